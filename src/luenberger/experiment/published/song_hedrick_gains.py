"""Observer gains and disturbance gains of Song and Hedrick 2011, printed and recomputed."""

from collections.abc import Iterator

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.core import Infeasible, Outcome
from luenberger.experiment.published.flexible_joint import PRINTED_GAINS, TRANSFORM, Direction, flexible_joint
from luenberger.experiment.published.row import Row, judged
from luenberger.lmi import SOLVERS, Block, Problem, solve
from luenberger.methods.lipschitz_algorithm import lipschitz_algorithm
from luenberger.methods.lipschitz_bracket import largest_epsilon
from luenberger.methods.lipschitz_disturbance import LipschitzDisturbance
from luenberger.methods.lipschitz_gain import disturbance_bound, disturbance_gain, disturbed, least_disturbance_gain
from luenberger.methods.lipschitz_pareto import LipschitzPareto
from luenberger.methods.lipschitz_plant import LumpedPlant
from luenberger.methods.lipschitz_riccati import LipschitzRiccati
from luenberger.methods.structured_lipschitz import StructuredLipschitz
from luenberger.synthesize import synthesize

# Four decimals are printed for L1 and L2; L4 has five significant digits, so its largest entry carries half a thousandth.
FOUR_DECIMALS = 5.1e-5
FIVE_DIGITS = 5.1e-4


def gain_rows() -> Iterator[Row]:
    """Yield the rows of L1 to L4, of the disturbance gains kappa, of Figure 4 and of the smallest gains."""
    yield _riccati("L1", 0.1)
    yield _riccati("L2", 1.0)
    yield _third()
    yield from _fourth()
    yield from _disturbance_gains()
    yield from _pareto()
    yield _smallest_eigenvalue()
    yield _algorithm()
    for rate in (0.0, 1.0):
        yield _structured(rate)
    yield judged(
        "L2 resembles the gain of Rajamani and Cho 1998",
        "Step 3",
        "quite similar",
        "-",
        "The gain it is compared with is not printed.",
        reproduced=False,
    )


def attained_gains() -> dict[str, np.ndarray]:
    """Return solver -> the gain it reports for "minimise kappa^2 alone", the problem behind the printed L3."""
    plant = LumpedPlant.of(flexible_joint("motor_angle"), TRANSFORM)
    n, constant = plant.nx, Polynomial.constant
    P, squared = cp.Variable((n, n), symmetric=True), cp.Variable()
    corner = P @ plant.A + plant.A.T @ P + (1 + plant.lipschitz**2) * np.eye(n) - plant.C.T @ plant.C / 0.1
    blocks = [Block("storage", constant(-P)), Block("l2_gain", disturbed(P, corner, -np.eye(n), plant.E, squared))]
    problem = Problem({"P": P, "squared": squared}, blocks, squared)
    found = {
        name: solve(problem, solvers=[name]) for name in SOLVERS if name in cp.installed_solvers() and name != "SCS"
    }
    return {name: plant.gain(s.values["P"], 0.1) for name, s in found.items() if s is not None}


def _riccati(name: str, epsilon: float) -> Row:
    plant, printed = flexible_joint("none"), PRINTED_GAINS[name]
    design = synthesize(plant, LipschitzRiccati(epsilon, TRANSFORM))
    deviation = float(np.abs(design.gain_at() - printed).max())
    other = synthesize(plant, LipschitzRiccati(epsilon, TRANSFORM, "sdp")).gain_at()
    spread = float(np.abs(other - design.gain_at()).max())
    return judged(
        f"Gain {name}, epsilon = {epsilon:g}",
        "(26), (33)",
        _numbers(printed),
        f"{_numbers(design.gain_at())}; lmin(P) = {design.statistics['smallest_eigenvalue']:.6f}",
        f"Largest solution of the Riccati equation; the difference is the rounding of the print. The semidefinite programme differs by {spread:.1e}. "
        f"Certificate: {design.certificate.outcome.value}.",
        reproduced=deviation <= FOUR_DECIMALS and design.certificate.outcome is Outcome.PROVED,
        deviation=deviation,
    )


