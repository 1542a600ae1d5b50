"""Claims about plants with modes as words and as text: nothing is lost, and what cannot be a claim is refused."""

import json
from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from luenberger.certify import SwitchedClaim
from luenberger.core import BadInput

STORAGE = np.array([[2.0, 0.1], [0.1, 1.0]])


def stability(**options: Any) -> SwitchedClaim:
    return SwitchedClaim("iss", **{"level": 3.0, "storages": (STORAGE,), "fade": 0.36, "supply": 0.7, **options})


def test_text_keeps_every_number_to_the_last_bit() -> None:
    claim = stability(
        level=0.1 + 0.2,
        storages=(STORAGE / 3, STORAGE / 7),
        growth=1 / 0.3,
        inputs="noise+next noise",
        order="last",
        vector=np.array([1 / 3, 1 / 7]),
        state_bound=np.array([1 / 9, 1 / 11]),
    )
    again = SwitchedClaim.from_text(json.loads(json.dumps(claim.as_text())))
    for each in fields(SwitchedClaim):
        np.testing.assert_array_equal(getattr(again, each.name), getattr(claim, each.name))


def test_texts_without_an_order_are_of_the_first_kind() -> None:
    data = stability(order="last").as_text()
    del data["order"]
    assert SwitchedClaim.from_text(data).order == "next"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"level": np.nan}, "a finite level >= 0"),
        ({"level": -1.0}, "a finite level >= 0"),
        ({"fade": 0.0}, "0 < fade < 1"),
        ({"fade": 1.0}, "0 < fade < 1"),
        ({"supply": -1.0}, "supply >= 0"),
        ({"supply": np.inf}, "supply >= 0"),
        ({"growth": 0.9}, "growth >= 1"),
        ({"storages": ()}, "no storages"),
        ({"inputs": "wind"}, r"\['wind'\]"),
        ({"inputs": "noise+reused noise"}, r"\['reused noise'\]"),
        ({"storages": (np.array([[1.0, 0.1], [0.0, 1.0]]),)}, "not symmetric"),
        ({"storages": (np.ones((1, 2)),)}, "square"),
        ({"storages": (np.array([[np.nan]]),)}, "storage"),
    ],
)
def test_what_cannot_be_a_claim_is_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        stability(**options)


def test_sentences_say_the_numbers_and_no_more_than_is_proved() -> None:
    assert "|e|_2 <= 3 sup |w|_2, w being what is added to the error" in stability().sentence()
    assert stability().sentence().endswith("by a factor 0.8 a step.")
    # A switch may lift the storage, so the factor does not hold across it.
    assert stability(growth=2.0).sentence().endswith("by a factor 0.8 a step between switches.")
    assert "noise and noise of the next sample, noise in units" in stability(inputs="noise+next noise").sentence()
    assert "no more than |P E| <= 1e-16" in SwitchedClaim("decoupling", 1e-16).sentence()
    assert "|K| stays below 2.5" in SwitchedClaim("gain_bound", 2.5).sentence()
    box = SwitchedClaim("containment", 1e-16, vector=np.array([0.5, 0.25]))
    assert "rounding of at most 1.0e-16 of the signals" in box.sentence()
    assert "within (0.5, 0.25), state by state, stays there" in box.sentence()
    assert "stays there" not in SwitchedClaim("containment", 1e-16).sentence()
