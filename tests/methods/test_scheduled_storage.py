"""A storage that moves proves what no constant one can, where the scheduling moves slowly."""

from dataclasses import replace

import numpy as np
import pytest

from catalogue import hidden_oscillator
from luenberger.algebra import Polynomial
from luenberger.certify import Claim, prove
from luenberger.core import Infeasible, NotAccepted, Outcome
from luenberger.lmi import Bernstein, Grid, l2_storage
from luenberger.lmi.storage import affine_monomials
from luenberger.methods import PolytopicLuenberger, RobustLuenberger
from luenberger.synthesize import synthesize
from luenberger.vehicle import slip_angle_plant, wang_car

SPEED, ACCELERATION = (15 / 3.6, 150 / 3.6), (-8.0, 8.0)


def test_slow_scheduling_is_proved_where_fast_scheduling_is_not() -> None:
    with pytest.raises(Infeasible):
        synthesize(hidden_oscillator(0.2), PolytopicLuenberger())
    design = synthesize(hidden_oscillator(0.2), PolytopicLuenberger(storage="scheduled"))
    assert design.certificate.outcome is Outcome.PROVED
    storage = design.certificate.claims[0].storage
    assert isinstance(storage, Polynomial)
    assert storage.degree == {"stiffness": 1}
    # The same witness says nothing of a plant that moves ten thousand times faster.
    faster = replace(design, system=hidden_oscillator(2e3))
    assert faster.certify().outcome is Outcome.REFUTED


def test_without_a_rate_the_option_is_refused() -> None:
    with pytest.raises(NotAccepted, match="has a bounded rate"):
        synthesize(hidden_oscillator(None), PolytopicLuenberger(storage="scheduled"))


def test_the_nearest_decay_rate_is_named() -> None:
    # The oscillator dies out like exp(-0.3 t) at best.
    with pytest.raises(Infeasible) as refusal:
        synthesize(hidden_oscillator(0.2), PolytopicLuenberger(decay_rate=0.29, storage="scheduled"))
    assert refusal.value.nearest is not None
    assert 0.0 < refusal.value.nearest < 0.29


def test_the_car_has_the_storage_of_the_dissertation() -> None:
    plant = slip_angle_plant(wang_car, SPEED, ACCELERATION, jerk=10.0)
    assert affine_monomials(plant) == [{}, {"inverse_speed": 1}, {"inverse_speed": 1, "acceleration": 1}]
    # The rate of the speed follows from the acceleration; without a jerk bound its own product cannot move.
    slow = slip_angle_plant(wang_car, SPEED, ACCELERATION)
    assert affine_monomials(slow) == [{}, {"inverse_speed": 1}]


def test_a_coarse_grid_lies_and_is_refuted() -> None:
    plant = slip_angle_plant(wang_car, SPEED, ACCELERATION, jerk=10.0)
    plant = plant.replace(E=np.eye(2), G=[[0.2]])
    gain = Polynomial.constant([[5.0], [-5.0]])
    rich = [*affine_monomials(plant), {"inverse_speed": 2}, {"inverse_speed": 3}, {"inverse_speed": 4}]
    honest = l2_storage(plant, gain, np.eye(2), "both", monomials=rich, relaxation=Bernstein(parts=2))
    coarse = l2_storage(plant, gain, np.eye(2), "both", monomials=rich, relaxation=Grid(3))
    assert honest is not None
    assert coarse is not None
    # Three points a parameter leave the storage free between them: the level looks three percent better than it is.
    assert coarse[0] < 0.98 * honest[0]
    outcomes = [
        prove(plant, gain, Claim("l2_gain", level, P, weight=np.eye(2), inputs="both")).outcome
        for level, P, _ in (honest, coarse)
    ]
    assert outcomes == [Outcome.PROVED, Outcome.REFUTED]


def test_the_robust_design_claims_less_with_a_moving_storage() -> None:
    plant = slip_angle_plant(
        wang_car, SPEED, ACCELERATION, jerk=10.0, scale_error=((-0.1, 0.1), (-0.2, 0.2)), output="slip_difference"
    )
    levels = {}
    for storage in ("constant", "scheduled"):
        design = synthesize(plant, RobustLuenberger("l2", form="estimate", storage=storage))
        levels[storage] = design.certificate.level("l2_gain")
    assert levels["constant"] is not None
    assert levels["scheduled"] is not None
    # 0.224 and 0.150 on a dense grid for gains near zero; two sub-intervals and the back-off cost three percent.
    assert levels["scheduled"] < 0.72 * levels["constant"]
    with pytest.raises(NotAccepted, match="L2 gain alone"):
        synthesize(plant, RobustLuenberger("h2", storage="scheduled"))
