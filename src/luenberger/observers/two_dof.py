"""The correction observer with a second degree of freedom: the output error also enters the argument of f."""

from typing import Any

from luenberger.algebra import Polynomial
from luenberger.core import NotAccepted
from luenberger.observers.correction import CorrectionObserver, checked_gain
from luenberger.systems.system import System


class TwoDofObserver(CorrectionObserver):
    """Copy of the plant plus gain times output error, with the output error in the argument of f as well.

        zeta = xh + L2(r) (y - C(r) xh - D(r) u)
        dxh  = A(r) xh + B(r) u + F(r) f(H zeta, u) + L(r) (y - C(r) xh - D(r) u)      (xh+ for a discrete plant)

    Choose it where f depends on a state that is measured: L2 lets the measurement stand in for the estimate there, and the
    gains L that then suffice are smaller. Noise reaches f unfiltered, so L2 is limited by it. Where f depends on no
    measured direction, `CorrectionObserver` does as well. L is what multiplies the output error in the derivative, whatever
    shift of coordinates a design used.

    Everything else is as in `CorrectionObserver`: the estimate at sample k is the prediction for t_k, and u_k, y_k, r_k are
    held over the step. Under "rk4" zeta follows the estimate inside the step; under "exact" it is held with f.

    Args:
        system: plant with a nonlinearity, continuous or discrete.
        gain: L(r), shape (nx, ny): nested numbers or `Polynomial` in the scheduling parameters.
        argument_gain: L2(r), shape (nx, ny), in the same forms; zero gives `CorrectionObserver`.
        dt: sample time [s]; needed for a continuous plant, that of the plant for a discrete one.
        method: "rk4" or "exact"; a discrete plant uses its own map.
        substeps: parts of the step under "rk4"; None asks `substeps_needed`.
        clip_scheduling: clip r into the declared box before use.

    Raises:
        BadInput: gains of the wrong shape or with unknown parameters, dt missing or wrong, unknown method, or a closed
            loop too fast for Runge-Kutta at this sample time.
        NotAccepted: the plant has no nonlinearity, so there is no argument to correct.

    Reference: M. Arcak, P. Kokotovic, Nonlinear observers: a circle criterion design and robustness analysis, Automatica
        37 (2001), 1923-1930: injection into the argument of the nonlinearity.
    """

    argument_gain: Polynomial

    def __init__(
        self,
        system: System,
        gain: Any,
        argument_gain: Any,
        dt: float | None = None,
        *,
        method: str = "rk4",
        substeps: int | None = None,
        clip_scheduling: bool = False,
    ):
        if system.nonlinearity is None:
            raise NotAccepted(
                f"`{system.name}` has no nonlinearity whose argument a gain could correct; use `CorrectionObserver`."
            )
        self.argument_gain = checked_gain(system, argument_gain, "argument_gain")
        super().__init__(system, gain, dt, method=method, substeps=substeps, clip_scheduling=clip_scheduling)

    @property
    def _fed(self) -> Polynomial:
        return self.argument_gain
