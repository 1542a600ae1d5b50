"""The comparison of observer inequalities: what theory orders stays ordered, and nothing without a proof counts."""

from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest

from luenberger.core import BadInput, NotAccepted, Outcome
from luenberger.experiment.published import conservatism_table
from luenberger.experiment.published.conservatism_cost import unknowns
from luenberger.experiment.published.conservatism_entrants import (
    ENTRANTS,
    LIMIT_WORDS,
    BestRiccati,
    Entrant,
    Spoiled,
    about_the_middle,
)
from luenberger.experiment.published.conservatism_figure import conservatism_plot, method_table, write_page
from luenberger.experiment.published.conservatism_findings import (
    CHANNEL,
    COORDINATES,
    FULL,
    HULL,
    LUMPED,
    MIDDLE,
    MULTIPLIER,
    SAME,
    SECOND,
    SECTOR,
    VERTICES,
    ratios,
    reach,
    sentences,
    shares,
)
from luenberger.experiment.published.conservatism_plants import NAMED, SOURCES, Plant, plant_called, plant_names
from luenberger.experiment.published.conservatism_probe import seems_possible
from luenberger.experiment.published.conservatism_table import (
    GAIN_LIMIT,
    STEP,
    Entry,
    entries,
    rows_of,
    searched,
    table,
)
from luenberger.experiment.published.lipschitz_conservatism import conclusions, plant_row
from luenberger.experiment.published.row import Verdict
from luenberger.methods.extended_luenberger import ExtendedLuenberger
from luenberger.synthesize import synthesize
from luenberger.systems import Nonlinearity, System

BY_NAME = {e.name: e for e in ENTRANTS}
# One channel of one argument and one of two; few states and plants, since every entry is two dozen programmes.
DRAWN = "random 0"
OSCILLATOR = "Van der Pol, r = 2"


def chosen(*names: str) -> list[Entrant]:
    return [BY_NAME[n] for n in names]


@pytest.fixture(scope="module")
def computed() -> list[Entry]:
    """What the laws below are put to; the table keeps what it has computed."""
    return table((DRAWN, OSCILLATOR), workers=1)


def proved(found: list[Entry], plant: str) -> dict[str, float]:
    return {e.method: e.proved for e in found if e.plant == plant and e.proved is not None}


def test_every_end_is_a_proof_and_the_next_a_refusal(computed: list[Entry]) -> None:
    assert {e.plant for e in computed} == {DRAWN, OSCILLATOR}
    for e in computed:
        if e.proved is None or e.refused is None:
            assert e.status == "not accepted" or e.proved is not None
            continue
        # Neighbours of the search, one percent apart, or two where it had to climb.
        assert 1 < e.refused / e.proved <= 10 ** (2.1 * STEP)
        assert e.reason
    for plant, method in ((DRAWN, VERTICES), (OSCILLATOR, HULL), (DRAWN, LUMPED)):
        entrant, at = BY_NAME[method], plant_called(plant)
        strength = proved(computed, plant)[method]
        design = synthesize(entrant.plant(at, strength), entrant.method(at))
        assert design.certificate.outcome is Outcome.PROVED


@pytest.mark.parametrize("plant", [DRAWN, OSCILLATOR])
def test_order_that_theory_demands(computed: list[Entry], plant: str) -> None:
    found = proved(computed, plant)
    for less, more in (
        (LUMPED, COORDINATES),
        (COORDINATES, CHANNEL),
        (CHANNEL, VERTICES),
        (MIDDLE, VERTICES),
        (MULTIPLIER, VERTICES),
        (MULTIPLIER, SECOND),
        (VERTICES, HULL),
    ):
        if less in found and more in found:
            assert found[less] <= found[more] * (1 + SAME), (less, more)
    assert found[FULL] == pytest.approx(found[VERTICES], rel=SAME)


def test_multiplier_is_exact_for_one_slope_and_loses_with_two_that_share_a_channel(computed: list[Entry]) -> None:
    one = proved(computed, DRAWN)
    assert one[MULTIPLIER] == pytest.approx(one[VERTICES], rel=SAME)
    # About the middle the bound of one slope loses nothing either.
    assert one[MIDDLE] == pytest.approx(one[VERTICES], rel=SAME)
    both = proved(computed, OSCILLATOR)
    assert both[MULTIPLIER] < 0.97 * both[VERTICES]
    assert both[HULL] > 1.1 * both[VERTICES]


def test_what_admits_more_needs_less_gain(computed: list[Entry]) -> None:
    gains = {e.method: e.gain for e in computed if e.plant == OSCILLATOR and e.gain is not None and e.strength == 1.0}
    assert gains[SECOND] < gains[HULL] < gains[VERTICES] < gains[MULTIPLIER] < gains[CHANNEL]


def test_printed_sector_condition_is_not_accepted_where_it_is_false(computed: list[Entry]) -> None:
    status = {(e.plant, e.method): e for e in computed}
    refused = status[OSCILLATOR, SECTOR]
    assert refused.status == "not accepted"
    assert "(5.7)" in refused.reason
    assert reach(refused) == "-"
    assert status[DRAWN, SECTOR].status == "proved"
    assert status[DRAWN, HULL].status == "not accepted"


