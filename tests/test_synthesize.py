"""From plant and method to a proved design, or to a refusal before any solver runs."""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import pytest

from catalogue import oscillator, robot
from luenberger.algebra import Polynomial
from luenberger.certify import Claim
from luenberger.core import BadInput, Infeasible, NotAccepted, NotCertified, Outcome
from luenberger.methods import Candidate, PolytopicLuenberger, StructuredLipschitz
from luenberger.synthesize import synthesize
from luenberger.systems import System


@dataclass(frozen=True)
class Liar:
    """A method that claims what is not so."""

    level: float = 100.0
    references: ClassVar[tuple[str, ...]] = ("nobody",)
    seen: list[Polynomial] = field(default_factory=list)

    def accept(self, system: System) -> None: ...

    def design(self, system: System) -> Candidate:
        def claims(rounded: Polynomial) -> list[Claim]:
            self.seen.append(rounded)
            return [Claim("decay", self.level, np.eye(system.nx))]

        return Candidate(Polynomial.constant(np.full((system.nx, system.ny), 1 / 3)), claims)


def test_a_false_claim_is_refused() -> None:
    with pytest.raises(NotCertified, match="`decay` is refuted"):
        synthesize(oscillator(), Liar())
    assert synthesize(oscillator(), Liar(), require=False).certificate.outcome is Outcome.REFUTED


def test_claims_are_about_the_rounded_gain() -> None:
    liar = Liar()
    synthesize(oscillator(), liar, digits=3, require=False)
    np.testing.assert_array_equal(liar.seen[0]({}), 0.333)


def test_a_broken_witness_is_replaced_once() -> None:
    # The identity is no storage for the undamped oscillator, yet the claim is true: a better witness is found.
    assert synthesize(oscillator(), Liar(level=0.01)).certificate.outcome is Outcome.PROVED


def test_undetectable_pair_is_named_before_any_solver() -> None:
    plant = System.linear([[-3.63, 0.0], [0.0, -1.0]], C=[[0.0, 1.0]], states=("slow", "seen"))
    with pytest.raises(BadInput, match=r"3\.63.*slow"):
        synthesize(plant, PolytopicLuenberger(decay_rate=5.0))
    assert synthesize(plant, PolytopicLuenberger(decay_rate=3.0)).certificate.outcome is Outcome.PROVED


@pytest.mark.parametrize("rate", [-1.0, float("nan"), float("inf")])
def test_indefinite_request(rate: float) -> None:
    with pytest.raises(BadInput, match="decay_rate"):
        synthesize(oscillator(), PolytopicLuenberger(decay_rate=rate))


def test_methods_refuse_plants_outside_their_theorem() -> None:
    with pytest.raises(NotAccepted, match="no nonlinearity"):
        synthesize(oscillator(), StructuredLipschitz())
    with pytest.raises(NotAccepted, match="discrete"):
        synthesize(System.linear([[0.5]], C=[[1.0]], dt=0.1), PolytopicLuenberger())
    with pytest.raises(NotAccepted, match="Jacobian box"):
        synthesize(robot("lipschitz"), PolytopicLuenberger())


def test_infeasible_names_block_and_nearest_level() -> None:
    # Scheduling moves the hidden coupling between +2 and -2: a common storage reaches only part of the wish.
    A = Polynomial.affine(np.array([[-1.0, 0.0], [0.0, -1.0]]), r=np.array([[0.0, 0.0], [2.0, 0.0]]))
    from luenberger.systems import Parameter

    plant = System.lpv(A, C=[[0.0, 1.0]], parameters=[Parameter("r", -1.0, 1.0)])
    with pytest.raises((Infeasible, BadInput)) as caught:
        synthesize(plant, PolytopicLuenberger(decay_rate=3.0))
    assert "decay_rate" in str(caught.value)
