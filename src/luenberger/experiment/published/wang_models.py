"""Model, hull and error equation of Wang 2014, chapter 3, checked against what they are derived from."""

from collections.abc import Iterator, Mapping
from itertools import product

import numpy as np
from scipy.spatial import ConvexHull

from luenberger.algebra import Polynomial
from luenberger.experiment.published.row import INDEPENDENT, Row, judged
from luenberger.experiment.published.wang_gains import HINF_FREE
from luenberger.experiment.published.wang_plants import (
    ACCELERATION,
    ACCELERATION_ERROR,
    SPEED,
    SPEED_ERROR,
    X3,
    X4,
    Hull,
    scheduling_error,
    theta_model,
    theta_plant,
)
from luenberger.methods.robust_inequality import GivenGain
from luenberger.systems.error_system import ErrorSystem
from luenberger.systems.observability import observability_matrix
from luenberger.vehicle import wang_car


def model_rows() -> Iterator[Row]:
    """Yield the rows of model, observability, error equation and hulls."""
    yield _derivation()
    yield _unobservable()
    yield _error_equation()
    yield _inputs_sign()
    yield _bounds()
    yield _hulls()


def slip_rates(vx: float, ax: float, state: np.ndarray, inputs: np.ndarray) -> np.ndarray:
    """Return d/dt of both slip angles from force and moment balance, by differences of their definitions.

    Args:
        vx: speed [m/s].
        ax: d vx/dt [m/s^2].
        state: slip angles [rad].
        inputs: steering [rad], its rate [rad/s], yaw rate [rad/s].
    """
    m, Iz, a, b = wang_car.mass, wang_car.yaw_inertia, wang_car.front_axle_distance, wang_car.rear_axle_distance
    (af, ar), (delta, rate, r) = state, inputs
    front, rear = wang_car.front_stiffness * af, wang_car.rear_stiffness * ar
    vy = -vx * ar + b * r
    dvy, dr = (front + rear) / m - vx * r, (a * front - b * rear) / Iz
    h = 1e-6

    def slips(t: float) -> np.ndarray:
        v, w, yaw = vx + ax * t, vy + dvy * t, r + dr * t
        return np.array([delta + rate * t - (w + a * yaw) / v, -(w - b * yaw) / v])

    return (slips(h) - slips(-h)) / (2 * h)


def consistent_points(count: int) -> Iterator[tuple[float, float, np.ndarray, np.ndarray]]:
    """Yield random (vx, ax, slip angles, inputs) that satisfy delta - wb r / vx = af - ar.

    Args:
        count: how many.
    """
    generator = np.random.default_rng(0)
    wheelbase = wang_car.front_axle_distance + wang_car.rear_axle_distance
    for _ in range(count):
        vx, ax, r = generator.uniform(*SPEED), generator.uniform(*ACCELERATION), generator.normal()
        state = 0.1 * generator.normal(size=2)
        delta = state[0] - state[1] + wheelbase * r / vx
        yield vx, ax, state, np.array([delta, generator.normal(), r])


def _derivation() -> Row:
    plant, worst = theta_plant(), 0.0
    for vx, ax, state, inputs in consistent_points(50):
        A, B = (_at(plant.polynomial(k), {"theta1": 1 / vx, "theta2": ax / vx}) for k in "AB")
        worst = max(worst, float(np.abs(A @ state + B @ inputs - slip_rates(vx, ax, state, inputs)).max()))
    return judged(
        "slip rates of (3.19) against differences of the balance of forces and moments, fifty random points",
        "(3.18) to (3.21)",
        "-1 on r in row two of the printed B_ou",
        f"+1 on r in both rows; largest difference {worst:.1e} rad/s",
        "The model (3.74) is right; the printed B_ou is for -ar, which the dissertation does not say. "
        "ax is d vx/dt and not what an accelerometer reads.",
        reproduced=False,
        # Differences of second order over 1e-6 s leave 1e-8.
        corrected=worst < 1e-6,
        deviation=worst,
    )


