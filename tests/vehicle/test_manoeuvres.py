"""Every manoeuvre: rates against finite differences, shapes at their printed instants, batches by vmap."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.core import BadInput
from luenberger.simulate import TruthModel, simulate
from luenberger.vehicle import SingleTrack, wang_car
from luenberger.vehicle.manoeuvres import (
    Manoeuvre,
    braking_lane_changes,
    fishhook,
    ramp_steer,
    sine_with_dwell,
    slalom,
    step_steer,
)

ALL = [
    step_steer(0.05, 25.0),
    ramp_steer(0.01, 80 / 3.6),
    slalom(0.03, 15.0),
    sine_with_dwell(0.06),
    fishhook(-0.12),
    braking_lane_changes(),
]
named = pytest.mark.parametrize("manoeuvre", ALL, ids=lambda m: m.name)


def away_from_corners(manoeuvre: Manoeuvre, gap: float) -> np.ndarray:
    times = np.random.default_rng(3).uniform(0.0, manoeuvre.duration, 2000)
    corners = np.asarray(manoeuvre.jump_times)
    return times[np.abs(times[:, None] - corners[None, :]).min(axis=1) > gap]


@named
def test_rates_are_the_derivatives(manoeuvre: Manoeuvre) -> None:
    times, h = away_from_corners(manoeuvre, 2e-4), 1e-4
    for value, rate in ((manoeuvre.steering, manoeuvre.steering_rate), (manoeuvre.speed, manoeuvre.acceleration)):
        slope = (jax.vmap(value)(times + h) - jax.vmap(value)(times - h)) / (2 * h)
        # Central differences: h^2 / 6 of a third derivative below 100 rad/s^3, and rounding 1e-16 * 22 / h.
        np.testing.assert_allclose(jax.vmap(rate)(times), slope, atol=5e-7)


def test_rates_at_a_corner_are_those_of_the_side_to_come() -> None:
    step, sine = step_steer(0.05, 20.0, start=1.0, rise=0.5), sine_with_dwell(0.1, start=1.0)
    assert [float(step.steering_rate(t)) for t in (1.0, 1.5)] == [0.1, 0.0]
    assert float(sine.steering_rate(1.0)) == pytest.approx(0.1 * 2 * np.pi * 0.7, rel=1e-15)


def test_rates_of_the_braking_lane_changes_are_the_closed_forms() -> None:
    manoeuvre, w = braking_lane_changes(), 2 * np.pi
    for t, A, t0 in ((1.3, 0.022, 0.5), (2.9, 0.022, 0.5), (4.7, -0.045, 4.0), (6.2, -0.045, 4.0)):
        s = (t - t0) / 2.5
        rate = A * 0.7698 * w / 2.5 * (np.cos(w * s) - np.cos(2 * w * s))
        assert float(manoeuvre.steering_rate(t)) == pytest.approx(rate, abs=1e-15)
        fall = -0.5 * (55 / 3.6) * np.pi / 8 * np.sin(np.pi * (t - 1) / 8)
        assert float(manoeuvre.acceleration(t)) == pytest.approx(fall, abs=1e-14)


@named
def test_steering_is_continuous_and_the_end_comes_after_the_last_corner(manoeuvre: Manoeuvre) -> None:
    corners = manoeuvre.jump_times
    assert (np.diff(corners) >= 0).all()
    assert float(corners[-1]) <= manoeuvre.duration
    before, after = (jax.vmap(manoeuvre.steering)(corners + shift) for shift in (-1e-9, 1e-9))
    # 2e-9 s at a rate below 1 rad/s.
    np.testing.assert_allclose(before, after, atol=2e-9)
    assert float(manoeuvre.steering(0.0)) == 0.0


@named
def test_a_batch_of_amplitudes_is_a_vmap(manoeuvre: Manoeuvre) -> None:
    def twice(m: Manoeuvre) -> Manoeuvre:
        name = "amplitudes" if hasattr(m.turn, "amplitudes") else "amplitude"
        return eqx.tree_at(lambda k: getattr(k.turn, name), m, 2.0 * getattr(m.turn, name))

    pair = jax.tree.map(lambda *leaves: jnp.stack(leaves), manoeuvre, twice(manoeuvre))
    time = 0.37 * manoeuvre.duration
    values = jax.jit(jax.vmap(lambda m: m.steering(time)))(pair)
    assert values.shape == (2,)
    assert float(values[0]) == pytest.approx(float(manoeuvre.steering(time)), abs=1e-15)
    assert float(values[1]) == pytest.approx(float(twice(manoeuvre).steering(time)), abs=1e-15)


def test_factories_take_traced_amplitudes() -> None:
    peaks = jax.vmap(lambda A: fishhook(A).steering(2.0))(jnp.array([0.05, 0.1]))
    np.testing.assert_allclose(peaks, [-0.05, -0.1], atol=1e-15)


def test_sine_with_dwell_has_the_printed_shape() -> None:
    manoeuvre = sine_with_dwell(0.1, start=1.0)
    period = 1 / 0.7
    assert float(manoeuvre.steering(1.0 + period / 4)) == pytest.approx(0.1, abs=1e-15)
    pause = 1.0 + 0.75 * period
    for share in (0.0, 0.3, 1.0):
        assert float(manoeuvre.steering(pause + share * 0.5)) == pytest.approx(-0.1, abs=1e-15)
    assert float(manoeuvre.steering_rate(pause + 0.25)) == 0.0
    # The end of the last quarter, then straight; 1e-15 of rounding of the sine at 2 pi.
    assert float(manoeuvre.steering(1.0 + period + 0.5)) == pytest.approx(0.0, abs=1e-15)
    assert float(manoeuvre.speed(3.0)) * 3.6 == pytest.approx(80.0)


def test_fishhook_turns_reverses_holds_and_comes_back() -> None:
    A, ratio = 0.2, 16.0
    manoeuvre = fishhook(A, steering_ratio=ratio, start=1.0)
    turn = A / (np.deg2rad(720.0) / ratio)
    assert float(manoeuvre.steering_rate(1.0 + turn / 2)) * ratio == pytest.approx(np.deg2rad(720.0))
    assert float(manoeuvre.steering_rate(1.25 + 1.5 * turn)) * ratio == pytest.approx(-np.deg2rad(720.0))
    assert float(manoeuvre.steering(1.1 + turn)) == pytest.approx(A)
    assert float(manoeuvre.steering(1.25 + 3 * turn + 1.5)) == pytest.approx(-A)
    assert float(manoeuvre.steering(1.25 + 3 * turn + 3.0 + 1.0)) == pytest.approx(-A / 2)
    assert float(manoeuvre.steering(1.25 + 3 * turn + 5.0)) == pytest.approx(0.0, abs=1e-15)


def test_slalom_has_one_period_each_two_cones() -> None:
    manoeuvre = slalom(0.04, 18.0, spacing=18.0, cones=4, start=1.0)
    peaks = [float(manoeuvre.steering(1.0 + s)) for s in (0.5, 1.5, 2.5, 3.5, 4.2)]
    np.testing.assert_allclose(peaks, [0.04, -0.04, 0.04, -0.04, 0.0], atol=1e-15)


def test_ramp_and_step_reach_their_angles() -> None:
    assert float(ramp_steer(0.01, 20.0).steering(11.0)) == pytest.approx(0.1)
    assert float(ramp_steer(0.01, 20.0).steering(22.5)) == pytest.approx(0.2)
    assert float(step_steer(0.05, 20.0).steering(1.05)) == pytest.approx(0.025)
    assert float(step_steer(0.05, 20.0).steering_rate(1.05)) == pytest.approx(0.5)


def test_lane_changes_while_braking_are_those_of_the_formula() -> None:
    manoeuvre = braking_lane_changes()
    for t in (0.2, 0.9, 2.2, 3.3, 4.6, 6.1, 7.2):
        wanted = 0.0
        for A, t0 in ((0.022, 0.5), (-0.045, 4.0)):
            s = (t - t0) / 2.5
            if 0 <= s <= 1:
                wanted += A * 0.7698 * (np.sin(2 * np.pi * s) - 0.5 * np.sin(4 * np.pi * s))
        assert float(manoeuvre.steering(t)) == pytest.approx(wanted, abs=1e-16)
    times = np.linspace(0, 10, 20_001)
    # The amplitude is the peak: 0.7698 is 4 / sqrt(27) to four digits, and the grid misses the top by less.
    assert np.abs(jax.vmap(manoeuvre.steering)(times)).max() == pytest.approx(0.045, rel=1e-4)
    np.testing.assert_allclose(
        3.6 * jax.vmap(manoeuvre.speed)(jnp.array([0.0, 1.0, 5.0, 9.0, 10.0])), [78, 78, 50.5, 23, 23]
    )
    least = float(jax.vmap(manoeuvre.acceleration)(times).min())
    assert least == pytest.approx(-(78 - 23) / 3.6 * np.pi / 16, rel=1e-6)


def test_values_take_arrays_of_times() -> None:
    times = np.linspace(0, 4, 7)
    for manoeuvre in ALL:
        for read in (manoeuvre.steering, manoeuvre.steering_rate, manoeuvre.speed, manoeuvre.acceleration):
            np.testing.assert_allclose(read(times), jax.vmap(read)(times), atol=1e-15)


def test_a_manoeuvre_drives_a_truth_model() -> None:
    manoeuvre, track = step_steer(0.02, 20.0), SingleTrack(wang_car)
    model = TruthModel(track, track.output, track.states, track.inputs, ("r", "ay"), track.scheduling_names)
    driven = simulate(
        model,
        time=np.linspace(0, manoeuvre.duration, 101),
        x0=[0.0, 0.0],
        u=lambda t: manoeuvre.steering(t)[None],
        r=lambda t: manoeuvre.speed(t)[None],
        jump_times=manoeuvre.jump_times,
    )
    # Steady state of the neutral car: r = vx delta / (a + b); the modes at 20 m/s have died down by e^-30.
    assert driven["yaw_rate"].values[-1] == pytest.approx(20.0 * 0.02 / 2.37, rel=1e-6)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: step_steer(0.1, 20.0, rise=0.0),
        lambda: step_steer(0.1, 20.0, settle=float("inf")),
        lambda: ramp_steer(0.1, 20.0, start=-4.0),
        lambda: slalom(0.1, 20.0, cones=5),
        lambda: slalom(0.1, -20.0),
        lambda: sine_with_dwell(0.1, start=-1.0),
        lambda: fishhook(0.1, steering_ratio=0.0),
    ],
)
def test_impossible_times_are_refused(wrong) -> None:
    with pytest.raises(BadInput, match="is needed"):
        wrong()
