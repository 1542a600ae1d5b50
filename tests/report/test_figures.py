"""Figures: angles in degrees, one colour an entrant throughout, errors against the truth."""

import numpy as np

from luenberger.report.figures import comparison_figures, cost_bars, error_bars, error_shares, estimate_figure, shown
from luenberger.report.palette import faded, styles

TIME = np.linspace(0.0, 1.0, 50)
TRUTH = 0.1 * np.sin(TIME)
ESTIMATES = {"one": TRUTH + 0.01, "two": TRUTH - 0.02}


def test_angles_are_shown_in_degrees() -> None:
    values, unit = shown(np.array([np.pi]), "rad")
    assert (values[0], unit) == (180.0, "deg")
    assert shown(np.array([3.0]), "m/s")[1] == "m/s"


def test_estimates_and_errors_are_drawn() -> None:
    figure = estimate_figure(TIME, TRUTH, ESTIMATES, name="slip", unit="rad")
    traces = {t.name: t for t in figure.plot.data if t.name}
    assert {"truth", "one", "two"} <= set(traces)
    errors = [t for t in figure.plot.data if t.name == "one"]
    assert any(np.allclose(t.y, np.rad2deg(0.01), atol=1e-5) for t in errors)


def test_every_entrant_keeps_its_colour() -> None:
    names = [f"n{k}" for k in range(9)]
    looks = styles(names)
    assert len({(s.colour, s.dash) for s in looks.values()}) == len(names)
    assert styles(names)["n3"] == looks["n3"]
    assert faded(looks["n0"].colour, 0.5).startswith("rgba")


def test_bars_and_shares() -> None:
    bars = error_bars({"one": 0.01, "two": 0.02}, name="RMSE", unit="rad").plot.data[0]
    np.testing.assert_allclose(bars.x, np.rad2deg([0.01, 0.02]))
    cost = cost_bars({"one": 2e-6}).plot.data[0]
    np.testing.assert_allclose(cost.x, [2.0])
    shares = error_shares({"one": np.linspace(-1, 1, 101)}, name="e", unit="").plot.data[0]
    assert max(shares.y) == 100.0


def test_a_comparison_has_all_of_them() -> None:
    figures = comparison_figures(
        TIME,
        TRUTH,
        ESTIMATES,
        name="slip",
        unit="rad",
        errors={"one": 0.01, "two": 0.02},
        seconds={"one": 1e-6, "two": 2e-6},
    )
    assert len(figures) == 4
