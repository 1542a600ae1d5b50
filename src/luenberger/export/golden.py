"""Golden vectors: what the Python observer did on a drive, and a small program that replays it on the target."""

import math
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from luenberger.core import BadInput
from luenberger.export.c import CCode
from luenberger.export.guard import Guarded


@dataclass(frozen=True, eq=False)
class Golden:
    """Vectors of runs, each from a start of its own.

    Args:
        x0: first guesses, shape (runs, nx).
        u: inputs, shape (runs, nt, nu).
        y: outputs, shape (runs, nt, ny).
        r: scheduling signals, shape (runs, nt, nr).
        estimate: all entries of the estimate in the order of the C structure, shape (runs, nt, ne).
        status: status words, shape (runs, nt).
    """

    x0: np.ndarray
    u: np.ndarray
    y: np.ndarray
    r: np.ndarray
    estimate: np.ndarray
    status: np.ndarray


def golden(guarded: Guarded, x0: Any, u: Any, y: Any, r: Any, *, dtype: Any = float) -> Golden:
    """Run the guarded observer in one compiled scan, runs side by side.

    Args:
        guarded: observer.
        x0: first guesses, shape (runs, nx).
        u: inputs, shape (runs, nt, nu).
        y: outputs, shape (runs, nt, ny).
        r: scheduling signals, shape (runs, nt, nr).
        dtype: float64 or float32.

    Raises:
        BadInput: arrays that do not fit the signals.
    """
    s = guarded.signals
    start = np.asarray(x0, dtype)
    arrays = [np.asarray(a, dtype) for a in (u, y, r)]
    leading = arrays[1].shape[:2]
    for name, a, names in zip("uyr", arrays, (s.inputs, s.outputs, s.scheduling), strict=True):
        if a.shape != (*leading, len(names)) or len(leading) != 2:
            raise BadInput(f"`{name}` has shape {a.shape}; (runs, nt, {len(names)}) is needed.")
    if start.shape != (leading[0], len(s.states)):
        raise BadInput(f"`x0` has shape {start.shape}; {(leading[0], len(s.states))} is needed.")

    def one(state: Any, sample: Any) -> Any:
        following, estimate, raised = guarded.step(state, *sample)
        word = sum((jnp.where(flag, 1 << k, 0) for k, flag in enumerate(raised.values())), jnp.asarray(0))
        return following, (jnp.concatenate([jnp.ravel(leaf) for leaf in jax.tree.leaves(estimate)]), word)

    def run(first: Any, *signals: Any) -> Any:
        return jax.lax.scan(one, guarded.init(first), signals)[1]

    estimate, status = jax.jit(jax.vmap(run))(start, *arrays)
    return Golden(start, arrays[0], arrays[1], arrays[2], np.asarray(estimate), np.asarray(status))


