"""C99 from an observer: the step that was proved and replayed, operation by operation, without allocation and without globals."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from luenberger.algebra.jaxpr import Trace
from luenberger.certify import Certificate
from luenberger.core import BadInput
from luenberger.export.c_header import header
from luenberger.export.c_text import CText
from luenberger.export.guard import Guarded
from luenberger.export.program import Leaf, Program, Table, program
from luenberger.export.signals import NAME

PRECISIONS = ("double", "float")


@dataclass(frozen=True)
class CCode:
    """A pair of files.

    Args:
        name: prefix of every symbol, and name of the files.
        header: text of NAME.h.
        source: text of NAME.c.
        precision: "double" or "float".
        operations: arithmetic operations a step.
        stack: upper bound of the locals of a step [bytes].
        calls: functions of the mathematical library that a step calls.
        guarded: what the code was written from.
        read: the scalar programs behind it.
    """

    name: str
    header: str
    source: str
    precision: str
    operations: int
    stack: int
    calls: tuple[str, ...]
    guarded: Guarded
    read: Program


def c_code(
    guarded: Guarded,
    name: str,
    *,
    precision: str = "double",
    certificate: Certificate | None = None,
    statements: Sequence[str] = (),
) -> CCode:
    """Write an observer as C99.

    Choose it to run on a target what was replayed here: the code is read from `Guarded.step` itself. The caller owns all memory, nothing
    is allocated, there is no global state, and every symbol begins with `name`. Compile it without -ffast-math: a step must see what is
    not a number, and keep the order of its sums.

    Args:
        guarded: observer with its watched assumptions.
        name: prefix, a C identifier.
        precision: "double" or "float".
        certificate: what was proved, quoted in the header.
        statements: further sentences for the header, e.g. on the sampled step.

    Raises:
        BadInput: a name that is no C identifier, an unknown precision, or a JAX primitive that cannot be written (named).
        NotAccepted: an operation or constant that C99 lacks.
    """
    if not NAME.match(name):
        raise BadInput(f"`name` is `{name}`; a C identifier is needed, since it is the prefix of every symbol.")
    if precision not in PRECISIONS:
        raise BadInput(f'`precision` is "{precision}"; "double" or "float" is needed.')
    read = program(guarded)
    step, init = CText(precision), CText(precision)
    signals = [
        ("u", len(guarded.signals.inputs)),
        ("y", len(guarded.signals.outputs)),
        ("r", len(guarded.signals.scheduling)),
    ]
    tables = [f"{name}_{t.name}[{k}]" for t in read.tables for k in range(len(t.values))]
    places = [f"state->{leaf.path}{_index(leaf, k)}" for leaf in read.state for k in range(leaf.size)]
    given = [*tables, *places, *(f"{letter}[{k}]" for letter, count in signals for k in range(count))]
    results = _written(read.step, step, given)
    out = [f"estimate->{leaf.path}{_index(leaf, k)}" for leaf in read.estimate for k in range(leaf.size)]
    following, estimate, flags = (
        results[: len(places)],
        results[len(places) : len(places) + len(out)],
        results[len(places) + len(out) :],
    )
    body = [
        *step.lines,
        *(f"{place} = {value};" for place, value in zip(out, estimate, strict=True)),
        *(f"{place} = {value};" for place, value in zip(places, following, strict=True)),
        "return "
        + (" | ".join(f"({p} ? {_flag(name, f)} : 0U)" for p, f in zip(flags, read.flags, strict=True)) or "0U")
        + ";",
    ]
    start = _written(read.init, init, [*tables, *(f"x0[{k}]" for k in range(len(guarded.signals.states)))])
    begin = [*init.lines, *(f"{place} = {value};" for place, value in zip(places, start, strict=True))]
    size = 8 if precision == "double" else 4
    stack = size * sum(line.startswith(f"const {precision}") for line in step.lines)
    stack += 4 * sum(line.startswith("const int") for line in step.lines)
    calls = tuple(sorted(step.calls))
    facts = (step.operations, stack, calls)
    text = header(guarded, read, name, precision, facts, certificate, statements)
    source = _source(name, precision, read.tables, begin, body, bool(signals), calls or init.calls)
    return CCode(name, text, source, precision, step.operations, stack, calls, guarded, read)


def _written(read: Trace, text: CText, given: Sequence[str]) -> list[str]:
    """Operations as lines; returns the expressions of all outputs."""
    used = {k for operation in read.operations for k in operation.operands} | {
        int(k) for o in read.outputs for k in o.flat
    }
    names, position = [], 0
    for k, operation in enumerate(read.operations):
        if operation.name == "input":
            # Inputs are copied first: what is written at the end must not change what is still to be read.
            names.append(_loaded(text, given[position]) if k in used else "")
            position += 1
    values = read.run(names, text)
    return [values[int(k)] for places in read.outputs for k in places.flat]


def _loaded(text: CText, place: str) -> str:
    name = f"i{len(text.lines)}"
    text.lines.append(f"const {text.real} {name} = {place};")
    return name


def _source(
    name: str,
    precision: str,
    tables: Sequence[Table],
    begin: Sequence[str],
    body: Sequence[str],
    signals: bool,
    calls: Any,
) -> str:
    text = CText(precision)
    lines = [f'#include "{name}.h"', "", "#include <math.h>", ""]
    whole = "\n".join([*begin, *body])
    for table in tables:
        if f"{name}_{table.name}[" in whole:
            rows = ", ".join(text.constant(v) for v in table.values)
            lines.append(f"static const {precision} {name}_{table.name}[{len(table.values)}] = {{{rows}}};")
    arguments = f"{name}_state *state, const {precision} *x0"
    lines += [
        "",
        f"void {name}_init({arguments})",
        "{",
        *(f"    {line}" for line in [*begin, *_unused(begin, ("x0",))]),
        "}",
        "",
    ]
    arguments = f"{name}_state *state, const {precision} *u, const {precision} *y, const {precision} *r, {name}_estimate *estimate"
    lines += [
        f"unsigned {name}_step({arguments})",
        "{",
        *(f"    {line}" for line in [*_unused(body, ("u", "y", "r")), *body]),
        "}",
    ]
    return "\n".join(lines) + "\n"


def _unused(body: Sequence[str], names: Sequence[str]) -> list[str]:
    whole = "\n".join(body)
    return [f"(void){name};" for name in names if not re.search(rf"\b{name}\[", whole)]


def _index(leaf: Leaf, k: int) -> str:
    return "" if not leaf.shape else f"[{k}]"


def _flag(name: str, flag: str) -> str:
    return f"{name.upper()}_{flag.upper()}"
