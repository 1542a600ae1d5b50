"""Gain tables in C: what they compute, whatever users call their signals."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from c_programs import needs_compiler, printed
from luenberger.algebra import Polynomial
from luenberger.core import BadInput
from luenberger.export import Axis, GainTable, look_up_table, table_header
from luenberger.methods import PolytopicLuenberger
from luenberger.synthesize import synthesize
from luenberger.systems import Parameter, System


@cache
def table(signal: str, unit: str = "", name: str = "plant") -> GainTable:
    moving = Polynomial.affine(np.array([[-1.0, 1.0], [0.0, -1.0]]), **{signal: np.array([[0.0, 0.0], [0.5, 0.0]])})
    parameters = [Parameter(signal, -1.0, 1.0, unit)]
    plant = System.lpv(moving, C=[[1.0, 0.0]], parameters=parameters, name=name, units={signal: unit})
    points = (-1.0, -0.25, 1.0)
    return look_up_table(
        synthesize(plant, PolytopicLuenberger(decay_rate=1.0)), (Axis(signal, points),), levels={"decay": 0.9}
    )


def computed(read: GainTable, folder: Path, at: float) -> np.ndarray:
    """What the header makes of one signal, under all warnings that a target may have on."""
    (folder / "obs.h").write_text(table_header(read, "obs"), encoding="utf-8")
    source = (
        '#include "obs.h"\n#include <stdio.h>\nint main(void)\n{\n    double gain[2];\n'
        f'    obs_gain({at!r}, gain);\n    printf("%.17g %.17g\\n", gain[0], gain[1]);\n    return 0;\n}}\n'
    )
    return printed(folder, source, flags=("-Wshadow",))


@needs_compiler
@pytest.mark.parametrize("signal", ["k", "L", "cell", "share", "corner", "weight", "point"])
def test_signals_may_be_called_like_the_locals_of_the_function(signal: str, tmp_path: Path) -> None:
    found = computed(table(signal), tmp_path, 0.3)
    # One interpolation of numbers below one.
    np.testing.assert_allclose(found, table(signal)(**{signal: 0.3}).ravel(), rtol=0, atol=1e-15)


@needs_compiler
@pytest.mark.parametrize(
    ("unit", "name"), [("m*/s", "a"), ("m/*s", "a"), ("m", "a */ b"), ("m", "a /* b"), ("m\ns", "a")]
)
def test_what_users_write_cannot_end_a_comment(unit: str, name: str, tmp_path: Path) -> None:
    assert np.isfinite(computed(table("v", unit, name), tmp_path, 0.3)).all()


@needs_compiler
@pytest.mark.parametrize(("at", "edge"), [(-7.0, -1.0), (9.0, 1.0), (float("1e300"), 1.0)])
def test_beyond_the_grid_the_edge_is_held(at: float, edge: float, tmp_path: Path) -> None:
    np.testing.assert_allclose(computed(table("v"), tmp_path, at), table("v")(v=edge).ravel(), rtol=0, atol=1e-15)


def test_names_that_c_cannot_hold_are_refused() -> None:
    with pytest.raises(BadInput, match="`int` is no C identifier; rename it"):
        table_header(table("int"), "obs")
    with pytest.raises(BadInput, match="a C identifier is needed, since it is the prefix"):
        table_header(table("v"), "my-table")
    with pytest.raises(BadInput, match="`obs_gain` begins like the symbols of the header; give another `name`"):
        table_header(table("obs_gain"), "obs")
    assert "other_gain(double obs_gain, double *L)" in table_header(table("obs_gain"), "other")
