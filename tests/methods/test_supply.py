"""The pieces around a dissipation inequality, each against the error system that a fixed gain closes."""

import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.methods.supply import Supply, entering, injected, input_unit, open_loop
from luenberger.systems import Nonlinearity, Parameter, System
from luenberger.systems.error_system import ErrorSystem


def plant() -> System:
    """Two states, two inputs of which the second is noisy and reaches the output, scheduled throughout."""
    f = Nonlinearity.bounded(lambda z, u: jnp.sin(z), [[0.0, 1.0]], jacobian=([[-1.0]], [[1.0]]))
    return System.lpv(
        Polynomial.affine([[0.0, 1.0], [-1.0, -1.0]], speed=[[0.0, 0.0], [-0.5, 0.0]]),
        [[1.0, 0.0], [0.0, 2.0]],
        Polynomial.affine([[1.0, 0.0]], speed=[[0.0, 0.3]]),
        [[0.0, 0.7]],
        parameters=[Parameter("speed", 1.0, 3.0)],
        E=Polynomial.affine([[0.0], [2.0]], speed=[[1.0], [0.0]]),
        F=[[1.0], [0.4]],
        G=[[0.5, 0.0]],
        N=[[0.0, 0.0], [0.0, 0.1]],
        nonlinearity=f,
    )


@pytest.mark.parametrize("inputs", ["disturbance", "noise", "both"])
@pytest.mark.parametrize("second", [None, np.array([[0.3], [-0.2]])])
def test_input_direction_is_that_of_the_closed_loop(inputs: str, second: np.ndarray | None) -> None:
    system, random = plant(), np.random.default_rng(3)
    P = np.array([[2.0, 0.3], [0.3, 1.0]])
    L = Polynomial.affine(random.normal(size=(2, 1)), speed=random.normal(size=(2, 1)))
    L2 = None if second is None else Polynomial.constant(second)
    unit = input_unit(system, inputs)
    PB = entering(system, open_loop(system, L2), Polynomial.constant(P), P @ L, Supply("", None, inputs, None, unit))
    closed = ErrorSystem.of(system, L, argument_gain=L2).joined(inputs)
    for speed, slope in [(1.0, -1.0), (2.2, 0.4), (3.0, 1.0)]:
        where = {"speed": speed, "df1_dz1": slope}
        # Products of a handful of doubles.
        assert np.allclose(unit * PB(_known(PB, where)), P @ closed(_known(closed, where)), rtol=1e-12, atol=1e-14)


def _known(polynomial: Polynomial, where: dict[str, float]) -> dict[str, float]:
    return {n: where[n] for n in polynomial.names}


def test_what_the_output_error_shows_of_the_inputs() -> None:
    shown = np.asarray(injected(plant(), "both")({"speed": 2.0}))
    # (0, G - D N) by hand: 0.5 and -0.7 * 0.1.
    assert np.allclose(shown, [[0.0, 0.5, -0.07]], rtol=1e-12, atol=0)


def test_unit_of_an_input_without_direction_is_one() -> None:
    system = System.linear([[-1.0]], C=[[1.0]], E=[[0.0]])
    assert input_unit(system, "disturbance") == 1.0
    assert input_unit(System.linear([[-1.0]], C=[[1.0]], E=[[3e-4]]), "disturbance") == pytest.approx(3e-4)
