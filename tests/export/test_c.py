"""The C writer: one symbol prefix, no globals, no allocation, what it costs said, what cannot be written refused by name."""

import re
import subprocess
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from c_programs import needs_compiler
from export_plants import running, scheduled
from luenberger.core import BadInput
from luenberger.export import Guarded, Signals, build, c_code, golden, write_c
from luenberger.export.build import compiler
from luenberger.export.golden import random_drive
from luenberger.observers import Estimate, Observer, ZonotopicFilter
from luenberger.systems import System


def code(name: str = "spring", precision: str = "double"):
    return c_code(Guarded.of(running(), scheduled()), name, precision=precision)


class Sorting(Observer):
    """An observer whose step sorts, which straight-line C cannot say."""

    dt: float = 0.1

    def init(self, x0):
        return jnp.asarray(x0)

    def step(self, state, u, y, r):
        return jnp.sort(state), Estimate(state)


def test_the_header_names_signals_units_cost_and_flags() -> None:
    text = code().header
    for words in (
        "u[0] force [N]",
        "y[0] measured_position [m]",
        "r[0] stiffness [1/s^2], proved in [1, 4]",
        "[0] position [m]",
        "library functions called: none",
        "#define SPRING_SCHEDULING_RATE 4U",
        "Nothing is certified about this estimator.",
        "CorrectionObserver, one step of 0.01 s, double",
    ):
        assert words in text
    operations = int(re.search(r"takes (\d+) arithmetic operations", text)[1])  # type: ignore[index]
    assert operations == code().operations == len(re.findall(r"const double t\d+ =", code().source.split("_step(")[1]))


@pytest.mark.parametrize(("precision", "share"), [("double", "1.1e-16"), ("float", "6.0e-08")])
def test_computed_bounds_do_not_pass_for_rounded_ones(precision: str, share: str) -> None:
    plant = System.linear(
        [[0.9, 0.1], [0.0, 0.8]], C=[[1.0, 0.0]], E=[[0.0], [1.0]], dt=0.1, disturbance_bound=[1.0], noise_bound=[0.1]
    )
    bounded = ZonotopicFilter(plant, initial_half_width=[1.0, 1.0], count=6)
    assert (
        f"being {share} of the largest value" in c_code(Guarded.of(bounded, plant), "set", precision=precision).header
    )
    assert "outward" not in code(precision=precision).header


def test_boxes_that_are_taken_for_granted_stand_in_numbers() -> None:
    plant = System.linear([[0.9]], C=[[1.0]], E=[[1.0]], dt=0.1, disturbance_bound=[1.0], noise_bound=[0.1])
    for never, told in ((None, False), ([np.inf], False), ([2.5], True)):
        bounded = ZonotopicFilter(plant, initial_half_width=[0.25], state_bound=never)
        header = c_code(Guarded.of(bounded, plant), "set").header
        assert "within (0.25) of x0" in header
        assert ("to stay within (2.5) of zero" in header) == told
    assert "within" not in code().header.split("#ifndef")[0]


def test_no_allocation_no_globals_and_gains_as_tables() -> None:
    source = code().source
    assert not re.search(r"malloc|calloc|static (?!const)|^\s*double \w+;", source, re.MULTILINE)
    assert "static const double spring_gain_0[2] = {2.0, 1.0};" in source
    assert "spring_gain_1[1]" in source
    # The zero in the second table costs nothing.
    assert "spring_gain_1[0]" not in source.split("_step(")[1]


@needs_compiler
def test_two_observers_share_a_program_and_every_symbol_has_its_prefix(tmp_path: Path) -> None:
    for name in ("one", "two"):
        (tmp_path / f"{name}.h").write_text(code(name).header)
        (tmp_path / f"{name}.c").write_text(code(name).source)
        subprocess.run([str(compiler()), "-std=c99", "-c", f"{name}.c"], cwd=tmp_path, check=True)
    shown = subprocess.run(
        ["nm", "-g", "--defined-only", "one.o"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert sorted(line.split()[-1] for line in shown.stdout.splitlines()) == ["one_init", "one_step"]
    (tmp_path / "main.c").write_text(
        '#include "one.h"\n#include "two.h"\nint main(void)\n{\n    one_state a; two_state b; one_estimate e; two_estimate f;\n'
        "    const double x[2] = {0.0, 0.0}, u[1] = {1.0}, y[1] = {0.5}, r[1] = {2.0};\n    one_init(&a, x); two_init(&b, x);\n"
        "    return (int)(one_step(&a, u, y, r, &e) | two_step(&b, u, y, r, &f));\n}\n"
    )
    words = [str(compiler()), "-std=c99", "-Wall", "-Werror", "main.c", "one.o", "two.o", "-o", "main", "-lm"]
    subprocess.run(words, cwd=tmp_path, check=True)
    assert subprocess.run(["./main"], cwd=tmp_path, check=False).returncode == 0


@needs_compiler
def test_a_wrong_number_in_the_code_is_caught_by_its_vectors(tmp_path: Path) -> None:
    guarded = Guarded.of(running(), scheduled())
    write_c(code(), golden(guarded, *random_drive(guarded, 50)), tmp_path, tolerance=1e-12)
    assert build(tmp_path, "spring").agrees
    source = (tmp_path / "spring.c").read_text()
    (tmp_path / "spring.c").write_text(source.replace("{2.0, 1.0}", "{2.0, 1.0000001}"))
    said = build(tmp_path, "spring")
    assert said.ran
    assert not said.agrees
    assert "disagreements" in said.says


def test_what_cannot_be_written_is_refused_by_name() -> None:
    guarded = Guarded.of(Sorting(), signals=Signals(("a", "b")))
    with pytest.raises(BadInput, match="`sort`"):
        c_code(guarded, "sorting")
    with pytest.raises(BadInput, match="C identifier"):
        code("9lives")
    with pytest.raises(BadInput, match='"double" or "float"'):
        code(precision="half")


def test_vectors_are_what_the_observer_did() -> None:
    guarded = Guarded.of(running(), scheduled())
    drive = random_drive(guarded, 30, 2)
    run = golden(guarded, *drive)
    state = guarded.init(drive[0][1])
    for k in range(30):
        state, estimate, raised = guarded.step(state, *(a[1, k] for a in drive[1:]))
        np.testing.assert_allclose(run.estimate[1, k], estimate.x, rtol=1e-12, atol=1e-15)
        assert run.status[1, k] == sum(int(bool(f)) << i for i, f in enumerate(raised.values()))
    # The drive leaves the scheduling box now and then, on purpose.
    assert 0 < ((run.status & 2) > 0).mean() < 0.3
    with pytest.raises(BadInput, match="`u` has shape"):
        golden(guarded, drive[0], drive[1][0], *drive[2:])
    assert jax.tree.leaves(guarded)  # arrays are leaves: golden vectors are batched by vmap
