"""Every operation of the arithmetic, written as C, computes what NumPy computes."""

from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from c_programs import needs_compiler, printed
from luenberger.algebra.arithmetic import FLOAT
from luenberger.algebra.jaxpr import trace
from luenberger.export.c_text import CText

POINTS = np.array([[0.3, -0.7], [2.5, 1.5], [-1.2, 0.4], [0.0, -0.0], [np.nan, 1.0], [np.inf, -2.0]])
FUNCTIONS = {
    "arithmetic": lambda a, b: (a + b) * (a - b) / (b * b + 2.0) - a,
    "powers": lambda a, b: a**5 + b**-3 + jnp.square(a),
    "extremes": lambda a, b: jnp.maximum(a, b) + 2.0 * jnp.minimum(a, b),
    "branches": lambda a, b: jnp.where((a > b) & ~(a == 0.0), a, jnp.where((a <= b) | (a != a), b, -a)),
    "signs": lambda a, b: jnp.sign(a) + jnp.abs(b) + jnp.floor(a) + jnp.ceil(b),
    "circle": lambda a, b: jnp.sin(a) * jnp.cos(b) + jnp.arctan2(a, b) + jnp.arctan(a),
    "growth": lambda a, b: jnp.exp(-jnp.abs(a)) + jnp.tanh(b) + jnp.sqrt(jnp.abs(b)) + jnp.log1p(jnp.abs(a)),
    "missing": lambda a, b: jnp.where(jnp.isnan(a), 1.0, 0.0) + jnp.where(jnp.isfinite(b), 2.0, 0.0),
}


@needs_compiler
@pytest.mark.parametrize("name", FUNCTIONS)
def test_an_expression_computes_the_same(name: str, tmp_path: Path) -> None:
    read = trace(FUNCTIONS[name], np.zeros(()), np.zeros(()))
    text = CText("double")
    values = read.run(["a", "b"], text)
    body = "\n    ".join(text.lines)
    source = (
        "#include <math.h>\n#include <stdio.h>\n#include <stdlib.h>\nint main(int n, char **v)\n{\n    int k;\n"
        "    for (k = 1; k + 1 < n; k += 2) {\n    const double a = strtod(v[k], NULL), b = strtod(v[k + 1], NULL);\n    "
        + body
        + f'\n    printf("%.17g\\n", {values[int(read.outputs[0])]});\n    }}\n    return 0;\n}}\n'
    )
    found = printed(tmp_path, source, *(repr(float(x)) for x in POINTS.ravel()))
    with np.errstate(all="ignore"):
        expected = np.broadcast_to(read.run([POINTS[:, 0], POINTS[:, 1]], FLOAT)[int(read.outputs[0])], len(POINTS))
    # Two mathematical libraries may differ in the last digit of a few calls.
    np.testing.assert_allclose(found, expected, rtol=1e-14, atol=1e-15)


@pytest.mark.parametrize(
    ("real", "value", "text"),
    [
        ("double", 1.0, "1.0"),
        ("double", -0.1, "(-0.1)"),
        ("float", 1e-7, "1e-07f"),
        ("float", 3.0, "3.0f"),
        ("double", float("nan"), "(double)NAN"),
        ("double", -float("inf"), "(-(double)INFINITY)"),
    ],
)
def test_literals(real: str, value: float, text: str) -> None:
    assert CText(real).constant(value) == text


def test_the_library_functions_that_are_called_are_listed() -> None:
    text = CText("float")
    trace(lambda a: jnp.sin(a) + jnp.sqrt(jnp.abs(a)), np.zeros(())).run(["a"], text)
    # Absolute value and square root are instructions, no calls.
    assert text.calls == {"sinf"}
    assert any("sqrtf(" in line for line in text.lines)
