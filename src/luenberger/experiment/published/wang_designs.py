"""Design values of Wang 2014, chapter 3: the levels of (3.41), (3.43), (3.52), (3.53), and the printed gains analysed.

No level is printed. The printed gains are analysed instead, and the infimum of every problem is found without a gain in it; beside both
stand the numbers of an independent implementation.
"""

from collections.abc import Iterator
from itertools import chain, product
from typing import Any

import numpy as np
from scipy.linalg import solve_continuous_lyapunov

from luenberger.algebra import Polynomial
from luenberger.certify import certify_claims
from luenberger.core import Outcome
from luenberger.experiment.published.row import INDEPENDENT, Row, compared, judged
from luenberger.experiment.published.wang_gains import FEASIBLE, H2, H2_FREE, HINF, HINF_FREE, NONE
from luenberger.experiment.published.wang_models import model_rows
from luenberger.experiment.published.wang_plants import Hull, Reading, theta_gain, theta_model, theta_plant
from luenberger.lmi.problem import installed_solvers
from luenberger.methods.robust_bound import gamma_star
from luenberger.methods.robust_inequality import GivenGain, Norm
from luenberger.methods.robust_luenberger import RobustLuenberger
from luenberger.methods.unstructured import UnstructuredObserver
from luenberger.synthesize import synthesize
from luenberger.systems import System
from luenberger.systems.error_system import ErrorSystem

Parts = tuple[tuple[float, float], ...]
NORMS: tuple[Norm, ...] = ("h2", "l2")
WORDS = {"h2": "H2", "l2": "H-infinity"}
# (hull, norm) -> infimum of the Luenberger and of the unstructured problem, of the Luenberger problem driven by (x, u), and L1/L2.
TABLE: dict[tuple[Hull, Norm], tuple[float, float, float, float]] = {
    ("independent", "h2"): (0.56165, 0.49995, 0.52803, -1.0381),
    ("independent", "l2"): (0.229197, 0.20867, 0.22614, -1.0381),
    ("joint", "h2"): (0.54782, 0.47966, 0.51724, -1.043),
    ("joint", "l2"): (0.22171, 0.19880, 0.21739, -1.042),
}

# Printed gain, units of the part of the error that y shows, row two turned or not, level there and its relative tolerance.
_PRINTED: tuple[tuple[str, str, Parts, Norm, float, bool, float, float], ...] = (
    ("H2 Luenberger gain", "(3.41)", H2, "h2", 100.0, True, 0.567, 0.01),
    ("H2 Luenberger gain", "(3.41)", H2, "h2", 100.0, False, 28.6, 0.01),
    ("H-infinity Luenberger gain", "(3.43)", HINF, "l2", 10.0, True, 0.229197, 0.001),
    ("H-infinity Luenberger gain", "(3.43)", HINF, "l2", 10.0, False, 9.2, 0.01),
    ("gain zero", "(3.41)", NONE, "h2", 10.0, True, 0.7852, 0.001),
    ("gain zero", "(3.43)", NONE, "l2", 10.0, True, 0.2319, 0.001),
    ("feasibility gain", "(3.27)", FEASIBLE, "h2", 10.0, True, 3.96, 0.005),
    ("feasibility gain", "(3.27)", FEASIBLE, "l2", 10.0, True, 8.19, 0.005),
)
_FREE: tuple[tuple[Reading, Norm, Any, str, float], ...] = (
    ("measured", "h2", H2_FREE, "(3.52)", 0.5323),
    ("measured", "l2", HINF_FREE, "(3.53)", 0.22139),
    ("true", "h2", H2_FREE, "(3.52)", 0.5530),
    ("true", "l2", HINF_FREE, "(3.53)", 0.2443),
)
# What counts, hull -> level and gain of the well-posed H2 problem.
_FINITE: dict[tuple[str, Hull], tuple[float, tuple[float, float]]] = {
    ("y-error", "independent"): (0.67883, (36.93, -35.84)),
    ("y-error", "joint"): (0.66743, (37.01, -35.75)),
    ("noise", "independent"): (0.7125, (19.48, -18.95)),
    ("noise", "joint"): (0.7000, (19.3, -18.7)),
}
_FROZEN: tuple[tuple[Norm, Parts, float, float], ...] = (("h2", H2, 0.5619, 0.5720), ("l2", HINF, 0.1318, 0.2294))