def _unobservable() -> Row:
    plant, generator = theta_plant(), np.random.default_rng(1)
    ratios, gaps = [], []
    for vx, ax, *_ in consistent_points(20):
        point, C = {"theta1": 1 / vx, "theta2": ax / vx}, np.array([[1.0, -1.0]])
        A = _at(plant.polynomial("A"), point)
        values = np.linalg.svd(observability_matrix(A, C), compute_uv=False)
        ratios.append(values[-1] / values[0])
        slow = -(wang_car.front_stiffness + wang_car.rear_stiffness) / wang_car.mass / vx - ax / vx
        eigenvalues = np.linalg.eigvals(A - generator.normal(size=(2, 1)) * 50 @ C)
        gaps.append(np.abs(eigenvalues - slow).min())
    return judged(
        "smallest over largest singular value of the observability matrix of (A, C), twenty points",
        "section 4.2",
        "observable",
        f"{max(ratios):.1e}; the mode -(Cf + Cr)/(M vx) - ax/vx moves by {max(gaps):.1e} 1/s under random gains",
        "a Cf = b Cr: the car is exactly neutral steer, so af = ar is seen by no output and no gain reaches it. "
        "Detectability is all that can be claimed.",
        reproduced=False,
        corrected=float(max(ratios)) < 1e-12 and float(max(gaps)) < 1e-8,
    )


def _error_equation() -> Row:
    """x' - xhat' by plant and observer against (3.34), and what is missing where y is computed from the measured speed."""
    worst, missing = 0.0, 0.0
    generator = np.random.default_rng(2)
    names, gain = ("theta1", "theta2"), generator.normal(size=(3, 2, 1))
    L = Polynomial(names, dict(zip(((0, 0), (1, 0), (0, 1)), gain, strict=True)))
    error = scheduling_error("joint")
    for output in ("slip_difference", "slip_constraint"):
        plant = theta_plant("joint", output=output)
        closed = ErrorSystem.of(plant, L, form="estimate")
        for _ in range(20):
            p = {n: generator.uniform(*i) for n, i in error.box.items()}
            true, measured = ({n: float(_at(q, p)[0, 0]) for n, q in m.items()} for m in (error.true, error.measured))
            x, xhat, u = generator.normal(size=2), generator.normal(size=2), generator.normal(size=3)
            A, B, C, D = (_at(plant.polynomial(k), true) for k in "ABCD")
            Am, Bm, Cm, Dm = (_at(plant.polynomial(k), measured) for k in "ABCD")
            innovation = C @ x + D @ u - Cm @ xhat - Dm @ u
            rate = A @ x + B @ u - Am @ xhat - Bm @ u - _at(L, measured) @ innovation
            form = _at(closed.A, p) @ (x - xhat) + _at(closed.joined("scheduling"), p) @ np.concatenate([xhat, u])
            worst = max(worst, float(np.abs(rate - form).max()))
            missing = max(missing, float(np.abs(_at(L, measured) @ (D - Dm) @ u).max()))
    return judged(
        "rate of the error: plant minus observer against the error equation, forty random points",
        "(3.33), (3.34)",
        "L(theta_m)(y - C xhat) unspoilt by the speed",
        f"{worst:.1e}; left out of (3.34): up to {missing:.2g} (unit inputs)",
        "(3.33) is wrong in its first line and right in its last. y = delta - wb r / vx is computed from the measured speed, which adds "
        "-L(theta_m) wb r theta_D1.",
        reproduced=False,
        corrected=worst < 1e-10 and missing > 1e-3,
    )


