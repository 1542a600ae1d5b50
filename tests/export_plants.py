"""Small observers to export, and drives that ask everything of them."""

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.export import Golden, Guarded, golden
from luenberger.export.golden import random_drive
from luenberger.observers import CorrectionObserver
from luenberger.systems import Parameter, System


def scheduled() -> System:
    """Spring with a measured stiffness that moves at a bounded rate, position measured."""
    A = Polynomial.affine(np.array([[0.0, 1.0], [0.0, -0.4]]), stiffness=np.array([[0.0, 0.0], [-1.0, 0.0]]))
    return System.lpv(
        A,
        [[0.0], [1.0]],
        [[1.0, 0.0]],
        parameters=[Parameter("stiffness", 1.0, 4.0, "1/s^2", rate=2.0)],
        states=("position", "speed"),
        inputs=("force",),
        outputs=("measured_position",),
        units={"position": "m", "speed": "m/s", "force": "N", "measured_position": "m", "stiffness": "1/s^2"},
        name="spring",
    )


def running(dt: float = 0.01) -> CorrectionObserver:
    """Its observer with a gain that follows the stiffness."""
    gain = Polynomial.affine(np.array([[2.0], [1.0]]), stiffness=np.array([[0.0], [-0.5]]))
    return CorrectionObserver(scheduled(), gain, dt)


# Beyond these a sine reduced in another way is another number, which is the business of no observer.
EXTREMES = (np.nan, np.inf, -np.inf, 1e9, -1e9, 1e-320, 0.0, -0.0)


def vectors(watched: Guarded, samples: int = 50, runs: int = 200) -> Golden:
    """Golden vectors of which half see extremes: what is not finite, what is huge, what lies outside the domain."""
    rng = np.random.default_rng(1)
    x0, *signals = random_drive(watched, samples, runs)
    for signal in signals:
        hit = rng.random(signal.shape) < 0.03
        hit[: runs // 2] = False
        signal[hit] = rng.choice(EXTREMES, size=int(hit.sum()))
    return golden(watched, x0, *signals)
