"""Which coordinates are tried, and that a search finds what no change of signs gives."""

import numpy as np
import pytest

from interval_plants import FLIP, lateral_car, slip_transform, thesis_car
from luenberger.core import BadInput, Infeasible, Outcome
from luenberger.methods.interval import IntervalLuenberger
from luenberger.methods.interval_coordinates import Choice, candidates, mixtures, sign_changes
from luenberger.synthesize import synthesize
from luenberger.systems import System


def test_all_signs_up_to_the_whole() -> None:
    found = [tuple(np.diag(T)) for T in sign_changes(3)]
    assert len(set(found)) == len(found) == 4
    assert all(signs[0] == 1.0 for signs in found)
    with pytest.raises(BadInput, match="64 sign changes"):
        list(sign_changes(7))


def test_the_best_comes_first_and_all_is_reported() -> None:
    levels = {1.0: 2.0, -1.0: 1.0}

    def attempt(T: np.ndarray) -> Choice | None:
        return Choice(T, levels[T[1, 1]], levels[T[1, 1]], None)

    found, tried = candidates("signs", thesis_car(), attempt)
    np.testing.assert_array_equal(found[0].transform, FLIP)
    assert [c.level for c in found] == [1.0, 2.0]
    assert len(tried) == 2
    nothing, tried = candidates("states", thesis_car(), lambda T: None)
    assert nothing == []
    np.testing.assert_array_equal(tried[0], np.eye(2))


def test_mixtures_are_invertible_and_repeat() -> None:
    three = System.linear(-np.eye(3), C=[[1.0, 0.0, 0.0]])
    for plant in (lateral_car(), three):
        first, again = list(mixtures(plant)), list(mixtures(plant))
        assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
        assert all(np.linalg.matrix_rank(T) == plant.nx for T in first)
    assert list(mixtures(System.linear([[-1.0]], C=[[1.0]]))) == []


def test_search_finds_mixed_states_for_the_lateral_car() -> None:
    with pytest.raises(Infeasible):
        synthesize(lateral_car(), IntervalLuenberger())
    found = synthesize(lateral_car(), IntervalLuenberger(coordinates="search"))
    assert found.certificate.outcome is Outcome.PROVED
    slip = slip_transform() / np.linalg.norm(slip_transform(), axis=1, keepdims=True)
    T = np.array(found.statistics["transform"])
    rows = T / np.linalg.norm(T, axis=1, keepdims=True)
    # Slip angles reach 0.1702; the measure of the search charges the condition number of T.
    assert found.statistics["optimum"] * np.linalg.cond(rows) <= 0.1702 * np.linalg.cond(slip)


def test_unknown_words_and_wrong_shapes() -> None:
    for asked, message in (("sign", "signs"), (np.eye(3), "coordinates")):
        with pytest.raises(BadInput, match=message):
            synthesize(thesis_car(), IntervalLuenberger(coordinates=asked))
