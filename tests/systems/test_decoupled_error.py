"""Error channels of an unknown-input observer: against the observer itself, step by step, and in exact arithmetic."""

from collections.abc import Mapping

import numpy as np
import pytest
from flint import fmpq

from luenberger.algebra import Polynomial
from luenberger.algebra.definiteness import exact
from luenberger.core import BadInput, NotAccepted
from luenberger.systems import Parameter, System
from luenberger.systems.decoupled_error import DecoupledError, require_no_feedthrough
from luenberger.systems.discretize import discretize
from luenberger.systems.matrix import PlantMatrix
from luenberger.systems.uncertainty import Uncertain
from luenberger.vehicle import gust_car, wind_plant

TS = 0.06
H = np.array([[-1 / 0.24], [-1.0]])


def windy(speed_error: float = 0.0) -> System:
    stiffness = ((54e3, 66e3), (58.5e3, 71.5e3))
    options = {"yaw_rate_noise": 0.005, "steering_error": 0.01, "speed_error": speed_error}
    return discretize(wind_plant(gust_car, (6.0, 19.9), gust_arm=0.4, stiffness=stiffness, **options), TS, "euler")


def synthetic(seed: int) -> tuple[System, Polynomial, np.ndarray]:
    """Scheduled plant with three states, two outputs, one unknown input, two uncertain parameters; a gain; a decoupling."""
    rng = np.random.default_rng(seed)
    names = ("r", "p", "q")
    A = Polynomial(
        names,
        {
            (0, 0, 0): rng.normal(size=(3, 3)) * 0.3,
            (1, 0, 0): rng.normal(size=(3, 3)) * 0.1,
            (1, 1, 0): rng.normal(size=(3, 3)) * 0.1,
            (0, 0, 1): np.outer(rng.normal(size=3), rng.normal(size=3)),
        },
    )
    C, E = rng.normal(size=(2, 3)), rng.normal(size=(3, 1))
    system = System.lpv(
        A,
        Polynomial(("p",), {(0,): rng.normal(size=(3, 1)), (1,): rng.normal(size=(3, 1))}),
        C,
        E=E,
        G=rng.normal(size=(2, 3)),
        N=rng.normal(size=(1, 3)),
        noise_bound=[0.1, 0.2, 0.3],
        parameters=[
            Parameter("r", -1.0, 1.0, error=0.05),
            Parameter("p", 0.0, 0.2, measured=False),
            Parameter("q", -0.1, 0.1, measured=False),
        ],
        dt=0.1,
    )
    gain = Polynomial.affine(rng.normal(size=(3, 2)), r=rng.normal(size=(3, 2)))
    free = rng.normal(size=(3, 2))
    seen = C @ E
    inverse = np.linalg.pinv(seen)
    return system, gain, -E @ inverse + free @ (np.eye(2) - seen @ inverse)


def value(matrix: Polynomial, point: Mapping[str, float]) -> np.ndarray:
    return np.asarray(matrix({n: point[n] for n in matrix.names}), dtype=float)


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("other", [False, True], ids=["same mode", "another mode before"])
def test_error_of_a_simulated_observer(seed: int, other: bool) -> None:
    system, gain, decoupling = synthetic(seed)
    rng = np.random.default_rng(100 + seed)
    before = decoupling + (0.3 * rng.normal(size=(3, 2)) if other else 0.0)
    error = DecoupledError.of(
        system, gain, Polynomial.constant(decoupling), before=Polynomial.constant(before) if other else None
    )
    plant = error.uncertain.nominal
    true, read = 0.4, 0.43
    p, q = 0.15, -0.07
    x, z, u, d = rng.normal(size=3), rng.normal(size=3), rng.normal(size=1), rng.normal(size=1)
    noise, after = rng.normal(size=3), rng.normal(size=3)
    point = {"r": true, "p": p, "q": q}
    C, G, Nu = (np.asarray(system.at(k, [read])) for k in "CGN")
    y = C @ x + G @ noise
    # The observer in its own words; z carries no output of the present sample.
    estimate = z - before @ y
    P = np.eye(3) + decoupling @ C
    K = value(gain, {"r": read})
    N = P @ np.asarray(plant.at("A", [read])) - K @ C
    ahead = N @ estimate + K @ y + P @ np.asarray(plant.at("B", [read])) @ (u + Nu @ noise)
    x_ahead = value(system.polynomial("A"), point) @ x + value(system.polynomial("B"), point) @ u
    x_ahead = x_ahead + value(system.polynomial("E"), point) @ d
    estimate_ahead = ahead - decoupling @ (C @ x_ahead + G @ after)

    unit = {"r": (true - read) / 0.05, "p": (p - 0.1) / 0.1, "q": q / 0.1}
    s = np.array([np.prod([unit[n] for n in cause.split("*")]) for cause in error.uncertain.names])
    rows = value(error.uncertain.rows, {"r": read}) @ np.concatenate([x, u, d])
    at = {name: value(channel, {"r": read}) for name, channel in error.inputs.items()}
    pushed = at["uncertainty"] @ (s * rows) + at["disturbance"] @ d
    e, e_ahead = x - estimate, x_ahead - estimate_ahead
    plain = value(error.A, {"r": read}) @ e + pushed + at["noise"] @ noise + at["next noise"] @ after
    np.testing.assert_allclose(plain, e_ahead, atol=1e-12)
    bar, bar_ahead = e - before @ G @ noise, e_ahead - decoupling @ G @ after
    reused = value(error.A, {"r": read}) @ bar + pushed + at["reused noise"] @ noise
    np.testing.assert_allclose(reused, bar_ahead, atol=1e-12)