def test_nothing_without_a_proof_is_called_proved() -> None:
    honest = replace(BY_NAME[VERTICES], name="spoiled", method=lambda p: Spoiled(ExtendedLuenberger()))
    plant = plant_called(DRAWN)
    found = entries(plant, [honest])[0]
    assert found.proved is None
    assert found.gain is None
    assert found.status == "undecided"
    assert "found a gain, but its claim" in found.reason


def test_gain_limit_counts() -> None:
    plant, entrant = plant_called(DRAWN), BY_NAME[VERTICES]
    narrow = searched(plant, entrant, entrant.method(plant), gain_limit=8.0)
    assert narrow.proved is not None
    assert LIMIT_WORDS in narrow.reason
    assert narrow.status == "proved"
    design = synthesize(plant.at(narrow.proved), ExtendedLuenberger())
    level = next(p.claim.level for p in design.certificate.proofs if p.claim.kind == "gain_bound")
    assert level <= 8.0
    assert not seems_possible(plant.at(1.1 * narrow.proved), ExtendedLuenberger(), 8.0)


def test_riccati_forms_do_not_take_scheduled_plants() -> None:
    plant, entrant = plant_called("slip angles"), BY_NAME[LUMPED]
    assert searched(plant, entrant, BestRiccati()).status == "not accepted"
    with pytest.raises(NotAccepted, match="acceleration"):
        seems_possible(plant.at(0.5), BestRiccati(), GAIN_LIMIT)


def test_slip_limit_of_the_vertices_is_that_of_the_plant() -> None:
    plant, entrant = plant_called("slip angles"), BY_NAME[VERTICES]
    found = searched(plant, entrant, entrant.method(plant))
    assert found.proved is not None
    assert found.refused is not None
    # 1 - a_max M / (Cf + Cr), from the one mode that (1, -1) does not show.
    assert found.proved < 0.9498 < found.refused
    assert "unobservable mode" in found.reason


def flipped(plant: Plant, signs: list[float]) -> Plant:
    """The same plant with some states counted backwards."""
    S, system = np.diag(signs), plant.system
    f = system.nonlinearity
    assert f is not None
    A, C, F = (np.asarray(system.at(letter)) for letter in "ACF")
    turned = Nonlinearity.bounded(
        f.function, f.H @ S, size=f.size, jacobian=(np.asarray(f.jacobian_lower), np.asarray(f.jacobian_upper))
    )
    return replace(plant, system=System.nonlinear(S @ A @ S, C=C @ S, F=S @ F, nonlinearity=turned))


def test_sign_of_a_state_changes_no_entry(computed: list[Entry]) -> None:
    designs = chosen(LUMPED, CHANNEL, MULTIPLIER, VERTICES, SECOND)
    turned = entries(flipped(plant_called(DRAWN), [-1.0, 1.0]), designs)
    for e in turned:
        before = next(o for o in computed if o.plant == DRAWN and o.method == e.method)
        assert e.status == before.status
        assert e.proved == pytest.approx(before.proved, rel=SAME)
        # The common strength, half of what the vertices admit, may itself lie a step apart.
        assert e.gain == pytest.approx(before.gain, rel=2 * SAME)


def test_random_plants_come_from_their_seeds() -> None:
    draw = plant_called.__wrapped__
    first, again = draw("random 7"), draw("random 7")
    assert first is not again
    for letter in "ACF":
        np.testing.assert_array_equal(np.asarray(first.system.at(letter)), np.asarray(again.system.at(letter)))
    assert not np.array_equal(np.asarray(first.system.at("C")), np.asarray(plant_called("random 12").system.at("C")))
    assert first.is_random
    shapes = set()
    for seed in range(15):
        system = plant_called(f"random {seed}").system
        assert system.nonlinearity is not None
        shapes.add((system.nx, system.nonlinearity.size, len(system.nonlinearity.H)))
    assert shapes == {(nx, *kind) for nx, kind in product((2, 3, 4), ((1, 1), (1, 2), (2, 2)))}


@pytest.mark.parametrize("name", ["random 0", "random 1", "random 2", "FitzHugh nerve", "tunnel diode"])
def test_slopes_lie_in_the_stated_box(name: str) -> None:
    system = plant_called(name).system
    f = system.nonlinearity
    assert f is not None
    domain = (-3 * np.ones(system.nx), 3 * np.ones(system.nx)) if f.domain is None else f.domain
    x = np.random.default_rng(0).uniform(*domain, (500, system.nx))
    slopes = np.asarray(jax.vmap(jax.jacfwd(lambda z: f.function(z, np.zeros(0))))(x @ f.H.T)).reshape(500, f.size, -1)
    assert np.all(slopes >= np.asarray(f.jacobian_lower) - 1e-12)
    assert np.all(slopes <= np.asarray(f.jacobian_upper) + 1e-12)
    # Zero lies in the box, so that the boxes of growing strengths are nested.
    assert np.all(np.asarray(f.jacobian_lower) <= 0)
    assert np.all(np.asarray(f.jacobian_upper) >= 0)


