"""The fishhook of Wang 2014, figures 5.6 to 5.8, drawn again on the double track: who finds the slip angles."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from luenberger.core import Trajectory
from luenberger.experiment.published.wang_fishhook_runs import (
    LINEAR,
    NONLINEAR,
    double_track_truth,
    everybody,
    root_mean_squares,
)
from luenberger.experiment.published.wang_runs import FIRST, slip_truth
from luenberger.report.figures import Figure
from luenberger.report.palette import TRUTH, styles

# Every fiftieth of a second is enough to look at.
EVERY = 20
SHOWN = (LINEAR, NONLINEAR, "EKF", "UKF", "EKF without accelerometer")


def fishhook_figure() -> Figure:
    """Return both slip angles with their estimates, over steering and speed; from the third second to the sixth they are largest."""
    truth = double_track_truth()
    found, true, time = everybody(truth), slip_truth(truth), truth.time[FIRST:][::EVERY]
    looks = styles(SHOWN)
    plot = make_subplots(
        rows=3,
        cols=1,
        shared_xaxes=True,
        row_heights=[0.39, 0.39, 0.22],
        vertical_spacing=0.05,
        specs=[[{}], [{}], [{"secondary_y": True}]],
    )
    for axle, name in enumerate(("front", "rear")):
        row = axle + 1
        plot.add_trace(
            _line(time, np.rad2deg(true[::EVERY, axle]), "double track", TRUTH, axle == 0, width=2.4), row, 1
        )
        for who in SHOWN:
            values = np.rad2deg(found[who][::EVERY, axle])
            plot.add_trace(_line(time, values, who, looks[who].colour, axle == 0), row, 1)
        for edge in (-0.1, 0.1):
            level = np.full(2, np.rad2deg(edge))
            plot.add_trace(_line(time[[0, -1]], level, "0.1 rad", "#b0b4ba", False, width=1.0, dash="dash"), row, 1)
        plot.update_yaxes(title_text=f"{name} slip angle [deg]", row=row)
    steering, speed = (truth[n].values[FIRST:][::EVERY] for n in ("steering", "speed"))
    plot.add_trace(_line(time, np.rad2deg(steering), "steering", "#8a8a8a", True, dash="solid"), 3, 1)
    plot.add_trace(_line(time, 3.6 * speed, "speed", "#8a8a8a", True, dash="dot"), 3, 1, secondary_y=True)
    plot.update_yaxes(title_text="steering [deg]", row=3, col=1, secondary_y=False)
    plot.update_yaxes(
        title_text="speed [km/h]", row=3, col=1, secondary_y=True, showgrid=False, range=[15, 85], dtick=20
    )
    plot.update_xaxes(title_text="time [s]", row=3)
    plot.update_layout(
        height=760,
        template="plotly_white",
        margin={"l": 64, "r": 64, "t": 56, "b": 48},
        legend={"orientation": "h", "yanchor": "bottom", "y": 1.01, "x": 0},
    )
    return Figure(
        "estimates",
        "Figs. 5.6 to 5.8: slip angles in a fishhook, 78 to 23 km/h",
        plot,
        _caption(truth, found),
        {n: looks[n].colour for n in SHOWN},
    )


def _caption(truth: Trajectory, found: Mapping[str, np.ndarray]) -> str:
    errors = {n: root_mean_squares(found[n], truth) for n in SHOWN}
    told = ", ".join(f"{n} {e[0]:.1f}/{e[1]:.1f}" for n, e in errors.items())
    return (
        f"Root mean square errors front/rear from two seconds on [mrad]: {told}. Dashed: 0.1 rad, beyond which the dissertation calls the "
        "tyres nonlinear. Estimators start at one second, away from the truth; no noise, nobody tuned."
    )


def _line(
    x: np.ndarray, y: np.ndarray, name: str, colour: str, legend: bool, *, width: float = 1.6, dash: str = "solid"
) -> Any:
    return go.Scatter(
        x=x,
        y=y,
        name=name,
        mode="lines",
        legendgroup=name,
        showlegend=legend,
        line={"color": colour, "width": width, "dash": dash},
    )
