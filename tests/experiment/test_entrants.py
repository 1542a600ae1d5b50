"""Every kind of entrant is built, honours its knobs, and turns its states into sideslip with the right sign."""

import jax
import numpy as np
import pytest

from luenberger.core import BadInput, Outcome, Signal, Trajectory
from luenberger.experiment.entrant import Setting
from luenberger.experiment.entrants import KINDS, build, kind_of
from luenberger.replay import replay
from luenberger.simulate import TruthModel, simulate
from luenberger.vehicle import SingleTrack, carmaker_car, slip_angle_channels

DT = 0.01
SETTING = Setting(carmaker_car.with_values(friction=0.9), (10.0, 14.0), (-1.0, 1.0), DT)
ANCHORS = ("zero",)
# What an envelope is told where it may not learn: intervals round the stiffness of the car.
BOX = {"front_lower": 180e3, "front_upper": 200e3, "rear_lower": 140e3, "rear_upper": 160e3, "force_offset": 20.0}


@pytest.fixture(scope="module")
def drive() -> Trajectory:
    """A gentle slalom of the linear car at 12 m/s: every model is right, so every entrant must find the sideslip."""
    time = DT * np.arange(600)
    steering = 0.01 * np.sin(2.0 * time)
    truth = SingleTrack(SETTING.car)
    model = TruthModel(
        truth, truth.output, truth.states, inputs=truth.inputs, outputs=truth.outputs, scheduling_names=("speed",)
    )
    run = simulate(
        model, time=time, x0=np.zeros(2), u=steering[:, None], r=np.full((600, 1), 12.0), interpolation="linear"
    )
    log = Trajectory(
        time,
        [
            Signal("speed", "m/s", np.full(600, 12.0)),
            Signal("lateral_speed", "m/s", run["lateral_speed"].values),
            Signal("yaw_rate", "rad/s", run["yaw_rate"].values),
            Signal("steering", "rad", steering),
            Signal("lateral_acceleration", "m/s^2", run["lateral_acceleration"].values),
        ],
    )
    return slip_angle_channels(log, SETTING.car, time_constant=0.005)


@pytest.mark.parametrize("kind", KINDS)
def test_finds_the_sideslip_of_its_own_model(kind: str, drive: Trajectory) -> None:
    entrant = build(SETTING, {"kind": kind, **(BOX if kind.startswith("interval") else {})})
    constants = [Signal(n, "", np.full(len(drive), v)) for n, v in entrant.constants.items()]
    log = drive.with_signals(*constants)
    run = replay({"x": entrant.observer}, log, entrant.channels, np.zeros(2))
    error = entrant.sideslip(np.asarray(run.estimates["x"].x), log) - log["sideslip"].values
    share = np.sqrt(np.mean(error[100:] ** 2)) / np.sqrt(np.mean(log["sideslip"].values[100:] ** 2))
    # The force balance leaves out the yaw acceleration (14 per cent here), the unscented filter spreads its points into the
    # saturation of its brush tyres (9), samples are held over a step (1); a sign error would give 200 per cent.
    assert share == pytest.approx(1.0) if kind in ANCHORS else share < 0.18


def test_tuning_the_stiffness_of_a_filter_compiles_nothing_anew() -> None:
    for kind in ("kalman", "ekf", "ukf", "rear_axle"):
        one, two = (build(SETTING, {"kind": kind}, {"rear_stiffness": c}) for c in (1e5, 2e5))
        assert jax.tree.structure(one.observer) == jax.tree.structure(two.observer)
        assert one.constants["rear_stiffness"] == 1e5
        assert two.constants["rear_stiffness"] == 2e5


def test_knobs_are_options_or_stiffness() -> None:
    for kind in KINDS.values():
        assert set(kind.knobs) <= {*kind.options, "front_stiffness", "rear_stiffness"}


def test_refusals() -> None:
    with pytest.raises(BadInput, match="`kalman`"):
        kind_of({"kind": "kalmann"})
    with pytest.raises(BadInput, match="unknown key `decay`"):
        build(SETTING, {"kind": "lpv_luenberger", "decay": 1.0})
    for bad in (0.0, True, "fast"):
        with pytest.raises(BadInput, match="positive number"):
            build(SETTING, {"kind": "lpv_luenberger", "decay_rate": bad})


def test_nonlinear_observers_are_proved_and_go_on_beyond_their_slip_limit() -> None:
    for kind in ("lpv_extended", "lpv_two_dof"):
        entrant = build(SETTING, {"kind": kind, "friction": 0.9, "gain_limit": 4.0})
        assert entrant.design is not None
        assert entrant.design.certificate.outcome is Outcome.PROVED
        assert {"decay", "l2_gain", "gain_bound"} <= {c.kind for c in entrant.design.certificate.claims}
        limit = KINDS[kind].options["slip_limit"]
        f = entrant.design.system.nonlinearity
        assert f is not None
        assert f.is_clipped
        assert f.domain is not None
        assert f.jacobian_lower is not None
        assert f.jacobian_upper is not None
        # A brush tyre alone would be flat at a radian; continued it keeps a slope of the design.
        slope = (f(np.array([1.0, 0.0]), None) - f(np.array([0.9, 0.0]), None))[0] / 0.1
        assert float(f.jacobian_lower[0, 0]) < slope < float(f.jacobian_upper[0, 0])
        assert f.domain[1][0] == limit


def test_a_filter_may_do_without_the_accelerometer(drive: Trajectory) -> None:
    entrant = build(SETTING, {"kind": "ekf_yaw_rate"})
    assert "lateral_acceleration" not in (*entrant.channels.inputs, *entrant.channels.outputs)
