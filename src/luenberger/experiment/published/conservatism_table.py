"""The comparison computed: for every plant and design the largest strength with a proof, the first without, and the gain."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context
from typing import Literal

from luenberger.admissible import Admissible, largest_admissible
from luenberger.core import BadInput, Infeasible, NotAccepted, NotCertified
from luenberger.design import Design
from luenberger.experiment.published.conservatism_cost import unknowns
from luenberger.experiment.published.conservatism_entrants import ENTRANTS, LIMIT_WORDS, Entrant, Limited
from luenberger.experiment.published.conservatism_plants import Plant, plant_called, plant_names
from luenberger.experiment.published.conservatism_probe import seems_possible
from luenberger.methods.method import Method
from luenberger.synthesize import synthesize
from luenberger.systems import System

Status = Literal["proved", "undecided", "refused", "not accepted"]
# Largest gain [units of the plant, 1/s and 1/s^2] that counts: with a measured derivative almost any strength is met by some gain.
GAIN_LIMIT = 100.0
# Decimal logarithms of the strengths between which is searched, of one percent, and of a first stride.
LOWEST, HIGHEST, STEP, LEAP = -3.0, 2.0, 0.0043, 0.5
# The design whose strength halves into the common one of a plant that has no nominal strength.
COMMON = "vertices of the Jacobian box"


@dataclass(frozen=True)
class Entry:
    """One plant under one design.

    Args:
        plant: its name.
        method: name of the design.
        status: "proved" where a strength was proved and the next has no gain, none within the limit, or was not looked at;
            "undecided" where a quick look at the next finds a gain that the design or its proof misses; "refused" where even the lowest strength
            had no gain; "not accepted" where the theorem does not speak of the plant.
        proved: largest strength with a proved design, None where there is none.
        refused: smallest strength above it that was tried in vain, None where there is none.
        reason: why there is nothing at `refused`, or at all.
        strength: the common strength of the plant at which gains are compared.
        gain: bound of |L|, proved, at the common strength, None where no design was proved there.
        seconds: of the solver there [s].
        unknowns: number of scalar unknowns of the inequality.
    """

    plant: str
    method: str
    status: Status
    proved: float | None = None
    refused: float | None = None
    reason: str = ""
    strength: float | None = None
    gain: float | None = None
    seconds: float | None = None
    unknowns: int | None = None


def entries(plant: Plant, entrants: Sequence[Entrant] = ENTRANTS, gain_limit: float = GAIN_LIMIT) -> list[Entry]:
    """Return the row of a plant, one entry for each design that runs on it.

    Args:
        plant: row of the comparison.
        entrants: designs.
        gain_limit: largest |L| that counts for the strengths.
    """
    run = [e for e in entrants if e.on_random or not plant.is_random]
    methods = {e.name: e.method(plant) for e in run}
    found = {e.name: searched(plant, e, methods[e.name], gain_limit) for e in run}
    common = plant.nominal
    if common is None:
        admitted = found[COMMON].proved if COMMON in found else None
        common = None if admitted is None else 0.5 * admitted
    return [_with_gain(found[e.name], plant, e, methods[e.name], common) for e in run]


def searched(plant: Plant, entrant: Entrant, method: Method, gain_limit: float = GAIN_LIMIT) -> Entry:
    """Return how strong the nonlinearity may be: quick looks say where to search, designs with certificates decide.

    Args:
        plant: row of the comparison.
        entrant: column of the comparison.
        method: its method for this plant.
        gain_limit: largest |L| that counts.
    """
    entry = Entry(plant.name, entrant.name, "not accepted")
    if entrant.view == "hull" and plant.hull is None:
        return replace(entry, reason="The Jacobian fills its box.")
    limited = Limited(method, gain_limit)

    def at(logarithm: float) -> System:
        return entrant.plant(plant, 10.0**logarithm)

    def possible(logarithm: float) -> bool:
        return seems_possible(at(logarithm), method, gain_limit)

    try:
        found = _decided(at, limited, _largest_possible(possible))
    except NotAccepted as refusal:
        return replace(entry, reason=str(refusal))
    except (Infeasible, NotCertified, BadInput) as refusal:
        is_open = isinstance(refusal, NotCertified) or (LIMIT_WORDS not in str(refusal) and possible(LOWEST))
        status = "undecided" if is_open else "refused"
        return replace(entry, status=status, refused=10.0**LOWEST, reason=str(refusal))
    proved = 10.0**found.proved
    if found.refused is None:
        return replace(entry, status="proved", proved=proved)
    # A gain beyond the limit is an answer; so is a solver that finds nothing, but not a gain that is there and has no proof.
    settled = LIMIT_WORDS in found.reason or not possible(found.refused)
    status = "proved" if settled else "undecided"
    return replace(entry, status=status, proved=proved, refused=10.0**found.refused, reason=found.reason)


def _largest_possible(possible: Callable[[float], bool]) -> float:
    """The largest logarithm that seems possible, to one step: from above in leaps, since solvers may fail at weak ones too."""
    bad = good = HIGHEST
    while not possible(good):
        if good <= LOWEST:
            return LOWEST
        bad, good = good, max(good - LEAP, LOWEST)
    while bad - good > STEP:
        middle = 0.5 * (good + bad)
        good, bad = (middle, bad) if possible(middle) else (good, middle)
    return good


def _decided(at: Callable[[float], System], limited: Limited, near: float) -> Admissible:
    """The largest strength proved, looked for upwards from `near`, else from ever farther below it."""
    refusal: Infeasible | NotCertified | BadInput | None = None
    for back in (0.0, 4 * STEP, 16 * STEP, 64 * STEP, HIGHEST - LOWEST):
        low, high = max(near - back, LOWEST), min(near + STEP, HIGHEST)
        low = min(low, high - STEP)
        try:
            found = largest_admissible(at, limited, low, high, 1.01 * STEP)
        except (Infeasible, NotCertified, BadInput) as failed:
            refusal = failed
            continue
        stride = STEP
        while found.refused is None and high < HIGHEST:
            stride *= 2
            low, high = high, min(high + stride, HIGHEST)
            found = largest_admissible(at, limited, low, high, 1.01 * STEP)
        return found
    assert refusal is not None
    raise refusal


def _with_gain(entry: Entry, plant: Plant, entrant: Entrant, method: Method, strength: float | None) -> Entry:
    """Add the gain at the common strength, without a limit, and what it cost."""
    if entry.status == "not accepted" or strength is None:
        return entry
    system = entrant.plant(plant, strength)
    entry = replace(entry, strength=strength, unknowns=unknowns(system, method))
    try:
        design = synthesize(system, method)
    except (Infeasible, NotCertified, BadInput):
        return entry
    return replace(entry, gain=injected(design), seconds=float(design.statistics["solver_seconds"]))


def injected(design: Design) -> float:
    """Return the proved bound of |L|.

    Args:
        design: with its certificate.
    """
    return next(p.claim.level for p in design.certificate.proofs if p.claim.kind == "gain_bound")


def _row(name: str) -> list[Entry]:
    return entries(plant_called(name))


# Plants that were computed in this process, so that a table and its page cost one computation.
_KNOWN: dict[str, list[Entry]] = {}


def rows_of(names: Sequence[str], workers: int = 2) -> Iterator[list[Entry]]:
    """Yield the entries of one plant after the other, as they are known; each plant is computed once in a process.

    Args:
        names: plants.
        workers: processes that share the plants; one computes here.
    """
    fresh = [name for name in names if name not in _KNOWN]
    if workers <= 1 or len(fresh) < 2:
        yield from _kept(names, map(_row, fresh))
        return
    # A forked process would inherit the locks of a threaded one.
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        yield from _kept(names, pool.map(_row, fresh))


def _kept(names: Sequence[str], fresh: Iterator[list[Entry]]) -> Iterator[list[Entry]]:
    for name in names:
        if name not in _KNOWN:
            _KNOWN[name] = next(fresh)
        yield _KNOWN[name]


def table(names: Sequence[str] | None = None, workers: int = 2) -> list[Entry]:
    """Return all entries, plant by plant.

    Args:
        names: plants; left out: all published and all random ones.
        workers: processes that share the plants; one computes here.
    """
    return [e for row in rows_of(plant_names() if names is None else names, workers) for e in row]
