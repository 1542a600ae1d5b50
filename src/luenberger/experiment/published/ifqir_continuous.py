"""Cars in continuous time: bounds for the car sampled by Euler's rule, and for the one sampled exactly with its remainder enclosed."""

from collections.abc import Iterator

import numpy as np

from luenberger.experiment.published.ifqir_car import ENDS, SPEEDS, START, STATE_BOUND, STEP, continuous
from luenberger.experiment.published.ifqir_drive import GUST
from luenberger.experiment.published.ifqir_estimates import runs
from luenberger.experiment.published.ifqir_runs import enclosed, observer
from luenberger.experiment.published.row import Row, judged
from luenberger.observers.unknown_input import UnknownInputObserver
from luenberger.systems import Switched
from luenberger.systems.held_box import discretize_enclosed
from luenberger.systems.uncertainty import Uncertain


def continuous_rows() -> Iterator[Row]:
    """Row of the discretisation error."""
    road, found = runs(exact=True)
    euler = enclosed(observer("c4"), found, road.speed[:, None])
    held = enclosed(held_observer(GUST), found, road.speed[:, None])
    left = [int(bounds.left(found.states).sum()) for bounds in (euler, held)]
    yield judged(
        "Bounds for the sampled car against the continuous one",
        "section 5.1",
        "first order Euler approximation",
        f"left on {left[0]} of {len(found.states)} runs with Ts = {STEP:g} s; sampled exactly with the remainder enclosed on {left[1]} "
        f"({held.width:.3f} m/s wide, Euler {euler.width:.3f} m/s)",
        "The recursion covers no discretisation error. `discretize_enclosed` does; its E moves with the stiffness, so what is left of the gust has to be "
        f"bounded, by {GUST:g} N here. Gust and steering are held over a step.",
        reproduced=left[0] == 0,
        corrected=left[1] == 0,
        deviation=left[0] / len(found.states),
    )


def held_observer(gust_bound: float) -> UnknownInputObserver:
    """Return the observer of the exactly sampled car, decoupled for its nominal gust direction.

    Args:
        gust_bound: largest gust force [N].
    """
    plant = continuous(gust_bound=gust_bound)
    modes = [discretize_enclosed(plant.freeze(speed=v, inverse_speed=1 / v), STEP) for v in SPEEDS]
    gains, decoupling = [], []
    for mode in modes:
        nominal = Uncertain.of(mode).nominal
        A, C, E = (np.asarray(nominal.at(letter)) for letter in "ACE")
        H = -E / float((C @ E)[0, 0])
        decoupling.append(H)
        gains.append((np.eye(2) + H @ C) @ A @ C.T)
    return UnknownInputObserver(
        Switched.of(modes, "speed", ENDS, unit="m/s"),
        gains,
        decoupling,
        initial_half_width=[START, START],
        state_bound=STATE_BOUND,
    )
