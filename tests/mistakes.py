"""Ordinary mistakes at the doors, with what has to be said; run as a program it makes them all and prints what was said."""

import json
from collections.abc import Callable
from typing import Any

import numpy as np

from luenberger import Polynomial, Signal, System, Trajectory
from luenberger.certify import Claim, SwitchedClaim
from luenberger.core import BadInput, Infeasible, LuenbergerError, NotAccepted
from luenberger.design import Design, SwitchedDesign
from luenberger.export import look_up_table
from luenberger.methods import KalmanGain, SteadyWidth, UnknownInputGain
from luenberger.observers import ZonotopicFilter
from luenberger.replay import Channels, replay
from luenberger.synthesize import synthesize
from luenberger.systems import Parameter

A, C, E = [[0.9, 0.1], [0.0, 0.8]], [[0.0, 1.0]], [[0.0], [1.0]]
PLANT: dict[str, Any] = {"C": C, "E": E, "dt": 0.1, "noise_bound": [0.1]}


def windy() -> SwitchedDesign:
    return synthesize(System.linear(A, **PLANT), UnknownInputGain(fade=0.1))


def scheduled() -> Design:
    moving = Polynomial.affine(np.array([[0.5]]), speed=np.array([[0.1]]))
    plant = System.lpv(moving, C=[[1.0]], dt=0.1, parameters=[Parameter("speed", 1.0, 2.0, "m/s")])
    return synthesize(plant, KalmanGain(np.eye(1), np.eye(1)))


def log() -> Trajectory:
    return Trajectory(0.1 * np.arange(4), [Signal("y1", "", np.zeros(4))], "log")


MISTAKES: dict[str, tuple[Callable[[], Any], type[Exception], str]] = {
    "step as a text": (lambda: System.linear(A, C=C, dt="0.1"), BadInput, "`dt` is '0.1'; a discrete plant needs"),  # type: ignore[arg-type]
    "one bound without a list": (
        lambda: System.linear(A, C=C, dt=0.1, noise_bound=0.1),
        BadInput,
        "`noise_bound` is 0.1; a list of 1 numbers",
    ),
    "a class for a method": (
        lambda: synthesize(System.linear(A, **PLANT), UnknownInputGain),  # type: ignore[arg-type]
        BadInput,
        "the class `UnknownInputGain`; pass a method with its options",
    ),
    "method and plant swapped": (
        lambda: synthesize(UnknownInputGain(), System.linear(A, **PLANT)),  # type: ignore[arg-type]
        BadInput,
        "takes a plant and a method, but the method given is a `System`",
    ),
    "unit and values swapped": (
        lambda: Signal("y1", np.zeros(3), "m"),  # type: ignore[arg-type]
        BadInput,
        "give name, unit, values in this order",
    ),
    "an observer alone": (
        lambda: replay(windy().observer(initial_half_width=[1, 1]), log(), Channels((), ("y1",)), np.zeros(2)),  # type: ignore[arg-type]
        BadInput,
        "`observers` is a `UnknownInputObserver`; a mapping",
    ),
    "a word for a reduction": (
        lambda: ZonotopicFilter(
            System.linear([[0.9]], C=[[1.0]], dt=0.1, noise_bound=[1.0]),
            initial_half_width=[1.0],
            reduction="girard",  # type: ignore[arg-type]
        ),
        BadInput,
        "`reduction` is 'girard'; a function is needed",
    ),
    "noise without a bound": (
        lambda: synthesize(System.linear([[0.9]], C=[[1.0]], dt=0.1), SteadyWidth()),
        BadInput,
        "has no `noise_bound`;",
    ),
    "a disturbance without a bound": (
        lambda: synthesize(System.linear([[0.9]], C=[[1.0]], E=[[1.0]], dt=0.1, noise_bound=[1.0]), SteadyWidth()),
        BadInput,
        "has an E without `disturbance_bound`;",
    ),
    "nothing to decouple": (
        lambda: synthesize(System.linear(A, C=C, dt=0.1, noise_bound=[0.1]), UnknownInputGain()),
        NotAccepted,
        "has no unknown input E, so there is nothing to decouple",
    ),
    "a fade that is too fast": (
        lambda: synthesize(System.linear(A, **PLANT), UnknownInputGain(fade=0.5)),
        Infeasible,
        "`fade=None` look for the best",
    ),
    "a table without its axis": (
        lambda: look_up_table(scheduled(), []),
        BadInput,
        r"an axis is missing for speed in \[1, 2\].*--axis speed:1,...,2",
    ),
    "a claim of no kind": (
        lambda: Claim.from_text(Claim("decay", 1.0, np.eye(2)).as_text() | {"kind": ["decay"]}),
        BadInput,
        r"`kind` of a `Claim` is \['decay'\]; one of 'decay', ",
    ),
    "a claim about another signal": (
        lambda: Claim("decay", 1.0, np.eye(2), form="x"),  # type: ignore[arg-type]
        BadInput,
        "`form` of a `Claim` is 'x'; one of 'plant', 'estimate' is needed",
    ),
    # Its sentence would be that of an ISS bound, with nothing behind it.
    "a claim that nothing checks": (
        lambda: SwitchedClaim("stable", 1e-3),  # type: ignore[arg-type]
        BadInput,
        "`kind` of a `SwitchedClaim` is 'stable'; one of 'decoupling', ",
    ),
    "a claim about no order of modes": (
        lambda: SwitchedClaim("containment", 1e-16, order="first"),  # type: ignore[arg-type]
        BadInput,
        "`order` of a `SwitchedClaim` is 'first'; one of 'next', 'last' is needed",
    ),
    "a folder that is not there": (
        lambda: windy().save("/nowhere/at/all.json"),
        BadInput,
        "cannot be written .*; give another path",
    ),
}


def said(make: Callable[[], Any]) -> list[str]:
    """Kind and words of what a mistake raises."""
    try:
        make()
    except (LuenbergerError, TypeError, ValueError, AttributeError) as error:
        return [type(error).__name__, str(error)]
    return ["nothing", ""]


if __name__ == "__main__":
    print(json.dumps({name: said(make) for name, (make, _, _) in MISTAKES.items()}))
