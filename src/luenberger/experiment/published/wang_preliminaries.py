"""Wang's chapter 2: what of the printed inequalities holds as printed, on examples that can be checked by hand."""

from collections.abc import Iterator

import numpy as np

from luenberger.experiment.published.row import Row, judged
from luenberger.lmi.classical import (
    bounded_real_gain,
    kyp_storage,
    largest_slope,
    positive_real_storage,
    unstructured_margin,
    unstructured_nominal,
)

A, B = np.array([[0.0, 1.0], [-2.0, -3.0]]), np.array([[0.0], [1.0]])
C, D = np.array([[1.0, 0.5]]), np.array([[0.1]])


def preliminary_rows() -> Iterator[Row]:
    """Rows of chapter 2."""
    peak = max(abs((C @ np.linalg.solve(1j * w * np.eye(2) - A, B) + D)[0, 0]) for w in np.linspace(0, 20, 2001))
    levels = [bounded_real_gain(A, B, C, D, form) for form in ("square", "linear")]
    close = all(v is not None and abs(v - peak) < 1e-4 for v in levels)
    yield judged(
        "bounded real, both forms, A = [0 1; -2 -3], C = [1 0.5], D = 0.1",
        "(2.50), (2.51)",
        "equivalent",
        ", ".join("none" if v is None else f"{v:.6f}" for v in levels),
        f"The largest response over frequency is {peak:.6f}. (2.47) prints >= for <=.",
        reproduced=close,
    )
    plant, entry, supply = np.array([[1.0]]), np.array([[1.0]]), np.diag([1.0, -4.0])
    free, definite = kyp_storage(plant, entry, supply), kyp_storage(plant, entry, supply, definite=True)
    yield judged(
        "KYP for 1/(s - 1), bound 2",
        "(2.41)",
        "P > 0",
        "none" if free is None else f"P = {free[0, 0]:.3f}; definite: {'found' if definite is not None else 'none'}",
        "The frequency inequality holds and only a negative P shows it; P > 0 needs a Hurwitz A.",
        reproduced=definite is not None,
        corrected=free is not None and free[0, 0] < 0,
    )
    slope = largest_slope(np.array([[0.0, 1.0], [-1.0, -1.0]]), np.array([[0.0], [-1.0]]), np.array([[1.0, 0.0]]))
    yield judged(
        "Lure system, largest sector slope",
        "(2.55), (2.61)",
        "-",
        "none" if slope is None else f"{slope:.4f}",
        "Equal to the circle criterion, 3; (2.55) lacks the halves off the diagonal, (2.61) lacks P > 0.",
        reproduced=False,
        corrected=slope is not None and abs(slope - 3) < 1e-3,
    )
    one = np.eye(1)
    strict = positive_real_storage(-one, one, one)
    yield judged(
        "positive real without feedthrough, 1/(s + 1)",
        "(2.45), (2.60)",
        "strict inequality",
        "none" if strict is None else f"P = {strict[0, 0]:.4f} from the equality",
        "The last block is zero, so the strict inequality never holds; P B = C'/2 is what remains.",
        reproduced=False,
        corrected=strict is not None and abs(strict[0, 0] - 0.5) < 1e-6,
    )
    margin, nominal = unstructured_margin(A, C), unstructured_nominal(A, C, 1.5)
    yield judged(
        "unstructured observer, literal inequality",
        "(2.30), (2.31)",
        "feasible",
        f"best margin {margin:.1e}; equality version {'feasible' if nominal is not None else 'infeasible'}",
        "A zero diagonal block cannot be negative: its row has to vanish, which is Ao = A - Bo C.",
        reproduced=margin > 1e-6,
        corrected=nominal is not None,
    )
