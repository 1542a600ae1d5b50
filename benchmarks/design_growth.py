"""How the cost of a design grows with scheduling parameters and states, for each relaxation, and what each gives away.

    python benchmarks/design_growth.py [--picture results/design_growth.png] [--seconds 5]

The plant x' = A(r) x, y = C(r) x and the gain P L(r) = Y(r) are affine in p parameters, so the inequality is quadratic in all of
them. Wanted is the largest margin of decay with I <= P <= 10 I and bounded Y. Solver time, time of the whole design and time of the proof in exact rationals are
measured in this run and shown as multiples of those of the smallest case (one parameter, two states, structured multiplier), so
that pictures of different machines can be laid side by side. A relaxation leaves a sweep once a design took longer than allowed.
"""

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cvxpy as cp
import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots
from rich.console import Console
from rich.table import Table

from luenberger.algebra import Polynomial
from luenberger.algebra.definiteness import exact
from luenberger.certify.continuum import negative_definite
from luenberger.lmi import (
    Bernstein,
    Block,
    FullBlockMultiplier,
    Planned,
    Problem,
    Relaxation,
    StructuredMultiplier,
    solve,
)
from luenberger.lmi.storage import rounded_storage
from luenberger.report.palette import styles

RELAXATIONS: dict[str, Relaxation] = {
    "structured multiplier": StructuredMultiplier(),
    "full block multiplier": FullBlockMultiplier(),
    "Bernstein": Bernstein(),
    "Bernstein, 2 parts": Bernstein(parts=2),
    "planner": Planned(),
}
PARAMETERS, STATES = tuple(range(1, 7)), (2, 3, 4, 6, 8, 10, 12)
FIXED_STATES, FIXED_PARAMETERS = 3, 3
# A proof by subdivision is given up after so many pieces.
PIECES = 20


@dataclass(frozen=True)
class Cost:
    """One design.

    Args:
        solver: the solver's own time [s].
        total: posing, expanding, solving and judging [s].
        certificate: exact proof on the whole box [s]; None where it was given up.
        margin: what was maximised.
    """

    solver: float
    total: float
    certificate: float | None
    margin: float


