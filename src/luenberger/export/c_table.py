"""A gain table as a C99 header: grid, entries, and the interpolation that was proved."""

from collections.abc import Sequence

import numpy as np

from luenberger.core import BadInput
from luenberger.export.c_text import CText, in_comment
from luenberger.export.signals import NAME, Signals, distinct
from luenberger.export.tables import GainTable


def table_header(table: GainTable, name: str) -> str:
    """Return the text of NAME.h: a function that fills L from the signals, multi-linear between grid points, held outside.

    Args:
        table: gain table.
        name: prefix, a C identifier.

    Raises:
        BadInput: a name or a signal that is no C identifier, or a signal that is called like a symbol of the header.
    """
    if not NAME.match(name):
        raise BadInput(f"`name` is `{name}`; a C identifier is needed, since it is the prefix of every symbol.")
    signals = Signals((), scheduling=tuple(axis.name for axis in table.axes))
    if own := [s for s in signals.scheduling if s.startswith(f"{name}_")]:
        raise BadInput(
            f"The signal `{own[0]}` begins like the symbols of the header; give another `name` than `{name}`."
        )
    real = table.precision
    nx, ny = table.values.shape[-2:]
    system = table.design.system
    sizes = [len(axis.points) for axis in table.axes]
    lines = [
        f"/* {name}: gain table of `{in_comment(system.name)}`, {' x '.join(map(str, sizes))} points, {real}.",
        " *",
        f" * L has {nx} rows (states {', '.join(system.states)}) and {ny} columns (outputs {', '.join(system.outputs)}), row by row.",
        f" * The interpolated gain differs from that of the design by at most {table.error:.6g} in any entry.",
        " * Proved of the interpolated gain, on every cell:",
        *(f" *   {p.outcome.value}: {in_comment(p.sentence)}" for p in table.certificate.proofs),
        *(
            []
            if system.dt is not None
            else [
                " * That is about continuous time: the step of the observer that reads this table is not in it, see `export --to c`."
            ]
        ),
        " * This rests on:",
        *(f" *   {in_comment(line)}" for line in table.certificate.assumptions),
        " */",
        f"#ifndef {name.upper()}_H",
        f"#define {name.upper()}_H",
        "",
    ]
    for k, axis in enumerate(table.axes):
        unit = "" if axis.reciprocal else system.units.get(axis.parameter, "")
        lines.append(f"/* {axis.name}{f' [{in_comment(unit)}]' if unit else ''} */")
        lines.append(f"static const {real} {name}_axis{k}[{sizes[k]}] = {{{_row(real, axis.points)}}};")
    # What is a float in the table is a float here.
    lines.append(f"static const {real} {name}_entries[{table.values.size}] = {{")
    flat = table.values.reshape(-1, nx * ny)
    lines += [f"    {_row(real, row)}," for row in flat]
    lines += ["};", "", *_function(table, name, sizes, nx * ny), "", "#endif"]
    return "\n".join(lines) + "\n"


def _function(table: GainTable, name: str, sizes: Sequence[int], entries: int) -> list[str]:
    real, text = table.precision, CText(table.precision)
    zero, one = text.constant(0.0), text.constant(1.0)
    count = len(sizes)
    # Two axes may be read by one signal, speed and its inverse for example.
    signals = list(dict.fromkeys(axis.name for axis in table.axes))
    own = ("L", "cell", "share", "corner", "weight", "point", "k")
    L, cell, share, corner, weight, point, k = distinct([*signals, *own])[len(signals) :]
    arguments = ", ".join(f"{real} {signal}" for signal in signals)
    lines = [
        f"/* Fill {L}[{entries}] at the given signals; what lies outside the grid is held at its edge. */",
        f"static inline void {name}_gain({arguments}, {real} *{L})",
        "{",
        f"    {real} {share}[{count}];",
        f"    int {cell}[{count}], {corner}, {k};",
    ]
    for a, axis in enumerate(table.axes):
        n, grid, c, s = sizes[a], f"{name}_axis{a}", f"{cell}[{a}]", f"{share}[{a}]"
        lines += [
            f"    for ({c} = 0; {c} < {n - 2} && {axis.name} >= {grid}[{c} + 1]; ++{c}) {{",
            "    }",
            f"    {s} = ({axis.name} - {grid}[{c}]) / ({grid}[{c} + 1] - {grid}[{c}]);",
            f"    {s} = {s} > {zero} ? ({s} < {one} ? {s} : {one}) : {zero};",
        ]
    strides = [int(np.prod(sizes[a + 1 :], dtype=int)) for a in range(count)]
    place = " + ".join(f"({cell}[{a}] + (({corner} >> {a}) & 1)) * {strides[a]}" for a in range(count))
    product = " * ".join(f"((({corner} >> {a}) & 1) ? {share}[{a}] : {one} - {share}[{a}])" for a in range(count))
    lines += [
        f"    for ({k} = 0; {k} < {entries}; ++{k}) {{",
        f"        {L}[{k}] = {zero};",
        "    }",
        f"    for ({corner} = 0; {corner} < {2**count}; ++{corner}) {{",
        f"        const {real} {weight} = {product};",
        f"        const {real} *{point} = {name}_entries + ({place}) * {entries};",
        f"        for ({k} = 0; {k} < {entries}; ++{k}) {{",
        f"            {L}[{k}] += {weight} * {point}[{k}];",
        "        }",
        "    }",
        "}",
    ]
    return lines


def _row(real: str, values: Sequence[float] | np.ndarray) -> str:
    text = CText(real)
    return ", ".join(text.constant(float(v)) for v in values)
