"""Design values of Wang 2014, chapter 4: levels of theorem 5, with the printed gain analysed, and where no gain keeps order."""

from collections.abc import Iterator

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.core import Infeasible, LuenbergerError
from luenberger.experiment.published.row import INDEPENDENT, Row, compared, judged
from luenberger.experiment.published.wang_enclosures import SAME, TURNED, car
from luenberger.experiment.published.wang_gains import INTERVAL, NONE, printed_gain
from luenberger.experiment.published.wang_plants import ACCELERATION, SPEED, STIFFNESS
from luenberger.methods.interval import IntervalLuenberger
from luenberger.synthesize import synthesize
from luenberger.systems import Parameter, System
from luenberger.systems.enclosure_system import order_margin
from luenberger.vehicle import slip_angle_plant, wang_car

# Speed up to which the printed gain, row two turned, keeps order [m/s].
PRINTED_TOP = 118 / 3.6


def interval_design_rows() -> Iterator[Row]:
    """Yield the levels of theorem 5 and the plant that no gain and no sign serves."""
    plant = car()
    limited = slip_angle_plant(wang_car, (SPEED[0], PRINTED_TOP), ACCELERATION, stiffness=STIFFNESS)
    fixed = plant.freeze(inverse_speed=1 / 20.0, acceleration=0.0)
    for words, system, coordinates, expected in (
        ("15 to 150 km/h, (front, rear)", plant, SAME, 0.38041),
        ("15 to 150 km/h, (front, -rear)", plant, TURNED, 0.40866),
        ("15 to 118 km/h, (front, -rear)", limited, TURNED, 0.32148),
        ("20 m/s, (front, rear)", fixed, SAME, 0.1702),
        ("20 m/s, (front, -rear)", fixed, TURNED, 0.1819),
    ):
        ours = level(system, coordinates)
        yield compared(
            f"smallest level of theorem 5, {words}", "(4.32)", expected, ours, "The dissertation prints the gain only."
        )
    for words, gain, system, expected in (
        ("printed gain, row two turned, 15 to 150 km/h", INTERVAL, plant, 0.39055),
        ("printed gain, row two turned, 15 to 118 km/h", INTERVAL, limited, 0.32217),
        ("no correction, 15 to 150 km/h", NONE, plant, 0.43238),
    ):
        ours = given_level(system, printed_gain(gain))
        why = (
            "Order aside, which the printed gain does not keep above 118.5 km/h."
            if gain is INTERVAL
            else "Common storage."
        )
        yield compared(f"level of {words}", "(4.47)", expected, ours, why)
    yield _no_order()


def level(system: System, coordinates: np.ndarray) -> float:
    """Return the smallest level of theorem 5 in given coordinates.

    Args:
        system: plant.
        coordinates: T.
    """
    return float(synthesize(system, IntervalLuenberger(coordinates=coordinates)).statistics["optimum"])


def given_level(system: System, gain: Polynomial) -> float:
    """Return the smallest level of a given gain in (front, -rear).

    Args:
        system: plant.
        gain: L(r).

    Raises:
        LuenbergerError: no storage was found.
    """
    found = IntervalLuenberger().level_of(system, gain, TURNED)
    if found is None:
        raise LuenbergerError(
            "No diagonal storage was found for a printed gain; install the extra solvers and try again."
        )
    return found


def lateral_car() -> System:
    """Lateral speed and yaw rate at 20 m/s with the yaw rate measured and both stiffnesses unknown."""
    m, Iz, a, b, v = (
        wang_car.mass,
        wang_car.yaw_inertia,
        wang_car.front_axle_distance,
        wang_car.rear_axle_distance,
        20.0,
    )
    names = ("front_stiffness", "rear_stiffness")
    A = Polynomial(
        names,
        {
            (0, 0): np.array([[0.0, -v], [0.0, 0.0]]),
            (1, 0): -np.array([[1 / m, a / m], [a / Iz, a * a / Iz]]) / v,
            (0, 1): np.array([[-1 / m, b / m], [b / Iz, -b * b / Iz]]) / v,
        },
    )
    parameters = [Parameter(n, *ends, "N/rad", measured=False) for n, ends in zip(names, STIFFNESS, strict=True)]
    return System.lpv(
        A, C=[[0.0, 1.0]], parameters=parameters, states=("lateral_speed", "yaw_rate"), name="lateral motion"
    )


def _no_order() -> Row:
    plant = lateral_car()
    margins = [order_margin(plant, np.zeros((2, 1)), T) for T in (SAME, TURNED)]
    worst = max(margin.value for margin in margins)
    try:
        synthesize(plant, IntervalLuenberger())
        answer = "a design was found"
    except Infeasible as refused:
        answer = f"refused: {str(refused).split(';')[0].split('. ')[0]}"
    return judged(
        "lateral speed and yaw rate as states, yaw rate measured, 20 m/s: entry that no gain reaches",
        INDEPENDENT,
        "-1.543 1/s, no design",
        f"{worst:.3f} 1/s; {answer}",
        "d(yaw rate)/d(lateral speed) changes its sign over the stiffness box and stands in a column that y does not touch. In slip angles "
        "the same car is served.",
        reproduced=abs(worst + 1.543) < 0.0015 and answer.startswith("refused"),
        deviation=abs(worst + 1.543),
    )
