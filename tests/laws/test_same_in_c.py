"""Law: the exported step is the Python step, for random and for extreme inputs, without a warning and without undefined behaviour."""

from pathlib import Path

import numpy as np

from c_programs import needs_compiler
from catalogue import Row
from export_plants import vectors
from luenberger.design import Design, SwitchedDesign
from luenberger.export import Guarded, build, c_code, golden, write_c
from luenberger.export.golden import random_drive
from luenberger.export.rounding import run_bound
from luenberger.systems import Switched

DT = 0.005
pytestmark = needs_compiler


def guarded(row: Row, design: Design | SwitchedDesign) -> Guarded:
    observer = design.observer(Switched.of(design.system).first.dt or DT, **row.options)
    return Guarded.of(observer, design.system, certificate=design.certificate)


def test_ten_thousand_samples_agree_under_sanitizers(
    any_row: Row, any_design: Design | SwitchedDesign, tmp_path: Path
) -> None:
    watched = guarded(any_row, any_design)
    run = vectors(watched)
    assert np.isfinite(run.estimate).all()
    assert "not_finite" in watched.flags
    assert (run.status & 1).any()
    # Sums in another order and another mathematical library: a few units a step, relative to the largest value met so far.
    write_c(c_code(watched, "law", certificate=any_design.certificate), run, tmp_path, tolerance=1e-12)
    said = build(tmp_path, "law", sanitize=True)
    assert said.agrees, said.says


def test_single_precision_stays_within_its_derived_bound(
    any_row: Row, any_design: Design | SwitchedDesign, tmp_path: Path
) -> None:
    watched = guarded(any_row, any_design)
    written = c_code(watched, "law", precision="float")
    drive = [a.astype(np.float32) for a in random_drive(watched, 3, 2, seed=2)]
    single = golden(watched, *drive, dtype=np.float32)
    double = golden(watched, *drive)
    bound = np.array([run_bound(written.read, "float", *(a[k] for a in drive)) for k in range(2)])
    # Python in single and in double precision and C in single precision all lie in one ball around the exact run.
    assert (np.abs(single.estimate - double.estimate) <= bound).all()
    largest = max(1.0, float(np.abs(single.estimate).max()))
    write_c(written, single, tmp_path, tolerance=min(float(bound.max()) / largest, 1e30))
    said = build(tmp_path, "law", sanitize=True)
    assert said.agrees, said.says
