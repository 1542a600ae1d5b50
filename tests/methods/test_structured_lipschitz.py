"""The structured Lipschitz design: known smallest gains, monotony, and the claims it makes."""

import jax.numpy as jnp
import numpy as np
import pytest

from catalogue import robot
from luenberger.core import BadInput, NotAccepted, Outcome
from luenberger.methods import StructuredLipschitz
from luenberger.synthesize import synthesize
from luenberger.systems import Nonlinearity, System


def scalar(lipschitz: float) -> System:
    f = Nonlinearity.bounded(lambda z, u: lipschitz * jnp.sin(z), [[1.0]], lipschitz=lipschitz)
    return System.nonlinear([[0.0]], C=[[1.0]], F=[[1.0]], nonlinearity=f)


@pytest.mark.parametrize("g", [0.5, 3.0])
def test_scalar_plant_needs_the_lipschitz_constant(g: float) -> None:
    # e' = -L e + phi, |phi| <= g |e|: stable for every phi exactly if L > g.
    design = synthesize(scalar(g), StructuredLipschitz())
    assert g < design.gain_at()[0, 0] <= g * 1.006


@pytest.mark.parametrize(("rate", "bound"), [(0.0, 2.2105), (1.0, 4.1280)])
def test_robot(rate: float, bound: float) -> None:
    design = synthesize(robot(), StructuredLipschitz(rate))
    # Four decimals are stated; solvers agree to 1e-5.
    assert np.sqrt(design.statistics["optimum"]) == pytest.approx(bound, abs=6e-5)
    claimed = design.certificate.level("gain_bound")
    assert claimed is not None
    assert claimed <= bound * 1.006


def test_no_margin_limit_on_the_robot() -> None:
    f = Nonlinearity.bounded(lambda z, u: -40.0 * jnp.sin(z), [[0.0, 0.0, 1.0, 0.0]], lipschitz=40.0)
    design = synthesize(robot().replace(nonlinearity=f), StructuredLipschitz())
    assert design.certificate.outcome is Outcome.PROVED


def test_disturbance_gain_is_claimed_where_there_is_a_disturbance() -> None:
    kinds = [c.kind for c in synthesize(robot(), StructuredLipschitz(1.0)).certificate.claims]
    assert kinds == ["decay", "gain_bound", "l2_gain"]
    assert "l2_gain" not in [c.kind for c in synthesize(scalar(1.0), StructuredLipschitz()).certificate.claims]


def test_more_decay_costs_more_gain() -> None:
    optima = [synthesize(robot(), StructuredLipschitz(rate)).statistics["optimum"] for rate in (0.0, 0.5, 1.0, 2.0)]
    assert optima == sorted(optima)


def test_refusals() -> None:
    with pytest.raises(NotAccepted, match="no nonlinearity"):
        synthesize(System.linear([[0.0]], C=[[1.0]]), StructuredLipschitz())
    with pytest.raises(BadInput, match="no bound"):
        Nonlinearity.bounded(lambda z, u: z, [[1.0]])
    with pytest.raises(BadInput, match="decay_rate"):
        synthesize(scalar(1.0), StructuredLipschitz(-1.0))