def _third() -> Row:
    found = attained_gains()
    least = least_disturbance_gain(flexible_joint("printed"), 0.1, TRANSFORM)
    listed = ", ".join(f"{name}: L11 = {L[0, 0]:.4g}" for name, L in found.items())
    return judged(
        "Gain L3",
        "(34), Step 4",
        _numbers(PRINTED_GAINS["L3"]),
        f"{listed}; with the printed B_d inf kappa = {least:.6f}",
        "It minimises kappa alone, which is delta = 1 in (34), not delta = 0. The infimum is not attained: P becomes singular and the gain grows "
        "without bound, so the printed entries are where one solver stopped.",
        reproduced=any(np.abs(L / PRINTED_GAINS["L3"] - 1).max() < 1e-2 for L in found.values()),
    )


def _fourth() -> Iterator[Row]:
    printed, method = PRINTED_GAINS["L4"], LipschitzDisturbance(0.1, 0.2, TRANSFORM)
    words: dict[Direction, str] = {"printed": "B_d = (0, 2, 0, 0) as printed", "motor_angle": "B_d = (1, 0, 0, 0)"}
    for direction, word in words.items():
        design = synthesize(flexible_joint(direction), method)
        gain = design.gain_at()
        deviation = float(np.abs(gain - printed).max())
        matches = deviation <= FIVE_DIGITS and design.certificate.outcome is Outcome.PROVED
        yield judged(
            f"Gain L4, epsilon = 0.1, delta = 0.2, {word}",
            "(30), (34)",
            _numbers(printed),
            f"{_numbers(gain)}; kappa = {design.statistics['disturbance_gain']:.6f}, lmin(P) = {design.statistics['smallest_eigenvalue']:.6f}",
            "Every printed digit is obtained with the disturbance on the motor angle and (34) as printed. That the authors ran this B_d is an "
            "inference: b times it, with kappa^2 weighted by 1 / b^2, gives the same gain."
            if matches
            else "With the printed B_d the optimum is this other, certified gain; the print is matched by B_d = (1, 0, 0, 0), see the next row.",
            reproduced=matches,
            corrected=design.certificate.outcome is Outcome.PROVED,
            deviation=deviation,
        )


def _disturbance_gains() -> Iterator[Row]:
    plant = flexible_joint("printed")
    kappas = {name: disturbance_gain(plant, L, TRANSFORM) for name, L in PRINTED_GAINS.items()}
    claims = {
        "L3": ("the smallest", kappas["L3"] == min(kappas.values())),
        "L4": ("between L3 and L1", kappas["L3"] < kappas["L4"] < kappas["L1"]),
    }
    for name, gain in PRINTED_GAINS.items():
        original = disturbance_gain(plant, gain, TRANSFORM, "original")
        proved = [float(disturbance_bound(plant, gain, TRANSFORM, norm)) ** 0.5 for norm in ("transformed", "original")]
        printed, holds = claims.get(name, ("-", False))
        yield judged(
            f"kappa of the printed {name}, printed B_d",
            "(30)",
            printed,
            f"{kappas[name]:.5f} for |T e|, {original:.5f} for |e|; proved <= {proved[0]:.5f} and <= {proved[1]:.5f}",
            "Smallest over storage matrix and multiplier; the upper bounds hold in rational arithmetic."
            + ("" if name in claims else " No value is printed to compare with."),
            reproduced=holds,
        )


