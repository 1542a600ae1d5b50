"""The rows that bound the width against a brute-force maximum of what the two bounds of an observer can do."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from interval_plants import uncertain_pair
from luenberger.algebra import Polynomial
from luenberger.systems.enclosure_system import EnclosureSystem

GAIN = np.array([[0.6], [0.1]])
unit = st.floats(-1.0, 1.0)


@given(st.tuples(unit, unit), st.tuples(unit, unit), st.tuples(st.floats(0, 2), st.floats(0, 2)), unit, unit)
def test_no_enclosure_opens_faster(
    x: tuple[float, float], share: tuple[float, float], width: tuple[float, float], u: float, d: float
) -> None:
    plant = uncertain_pair(noise_bound=(0.3,), E=[[0.0], [1.0]], disturbance_bound=(0.2,))
    here = EnclosureSystem.of(plant)
    rows = here.rows(here.correction(Polynomial.constant(GAIN)))
    state, w = np.array(x), np.array(width)
    # The state anywhere inside the enclosure; every row takes the worst q for the upper and the best for the lower bound.
    lower = state - (np.array(share) + 1) / 2 * w
    ends = []
    for q in (-1.0, 1.0):
        A = np.array([[-1.0, 0.5], [0.4, -2.0]]) + q * np.array([[0.1, 0.2], [0.1, 0.3]])
        B = np.array([0.0, 1.0 + 0.2 * q])
        ends.append([A @ bound + B * u - GAIN[:, 0] * bound[0] for bound in (lower, lower + w)])
    slack = np.abs(GAIN[:, 0]) * 0.3 + np.array([0.0, 0.2])
    opening = np.max([e[1] for e in ends], axis=0) - np.min([e[0] for e in ends], axis=0) + 2 * slack
    for i in range(2):
        totals = rows.totals(i, list(w), list(np.abs(state)), [abs(u)])
        bound = max(float(t(dict.fromkeys(t.names, 0.0))[0, 0]) for t in totals)
        assert opening[i] <= bound + 1e-12


def test_drive_is_the_row_without_widths() -> None:
    here = EnclosureSystem.of(uncertain_pair(noise_bound=(0.3,)))
    rows = here.rows(here.correction(Polynomial.constant(GAIN)))
    for i in range(2):
        (total,), (drive,) = rows.totals(i, [0.0, 0.0], [1.0, 2.0], [3.0]), rows.drive(i, [1.0, 2.0], [3.0])
        np.testing.assert_allclose(total(dict.fromkeys(total.names, 0.0)), drive(dict.fromkeys(drive.names, 0.0)))
