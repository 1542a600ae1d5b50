"""A drive as the monitors of guaranteed estimators read it: shapes checked, gaps in the readings held, bounds of the mode at hand."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from luenberger.core import BadInput
from luenberger.core.checks import finite_array, known_keys
from luenberger.observers.monitor import Drive
from luenberger.observers.zonotopic_plant import by_mode
from luenberger.systems.switched import Switched


class SetLog:
    """The signals of a drive, checked against a plant with modes.

    Choose it to judge a log; `monitor_sets` is the user of it. `measured` and `true` hold signals by name, None where the drive
    leaves one out; `r` is the measured scheduling with the last finite reading held, `best_r` the true one where it is known, `at`
    C, D, G and N there by letter, `input` the true input where anything tells it.

    Args:
        plant: plant with its modes.
        drive: measured and true signals.
        true_input: true input, shape (nt, nu); None: from the measured one and the noise.

    Raises:
        BadInput: signals of the wrong shape, true ones that are not finite, unknown parameters.
    """

    def __init__(self, plant: Switched, drive: Drive, true_input: Any = None):
        first = plant.first
        self.time = finite_array("time", drive.time)
        self.plant, self.count = plant, self.time.size
        count = self.count
        shapes = {"r": plant.nr, "u": first.nu, "y": first.ny}
        self.measured = {
            n: np.zeros((count, 0))
            if getattr(drive, n) is None and size == 0
            else _shaped(n, getattr(drive, n), (count, size))
            for n, size in shapes.items()
        }
        self.read = [jnp.asarray(v) for n, v in self.measured.items() if v is not None and v.shape[1]]
        sizes = {"true_r": plant.nr, "x": first.nx, "noise": first.nv, "disturbance": first.nd}
        self.true = {n: _true(n, getattr(drive, n), (count, size)) for n, size in sizes.items()}
        known_keys("`uncertainty` of the drive", drive.uncertainty, list(first.uncertainty))
        self.uncertainty = {n: finite_array(n, v) for n, v in drive.uncertainty.items()}
        for name, values in self.uncertainty.items():
            _shaped(name, values, (count,))
        r = self.measured["r"]
        self.r = None if r is None else _held(r)
        self.best_r = self.r if self.true["true_r"] is None else self.true["true_r"]
        self.at = None if self.best_r is None else _matrices(plant, jnp.asarray(self.best_r))
        self.input = self._input(_true("true_input", true_input, (count, first.nu)))

    def _input(self, given: np.ndarray | None) -> np.ndarray | None:
        """The true input, None where nothing tells."""
        u, noise = self.measured["u"], self.true["noise"]
        if given is not None or u is None or self.at is None:
            return given
        if noise is not None:
            return u - np.einsum("kij,kj->ki", self.at["N"], noise)
        return None if np.any(self.at["N"]) else u

    @property
    def mode(self) -> np.ndarray | None:
        """Number of the mode that was measured at every sample."""
        return None if self.r is None else np.asarray(jax.vmap(self.plant.mode)(jnp.asarray(self.r)))

    def trusted(self, name: str) -> np.ndarray:
        """Return lower and upper end, error and the two factors of a parameter in the mode that holds, shape (5, nt).

        Args:
            name: of the parameter; without measured scheduling the widest of all modes.
        """
        found = [next(p for p in mode.parameters if p.name == name) for mode in self.plant.modes]
        table = np.array([[p.lower, p.upper, p.error, *p.factor] for p in found])
        if self.mode is not None:
            return table[self.mode].T
        widest = np.where([True, False, False, True, False], table.min(axis=0), table.max(axis=0))
        return np.tile(widest[:, None], self.count)


@eqx.filter_jit
def _matrices(plant: Switched, r: jax.Array) -> dict[str, jax.Array]:
    """C, D, G, N at every sample."""

    def at(letter: str, r: jax.Array) -> jax.Array:
        return by_mode(plant, r, lambda k, s: plant.modes[k].at(letter, s))

    return jax.vmap(lambda one: {letter: at(letter, one) for letter in "CDGN"})(r)


def _held(values: np.ndarray) -> np.ndarray:
    """The last finite value where there is none; before the first, that one; zero where there is none at all."""
    out = np.array(values)
    for column in out.T:
        good = np.flatnonzero(np.isfinite(column))
        if good.size:
            column[:] = column[good[np.maximum(np.searchsorted(good, np.arange(column.size), side="right") - 1, 0)]]
        else:
            column[:] = 0.0
    return out


def _shaped(name: str, given: Any, shape: tuple[int, ...]) -> np.ndarray | None:
    if given is None:
        return None
    values = np.asarray(given, dtype=float)
    if values.shape != shape:
        raise BadInput(f"`{name}` of the drive has shape {values.shape}; {shape} is needed.")
    return values


def _true(name: str, given: Any, shape: tuple[int, ...]) -> np.ndarray | None:
    return None if given is None else _shaped(name, finite_array(name, given), shape)
