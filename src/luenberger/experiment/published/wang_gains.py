"""The observer gains printed in Wang 2014, section 3.3 and equation (4.47), and the observers that they make.

The prints are for the state (front slip, -rear slip), which the dissertation does not say: `flipped` turns the sign of the
second row (and of the second column of an unstructured A_o). Evidence stands with the rows of `wang-lpv`.
"""

from typing import Any

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.experiment.published.wang_plants import ACCELERATION, SPEED
from luenberger.observers import CorrectionObserver
from luenberger.systems import System
from luenberger.vehicle import slip_angle_plant, wang_car

# The scheduling of the print is (1/vx, ax/vx): exponents of (inverse_speed, acceleration).
_NAMES, _KEYS = ("inverse_speed", "acceleration"), ((0, 0), (1, 0), (1, 1))
_FLIP = np.diag([1.0, -1.0])

FEASIBLE = ((0.0477, 0.0477), (-65.7731, -63.7411), (-0.4363, -0.4363))
H2 = ((7250.9, 6962.8), (35776.0, 34423.0), (831.9374, 773.2087))
HINF = ((390.3628, 376.0443), (941.1064, 908.2782), (104.0730, 100.1726))
INTERVAL = ((1.7127, 1.3431), (-58.5902, -42.9510), (-0.5579, -0.4398))
# A_o, B_ou and B_oy in that order; of B_ou the second and third columns carry the steering and yaw rates.
H2_FREE = (
    (
        ((-2319.1, -2321.0), (-2531.0, -2532.7)),
        ((-2982.7, -2818.1), (-1432.1, -1581.4)),
        ((125.4695, 126.4443), (121.1414, 120.1646)),
    ),
    (((0.3352, 1, 1), (0.3364, 0, -1)), ((-1.5886, 0, 0), (-1.4224, 0, 0)), ((0.9821, 0, 0), (0.0147, 0, 0))),
    ((2320.3, 2532.2), (2824.4, 1432.6), (-126.4374, -121.1343)),
)
HINF_FREE = (
    (
        ((-324.2065, -324.4028), (-311.0927, -310.6798)),
        ((-360.3333, -202.7391), (-194.5750, -352.6795)),
        ((-1.0852, -0.1374), (-0.1474, -1.1605)),
    ),
    (((-0.9175, 1, 1), (-0.8422, 0, -1)), ((2.1202, 0, 0), (2.0056, 0, 0)), ((1.2391, 0, 0), (0.2549, 0, 0))),
    ((324.2891, 310.8739), (206.7304, 200.8320), (0.1406, 0.1824)),
)
# Ours: optimal H2 gain once the error that vx brings into y is counted; then the gain is finite and constant.
CORRECTED = ((37.0, 35.7), (0.0, 0.0), (0.0, 0.0))
NONE = ((0.0, 0.0), (0.0, 0.0), (0.0, 0.0))

LUENBERGER = {
    "feasibility gain": FEASIBLE,
    "H2 Luenberger": H2,
    "H-infinity Luenberger": HINF,
    "no correction": NONE,
    "corrected H2 Luenberger": CORRECTED,
}
UNSTRUCTURED = {"H2 unstructured": H2_FREE, "H-infinity unstructured": HINF_FREE}


def printed_gain(parts: Any, *, flipped: bool = True) -> Polynomial:
    """Return L(r) of three printed columns, in (inverse_speed, acceleration).

    Args:
        parts: L0, L1, L2, each of shape (2,).
        flipped: turn the sign of the second row, into the states (front slip, rear slip).
    """
    turn = _FLIP if flipped else np.eye(2)
    return _scheduled([turn @ np.reshape(np.asarray(p, np.float64), (2, 1)) for p in parts])


def slip_plant() -> System:
    """The car of the dissertation over the speeds and accelerations of its designs."""
    return slip_angle_plant(wang_car, SPEED, ACCELERATION)


def unstructured_model(parts: Any, *, flipped: bool = True) -> tuple[System, Polynomial]:
    """Return the copy An = A_o + B_oy C, Bn = B_ou of an unstructured observer and its gain B_oy.

    Args:
        parts: A_o, B_ou and B_oy, three coefficients each.
        flipped: turn signs into the states (front slip, rear slip).
    """
    turn = _FLIP if flipped else np.eye(2)
    A, B, gain = parts
    L, C = printed_gain(gain, flipped=flipped), np.array([[1.0, -1.0]])
    loop = _scheduled([turn @ np.asarray(p, np.float64) @ turn for p in A])
    inputs = _scheduled([turn @ np.asarray(p, np.float64) for p in B])
    return slip_plant().replace(A=loop + L @ C, B=inputs), L


def printed_observers(dt: float, *, flipped: bool = True) -> dict[str, CorrectionObserver]:
    """Return every observer of section 3.3, the copy without correction and the corrected H2 gain, by exact steps.

    The fastest printed loop has a rate of 3.4e4 1/s, which Runge-Kutta would need hundreds of parts of a step for.

    Args:
        dt: sample time [s].
        flipped: turn signs into the states (front slip, rear slip).
    """
    plant = slip_plant()
    made = {
        name: CorrectionObserver(plant, printed_gain(p, flipped=flipped), dt, method="exact")
        for name, p in LUENBERGER.items()
    }
    for name, parts in UNSTRUCTURED.items():
        model, gain = unstructured_model(parts, flipped=flipped)
        made[name] = CorrectionObserver(model, gain, dt, method="exact")
    return made


def _scheduled(parts: Any) -> Polynomial:
    return Polynomial(_NAMES, dict(zip(_KEYS, parts, strict=True)))
