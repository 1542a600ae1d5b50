"""The unknown-input observer: its identities, one step by hand, and what runs: start sets, precision, compilation."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.core import BadInput
from luenberger.observers.unknown_input import DecoupledState, UnknownInputObserver
from luenberger.sets import Zonotope
from luenberger.systems import Switched, System
from observers import gust_drive as gust


def matrices(mode: System) -> dict[str, np.ndarray]:
    """Nominal matrices of a mode, its gain and what follows from it, by plain algebra."""
    nominal = mode.freeze(**mode.uncertainty)
    found = {letter: np.asarray(nominal.at(letter)) for letter in "ABCEGN"}
    K, H = gust.decoupled(mode)
    gain = np.asarray(K({}))
    P = np.eye(2) + H @ found["C"]
    return found | {"K": gain, "H": H, "P": P, "loop": P @ found["A"] - gain @ found["C"]}


def test_identities_of_the_car() -> None:
    plant = gust.three_modes()
    observer = gust.observer(plant)

    @jax.jit
    def loop(speed: Any) -> Any:
        def predicted(x: Any) -> Any:
            state = eqx.tree_at(lambda s: s.prediction, observer.init(jnp.zeros(2)), x)
            return observer.step(state, jnp.zeros(1), jnp.zeros(1), speed)[0].prediction

        return jax.jacobian(predicted)(jnp.ones(2))

    for mode, zero in enumerate((0.0353, 0.3948, 0.5457)):
        m = matrices(plant.modes[mode])
        np.testing.assert_allclose(m["H"], [[-4.16667], [-1.0]], atol=1e-5)
        np.testing.assert_allclose(m["P"], [[1.0, -4.16667], [0.0, 0.0]], atol=1e-5)
        np.testing.assert_allclose(m["P"] @ m["E"], 0.0, atol=1e-18)
        # The digits are those of the expected value.
        np.testing.assert_allclose(m["loop"], np.diag([zero, 0.0]), atol=1e-4)
        np.testing.assert_allclose(m["loop"] @ m["H"] - m["K"], m["P"] @ m["A"] @ m["H"], atol=1e-12)
        np.testing.assert_allclose(loop(np.array([gust.SPEEDS[mode]])), m["loop"], atol=1e-12)


def test_the_estimate_is_the_printed_recursion() -> None:
    plant, runs = gust.three_modes(), gust.cars(120, random=2)
    found = gust.boxes(gust.observer(plant), runs)
    modes = [matrices(mode) for mode in plant.modes]
    which = np.digitize(runs.speed, gust.ENDS[1:3])
    for i in range(3):
        xh, expected = np.zeros(2), []
        for k in range(120):
            expected.append(xh)
            m = modes[which[i, k]]
            if k + 1 < 120:
                after = m["H"] @ runs.y[i, k + 1]
                xh = m["loop"] @ xh + m["K"] @ runs.y[i, k] + m["P"] @ m["B"] @ runs.u[i, k] - after
        # Sums in another order.
        np.testing.assert_allclose(np.asarray(found.x)[i], expected, atol=1e-13)


def test_generators_of_one_step_after_a_switch() -> None:
    plant = gust.three_modes(steering_error=0.01)
    observer = gust.observer(plant, count=40)
    m = matrices(plant.modes[1])
    H, start = np.array([[0.3], [-0.7]]), np.array([[0.02, 0.01], [-0.01, 0.03]])
    padded = np.pad(start, ((0, 0), (0, 38)))
    x, y, u = np.array([0.1, 0.05]), np.array([0.04]), np.array([0.03])
    state = DecoupledState(jnp.asarray(x + H @ y), jnp.asarray(padded), jnp.asarray(H))
    after, estimate = eqx.filter_jit(observer.step)(state, u, y, np.array([13.0]))
    v = np.diag([0.005, 0.01])
    hull = np.abs(start).sum(axis=1) + np.abs(H[:, 0]) * 0.005
    np.testing.assert_allclose(np.asarray(estimate.upper), x + hull, rtol=1e-12)
    a, b, vx = 1.2, 1.6, gust.SPEEDS[1]
    directions = gust.STEP * np.array([[1 / 1500, 1 / 1500], [a / 2500, -b / 2500]]) * [6e3, 6.5e3]
    slips = np.array([[-1 / vx, -a / vx], [-1 / vx, b / vx]])
    largest = np.abs(slips @ x + [0.03, 0.0]) + np.abs(slips) @ hull + [0.01, 0.0]
    noise = (m["loop"] @ H @ m["G"] - m["K"] @ m["G"] - m["P"] @ m["B"] @ m["N"]) @ v
    expected = [m["loop"] @ start, noise, m["P"] @ directions * largest]
    # Factors may be scaled and signed at will, so the sets are compared by their support.
    for angle in np.linspace(0, np.pi, 7):
        d = np.array([np.cos(angle), np.sin(angle)])
        plain = sum(np.abs(d @ part).sum() for part in expected)
        np.testing.assert_allclose(Zonotope(jnp.zeros(2), after.generators).support(d), plain, rtol=1e-9, atol=1e-15)
    np.testing.assert_array_equal(after.decoupling, m["H"])


def test_the_start_set_is_the_box_or_the_zonotope_given() -> None:
    observer = gust.observer(gust.three_modes(), initial_half_width=[0.1, 0.02])
    quiet = np.zeros(1)
    _, first = observer.step(observer.init(np.array([1.0, 2.0])), quiet, quiet, np.array([9.0]))
    np.testing.assert_allclose(np.array([first.lower, first.upper]), [[0.9, 1.98], [1.1, 2.02]])
    turned = Zonotope.of([0.0, 0.1], [[0.1, 0.2, 0.0], [0.1, -0.1, 0.3]])
    _, first = observer.step(observer.init(turned), quiet, np.ones(1), np.array([9.0]))
    np.testing.assert_allclose(np.array([first.lower, first.upper]), [[-0.3, -0.4], [0.3, 0.6]])
    with pytest.raises(BadInput, match="at most 20"):
        observer.init(Zonotope.of([0.0, 0.0], np.ones((2, 21))))
    with pytest.raises(BadInput, match="2 states"):
        observer.init(np.zeros(3))


def test_single_precision_stays_and_still_contains() -> None:
    runs = gust.cars(200, random=8)
    observer = gust.observer(gust.three_modes())
    box = gust.boxes(observer, runs, jnp.float32)
    assert {a.dtype for a in (box.x, box.lower, box.upper)} == {np.dtype("float32")}  # type: ignore[union-attr]
    # Single precision of values up to one, gathered over a few steps.
    assert not gust.leavers(box, runs.x, 1e-5).any()
    np.testing.assert_allclose(gust.mean_width(box), gust.mean_width(gust.boxes(observer, runs)), rtol=1e-4)


def test_equal_plants_compile_once() -> None:
    traces = []

    @eqx.filter_jit
    def advance(observer: UnknownInputObserver, state: Any, y: Any) -> Any:
        traces.append(1)
        return observer.step(state, jnp.zeros(1), y, jnp.asarray([9.0]))[0]

    for scale in (1.0, 0.5, 2.0):
        observer = gust.observer(gust.three_modes(), initial_half_width=scale * gust.START)
        state = observer.init(jnp.zeros(2))
        for k in range(3):
            state = advance(observer, state, jnp.asarray([0.01 * k]))
    assert len(traces) == 1


def test_an_estimate_outside_the_trusted_box_gives_numbers() -> None:
    observer = gust.observer(gust.three_modes())
    state = observer.init(np.array([5.0, -3.0]))
    for _ in range(5):
        state, estimate = observer.step(state, np.zeros(1), np.ones(1), np.array([17.0]))
        assert all(np.isfinite(part).all() for part in jax.tree.leaves((state, estimate)))
        assert np.all(np.asarray(estimate.lower) < np.asarray(estimate.upper))
    # The factors then follow the set, as without a trusted box.
    free = gust.observer(gust.three_modes(), state_bound=None)
    one, other = (
        o.step(o.init(np.array([5.0, -3.0])), np.zeros(1), np.ones(1), np.array([17.0]))[0] for o in (observer, free)
    )
    np.testing.assert_allclose(one.generators, other.generators)


def test_a_single_plant_and_a_single_matrix_are_enough() -> None:
    mode = gust.three_modes().modes[0]
    K, H = gust.decoupled(mode)
    options: dict[str, Any] = {"initial_half_width": gust.START}
    alone = UnknownInputObserver(mode, K, H, **options)
    listed = UnknownInputObserver(Switched.of(mode), [np.asarray(K({}))], [H.tolist()], **options)
    quiet = np.zeros(1)
    one, other = (o.step(o.init(np.ones(2)), quiet, quiet, np.zeros(0))[0] for o in (alone, listed))
    np.testing.assert_array_equal(one.prediction, other.prediction)
    assert alone.states == ("lateral_speed", "yaw_rate")
    assert (alone.count, alone.dt) == (20, gust.STEP)


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"count": 1}, "at least one generator"),
        ({"uncertainty": "loose"}, "uncertainty"),
        ({"initial_half_width": [0.1]}, "2 numbers"),
        ({"state_bound": [0.8, -0.3]}, "2 numbers"),
        ({"state_bound": None, "closed_loop": False}, "finite"),
        ({"state_bound": [0.8, np.inf], "closed_loop": False}, "finite"),
    ],
)
def test_options_that_do_not_fit_are_refused(options: dict[str, Any], match: str) -> None:
    with pytest.raises(BadInput, match=match):
        gust.observer(gust.three_modes(), **options)