def random_drive(
    guarded: Guarded, count: int, runs: int = 1, seed: int = 0
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return first guesses and signals that sweep the proved scheduling box and now and then leave it by a hundredth.

    Args:
        guarded: observer.
        count: number of samples of a run.
        runs: number of runs.
        seed: of the random numbers.
    """
    rng, s = np.random.default_rng(seed), guarded.signals
    u, y = (
        np.cumsum(rng.normal(size=(runs, count, len(names))) * 0.05, axis=1) / math.sqrt(max(count, 1))
        for names in (s.inputs, s.outputs)
    )
    ranges = np.array([*guarded.ranges, *[(0.0, 1.0)] * (len(s.scheduling) - len(guarded.ranges))]).reshape(-1, 2)
    low, high = ranges.T
    phase = rng.uniform(0, 2 * np.pi, size=(runs, 1, len(ranges))) + np.arange(count)[:, None] * (2 * np.pi / 97)
    r = 0.5 * (low + high) + 0.51 * (high - low) * np.sin(phase)
    return rng.normal(size=(runs, len(s.states))) * 0.05, u, y, r


def vectors_text(run: Golden) -> str:
    """Return vectors as text that C and Python read back exactly: hexadecimal floats, one sample a line.

    Args:
        run: vectors.
    """
    runs, count = run.status.shape
    sizes = [run.x0.shape[1], run.u.shape[2], run.y.shape[2], run.r.shape[2], run.estimate.shape[2]]
    lines = [" ".join(map(str, [runs, count, *sizes]))]
    for j in range(runs):
        lines.append(_hex(run.x0[j]))
        rows = np.concatenate([run.u[j], run.y[j], run.r[j], run.estimate[j]], axis=1)
        lines += [f"{_hex(row)} {int(word)}" for row, word in zip(rows, run.status[j], strict=True)]
    return "\n".join(lines) + "\n"


def replay_text(code: CCode, tolerance: float) -> str:
    """Return a C program that reads vectors, runs the observer and fails where it differs.

    Args:
        code: exported observer.
        tolerance: largest difference, relative to the largest value that the run has met (at least one): what a large value
            leaves behind when it fades is its rounding.
    """
    s, real, name = code.guarded.signals, code.precision, code.name
    sizes = [len(s.states), len(s.inputs), len(s.outputs), len(s.scheduling)]
    entries = sum(leaf.size for leaf in code.read.estimate)
    room = [max(1, n) for n in sizes]
    return f"""/* Replays golden vectors through {name}; exit status 0 where every sample agrees within {tolerance!r}. */
#include "{name}.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static int numbers(FILE *file, {real} *into, int count)
{{
    int k;
    for (k = 0; k < count; ++k) {{
        double value;
        if (fscanf(file, "%lf", &value) != 1) {{
            return 0;
        }}
        into[k] = ({real})value;
    }}
    return 1;
}}

int main(int argc, char **argv)
{{
    static {name}_state state;
    static {name}_estimate estimate;
    {real} x0[{room[0]}], u[{room[1]}], y[{room[2]}], r[{room[3]}], wanted[{max(entries, 1)}], found[{max(entries, 1)}];
    double worst = 0.0, peak;
    int runs, samples, run, k, j, sizes[5], bad = 0;
    FILE *file = fopen(argc > 1 ? argv[1] : "{name}_vectors.txt", "r");
    if (file == NULL || fscanf(file, "%d %d %d %d %d %d %d", &runs, &samples, &sizes[0], &sizes[1], &sizes[2], &sizes[3], &sizes[4]) != 7) {{
        fprintf(stderr, "cannot read the vectors\\n");
        return 2;
    }}
    if (sizes[0] != {sizes[0]} || sizes[1] != {sizes[1]} || sizes[2] != {sizes[2]} || sizes[3] != {sizes[3]} || sizes[4] != {entries}) {{
        fprintf(stderr, "the vectors belong to another observer\\n");
        return 2;
    }}
    if (sizeof(estimate) != sizeof(found)) {{
        return 2;
    }}
    for (run = 0; run < runs; ++run) {{
        if (!numbers(file, x0, {sizes[0]})) {{
            fprintf(stderr, "the vectors end at run %d\\n", run);
            return 2;
        }}
        {name}_init(&state, x0);
        peak = 1.0;
        for (k = 0; k < samples; ++k) {{
            unsigned status, expected;
            if (!numbers(file, u, {sizes[1]}) || !numbers(file, y, {sizes[2]}) || !numbers(file, r, {sizes[3]})
                || !numbers(file, wanted, {entries}) || fscanf(file, "%u", &expected) != 1) {{
                fprintf(stderr, "the vectors end at run %d, sample %d\\n", run, k);
                return 2;
            }}
            status = {name}_step(&state, u, y, r, &estimate);
            memcpy(found, &estimate, sizeof(found));
            bad += status != expected;
            for (j = 0; j < {entries}; ++j) {{
                const double b = fabs((double)wanted[j]);
                peak = b - b == 0.0 && b > peak ? b : peak;
            }}
            for (j = 0; j < {entries}; ++j) {{
                const double a = (double)found[j], b = (double)wanted[j];
                /* Not a number on both sides agrees; so do equal infinities. */
                if (a != b && !(a != a && b != b)) {{
                    const double gap = fabs(a - b) / peak;
                    worst = gap > worst || gap != gap ? gap : worst;
                    bad += !(gap <= {tolerance!r});
                }}
            }}
        }}
    }}
    fclose(file);
    printf("{name}: %d runs of %d samples, largest difference %.3g, %d disagreements\\n", runs, samples, worst, bad);
    return bad != 0;
}}
"""


def _hex(values: Any) -> str:
    return " ".join(float(v).hex() if math.isfinite(v) else str(float(v)) for v in np.ravel(values))
