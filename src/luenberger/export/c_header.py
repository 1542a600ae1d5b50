"""The header of exported code: structures, signals with units, what was proved of what, and what a step costs."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from luenberger.certify import Certificate
from luenberger.export.c_text import in_comment
from luenberger.export.guard import FLAGS, Guarded
from luenberger.export.program import Leaf, Program
from luenberger.export.rounding import UNITS
from luenberger.observers import Observer


def header(
    guarded: Guarded,
    read: Program,
    name: str,
    precision: str,
    facts: tuple[int, int, tuple[str, ...]],
    certificate: Certificate | None,
    statements: Sequence[str],
) -> str:
    """Return the text of NAME.h.

    Args:
        guarded: what is exported.
        read: its programs.
        name: prefix.
        precision: "double" or "float".
        facts: operations and bytes of locals of a step, library functions it calls.
        certificate: what was proved; None for filters.
        statements: further sentences.
    """
    operations, stack, calls = facts
    s = guarded.signals
    library = ", ".join(calls) or "none"
    lines = [
        f"/* {name}: {type(guarded.observer).__name__}, one step of {guarded.observer.dt!r} s, {precision}.",
        " *",
        f" * A step takes {operations} arithmetic operations and at most {stack} bytes of locals; library functions called: {library}.",
        " * No allocation, no globals; the caller owns the state. Do not compile with -ffast-math.",
    ]
    sentences = [*_proved(certificate), *statements]
    sentences += _boxes(guarded.observer)
    if any(leaf.path == "lower" for leaf in read.estimate):
        sentences.append(
            f"The bounds are computed in {precision} to nearest, not outward: they hold up to rounding, each operation's share being "
            f"{UNITS[precision][0]:.1e} of the largest value in it."
        )
    lines += [f" * {in_comment(sentence)}" for sentence in sentences]
    lines += [
        " */",
        f"#ifndef {name.upper()}_H",
        f"#define {name.upper()}_H",
        "",
        "#ifdef __cplusplus",
        'extern "C" {',
        "#endif",
        "",
    ]
    for bit, flag in enumerate(read.flags):
        lines.append(f"#define {name.upper()}_{flag.upper()} {1 << bit}U /* {FLAGS[flag]} */")
    lines += ["", "typedef struct {", *_fields(read.state, precision), f"}} {name}_state;", ""]
    lines += ["/* Estimate at this sample, entry by entry:"]
    lines += [f" *   [{k}] {signal}{_unit(s.units, signal)}" for k, signal in enumerate(s.states)]
    lines += [" */", "typedef struct {", *_fields(read.estimate, precision), f"}} {name}_estimate;", ""]
    lines += [f"/* Start from a first guess x0[{len(s.states)}]. */"]
    lines += [f"void {name}_init({name}_state *state, const {precision} *x0);", ""]
    lines += ["/* Advance by one sample; returns the flags of broken assumptions, 0 where none was seen to break."]
    ranges = {n: f", proved in [{a:.9g}, {b:.9g}]" for n, (a, b) in zip(s.scheduling, guarded.ranges, strict=False)}
    for letter, names in (("u", s.inputs), ("y", s.outputs), ("r", s.scheduling)):
        lines += [f" *   {letter}[{k}] {n}{_unit(s.units, n)}{ranges.get(n, '')}" for k, n in enumerate(names)]
    lines += [" * Signals without entries may be null pointers.", " */"]
    lines.append(
        f"unsigned {name}_step({name}_state *state, const {precision} *u, const {precision} *y, const {precision} *r, "
        f"{name}_estimate *estimate);"
    )
    lines += ["", "#ifdef __cplusplus", "}", "#endif", "#endif"]
    return "\n".join(lines) + "\n"


def _boxes(observer: Observer) -> list[str]:
    """The boxes that a set takes for granted, in numbers; no output shows whether the first state was in its box."""
    start, never = (getattr(observer, name, None) for name in ("initial_half_width", "state_bound"))
    found = []
    if start is not None:
        found.append(f"The first state is taken to lie within {_numbers(start)} of x0, state by state.")
    if never is not None and np.isfinite(never).any():
        found.append(f"The state is taken to stay within {_numbers(never)} of zero, state by state.")
    return found


def _numbers(values: Any) -> str:
    return "(" + ", ".join(f"{v:.6g}" for v in np.ravel(values)) + ")"


def _proved(certificate: Certificate | None) -> list[str]:
    if certificate is None:
        return ["Nothing is certified about this estimator."]
    lines = ["Certified of the design (a statement about the stated model, see below for the sampled step):"]
    for proof in certificate.proofs:
        lines.append(f"  {proof.outcome.value}: {proof.sentence}")
    return [*lines, "This rests on:", *(f"  {sentence}" for sentence in certificate.assumptions)]


def _fields(leaves: Sequence[Leaf], precision: str) -> list[str]:
    return [
        f"    {precision} {leaf.path}{f'[{leaf.size}]' if leaf.shape else ''};"
        + (f" /* {_shape(leaf)} */" if len(leaf.shape) > 1 else "")
        for leaf in leaves
        if leaf.size
    ]


def _shape(leaf: Leaf) -> str:
    return " x ".join(map(str, leaf.shape)) + ", row by row"


def _unit(units: object, name: str) -> str:
    unit = dict(units).get(name, "")  # type: ignore[call-overload]
    return f" [{in_comment(unit)}]" if unit else ""
