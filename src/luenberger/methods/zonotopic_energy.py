"""Constant gains for guaranteed estimates by a matrix inequality: least segments (Nom-G) and least energy gain (Hinf-G)."""

from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial, symmetric
from luenberger.lmi import Block, Problem, centre, infeasible
from luenberger.methods.method import Candidate, statistics
from luenberger.methods.zonotopic_plant import DrivenError, require_driven, steady_claims
from luenberger.systems import System


@dataclass(frozen=True)
class SegmentGain:
    """Constant predictor gain whose steady generators have the least sum of squares; the class that CORA calls Nom-G.

    Choose it for a gain without tuning that treats all generators alike. It is the stationary gain of `ZonotopicKalmanFilter`
    without order reduction; the box can be far from the narrowest, which `SteadyWidth` finds.

    Assumes: x+ = A x + B u + E d, y = C x + D u + G v, u measured as u + N v, constant matrices, |d| <= disturbance_bound,
    |v| <= noise_bound.
    Certifies: see `SteadyWidth`.

    Posed as: least trace Z with [[P, P F, P M], [., P, 0], [., 0, I]] >= 0 and [[Z, I], [I, P]] >= 0, F = A - L C and M the
    generators of disturbance and noise, Y = P L: then P^-1 is no less than the sum of all F^k M M' F^k'.

    Reference: C. Combastel, Zonotopes and Kalman observers, Automatica 55 (2015) 265-273, section 4 (Frobenius norm of the
    generators); the name of the class from M. Althoff, J. Rath, Automatica 130 (2021) 109662. The stationary inequality is the
    textbook one of H2 filtering; the design behind the published numbers of that class differs from it.

    Example:
        >>> import luenberger as lb
        >>> from luenberger.methods.zonotopic_energy import SegmentGain
        >>> plant = lb.System.linear(
        ...     [[1.0]], C=[[1.0]], E=[[1.0]], dt=0.1, disturbance_bound=[1.0], noise_bound=[1.0])
        >>> gain = SegmentGain().design(plant).gain({})
        >>> bool(abs(gain[0, 0] - 0.618) < 0.02)
        True
    """

    references: ClassVar[tuple[str, ...]] = (
        "C. Combastel, Zonotopes and Kalman observers, Automatica 55 (2015) 265-273",
        "M. Althoff, J. Rath, Comparison of guaranteed state estimators for linear time-invariant systems, "
        "Automatica 130 (2021) 109662",
    )

    def accept(self, system: System) -> None:
        """Refuse plants without a constant steady box; see `Method`."""
        require_driven(system)

    def design(self, system: System) -> Candidate:
        """Minimise the trace; see `Method`."""
        nx = system.nx
        P, Y, PF, PM = _closed(system)
        Z = cp.Variable((nx, nx), symmetric=True, name="Z")
        steady = symmetric([[P, PF, PM], [P, 0], [Polynomial.constant(np.eye(PM.shape[1]))]])
        bound = symmetric([[Polynomial.constant(Z), Polynomial.constant(np.eye(nx))], [P]])
        variables = {"P": P.terms[()], "Y": Y, "Z": Z}
        return _candidate(system, Problem(variables, [Block("steady", -steady), Block("trace", -bound)], cp.trace(Z)))


@dataclass(frozen=True)
class HInfinityGain:
    """Constant predictor gain with the least energy gain from disturbance and noise to the error; CORA's class Hinf-G.

    Choose it where the published interval estimators of that class are to be compared, or where energies matter; the least
    energy gain does not give the narrowest box, which `SteadyWidth` finds.

    Assumes: as `SegmentGain`; disturbance and noise are taken in units of their bounds.
    Certifies: see `SteadyWidth`. The energy gain itself is a way to the gain and is not claimed.

    Posed as: least g with [[-P + I, 0, F' P], [0, -g I, M' P], [P F, P M, -P]] < 0, Y = P L.

    Reference: W. Tang, Z. Wang, Y. Wang, T. Raissi, Y. Shen, Interval estimation methods for discrete-time linear time-invariant
    systems, IEEE Trans. Autom. Control 64 (2019) 4717-4724: design of the gain by an inequality, box by propagated zonotopes.
    The inequality here is the textbook bounded real lemma.

    Example:
        >>> import luenberger as lb
        >>> from luenberger.methods.zonotopic_energy import HInfinityGain
        >>> plant = lb.System.linear(
        ...     [[0.5]], C=[[1.0]], E=[[1.0]], dt=0.1, disturbance_bound=[1.0], noise_bound=[1.0])
        >>> HInfinityGain().design(plant).gain({}).shape
        (1, 1)
    """

    references: ClassVar[tuple[str, ...]] = (
        "W. Tang, Z. Wang, Y. Wang, T. Raissi, Y. Shen, Interval estimation methods for discrete-time linear time-invariant "
        "systems, IEEE Trans. Autom. Control 64 (2019) 4717-4724",
        "M. Althoff, J. Rath, Comparison of guaranteed state estimators for linear time-invariant systems, "
        "Automatica 130 (2021) 109662",
    )

    def accept(self, system: System) -> None:
        """Refuse plants without a constant steady box; see `Method`."""
        require_driven(system)

    def design(self, system: System) -> Candidate:
        """Minimise the energy gain; see `Method`."""
        P, Y, PF, PM = _closed(system)
        squared = cp.Variable(name="squared")
        size = Polynomial.constant(-squared * np.eye(PM.shape[1]))
        real = symmetric([[Polynomial.constant(np.eye(system.nx)) - P, 0, PF.T], [size, PM.T], [-P]])
        variables = {"P": P.terms[()], "Y": Y, "squared": squared}
        return _candidate(system, Problem(variables, [Block("storage", -P), Block("energy", real)], squared))


def _closed(system: System) -> tuple[Polynomial, cp.Variable, Polynomial, Polynomial]:
    """P, Y = P L, P (A - L C) and P M, M the generators of disturbance and noise."""
    error = DrivenError.of(system)
    P = cp.Variable((system.nx, system.nx), symmetric=True, name="P")
    Y = cp.Variable((system.nx, system.ny), name="Y")
    drive = P @ error.base - Y @ error.seen
    return Polynomial.constant(P), Y, Polynomial.constant(P @ error.A - Y @ error.C), Polynomial.constant(drive)


def _candidate(system: System, problem: Problem) -> Candidate:
    found = centre(problem, back_off=1e-3)
    if found is None:
        raise infeasible(problem, "", None, "", None)
    L = np.linalg.solve(found.values["P"], found.values["Y"])
    facts: dict[str, Any] = statistics(found) | {"box": DrivenError.of(system).box(L).tolist()}
    return Candidate(Polynomial.constant(L), partial(steady_claims, system), facts)