def _pareto() -> Iterator[Row]:
    plant = flexible_joint("none")
    front: list[tuple[float, float, float, float]] = []
    edge = 0.0
    for delta in (0.1, 0.2, 0.3, 0.5, 0.7, 0.9, 0.95, 0.99):
        try:
            made = LipschitzPareto(delta, 0.0, TRANSFORM).design(plant)
        except Infeasible as refusal:
            edge = refusal.nearest or edge
            continue
        largest = float(np.abs(np.asarray(made.gain({}))).max())
        front.append((delta, made.statistics["sigma"], made.statistics["smallest_eigenvalue"], largest))
    ratios = [low / sigma for _, sigma, low, _ in front]
    yield judged(
        "Fig. 4, 1/epsilon proportional to lmin(P) for delta = 0.1 to 0.99",
        "(27)",
        "proportional",
        "; ".join(f"delta {d:g}: sigma {s:.4f}, lmin {m:.5f}, max|L| {g:.3g}" for d, s, m, g in front),
        f"lmin(P) is concave in sigma: their ratio varies by a factor {max(ratios) / min(ratios):.0f}. Below delta = {edge:.3f} the optimum "
        "lies at the edge of feasibility, where P is singular, so delta = 0.1 gives no gain at all.",
        reproduced=max(ratios) / min(ratios) < 1.05,
        corrected=max(ratios) / min(ratios) > 2,
    )
    needed = 1 / largest_epsilon(plant, 0.333, TRANSFORM).feasible
    yield judged(
        "Lower bound sigma* = 1 / epsilon* in (27)",
        "(27)",
        f"{1 / 4.8329:.6f}",
        f"{needed:.6f}",
        "The inequality itself needs sigma above the second number, so the printed bound is never active.",
        reproduced=abs(needed - 1 / 4.8329) < 1e-5,
        corrected=needed > 1 / 4.8329,
        deviation=needed - 1 / 4.8329,
    )


def _smallest_eigenvalue() -> Row:
    plant = flexible_joint("none")
    made = {sigma: LipschitzRiccati(1 / sigma, TRANSFORM).design(plant) for sigma in (0.25, 1.0, 10.0)}
    largest = [float(np.abs(np.asarray(m.gain({}))).max()) for m in made.values()]
    eigenvalues = [m.statistics["smallest_eigenvalue"] for m in made.values()]
    return judged(
        "A large lmin(P) makes the gain small",
        "(26)",
        "yes",
        "; ".join(
            f"sigma {s:g}: lmin {m:.5f}, max|L| {g:.4f}" for s, m, g in zip(made, eigenvalues, largest, strict=True)
        ),
        "|L| <= |C| / (2 epsilon lmin(P)) at one epsilon, but along sigma both grow together; the smallest gain is another problem, see below.",
        reproduced=largest == sorted(largest, reverse=True),
        corrected=eigenvalues == sorted(eigenvalues) and largest == sorted(largest),
    )


def _algorithm() -> Row:
    report = lipschitz_algorithm(flexible_joint("motor_angle"), [None, TRANSFORM], epsilon=0.1, delta=0.2)
    first, last = report.tables[0], report.tables[-1]
    return judged(
        "The whole procedure: T = I fails, T = diag(1, 1, 1, 0.1) gives the gains",
        "Algorithm 1",
        "as printed, epsilon* = 4.8329",
        f"T = I: {first.feasible} of 20 grid points; T = diag{last.transform}: {last.feasible} of 20; epsilon* in [{report.bracket.feasible:.6f}, "
        f"{report.bracket.infeasible:.6f}]",
        "The steps are as printed; only the grid index of epsilon* is corrected (17 printed, 16 found).",
        reproduced=first.feasible == 0 and last.feasible == 17,
        corrected=first.feasible == 0 and last.feasible == 16,
    )


def _structured(rate: float) -> Row:
    made = synthesize(flexible_joint("none"), StructuredLipschitz(rate))
    smallest = float(np.sqrt(made.statistics["optimum"]))
    name = "L2" if rate == 0 else "L1"
    norm = float(np.linalg.norm(PRINTED_GAINS[name], 2))
    return judged(
        f"Smallest gain norm for gamma = 3.33, decay {rate:g} 1/s",
        "(26)",
        f"|{name}| = {norm:.4f} (optimal design)",
        f"{smallest:.4f} (bound of the optimum; the certified design has |L| = {np.linalg.norm(made.gain_at(), 2):.4f})",
        "The nonlinearity kept in its channel F, H instead of spread over all states, and a free gain: no coordinates are needed.",
        reproduced=False,
        corrected=smallest < norm and made.certificate.outcome is Outcome.PROVED,
    )


def _numbers(gain: np.ndarray) -> str:
    return "[" + "; ".join(" ".join(f"{x:.6g}" for x in row) for row in gain) + "]"
