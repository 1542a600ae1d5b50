"""Two claims together are as good as the weaker one."""

from functools import reduce
from itertools import permutations, product

import pytest

from luenberger.core import Outcome

WORST_FIRST = (Outcome.REFUTED, Outcome.UNDECIDED, Outcome.PROVED)


@pytest.mark.parametrize(("one", "two"), list(product(Outcome, repeat=2)))
def test_the_worse_outcome_wins(one: Outcome, two: Outcome) -> None:
    expected = next(o for o in WORST_FIRST if o in (one, two))
    assert (one & two) is expected
    assert (two & one) is expected


def test_proved_needs_every_claim() -> None:
    for order in permutations(WORST_FIRST):
        assert reduce(Outcome.__and__, order, Outcome.PROVED) is Outcome.REFUTED
    assert reduce(Outcome.__and__, [Outcome.PROVED] * 3) is Outcome.PROVED


def test_stored_word_reads_back() -> None:
    assert [Outcome(o.value) for o in Outcome] == list(Outcome)


def test_each_outcome_has_its_own_sentence() -> None:
    sentences = {o.sentence for o in Outcome}
    assert len(sentences) == 3
    assert all(s.endswith(".") for s in sentences)
