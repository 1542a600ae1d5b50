"""The car of Ifqir et al. 2020, section 5: what is printed, what is not and was chosen here, and the plants that follow."""

from dataclasses import dataclass

import numpy as np

from luenberger.experiment.published.ifqir_printed import Bounds, PrintedMode
from luenberger.systems import Switched, System
from luenberger.systems.discretize import discretize
from luenberger.vehicle.cars import gust_car
from luenberger.vehicle.wind import wind_plant

# Printed: speeds of the three modes [m/s], their limits, with V0 as it has to be, and the sample time [s].
SPEEDS = (8.5, 13.55, 18.05)
PRINTED_ENDS = (10.6, 11.0, 16.0, 19.899)
ENDS = (6.0, 11.0, 16.0, 19.899)
PRINTED_STEP = 0.6
# The step at which epsilon = 0.5 is feasible for all three modes under Euler's rule.
STEP = 0.06
FADE = 0.5
PRINTED_GAMMA = 0.0120
# Printed bounds: states [m/s, rad/s], input error [rad], half widths of the first box, share of the stiffness.
STATE_BOUND = np.array([0.8, 0.3])
INPUT_ERROR = 0.01
START = 0.01
SHARE = 0.1
# Not printed: the noise of the gyro [rad/s] and the distance of the gust from the centre of gravity [m].
NOISE = 0.005
GUST_ARM = 0.4
_OUTPUT = np.array([[0.0, 1.0]])


@dataclass(frozen=True)
class Axles:
    """The single track in matrices that can be written down by hand, one speed at a time.

    Args:
        A: continuous state matrix, (2, 2).
        B: continuous input matrix, (2, 1).
        E: continuous gust matrix, (2, 1).
        directions: what one newton of lateral force of the front and of the rear axle does, (2, 2), one column an axle.
        slips: slip angle of each axle over (lateral speed, yaw rate), (2, 2), one row an axle; the front one gains the steering.
    """

    A: np.ndarray
    B: np.ndarray
    E: np.ndarray
    directions: np.ndarray
    slips: np.ndarray

    @staticmethod
    def at(speed: float, gust_arm: float = GUST_ARM) -> "Axles":
        """Return the car at one speed.

        Args:
            speed: vx [m/s].
            gust_arm: lw [m].
        """
        m, Iz = gust_car.mass, gust_car.yaw_inertia
        a, b = gust_car.front_axle_distance, gust_car.rear_axle_distance
        directions = np.array([[1 / m, 1 / m], [a / Iz, -b / Iz]])
        slips = np.array([[-1.0, -a], [-1.0, b]]) / speed
        stiffness = np.array([gust_car.front_stiffness, gust_car.rear_stiffness])
        A = (directions * stiffness) @ slips + np.array([[0.0, -speed], [0.0, 0.0]])
        B = stiffness[0] * directions[:, :1]
        return Axles(A, B, np.array([[1 / m], [gust_arm / Iz]]), directions, slips)

    def sampled(self, step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return A, B, E of Euler's rule.

        Args:
            step: sample time [s].
        """
        return np.eye(2) + step * self.A, step * self.B, step * self.E

    def decoupled(self, step: float) -> "Decoupled":
        """Return the observer that decouples the gust, with the gain that leaves only the zero.

        Args:
            step: sample time [s].
        """
        A, _, E = self.sampled(step)
        H = -E / float(E[1, 0])
        P = np.eye(2) + H @ _OUTPUT
        K = (P @ A)[:, 1:]
        return Decoupled(P @ A - K @ _OUTPUT, P, H, K)


@dataclass(frozen=True)
class Decoupled:
    """One mode of the observer (8).

    Args:
        N: error matrix, (2, 2).
        P: I + H C, (2, 2).
        H: decoupling matrix, (2, 1).
        K: gain, (2, 1).
    """

    N: np.ndarray
    P: np.ndarray
    H: np.ndarray
    K: np.ndarray

    @property
    def zero(self) -> float:
        """The eigenvalue of the error that no gain moves."""
        return float(self.N[0, 0])


def fixed_rate(speed: float, gust_arm: float = GUST_ARM) -> float:
    """Return the continuous eigenvalue of the error that no gain moves [1/s], in closed form.

    Args:
        speed: vx [m/s].
        gust_arm: lw [m], not zero.
    """
    a, b = gust_car.front_axle_distance, gust_car.rear_axle_distance
    front = gust_car.front_stiffness * (gust_arm - a)
    rear = gust_car.rear_stiffness * (gust_arm + b)
    return -(front + rear) / (gust_car.mass * speed * gust_arm)


def printed_mode(speed: float, share: float = SHARE, step: float = STEP) -> PrintedMode:
    """Return a mode as the recursion (34) to (36) takes it.

    Args:
        speed: vx [m/s].
        share: uncertainty of both stiffnesses.
        step: sample time [s].
    """
    car, seen = Axles.at(speed), Axles.at(speed).decoupled(step)
    stiffness = share * step * np.array([gust_car.front_stiffness, gust_car.rear_stiffness])
    dA = (np.abs(car.directions) * stiffness) @ np.abs(car.slips)
    dB = stiffness[0] * np.abs(car.directions[:, :1])
    return PrintedMode(seen.N, seen.P, seen.H, seen.K, Bounds.around(dA), Bounds.around(dB))


def continuous(
    share: float = SHARE,
    noise: float = NOISE,
    steering_error: float = 0.0,
    speed_error: float = 0.0,
    gust_arm: float = GUST_ARM,
    gust_bound: float | None = None,
) -> System:
    """Return the car over all speeds in continuous time.

    Args:
        share: uncertainty of both stiffnesses.
        noise: bound of the error of the gyro [rad/s].
        steering_error: bound of the error of the steering angle [rad].
        speed_error: bound of the error of the speed [m/s].
        gust_arm: lw [m].
        gust_bound: largest gust force [N]; None: none is known.
    """
    front, rear = gust_car.front_stiffness, gust_car.rear_stiffness
    return wind_plant(
        gust_car,
        (ENDS[0], ENDS[-1]),
        gust_arm=gust_arm,
        stiffness=(((1 - share) * front, (1 + share) * front), ((1 - share) * rear, (1 + share) * rear)),
        yaw_rate_noise=noise,
        steering_error=steering_error,
        speed_error=speed_error,
        gust_bound=gust_bound,
    )


def scheduled(step: float = STEP, **options: float) -> System:
    """Return the car over all speeds, sampled by Euler's rule.

    Args:
        step: sample time [s].
        options: see `continuous`.
    """
    return discretize(continuous(**options), step, "euler")


def switched(
    share: float = SHARE,
    noise: float = NOISE,
    steering_error: float = 0.0,
    step: float = STEP,
    gust_arm: float = GUST_ARM,
) -> Switched:
    """Return the car as three plants, one a mode, each at the printed speed.

    Args:
        share: uncertainty of both stiffnesses.
        noise: bound of the error of the gyro [rad/s].
        steering_error: bound of the error of the steering angle [rad].
        step: sample time [s].
        gust_arm: lw [m].
    """
    plant = scheduled(step, share=share, noise=noise, steering_error=steering_error, gust_arm=gust_arm)
    modes = [plant.freeze(speed=v, inverse_speed=1 / v) for v in SPEEDS]
    return Switched.of(modes, "speed", ENDS, unit="m/s")
