"""Stability margins and the largest epsilon of Song and Hedrick 2011, printed and proved."""

from collections.abc import Iterator
from fractions import Fraction

import numpy as np

from luenberger.experiment.published.flexible_joint import PRINTED_GAINS, TRANSFORM, flexible_joint
from luenberger.experiment.published.row import Row, judged
from luenberger.methods.lipschitz_bracket import largest_epsilon, margin_bracket
from luenberger.methods.lipschitz_inequality import LumpedInequality
from luenberger.methods.lipschitz_margin import margin_at, quadratic_storage, stability_margin, storage_at, thau_bound
from luenberger.methods.lipschitz_plant import LumpedPlant, Transform

GRID = np.logspace(-1, 1, 20)
CLAIMED = 4.8329


def margin_table(transform: Transform = None) -> list[tuple[int, float, float, float]]:
    """Return (k, epsilon_k, margin by Riccati equation, margin by (24) as a semidefinite programme), k = 1 to 20.

    Args:
        transform: T or its diagonal.
    """
    plant = flexible_joint("none")
    points = [float(e) for e in GRID]
    return [
        (k + 1, e, margin_at(plant, e, transform), margin_at(plant, e, transform, "sdp")) for k, e in enumerate(points)
    ]


def margin_rows() -> Iterator[Row]:
    """Yield the rows of Figures 1 and 2, of epsilon*, and of the margins of the printed gains."""
    yield from _figure_one()
    yield from _figure_two()
    yield from _theorems()
    for name, gain in PRINTED_GAINS.items():
        yield _gain_margin(name, gain)


def _figure_one() -> Iterator[Row]:
    table = margin_table(None)
    largest = max(row[2] for row in table)
    limit = margin_bracket(flexible_joint("none"), epsilon=1e-4).alpha[1]
    yield judged(
        "Fig. 1, margins for T = I, k = 1..20",
        "(24)",
        "alpha_k < 3.33 for all k",
        ", ".join(f"{row[2]:.5f}" for row in table),
        f"Margins fall with epsilon; even at epsilon = 1e-4 the proved upper bound is {limit:.4f}, so no epsilon above that reaches 3.33.",
        reproduced=bool(largest < 3.33 and limit < 3.33),
    )
    spread = _spread(table)
    yield judged(
        "Fig. 1, number of k for which (24) is solved",
        "(24)",
        "results up to k = 17",
        "all 20",
        f"All 20 programmes are solved and agree with the Riccati oracle within {spread:.1e}; the end at k = 17 is one of the solver, not of the problem.",
        reproduced=False,
        corrected=spread < 1e-4,
        deviation=spread,
    )


def _figure_two() -> Iterator[Row]:
    plant = flexible_joint("none")
    lumped = LumpedPlant.of(plant, TRANSFORM)
    yield judged(
        "Lipschitz constant in z = T x",
        "(36)",
        "0.333",
        f"{lumped.lipschitz:.6f}",
        "|T F| g |H T^-1| with T = diag(1, 1, 1, 0.1).",
        reproduced=abs(lumped.lipschitz - 0.333) < 1e-12,
        deviation=abs(lumped.lipschitz - 0.333),
    )
    table = margin_table(TRANSFORM)
    spread = _spread(table)
    yield judged(
        "Fig. 2, margins for T = diag(1, 1, 1, 0.1), k = 1..20",
        "(24)",
        "curve that crosses 0.333 after k = 17",
        ", ".join(f"{row[2]:.5f}" for row in table),
        f"Riccati oracle and semidefinite programme agree within {spread:.1e}. The crossing lies after k = 16; see the next rows.",
        reproduced=False,
        corrected=spread < 1e-4 and table[15][2] > 0.333 > table[16][2],
        deviation=spread,
    )
    low, high = margin_bracket(plant, epsilon=float(GRID[16]), transform=TRANSFORM).alpha
    yield judged(
        "alpha at k = 17, epsilon = 4.8329",
        "(24)",
        "0.3630",
        f"{table[16][2]:.6f}",
        f"Off by one: 0.3630 belongs to k = 16, epsilon = {GRID[15]:.4f}, where alpha = {table[15][2]:.6f}. At k = 17 alpha lies in "
        f"[{low:.7f}, {high:.7f}], proved in rational arithmetic.",
        reproduced=bool(low <= 0.36305 and high >= 0.36295),
        corrected=high < 0.3629 and abs(table[15][2] - 0.3630) < 5e-5,
        deviation=abs(table[16][2] - 0.3630),
    )
    bound = margin_bracket(plant, epsilon=CLAIMED, transform=TRANSFORM).upper
    yield judged(
        "A storage matrix exists for all epsilon in (0, 4.8329]",
        "(19), Theorem 4",
        "yes",
        f"alpha^2 <= {float(bound):.6f} < {0.333**2:.6f}",
        "Refuted at epsilon = 4.8329 by a dual certificate, exact in rational arithmetic.",
        reproduced=bound >= Fraction(0.333) ** 2,
        corrected=bound < Fraction(0.333) ** 2,
    )
    bracket = largest_epsilon(plant, 0.333, TRANSFORM)
    assert bracket.infeasible is not None
    yield judged(
        "Largest epsilon*",
        "(24), Step 2",
        "4.8329",
        f"{bracket.feasible:.6f} (feasible) .. {bracket.infeasible:.6f} (infeasible)",
        "Both ends proved in rational arithmetic: a storage matrix at the lower, a dual certificate at the upper.",
        reproduced=bracket.feasible <= CLAIMED <= bracket.infeasible,
        corrected=bracket.infeasible < CLAIMED,
        deviation=CLAIMED - bracket.feasible,
    )