def _inputs_sign() -> Row:
    plant, gain, copy = theta_model(HINF_FREE, "measured")
    right = GivenGain(plant, gain, "l2", form="estimate", model=copy).level()
    wrong = GivenGain(plant.replace(B=plant.polynomial("B") * -1.0), gain, "l2", form="estimate", model=copy).level()
    shown = ["none" if v is None else f"{v:.4f}" for v in (right, wrong)]
    return judged(
        "H-infinity level of the printed unstructured observer with + B(theta) and with - B(theta)",
        "(3.51)",
        "- B(theta)",
        f"{shown[0]} and {shown[1]}",
        "(3.49) has the sign that (3.51) loses; the printed B_ou is near B.",
        reproduced=False,
        corrected=right is not None and (wrong is None or wrong > 2 * right),
    )


def _bounds() -> Row:
    (e1, E1), (e2, E2) = SPEED_ERROR, ACCELERATION_ERROR
    samples = [(a / (1 + a), (a - b) / (1 + a)) for a, b in product(np.linspace(e1, E1, 101), np.linspace(e2, E2, 101))]
    low, high = np.min(samples, axis=0), np.max(samples, axis=0)
    gap = float(np.abs(np.array([X3, X4]).T - [low, high]).max())
    return judged(
        "intervals of x3 = e1/(1 + e1) and x4 = (e1 - e2)/(1 + e1)",
        "(3.71), (3.73)",
        "1/(1 + 1/e1)",
        f"[{X3[0]:.4f}, {X3[1]:.4f}] and [{X4[0]:.4f}, {X4[1]:.4f}]",
        "The printed 1/(1 + 1/e1) is undefined at zero error; e1/(1 + e1) is what it stands for. Sampled on a grid.",
        reproduced=False,
        corrected=gap < 1e-12,
    )


def _hulls() -> Row:
    hulls: dict[Hull, ConvexHull] = {hull: ConvexHull(vertices(hull)) for hull in ("independent", "joint")}
    generator, outside = np.random.default_rng(3), 0.0
    for _ in range(300):
        v, a = generator.uniform(*SPEED), generator.uniform(*ACCELERATION)
        e1, e2 = generator.uniform(*SPEED_ERROR), generator.uniform(*ACCELERATION_ERROR)
        true, measured = np.array([1 / v, a / v]), np.array([1, a * (1 + e2)]) / (v * (1 + e1))
        point = np.concatenate([true, true - measured])
        outside = max(outside, *(float((h.equations @ np.append(point, 1.0)).max()) for h in hulls.values()))
    ratio = float(hulls["joint"].volume / hulls["independent"].volume)
    return judged(
        "300 random (vx, ax, e1, e2) in both hulls of (theta, theta_D); volume of the joint over the independent hull",
        f"Lemma 10, (3.72), {INDEPENDENT}",
        "0.778",
        f"farthest outside {max(outside, 0.0):.1e}; {ratio:.3f}",
        "Sixteen points each. x3 and x4 share e1; Lemma 10 takes them as independent, which is valid and larger than need be. "
        "In 1/(1 + e1) and 1 + e2 all is multi-affine, so the joint vertices are a hull too.",
        reproduced=outside < 1e-12 and abs(ratio - 0.778) <= 0.01,
        deviation=abs(ratio - 0.778),
    )


def vertices(hull: Hull) -> np.ndarray:
    """Return the sixteen points (theta, theta_D), shape (16, 4).

    Args:
        hull: as `theta_plant`.
    """
    error = scheduling_error(hull)
    points = []
    for ends in product(*error.box.values()):
        p = dict(zip(error.box, ends, strict=True))
        true = np.array([float(_at(error.true[n], p)[0, 0]) for n in ("theta1", "theta2")])
        measured = np.array([float(_at(error.measured[n], p)[0, 0]) for n in ("theta1", "theta2")])
        points.append(np.concatenate([true, true - measured]))
    return np.array(points)


def _at(matrix: Polynomial, values: Mapping[str, float]) -> np.ndarray:
    return np.asarray(matrix({n: values[n] for n in matrix.names}))
