"""The double track against an independent simulator, commonroad-vehicle-models, on one double lane change."""

import numpy as np
import pytest

from luenberger.experiment.published.truth_models import Reference, followed, multi_body, single_track_drift

pytest.importorskip("vehiclemodels")


def differences(reference: Reference) -> list[float]:
    """Root mean square of the difference over that of the other simulator: yaw rate, lateral acceleration, lateral speed."""
    ours = followed(reference.parameters, reference.log)
    pairs = (
        ("yaw_rate", "yaw_rate"),
        ("lateral_acceleration", "lateral_acceleration"),
        ("lateral_speed", reference.lateral_speed),
    )
    return [
        float(
            np.linalg.norm(ours[own].values - reference.log[name].values) / np.linalg.norm(reference.log[name].values)
        )
        for name, own in pairs
    ]


def test_shared_physics_agree_with_the_single_track_drift_model() -> None:
    found = differences(single_track_drift(alike=True))
    # Measured 1.4 %, 2.0 % and 4.4 %: what is left is wheel speeds and combined slip under braking there, an ellipse and a
    # relaxation length of 0.03 m here. A sign or a lever arm put wrong gives some 100 %.
    assert np.array(found) == pytest.approx(0, abs=0.06)
    assert found[0] < 0.02
    assert found[1] < 0.03


def test_what_modelling_adds_to_the_single_track_drift_model_is_bounded() -> None:
    found = differences(single_track_drift())
    # Measured 4.5 %, 12.5 % and 20.3 %: mostly relaxation (0.4 m at 6 m/s to 22 m/s is 20 ms to 60 ms) and roll, which the
    # other lacks; small enough to call it the same car, large enough that the truth is another model.
    for miss, limit in zip(found, (0.06, 0.15, 0.25), strict=True):
        assert 0.02 < miss < limit


def test_the_multi_body_car_is_met_in_yaw_rate() -> None:
    yaw_rate, acceleration, _ = differences(multi_body())
    # Measured 3.7 % and 16.9 %: relaxation here, camber thrust and joints that give way there. The lateral speed, 70 % off at
    # 3 mrad of sideslip, is reported and not bounded.
    assert yaw_rate < 0.05
    assert acceleration < 0.2
