"""Whether the state can be found while an unknown input acts: invariant zeros and the matching condition."""

import numpy as np

from luenberger.systems.hidden_subspace import RELATIVE_TOLERANCE, Balanced, points
from luenberger.systems.mode import Report, named_modes, slowest_first
from luenberger.systems.system import System

# Any number that is no invariant zero gives the normal rank; a fixed one far from the axes keeps reports reproducible.
_NO_ZERO = 0.6180339887 + 0.7548776662j


def strong_detectability(system: System) -> Report:
    """Tell whether y = 0 forces x -> 0 whatever the unknown input d does.

    Ask it before an unknown-input observer is tried: without strong detectability no observer finds the state. An
    observer that does not differentiate y needs the matching condition rank(C E) = rank(E) too, `report.matching`; both
    together are called strong* detectability.

    Assumes: dx = A x + E d, y = C x at constant parameters; a scheduled plant is looked at where it is frozen at the
    vertices and the middle of its box, a nonlinear one through its bounds as in `detectability`. Linearly dependent
    columns of E count once.

    Certifies nothing: floating point with relative tolerance 1e-9. The zeros are the eigenvalues on the largest
    subspace of ker C that some d keeps invariant, which leaves the zeros at infinity aside without computing them.

    Args:
        system: plant with unknown inputs E; without any, the question is `detectability`.

    Returns:
        report whose modes are the motions some unknown input hides, at the invariant zeros; `rank` is the normal rank
        of the Rosenbrock pencil, which needs nx + rank(E).

    Reference: M. L. J. Hautus, "Strong detectability and observers", Linear Algebra and its Applications 50, 1983.
    """
    triples = [(where, Balanced.of(A, C, E)) for where, A, C, E in points(system, linear_part=False)]
    modes = [m for where, t in triples for m in named_modes(system, where, *t.hidden_modes(), t.roundoff)]
    ordered = slowest_first(modes)
    slow = [mode for mode in ordered if not mode.fades(0.0)]
    unseen = any(t.input_is_hidden() for _, t in triples)
    matched = all(np.linalg.matrix_rank(t.C @ t.E, tol=RELATIVE_TOLERANCE) == t.E.shape[1] for _, t in triples)
    pencils = [(np.linalg.svd(rosenbrock(t, _NO_ZERO * t.size), compute_uv=False), t) for _, t in triples]
    worst, triple = min(pencils, key=lambda pencil: _rank(pencil[0]) - pencil[1].E.shape[1])
    holds = not slow and not unseen
    sentences = [_answer(system, holds, len(triples))]
    if unseen:
        sentences.append(
            f"Some unknown input leaves no trace in the outputs: the Rosenbrock pencil has normal rank {_rank(worst)}, "
            f"{system.nx + triple.E.shape[1]} is needed. Add a sensor that sees it."
        )
    for mode in slow[:3]:
        sentences.append(f"An unknown input hides the mode {mode.text}, an invariant zero that does not die out.")
    if holds and ordered:
        slowest = ordered[0].text
        sentences.append(f"The slowest invariant zero is {slowest}; no observer forgets its error faster than that.")
    sentences.append(_match(holds, matched))
    return Report("strong detectability", holds, ordered, tuple(sentences), _rank(worst), worst, matched)


def rosenbrock(triple: Balanced, s: complex) -> np.ndarray:
    """Return the pencil [A - s I, E; C, 0], state rows divided by the norm of A, shape (nx + ny, nx + nd).

    Args:
        triple: balanced plant.
        s: point of the complex plane.
    """
    upper = np.hstack([(triple.A - s * np.eye(len(triple.scale))) / triple.size, triple.E])
    return np.vstack([upper, np.hstack([triple.C, np.zeros((triple.C.shape[0], triple.E.shape[1]))])])


def _rank(values: np.ndarray) -> int:
    return int(np.sum(values > RELATIVE_TOLERANCE * values[0]))


def _answer(system: System, holds: bool, places: int) -> str:
    at = "" if places == 1 else f", frozen at {places} vertices and middle points of its box"
    return f"`{system.name}` is {'' if holds else 'not '}strongly detectable{at}."


def _match(holds: bool, matched: bool) -> str:
    if not matched:
        return (
            "The matching condition rank(C E) = rank(E) fails: an observer would need derivatives of y. Measure a "
            "state that the unknown input drives directly, or bound its effect with an L2 gain instead."
        )
    starred = ", so the plant is strong* detectable" if holds else ""
    return f"The matching condition rank(C E) = rank(E) holds{starred}."
