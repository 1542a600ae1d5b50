"""What is proved of the step that ships, against steps whose factor is known in closed form."""

import math

import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.certify.rational_text import from_text
from luenberger.core import Outcome
from luenberger.design import Design
from luenberger.export import sampled_step
from luenberger.export.sampled import proofs_text, quantised, quantised_plant, sampling_of
from luenberger.methods import KalmanGain, PolytopicLuenberger
from luenberger.observers import KalmanFilter
from luenberger.synthesize import synthesize
from luenberger.systems import Parameter, System


def lag(rate: float = 0.8) -> Design:
    """One state, x' = -x, corrected so that the error obeys e' = -(1 + L) e."""
    return synthesize(System.linear([[-1.0]], C=[[1.0]]), PolytopicLuenberger(decay_rate=rate))


def pole(design: Design) -> float:
    return -1.0 - float(np.asarray(design.gain_at())[0, 0])


@pytest.mark.parametrize("step", [0.01, 0.2])
@pytest.mark.parametrize("substeps", [1, 3])
def test_rk4_is_proved_with_the_factor_of_its_own_polynomial(step: float, substeps: int) -> None:
    design = lag()
    z = pole(design) * step / substeps
    factor = abs(1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24) ** substeps
    found = sampled_step(design, design.observer(step, method="rk4", substeps=substeps))
    assert found is not None
    assert found.outcome is Outcome.PROVED
    assert found.level is not None
    # Two hundredths of the way to one are given away to prove it.
    assert factor <= found.level <= factor + 0.021 * (1 - factor)
    assert (found.sampling.scheme, found.sampling.parts) == ("rk4", substeps)


def test_the_exponential_is_proved_with_the_exponential() -> None:
    design = lag()
    found = sampled_step(design, design.observer(0.1, method="exact"))
    assert found is not None
    assert found.outcome is Outcome.PROVED
    factor = math.exp(0.1 * pole(design))
    assert found.level == pytest.approx(factor + 0.02 * (1 - factor), rel=1e-9)


def test_a_step_that_is_too_long_is_not_proved_and_says_what_was_met() -> None:
    design = lag()
    step = -4.0 / pole(design)
    z = -4.0
    factor = 1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24
    found = sampled_step(design, design.observer(step, method="rk4", substeps=1))
    assert found is not None
    assert found.outcome is Outcome.UNDECIDED
    assert factor > 1
    assert found.level == pytest.approx(factor, rel=1e-9)
    assert "no decay" in found.sentence
    assert "largest factor met was 5" in found.sentence


def test_a_discrete_design_is_its_own_map() -> None:
    design = synthesize(System.linear([[0.9]], C=[[1.0]], dt=0.1), KalmanGain(np.eye(1), np.eye(1)))
    factor = abs(0.9 - float(np.asarray(design.gain_at())[0, 0]))
    found = sampled_step(design, design.observer())
    assert found is not None
    assert found.outcome is Outcome.PROVED
    assert found.level == pytest.approx(factor + 0.02 * (1 - factor), rel=1e-9)
    assert "map of the discrete plant" in found.sentence


def test_the_factor_is_that_of_the_worst_place_of_the_box() -> None:
    moving = Polynomial.affine(np.array([[-1.0]]), v=np.array([[-1.0]]))
    plant = System.lpv(moving, C=[[1.0]], parameters=[Parameter("v", 0.0, 2.0)])
    design = synthesize(plant, PolytopicLuenberger(decay_rate=0.5, schedule="constant"))
    L = float(np.asarray(design.gain_at(v=0.0))[0, 0])
    found = sampled_step(design, design.observer(0.01, method="rk4", substeps=1))
    assert found is not None
    assert found.outcome is Outcome.PROVED
    assert found.level is not None
    # Slowest at v = 0; to fourth order the step is the exponential.
    slowest = math.exp(-0.01 * (1 + L))
    assert slowest <= found.level <= slowest + 0.021 * (1 - slowest)


def test_filters_have_no_such_map() -> None:
    plant = System.linear([[0.9]], C=[[1.0]], dt=0.1)
    runs = KalmanFilter(
        plant, process_covariance=np.eye(1), measurement_covariance=np.eye(1), initial_covariance=np.eye(1)
    )
    assert sampling_of(runs) is None


def test_rounded_plants_hold_single_precision_and_double_is_left_alone() -> None:
    plant = System.linear([[0.1, 1.0], [0.0, 0.7]], [[0.3], [0.0]], [[1.0, 0.0]], dt=0.1)
    assert quantised_plant(plant, "double") is plant
    single = quantised_plant(plant, "float")
    assert float(np.asarray(single.at("A", ()))[0, 0]) == float(np.float32(0.1))
    assert float(np.asarray(single.at("B", ()))[0, 0]) == float(np.float32(0.3))
    design = lag()
    assert quantised(design, "double") is design


def test_proofs_as_data_carry_every_digit() -> None:
    design = lag()
    found = sampled_step(design, design.observer(0.1, method="rk4", substeps=2))
    assert found is not None
    assert found.level is not None
    data = proofs_text(design.certificate, found, "double", ["one sentence"])
    assert data["precision"] == "double"
    assert data["statements"] == ["one sentence"]
    assert data["step"]["outcome"] == "proved"
    assert from_text(data["step"]["level"]) == found.level
    assert from_text(data["step"]["sampling"]["dt"]) == 0.1
    assert data["step"]["sampling"]["parts"] == 2
    assert proofs_text(None, None, "float") == {"precision": "float", "design": None, "step": None, "statements": []}
