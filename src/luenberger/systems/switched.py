"""Plants with several modes: a tuple of frozen plants, and the measured signal that says which of them holds."""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from luenberger.core import BadInput
from luenberger.core.checks import finite_array
from luenberger.systems.system import System

# What has to be one in all modes, so that one state, one input and one output are spoken of.
_SHARED = ("dt", "states", "inputs", "outputs", "nd", "nv", "noise_bound", "disturbance_bound", "scheduling_names")


class Switched(eqx.Module):
    """A switched plant: x+ = A_i x + B_i u + E_i d, y = C_i x + G_i v in mode i, which a measured signal selects.

    Choose it where one plant does not fit the whole drive but a few do, e.g. a car at low, medium and high speed. A plant without
    modes is a switched plant with one, see `Switched.of`.

    Args:
        modes: plants with the same signals, bounds, sample time and scheduling parameters.
        signal: measured signal that selects the mode; empty where there is only one.
        ends: limits of the modes, one more than there are modes; mode i holds where ends[i] <= signal < ends[i + 1].
        dwell: least number of samples between two switches that is trusted; 1 for any switching.
        unit: unit of the signal.
    """

    modes: tuple[System, ...]
    signal: str = eqx.field(static=True)
    ends: tuple[float, ...] = eqx.field(static=True)
    dwell: int = eqx.field(static=True)
    unit: str = eqx.field(static=True)

    @staticmethod
    def of(
        modes: "System | Sequence[System] | Switched",
        signal: str = "mode",
        ends: Sequence[float] | None = None,
        *,
        dwell: int = 1,
        unit: str = "",
    ) -> "Switched":
        """Check the modes and put them together.

        Args:
            modes: plants, e.g. `[plant.freeze(speed=v, inverse_speed=1 / v) for v in (8.5, 13.5, 18.0)]`; one plant, or a switched
                plant, is taken as it is.
            signal: name of the measured signal that selects the mode.
            ends: its limits, one more than there are modes, rising; left out: the signal is the number of the mode, 0, 1, ...
            dwell: least number of samples between two switches.
            unit: unit of the signal.

        Raises:
            BadInput: no mode, modes that do not share signals, bounds or sample time, limits that do not rise, a dwell below 1.
        """
        if isinstance(modes, Switched):
            return modes
        plants = (modes,) if isinstance(modes, System) else tuple(modes)
        if not plants:
            raise BadInput("A switched plant has no modes; give at least one `System`.")
        for what in _SHARED:
            values = [getattr(p, what) for p in plants]
            if any(v != values[0] for v in values):
                raise BadInput(f"The modes differ in `{what}`: {values}; all modes need the same.")
        if dwell < 1:
            raise BadInput(f"`dwell` is {dwell}; at least one sample lies between two switches.")
        if len(plants) == 1:
            return Switched(plants, "", (), dwell, "")
        given = [k - 0.5 for k in range(len(plants) + 1)] if ends is None else ends
        limits = finite_array("ends", given)
        if limits.shape != (len(plants) + 1,) or (np.diff(limits) <= 0).any():
            raise BadInput(f"`ends` is {limits.tolist()}; {len(plants)} modes need {len(plants) + 1} rising limits.")
        return Switched(plants, signal, tuple(limits.tolist()), dwell, unit)

    @property
    def first(self) -> System:
        """The first mode, for all that the modes share."""
        return self.modes[0]

    @property
    def name(self) -> str:
        """How the plant is called."""
        return self.first.name if len(self.modes) == 1 else f"{self.first.name}, {len(self.modes)} modes"

    @property
    def scheduling_names(self) -> tuple[str, ...]:
        """The order of every vector r: what schedules the modes, then the signal that selects them unless it is among these."""
        names = self.first.scheduling_names
        return names if not self.signal or self.signal in names else (*names, self.signal)

    @property
    def nr(self) -> int:
        """Number of measured scheduling signals, that of the modes included."""
        return len(self.scheduling_names)

    @property
    def transitions(self) -> tuple[tuple[int, int], ...]:
        """All pairs (from, to) of modes, staying included."""
        return tuple((i, j) for i in range(len(self.modes)) for j in range(len(self.modes)))

    def mode(self, r: Any) -> jax.Array:
        """Return the number of the mode at a scheduling vector, an integer; outside all limits the nearest mode.

        Args:
            r: shape (nr,), in the order of `scheduling_names`.

        Raises:
            BadInput: r of the wrong length.
        """
        if len(r) != self.nr:
            raise BadInput(
                f"`r` has {len(r)} entries but `{self.name}` needs {list(self.scheduling_names)}; give one for each."
            )
        if not self.signal:
            return jnp.asarray(0)
        value = jnp.asarray(r[self.scheduling_names.index(self.signal)])
        return sum(((value >= end).astype(int) for end in self.ends[1:-1]), jnp.asarray(0))

    def within(self, r: Any) -> Any:
        """Return the part of a scheduling vector that the matrices of the modes take, shape (nr of a mode,).

        Args:
            r: shape (nr,), in the order of `scheduling_names`.
        """
        return r[: self.first.nr]
