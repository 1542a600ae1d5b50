"""Small observers to export."""

import numpy as np

from luenberger.algebra import Polynomial
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
