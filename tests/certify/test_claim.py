"""Claims as text keep every digit; altered text is refused."""

import json

import numpy as np
import pytest

from luenberger.certify import Claim
from luenberger.core import BadInput


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


@pytest.mark.parametrize("kind", ["l2_gain", "width_gain"])
def test_inputs_that_a_claim_cannot_speak_of_are_refused(kind: str) -> None:
    data = Claim("width_gain", 1.0, np.eye(2), weight=np.eye(2), inputs="residual").as_text()
    with pytest.raises(BadInput, match="unknown key `wind`"):
        Claim.from_text(data | {"kind": kind, "inputs": "wind"})
