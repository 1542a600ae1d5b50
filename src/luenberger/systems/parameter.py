"""Named parameters of a plant: measured scheduling and unmeasured uncertainty, each with the interval we trust."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from luenberger.core import BadInput

RateLaw = tuple[tuple[float, tuple[tuple[str, int], ...]], ...]


@dataclass(frozen=True)
class Parameter:
    """One scheduling parameter (measured at run time) or uncertainty (never measured).

    Args:
        name: ASCII name, the key in matrix polynomials.
        lower: lower end of the trusted interval.
        upper: upper end of the trusted interval.
        unit: SI unit as text.
        measured: True for scheduling, False for uncertainty.
        rate: largest |d parameter/dt| [unit/s], or None where no bound is trusted.
        error: largest offset of a measured scheduling parameter from the true one [unit].
        factor: interval of measured / true of a scheduling parameter; (0.9, 1.1) is a scale error of ten percent.
        rate_law: exact d parameter/dt where it follows from other parameters, as monomials
            (coefficient, ((name, power), ...)); 1/vx has ((-1.0, (("inverse_speed", 2), ("acceleration", 1))),).

    Raises:
        BadInput: ends not finite or inverted, negative rate or error, a factor interval that leaves out one.
    """

    name: str
    lower: float
    upper: float
    unit: str = ""
    measured: bool = True
    rate: float | None = None
    error: float = 0.0
    factor: tuple[float, float] = (1.0, 1.0)
    rate_law: RateLaw | None = None

    def __post_init__(self) -> None:
        if not (math.isfinite(self.lower) and math.isfinite(self.upper) and self.lower <= self.upper):
            raise BadInput(
                f"Parameter `{self.name}` has the interval [{self.lower}, {self.upper}] {self.unit}; finite ends with lower <= upper are needed."
            )
        if (self.rate is not None and not self.rate >= 0) or not self.error >= 0:
            raise BadInput(
                f"Parameter `{self.name}` has rate {self.rate} and error {self.error}; both need to be >= 0."
            )
        if not (0 < self.factor[0] <= 1 <= self.factor[1] < math.inf):
            raise BadInput(
                f"Parameter `{self.name}` is measured with a factor in {list(self.factor)}; 0 < lower <= 1 <= upper is needed."
            )

    @property
    def is_exact(self) -> bool:
        """True where the measured value is the true one."""
        return self.error == 0.0 and self.factor == (1.0, 1.0)

    @property
    def middle(self) -> float:
        """Midpoint of the interval, the nominal value of an uncertainty."""
        return 0.5 * (self.lower + self.upper)

    @property
    def interval(self) -> tuple[float, float]:
        """(lower, upper)."""
        return (self.lower, self.upper)


def box(parameters: Sequence[Parameter]) -> dict[str, tuple[float, float]]:
    """Return name -> (lower, upper) for the given parameters."""
    return {p.name: p.interval for p in parameters}
