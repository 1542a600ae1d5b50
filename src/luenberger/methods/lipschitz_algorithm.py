"""The published design procedure for Lipschitz observers as one call that reports brackets instead of grid indices."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from luenberger.core import BadInput, Infeasible
from luenberger.methods.lipschitz_bracket import EpsilonBracket, largest_epsilon
from luenberger.methods.lipschitz_disturbance import LipschitzDisturbance
from luenberger.methods.lipschitz_margin import margin_at
from luenberger.methods.lipschitz_plant import LumpedPlant, Transform, as_tuples, require_lipschitz
from luenberger.methods.lipschitz_riccati import LipschitzRiccati
from luenberger.methods.method import Candidate
from luenberger.systems import System

Methods = Mapping[str, LipschitzRiccati | LipschitzDisturbance]


@dataclass(frozen=True, eq=False)
class MarginTable:
    """Margins over a logarithmic grid of epsilon in one choice of coordinates.

    Args:
        transform: T as nested tuples, None for the states as they are.
        lipschitz: Lipschitz constant in these coordinates.
        epsilons: the grid, ascending.
        margins: largest tolerated Lipschitz constant at each epsilon, in floating point.
    """

    transform: tuple[Any, ...] | None
    lipschitz: float
    epsilons: np.ndarray
    margins: np.ndarray

    @property
    def feasible(self) -> int:
        """Number of leading grid points whose margin exceeds the Lipschitz constant (margins fall with epsilon)."""
        return int(np.count_nonzero(self.margins > self.lipschitz))


@dataclass(frozen=True, eq=False)
class AlgorithmReport:
    """What the procedure found.

    Args:
        tables: one for each choice of coordinates that was looked at; the last one is used.
        bracket: proved feasible and infeasible epsilon in the coordinates used.
        methods: the designs as options for `synthesize`, by name.
        designs: their gains, not yet rounded nor proved, by name.
    """

    tables: tuple[MarginTable, ...]
    bracket: EpsilonBracket
    methods: Methods
    designs: Mapping[str, Candidate]

    @property
    def transform(self) -> tuple[Any, ...] | None:
        """The coordinates used."""
        return self.tables[-1].transform


def lipschitz_algorithm(
    system: System,
    transforms: Sequence[Transform] = (None,),
    *,
    epsilon: float | None = None,
    delta: float = 0.2,
    decades: float = 1.0,
    points: int = 20,
) -> AlgorithmReport:
    """Run the four-step design procedure: margins over epsilon, coordinates, gain, gain against a disturbance.

    Choose it to see the whole range of Riccati-form designs of a plant in one call. The largest epsilon is not read off
    the grid but bracketed by a proof on either side; the grid is there to be looked at.

    Assumes: e' = (A - L C) e + phi + E d, |T phi| <= g |T e| for all states.
    Certifies: the bracket; the designs are proved by `synthesize(system, report.methods[name])`.

    Args:
        system: continuous Lipschitz plant with constant matrices.
        transforms: coordinates to try in this order; the first that admits the Lipschitz constant is used.
        epsilon: inverse output weight of the designs; default a tenth of the largest proved feasible one.
        delta: weight of kappa^2 against lmin(P), used where the plant has an unknown input.
        decades: the grid spans 10^-decades to 10^decades.
        points: grid points, at least 2.

    Returns:
        tables, proved bracket of epsilon, methods and gains.

    Raises:
        NotAccepted: the plant lies outside the theorem.
        BadInput: no transform, too few points, or an epsilon above the bracket.
        Infeasible: no coordinates admit the Lipschitz constant at any epsilon.

    Reference: B. Song, J. K. Hedrick, ACC 2011, Algorithm 1. Its test alpha >= gamma must be strict; the largest epsilon is
    bracketed here because the printed grid index is off by one.

    Example:
        >>> import jax.numpy as jnp
        >>> import luenberger as lb
        >>> from luenberger.methods.lipschitz_algorithm import lipschitz_algorithm
        >>> sine = lb.Nonlinearity.bounded(lambda z, u: -3 * jnp.sin(z), [[1, 0]], lipschitz=3.0)
        >>> pendulum = lb.System.nonlinear([[0, 1], [0, -0.1]], C=[[1, 0]], F=[[0], [1]], nonlinearity=sine)
        >>> report = lipschitz_algorithm(pendulum, [None, (1.0, 0.3)])
        >>> report.transform, report.bracket.feasible < report.bracket.infeasible
        ((1.0, 0.3), True)
    """
    require_lipschitz(system)
    if not transforms or points < 2 or not decades > 0:
        raise BadInput(
            f"{len(transforms)} transforms, {points} points and {decades} decades are given; >= 1, >= 2 and > 0 are needed."
        )
    tables: list[MarginTable] = []
    bracket = None
    for transform in transforms:
        tables.append(_table(system, transform, np.logspace(-decades, decades, points)))
        if (bracket := _bracket(system, transform)) is not None:
            break
    if bracket is None:
        best = ", ".join(f"{t.margins.max():.4g} of {t.lipschitz:.4g}" for t in tables)
        raise Infeasible(
            f"None of the {len(tables)} coordinates admits the Lipschitz constant (best margin on the grid: {best}). Give a `transform` that "
            "shrinks the states where the nonlinearity acts, or use `StructuredLipschitz`, which needs no coordinates.",
            "stability",
        )
    used = bracket.feasible / 10 if epsilon is None else epsilon
    if not 0 < used <= bracket.feasible:
        raise BadInput(
            f"`epsilon` is {used}; these coordinates are proved feasible for 0 < epsilon <= {bracket.feasible:.6g}. Choose inside."
        )
    methods: dict[str, LipschitzRiccati | LipschitzDisturbance] = {
        "riccati": LipschitzRiccati(used, tables[-1].transform)
    }
    if system.nd:
        methods["disturbance"] = LipschitzDisturbance(used, delta, tables[-1].transform)
    for method in methods.values():
        method.accept(system)
    return AlgorithmReport(tuple(tables), bracket, methods, {name: m.design(system) for name, m in methods.items()})


def _table(system: System, transform: Transform, epsilons: np.ndarray) -> MarginTable:
    margins = np.array([margin_at(system, float(e), transform) for e in epsilons])
    return MarginTable(as_tuples(transform), LumpedPlant.of(system, transform).lipschitz, epsilons, margins)


def _bracket(system: System, transform: Transform) -> EpsilonBracket | None:
    try:
        return largest_epsilon(system, None, transform)
    except Infeasible:
        return None
