"""Gain tables: read right, bounded error, and a proof that speaks of the table and not of the design."""

import csv
import itertools
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from c_programs import needs_compiler, printed
from luenberger.core import BadInput, NotAccepted, Outcome
from luenberger.design import Design
from luenberger.export import Axis, GainTable, look_up_table, table_header
from luenberger.export.build import SANITIZE
from luenberger.methods import PolytopicLuenberger
from luenberger.synthesize import synthesize
from luenberger.vehicle import carmaker_car, slip_angle_plant

SPEEDS = (15 / 3.6, 6.0, 9.0, 13.0, 19.0, 28.0, 150 / 3.6)
AXES = (Axis("inverse_speed", SPEEDS, "speed"), Axis("acceleration", (-8.0, 4.0)))


@cache
def design() -> Design:
    plant = slip_angle_plant(carmaker_car, (15 / 3.6, 150 / 3.6), (-8.0, 4.0))
    return synthesize(plant, PolytopicLuenberger(decay_rate=5.0))


@cache
def table(precision: str = "double") -> GainTable:
    return look_up_table(design(), AXES, precision=precision, levels={"decay": 4.5})


def test_grid_points_hold_the_gain_of_the_design() -> None:
    for i, speed in enumerate(SPEEDS):
        for j, acceleration in enumerate((-8.0, 4.0)):
            wanted = design().gain_at(inverse_speed=1 / speed, acceleration=acceleration)
            np.testing.assert_allclose(table().values[i, j], wanted, rtol=1e-12)
            np.testing.assert_allclose(table()(speed=speed, acceleration=acceleration), wanted, rtol=1e-9)


def test_the_stated_error_is_never_exceeded_and_nearly_met() -> None:
    rng = np.random.default_rng(0)
    worst = 0.0
    for speed, acceleration in zip(rng.uniform(SPEEDS[0], SPEEDS[-1], 2000), rng.uniform(-8, 4, 2000), strict=True):
        wanted = design().gain_at(inverse_speed=1 / speed, acceleration=acceleration)
        worst = max(worst, float(np.abs(table()(speed=speed, acceleration=acceleration) - wanted).max()))
    assert 0.9 * table().error < worst <= table().error


def test_halving_the_cells_quarters_the_error() -> None:
    finer = sorted({*SPEEDS, *(2 / (1 / a + 1 / b) for a, b in itertools.pairwise(SPEEDS))})
    fine = look_up_table(design(), (Axis("inverse_speed", tuple(finer), "speed"), AXES[1]), levels={"decay": 4.5})
    # The chord of 1/v errs by the square of the cell, a little more where cells are wide.
    assert 0.2 < fine.error / table().error < 0.3


def test_points_beyond_the_plant_change_nothing_of_what_is_proved() -> None:
    wider = (
        Axis("inverse_speed", (2.0, 3.0, *SPEEDS, 60.0), "speed"),
        Axis("acceleration", (-20.0, -8.0, 4.0, 10.0)),
    )
    found = look_up_table(design(), wider, levels={"decay": 4.5})
    assert found.certificate.outcome is Outcome.PROVED
    # Of ten by three cells those that only touch the box may count, where the last digit of 1/v decides.
    told = found.certificate.assumptions[-1]
    assert 6 <= int(told.split("each of its ")[1].split()[0]) <= 10


def test_a_speed_that_is_read_with_an_error_has_no_table() -> None:
    plant = slip_angle_plant(carmaker_car, (15 / 3.6, 150 / 3.6), (-8.0, 4.0))
    erring = plant.replace(
        parameters=[replace(p, error=1e-4) if p.name == "inverse_speed" else p for p in plant.parameters]
    )
    with pytest.raises(NotAccepted, match=r"\['inverse_speed'\] are read with an error"):
        look_up_table(replace(design(), system=erring), AXES)