def test_wind_plant_has_the_published_projection_and_eigenvalues() -> None:
    for speed, z in ((8.5, 0.035294), (13.55, 0.394834), (18.05, 0.545706)):
        mode = windy().freeze(speed=speed, inverse_speed=1 / speed)
        A0 = np.asarray(Uncertain.of(mode).nominal.at("A"))
        P = np.array([[1.0, -1 / 0.24], [0.0, 0.0]])
        K = np.array([[(P @ A0)[0, 1]], [0.0]])
        error = DecoupledError.of(mode, Polynomial.constant(K), Polynomial.constant(H))
        np.testing.assert_allclose(value(error.projection, {}), P, atol=1e-15)
        np.testing.assert_allclose(value(error.A, {}), np.diag([z, 0.0]), atol=1e-6)
        np.testing.assert_allclose(value(error.inputs["disturbance"], {}), 0.0, atol=1e-15)
        # K drops out of what the gyro does: N H - K = P A H.
        reused = value(error.inputs["reused noise"], {})
        np.testing.assert_allclose(reused[:, :1], P @ A0 @ H, atol=1e-12)


def test_channels_in_exact_arithmetic_are_those_of_the_floats() -> None:
    def lift(matrix: PlantMatrix) -> Polynomial:
        assert isinstance(matrix, Polynomial)
        return matrix.map(exact)

    system, gain, decoupling = synthetic(4)
    floats = DecoupledError.of(system, gain, Polynomial.constant(decoupling))
    exactly = DecoupledError.of(system, gain, Polynomial.constant(decoupling), lift)
    assert set(floats.inputs) == {"lumped", "uncertainty", "disturbance", "noise", "next noise", "reused noise"}
    for name, channel in exactly.inputs.items():
        entries = channel({n: fmpq(1, 4) for n in channel.names})
        assert all(isinstance(entry, fmpq) for entry in np.ravel(entries))
        np.testing.assert_allclose(
            [float(entry.p) / float(entry.q) for entry in np.ravel(entries)],
            np.ravel(value(floats.inputs[name], {"r": 0.25})),
            atol=1e-13,
        )


def test_error_runs_over_the_readings_of_the_scheduling() -> None:
    error = DecoupledError.of(windy(0.2), Polynomial.constant(np.zeros((2, 1))), Polynomial.constant(H))
    assert error.box["speed"] == pytest.approx((5.8, 20.1))
    assert set(error.A.names) <= {"speed", "inverse_speed"}
    assert error.inputs["uncertainty"].shape == (2, error.uncertain.nk)


def test_channels_side_by_side() -> None:
    system, gain, decoupling = synthetic(3)
    error = DecoupledError.of(system, gain, Polynomial.constant(decoupling))
    joined = value(error.joined("lumped+next noise"), {"r": 0.1})
    np.testing.assert_array_equal(joined[:, :3], np.eye(3))
    np.testing.assert_array_equal(joined[:, 3:], value(error.inputs["next noise"], {"r": 0.1}))
    with pytest.raises(BadInput, match="no input \\['wind'\\]"):
        error.joined("lumped+wind")


def test_a_plant_without_inputs() -> None:
    plant = System.linear(np.diag([0.5, 0.2]), E=[[1.0], [0.5]], C=[[1.0, 0.0]], dt=1.0)
    error = DecoupledError.of(plant, Polynomial.constant(np.zeros((2, 1))), Polynomial.constant([[-1.0], [-0.5]]))
    np.testing.assert_array_equal(value(error.inputs["disturbance"], {}), np.zeros((2, 1)))
    np.testing.assert_array_equal(value(error.inputs["noise"], {}), np.zeros((2, 1)))


def test_refusals() -> None:
    system = windy()
    good = Polynomial.constant(np.zeros((2, 1)))
    with pytest.raises(BadInput, match="`gain` has shape"):
        DecoupledError.of(system, Polynomial.constant(np.zeros((1, 2))), good)
    with pytest.raises(BadInput, match="`decoupling` depends on \\['front_stiffness'\\]"):
        DecoupledError.of(system, good, Polynomial.affine(np.zeros((2, 1)), front_stiffness=np.ones((2, 1))))
    direct = System.linear(np.eye(2) * 0.5, np.ones((2, 1)), np.eye(1, 2), [[1.0]], E=np.eye(2, 1), dt=1.0)
    with pytest.raises(NotAccepted, match="feedthrough"):
        DecoupledError.of(direct, good, good)
    with pytest.raises(NotAccepted, match="D = 0"):
        require_no_feedthrough(direct)
    require_no_feedthrough(system)