def test_plant_about_the_middle_moves_alike() -> None:
    plant = plant_called("random 2").at(1.7)
    centred = about_the_middle(plant)
    assert centred.nonlinearity is not None
    lower, upper = (np.asarray(getattr(centred.nonlinearity, f"jacobian_{side}")) for side in ("lower", "upper"))
    np.testing.assert_allclose(lower, -upper)
    for x in np.random.default_rng(1).normal(size=(5, plant.nx)):
        ours = centred.dynamics(0.0, x, np.zeros(0))
        np.testing.assert_allclose(ours, plant.dynamics(0.0, x, np.zeros(0)), rtol=1e-12, atol=1e-12)


def test_strength_multiplies_the_nonlinearity_alone() -> None:
    plant = plant_called(OSCILLATOR)
    x = np.array([1.2, -0.7])
    once, twice = (np.asarray(plant.at(s).dynamics(0.0, x, np.zeros(0))) for s in (1.0, 2.0))
    np.testing.assert_allclose(twice - once, [0.0, (1 - x[0] ** 2) * x[1]], rtol=1e-13)
    assert plant.hull is not None
    assert plant.hull.bound_status == "proved"


def test_unknowns_are_counted() -> None:
    plant = plant_called(OSCILLATOR).at(1.0)
    # Storage 3, gain 2, its bound 1; then s, or one number a slope, a symmetric 3 x 3, or two numbers with two gain entries.
    expected = {CHANNEL: 7, VERTICES: 6, MULTIPLIER: 8, FULL: 12, SECOND: 10, LUMPED: 4}
    for name, count in expected.items():
        assert unknowns(plant, BY_NAME[name].method(plant_called(OSCILLATOR))) == count


def test_names_that_are_not_known() -> None:
    assert set(NAMED) == set(SOURCES)
    assert len(plant_names()) == len(NAMED) + 50
    with pytest.raises(BadInput, match="tunnel diode"):
        plant_called("tunel diode")


def made_up(plant: str, **strengths: float | None) -> list[Entry]:
    words = {"riccati": LUMPED, "channel": CHANNEL, "vertices": VERTICES, "full": FULL, "second": SECOND, "hull": HULL}
    return [
        Entry(plant, words[k], "proved", v, None if v is None else 1.01 * v, "-", 1.0, 2.0, 1e-3, 6)
        for k, v in strengths.items()
    ]


def test_rows_tell_when_the_order_is_broken() -> None:
    good = made_up("tunnel diode", riccati=0.1, channel=0.3, vertices=1.0, full=1.0, second=2.0)
    assert plant_row(good).verdict is Verdict.REPRODUCED
    bad = made_up("tunnel diode", riccati=0.1, channel=1.3, vertices=1.0, full=0.8, second=2.0)
    row = plant_row(bad)
    assert row.verdict is not Verdict.REPRODUCED
    assert "Out of order" in row.reason
    verdicts = {r.item: r.verdict for r in conclusions([*bad, *made_up("slip angles", vertices=0.94)])}
    assert verdicts[f"{VERTICES} over {CHANNEL}"] is Verdict.CORRECTED
    assert verdicts[f"{CHANNEL} over {LUMPED}"] is Verdict.REPRODUCED
    assert verdicts[f"{FULL} over {VERTICES}"] is Verdict.CORRECTED


def test_findings_count_what_is_there() -> None:
    found = [e for k in range(4) for e in made_up(f"random {k}", riccati=0.1, vertices=1.0, full=1.0, second=1.0 + k)]
    np.testing.assert_allclose(ratios(found, SECOND, VERTICES), [1, 2, 3, 4])
    assert shares(found)[VERTICES]["random 3"] == 0.25
    text = sentences(found)
    assert "further than the vertices on 3 of 4" in text[1]
    assert "less far on 0 of 4" in text[1]


def test_picture_and_page(tmp_path: Path, computed: list[Entry], monkeypatch: pytest.MonkeyPatch) -> None:
    plot = conservatism_plot(computed)
    layout: Any = plot.layout
    cells = [a.text for a in layout.annotations]
    assert reach(next(e for e in computed if e.plant == OSCILLATOR and e.method == HULL)) in cells
    assert "1 random plants" in cells[0]
    assert [row[0] for row in method_table(computed).rows] == [e.name for e in ENTRANTS]
    monkeypatch.setattr(conservatism_table, "_row", lambda name: pytest.fail(f"{name} is computed again"))
    text = write_page(tmp_path / "page.html", list(computed)).read_text(encoding="utf-8")
    for words in ("least conservative", "Y. Wang 2014, (5.57)", "Smallest gain that was found"):
        assert words in text
    assert sum(len(row) for row in rows_of((DRAWN, OSCILLATOR))) == sum(
        e.plant in (DRAWN, OSCILLATOR) for e in computed
    )
