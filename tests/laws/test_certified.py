"""Law: every claim of every method is proved, again from the file, and a spoiled design is refused."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.certify import Claim, SwitchedClaim, certify_claims, certify_switched_claims
from luenberger.core import Outcome
from luenberger.design import Design, SwitchedDesign

AnyDesign = Design | SwitchedDesign


def checked(design: AnyDesign, claim: Any) -> Outcome:
    """What comes of one claim about the gains of a design."""
    if isinstance(design, SwitchedDesign):
        return certify_switched_claims(design.system, design.gains, design.decoupling, [claim]).outcome
    gains = {"argument_gain": design.argument_gain, "filter_gain": design.filter_gain}
    return certify_claims(design.system, design.gain, [claim], design.model, **gains).outcome


def every_gain(design: AnyDesign) -> list[Polynomial]:
    if isinstance(design, SwitchedDesign):
        return [*design.gains, *design.decoupling]
    return [g for g in (design.gain, design.argument_gain, design.filter_gain) if g is not None]


def negative(claim: Claim | SwitchedClaim) -> Claim | SwitchedClaim | None:
    """The claim with its storages turned round, where it has any."""
    if isinstance(claim, SwitchedClaim):
        return replace(claim, storages=tuple(-Q for Q in claim.storages)) if claim.storages else None
    return None if claim.storage is None else replace(claim, storage=-claim.storage)


def test_every_claim_is_proved(any_design: AnyDesign) -> None:
    assert any_design.certificate.proofs
    assert all(p.outcome is Outcome.PROVED for p in any_design.certificate.proofs)


def test_proved_again_from_the_file(any_design: AnyDesign, tmp_path: Path) -> None:
    any_design.save(tmp_path / "design.json")
    again = type(any_design).load(tmp_path / "design.json")
    assert again.certify().outcome is Outcome.PROVED
    for one, two in zip(every_gain(any_design), every_gain(again), strict=True):
        for (e, mine), (f, read) in zip(one, two, strict=True):
            assert e == f
            np.testing.assert_array_equal(mine, read)


def test_spoiled_gain_is_refused(any_design: AnyDesign) -> None:
    # Turned round and enlarged, the correction drives the error instead of damping it.
    if isinstance(any_design, SwitchedDesign):
        assert any_design.with_gains([K * -10.0 for K in any_design.gains]).certificate.outcome is not Outcome.PROVED
        # A decoupling one percent off lets the unknown input in.
        off = any_design.with_gains(any_design.gains, [H * 1.01 for H in any_design.decoupling])
        proofs = {p.claim.kind: p.outcome for p in off.certificate.proofs}
        assert proofs["decoupling"] is Outcome.REFUTED
        assert proofs["containment"] is not Outcome.PROVED
        return
    assert any_design.with_gain(any_design.gain * -10.0).certificate.outcome is not Outcome.PROVED
    if any_design.filter_gain is not None:
        spoiled = any_design.with_filter_gain(any_design.filter_gain * -10.0)
        assert all(p.outcome is not Outcome.PROVED for p in spoiled.certificate.proofs)


def test_spoiled_level_is_refused(any_design: AnyDesign) -> None:
    for claim in any_design.certificate.claims:
        if claim.kind in ("cooperative", "containment", "decoupling"):
            continue  # these have no level, or one of rounding
        rate = claim.kind in ("decay", "width_decay") and any_design.system.dt is None
        worse = claim.level + 50.0 if rate else claim.level / 2
        assert checked(any_design, replace(claim, level=worse)) is not Outcome.PROVED


def test_spoiled_box_is_refused(any_design: AnyDesign) -> None:
    for claim in any_design.certificate.claims:
        if claim.kind in ("steady_box", "filter_box"):
            # A thousandth narrower than claimed: an admissible drive reaches past it.
            assert checked(any_design, replace(claim, vector=0.999 * np.asarray(claim.vector))) is Outcome.REFUTED


def test_spoiled_storage_is_refused(any_design: AnyDesign) -> None:
    for claim in any_design.certificate.claims:
        if (spoiled := negative(claim)) is not None:
            assert checked(any_design, spoiled) is Outcome.REFUTED


def test_faster_and_quieter_than_claimed_is_refused(any_design: AnyDesign) -> None:
    for claim in any_design.certificate.claims:
        if claim.kind == "iss":
            assert checked(any_design, replace(claim, fade=min(0.99, 1.5 * claim.fade))) is not Outcome.PROVED
            assert checked(any_design, replace(claim, supply=0.5 * claim.supply)) is not Outcome.PROVED
