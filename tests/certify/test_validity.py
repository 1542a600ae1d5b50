"""Domain claims: proved where strips and decay hold, refused with the condition that fails where one does not."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.certify import Claim
from luenberger.certify.validity import domain_verdict
from luenberger.core import BadInput, NotAccepted, Outcome
from luenberger.systems import MatrixFunction, Nonlinearity, Parameter, System
from luenberger.systems.discretize import discretize

SQUARE = ([-2.0, -2.0], [2.0, 2.0])
KEPT = np.array([0.5, 1.0])
# e' = -2 e + J e with J in [-1, 1] on both diagonals: P = I falls, and e' e <= c stays in the strips where c < 0.25.
BEND = Nonlinearity.bounded(lambda z, u: jnp.sin(z), np.eye(2), size=2, jacobian=(-np.eye(2), np.eye(2)), domain=SQUARE)
PLANT = System.nonlinear(-2 * np.eye(2), None, [[1.0, 0.0]], F=np.eye(2), nonlinearity=BEND, name="two decays")
ZERO = Polynomial.constant(np.zeros((2, 1)))


def claim(level: float, P: object = ((1.0, 0.0), (0.0, 1.0)), kept: np.ndarray = KEPT, **fields: object) -> Claim:
    return Claim("domain", level, np.array(P), state_bound=kept, **fields)  # type: ignore[arg-type]


def test_level_sets_are_proved_up_to_the_face_and_refuted_beyond() -> None:
    failed, verdict = domain_verdict(PLANT, ZERO, claim(0.25 * (1 - 1e-12)))
    assert (failed, verdict.outcome) == ("", Outcome.PROVED)
    # he(-2 I + J) <= -2 I, less one percent; the strips that are touched do not count.
    assert 1.97 <= verdict.margin <= 2.0
    failed, verdict = domain_verdict(PLANT, ZERO, claim(0.25))
    assert (failed, verdict.outcome) == ("argument x1", Outcome.REFUTED)
    # A tilted ellipse touches at sqrt(h P^-1 h'), not at its semi-axes.
    P = np.array([[2.0, 1.0], [1.0, 1.0]])
    touching = min(KEPT**2 / np.diag(np.linalg.inv(P)))
    assert domain_verdict(PLANT, ZERO, claim(touching * (1 - 1e-9), P))[1].outcome is Outcome.PROVED
    assert domain_verdict(PLANT, ZERO, claim(touching * (1 + 1e-9), P))[0] == "argument x1"


def test_the_same_storage_must_fall() -> None:
    # he(P (-2 I + J)) with J = diag(-1, 1): indefinite for this P, though each of its Jacobians is stable.
    steep = np.array([[1.0, 0.97], [0.97, 1.0]])
    failed, verdict = domain_verdict(PLANT, ZERO, claim(0.001, steep))
    assert (failed, verdict.outcome) == ("decay", Outcome.REFUTED)
    assert {abs(v) for v in verdict.point.values()} == {1.0}
    failed, _ = domain_verdict(PLANT, Polynomial.constant([[-3.0], [0.0]]), claim(0.01))
    assert failed == "decay"
    failed, _ = domain_verdict(PLANT, ZERO, claim(0.01, np.diag([1.0, -1.0])))
    assert failed == "storage"


def test_every_vertex_of_a_hull_counts() -> None:
    corners = [np.diag([1.0, -1.0]), np.diag([-1.0, 1.0])]
    steep = np.array([[1.0, 0.95], [0.95, 1.0]])
    hull = Nonlinearity.bounded(lambda z, u: z, np.eye(2), size=2, hull=corners[:1], domain=SQUARE)
    one = PLANT.replace(nonlinearity=hull)
    two = PLANT.replace(nonlinearity=replace(hull, jacobian_vertices=np.array(corners)))
    # Turned on the first state only, the storage falls at the first vertex and not at the second.
    P = np.array([[1.0, 0.9], [0.9, 9.0]])
    assert domain_verdict(one, ZERO, claim(0.001, P))[1].outcome is Outcome.PROVED
    assert domain_verdict(two, ZERO, claim(0.001, P))[1].outcome is Outcome.PROVED
    assert domain_verdict(two, ZERO, claim(0.001, steep))[0] == "decay"


def test_the_argument_has_strips_of_its_own_over_the_scheduling() -> None:
    plant = System.lpv(
        Polynomial.affine(-3 * np.eye(2), p=np.zeros((2, 2))),
        None,
        [[1.0, 0.0]],
        F=np.eye(2),
        nonlinearity=BEND,
        parameters=[Parameter("p", 0.0, 2.0)],
    )
    # Row 2 of I - L2 C is (-p, 1): reach sqrt(1 + p^2) of the unit circle, 5 at p = 2; it must stay below m2 = 1.
    L2 = Polynomial.affine([[0.0], [0.0]], p=[[0.0], [1.0]])
    wide, one = np.array([1.0, 1.0]), np.eye(2)
    assert domain_verdict(plant, ZERO, claim(0.2 * (1 - 1e-9), one, wide), L2)[1].outcome is Outcome.PROVED
    failed, verdict = domain_verdict(plant, ZERO, claim(0.2 * (1 + 1e-9), one, wide), L2)
    assert (failed, verdict.outcome) == ("argument x2", Outcome.REFUTED)
    assert verdict.point == {"p": 2.0}
    # The decay is that of A + F J H (I - L2 C): fed back on itself tenfold, f drives what it damped.
    assert domain_verdict(plant, ZERO, claim(1e-4, one, wide), L2 * 10.0)[0] == "decay"


def test_states_that_f_does_not_read_are_free() -> None:
    only_first = Nonlinearity.bounded(
        lambda z, u: jnp.sin(z), [[1.0, 0.0]], jacobian=([[-1.0]], [[1.0]]), domain=SQUARE
    )
    plant = System.nonlinear(-2 * np.eye(2), None, [[1.0, 0.0]], F=[[1.0], [0.0]], nonlinearity=only_first)
    kept = np.array([0.5, 0.0])
    assert domain_verdict(plant, ZERO, claim(0.24, np.diag([1.0, 1e-6]), kept))[1].outcome is Outcome.PROVED
    assert domain_verdict(plant, ZERO, claim(0.24, np.eye(2), np.array([0.0, 0.5])))[0] == "room of x1"


def test_no_room_for_the_plant_is_no_claim() -> None:
    assert domain_verdict(PLANT, ZERO, claim(0.1, kept=np.array([0.5, 2.1])))[0] == "room of x2"
    # A plant that rests at the middle may use the whole half width.
    assert domain_verdict(PLANT, ZERO, claim(0.1, kept=np.array([2.0, 2.0])))[1].outcome is Outcome.PROVED


def test_discrete_plants_must_fall_from_step_to_step() -> None:
    plant = discretize(PLANT, 0.2, "euler")
    assert domain_verdict(plant, ZERO, claim(0.24))[1].outcome is Outcome.PROVED
    # x + 0.8 (-2 + J) x reaches the factor 1 - 2.4 = -1.4.
    assert domain_verdict(discretize(PLANT, 0.8, "euler"), ZERO, claim(0.24))[0] == "decay"


def test_a_lipschitz_bound_takes_its_multiplier() -> None:
    ball = Nonlinearity.bounded(lambda z, u: jnp.sin(z), np.eye(2), size=2, lipschitz=1.0, domain=SQUARE)
    plant = PLANT.replace(nonlinearity=ball)
    assert domain_verdict(plant, ZERO, claim(0.24, multiplier=1.0))[1].outcome is Outcome.PROVED
    # -4 + s + 1/s >= 0 from s = 2 + sqrt 3.
    assert domain_verdict(plant, ZERO, claim(0.24, multiplier=3.8))[0] == "decay"


def test_functions_on_the_domain_are_proved_with_balls() -> None:
    A = MatrixFunction(lambda v: -(2 + jnp.sin(v["p"])) * jnp.eye(2), ("p",), (2, 2))
    plant = System.lpv(A, None, [[1.0, 0.0]], F=np.eye(2), nonlinearity=BEND, parameters=[Parameter("p", 0.0, 1.0)])
    assert domain_verdict(plant, ZERO, claim(0.24))[1].outcome is Outcome.PROVED
    C = MatrixFunction(lambda v: jnp.stack([jnp.cos(v["p"]), jnp.sin(v["p"])])[None], ("p",), (1, 2))
    with pytest.raises(NotAccepted, match=r"`C` of .* is a function"):
        domain_verdict(plant.replace(C=C), ZERO, claim(0.24), ZERO + np.ones((2, 1)))


def test_what_has_no_meaning_is_refused() -> None:
    with pytest.raises(NotAccepted, match="no nonlinearity with a `domain`"):
        domain_verdict(System.linear(-np.eye(2), C=[[1.0, 0.0]]), ZERO, claim(0.1))
    with pytest.raises(NotAccepted, match="no nonlinearity with a `domain`"):
        domain_verdict(PLANT.replace(nonlinearity=replace(BEND, domain=None)), ZERO, claim(0.1))
    with pytest.raises(BadInput, match=r"`state_bound` has shape \(3,\)"):
        domain_verdict(PLANT, ZERO, claim(0.1, kept=np.ones(3)))
    moving = Claim("domain", 0.1, Polynomial.affine(np.eye(2), p=np.eye(2)), state_bound=KEPT)
    with pytest.raises(NotAccepted, match="constant storage"):
        domain_verdict(PLANT, ZERO, moving)