def design_rows() -> Iterator[Row]:
    """Yield the rows of levels, printed gains, finite gains, frozen norms, designs made here, and model and hull."""
    return chain(level_rows(), printed_rows(), finite_rows(), frozen_rows(), own_rows(), model_rows())


def level_rows() -> Iterator[Row]:
    """Infima of the four problems on both hulls, with the direction of large gains."""
    for (hull, norm), (structured, free, exogenous, ratio) in TABLE.items():
        plant, word = theta_plant(hull), f"{WORDS[norm]}, {hull} hull"
        number = {"h2": ("(3.41)", "(3.52)"), "l2": ("(3.43)", "(3.53)")}[norm]
        luenberger = gamma_star(plant, norm)
        yield compared(
            f"smallest level of a Luenberger observer, {word}",
            number[0],
            structured,
            luenberger.level,
            "Projected on ker C.",
        )
        ours = gamma_star(plant, norm, structure="unstructured").level
        yield compared(
            f"smallest level of an unstructured observer, {word}", number[1], free, ours, "theta_m = theta - theta_D."
        )
        ours = gamma_star(plant, norm, form="plant").level
        yield compared(
            f"smallest level of a Luenberger observer driven by (x, u), {word}",
            number[0],
            exogenous,
            ours,
            "The dissertation lets (xhat, u) drive the error; x does not depend on the gain.",
        )
        assert luenberger.direction is not None
        yield judged(
            f"L1 / L2 of large gains, {word}",
            f"{number[0]}, {INDEPENDENT}",
            f"{ratio:.4f}",
            f"{luenberger.direction:.4f}",
            "The size of the gain is unbounded at the infimum and not unique, its direction is. "
            "The printed gains have -1.0414 (H2) and -1.0381 (H-infinity) with row two turned.",
            reproduced=abs(luenberger.direction - ratio) <= 0.003,
            deviation=abs(luenberger.direction - ratio),
        )


def printed_rows() -> Iterator[Row]:
    """The printed gains in the inequalities that they are printed for, each level proved two percent above its square."""
    plant = theta_plant()
    for word, number, parts, norm, unit, flipped, expected, within in _PRINTED:
        given = GivenGain(plant, theta_gain(parts, flipped=flipped), norm, form="estimate", coordinates=sheared(unit))
        turned = "" if parts is NONE else ", row two turned" if flipped else ", as printed"
        yield _analysed(f"{WORDS[norm]} level of the {word}{turned}", number, given, expected, within)
    for reading, norm, parts, number, expected in _FREE:
        vertices = "(theta_m, theta_D)" if reading == "measured" else "(theta, theta_D)"
        word = f"{WORDS[norm]} level of the unstructured observer, vertices taken for {vertices}"
        yield _analysed(word, number, _free(reading, norm, parts), expected, 0.01)
    yield _vertices()
    yield _convergence(plant)


