"""Errata of Song and Hedrick 2011: statements and symbols that cannot stand as printed."""

from collections.abc import Iterator

import numpy as np

from luenberger.experiment.published.flexible_joint import TRANSFORM, flexible_joint
from luenberger.experiment.published.row import Row, judged
from luenberger.methods.hamiltonian import hinf_peak
from luenberger.methods.lipschitz_margin import stability_margin, storage_at
from luenberger.methods.lipschitz_plant import LumpedPlant
from luenberger.systems.observability import observability


def text_rows() -> Iterator[Row]:
    """Yield one row for each erratum that is not already part of a table."""
    plant = flexible_joint("none")
    yield judged(
        "Length of B_u and f(x)",
        "(35)",
        "3 entries",
        f"{plant.nx} entries: B_u = (0, 21.6, 0, 0), f = (0, 0, 0, -3.33 sin(link angle))",
        "The plant has four states; one zero is missing in each. Torque enters at the motor, gravity at the link.",
        reproduced=plant.nx == 3,
        corrected=plant.at("B").shape == (plant.nx, 1),
    )
    report = observability(plant, linear_part=True)
    yield judged(
        '"the pair (A, C) is controllable"',
        "section V",
        "controllable",
        f"observable: rank {report.rank} of {plant.nx}",
        "A pair (A, C) can only be observable, which it is.",
        reproduced=False,
        corrected=report.rank == plant.nx,
    )
    yield judged(
        '"exogenous known input" d',
        "(35)",
        "known",
        "unknown",
        "A known input would be copied into the observer and leave no trace in the error (29).",
        reproduced=False,
        corrected=True,
    )
    yield judged(
        "Range of the multiplier sigma",
        "(6)",
        "sigma >= 0",
        "sigma > 0",
        f"At sigma = 0 the second diagonal block is zero: largest eigenvalue of [[-1, p], [p, 0]] at p = 0.1 is "
        f"{np.linalg.eigvalsh([[-1.0, 0.1], [0.1, 0.0]])[1]:.4f} > 0.",
        reproduced=False,
        corrected=bool(np.linalg.eigvalsh([[-1.0, 0.1], [0.1, 0.0]])[1] > 0),
    )
    yield _strict()
    yield _output_matrix()
    yield judged(
        "Weight that makes kappa the only goal",
        "Step 4, (34)",
        "delta = 0 for L3",
        "delta = 1",
        "At delta = 0 the objective delta kappa^2 - (1 - delta) lmin(P) holds no kappa at all.",
        reproduced=False,
        corrected=True,
    )
    yield judged(
        "Error whose L2 gain kappa bounds",
        "(30) in z = T x",
        "e",
        "T e",
        "(30) with transformed matrices has z' z in place of e' e; for |e| the unit block becomes T^-T T^-1, whose norm here is "
        f"{np.linalg.norm(LumpedPlant.of(plant, TRANSFORM).weight('original'), 2):.0f}.",
        reproduced=False,
        corrected=True,
    )


def _strict() -> Row:
    """A perturbation of exactly the size of the margin that moves an eigenvalue onto the imaginary axis."""
    plant = flexible_joint("none")
    lumped = LumpedPlant.of(plant, TRANSFORM)
    P = storage_at(lumped, 1.0)
    assert P is not None
    gain = lumped.gain(P, 1.0)
    loop, eye = lumped.loop(gain), np.eye(4)
    peak = hinf_peak(loop, eye, eye)
    U, s, V = np.linalg.svd(np.linalg.inv(1j * peak.frequency * eye - loop))
    worst = np.outer(V[0].conj(), U[:, 0].conj()) / s[0]
    left = float(np.linalg.eigvals(loop + worst).real.max())
    alpha = stability_margin(plant, gain, TRANSFORM)
    return judged(
        "Relation of margin and Lipschitz constant",
        "Corollary 1, Theorem 4, Algorithm 1",
        "alpha >= gamma",
        f"alpha > gamma: phi = D e with |D| = {np.linalg.norm(worst, 2):.6f} = alpha leaves an eigenvalue with real part {left:.1e}",
        f"The margin is a supremum that is not attained; shown for L2 (alpha = {alpha:.6f}) at {peak.frequency:.3f} rad/s.",
        reproduced=left < -1e-6,
        corrected=abs(left) <= 1e-6 and abs(float(np.linalg.norm(worst, 2)) - alpha) < 1e-6,
    )


def _output_matrix() -> Row:
    """The printed C' agrees with the right one for the printed T alone; another T shows which one is meant."""
    plant = flexible_joint("none")
    margins = {}
    for transform in (TRANSFORM, (0.5, 1.0, 1.0, 0.1)):
        lumped = LumpedPlant.of(plant, transform)
        P = storage_at(lumped, 0.1)
        assert P is not None
        printed = lumped.T_inverse @ np.linalg.solve(P, np.asarray(plant.at("C")).T) / 0.2
        margins[transform] = (
            stability_margin(plant, printed, transform),
            stability_margin(plant, lumped.gain(P, 0.1), transform),
        )
    same, other = margins.values()
    return judged(
        "Output matrix in the gain formula",
        "(33)",
        "P^-1 C'",
        "P^-1 (C T^-1)'",
        f"Equal for the printed T, which leaves C unchanged (margins {same[0]:.4f} and {same[1]:.4f}); with T = diag(0.5, 1, 1, 0.1) the printed "
        f"formula gives another gain (margin {other[0]:.4f} instead of {other[1]:.4f}), of which the proof says nothing.",
        reproduced=False,
        corrected=abs(same[0] - same[1]) < 1e-9 and abs(other[0] - other[1]) > 1e-3,
    )
