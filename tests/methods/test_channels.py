"""Scalar channels: they are the Jacobian, their inequality is the S-procedure, and L1 is what the derivation says."""

import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.core import NotAccepted
from luenberger.methods.channels import Channels, diagonal, row_space
from luenberger.systems import Nonlinearity, Parameter, System

H = np.array([[0.0, 2.0, 0.0], [1.0, 0.0, -3.0]])
BOX = {"s": (-1.0, 2.0)}


def plant(lower: object, upper: object) -> System:
    f = Nonlinearity.bounded(lambda z, u: jnp.zeros(2), H, size=2, jacobian=(lower, upper))
    F = Polynomial.affine([[1.0, 0.0], [0.0, 20.0], [0.3, 0.0]], s=[[0.0, 1.0], [0.0, 0.0], [2.0, 0.0]])
    return System.lpv(-np.eye(3), C=[[1.0, 1.0, 0.0]], F=F, nonlinearity=f, parameters=[Parameter("s", *BOX["s"])])


MIXED = np.array([[-1.0, 0.5], [7.0, -9.0]]), np.array([[300.0, 2.0], [7.0, -1.0]])


def reached(channels: Channels, slopes: np.ndarray) -> Polynomial:
    """sum_k b_k g_k h_j(k)"""
    return channels.directions @ (np.diag(slopes) @ channels.pick @ channels.arguments)


@pytest.mark.parametrize("shift", ["none", "lower"])
def test_channels_and_fixed_slopes_are_the_jacobian(shift: str) -> None:
    system = plant(*MIXED)
    channels = Channels.of(system, shift)
    F = system.polynomial("F")
    for end, slopes in zip(MIXED, (channels.lower, channels.upper), strict=True):
        difference = reached(channels, slopes) - F @ ((end - channels.fixed) @ H)
        assert max(abs(c).max() for _, c in difference) < 1e-12 * 300
    assert np.all(channels.lower <= 0)
    assert np.all(channels.upper >= 0)
    np.testing.assert_allclose(np.maximum(-channels.lower, channels.upper), 1.0)


def test_a_slope_is_split_off_only_where_zero_lies_outside() -> None:
    # Entry (1, 1) holds zero; (1, 2) and (2, 2) do not: the end nearer to zero goes; (2, 1) does not vary.
    np.testing.assert_array_equal(Channels.of(plant(*MIXED)).fixed, [[0.0, 0.5], [7.0, -1.0]])
    np.testing.assert_array_equal(Channels.of(plant(*MIXED), "lower").fixed, MIXED[0])
    assert not Channels.of(plant(np.zeros((2, 2)), np.ones((2, 2)))).is_shifted


def test_directions_and_arguments_share_their_size() -> None:
    channels = Channels.of(plant(*MIXED))
    sizes = np.max([np.linalg.norm(c, axis=0) for c in channels.directions.bernstein(BOX).values()], axis=0)
    # The largest channel of each argument is balanced; here each argument's largest is found by its pick.
    np.testing.assert_allclose(
        np.max(channels.pick * sizes[:, None], axis=0), np.linalg.norm(channels.arguments, axis=1)
    )


def test_what_cannot_vary_is_refused() -> None:
    with pytest.raises(NotAccepted, match="No varying entry"):
        Channels.of(plant(np.ones((2, 2)), np.ones((2, 2))))
    with pytest.raises(NotAccepted, match="no nonlinearity"):
        Channels.of(System.linear([[0.0]], C=[[1.0]]))


def test_behind_changes_units_alone() -> None:
    channels = Channels.of(plant(*MIXED))
    L2, C = Polynomial.affine([[0.999], [0.2], [0.0]], s=[[0.0], [0.1], [0.0]]), Polynomial.constant([[1.0, 1.0, 0.0]])
    behind = channels.behind(L2, C, BOX)
    for slopes in (channels.lower, channels.upper):
        difference = reached(channels, slopes) - reached(behind, slopes)
        assert max(abs(c).max() for _, c in difference) < 1e-10


@pytest.mark.parametrize("driven", [False, True])
def test_inequality_is_the_s_procedure(driven: bool) -> None:
    generator = np.random.default_rng(0)
    channels = Channels.of(plant(*MIXED))
    nk, na = channels.pick.shape
    corner, PB, seen = (generator.normal(size=s) for s in ((3, 3), (3, nk), (na, 3)))
    corner, tau = corner + corner.T, generator.uniform(1, 2, (na, 1))
    columns, blurred, squared = generator.normal(size=(3, 2)), generator.normal(size=(na, 2)), 1.7
    lifted = [Polynomial.constant(m) for m in (corner, PB, seen, columns, blurred)]
    inputs = (lifted[3], lifted[4], squared) if driven else None
    M = np.asarray(channels.inequality(lifted[0], lifted[1], tau, lifted[2], inputs)({}))
    e, w, v = generator.normal(size=3), generator.normal(size=nk), generator.normal(size=2) * driven
    x = np.concatenate([e, w, v]) if driven else np.concatenate([e, w])
    n = len(x)
    value = x @ (M[:n, :n] - M[:n, n:] @ np.linalg.solve(M[n:, n:], M[n:, :n])) @ x
    p = channels.pick @ ((seen @ e + blurred @ v) / tau[:, 0])
    products = (w - channels.lower * p) @ (np.diag((channels.pick @ tau)[:, 0]) @ (channels.upper * p - w))
    wanted = e @ corner @ e + 2 * e @ PB @ w + 2 * e @ columns @ v - squared * v @ v + products
    assert value == pytest.approx(wanted, rel=1e-12)


def test_row_space_and_diagonal() -> None:
    V = row_space(np.array([[1.0, 2.0, 0.0], [2.0, 4.0, 0.0]]))
    assert V.shape == (3, 1)
    np.testing.assert_allclose(np.abs(V[:, 0]), np.array([1.0, 2.0, 0.0]) / np.sqrt(5), atol=1e-15)
    np.testing.assert_array_equal(diagonal(np.array([[1.0], [2.0]]))({}), np.diag([1.0, 2.0]))
