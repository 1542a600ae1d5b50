"""The switched car in side wind: three storages, five recursions, and filters that bound the gust or take it as noise."""

from collections.abc import Callable, Mapping

from luenberger.design import SwitchedDesign
from luenberger.experiment.gust_drive import Drive
from luenberger.experiment.gust_entrants import SOURCES, bounding, gaussian, local_schedule
from luenberger.experiment.gust_runs import VARIANTS, WORDS, Cars, Enclosure, driven, enclosed
from luenberger.experiment.gust_specification import GustSpecification
from luenberger.experiment.gust_study import HEADINGS, INDUCTION, NONE, NOTE, STATED, Study, scored
from luenberger.methods import UnknownInputGain
from luenberger.methods.unknown_input_inequality import Storage
from luenberger.report.figures import Figure, error_bars, estimate_figure
from luenberger.report.tables import Table
from luenberger.synthesize import synthesize
from luenberger.systems import Switched

STORAGES: Mapping[Storage, str] = {
    "common": "one storage for all modes",
    "mode": "a storage for each mode",
    "dwell": "a storage for each mode, dwell time",
}
# Samples between two switches that the storage with a dwell time trusts; the drive is longer in every mode.
DWELL = 5
OURS, BOUNDING, NOISE = "unknown-input observer", "gust bounded", "Kalman filter"
# The run that is shown: an adversary that pushes the error of the lateral speed up.
_SHOWN = -4


def switched_study(spec: GustSpecification, progress: Callable[[str, float], None]) -> Study:
    """Run the study.

    Args:
        spec: the experiment.
        progress: called with what is being done and the share done.
    """
    road, plant = spec.road(), spec.switched()
    designs = _designed(spec, plant, progress)
    first = designs[STORAGES["common"]]
    progress("driving", 0.2)
    schedule = road.speed[:, None]
    runs = driven(plant, first.gains, first.decoupling, road, schedule, spec.unknown(), spec.initial_half_width)
    found: dict[str, Enclosure] = {}
    for k, (name, (uncertainty, reuse, closed)) in enumerate(VARIANTS.items()):
        progress(f"replaying {name}", 0.3 + 0.1 * k)
        if closed or spec.state_bound:
            options = {"uncertainty": uncertainty, "reuse_noise": reuse, "closed_loop": closed}
            found[f"{name}: {WORDS[name]}"] = enclosed(first.observer(**options, **spec.options), runs, schedule)
    local = local_schedule(road.local)
    progress("replaying the filters", 0.85)
    others = {
        BOUNDING: bounding(spec, "bounded", spec.force, runs, local),
        NOISE: gaussian(spec, spec.force, runs, local),
    }
    everybody = found | others
    best = list(found)[-1]
    kinds = {**dict.fromkeys(everybody, INDUCTION), best: STATED, NOISE: NONE}
    rows = [scored(name, bounds, runs, kinds[name]) for name, bounds in everybody.items()]
    shown = {n: everybody[n] for n in (best, BOUNDING, NOISE)}
    # Those of the other picture first, so that everybody has one colour; then the recursions from the narrowest on.
    drawn = shown | {n: everybody[n] for n in reversed(found)}
    return Study(
        _summary(spec, everybody, best, runs),
        Table(HEADINGS, rows, [NOTE, _runs(spec, runs)], "Lateral speed"),
        _figures(road, runs, shown, drawn),
        {best if design is first else name: design for name, design in designs.items()},
        {
            "time": road.time,
            "speed": road.speed,
            "steering": road.steering,
            "gust": road.gust,
            "lateral_speed": runs.states[_SHOWN, :, 0],
        }
        | {f"{n} {end}": getattr(b, end)[_SHOWN, :, 0] for n, b in shown.items() for end in ("lower", "upper")},
        [_storages(designs, plant)],
        _assumptions(spec),
        SOURCES,
    )


def _designed(
    spec: GustSpecification, plant: Switched, progress: Callable[[str, float], None]
) -> dict[str, SwitchedDesign]:
    designs = {}
    for k, storage in enumerate(STORAGES):
        progress(f"designing with {STORAGES[storage]}", 0.05 * k)
        modes = spec.switched(DWELL) if storage == "dwell" else plant
        designs[STORAGES[storage]] = synthesize(modes, UnknownInputGain(fade=spec.fade, storage=storage))
    return designs


def _figures(road: Drive, runs: Cars, shown: Mapping[str, Enclosure], drawn: Mapping[str, Enclosure]) -> list[Figure]:
    return [
        error_bars(
            {n: b.width for n, b in drawn.items()},
            name="mean width of the bounds of the lateral speed",
            unit="m/s",
        ),
        estimate_figure(
            road.time,
            runs.states[_SHOWN, :, 0],
            {n: b.estimate[_SHOWN, :, 0] for n, b in shown.items()},
            name="lateral speed",
            unit="m/s",
            truth_name="car",
            bounds={n: (b.lower[_SHOWN, :, 0], b.upper[_SHOWN, :, 0]) for n, b in shown.items()},
            caption="Shown is a run whose stiffness and noise push the error of the unknown-input observer up at every sample.",
        ),
    ]


def _assumptions(spec: GustSpecification) -> list[str]:
    return [
        f"The car is sampled by Euler's rule with {spec.sample_time:g} s and is exactly what the plant says: in a mode it has the speed of "
        "the mode, and nothing covers what it deviates from that, see the study on the double track.",
        f"The zonotopic filter is told {spec.force:g} N, the largest gust of the drive; the {OURS}, c0 to c4, is told nothing of the gust.",
    ]


def _storages(designs: dict[str, SwitchedDesign], plant: Switched) -> Table:
    rows = []
    for name, design in designs.items():
        claims = {c.kind: c for c in design.certificate.claims}
        iss = claims["iss"]
        rows.append([name, iss.supply, iss.level, design.certificate.outcome.value])
    notes = [
        "What may be added to the storage in a step, and the bound of the error in units of what is added to it; with storages per mode, "
        "supply belongs to another scale.",
        f"The error has a zero that no gain moves in each of the {len(plant.modes)} modes; where the output leaves nothing else to choose, all "
        "storages give the same gains.",
    ]
    return Table(["design", "supply", "ultimate bound", "certificate"], rows, notes, "Storages")


def _runs(spec: GustSpecification, runs: Cars) -> str:
    return (
        f"{len(runs.states)} runs of {spec.samples * spec.sample_time:.0f} s: stiffness and noise at random inside their bounds and at their "
        "ends, constant at their ends, and adversaries that push the error one way."
    )


def _summary(spec: GustSpecification, everybody: dict[str, Enclosure], best: str, runs: Cars) -> str:
    width = {n: b.width for n, b in everybody.items()}
    left = int(everybody[best].left(runs.states).sum())
    noise = int(everybody[NOISE].left(runs.states).sum())
    held = "is left on none" if left == 0 else f"IS LEFT ON {left}"
    return (
        f"Without any bound of the gust the guaranteed lateral speed is {width[best]:.3f} m/s wide and {held} of {len(runs.states)} runs. "
        f"Told that no gust exceeds {spec.force:g} N, a zonotopic filter is {width[BOUNDING]:.3f} m/s wide. The Kalman filter's three standard "
        f"deviations are {width[NOISE]:.3f} m/s wide and are left on {noise} runs: a gust is no white noise, and a stiffness no noise at all."
    )