def plant(p: int, nx: int) -> tuple[Polynomial, Polynomial]:
    """Return A(r) and C(r): a third as many outputs as states, swings that together have the size of the constant parts."""
    generator = np.random.default_rng((p, nx))
    ny = max(1, nx // 3)
    units = [tuple(int(j == k) for j in range(p)) for k in range(p)]
    A = generator.normal(size=(nx, nx)) / np.sqrt(nx)
    A -= (np.linalg.eigvalsh(A + A.T).max() / 2 + 1.0) * np.eye(nx)
    C = 0.4 * generator.normal(size=(ny, nx)) / np.sqrt(nx)
    moving = {
        "A": {u: 0.5 / np.sqrt(p) * generator.normal(size=(nx, nx)) / np.sqrt(nx) for u in units},
        "C": {u: 1.5 / np.sqrt(p) * generator.normal(size=(ny, nx)) / np.sqrt(nx) for u in units},
    }
    zero, names = (0,) * p, [f"r{k}" for k in range(p)]
    return Polynomial(names, {zero: A, **moving["A"]}), Polynomial(names, {zero: C, **moving["C"]})


def designed(p: int, nx: int, relaxation: Relaxation) -> Cost | None:
    """Maximise s with decay F <= -s I, I <= P <= 10 I and |Y| <= 10; prove four fifths of it in rationals."""
    A, C = plant(p, nx)
    ny, box = C.shape[0], dict.fromkeys(A.names, (-1.0, 1.0))
    start = time.perf_counter()
    P, s = cp.Variable((nx, nx), symmetric=True, name="P"), cp.Variable(name="s")
    parts = {e: cp.Variable((nx, ny), name=f"Y{k}") for k, e in enumerate(A.terms)}
    half = Polynomial.constant(P) @ A - Polynomial(A.names, dict(parts)) @ C
    blocks = [
        Block("below", Polynomial.constant(np.eye(nx) - P)),
        Block("above", Polynomial.constant(P - 10.0 * np.eye(nx))),
        Block("decay", half + half.T + Polynomial.constant(s * np.eye(nx)), box, relaxation=relaxation),
    ]
    problem = Problem({"P": P, "s": s, **{v.name(): v for v in parts.values()}}, blocks, -s)
    limits = [cp.norm(y, "fro") <= 10.0 for y in parts.values()]
    found = solve(problem, extra=limits, solvers=("CLARABEL",))
    total = time.perf_counter() - start
    if found is None:
        return None
    start = time.perf_counter()
    storage = Polynomial.constant(exact(rounded_storage(found.values["P"])))
    rounded = Polynomial(A.names, {e: exact(np.round(found.values[v.name()], 9)) for e, v in parts.items()})
    drift = storage @ A.map(exact) - rounded @ C.map(exact)
    kept = Polynomial.constant(exact((-found.objective - 0.2 * abs(found.objective)) * np.eye(nx)))
    verdict = negative_definite(drift + drift.T + kept, box, pieces=PIECES)
    proof = time.perf_counter() - start
    return Cost(found.solver_seconds, total, proof if verdict.margin > 0 else None, -found.objective)


def swept(cases: Sequence[tuple[int, int]], allowed: float, console: Console) -> dict[str, dict[tuple[int, int], Cost]]:
    """Return the costs of all relaxations over the cases, leaving a relaxation once it took longer than allowed."""
    costs: dict[str, dict[tuple[int, int], Cost]] = {name: {} for name in RELAXATIONS}
    gone: set[str] = set()
    for case in cases:
        for name, relaxation in RELAXATIONS.items():
            if name in gone:
                continue
            repeats = 2
            for _ in range(repeats):
                cost = designed(*case, relaxation)
                best = costs[name].get(case)
                if cost is not None and (best is None or cost.total < best.total):
                    costs[name][case] = cost
                if cost is None or cost.total > 0.5:
                    break
            if case in costs[name] and costs[name][case].total > allowed:
                gone.add(name)
            console.print(f"p={case[0]} nx={case[1]} {name}: {costs[name].get(case)}", style="dim")
    return costs


def table(costs: dict[str, dict[tuple[int, int], Cost]], unit: Cost) -> Table:
    """Return the costs as multiples of the smallest case."""
    made = Table("parameters", "states", "relaxation", "solver", "design", "proof", "margin given away")
    made.title = "multiples of the smallest case (structured multiplier, one parameter, two states)"
    for case in dict.fromkeys(c for row in costs.values() for c in row):
        best = max(row[case].margin for row in costs.values() if case in row)
        for name, row in costs.items():
            if case in row:
                cost = row[case]
                proof = "-" if cost.certificate is None else f"{cost.certificate / (unit.certificate or 1.0):.1f}"
                numbers = (f"{cost.solver / unit.solver:.1f}", f"{cost.total / unit.total:.1f}", proof)
                made.add_row(str(case[0]), str(case[1]), name, *numbers, f"{1 - cost.margin / best:.2%}")
    return made


def swapped(costs: dict[str, dict[tuple[int, int], Cost]], dear: str, cheap: str, which: int) -> int | None:
    """Return the size from which on the dear relaxation took more than twice the time of the cheap one, or was given up."""
    found = None
    for case in reversed(costs[cheap]):
        if case in costs[dear] and costs[dear][case].total <= 2 * costs[cheap][case].total:
            break
        found = case[which]
    return found


def picture(by_parameters: dict[str, dict], by_states: dict[str, dict], unit: Cost) -> go.Figure:
    """Return solver, design and proof time and the margin given away over both sweeps."""
    rows = ("solver time", "whole design", "exact proof", "margin given away, %")
    plot = make_subplots(
        rows=4,
        cols=2,
        shared_xaxes=True,
        vertical_spacing=0.04,
        horizontal_spacing=0.08,
        column_titles=[f"{FIXED_STATES} states", f"{FIXED_PARAMETERS} scheduling parameters"],
    )
    for column, (costs, which) in enumerate(((by_parameters, 0), (by_states, 1)), start=1):
        best = {c: max(r[c].margin for r in costs.values() if c in r) for r in costs.values() for c in r}
        for (name, style), row in zip(styles(list(costs)).items(), costs.values(), strict=True):
            x = [case[which] for case in row]
            planned = name == "planner"
            series = (
                [c.solver / unit.solver for c in row.values()],
                [c.total / unit.total for c in row.values()],
                [None if c.certificate is None else c.certificate / (unit.certificate or 1.0) for c in row.values()],
                [100 * (1 - c.margin / best[case]) for case, c in row.items()],
            )
            for k, y in enumerate(series, start=1):
                look = {"color": "#1a1a1a", "size": 13, "symbol": "circle-open"} if planned else {"color": style.colour}
                trace = go.Scatter(
                    x=x,
                    y=y,
                    name=name,
                    mode="markers" if planned else "lines+markers",
                    marker=look,
                    line={"color": style.colour},
                    legendgroup=name,
                    showlegend=column == 1 and k == 1,
                )
                plot.add_trace(trace, row=k, col=column)
    for k, title in enumerate(rows, start=1):
        scale: dict[str, Any] = {"type": "log", "dtick": 1} if k < 4 else {"type": "linear", "rangemode": "tozero"}
        plot.update_yaxes(title_text=title, row=k, col=1)
        plot.update_yaxes(**scale, row=k)
    swaps = (
        (1, by_parameters, "full block multiplier", "structured multiplier", 0),
        (2, by_states, "full block multiplier", "Bernstein", 1),
    )
    for column, costs, dear, cheap, which in swaps:
        if (at := swapped(costs, dear, cheap, which)) is not None:
            text = f"from {at} on: {cheap}<br>for {dear}"
            corner = "top left" if at > (PARAMETERS, STATES)[which][-1] / 2 else "top right"
            line = {"width": 1.5, "dash": "dot", "color": "#1a1a1a"}
            where: Any = {"row": 2, "col": column}
            plot.add_vline(x=at, line=line, annotation_text=text, annotation_position=corner, **where)
    plot.update_xaxes(range=[PARAMETERS[0] - 0.3, PARAMETERS[-1] + 0.3], dtick=1, col=1)
    plot.update_xaxes(range=[STATES[0] - 0.5, STATES[-1] + 0.5], dtick=2, col=2)
    plot.update_xaxes(title_text="scheduling parameters", row=4, col=1)
    plot.update_xaxes(title_text="states", row=4, col=2)
    plot.update_layout(
        template="plotly_white",
        title="Growth of a design with quadratic scheduling; times in multiples of the smallest case; circles: the planner's choice",
        width=1150,
        height=1250,
        legend={"orientation": "h", "y": -0.06},
        font={"size": 13},
    )
    return plot


def main() -> None:
    """Sweep, tabulate, draw."""
    parser = argparse.ArgumentParser(description="Growth of the cost of a design.")
    parser.add_argument(
        "--picture", type=Path, default=Path("results/design_growth.png"), help="PNG; an HTML page is put beside it"
    )
    parser.add_argument(
        "--seconds", type=float, default=5.0, help="a relaxation leaves a sweep after a design this long"
    )
    given = parser.parse_args()
    console = Console(width=120)
    designed(1, 2, StructuredMultiplier())
    unit = min((c for c in (designed(1, 2, StructuredMultiplier()) for _ in range(5)) if c), key=lambda c: c.total)
    by_parameters = swept([(p, FIXED_STATES) for p in PARAMETERS], given.seconds, console)
    by_states = swept([(FIXED_PARAMETERS, nx) for nx in STATES], given.seconds, console)
    for costs in (by_parameters, by_states):
        console.print(table(costs, unit))
    plot = picture(by_parameters, by_states, unit)
    given.picture.parent.mkdir(parents=True, exist_ok=True)
    plot.write_html(given.picture.with_suffix(".html"), include_plotlyjs="cdn")
    plot.write_image(given.picture)
    console.print(f"{given.picture} and {given.picture.with_suffix('.html').name}")


if __name__ == "__main__":
    main()
