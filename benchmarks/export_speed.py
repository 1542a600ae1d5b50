"""Nanoseconds per step of exported C beside C written by hand for the same arithmetic, for two observers.

Run `python benchmarks/export_speed.py`; it needs a C compiler. Both sides are compiled with the same flags into one program each and
timed in turns, the least of several rounds; states and signals are fed back, so that no step can be left out or started early. The process
exits with 1 where a bar is missed: 100 ns for the observer of the flexible joint (Runge-Kutta, four states), 300 ns for the scheduled
slip-angle observer, and twice the hand-written loop for either. The hand-written code has neither flags nor guards.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from luenberger.experiment.published.flexible_joint import flexible_joint
from luenberger.export import Guarded, c_code
from luenberger.export.build import compiler
from luenberger.methods import PolytopicLuenberger, StructuredLipschitz
from luenberger.observers import CorrectionObserver
from luenberger.synthesize import synthesize
from luenberger.systems import System
from luenberger.vehicle import carmaker_car, slip_angle_plant

STEPS, ROUNDS = 2_000_000, 9
FLAGS = ["-std=c99", "-O2", "-march=native"]


def rows(name: str, matrix: np.ndarray) -> str:
    """A constant matrix in C."""
    inner = ", ".join("{" + ", ".join(repr(float(v)) for v in row) + "}" for row in np.atleast_2d(matrix))
    return f"static const double {name}[{matrix.shape[0]}][{matrix.shape[1]}] = {{{inner}}};"


def joint_by_hand(system: System, gain: np.ndarray, dt: float) -> str:
    """Runge-Kutta of A x + B u + F f(x) + L (y - C x) in loops over matrices."""
    at = {k: np.asarray(system.at(k)) for k in "ABC"}
    h = repr(dt)
    return "\n".join(
        [
            rows("A", at["A"]),
            rows("B", at["B"]),
            rows("L", gain),
            "static void slope(const double *x, double u, const double *y, double *d)",
            "{",
            "    const double e0 = y[0] - x[0], e1 = y[1] - x[1];",
            "    int i, j;",
            "    for (i = 0; i < 4; ++i) {",
            "        double s = B[i][0] * u + L[i][0] * e0 + L[i][1] * e1;",
            "        for (j = 0; j < 4; ++j) s += A[i][j] * x[j];",
            "        d[i] = s;",
            "    }",
            "    d[3] -= 3.33 * sin(x[2]);",
            "}",
            "static void hand_step(double *x, const double *u, const double *y, const double *r)",
            "{",
            "    double k1[4], k2[4], k3[4], k4[4], z[4];",
            "    int i;",
            "    (void)r;",
            "    slope(x, u[0], y, k1);",
            f"    for (i = 0; i < 4; ++i) z[i] = x[i] + k1[i] * ({h} / 2);",
            "    slope(z, u[0], y, k2);",
            f"    for (i = 0; i < 4; ++i) z[i] = x[i] + k2[i] * ({h} / 2);",
            "    slope(z, u[0], y, k3);",
            f"    for (i = 0; i < 4; ++i) z[i] = x[i] + k3[i] * {h};",
            "    slope(z, u[0], y, k4);",
            f"    for (i = 0; i < 4; ++i) x[i] += (k1[i] + k2[i] * 2 + k3[i] * 2 + k4[i]) * ({h} / 6);",
            "}",
        ]
    )


def slip_by_hand(observer: CorrectionObserver) -> str:
    """The same of a plant scheduled by s = 1/v and a: A = s K - s a I, gain L0 + s L1 + a L2 + s a L3, in as many parts."""
    system = observer.plant.value
    A = {e: np.asarray(c) for e, c in system.polynomial("A")}
    B = {e: np.asarray(c) for e, c in system.polynomial("B")}
    L = {e: np.asarray(c) for e, c in observer.gain.over(system.scheduling_names)}
    zero = np.zeros((2, 1))
    gains = [L.get(e, zero) for e in ((0, 0), (1, 0), (0, 1), (1, 1))]
    h = repr(observer.dt / observer.substeps)
    return "\n".join(
        [
            rows("A1", A[(1, 0)]),
            rows("A2", A[(1, 1)]),
            rows("B0", B[(0, 0)]),
            rows("B2", B[(1, 1)]),
            *(rows(f"L{k}", g) for k, g in enumerate(gains)),
            "static void slope(double M[2][2], const double *f, const double *x, double *d)",
            "{",
            "    d[0] = M[0][0] * x[0] + M[0][1] * x[1] + f[0];",
            "    d[1] = M[1][0] * x[0] + M[1][1] * x[1] + f[1];",
            "}",
            "static void hand_step(double *x, const double *u, const double *y, const double *r)",
            "{",
            "    const double s = r[0], sa = r[0] * r[1];",
            "    double M[2][2], f[2], k1[2], k2[2], k3[2], k4[2], z[2];",
            "    int i, j, part;",
            "    for (i = 0; i < 2; ++i) {",
            "        const double l = L0[i][0] + s * L1[i][0] + r[1] * L2[i][0] + sa * L3[i][0];",
            "        f[i] = l * y[0];",
            "        for (j = 0; j < 3; ++j) f[i] += (B0[i][j] + sa * B2[i][j]) * u[j];",
            "        for (j = 0; j < 2; ++j) M[i][j] = s * A1[i][j] + sa * A2[i][j];",
            "        M[i][0] -= l;",
            "        M[i][1] += l;",
            "    }",
            f"    for (part = 0; part < {observer.substeps}; ++part) {{",
            "        slope(M, f, x, k1);",
            f"        for (i = 0; i < 2; ++i) z[i] = x[i] + k1[i] * ({h} / 2);",
            "        slope(M, f, z, k2);",
            f"        for (i = 0; i < 2; ++i) z[i] = x[i] + k2[i] * ({h} / 2);",
            "        slope(M, f, z, k3);",
            f"        for (i = 0; i < 2; ++i) z[i] = x[i] + k3[i] * {h};",
            "        slope(M, f, z, k4);",
            f"        for (i = 0; i < 2; ++i) x[i] += (k1[i] + k2[i] * 2 + k3[i] * 2 + k4[i]) * ({h} / 6);",
            "    }",
            "}",
        ]
    )


def timed(guarded: Guarded, hand: str, folder: Path) -> tuple[float, float, float]:
    """Nanoseconds a step of exported and of hand-written code, and the largest difference of their states."""
    s = guarded.signals
    counts = [len(s.inputs), len(s.outputs), max(1, len(s.scheduling))]
    nx, ranges = len(s.states), guarded.ranges or ((0.0, 0.0),)
    move = "\n".join(
        f"        r[{k}] = {0.5 * (a + b)!r} + {0.4 * (b - a)!r} * x[0] / (1.0 + x[0] * x[0]);"
        for k, (a, b) in enumerate(ranges)
    )
    code = c_code(guarded, "made")
    (folder / "made.h").write_text(code.header)
    (folder / "made.c").write_text(code.source)
    shared = f"double u[{counts[0]}] = {{0}}, y[{counts[1]}] = {{0}}, r[{counts[2]}] = {{0}};"
    feed = f"        u[0] = 0.1 * x[{nx - 1}] + 0.01;\n        y[0] = 0.5 * x[0] + 0.02;\n{move}"
    body = f"""#include "made.h"
