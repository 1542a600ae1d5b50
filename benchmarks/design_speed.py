"""Design + certificate against the solver's own time, both measured in this run.

    python benchmarks/design_speed.py

The bar: total time at most twice the solver's own time plus 0.2 s, certificate at most 50 ms.
"""

import sys
import time
from pathlib import Path

from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from catalogue import robot, slip_angle_car
from luenberger.methods import Method, PolytopicLuenberger, StructuredLipschitz
from luenberger.synthesize import synthesize
from luenberger.systems import System

CASES: tuple[tuple[str, System, Method], ...] = (
    ("flexible joint, structured Lipschitz, decay 1", robot(), StructuredLipschitz(decay_rate=1.0)),
    ("flexible joint, Jacobian vertices, decay 1", robot("jacobian"), PolytopicLuenberger(decay_rate=1.0)),
    ("slip angle, LPV, decay 3", slip_angle_car(), PolytopicLuenberger(decay_rate=3.0)),
)


def main() -> None:
    """Print one row a case: best of five runs after one to warm up."""
    table = Table("case", "total [ms]", "solver [ms]", "bar [ms]", "certificate [ms]", "kept")
    for name, system, method in CASES:
        synthesize(system, method)
        runs = []
        for _ in range(5):
            start = time.perf_counter()
            design = synthesize(system, method)
            total = time.perf_counter() - start
            runs.append((total, design.statistics["solver_seconds"], design.statistics["certificate_seconds"]))
        total, solver, certificate = min(runs)
        bar = 2 * solver + 0.2
        kept = "yes" if total <= bar and certificate <= 0.05 else "no"
        table.add_row(name, *(f"{1e3 * x:.1f}" for x in (total, solver, bar, certificate)), kept)
    Console().print(table)


if __name__ == "__main__":
    main()
