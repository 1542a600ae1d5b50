"""The scheduled observer on a double track in side wind: what a car that is no single track does to a guarantee, and what restores it."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from luenberger.core import Trajectory
from luenberger.experiment.drives import speed_held
from luenberger.experiment.gust_drive import Drive
from luenberger.experiment.gust_entrants import SOURCES, bounding, gaussian, local_schedule
from luenberger.experiment.gust_mismatch import across_gust, along_gust
from luenberger.experiment.gust_runs import Cars, Enclosure, enclosed
from luenberger.experiment.gust_specification import GustSpecification
from luenberger.experiment.gust_study import HEADINGS, INDUCTION, NONE, NOTE, STATED, Study, scored
from luenberger.methods import UnknownInputGain
from luenberger.report.figures import Figure, error_bars, estimate_figure
from luenberger.report.tables import Table
from luenberger.simulate import TruthModel, simulate
from luenberger.synthesize import synthesize
from luenberger.vehicle.double_track import DoubleTrack
from luenberger.vehicle.double_track_parameters import DoubleTrackParameters
from luenberger.vehicle.road import Road

BELIEVING, MEASURED = "decoupled, as stated", "decoupled, mismatch covered"
BOUNDING, WIDER, NOISE = "gust bounded", "gust bounded, mismatch covered", "Kalman filter"
# Room over what the mismatch was on this very drive.
_ROOM = 1.05


def double_track_study(spec: GustSpecification, progress: Callable[[str, float], None]) -> Study:
    """Run the study.

    Args:
        spec: the experiment.
        progress: called with what is being done and the share done.
    """
    progress("simulating the double track", 0.0)
    road = spec.road()
    truth = windy_double_track(spec, road)
    runs = _read(spec, road, truth)
    schedule = local_schedule(np.clip(truth["speed"].values, spec.ends[0], spec.ends[-1]))
    progress("designing", 0.4)
    plant = spec.scheduled()
    stated = synthesize(plant, UnknownInputGain(fade=spec.fade))
    gap = across_gust(plant, road, truth, schedule)
    error = spec.steering_error + _ROOM * float(gap.max())
    more = along_gust(plant, road, truth, schedule, _ROOM * float(gap.max()))
    force = spec.force + _ROOM * float(more.max())
    wide = synthesize(spec.scheduled(steering_error=error), UnknownInputGain(fade=spec.fade))
    progress("replaying", 0.6)
    found = {
        BELIEVING: enclosed(stated.observer(**spec.options), runs, schedule),
        MEASURED: enclosed(wide.observer(**spec.options), runs, schedule),
        BOUNDING: bounding(spec, "bounded", spec.force, runs, schedule, steering_error=error),
        WIDER: bounding(spec, "bounded", force, runs, schedule, steering_error=error),
        NOISE: gaussian(spec, spec.force, runs, schedule),
    }
    kinds = {BELIEVING: STATED, MEASURED: STATED, BOUNDING: INDUCTION, WIDER: INDUCTION, NOISE: NONE}
    return Study(
        _summary(found, runs, gap, error, force),
        Table(HEADINGS, [scored(n, b, runs, kinds[n]) for n, b in found.items()], [NOTE], "Lateral speed"),
        _figures(road, runs, found),
        {BELIEVING: stated, MEASURED: wide},
        {"time": road.time, "gust": road.gust, "mismatch": np.append(gap, 0.0), "mismatch_gust": np.append(more, 0.0)}
        | {n: truth[n].values for n in ("speed", "lateral_speed", "yaw_rate", "steering")}
        | {f"{n} {end}": getattr(b, end)[0, :, 0] for n, b in found.items() for end in ("lower", "upper")},
        [_drive_table(truth, gap, more)],
        _assumptions(spec, error, force),
        SOURCES,
    )


def _figures(road: Drive, runs: Cars, found: dict[str, Enclosure]) -> list[Figure]:
    x = runs.states[0, :, 0]
    # The first ones alone, or nothing could be told apart.
    shown = {n: found[n] for n in (BELIEVING, MEASURED)}
    return [
        error_bars(
            {n: b.width for n, b in found.items()}, name="mean width of the bounds of the lateral speed", unit="m/s"
        ),
        estimate_figure(
            road.time,
            x,
            {n: b.estimate[0, :, 0] for n, b in shown.items()},
            name="lateral speed",
            unit="m/s",
            truth_name="double track",
            bounds={n: (b.lower[0, :, 0], b.upper[0, :, 0]) for n, b in shown.items()},
            caption="The first of the runs, which differ in the noise of the gyro alone. Both have the same estimate; where the car leaves the inner "
            "band, the guarantee as stated broke. The numbers of the others lie in the file beside the page.",
        ),
    ]


def _assumptions(spec: GustSpecification, error: float, force: float) -> list[str]:
    return [
        "The truth is a double track with load transfer, roll, relaxation and combined slip, driven with steering and gust held over each "
        f"step of {spec.sample_time:g} s. The gust enters as a force and a moment; what it does to roll and load transfer is left out.",
        f"`{MEASURED}` adds {np.rad2deg(error - spec.steering_error):.3f} deg to the bound of the steering error, {_ROOM:g} times the largest "
        "mismatch of this very drive. That makes the bound true here; on another road it is an assumption like any other.",
        "What a mismatch does along the gust an unknown-input observer takes for gust and decouples with it; a filter that bounds the gust "
        f"has to be told {force:.0f} N for it: `{WIDER}`. `{BOUNDING}` believes {spec.force:g} N and has the wider steering error alone.",
        f"The speed is read exactly and clipped to [{spec.ends[0]:g}, {spec.ends[-1]:g}] m/s.",
    ]


def windy_double_track(spec: GustSpecification, road: Drive) -> Trajectory:
    """Simulate the double track on the drive, steering and gust held over each step.

    Args:
        spec: the car.
        road: what driver and wind do.
    """
    model = DoubleTrack(DoubleTrackParameters.of(spec.vehicle, "set by the study"), Road.uniform(spec.friction))
    held = speed_held(model)
    turn, side = model.states.index("yaw_rate"), model.states.index("lateral_speed")
    push = np.zeros(len(model.states))
    push[side], push[turn] = 1 / spec.vehicle.mass, spec.arm / spec.vehicle.yaw_inertia

    def blown(t: jax.Array, x: jax.Array, u: jax.Array, r: jax.Array) -> jax.Array:
        return held.dynamics(t, x, u[:3], r) + jnp.asarray(push) * u[3]

    windy = TruthModel(
        blown,
        lambda t, x, u, r: held.output(t, x, u[:3], r),
        states=held.states,
        inputs=(*held.inputs, "gust"),
        outputs=held.outputs,
        units={**held.units, "gust": "N"},
        name=f"{held.name} in side wind",
    )
    asked = np.gradient(road.speed, road.time)
    run = simulate(
        windy,
        time=road.time,
        x0=np.asarray(model.start(float(road.speed[0]))),
        u=np.column_stack([road.steering, asked, road.speed, road.gust]),
        rtol=1e-8,
        atol=1e-10,
    )
    return Trajectory(
        road.time, [run[n] for n in ("speed", "lateral_speed", "yaw_rate", "steering")], windy.name, "simulation"
    )


def _read(spec: GustSpecification, road: Drive, truth: Trajectory) -> Cars:
    """One car, many gyros and steering sensors."""
    unknown = spec.unknown()
    count = unknown.noise.shape[1]
    x = truth.table(["lateral_speed", "yaw_rate"])
    noise = unknown.noise.swapaxes(0, 1)
    steering = truth["steering"].values[None, :, None] + spec.steering_error * noise[..., 1:]
    return Cars(np.repeat(x[None], count, axis=0), x[None, :, 1:] + spec.yaw_rate_noise * noise[..., :1], steering)


def _drive_table(truth: Trajectory, gap: np.ndarray, more: np.ndarray) -> Table:
    lateral = np.abs(truth["yaw_rate"].values * truth["speed"].values)
    rows = [
        ["speed [m/s]", float(truth["speed"].values.min()), float(truth["speed"].values.max())],
        ["lateral acceleration, vx r [m/s²]", 0.0, float(lateral.max())],
        ["lateral speed [m/s]", float(truth["lateral_speed"].values.min()), float(truth["lateral_speed"].values.max())],
        ["mismatch across the gust, as steering [deg]", 0.0, float(np.rad2deg(gap.max()))],
        ["mismatch along the gust, as more gust [N]", float(more.min()), float(more.max())],
    ]
    notes = [
        f"The mismatch is what the plant with all its uncertain factors cannot do in a step; they cover {100 * np.mean(gap == 0.0):.1f} % of the steps across the gust. "
        "Tyre curvature, relaxation, roll and Euler's rule are in it."
    ]
    return Table(["on the drive", "least", "largest"], rows, notes, "What the double track did")


def _summary(found: dict[str, Enclosure], runs: Cars, gap: np.ndarray, error: float, force: float) -> str:
    left = {n: int(b.left(runs.states).sum()) for n, b in found.items()}
    width = {n: b.width for n, b in found.items()}
    count = len(runs.states)
    first = (
        "held on every run all the same, by the room of the set"
        if left[BELIEVING] == 0
        else f"was left on {left[BELIEVING]} of {count} runs: a proof about a plant says nothing about another car"
    )
    return (
        f"The double track did what the stated plant cannot do in {100 * np.mean(gap > 0.0):.0f} % of the steps, by as much as "
        f"{np.rad2deg(gap.max()):.2f} deg of steering. The guarantee as stated, {width[BELIEVING]:.3f} m/s wide, {first}. With the mismatch "
        f"covered by a steering error of {np.rad2deg(error):.2f} deg it is {width[MEASURED]:.3f} m/s wide and left on {left[MEASURED]} runs.\n\n"
        f"The zonotopic filter that bounds the gust is left on {left[BOUNDING]} runs even with that steering error, since a mismatch looks like "
        f"gust as well; it needs a gust bound of {force:.0f} N, and is {width[WIDER]:.3f} m/s wide then and left on {left[WIDER]}. The Kalman "
        f"filter's three standard deviations are left on {left[NOISE]}."
    )