#include <math.h>
#include <stdio.h>
#include <time.h>
{hand}
static double now(void) {{ struct timespec t; clock_gettime(CLOCK_MONOTONIC, &t); return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec; }}
int main(void)
{{
    static made_state state;
    made_estimate estimate;
    double best[2] = {{1e9, 1e9}}, gap = 0.0, start[{nx}];
    unsigned seen = 0;
    int round, k, i;
    for (i = 0; i < {nx}; ++i) start[i] = 0.01 * (i + 1);
    for (round = 0; round < {ROUNDS}; ++round) {{
        double a[{nx}], b[{nx}], t;
        {{
            {shared}
            const double *x = state.observer;
            made_init(&state, start);
            t = now();
            for (k = 0; k < {STEPS}; ++k) {{
{feed}
                seen |= made_step(&state, u, y, r, &estimate);
            }}
            t = now() - t;
            best[0] = t < best[0] ? t : best[0];
            for (i = 0; i < {nx}; ++i) a[i] = state.observer[i];
        }}
        {{
            {shared}
            double x[{nx}];
            for (i = 0; i < {nx}; ++i) x[i] = start[i];
            t = now();
            for (k = 0; k < {STEPS}; ++k) {{
{feed}
                hand_step(x, u, y, r);
            }}
            t = now() - t;
            best[1] = t < best[1] ? t : best[1];
            for (i = 0; i < {nx}; ++i) b[i] = x[i];
        }}
        for (i = 0; i < {nx}; ++i) gap = fabs(a[i] - b[i]) > gap ? fabs(a[i] - b[i]) : gap;
    }}
    printf("%.17g %.17g %.17g %u\\n", best[0] / {STEPS} * 1e9, best[1] / {STEPS} * 1e9, gap, seen);
    return 0;
}}
"""
    (folder / "main.c").write_text(body)
    words = [str(compiler()), *FLAGS, "-D_POSIX_C_SOURCE=199309L", "main.c", "made.c", "-o", "race", "-lm"]
    subprocess.run(words, cwd=folder, check=True)
    shown = subprocess.run(["./race"], cwd=folder, capture_output=True, text=True, check=True).stdout.split()
    return float(shown[0]), float(shown[1]), float(shown[2])


def main() -> int:
    """Time both observers and print how they stand."""
    joint = flexible_joint("none")
    joint_design = synthesize(joint, StructuredLipschitz(decay_rate=1.0))
    car = slip_angle_plant(carmaker_car, (15 / 3.6, 150 / 3.6), (-8.0, 4.0))
    car_design = synthesize(car, PolytopicLuenberger(decay_rate=5.0))
    observers = [
        ("flexible joint", joint, joint_design.observer(0.001), 100.0),
        ("slip angles", car, car_design.observer(0.01), 300.0),
    ]
    table = Table("observer", "exported [ns]", "bar [ns]", "by hand [ns]", "ratio (bar 2)", "largest difference")
    missed = 0
    for name, system, observer, bar in observers:
        hand = (
            slip_by_hand(observer)
            if system is car
            else joint_by_hand(system, np.asarray(observer.gain({})), observer.dt)
        )
        with tempfile.TemporaryDirectory() as folder:
            made, plain, gap = timed(Guarded.of(observer, system), hand, Path(folder))
        table.add_row(name, f"{made:.1f}", f"{bar:.0f}", f"{plain:.1f}", f"{made / plain:.2f}", f"{gap:.1e}")
        missed += made > bar or made > 2 * plain or gap > 1e-9
    Console().print(table)
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