def _theorems() -> Iterator[Row]:
    plant = flexible_joint("none")
    gain = PRINTED_GAINS["L2"]
    forms = [quadratic_storage(plant, gain, TRANSFORM, form) is not None for form in ("multiplier", "unit")]
    routes = [stability_margin(plant, gain, TRANSFORM, route) for route in ("norm", "maximise", "minimise")]
    spread = max(routes) - min(routes)
    yield judged(
        "Equivalence of (6), (7), (8) and of (13), (15)",
        "Theorem 2, Remark 1",
        "equivalent",
        f"L2: (6) {'holds' if forms[0] else 'fails'}, (8) {'holds' if forms[1] else 'fails'}; margins {', '.join(f'{r:.6f}' for r in routes)}",
        "Norm of the resolvent, (13) and (15) give one margin; a storage matrix of (6) is the multiplier times one of (8). In (6) the "
        "multiplier must be > 0: at 0 its second diagonal block is 0, which is not negative definite.",
        reproduced=all(forms) and spread < 1e-6,
        deviation=spread,
    )
    thau = {name: thau_bound(plant, L, TRANSFORM) for name, L in PRINTED_GAINS.items()}
    margins = {name: stability_margin(plant, L, TRANSFORM) for name, L in PRINTED_GAINS.items()}
    yield judged(
        "Thau's test on the printed gains",
        "(5)",
        "sufficient",
        ", ".join(f"{n} {thau[n]:.4f} <= {margins[n]:.4f}" for n in thau),
        "Never above the quadratic margin; it would accept neither L1 nor L2 at 0.333, which (8) accepts.",
        reproduced=all(thau[n] <= margins[n] for n in thau),
    )
    here, there = margin_bracket(plant, epsilon=0.1), margin_bracket(plant, epsilon=1.0)
    gamma = Fraction(9, 10)
    yield judged(
        "Equivalence of statements 2, 3 and 4",
        "Theorem 3",
        "equivalent",
        f"T = I, gamma = 0.9: (19) holds at epsilon = 0.1 (alpha >= {here.alpha[0]:.5f}), (17) and (18) fail (alpha <= {there.alpha[1]:.5f})",
        "(17) and (18) are (19) with epsilon = 1; (19) with free epsilon is weaker. Both sides proved in rational arithmetic.",
        reproduced=False,
        corrected=here.lower > gamma**2 > there.upper,
    )
    P = storage_at(LumpedPlant.of(plant, TRANSFORM), 4.5)
    assert P is not None
    # The equation has no slack of its own; a millionth of the constant is given up for a strict proof.
    squared = Fraction(0.333) ** 2 * (1 - Fraction(1, 10**6))
    smaller = (4.5, 1.0, 0.1, 1e-3)
    shared = [LumpedInequality.of(plant, TRANSFORM, None, e).tolerates(P, squared) for e in smaller]
    yield judged(
        "A P for epsilon* serves every smaller epsilon",
        "Theorem 4",
        "yes",
        f"P of epsilon = 4.5 proved at {', '.join(f'{e:g}' for e, held in zip(smaller, shared, strict=True) if held)}",
        "C' C / epsilon grows as epsilon falls.",
        reproduced=all(shared),
    )


def _gain_margin(name: str, gain: np.ndarray) -> Row:
    plant = flexible_joint("none")
    bracket = margin_bracket(plant, gain=gain, transform=TRANSFORM)
    alpha = stability_margin(plant, gain, TRANSFORM)
    return judged(
        f"Stability margin of the printed {name}",
        "(13), (15)",
        "> 0.333 (claimed by design)",
        f"{alpha:.6f}, proved in [{bracket.alpha[0]:.7f}, {bracket.alpha[1]:.7f}]",
        "1 / |(s I - T (A - L C) T^-1)^-1|_inf of the four printed decimals; both bounds in rational arithmetic.",
        reproduced=bracket.lower > Fraction(0.333) ** 2,
    )


def _spread(table: list[tuple[int, float, float, float]]) -> float:
    return max(abs(row[2] - row[3]) for row in table)
