"""Sampled signals as functions of time, and the refusals of what does not fit the model."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.core import BadInput
from luenberger.simulate import HeldSamples, LinearSamples
from luenberger.simulate.inputs import as_input, jumps

TIME = np.array([0.0, 1.0, 3.0])
VALUES = np.array([[0.0], [2.0], [8.0]])


def test_held_samples_change_at_their_time() -> None:
    signal = HeldSamples(TIME, VALUES)
    at = [float(signal(t)[0]) for t in (-1.0, 0.0, 0.999, 1.0, 2.9, 3.0, 9.0)]
    assert at == [0.0, 0.0, 0.0, 2.0, 2.0, 8.0, 8.0]


def test_linear_samples_are_joined_and_held_outside() -> None:
    signal = LinearSamples(TIME, VALUES)
    times = np.array([-1.0, 0.0, 0.5, 1.0, 2.5, 3.0, 9.0])
    at = jax.vmap(signal)(times)[:, 0]
    np.testing.assert_allclose(at, np.interp(times, TIME, VALUES[:, 0]), rtol=1e-15)


def test_jumps_are_where_held_values_change() -> None:
    assert jumps(HeldSamples(np.arange(4.0), np.array([[1.0], [1.0], [2.0], [2.0]]))).tolist() == [2.0]
    assert jumps(LinearSamples(TIME, VALUES)).size == 0


def test_one_channel_may_be_given_flat() -> None:
    assert as_input("u", VALUES[:, 0], TIME, 1, "held")(1.5).tolist() == [2.0]


def test_functions_return_vectors() -> None:
    assert as_input("u", lambda t: 2 * t, TIME, 1, "held")(jnp.asarray(3.0)).tolist() == [6.0]
    assert as_input("u", lambda t: jnp.array([t, 1]), TIME, 2, "held")(jnp.asarray(3.0)).tolist() == [3.0, 1.0]
    signal = LinearSamples(TIME, VALUES)
    assert as_input("u", signal, TIME, 1, "held") is signal


def test_no_channels_need_no_signal() -> None:
    assert as_input("r", None, TIME, 0, "held")(jnp.asarray(1.0)).shape == (0,)


@pytest.mark.parametrize(
    ("value", "count", "interpolation", "message"),
    [
        (None, 1, "held", "`u` is not given but the model has 1 channels of it"),
        (
            np.zeros((3, 2)),
            1,
            "held",
            r"`u` has shape \(3, 2\) but there are 3 times and 1 channels; \(3, 1\) is needed",
        ),
        (np.zeros(4), 1, "held", r"`u` has shape \(4, 1\)"),
        ([0.0, np.nan, 0.0], 1, "held", "`u` holds nan"),
        (lambda t: jnp.zeros(2), 1, "held", r"`u` returns shape \(2,\) but the model has 1 channels"),
        (VALUES, 1, "cubic", "`interpolation` is `cubic`"),
    ],
)
def test_signals_that_do_not_fit_are_refused(value: object, count: int, interpolation: str, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        as_input("u", value, TIME, count, interpolation)
