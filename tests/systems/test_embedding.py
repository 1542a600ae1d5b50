"""A plant given as one function is split rightly, bounded soundly, and offered in every form a design may ask for."""

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from luenberger.core import BadInput, NotAccepted
from luenberger.systems import System, embedding_jacobian
from luenberger.systems.embedding import Embedding, embed
from luenberger.vehicle import brush_tyres, wang_car

CAR = wang_car.with_values(friction=0.85)
FRONT, REAR = brush_tyres(CAR)
SPEED = 20.0


def van_der_pol(x: Any, u: Any) -> Any:
    return [x[1], (1 - x[0] ** 2) * x[1] - x[0]]


def pendulum(x: Any, u: Any) -> Any:
    return [x[1], -9.81 * jnp.sin(x[0]) - 0.1 * x[1] + 2.0 * u[0]]


def robot(x: Any, u: Any) -> Any:
    return [
        x[1],
        -48.6 * x[0] - 1.25 * x[1] + 48.6 * x[2] + 21.6 * u[0],
        x[3],
        19.5 * x[0] - 19.5 * x[2] - 3.33 * jnp.sin(x[2]),
    ]


def product(x: Any, u: Any) -> Any:
    return [x[1] * x[2] + u[0], -x[1] + u[1] * x[0], -x[2] + x[0] * x[1]]


def car(x: Any, u: Any) -> Any:
    a, b = CAR.front_axle_distance, CAR.rear_axle_distance
    front, rear = FRONT(u[0] - (x[0] + a * x[1]) / SPEED), REAR(-(x[0] - b * x[1]) / SPEED)
    return [(front + rear) / CAR.mass - SPEED * x[1], (a * front - b * rear) / CAR.yaw_inertia]


def linear(x: Any, u: Any) -> Any:
    return jnp.array([[0.0, 1.0], [-2.0, -3.0]]) @ x + jnp.array([0.0, 4.0]) * u[0]


def offset(x: Any, u: Any) -> Any:
    return [x[1] + 1.5, jnp.sin(u[0]) - x[0]]


# Function, half width of the state box, inputs, number of inputs.
PLANTS: dict[str, tuple[Callable[..., Any], list[float], Any, int]] = {
    "van der pol": (van_der_pol, [2.0, 2.0], 0, 0),
    "pendulum": (pendulum, [1.0, 3.0], 1, 1),
    "robot": (robot, [2.0, 9.0, 2.0, 9.0], 1, 1),
    "product": (product, [1.0, 1.0, 1.0], ([-1.0, -1.0], [1.0, 1.0]), 2),
    "car": (car, [0.5, 0.1], ([-0.02], [0.02]), 1),
    "linear": (linear, [1.0, 1.0], 1, 1),
    "offset": (offset, [1.0, 1.0], 1, 1),
}
MADE: dict[str, Embedding] = {}


def made(name: str) -> Embedding:
    if name not in MADE:
        function, half, inputs, _ = PLANTS[name]
        C = np.eye(1, len(half))
        MADE[name] = embed(
            function,
            (-np.array(half), np.array(half)),
            inputs=inputs,
            outputs=C,
            name=name,
            inflation=0.02,
            tolerance=1e-2,
        )
    return MADE[name]


