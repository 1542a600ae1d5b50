"""Monitors of guaranteed estimators: a clean run names nothing, and each broken assumption is named and no other."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.core import BadInput
from luenberger.experiment.published.ifqir_drive import drive
from luenberger.observers.monitor import Assumption, Drive, containment_excess, explain
from luenberger.observers.monitor_sets import CONTRADICTIONS, monitor_sets
from luenberger.observers.observer import Estimate
from luenberger.observers.unknown_input import UnknownInputObserver
from luenberger.observers.zonotopic import ZonotopicFilter, ZonotopicKalmanFilter
from luenberger.sets import Zonotope
from luenberger.systems import Switched
from observers import gust_drive as gust
from observers.gust_logs import SAMPLES, STEERING_ERROR, STIFFNESS, continuous, euler, log, unknowns

ZERO = np.zeros(2)


@cache
def plant(dwell: int = 1, gust_bound: float | None = None) -> Switched:
    made = gust.three_modes(steering_error=STEERING_ERROR, gust_bound=gust_bound)
    return Switched.of(made.modes, "speed", made.ends, dwell=dwell, unit="m/s")


@cache
def estimator(gust_bound: float | None = None) -> UnknownInputObserver:
    return gust.observer(plant(1, gust_bound))


@cache
def filtered(kind: type[ZonotopicFilter] | type[ZonotopicKalmanFilter] = ZonotopicFilter) -> Any:
    return kind(plant(1, 800.0), initial_half_width=gust.START, count=20, state_bound=gust.STATE_BOUND)


WATCHED = [
    "readings finite",
    "limits of speed",
    "dwell",
    "mode of true speed",
    "speed frozen in its mode",
    "range of front_stiffness",
    "range of rear_stiffness",
    "noise 1 (yaw_rate)",
    "noise 2 (steering)",
    "estimate finite",
    "outputs agree with the set",
    "set follows from the one before",
    "set meets the state bound",
    "state bound of lateral_speed",
    "state bound of yaw_rate",
    "state inside at the start",
    "sampling",
]


def watched(found: Drive, **options: Any) -> dict[str, Assumption]:
    options = {"frozen": gust.SPEEDS, "next_state": euler} | options
    judged = monitor_sets(options.pop("system", plant()), found, options.pop("observer", estimator()), ZERO, **options)
    return {a.name: a for a in judged}


def broken(found: dict[str, Assumption]) -> list[str]:
    """What is broken, the monitors that prove a contradiction without a culprit left out."""
    return [name for name, a in found.items() if not a.held.all() and name not in CONTRADICTIONS]


@cache
def clean() -> Drive:
    return log(unknowns())


@eqx.filter_jit
def box(observer: Any, u: Any, y: Any, r: Any) -> Estimate:
    start = observer.init(jnp.zeros(2))
    return jax.lax.scan(lambda state, now: observer.step(state, *now), start, (u, y, r))[1]


def outside(observer: Any, run: Drive) -> np.ndarray:
    estimate = box(observer, *(jnp.asarray(s) for s in (run.u, run.y, run.r)))
    # A state on its bound is not outside: rounding of a run.
    return np.asarray(containment_excess(run.x, estimate.lower, estimate.upper)) - 1e-12


@pytest.mark.parametrize("car", [0, 6])
def test_a_clean_run_names_nothing(car: int) -> None:
    found = watched(log(unknowns(), car))
    assert {name for name, a in found.items() if not a.held.all()} == set()
    assert list(found) == WATCHED


@pytest.mark.parametrize("car", [0, 6])
@pytest.mark.parametrize("kind", [ZonotopicFilter, ZonotopicKalmanFilter])
def test_a_clean_run_of_a_zonotopic_observer_names_nothing(kind: Any, car: int) -> None:
    found = watched(log(unknowns(), car), system=plant(1, 800.0), observer=filtered(kind))
    assert {name for name, a in found.items() if not a.held.all()} == set()
    assert found["disturbance 1"].worst == pytest.approx(0.0, abs=1e-8)


def doubled(which: str, column: int, size: float = 2.0) -> Drive:
    """One unknown twice its bound for ten samples."""
    unknown = unknowns()
    getattr(unknown, which)[60:70, 0, column] = size
    return log(unknown)


def wrong_start() -> Drive:
    unknown = unknowns()
    unknown.start[0] = [0.0, 3.0]
    return log(unknown)


def swerving() -> Drive:
    return log(unknowns(), steering=4.0 * drive(SAMPLES).steering)


def moving() -> Drive:
    return log(unknowns(), varying=True)


def restless() -> Drive:
    """Into the second mode and back within two samples."""
    way = drive(SAMPLES)
    speed = way.speed.copy()
    speed[20:22] = 11.5
    mode = (speed >= 11.0).astype(int) + (speed >= 16.0)
    return log(unknowns(), speed=speed, mode=mode, local=np.array(gust.SPEEDS)[mode])


def misread() -> Drive:
    """The speed is read in the wrong mode at one sample."""
    run = replace(log(unknowns()), r=np.full((SAMPLES, 1), gust.SPEEDS[0]))
    return replace(run, true_r=np.where(np.arange(SAMPLES)[:, None] == 70, 12.0, gust.SPEEDS[0]))


BREAKS: dict[str, tuple[Any, list[str]]] = {
    "noise": (lambda: doubled("noise", 0), ["noise 1 (yaw_rate)"]),
    "steering": (lambda: doubled("noise", 1), ["noise 2 (steering)"]),
    "front axle": (lambda: doubled("stiffness", 0), ["range of front_stiffness"]),
    "rear axle": (lambda: doubled("stiffness", 1, -1.5), ["range of rear_stiffness"]),
    "start": (wrong_start, ["state inside at the start"]),
    "state bound": (swerving, ["state bound of lateral_speed", "state bound of yaw_rate"]),
    "speed": (moving, ["speed frozen in its mode"]),
    "dwell": (restless, ["dwell"]),
}


@pytest.mark.parametrize("what", BREAKS)
def test_what_is_broken_is_named_and_nothing_else(what: str) -> None:
    made, expected = BREAKS[what]
    found = watched(made(), system=plant(dwell=3))
    assert broken(found) == expected
    where = [found[name].first_break_time for name in expected]
    if what in ("noise", "steering", "front axle", "rear axle"):
        assert where == [pytest.approx(60 * gust.STEP)]
        # Nothing else happens, so nothing is broken but for these ten samples.
        assert int((~found[expected[0]].held).sum()) == 10


def test_a_speed_read_in_the_wrong_mode_is_named() -> None:
    found = watched(misread(), observer=None, next_state=None)
    assert broken(found) == ["mode of true speed", "speed frozen in its mode"]
    assert found["mode of true speed"].worst == pytest.approx(1.0)
    assert found["speed frozen in its mode"].worst == pytest.approx(3.5)
    beyond = monitor_sets(plant(), Drive(np.arange(3.0), r=np.array([[5.0], [12.0], [21.0]])))
    (limits,) = [a for a in beyond if a.name == "limits of speed"]
    np.testing.assert_allclose(limits.excess, [1.0, -6.0, 21.0 - 19.899])
    assert not limits.needs_truth
    assert limits.unit == "m/s"


def test_explain_names_the_noise_for_every_state_that_leaves() -> None:
    unknown = unknowns()
    unknown.noise[:, 0, 0] *= 2.0
    run = log(unknown)
    found = [a for a in watched(run).values() if a.name not in CONTRADICTIONS]
    left = explain(run.time, outside(estimator(), run), found, memory=3 * gust.STEP)
    # The yaw rate leaves wherever the noise does, so in many stretches and with sound samples in between.
    assert len(left) > 10
    assert {violation.causes for violation in left} == {("noise 1 (yaw_rate)",)}


def test_explain_tells_two_causes_apart() -> None:
    unknown = unknowns()
    unknown.noise[40:45, 0, 0], unknown.stiffness[100:110, 0] = 3.0, [-6.0, 6.0]
    run = log(unknown)
    found = [a for a in watched(run).values() if a.name not in CONTRADICTIONS]
    left = explain(run.time, outside(estimator(), run), found, memory=3 * gust.STEP)
    early = {v.causes for v in left if v.start < 80 * gust.STEP}
    late = {v.causes for v in left if v.start > 80 * gust.STEP}
    assert early == {("noise 1 (yaw_rate)",)}
    assert late == {("range of front_stiffness", "range of rear_stiffness")}


def test_sampling_of_the_continuous_car_is_named() -> None:
    run = log(unknowns())
    found = watched(run, next_state=continuous)
    assert broken(found) == ["sampling"]
    worst = found["sampling"].worst
    # Euler's rule at 0.06 s is off by some centimetres per second, not by rounding.
    assert 1e-3 < worst < 0.1
    assert broken(watched(run, next_state=continuous, sampling_bound=[worst + 1e-9] * 2)) == []


def test_sampling_with_parameters_that_nobody_knows() -> None:
    run = replace(clean(), uncertainty={})

    def stiff(step: Any, **scale: float) -> Any:
        known = {name: scale.get(name, 1.0) * middle for name, middle in STIFFNESS.items()}
        return lambda x, u, d, r, q: step(x, u, d, r, known)

    # Any stiffness of the interval explains the next state, one beyond does not.
    assert broken(watched(run, next_state=stiff(euler, front_stiffness=1.1))) == []
    assert broken(watched(run, next_state=stiff(euler, front_stiffness=1.2))) == ["sampling"]


def test_noise_and_steering_are_judged_by_what_they_do_where_they_are_not_known_themselves() -> None:
    run = doubled("noise", 0)
    assert run.noise is not None
    true = run.u - run.noise[:, 1:]
    assert broken(watched(replace(run, noise=None), true_input=true)) == ["noise of yaw_rate"]
    off = np.where(np.arange(SAMPLES)[:, None] == 3, 1.5 * STEERING_ERROR, 0.0)
    found = watched(replace(clean(), noise=None), true_input=clean().u - off, next_state=None)
    assert broken(found) == ["error of steering"]
    assert found["error of steering"].worst == pytest.approx(0.5 * STEERING_ERROR)


def test_gusts_beyond_their_bound_contradict_consecutive_sets() -> None:
    weak = log(unknowns())
    strong = log(unknowns(), gust=5.0 * drive(SAMPLES).gust)
    bounded = {"system": plant(1, 800.0), "observer": estimator(800.0)}
    name = "set follows from the one before"
    assert watched(weak, **bounded)[name].held.all()
    found = watched(strong, **bounded)
    assert "disturbance 1" in broken(found)
    assert not found[name].held.all()
    early, late = found["disturbance 1"].first_break_time, found[name].first_break_time
    assert early is not None
    assert late is not None
    assert late >= early
    # A gust without a bound explains everything.
    assert watched(strong)[name].held.all()


def test_a_set_outside_the_state_bound_is_seen_on_the_road() -> None:
    run = log(unknowns(), steering=8.0 * drive(SAMPLES).steering)
    road = Drive(run.time, r=run.r, u=run.u, y=run.y)
    found = watched(road, next_state=None)
    assert not any(a.needs_truth for a in found.values())
    assert not found["set meets the state bound"].held.all()
    assert broken(found) == []


def test_outputs_contradict_a_zonotopic_prediction() -> None:
    run = log(unknowns())
    assert run.y is not None
    run.y[70] += 0.2
    road = Drive(run.time, r=run.r, u=run.u, y=run.y)
    found = watched(road, system=plant(1, 800.0), observer=filtered(), next_state=None)
    assert found["outputs agree with the set"].first_break_time == pytest.approx(70 * gust.STEP)
    # The unknown-input observer believes what it measures.
    assert watched(road, next_state=None)["outputs agree with the set"].held.all()


def test_readings_that_are_not_finite() -> None:
    run = log(unknowns())
    for signal in ("y", "r"):
        lost = replace(run, **{signal: np.where(np.arange(SAMPLES)[:, None] == 50, np.nan, getattr(run, signal))})
        found = watched(lost)
        assert int((~found["readings finite"].held).sum()) == 1
        assert found["readings finite"].first_break_time == pytest.approx(50 * gust.STEP)
        assert set(broken(found)) <= {"readings finite", "estimate finite"}
        assert all(found[name].held.all() for name in CONTRADICTIONS)


def test_a_scheduled_car_with_a_speed_read_wrong() -> None:
    system = gust.car(steering_error=STEERING_ERROR, speed_error=0.2)
    observer = gust.observer(system)
    run = log(unknowns(), varying=True)
    true = np.clip(drive(SAMPLES).speed, 6.0, None)
    off = 0.2 * np.sin(np.arange(SAMPLES))
    options = {"system": system, "observer": observer, "frozen": None}

    def signals(speed: np.ndarray) -> np.ndarray:
        return np.stack([speed, 1 / speed], axis=1)

    right = replace(run, r=signals(true + off), true_r=signals(true))
    assert broken(watched(right, **options)) == []
    assert {"range of speed", "error of inverse_speed"} <= set(watched(right, **options))
    off[40] = 0.5
    found = watched(replace(right, r=signals(true + off)), **options)
    assert broken(found) == ["error of speed"]
    assert found["error of speed"].worst == pytest.approx(0.3)
    # Beyond the range by more than the reading may be off.
    fast = np.where(np.arange(SAMPLES) == 80, 20.2, true + 0.0)
    assert broken(watched(replace(right, r=signals(fast), true_r=None), **options, next_state=None)) == [
        "range of speed"
    ]


def test_a_start_set_that_is_no_box() -> None:
    start = Zonotope.of(ZERO, [[0.02, 0.002], [0.02, -0.002]])
    run = clean()
    for first, inside in (([0.02, 0.02], True), ([0.02, -0.02], False)):
        x = np.array(run.x)
        x[0] = first
        found = monitor_sets(plant(), replace(run, x=x), estimator(), start)
        assert [a.held.all() for a in found if a.name == "state inside at the start"] == [inside]


def test_what_does_not_fit_is_refused() -> None:
    run = clean()
    bad: Sequence[tuple[Drive, dict[str, Any], str]] = (
        (replace(run, r=np.zeros((SAMPLES, 2))), {}, "`r`"),
        (replace(run, x=np.full((SAMPLES, 2), np.nan)), {}, "`x`"),
        (replace(run, uncertainty={"grip": np.zeros(SAMPLES)}), {}, "grip"),
        (replace(run, y=None), {}, "x0"),
        (run, {"frozen": [8.5, 13.5]}, "frozen"),
        (run, {"sampling_bound": [0.1]}, "sampling_bound"),
        (replace(run, disturbance=None), {}, "next_state"),
    )
    for drive_, options, match in bad:
        with pytest.raises(BadInput, match=match):
            watched(drive_, **options)
    with pytest.raises(BadInput, match="x0"):
        monitor_sets(plant(), run, estimator())
