"""The identified box against a simulated car whose tyres are known."""

import numpy as np
import pytest

from luenberger.core import BadInput, Trajectory
from luenberger.simulate import TruthModel, simulate
from luenberger.vehicle import BrushTyre, SingleTrack, slip_angle_channels, wang_car
from luenberger.vehicle.stiffness_box import StiffnessBox, axle_forces, stiffness_box

FRONT, REAR = BrushTyre(76500.0, 4500.0), BrushTyre(51000.0, 3000.0)


def drive(amplitude: float) -> Trajectory:
    truth = SingleTrack(wang_car, FRONT, REAR)
    model = TruthModel(
        truth, truth.output, truth.states, truth.inputs, truth.outputs, truth.scheduling_names, name="brush car"
    )
    time = np.arange(0, 12.0, 0.005)
    steering = amplitude * np.sin(2 * np.pi * 0.4 * time)
    speed = 20.0 - 0.5 * time
    run = simulate(model, time=time, x0=[0.0, 0.0], u=steering, r=speed, interpolation="linear")
    return slip_angle_channels(run, wang_car)


def test_forces_are_those_of_the_tyres() -> None:
    log = drive(0.05)
    forces = axle_forces(log, wang_car, time_constant=0.01)
    slip = log.table(["front_slip", "rear_slip"])
    expected = np.stack([np.asarray(FRONT(slip[:, 0])), np.asarray(REAR(slip[:, 1]))], axis=1)
    inside = (log.time > 0.2) & (log.time < 11.8)
    # The smoothing turns 0.4 Hz motion by (omega T)^2 = 6e-4 of its size; the first and last moments see one side only.
    assert np.abs(forces - expected)[inside].max() < 0.02 * np.abs(expected).max()


def test_box_spans_the_secants_of_the_drive() -> None:
    log = drive(0.06)
    box = stiffness_box(log, wang_car, tail=0.0, share=1.0, slip_floor=0.005, time_constant=0.01)
    slip = np.abs(log.table(["front_slip", "rear_slip"])).max(axis=0)
    lowest = [float(FRONT(slip[0]) / slip[0]), float(REAR(slip[1]) / slip[1])]
    # Secants fall from the stiffness at zero slip to that at the largest slip met; two percent are the forces' own error.
    assert box.front[0] == pytest.approx(lowest[0], rel=0.03)
    assert box.rear[0] == pytest.approx(lowest[1], rel=0.03)
    assert box.front[1] <= 76500 * 1.03
    assert box.share == (1.0, 1.0)


def test_excess_is_zero_on_the_edge_and_positive_outside() -> None:
    box = StiffnessBox((1e4, 2e4), (1e4, 2e4), (50.0, 0.0), (1.0, 1.0))
    slip = np.array([[0.1, 0.1], [-0.1, -0.1]])
    force = np.array([[2050.0, 1500.0], [-900.0, -2100.0]])
    np.testing.assert_allclose(box.excess(slip, force), [[0.0, 0.0], [50.0, 100.0]], atol=1e-9)


def test_a_narrow_box_pays_with_its_offset() -> None:
    log = drive(0.06)
    wide, narrow = (stiffness_box(log, wang_car, tail=t, slip_floor=0.005) for t in (0.0, 0.4))
    assert narrow.front[1] - narrow.front[0] < wide.front[1] - wide.front[0]
    assert narrow.offset[0] > wide.offset[0]


@pytest.mark.parametrize("options", [{"share": 0.0}, {"tail": 0.5}, {"slip_floor": 0.0}])
def test_shares_out_of_range(options: dict[str, float]) -> None:
    with pytest.raises(BadInput, match="are needed"):
        stiffness_box(drive(0.02), wang_car, **options)


def test_a_drive_that_teaches_nothing() -> None:
    with pytest.raises(BadInput, match="livelier drive"):
        stiffness_box(drive(0.001), wang_car, slip_floor=0.05)
