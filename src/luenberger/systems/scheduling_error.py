"""How the scheduling an observer reads differs from the scheduling the plant obeys, and how fast the true one moves.

Both are written as polynomials of free parameters p on a box, so that correlations survive: with a speed read as
(1 + e1) vx, the free parameters 1/vx and 1/(1 + e1) give true = 1/vx and measured = 1/vx * 1/(1 + e1).
"""

from collections.abc import Mapping, Sequence

import equinox as eqx
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.core import BadInput, NotAccepted
from luenberger.systems.parameter import Parameter


class SchedulingError(eqx.Module):
    """True and measured scheduling as polynomials of free parameters.

    Choose it by hand where parameters of a plant depend on each other (1/vx and ax/vx on a trapezoid); independent
    offsets and factors are stated in `Parameter` and collected by `SchedulingError.of`.

    Args:
        true: scheduling name -> polynomial (1, 1).
        measured: scheduling name -> polynomial (1, 1).
        box: free parameter -> interval.

    Raises:
        BadInput: different names, polynomials that are not scalar, a free parameter without an interval.
    """

    true: dict[str, Polynomial]
    measured: dict[str, Polynomial]
    intervals: tuple[tuple[str, float, float], ...] = eqx.field(static=True)

    def __init__(
        self,
        true: Mapping[str, Polynomial],
        measured: Mapping[str, Polynomial],
        box: Mapping[str, tuple[float, float]],
    ):
        self.true, self.measured = dict(true), dict(measured)
        self.intervals = tuple((n, float(lower), float(upper)) for n, (lower, upper) in box.items())
        if set(self.true) != set(self.measured):
            raise BadInput(f"`true` names {sorted(self.true)}, `measured` {sorted(self.measured)}; give both for each.")
        for name, value in [*self.true.items(), *self.measured.items()]:
            if value.shape != (1, 1):
                raise BadInput(
                    f"The scheduling `{name}` has shape {value.shape}; a scalar polynomial (1, 1) is needed."
                )
            if missing := set(value.names) - set(box):
                raise BadInput(
                    f"The scheduling `{name}` depends on {sorted(missing)}, which the box leaves out; add them."
                )

    @staticmethod
    def of(parameters: Sequence[Parameter]) -> "SchedulingError | None":
        """Return measured = factor * true + offset, every factor and offset a free parameter; None where all is exact.

        Args:
            parameters: measured parameters of a plant.
        """
        if all(p.is_exact for p in parameters):
            return None
        true = {p.name: _named(p.name) for p in parameters}
        measured, box = dict(true), {p.name: p.interval for p in parameters}
        for p in parameters:
            if p.factor != (1.0, 1.0):
                measured[p.name] = measured[p.name] * _named(f"{p.name}_factor")
                box[f"{p.name}_factor"] = p.factor
            if p.error:
                measured[p.name] = measured[p.name] + _named(f"{p.name}_offset")
                box[f"{p.name}_offset"] = (-p.error, p.error)
        return SchedulingError(true, measured, box)

    @property
    def box(self) -> dict[str, tuple[float, float]]:
        """Free parameter -> interval."""
        return {name: (lower, upper) for name, lower, upper in self.intervals}

    def require(self, names: Sequence[str]) -> None:
        """Refuse a map that is not about exactly these scheduling names.

        Args:
            names: scheduling names of the plant.

        Raises:
            BadInput: names differ.
        """
        if set(self.true) != set(names):
            raise BadInput(
                f"The scheduling error names {sorted(self.true)} but the plant is scheduled by {sorted(names)}."
            )


def scheduling_rates(parameters: Sequence[Parameter]) -> tuple[dict[str, Polynomial], dict[str, tuple[float, float]]]:
    """Return d r/dt of every scheduling parameter that has a rate, and the box of the free rates.

    A rate law gives the polynomial itself; a rate bound gives a free parameter `<name>_rate`.

    Args:
        parameters: parameters of a plant.

    Raises:
        NotAccepted: a rate law names a parameter that the plant does not have.
    """
    names = {p.name for p in parameters}
    rates: dict[str, Polynomial] = {}
    box: dict[str, tuple[float, float]] = {}
    for p in parameters:
        if p.rate_law is not None:
            used = tuple(dict.fromkeys(n for _, powers in p.rate_law for n, _ in powers))
            if unknown := set(used) - names:
                raise NotAccepted(f"The rate law of `{p.name}` names {sorted(unknown)}; the plant has {sorted(names)}.")
            terms = {tuple(dict(powers).get(n, 0) for n in used): np.array([[float(c)]]) for c, powers in p.rate_law}
            rates[p.name] = Polynomial(used, terms)
        elif p.rate is not None:
            rates[p.name] = _named(f"{p.name}_rate")
            box[f"{p.name}_rate"] = (-p.rate, p.rate)
    return rates, box


def _named(name: str) -> Polynomial:
    return Polynomial((name,), {(1,): np.ones((1, 1))})