def finite_rows() -> Iterator[Row]:
    """Where large gains cost, the optimum is attained and every solver finds it."""
    solvers = [s for s in installed_solvers() if s in ("CLARABEL", "CVXOPT")]
    for (kind, hull), (level, entries) in _FINITE.items():
        wrong = kind == "y-error"
        plant = theta_plant(hull, output="slip_constraint") if wrong else theta_plant(hull, noise=0.1)
        method = RobustLuenberger("h2", "scheduling" if wrong else "scheduling+noise", form="estimate")
        found = [method.optimum(plant, (solver,)) for solver in solvers]
        gains = [np.asarray(f.gain({"theta1": 0.0, "theta2": 0.0})).ravel() for f in found]
        spread = max(abs(found[0].level / found[-1].level - 1), float(np.abs(gains[0] / gains[-1] - 1).max()))
        what = "the error of vx in y counted" if wrong else "noise of 0.1 on y, y exact in vx"
        near = abs(found[0].level / level - 1) <= 1e-3 and np.allclose(gains[0], entries, rtol=0.01)
        yield judged(
            f"H2 Luenberger with one gain, {what}, {hull} hull",
            f"(3.34), (3.41), {INDEPENDENT}",
            f"{level:g} / ({entries[0]:g}, {entries[1]:g})",
            f"{found[0].level:.5f} / ({gains[0][0]:.2f}, {gains[0][1]:.2f})",
            f"{' and '.join(solvers)} agree within {spread:.1e}. (3.34) leaves out -L wb r theta_D1, since y is computed from the measured "
            "speed; with it, or with noise, the optimum has a finite gain.",
            reproduced=bool(near) and spread <= 0.01,
            deviation=abs(found[0].level - level),
        )
    flat = RobustLuenberger("l2", form="estimate").optimum(theta_plant(output="slip_constraint")).level
    yield compared(
        "H-infinity Luenberger with one gain, the error of vx in y counted, independent hull",
        "(3.43)",
        0.22920,
        flat,
        "The same level as without that error: the problem is flat and any small gain will do.",
    )


def frozen_rows() -> Iterator[Row]:
    """Norms at the sixteen frozen vertices; a common storage cannot promise less than the worst of them."""
    for norm, parts, expected, level in _FROZEN:
        worst = max(frozen_norms(theta_plant(), theta_gain(parts), norm))
        yield judged(
            f"largest frozen {WORDS[norm]} norm of the printed Luenberger gain over the sixteen vertices, row two turned",
            f"(3.72), {INDEPENDENT}",
            f"{expected:.4f}",
            f"{worst:.4f}",
            "Below the level of the common storage, as it must be: by a Lyapunov equation and a sweep of frequencies. "
            + (
                "The H2 level is tight."
                if norm == "h2"
                else "Fast scheduling costs the rest of the H-infinity level, or seems to."
            ),
            reproduced=abs(worst - expected) <= 0.001 * expected and worst <= level,
            deviation=abs(worst - expected),
        )


def own_rows() -> Iterator[Row]:
    """What this library designs: two percent above the infimum, smallest gain or nearest model, proved on the joint hull."""
    plant = theta_plant("joint")
    for norm, method in product(NORMS, (RobustLuenberger, UnstructuredObserver)):
        made = method(norm, form="estimate") if method is RobustLuenberger else method(norm)
        design = synthesize(plant, made)
        claim, bound = (
            next(c for c in design.certificate.claims if c.kind == k) for k in (f"{norm}_gain", "gain_bound")
        )
        word = "Luenberger" if method is RobustLuenberger else "unstructured"
        yield judged(
            f"{WORDS[norm]} {word} design, joint hull: level and largest gain",
            "(3.41) to (3.53)",
            "-",
            f"{claim.level:.4f}, |L| <= {bound.level:.4g} 1/s",
            f"Level, decay and gain bound {design.certificate.outcome.value} in exact rationals over the whole box. "
            f"The smallest level is {design.statistics['gamma_star']:.4f}, two percent below; nearer to it gains grow like one over the "
            "distance. A gain of zero is what H-infinity leaves of a Luenberger observer.",
            reproduced=design.certificate.outcome is Outcome.PROVED,
        )


def frozen_norms(plant: System, gain: Polynomial, norm: Norm) -> list[float]:
    """Return the norm from (xhat, u) to e at every vertex, by other means than matrix inequalities.

    Args:
        plant: with its scheduling error.
        gain: L(theta).
        norm: which norm.
    """
    error = ErrorSystem.of(plant, gain, form="estimate")
    directions, found = error.joined("scheduling"), list[float]()
    grid = np.concatenate([[0.0], np.logspace(-3, 5, 600)])
    for ends in product(*error.box.values()):
        point = dict(zip(error.box, ends, strict=True))
        A, B = (np.asarray(m({n: point[n] for n in m.names})) for m in (error.A, directions))
        if norm == "h2":
            found.append(float(np.sqrt(np.trace(solve_continuous_lyapunov(A, -B @ B.T)))))
        else:
            found.append(max(float(np.linalg.norm(np.linalg.solve(1j * w * np.eye(2) - A, B), 2)) for w in grid))
    return found


