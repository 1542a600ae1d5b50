"""Monitors of what was assumed: each breaks where it is broken and nowhere else, and a lost state is explained by one."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.core import BadInput
from luenberger.observers.enclosed_plant import Enclosed
from luenberger.observers.interval import IntervalObserver
from luenberger.observers.monitor import (
    Assumption,
    Drive,
    Sector,
    box_excess,
    containment_excess,
    crossing,
    explain,
    monitor,
    output_excess,
    rate_excess,
    sector_excess,
)
from luenberger.observers.observer import Estimate
from luenberger.systems import Parameter, System
from luenberger.systems.exponential import HoldOrder, affine_hold
from luenberger.vehicle import slip_angle_plant, wang_car

STIFFNESS, NOISE = ((60e3, 90e3), (35e3, 65e3)), (1e-3, 0.02, 5e-3)
TIME = 0.01 * np.arange(5)


def car(**options: Any) -> System:
    return slip_angle_plant(wang_car, (10.0, 40.0), (-8.0, 4.0), stiffness=STIFFNESS, **options)


def named(found: tuple[Assumption, ...]) -> dict[str, Assumption]:
    return {a.name: a for a in found}


def test_excess_by_hand() -> None:
    np.testing.assert_allclose(box_excess(np.array([0.0, 1.5, 3.0]), 1.0, 2.0), [1.0, -0.5, 1.0])
    assert float(rate_excess(1.0, 1.3, 0.1, 2.0)) == pytest.approx(1.0)
    # Force 500 N at 0.01 rad is a secant of 50 kN/rad, 100 N below the softest; the sign of the slip angle does not matter.
    for sign in (1.0, -1.0):
        assert float(sector_excess(sign * 0.01, sign * 500.0, (60e3, 90e3), 40.0)) == pytest.approx(60.0)
        assert float(sector_excess(sign * 0.01, sign * 700.0, (60e3, 90e3))) == pytest.approx(-100.0)
    assert float(crossing(np.array([0.0, 2.0]), np.array([1.0, 1.5]))) == pytest.approx(0.5)
    assert float(containment_excess(np.array([0.0, 2.0]), np.zeros(2), np.ones(2))) == pytest.approx(1.0)


def test_excess_inside_a_scan() -> None:
    def step(before: Any, now: Any) -> Any:
        return now, rate_excess(before, now, 0.1, 1.0)

    _, excess = jax.lax.scan(step, jnp.array(0.0), jnp.array([0.05, 0.1, 0.5]))
    np.testing.assert_allclose(excess, [-0.5, -0.5, 3.0], atol=1e-12)


def test_assumption_in_numbers_and_words() -> None:
    held = Assumption("range", TIME, np.full(5, -1.0))
    assert held.share == 1.0
    assert held.first_break_time is None
    assert held.sentence == "`range` held at every sample."
    broken = Assumption("range", TIME, np.array([-1, -1, 0.2, 0.5, -1]), "m/s", needs_truth=True)
    assert broken.share == pytest.approx(0.6)
    assert broken.first_break_time == pytest.approx(0.02)
    assert broken.worst == 0.5
    assert "60.0 %" in broken.sentence
    assert "t = 0.02 s, by at most 0.5 m/s (judged with the truth)" in broken.sentence


def test_scheduling_is_watched_as_read_and_as_it_is() -> None:
    plant = car(scale_error=((-0.1, 0.1), (-0.2, 0.2)))
    true = np.stack([np.array([0.05, 0.05, 0.09, 0.11, 0.05]), np.full(5, -8.0)], axis=1)
    read = true * np.array([[1.0, 1.0], [1.2, 1.0], [1.0, 1.2], [1.0, 1.0], [1.0, 1.3]])
    found = named(monitor(plant, Drive(TIME, r=read, true_r=true)))
    # The reading may be ten percent wrong: 0.11 is no contradiction, but it is no true 1/vx above 10 m/s.
    assert found["range of inverse_speed"].held.all()
    np.testing.assert_array_equal(found["range of true inverse_speed"].held, [1, 1, 1, 0, 1])
    # 1.2 is above 1 / (1 - 0.1).
    np.testing.assert_array_equal(found["error of inverse_speed"].held, [1, 0, 1, 1, 1])
    np.testing.assert_array_equal(found["error of acceleration"].held, [1, 1, 1, 1, 0])
    np.testing.assert_array_equal(found["range of acceleration"].held, [1, 1, 1, 1, 0])
    # d(1/vx)/dt is at most 8 / 100 s/m/s, so 8e-4 a sample.
    np.testing.assert_array_equal(found["rate of true inverse_speed"].held, [1, 1, 0, 0, 0])
    assert not found["range of inverse_speed"].needs_truth
    assert found["range of true inverse_speed"].needs_truth


def test_truth_of_tyres_noise_and_forces() -> None:
    plant = car(noise=NOISE, force_offset=30.0)
    noise = np.zeros((5, 3))
    noise[2] = [0.0, 0.021, -0.004]
    disturbance = np.array([[0, 0], [30, -30], [31, 0], [0, -31], [0, 0]], float)
    stiffness = {"front_stiffness": np.array([60e3, 90e3, 91e3, 75e3, 59e3])}
    axle = Sector(
        "rear axle", np.array([0.0, 0.01, 0.01, -0.01, 0.0]), np.array([20, 300, 400, -700, 31.0]), STIFFNESS[1], 30.0
    )
    found = named(
        monitor(plant, Drive(TIME, noise=noise, disturbance=disturbance, uncertainty=stiffness, sectors=[axle]))
    )
    assert found["noise 1"].held.all()
    np.testing.assert_array_equal(found["noise 2"].held, [1, 1, 0, 1, 1])
    np.testing.assert_array_equal(found["disturbance 1"].held, [1, 1, 0, 1, 1])
    np.testing.assert_array_equal(found["disturbance 2"].held, [1, 1, 1, 0, 1])
    np.testing.assert_array_equal(found["range of front_stiffness"].held, [1, 1, 0, 1, 0])
    np.testing.assert_array_equal(found["sector of rear axle"].held, [1, 0, 1, 0, 0])
    assert all(a.needs_truth for a in found.values())


def test_outputs_that_the_bounds_cannot_explain() -> None:
    plant = car(noise=NOISE)
    enclosed = Enclosed.of(plant, None, False, {"noise": True, "offset": True, "scheduling_error": True})
    lower, upper, u, r = np.array([0.0, 0.01]), np.array([0.01, 0.03]), np.zeros(3), np.array([0.05, 0.0])
    # y = af - ar lies in [-0.03, 0], read with at most 1e-3 + 2.37 * 0.05 * 5e-3 of noise.
    slack = 1e-3 + 2.37 * 0.05 * 5e-3
    for y, expected in ((0.0, -slack), (0.01, 0.01 - slack), (-0.04, 0.01 - slack)):
        assert float(output_excess(enclosed, lower, upper, u, np.array([y]), r)) == pytest.approx(expected, abs=1e-12)


def test_outputs_are_judged_for_every_true_scheduling() -> None:
    plant = car(scale_error=((-0.1, 0.1), (0.0, 0.0)), output="slip_constraint")
    enclosed = Enclosed.of(plant, None, False, {"noise": True, "offset": True, "scheduling_error": True})
    x, r = np.array([0.01, 0.02]), np.array([0.05, 0.0])
    u = np.array([0.1, 0.0, 0.5])
    low, high = enclosed.outputs(x, x, u, r)
    ends = [x[0] - x[1] - u[0] + 2.37 * u[2] * 0.05 * f for f in (0.9, 1.1)]
    np.testing.assert_allclose([low[0], high[0]], ends, rtol=1e-12)


def test_bounds_are_watched() -> None:
    plant = car()
    lower, upper = np.zeros((5, 2)), np.full((5, 2), 0.01)
    lower[3, 1] = 0.02
    x = np.full((5, 2), 0.005)
    x[0, 0] = 0.012
    y, u, r = np.zeros((5, 1)), np.zeros((5, 3)), np.tile([0.05, 0.0], (5, 1))
    y[4] = 0.5
    drive = Drive(
        TIME,
        r=r,
        u=u,
        y=y,
        x=x,
        estimate=Estimate(jnp.zeros((5, 2)), lower=jnp.asarray(lower), upper=jnp.asarray(upper)),
    )
    found = named(monitor(plant, drive))
    np.testing.assert_array_equal(found["lower bound below the upper"].held, [1, 1, 1, 0, 1])
    np.testing.assert_array_equal(found["state inside at the start"].held, [0, 1, 1, 1, 1])
    assert found["state inside at the start"].worst == pytest.approx(0.002)
    # Bounds that cross still span an interval; the crossing is watched apart.
    np.testing.assert_array_equal(found["outputs agree with the bounds"].held, [1, 1, 1, 1, 0])


def test_explanation_looks_back_as_far_as_the_memory() -> None:
    time = 0.1 * np.arange(10)
    violation = np.full(10, -1.0)
    violation[[4, 5, 9]] = [0.1, 0.3, 0.2]
    early = Assumption("early", time, np.where(np.arange(10) == 2, 1.0, -1.0))
    late = Assumption("late", time, np.where(np.arange(10) == 6, 1.0, -1.0))
    first, second = explain(time, violation, [early, late], memory=0.25)
    assert (first.start, first.stop, first.worst) == (pytest.approx(0.4), pytest.approx(0.5), 0.3)
    assert first.causes == ("early",)
    assert second.causes == ()
    assert explain(time, violation, [early, late], memory=0.45)[1].causes == ("late",)
    assert explain(time, np.full(10, -1.0), [early], memory=1.0) == ()
    with pytest.raises(BadInput, match="memory"):
        explain(time, violation, [], memory=-1.0)


def test_tyre_outside_its_box_is_found_to_have_lost_the_state() -> None:
    plant, dt, count = car(), 0.01, 300
    observer = IntervalObserver(
        plant, np.zeros((2, 1)), dt, transform=np.diag([1.0, -1.0]), initial_half_width=[0.01, 0.01]
    )
    r, time = np.array([0.05, 0.0]), dt * np.arange(count)
    u = np.stack([np.zeros(count), 0.5 * np.cos(6 * time), 0.3 * np.sin(6 * time)], axis=1)
    rear = np.where((time > 1.0) & (time < 1.5), 10e3, 50e3)

    def advance(carry: Any, sample: Any) -> Any:
        x, state = carry
        u, stiffness = sample
        state, estimate = observer.step(state, u, jnp.zeros(1), r)
        values = {"inverse_speed": r[0], "acceleration": r[1], "front_stiffness": 75e3, "rear_stiffness": stiffness}
        A, B = (jnp.asarray(plant.polynomial(letter)(values)) for letter in "AB")
        return (affine_hold(A, B @ u, x, dt, HoldOrder(12, 0)), state), (x, estimate)

    begin = (jnp.zeros(2), observer.init(np.zeros(2)))
    _, (x, estimate) = jax.jit(lambda: jax.lax.scan(advance, begin, (u, rear)))()
    x = np.asarray(x)
    drive = Drive(time, r=np.tile(r, (count, 1)), u=u, x=x, estimate=estimate, uncertainty={"rear_stiffness": rear})
    found = monitor(plant, drive)
    violation = np.asarray(containment_excess(x, estimate.lower, estimate.upper))
    stretches = explain(time, violation, found, memory=0.5)
    assert stretches
    assert all(s.causes == ("range of rear_stiffness",) for s in stretches)
    assert stretches[0].start > 1.0
    assert named(found)["range of rear_stiffness"].first_break_time == pytest.approx(1.01)


def test_rate_of_an_exact_parameter_is_watched_as_read() -> None:
    plant = System.lpv([[-1.0]], parameters=[Parameter("p", 0.0, 1.0, rate=2.0)])
    found = named(monitor(plant, Drive(TIME, r=np.array([[0.0], [0.01], [0.05], [0.05], [0.05]]))))
    np.testing.assert_array_equal(found["rate of p"].held, [1, 1, 0, 1, 1])


def test_signals_that_do_not_fit() -> None:
    for drive in (
        Drive(TIME, r=np.zeros((5, 3))),
        Drive(TIME, uncertainty={"grip": np.zeros(5)}),
        Drive(TIME, r=np.full((5, 2), np.nan)),
    ):
        with pytest.raises(BadInput):
            monitor(car(), drive)
