"""Figures: angles in degrees, one colour an entrant throughout, errors against the truth, a view that shows something."""

import numpy as np
import pytest

from luenberger.core import BadInput
from luenberger.report.decimation import LIMIT
from luenberger.report.figures import comparison_figures, cost_bars, error_bars, error_shares, estimate_figure, shown

TIME = np.linspace(0.0, 1.0, 50)
TRUTH = 0.1 * np.sin(TIME)
ESTIMATES = {"one": TRUTH + 0.01, "two": TRUTH - 0.02}


def test_angles_are_shown_in_degrees() -> None:
    values, unit = shown(np.array([np.pi]), "rad")
    assert (values[0], unit) == (180.0, "deg")
    assert shown(np.array([3.0]), "m/s")[1] == "m/s"


def test_estimates_and_errors_are_drawn() -> None:
    figure = estimate_figure(TIME, TRUTH, ESTIMATES, name="slip", unit="rad", truth_name="optical sensor")
    by_name: dict[str, list] = {}
    for trace in figure.plot.data:
        by_name.setdefault(trace.name, []).append(trace)
    # Single precision in the page.
    np.testing.assert_allclose(by_name["optical sensor"][0].y, np.rad2deg(TRUTH), rtol=1e-6)
    np.testing.assert_allclose(by_name["one"][0].y, np.rad2deg(TRUTH + 0.01), rtol=1e-6)
    np.testing.assert_allclose(by_name["two"][1].y, np.rad2deg(-0.02), rtol=1e-6)
    # One click hides estimate and error together, and the legend names each once.
    assert {t.legendgroup for t in by_name["one"]} == {"one"}
    assert [t.showlegend for t in by_name["one"]] == [True, False]
    assert figure.plot.layout.yaxis.title.text == "slip [deg]"


def test_another_length_is_refused() -> None:
    with pytest.raises(BadInput, match=r"`one`.*one length"):
        estimate_figure(TIME, TRUTH, {"one": TRUTH[:-1]}, name="slip", unit="rad")


def test_bounds_are_a_band_around_the_estimate() -> None:
    bounds = {"one": (TRUTH - 0.1, TRUTH + 0.1)}
    figure = estimate_figure(TIME, TRUTH, ESTIMATES, name="x", unit="m", bounds=bounds)
    lower, upper = (t for t in figure.plot.data if t.line.width == 0)
    assert upper.fill == "tonexty"
    assert np.all(np.asarray(lower.y) < np.asarray(upper.y))


def test_one_bad_entrant_does_not_flatten_the_others() -> None:
    figure = estimate_figure(TIME, TRUTH, {**ESTIMATES, "three": TRUTH + 0.015, "bad": TRUTH + 5.0}, name="x", unit="m")
    # 5 % above the largest error of the three that are alike.
    assert figure.plot.layout.yaxis2.range == pytest.approx((-0.021, 0.021))
    assert "`bad`" in figure.caption
    alike = estimate_figure(TIME, TRUTH, ESTIMATES, name="x", unit="m")
    assert alike.plot.layout.yaxis2.range is None
    assert alike.caption == ""


def test_missing_samples_are_no_obstacle() -> None:
    holes = np.where(TIME < 0.5, np.nan, TRUTH)
    figures = comparison_figures(
        TIME, holes, {**ESTIMATES, "none": np.full(50, np.nan)}, name="x", unit="rad", errors={"one": 0.1}
    )
    shares = next(f for f in figures if f.title.startswith("Share")).plot
    assert [t.name for t in shares.data] == ["one", "two"]


def test_long_curves_are_thinned() -> None:
    time = np.arange(50_000.0)
    figure = estimate_figure(time, np.sin(time), {"one": np.cos(time)}, name="x", unit="")
    assert all(len(t.x) <= LIMIT for t in figure.plot.data)


def test_bars_and_shares() -> None:
    bars = error_bars({"one": 0.01, "two": 0.02}, name="RMSE", unit="rad").plot.data[0]
    np.testing.assert_allclose(bars.x, np.rad2deg([0.01, 0.02]))
    np.testing.assert_allclose(cost_bars({"one": 2e-6}).plot.data[0].x, [2.0])
    curve = error_shares({"one": np.linspace(-1, 1, 1001)}, name="e", unit="").plot.data[0]
    # Half of the uniform errors are below one half.
    assert np.interp(50.0, curve.y, curve.x) == pytest.approx(0.5, abs=2e-3)


def test_a_comparison_has_all_of_them_in_one_colour_an_entrant() -> None:
    seconds = {"one": 1e-6, "two": 2e-6}
    figures = comparison_figures(TIME, TRUTH, ESTIMATES, name="slip", unit="rad", seconds=seconds)
    assert [f.kind for f in figures] == ["estimates", "errors", "errors", "cost"]
    assert len({tuple(f.colours.items()) for f in figures}) == 1
    np.testing.assert_allclose(figures[1].plot.data[0].x, np.rad2deg([0.01, 0.02]))
    assert len(comparison_figures(TIME, TRUTH, ESTIMATES, name="slip", unit="rad")) == 3