def sheared(unit: float) -> np.ndarray:
    """Return coordinates (af + ar, af - ar), the second in units of 1 / unit, in which large gains are well posed.

    Args:
        unit: about the root of the gain.
    """
    return np.array([[1.0, 1.0], [1.0, -1.0]]) @ np.diag([1.0, 1 / unit])


def _free(reading: Reading, norm: Norm, parts: Any) -> GivenGain:
    plant, gain, copy = theta_model(parts, reading)
    return GivenGain(plant, gain, norm, form="estimate", model=copy, coordinates=sheared(50.0))


def _vertices() -> Row:
    """Which reading of the vertices the printed unstructured observers are near the optimum of."""
    near: dict[Reading, list[float]] = {}
    readings: tuple[Reading, ...] = ("measured", "true")
    for reading in readings:
        near[reading] = []
        for _, norm, parts, _, _ in _FREE[:2]:
            star = gamma_star(theta_plant(reading=reading), norm, structure="unstructured").level
            level = _free(reading, norm, parts).level()
            near[reading].append(np.inf if level is None else level / star - 1)
    (a, b), (c, d) = near["measured"], near["true"]
    return judged(
        "printed unstructured observers above the smallest level, H2 and H-infinity",
        "(3.52), (3.53), (3.72)",
        "1.0 %, 0.3 % as (theta_m, theta_D); 10.6 %, 17 % as (theta, theta_D)",
        f"{100 * a:.1f} %, {100 * b:.1f} %; {100 * c:.1f} %, {100 * d:.1f} %",
        "The vertices of (theta, theta_D) were put in as (theta_m, theta_D): inferred from how near the prints are to either optimum.",
        reproduced=False,
        corrected=a < 0.015 and b < 0.005 and c > 0.1 and d > 0.15,
    )


def _convergence(plant: System) -> Row:
    """Which sign of row two the feasibility gain has, by what is said of its convergence."""
    slowest = {}
    for flipped in (True, False):
        L, A = theta_gain(FEASIBLE, flipped=flipped), plant.polynomial("A")
        point = {"theta1": 3.6 / 150, "theta2": -8 * 3.6 / 150}
        slowest[flipped] = float(np.linalg.eigvals(A(point) - L(point) @ np.array([[1.0, -1.0]])).real.max())
    return judged(
        "slowest eigenvalue with the feasibility gain, 150 km/h, ax = -8 m/s^2: as printed, row two turned",
        "(3.27), Fig. 3.9",
        "converges",
        f"{slowest[False]:.2f}, {slowest[True]:.2f} 1/s",
        "Without correction it is -3.39. The turned gain, which all other prints need, would converge six times slower than none at all; "
        "as printed the gain lies almost along (1, 1), which y does not show, and does next to nothing. (3.27) is met by both and by L = 0.",
        reproduced=slowest[False] < -3.0,
        deviation=None,
    )


def _analysed(item: str, equation: str, given: GivenGain, expected: float, within: float) -> Row:
    level, claim = given.level(), given.claim()
    outcome = None if claim is None else certify_claims(given.system, given.gain, [claim], given.model).outcome
    proof = (
        "no proof" if claim is None or outcome is None else f"{claim.level:.5f} is {outcome.value} in exact rationals"
    )
    gap = np.inf if level is None else abs(level - expected)
    return judged(
        item,
        f"{equation}, {INDEPENDENT}",
        f"{expected:g}",
        "none" if level is None else f"{level:.5f}",
        f"Best common storage for the printed digits; {proof}. The print states no level; beside stands an independent implementation.",
        reproduced=gap <= within * expected and outcome is Outcome.PROVED,
        deviation=None if level is None else gap,
    )
