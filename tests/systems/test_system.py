"""A plant is checked when it is made, and means its formula when it runs."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.core import BadInput, NotAccepted
from luenberger.systems import MatrixFunction, Nonlinearity, Parameter, System

SPEED = Parameter("vx", 5.0, 35.0, "m/s")
GRIP = Parameter("mu", 0.4, 1.0, measured=False)
A0, A1, A2 = (np.array(m) for m in ([[-1.0, 0.5], [0.0, -2.0]], [[0.0, 1.0], [0.2, 0.0]], [[0.0, 0.0], [0.0, -3.0]]))
B, C, D = np.array([[1.0], [0.5]]), np.array([[1.0, 1.0]]), np.array([[0.3]])


def scheduled(**options: Any) -> System:
    A = Polynomial.affine(A0, vx=A1, mu=A2)
    return System.lpv(A, B, C, D, parameters=[SPEED, GRIP], **options)


def pendulum() -> System:
    f = Nonlinearity.bounded(lambda z, u: jnp.sin(z) + u, [[1.0, 0.0]], jacobian=([[-1.0]], [[1.0]]))
    return System.nonlinear([[0.0, 1.0], [0.0, -0.1]], B, [[1.0, 0.0]], F=[[0.0], [-9.81]], nonlinearity=f)


def test_what_is_left_out() -> None:
    plant = System.linear([[-1.0, 0.0], [0.0, -2.0]])
    assert (plant.nx, plant.nu, plant.ny, plant.nd, plant.nv, plant.nr) == (2, 0, 2, 0, 2, 0)
    assert plant.states == ("x1", "x2")
    assert plant.outputs == ("y1", "y2")
    assert plant.is_lti
    np.testing.assert_array_equal(plant.at("C"), np.eye(2))
    np.testing.assert_array_equal(plant.at("G"), np.eye(2))


def test_dimensions_names_and_boxes() -> None:
    plant = scheduled(E=[[1.0], [0.0]], G=[[0.1, 0.2]], states=["slip", "yaw_rate"], units={"slip": "rad", "vx": "m/s"})
    assert (plant.nx, plant.nu, plant.ny, plant.nd, plant.nv, plant.nr) == (2, 1, 1, 1, 2, 1)
    assert plant.scheduling_names == ("vx",)
    assert plant.scheduling_box == {"vx": (5.0, 35.0)}
    assert plant.uncertainty == {"mu": 0.7}
    assert plant.units["slip"] == "rad"
    assert not plant.is_lti


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"A": [[1.0, 2.0]]}, r"`A` has shape \(1, 2\)"),
        ({"A": -1.0}, "two axes"),
        ({"A": [[np.nan, 0.0], [0.0, 1.0]]}, r"`A` holds nan at index \(0, 0\)"),
        ({"B": [[1.0]]}, r"`B` has shape \(1, 1\) but the system has 2 states; `B` needs shape \(2, 1\)"),
        ({"B": [1.0, 2.0]}, r"`B` has shape \(2,\)"),
        ({"B": [[np.inf], [0.0]]}, "`B` holds inf"),
        ({"C": [[1.0, 2.0, 3.0]]}, r"`C` has shape \(1, 3\)"),
        ({"D": [[1.0, 2.0]]}, "2 outputs and 0 inputs"),
        ({"E": [[1.0], [0.0], [0.0]]}, r"`E` needs shape \(2, 1\)"),
        ({"G": [[1.0]]}, r"`G` needs shape \(2, 1\)"),
        ({"dt": 0.0}, "`dt` is 0.0"),
        ({"dt": -0.1}, "`dt` is -0.1"),
        ({"dt": np.nan}, "`dt` is nan"),
        ({"F": [[1.0], [0.0]]}, "belong together"),
        ({"states": ["a"]}, r"`states` names \['a'\] but the system has 2"),
        ({"states": ["a", "a"]}, "2 different names"),
        ({"inputs": ["a"]}, "the system has 0"),
        ({"outputs": ["a", "b", "c"]}, "`outputs` names"),
        ({"units": {"x3": "m"}}, "`units` has the unknown key `x3`. Did you mean `x"),
        ({"parameters": [SPEED, SPEED]}, "repeat a name"),
    ],
)
def test_malformed_plants_are_refused(parts: dict[str, Any], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        System.build(**{"A": np.diag([-1.0, -2.0]), **parts})


def test_undeclared_parameters_are_refused() -> None:
    with pytest.raises(BadInput, match=r"`A` depends on \['vx'\]"):
        System.lpv(Polynomial.affine(A0, vx=A1), parameters=[GRIP])


def test_a_nonlinearity_has_to_fit() -> None:
    f = Nonlinearity.bounded(lambda z, u: z, [[1.0, 0.0, 0.0]], lipschitz=1.0)
    with pytest.raises(BadInput, match=r"`H` has shape \(1, 3\) but the system has 2 states"):
        System.nonlinear(A0, F=[[1.0], [0.0]], nonlinearity=f)
    good = Nonlinearity.bounded(lambda z, u: z, [[1.0, 0.0]], lipschitz=1.0)
    with pytest.raises(BadInput, match=r"`F` has shape \(2, 2\) but the system has 2 states and the nonlinearity 1"):
        System.nonlinear(A0, F=np.eye(2), nonlinearity=good)
    with pytest.raises(BadInput, match="belong together"):
        System.build(A0, nonlinearity=good)


def test_matrices_are_evaluated_at_the_vector_and_the_middle() -> None:
    np.testing.assert_allclose(scheduled().at("A", [10.0]), A0 + 10 * A1 + 0.7 * A2, rtol=1e-15)


def test_dynamics_and_output_are_the_formula() -> None:
    x, u, r = np.array([0.3, -0.7]), np.array([2.0]), np.array([12.0])
    plant = scheduled()
    A = A0 + 12 * A1 + 0.7 * A2
    np.testing.assert_allclose(plant.dynamics(0.0, x, u, r), A @ x + B @ u, rtol=1e-14)
    np.testing.assert_allclose(plant.output(0.0, x, u, r), C @ x + D @ u, rtol=1e-14)


def test_the_nonlinear_term_acts_through_F() -> None:
    x, u = np.array([0.4, 0.1]), np.array([0.2])
    expected = np.array([0.1, -0.01]) + B[:, 0] * 0.2 + np.array([0.0, -9.81]) * (np.sin(0.4) + 0.2)
    np.testing.assert_allclose(pendulum().dynamics(0.0, x, u), expected, rtol=1e-14)


@pytest.mark.parametrize("r", [(), (1.0, 2.0)])
def test_a_scheduling_vector_of_the_wrong_length_is_refused(r: tuple[float, ...]) -> None:
    with pytest.raises(BadInput, match=r"scheduled by \['vx'\]"):
        scheduled().dynamics(0.0, np.zeros(2), np.zeros(1), r)


def test_it_runs_under_jit_grad_and_vmap() -> None:
    plant = scheduled()
    x, u = jnp.array([1.0, 2.0]), jnp.array([0.5])
    speeds = jnp.array([[5.0], [20.0], [35.0]])
    at = eqx.filter_jit(lambda system, r: system.dynamics(0.0, x, u, r))
    many = jax.jit(jax.vmap(lambda r: plant.dynamics(0.0, x, u, r)))(speeds)
    for r, dx in zip(speeds, many, strict=True):
        np.testing.assert_allclose(dx, at(plant, r), rtol=1e-14)
    slope = jax.jacfwd(lambda r: plant.dynamics(0.0, x, u, r))(speeds[0])
    np.testing.assert_allclose(slope[:, 0], A1 @ x, rtol=1e-14)


def test_a_batch_of_plants_is_mapped() -> None:
    plant, x, u, r = scheduled(), jnp.array([1.0, 2.0]), jnp.array([0.5]), jnp.array([9.0])
    batch = jax.tree.map(lambda leaf: jnp.stack([leaf, 2.0 * leaf]), plant)
    found = jax.vmap(lambda one: one.dynamics(0.0, x, u, r))(batch)
    np.testing.assert_allclose(found, np.outer([1.0, 2.0], plant.dynamics(0.0, x, u, r)), rtol=1e-14)


def test_function_matrices_run_and_freeze() -> None:
    A = MatrixFunction(lambda v: jnp.array([[0.0, 1 / v["vx"]], [-v["mu"], 0.0]]), ("vx", "mu"), (2, 2))
    plant = System.lpv(A, C=C, parameters=[SPEED, GRIP])
    expected = [[0.0, 0.05], [-0.7, 0.0]]
    np.testing.assert_allclose(jax.jit(lambda r: plant.at("A", r))(jnp.array([20.0])), expected, rtol=1e-14)
    frozen = plant.freeze(vx=20.0)
    assert frozen.scheduling_names == ()
    np.testing.assert_allclose(frozen.at("A"), expected, rtol=1e-14)
    with pytest.raises(NotAccepted, match="`A` is given as a function"):
        plant.polynomial("A")
    assert plant.polynomial("C").shape == (1, 2)


def test_freezing_all_gives_a_constant_plant() -> None:
    frozen = scheduled(units={"vx": "m/s", "x1": "rad"}).freeze(vx=20.0, mu=0.5)
    assert frozen.is_lti
    assert frozen.units == {"x1": "rad"}
    np.testing.assert_allclose(frozen.at("A"), A0 + 20 * A1 + 0.5 * A2, rtol=1e-15)


def test_freezing_one_keeps_the_other() -> None:
    frozen = scheduled().freeze(mu=1.0)
    assert frozen.scheduling_names == ("vx",)
    assert frozen.uncertainty == {}
    np.testing.assert_allclose(frozen.at("A", [7.0]), A0 + 7 * A1 + A2, rtol=1e-15)


def test_freezing_keeps_the_nonlinearity() -> None:
    f = Nonlinearity.bounded(lambda z, u: jnp.sin(z), [[1.0, 0.0]], lipschitz=1.0)
    F = Polynomial.affine([[0.0], [1.0]], vx=[[1.0], [0.0]])
    frozen = System.nonlinear(A0, F=F, nonlinearity=f, parameters=[SPEED]).freeze(vx=6.0)
    np.testing.assert_array_equal(frozen.at("F"), [[6.0], [1.0]])
    assert frozen.nonlinearity is not None


@pytest.mark.parametrize("value", [4.9, 35.1, np.nan])
def test_freezing_outside_the_interval_is_refused(value: float) -> None:
    with pytest.raises(BadInput, match=r"`vx` = .* lies outside its interval \[5\.0, 35\.0\]"):
        scheduled().freeze(vx=value)


def test_freezing_an_unknown_parameter_gets_a_hint() -> None:
    with pytest.raises(BadInput, match=r"unknown key `vxx`\. Did you mean `vx`"):
        scheduled().freeze(vxx=10.0)


def test_replacing_checks_again() -> None:
    plant = scheduled()
    assert plant.replace(name="car").name == "car"
    assert plant.replace(dt=0.1).dt == 0.1
    with pytest.raises(BadInput, match=r"`B` needs shape \(2, 1\)"):
        plant.replace(B=np.zeros((3, 1)))
    with pytest.raises(BadInput, match="`replace` has the unknown key `AA`"):
        plant.replace(AA=A0)


def test_a_nonlinearity_can_be_added_and_removed() -> None:
    f = Nonlinearity.bounded(lambda z, u: jnp.sin(z), [[1.0, 0.0]], lipschitz=1.0)
    bent = System.linear(A0, C=C).replace(F=[[0.0], [1.0]], nonlinearity=f)
    assert not bent.is_lti
    np.testing.assert_array_equal(bent.at("F"), [[0.0], [1.0]])
    assert bent.replace(F=None, nonlinearity=None).is_lti
    with pytest.raises(BadInput, match="belong together"):
        System.linear(A0).replace(F=[[0.0], [1.0]])
