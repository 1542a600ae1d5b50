"""Plants for interval observers: the car of the dissertation with uncertain stiffness, in two choices of states."""

from itertools import product
from typing import Any

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.design import Design
from luenberger.systems import Parameter, System
from luenberger.vehicle import slip_angle_plant, wang_car

FLIP = np.diag([1.0, -1.0])
STIFFNESS = ((60e3, 90e3), (35e3, 65e3))


def thesis_car(slow: float = 15.0, fast: float = 150.0, **options: Any) -> System:
    """Wang 2014, equations (4.36) to (4.46): slip angles, hidden axle stiffness, speed in km/h."""
    return slip_angle_plant(wang_car, (slow / 3.6, fast / 3.6), (-8.0, 8.0), stiffness=STIFFNESS, **options)


def printed_gain(flipped: bool) -> Polynomial:
    """Wang 2014, (4.47), in 1/vx and ax; row 2 with the sign of the state (front, rear) where flipped."""
    turn = FLIP if flipped else np.eye(2)
    terms = {
        (0, 0): turn @ [[1.7127], [1.3431]],
        (1, 0): turn @ [[-58.5902], [-42.9510]],
        (1, 1): turn @ [[-0.5579], [-0.4398]],
    }
    return Polynomial(("inverse_speed", "acceleration"), terms)


def lateral_car(speed: float = 20.0) -> System:
    """The same car with lateral speed and yaw rate as states, at one speed [m/s], yaw rate measured."""
    m, Iz, a, b = wang_car.mass, wang_car.yaw_inertia, wang_car.front_axle_distance, wang_car.rear_axle_distance
    front = -np.array([[1 / m, a / m], [a / Iz, a**2 / Iz]]) / speed
    rear = -np.array([[1 / m, -b / m], [-b / Iz, b**2 / Iz]]) / speed
    A = Polynomial.affine(np.array([[0.0, -speed], [0.0, 0.0]]), front_stiffness=front, rear_stiffness=rear)
    B = Polynomial.affine(np.zeros((2, 1)), front_stiffness=np.array([[1 / m], [a / Iz]]))
    names = ("front_stiffness", "rear_stiffness")
    hidden = [Parameter(n, *ends, "N/rad", measured=False) for n, ends in zip(names, STIFFNESS, strict=True)]
    return System.lpv(A, B, [[0.0, 1.0]], parameters=hidden, states=("lateral_speed", "yaw_rate"), name="lateral car")


def slip_transform(speed: float = 20.0) -> np.ndarray:
    """Slip angles (less the steering) from lateral speed and yaw rate."""
    return np.array([[-1.0, -wang_car.front_axle_distance], [-1.0, wang_car.rear_axle_distance]]) / speed


def uncertain_pair(**options: Any) -> System:
    """Two coupled states with one hidden coupling, first state measured, input of unknown strength."""
    A = Polynomial.affine(np.array([[-1.0, 0.5], [0.4, -2.0]]), q=np.array([[0.1, 0.2], [0.1, 0.3]]))
    B = Polynomial.affine(np.array([[0.0], [1.0]]), q=np.array([[0.0], [0.2]]))
    hidden = [Parameter("q", -1.0, 1.0, measured=False)]
    return System.lpv(A, B, [[1.0, 0.0]], parameters=hidden, name="uncertain pair", **options)


def enclosed_run(design: Design, start: np.ndarray, steps: int = 2000) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """State and bounds of z = T x of the car, written out without the library's observer, by Runge-Kutta at 1 ms.

    Stiffness and noise jump between vertices, speed and acceleration wave over their box.

    Args:
        design: interval design of `thesis_car`, scheduling measured exactly.
        start: width of the enclosure at the start, (2,), the state at random inside.
        steps: number of steps.
    """
    generator = np.random.default_rng(3)
    system = design.system
    T = np.asarray(next(c for c in design.certificate.claims if c.kind == "containment").transform)
    inverse, dt = np.linalg.inv(T), 1e-3
    V = np.zeros(system.nv) if system.noise_bound is None else np.array(system.noise_bound)
    hidden = [p for p in system.parameters if not p.measured]
    corners = [dict(zip([p.name for p in hidden], c, strict=True)) for c in product(*(p.interval for p in hidden))]

    def at(value: Polynomial, point: dict[str, float]) -> np.ndarray:
        return np.asarray(value({n: point[n] for n in value.names}))

    z = np.zeros(2)
    lower = z - generator.uniform(0, 1, 2) * start
    state = np.array([z, lower, lower + start])
    seen, v = [], V
    for k in range(steps):
        t = k * dt
        r = {"inverse_speed": 0.132 + 0.108 * np.sin(1.3 * t), "acceleration": 8.0 * np.sin(2.1 * t)}
        u = np.array([0.02 * np.sin(3.0 * t), 0.06 * np.cos(3.0 * t), 0.2 * np.sin(3.0 * t - 0.4)])
        if k % 25 == 0:
            mine, v = corners[generator.integers(len(corners))], V * generator.choice([-1.0, 1.0], V.size)
        C = at(system.polynomial("C"), r) @ inverse
        B, G, N = T @ at(system.polynomial("B"), r), at(system.polynomial("G"), r), at(system.polynomial("N"), r)
        every = np.array([T @ at(system.polynomial("A"), r | c) @ inverse for c in corners])
        true, L = every[corners.index(mine)], T @ at(design.gain, r)
        slack = np.abs(B @ N + L @ G) @ V
        seen.append(state)

        def slopes(s: np.ndarray, true=true, every=every, L=L, C=C, B=B, G=G, N=N, slack=slack, u=u, v=v) -> np.ndarray:  # type: ignore[no-untyped-def]
            x, low, high = s
            y, heard = C @ x + G @ v, B @ (u + N @ v)
            down = (every @ low).min(axis=0) + heard - L @ (C @ low - y) - slack
            return np.array([true @ x + B @ u, down, (every @ high).max(axis=0) + heard - L @ (C @ high - y) + slack])

        one = slopes(state)
        two = slopes(state + dt / 2 * one)
        three = slopes(state + dt / 2 * two)
        state = state + dt / 6 * (one + 2 * two + 2 * three + slopes(state + dt * three))
    states, lows, ups = np.array(seen).transpose(1, 0, 2)
    return states, lows, ups
