"""Claims as text keep every digit; altered text is refused."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from luenberger.certify import Claim
from luenberger.certify.rational_text import from_text, to_text
from luenberger.core import BadInput


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_every_double_survives(x: float) -> None:
    assert from_text(to_text(x)) == x


@pytest.mark.parametrize("text", ["1/3", "a", "1/0", "", "0.1"])
def test_what_no_double_holds_is_refused(text: str) -> None:
    with pytest.raises(BadInput):
        from_text(text)


def test_claim_round_trip() -> None:
    P = np.array([[2.0, 0.1], [0.1, 1 / 3]])
    claim = Claim("l2_gain", 0.7, P, 1.25, np.eye(2), "both")
    again = Claim.from_text(json.loads(json.dumps(claim.as_text())))
    assert again.level == claim.level
    assert again.multiplier == 1.25
    np.testing.assert_array_equal(again.storage, P)
    np.testing.assert_array_equal(again.weight, np.eye(2))


def test_sentences_carry_the_numbers() -> None:
    assert "exp(-2 t)" in Claim("decay", 2.0, np.eye(2)).sentence(False)
    assert "0.5^k" in Claim("decay", 0.5, np.eye(2)).sentence(discrete=True)
    assert "3" in Claim("gain_bound", 3.0).sentence(False)
    assert "noise" in Claim("l2_gain", 3.0, np.eye(1), weight=np.eye(1), inputs="noise").sentence(False)
