"""The published two-mass table: bound, number of inequalities, and time against the solver's own.

python benchmarks/relaxations.py
"""

import time

import numpy as np
from rich.console import Console
from rich.table import Table

from luenberger.experiment.published.two_mass import PRINTED, bounded_real, gridded_norm
from luenberger.lmi import solve
from luenberger.lmi.problem import expand


def main() -> None:
    """Print one row a degree of the storage matrix."""
    table = Table("degree of P", "printed", "ours", "inequalities", "total [s]", "solver [s]")
    for degree, printed in enumerate(PRINTED):
        start = time.perf_counter()
        problem = bounded_real(degree)
        found = solve(problem)
        total = time.perf_counter() - start
        count = sum(map(len, expand(problem).values()))
        ours, own = (
            ("none", "-") if found is None else (f"{np.sqrt(found.objective):.5f}", f"{found.solver_seconds:.3f}")
        )
        table.add_row(str(degree), f"{printed:.4f}", ours, str(count), f"{total:.2f}", own)
    Console().print(table)
    Console().print(f"truth on a grid of parameters and frequencies: {gridded_norm():.5f}")


if __name__ == "__main__":
    main()
