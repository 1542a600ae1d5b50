"""Law: every claim of every method is proved, again from the file, and a spoiled design is refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from luenberger.certify import certify_claims
from luenberger.core import Outcome
from luenberger.design import Design


def test_every_claim_is_proved(design: Design) -> None:
    assert design.certificate.proofs
    assert all(p.outcome is Outcome.PROVED for p in design.certificate.proofs)


def test_proved_again_from_the_file(design: Design, tmp_path: Path) -> None:
    design.save(tmp_path / "design.json")
    again = Design.load(tmp_path / "design.json")
    assert again.certify().outcome is Outcome.PROVED
    for (e, one), (f, two) in zip(design.gain, again.gain, strict=True):
        assert e == f
        np.testing.assert_array_equal(one, two)


def test_spoiled_gain_is_refused(design: Design) -> None:
    # Turned round and enlarged, the correction drives the error instead of damping it.
    assert design.with_gain(design.gain * -10.0).certificate.outcome is not Outcome.PROVED


def test_spoiled_level_is_refused(design: Design) -> None:
    for claim in design.certificate.claims:
        if claim.kind in ("cooperative", "containment"):
            continue  # these have no level
        worse = claim.level + 50.0 if claim.kind in ("decay", "width_decay") else claim.level / 2
        assert (
            certify_claims(
                design.system,
                design.gain,
                [replace(claim, level=worse)],
                design.model,
                argument_gain=design.argument_gain,
            ).outcome
            is not Outcome.PROVED
        )


def test_spoiled_storage_is_refused(design: Design) -> None:
    for claim in design.certificate.claims:
        if claim.storage is not None:
            spoiled = replace(claim, storage=-claim.storage)
            checked = certify_claims(
                design.system, design.gain, [spoiled], design.model, argument_gain=design.argument_gain
            )
            assert checked.outcome is Outcome.REFUTED
