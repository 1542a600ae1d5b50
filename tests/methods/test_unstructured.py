"""The unstructured observer: below every Luenberger gain, near the plant, proved about its own copy, and its refusals."""

import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.certify import certify_claims
from luenberger.core import BadInput, Infeasible, NotAccepted, Outcome
from luenberger.design import Design
from luenberger.experiment.published.wang_plants import theta_plant
from luenberger.methods.robust_bound import gamma_star
from luenberger.methods.unstructured import UnstructuredObserver
from luenberger.synthesize import synthesize
from luenberger.systems import Parameter, System


def test_level_is_below_every_luenberger_gain_and_proved() -> None:
    plant = theta_plant("joint")
    for norm in ("h2", "l2"):
        design = synthesize(plant, UnstructuredObserver(norm))  # type: ignore[arg-type]
        assert design.certificate.outcome is Outcome.PROVED
        level = design.certificate.claims[0].level
        assert level < gamma_star(plant, norm).level  # type: ignore[arg-type]
        assert level == pytest.approx(1.02 * design.statistics["gamma_star"])


def test_error_follows_from_its_own_matrices() -> None:
    design = synthesize(theta_plant("joint"), UnstructuredObserver("l2"))
    assert design.model is not None
    claim, generator = design.certificate.claims[0], np.random.default_rng(0)
    scheduling = design.system.measured_scheduling
    assert scheduling is not None
    for _ in range(20):
        p = {n: generator.uniform(*i) for n, i in scheduling.box.items()}
        true, measured = (
            {n: float(q({k: p[k] for k in q.names})[0, 0]) for n, q in m.items()}
            for m in (scheduling.true, scheduling.measured)
        )
        A, B, C = (at(design.system, letter, true) for letter in "ABC")
        An, Bn = at(design.model, "A", measured), at(design.model, "B", measured)
        L = np.asarray(design.gain({n: measured[n] for n in design.gain.names}))
        # xhat' = A_o xhat + B_ou u + B_oy y written out with A_o = An - L C.
        Ao = An - L @ C
        Ae, Be = A - L @ C, np.hstack([A - L @ C - Ao, B - Bn])
        grid = np.concatenate([[0.0], np.logspace(-2, 4, 200)])
        worst = max(np.linalg.norm(np.linalg.solve(1j * w * np.eye(2) - Ae, Be), 2) for w in grid)
        assert worst <= claim.level


def at(system: System, letter: str, values: dict[str, float]) -> np.ndarray:
    matrix = system.polynomial(letter)
    return np.asarray(matrix({n: values[n] for n in matrix.names}))


def test_more_slack_brings_it_nearer_to_the_plant() -> None:
    plant = theta_plant("joint")
    far, near = (distance(synthesize(plant, UnstructuredObserver("h2", slack=s))) for s in (0.02, 0.3))
    assert near < far


def distance(design: Design) -> float:
    assert design.model is not None
    change = design.model.polynomial("A") - design.system.polynomial("A")
    return max(float(np.linalg.norm(np.asarray(c), 2)) for _, c in change)


def test_without_lopsided_errors_a_copy_is_chosen() -> None:
    A = Polynomial.affine([[-1.0, 0.0], [0.0, -1.0]], k=[[0.0, 0.0], [0.0, -1.0]])
    k = Parameter("k", 1.0, 2.0, error=0.1)
    plant = System.lpv(A, [[0.0], [1.0]], [[1.0, 0.0]], parameters=[k])
    design = synthesize(plant, UnstructuredObserver("l2", slack=0.2))
    # Offsets of either sign: the plant itself is in the middle, and nothing is gained by leaving it far.
    assert distance(design) < 0.05


def test_the_copy_is_part_of_the_claims() -> None:
    design = synthesize(theta_plant("joint"), UnstructuredObserver("l2"))
    bare = certify_claims(design.system, design.gain, design.certificate.claims[:1])
    # The same gain with a copy of the plant does not have the level.
    assert bare.outcome is not Outcome.PROVED
    assert design.with_gain(design.gain * -10.0).certificate.outcome is not Outcome.PROVED


def test_several_unseen_states_are_served_too() -> None:
    A = Polynomial.affine(np.diag([-1.0, -2.0, -3.0]), k=np.diag([0.0, -0.5, -0.5]))
    plant = System.lpv(
        A, [[1.0], [1.0], [0.0]], [[1.0, 0.0, 0.0]], parameters=[Parameter("k", 1.0, 2.0, factor=(0.9, 1.2))]
    )
    design = synthesize(plant, UnstructuredObserver("l2", slack=0.05))
    assert design.certificate.outcome is Outcome.PROVED


def test_refusals() -> None:
    exact = System.lpv(Polynomial.affine([[-1.0]], r=[[-1.0]]), C=[[1.0]], parameters=[Parameter("r", 0.0, 1.0)])
    with pytest.raises(NotAccepted, match="factor"):
        synthesize(exact, UnstructuredObserver())
    with pytest.raises(NotAccepted, match="constant outputs"):
        synthesize(theta_plant(output="slip_constraint"), UnstructuredObserver())
    with pytest.raises(Infeasible, match=r"above 0\.1988"):
        synthesize(theta_plant("joint"), UnstructuredObserver("l2", level=0.15))
    with pytest.raises(BadInput, match="gain_weight"):
        synthesize(theta_plant(), UnstructuredObserver("l2", gain_weight=0.0))