def test_what_is_proved_is_the_gain_of_the_table() -> None:
    assert table().certificate.outcome is Outcome.PROVED
    assert "each of its 6 cells in the box of the plant was proved" in table().certificate.assumptions[-1]
    # The design keeps 5.0, its table of so few points does not.
    with pytest.raises(NotAccepted, match="Take more points"):
        look_up_table(design(), AXES)
    coarse = (Axis("inverse_speed", (SPEEDS[0], SPEEDS[-1]), "speed"), AXES[1])
    refused = look_up_table(design(), coarse, require=False, levels={"decay": 4.9})
    assert refused.certificate.outcome is Outcome.REFUTED
    assert design().certificate.outcome is Outcome.PROVED


def test_a_table_in_the_parameter_itself_is_the_multi_affine_gain() -> None:
    exact = look_up_table(design(), (Axis("inverse_speed", (0.024, 0.24)), AXES[1]))
    assert exact.error < 1e-15
    assert exact.certificate.outcome is Outcome.PROVED


def test_single_precision_rounds_entries_and_grid_before_the_proof() -> None:
    single = table("float")
    assert (single.values == single.values.astype(np.float32)).all()
    assert all(p == float(np.float32(p)) for axis in single.axes for p in axis.points)
    assert single.axes[0].points[0] <= SPEEDS[0]
    assert single.axes[0].points[-1] >= SPEEDS[-1]


def test_csv_reads_back(tmp_path: Path) -> None:
    table().save_csv(tmp_path / "gain.csv")
    with (tmp_path / "gain.csv").open(encoding="utf-8") as file:
        rows = list(csv.reader(file))
    assert rows[0] == ["speed", "acceleration", "L_1_1", "L_2_1"]
    np.testing.assert_array_equal(np.array(rows[1:], float)[:, 2:], table().values.reshape(-1, 2))


@needs_compiler
@pytest.mark.parametrize("precision", ["double", "float"])
def test_the_header_interpolates_as_python_does(precision: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    points = np.column_stack([rng.uniform(2.0, 50.0, 200), rng.uniform(-10.0, 6.0, 200)]).astype(np.float32)
    (tmp_path / "gain.h").write_text(table_header(table(precision), "gain"))
    rows = ",".join(f"{{{float(a)!r},{float(b)!r}}}" for a, b in points)
    source = (
        f'#include "gain.h"\n#include <stdio.h>\nint main(void)\n{{\n    static const double points[200][2] = {{{rows}}};\n'
        f"    {precision} L[2];\n    int k;\n    for (k = 0; k < 200; ++k) {{\n"
        f"        gain_gain(({precision})points[k][0], ({precision})points[k][1], L);\n"
        '        printf("%.17g %.17g\\n", (double)L[0], (double)L[1]);\n    }\n    return 0;\n}\n'
    )
    found = printed(tmp_path, source, flags=SANITIZE).reshape(-1, 2)
    wanted = [table(precision)(speed=float(a), acceleration=float(b)).ravel() for a, b in points]
    # Three interpolations of numbers below one half.
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-15 if precision == "double" else 5e-7)


def test_refusals() -> None:
    with pytest.raises(BadInput, match="an axis is missing for acceleration"):
        look_up_table(design(), AXES[:1])
    with pytest.raises(BadInput, match="is no parameter of the gain"):
        look_up_table(design(), (*AXES, Axis("mass", (1.0, 2.0))))
    with pytest.raises(BadInput, match="add points at the ends"):
        look_up_table(design(), (Axis("inverse_speed", (5.0, 40.0), "speed"), AXES[1]))
    with pytest.raises(BadInput, match="at least two that rise"):
        Axis("acceleration", (1.0, 1.0))
    with pytest.raises(BadInput, match="above zero"):
        Axis("inverse_speed", (0.0, 1.0), "speed")
    constant = synthesize(design().system, PolytopicLuenberger(decay_rate=0.5, schedule="constant"))
    with pytest.raises(NotAccepted, match="needs no table"):
        look_up_table(constant, AXES)
