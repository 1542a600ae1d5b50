"""Which solvers there are, in which order they are asked, and with what accuracy."""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import cvxpy as cp

from luenberger.core import BadInput

# Tried in this order; each answer is judged by its residual, never by the solver's own word.
SOLVERS: Mapping[str, Mapping[str, Any]] = {
    "CLARABEL": {"tol_gap_abs": 1e-10, "tol_gap_rel": 1e-10, "tol_feas": 1e-10},
    "CVXOPT": {"abstol": 1e-9, "reltol": 1e-9, "feastol": 1e-9},
    "SDPA": {"epsilonStar": 1e-9, "epsilonDash": 1e-9},
    "SCS": {"eps_abs": 1e-8, "eps_rel": 1e-8, "max_iters": 20000},
}
_INSTALLED: list[str] = []


def installed_solvers(wanted: Sequence[str] | None = None) -> list[str]:
    """Return the solvers to try, in order.

    Args:
        wanted: names; None for every installed one of `SOLVERS`.

    Raises:
        BadInput: an unknown or absent solver is named.
    """
    if not _INSTALLED:
        _INSTALLED.extend(s for s in SOLVERS if s in cp.installed_solvers())
    if wanted is None:
        return list(_INSTALLED)
    if absent := [s for s in wanted if s not in _INSTALLED]:
        raise BadInput(f"Solver {absent} is not available; installed: {_INSTALLED}.")
    return list(wanted)


@contextmanager
def silent(solver: str) -> Iterator[None]:
    """Keep machine-readable output clean: SDPA writes to the process's own standard output past every Python stream.

    Args:
        solver: who is about to run.
    """
    if solver != "SDPA":
        yield
        return
    kept = os.dup(1)
    with open(os.devnull, "w", encoding="utf-8") as nowhere:
        os.dup2(nowhere.fileno(), 1)
        try:
            yield
        finally:
            os.dup2(kept, 1)
            os.close(kept)