def same(system: System, name: str, r: Any = None) -> None:
    function, half, _, nu = PLANTS[name]
    generator = np.random.default_rng(7)
    for _ in range(20):
        x, u = generator.uniform(-1, 1, len(half)) * half, generator.uniform(-0.02, 0.02, nu)
        wanted = np.asarray(jnp.stack([jnp.asarray(e) for e in function(x, u)]))
        # A x and F f(H x) cancel in part: a few hundred roundings of terms a hundred times larger.
        at = () if r is None else r(x, u)
        np.testing.assert_allclose(system.dynamics(0.0, x, u, at), wanted, rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize("name", PLANTS)
def test_every_view_is_the_plant(name: str) -> None:
    e = made(name)
    for view in (e.box(), e.sector("lower"), e.sector("middle"), e.lipschitz(), e.lipschitz(weighted=False), e.hull()):
        same(view, name)


@pytest.mark.parametrize("name", [n for n in PLANTS if n != "linear"])
def test_jacobians_lie_in_the_box_and_under_the_constant(name: str) -> None:
    _, half, _, nu = PLANTS[name]
    e = made(name)
    f = e.nonlinearity
    g = e.lipschitz().nonlinearity
    assert f is not None
    assert f.jacobian_lower is not None
    assert f.jacobian_upper is not None
    assert g is not None
    assert g.lipschitz is not None
    generator = np.random.default_rng(11)
    for _ in range(40):
        x, u = generator.uniform(-1, 1, len(half)) * half, generator.uniform(-0.02, 0.02, nu)
        J = np.asarray(jax.jacfwd(f.function)(jnp.asarray(f.H @ x), u))
        assert (f.jacobian_lower <= J + 1e-12 * abs(J)).all()
        assert (f.jacobian_upper >= J - 1e-12 * abs(J)).all()
        assert np.linalg.norm(jax.jacfwd(g.function)(jnp.asarray(g.H @ x), u), 2) <= g.lipschitz * (1 + 1e-12)


def test_constant_entries_go_to_the_linear_part_exactly() -> None:
    e = made("robot")
    np.testing.assert_array_equal(e.A[1], [-48.6, -1.25, 48.6, 0.0])
    np.testing.assert_array_equal(e.A[3], [19.5, 0.0, -19.5, 0.0])
    np.testing.assert_array_equal(e.A[[0, 2]], [[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    np.testing.assert_array_equal(e.B[:, 0], [0.0, 21.6, 0.0, 0.0])
    np.testing.assert_array_equal(e.F, [[0.0], [0.0], [0.0], [1.0]])
    np.testing.assert_array_equal(e.H, [[0.0, 0.0, 1.0, 0.0]])


def test_a_linear_plant_has_no_nonlinearity() -> None:
    e = made("linear")
    assert e.nonlinearity is None
    np.testing.assert_array_equal(e.A, [[0.0, 1.0], [-2.0, -3.0]])
    np.testing.assert_array_equal(e.B, [[0.0], [4.0]])
    assert "nothing to bound" in str(e)


def test_what_depends_on_no_state_costs_nothing() -> None:
    f = made("offset").nonlinearity
    assert f is not None
    assert not np.any(f.jacobian_lower)
    assert not np.any(f.jacobian_upper)


def test_a_tyre_reads_one_slip_angle() -> None:
    e = made("car")
    assert e.H.shape == (2, 2)
    f = e.nonlinearity
    assert f is not None
    assert f.jacobian_lower is not None
    # Two slopes instead of four: channel k reads argument k.
    np.testing.assert_array_equal(f.jacobian_lower * (1 - np.eye(2)), 0.0)


def test_rows_may_be_asked_for() -> None:
    e = embed(lambda x: [jnp.sin(x[0]), 2.0 * jnp.sin(x[0])], ([-1.0, 0.0], [1.0, 0.0]), channels="rows")
    assert e.F.shape == (2, 2)
    assert embed(lambda x: [jnp.sin(x[0]), 2.0 * jnp.sin(x[0])], ([-1.0, 0.0], [1.0, 0.0])).F.shape == (2, 1)


def test_sectors_start_where_asked() -> None:
    e = made("pendulum")
    lower, middle = e.sector("lower").nonlinearity, e.sector("middle").nonlinearity
    assert lower is not None
    assert middle is not None
    assert lower.jacobian_lower is not None
    assert middle.jacobian_lower is not None
    assert middle.jacobian_upper is not None
    assert lower.jacobian_lower[0, 0] == 0.0
    np.testing.assert_allclose(middle.jacobian_lower, -middle.jacobian_upper, rtol=1e-12)


def test_the_scheduled_form_is_the_plant() -> None:
    same(made("van der pol").polytopic(), "van der pol", lambda x, u: x[:1])
    e = embed(product, (-np.ones(3), np.ones(3)), inputs=([-1.0, -1.0], [1.0, 1.0]), outputs=np.eye(2, 3))
    plant = e.polytopic()
    assert plant.scheduling_names == ("measured_x2", "measured_u2")
    same(plant, "product", lambda x, u: [x[1], u[1]])


def test_the_scheduled_form_is_refused_with_its_reason() -> None:
    with pytest.raises(NotAccepted, match=r"depends on `x3`, which no output measures on its own \(measured: x1\)"):
        made("robot").polytopic()
    with pytest.raises(NotAccepted, match="no polynomial of what is measured: The function uses `sin`"):
        made("pendulum").polytopic()
    with pytest.raises(NotAccepted, match="without a state"):
        embed(lambda x: [x[0] * x[1] + 1.0, -x[1]], (-np.ones(2), np.ones(2)), outputs=[[0.0, 1.0]]).polytopic()


def test_outputs_may_be_a_linear_function_or_be_exchanged() -> None:
    e = embed(pendulum, ([-1.0, -3.0], [1.0, 3.0]), inputs=1, outputs=lambda x, u: [x[0] + 2.0 * x[1] + 3.0 * u[0]])
    np.testing.assert_array_equal(np.asarray(e.plant.at("C")), [[1.0, 2.0]])
    np.testing.assert_array_equal(np.asarray(e.plant.at("D")), [[3.0]])
    assert e.system(np.eye(2), bound="lipschitz").ny == 2
    assert e.system(E=[[0.0], [1.0]]).nd == 1


def test_the_table_names_bounds_and_reasons() -> None:
    text = str(made("van der pol"))
    assert "hull" in text
    assert "Least conservative of the sets: hull" in text
    assert "exact with scheduling by measured_x1" in text
    assert "refused: df1/dx3 depends on `x3`" in made("robot").table()


def test_names_and_sample_time_are_kept() -> None:
    e = embed(
        lambda x: [x[0] + 0.1 * x[1], x[1] - 0.1 * jnp.sin(x[0])],
        (-np.ones(2), np.ones(2)),
        states=("angle", "rate"),
        units={"angle": "rad"},
        dt=0.1,
    )
    assert e.plant.dt == 0.1
    assert e.plant.states == ("angle", "rate")
    assert e.hull().units["angle"] == "rad"


def test_a_jump_is_declared() -> None:
    e = embed(lambda x: [jnp.where(x[0] > 0, x[0], 2.0 * x[0]), -x[1]], (-np.ones(2), np.ones(2)))
    assert e.plant.nonlinearity is not None
    assert e.plant.nonlinearity.bound_status == "declared"
    assert "declared" in e.table()


ONES = np.ones(2)


@pytest.mark.parametrize(
    ("function", "domain", "options", "message"),
    [
        (lambda x: [x[1]], (-ONES, ONES), {}, r"`function` returns shape \(1,\) for 2 states"),
        (lambda x: x * np.nan, (-ONES, ONES), {}, "gives nan in row 0"),
        (lambda x: jnp.linalg.solve(jnp.eye(2) * x[0], x), (ONES, 2 * ONES), {}, "primitive `lu`"),
        (lambda x: x, (ONES, -ONES), {}, "lower <= upper"),
        (lambda x: x, [-ONES], {}, "two ends"),
        (lambda x: x, (ONES, np.ones(3)), {}, "one shape"),
        (lambda x, u: x * u, (-ONES, ONES), {"inputs": 2}, "depends on input 1 of 2"),
        (lambda x, u: x * u, (-ONES, ONES), {"inputs": -1}, "a number >= 0"),
        (lambda x, u: x * u, (-ONES, ONES), {"inputs": (ONES, -ONES)}, "lower <= upper"),
        (lambda x: x, (-ONES, ONES), {"inputs": 1}, r"write it as f\(x, u\)"),
        (lambda x: x if x[0] > 0 else -x, (-ONES, ONES), {}, "pure JAX"),
        (lambda x: x, (-ONES, ONES), {"outputs": lambda x: x**2}, "Row 0 of `outputs` is not linear"),
        (lambda x: x, (-ONES, ONES), {"outputs": np.ones((1, 3))}, "needs shape"),
    ],
)
def test_what_cannot_be_embedded_is_refused(function: Any, domain: Any, options: dict[str, Any], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        embed(function, domain, **options)


def test_an_unbounded_jacobian_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    # With all its pieces the search only takes longer to give up.
    few = partial(embedding_jacobian.enclose_jacobian, max_pieces=20)
    monkeypatch.setattr(embedding_jacobian, "enclose_jacobian", few)
    with pytest.raises(BadInput, match="not known to be bounded on `domain`"):
        embed(lambda x: jnp.sqrt(x), (np.zeros(1), np.ones(1)))


WHOLE = st.integers(-4, 4).map(float)


@settings(max_examples=6, deadline=None, derandomize=True)
@given(st.lists(WHOLE, min_size=8, max_size=8))
def test_random_polynomials_are_split_to_rounding(c: list[float]) -> None:
    def rates(x: Any, u: Any) -> Any:
        return [
            c[0] * x[0] + c[1] * x[1] * x[0] + c[2] * u[0] + c[3],
            c[4] * x[1] + c[5] * x[0] ** 2 + c[6] * x[1] ** 3 + c[7] * u[0],
        ]

    e = embed(rates, (-ONES, ONES), inputs=1, tolerance=0.05)
    x, u = np.random.default_rng(2).uniform(-1, 1, (2, 2))
    np.testing.assert_allclose(e.plant.dynamics(0.0, x, u[:1]), rates(x, u), rtol=0, atol=1e-13)
    np.testing.assert_array_equal(e.A * (abs(e.A) > 0), e.A)
    np.testing.assert_array_equal(e.B[:, 0], [c[2], c[7]])
