"""A guarded step as a straight list of scalar operations with named inputs, outputs and constant tables."""

from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from luenberger.algebra.jaxpr import Trace, trace
from luenberger.export.guard import Guarded
from luenberger.export.signals import distinct


@dataclass(frozen=True)
class Table:
    """A constant array of the observer, e.g. its gain.

    Args:
        name: C identifier.
        values: entries in C order; zeros and infinities are left out of the arithmetic.
    """

    name: str
    values: tuple[float, ...]


@dataclass(frozen=True)
class Leaf:
    """An array of the state, of the inputs or of the estimate.

    Args:
        path: C access path, e.g. "observer" or "estimate_lower".
        shape: its shape.
    """

    path: str
    shape: tuple[int, ...]

    @property
    def size(self) -> int:
        """Number of scalars."""
        return int(np.prod(self.shape, dtype=int))


@dataclass(frozen=True)
class Program:
    """What the C writer needs.

    Args:
        step: trace of (tables, state, u, y, r) -> (state, estimate, flags).
        init: trace of (tables, x0) -> state.
        tables: constant arrays, in the order of the inputs of both traces.
        state: leaves of the state.
        estimate: leaves of the estimate.
        flags: names of the flags in the order of the bits.
    """

    step: Trace
    init: Trace
    tables: tuple[Table, ...]
    state: tuple[Leaf, ...]
    estimate: tuple[Leaf, ...]
    flags: tuple[str, ...]


def program(guarded: Guarded) -> Program:
    """Read a guarded observer.

    Args:
        guarded: what to export.

    Raises:
        BadInput: a primitive that scalars have no meaning for, named.
    """
    numbers, rest = eqx.partition(guarded.observer, eqx.is_inexact_array)
    leaves, tree = jax.tree.flatten(numbers)
    paths = [_identifier(path) for path, _ in jax.tree_util.tree_flatten_with_path(numbers)[0]]
    arrays = [np.asarray(leaf, dtype=float) for leaf in leaves]
    s = guarded.signals

    def whole(tables: Any) -> Guarded:
        # Zeros and infinities stay known, so that sparse gains and bounds that are none cost nothing.
        mixed = [jnp.where((a == 0.0) | ~np.isfinite(a), a, t) for a, t in zip(arrays, tables, strict=True)]
        observer = eqx.combine(jax.tree.unflatten(tree, mixed), rest)
        return eqx.tree_at(lambda g: g.observer, guarded, observer)

    def step(tables: Any, state: Any, u: Any, y: Any, r: Any) -> Any:
        following, estimate, raised = whole(tables).step(jax.tree.unflatten(state_tree, state), u, y, r)
        return jax.tree.leaves(following), jax.tree.leaves(estimate), list(raised.values())

    def init(tables: Any, x0: Any) -> Any:
        return jax.tree.leaves(whole(tables).init(x0))

    x0 = np.zeros(len(s.states))
    start = guarded.init(x0)
    state_tree = jax.tree.structure(start)
    signals = [np.zeros(len(names)) for names in (s.inputs, s.outputs, s.scheduling)]
    _, estimate, _ = jax.eval_shape(guarded.step, start, *signals)
    return Program(
        trace(step, arrays, [np.zeros(leaf.shape) for leaf in jax.tree.leaves(start)], *signals),
        trace(init, arrays, x0),
        tuple(Table(n, tuple(a.ravel().tolist())) for n, a in zip(distinct(paths), arrays, strict=True)),
        _leaves(start),
        _leaves(estimate),
        guarded.flags,
    )


def _leaves(tree: Any) -> tuple[Leaf, ...]:
    found = jax.tree_util.tree_flatten_with_path(tree)[0]
    names = distinct([_identifier(path) for path, _ in found])
    return tuple(Leaf(name, tuple(np.shape(leaf))) for name, (_, leaf) in zip(names, found, strict=True))


def _identifier(path: Any) -> str:
    """A C name for a place in a tree: the names of attributes, the numbers of entries."""
    words = []
    for key in path:
        word = getattr(key, "name", None) or getattr(key, "key", None)
        word = getattr(key, "idx", None) if word is None else word
        words.append("".join(c if c.isalnum() else "_" for c in str(word)).strip("_") or "entry")
    return "_".join(words) or "value"
