"""Splits a JAX function into a linear part and channels that are really nonlinear, from its list of scalar operations.

Every operation is an affine form of inputs and *atoms*, an atom being an operation that is not affine in its operands
(a sine, a product of two signals). What a row of f contains besides inputs and constants is then a sum of atoms with
known coefficients: constancy is read off, not sampled. Coefficients are products of doubles, rounded as JAX rounds them.
"""

# pyright: reportUnknownMemberType=false, reportUnknownArgumentType=false, reportUnknownLambdaType=false
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from luenberger.algebra.graph import Operation, pruned, run
from luenberger.algebra.jaxpr import Trace

Channels = Literal["least", "rows", "terms"]
# Key -> coefficient; a key is the place of an input or atom, ONE the constant.
Form = dict[int, Any]
ONE = -1


class JaxArithmetic:
    """JAX scalars, so that part of a function that was read can run on its own."""

    def __init__(self) -> None:
        self.functions: Mapping[str, Callable[..., Any]] = {
            **{name: getattr(jnp, name) for name in ("abs", "sign", "square", "sqrt", "cbrt", "exp", "exp2", "expm1")},
            **{name: getattr(jnp, name) for name in ("log", "log1p", "sin", "cos", "tan", "sinh", "cosh", "tanh")},
            **{
                f"a{name}": getattr(jnp, f"arc{name}") for name in ("sin", "cos", "tan", "tan2", "sinh", "cosh", "tanh")
            },
            **{name: getattr(lax, name) for name in ("rsqrt", "logistic", "erf")},
            **{"floor": jnp.floor, "ceil": jnp.ceil, "rem": jnp.fmod, "max": jnp.maximum, "min": jnp.minimum},
            **{"add": jnp.add, "sub": jnp.subtract, "mul": jnp.multiply, "div": jnp.divide, "neg": jnp.negative},
            **{"pow": jnp.power, "integer_pow": lambda x, exponent: x**exponent},
            **{"eq": jnp.equal, "ne": jnp.not_equal, "lt": jnp.less, "le": jnp.less_equal, "gt": jnp.greater},
            **{"ge": jnp.greater_equal, "is_finite": jnp.isfinite, "is_nan": jnp.isnan, "and": jnp.logical_and},
            **{"or": jnp.logical_or, "xor": jnp.logical_xor, "not": jnp.logical_not},
        }

    def constant(self, value: float) -> float:
        """Return the number itself, which takes the precision of what it meets."""
        return value

    def select(self, predicate: Any, when_true: Any, when_false: Any) -> Any:
        """Return the chosen value."""
        return jnp.where(predicate, when_true, when_false)


JAX = JaxArithmetic()


@dataclass(frozen=True, eq=False)
class AffineSplit:
    """f(x, u) = A x + B u + c + (sum of atoms), row by row.

    Args:
        operations: of f; inputs x, then u, come first.
        A: coefficients of the states, shape (n, nx).
        B: coefficients of the inputs, shape (n, nu).
        c: constants, shape (n,).
        atoms: places of the atoms that some row contains.
        weights: coefficients of the atoms, shape (n, number of atoms).
        forms: every operation as an affine form of inputs and atoms.
    """

    operations: tuple[Operation, ...]
    A: np.ndarray
    B: np.ndarray
    c: np.ndarray
    atoms: tuple[int, ...]
    weights: np.ndarray
    forms: list[Form]

    @staticmethod
    def of(function: Trace, nx: int) -> "AffineSplit":
        """Split a function that was read for one vector of nx states and, where there are more inputs, u.

        Args:
            function: with one vector as its result.
            nx: number of states.
        """
        forms = affine_forms(function.operations)
        inputs = [k for k, operation in enumerate(function.operations) if operation.name == "input"]
        rows = [forms[k] for k in function.outputs[0].flat]
        atoms = tuple(sorted({key for row in rows for key in row} - {ONE, *inputs}))

        def picked(keys: Sequence[int]) -> np.ndarray:
            return np.array([[row.get(key, 0.0) for key in keys] for row in rows]).reshape(len(rows), len(keys))

        whole = picked(inputs)
        parts = whole[:, :nx], whole[:, nx:], picked([ONE])[:, 0]
        return AffineSplit(function.operations, *parts, atoms, picked(atoms), forms)

    def channels(self, choice: Channels) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return F (n, nf), atom weights (nf, number of atoms) and constants (nf,) with F (weights atoms + constants) the rest.

        Args:
            choice: "rows" gives every row its channel; "terms" gives one to all atoms whose columns of `weights` are
                multiples of each other; "least" takes whichever has fewer pairs (channel, argument), rows where equal.
        """
        rows, terms = self._by_rows(), self._by_terms()
        if choice == "least":
            counts = [min(self._pairs(weights)) for _, weights in (rows, terms)]
            choice = "terms" if counts[1] < counts[0] else "rows"
        F, weights = terms if choice == "terms" else rows
        constants = np.zeros(F.shape[1])
        for i in np.flatnonzero(self.c):
            unit = np.eye(len(self.c))[:, i]
            place = np.flatnonzero((unit[:, None] == F).all(axis=0))
            if not place.size:
                F, weights = np.column_stack([F, unit]), np.vstack([weights, np.zeros(len(self.atoms))])
                constants, place = np.append(constants, 0.0), np.array([F.shape[1] - 1])
            constants[place[0]] = self.c[i]
        return F, weights, constants

    def _by_rows(self) -> tuple[np.ndarray, np.ndarray]:
        rows = np.flatnonzero(self.weights.any(axis=1))
        return np.eye(len(self.c))[:, rows], self.weights[rows]

    def _by_terms(self) -> tuple[np.ndarray, np.ndarray]:
        columns: list[np.ndarray] = []
        weights: list[np.ndarray] = []
        for place, column in enumerate(self.weights.T):
            alone = np.count_nonzero(column) == 1
            direction = (column != 0).astype(float) if alone else column
            factor = float(column.sum()) if alone else 1.0
            same = [k for k, c in enumerate(columns) if (c == direction).all()]
            if not same:
                columns.append(direction)
                weights.append(np.zeros(len(self.atoms)))
            weights[same[0] if same else -1][place] = factor
        shape = (len(columns), len(self.c)), (len(columns), len(self.atoms))
        return np.array(columns).reshape(shape[0]).T, np.array(weights).reshape(shape[1])

    def arguments(self, weights: np.ndarray) -> np.ndarray:
        """Return H, shape (nz, nx), nz >= 1: what of the state the channels read.

        The states themselves, or the sums of states of which all atoms are functions where these make fewer pairs
        (channel, argument): a tyre force reads one slip angle, whatever states that is made of.

        Args:
            weights: atom weights of channels, shape (nf, number of atoms).
        """
        by_states, by_sums = self._pairs(weights)
        if by_sums < by_states:
            return np.array(self._sums(np.flatnonzero(weights.any(axis=0))))
        return np.eye(self.A.shape[1])[self._states(np.flatnonzero(weights.any(axis=0))) or [0]]

    def _pairs(self, weights: np.ndarray) -> tuple[int, int]:
        """Number of pairs (channel, state) and (channel, sum of states)."""
        used = [np.flatnonzero(row) for row in weights]
        return sum(len(self._states(a)) for a in used), sum(len(self._sums(a)) for a in used)

    def _states(self, used: np.ndarray) -> list[int]:
        reads, nx = ancestors(self.operations), self.A.shape[1]
        return sorted({s for a in used for s in reads[self.atoms[a]] if s < nx})

    def _sums(self, used: np.ndarray) -> list[np.ndarray]:
        """Directions of the affine operations at which the given atoms begin, parallel ones once."""
        found: list[np.ndarray] = []
        for node in self._frontier(used):
            direction = self._direction(node)
            if not any(np.allclose(direction, d, rtol=1e-13, atol=1e-15) for d in found):
                found.append(direction)
        return found

    def _direction(self, node: int) -> np.ndarray:
        """The state part of an affine operation, its largest entry one."""
        row = np.array([self.forms[node].get(s, 0.0) for s in range(self.A.shape[1])])
        return row / row[np.argmax(abs(row))]

    def _frontier(self, used: np.ndarray) -> list[int]:
        """Affine operations that read a state and feed an operation that is not affine, below the given atoms."""
        count = self.A.shape[1] + self.B.shape[1]
        open_nodes, seen, found = [self.atoms[a] for a in used], set[int](), set[int]()
        while open_nodes:
            for node in self.operations[open_nodes.pop()].operands:
                if node in seen:
                    continue
                seen.add(node)
                keys = set(self.forms[node]) - {ONE}
                if not all(key < count for key in keys):
                    open_nodes.append(node)
                elif any(key < self.A.shape[1] for key in keys):
                    found.add(node)
        return sorted(found)

    def function(
        self, weights: np.ndarray, constants: np.ndarray, H: np.ndarray, fixed: np.ndarray, linear: np.ndarray
    ) -> Callable[[Any, Any], jax.Array]:
        """Return phi: (z, u) -> weights atoms + constants - linear z, z = H x, as a JAX function.

        Args:
            weights: shape (nf, number of atoms).
            constants: shape (nf,).
            H: from `arguments`, shape (nz, nx).
            fixed: value of the states that z leaves out, (nx,).
            linear: shape (nf, nz).
        """
        used = np.flatnonzero(weights.any(axis=0))
        nx, nu = self.A.shape[1], self.B.shape[1]
        replaced = list(self.operations)
        given: dict[int, _Sum] = {s: _Sum(None, 1.0, {}, float(fixed[s])) for s in range(nx)}
        single = bool(((H != 0).sum(axis=1) == 1).all())
        for node in [int(np.argmax(row)) for row in H] if single else self._frontier(used):
            replaced[node] = Operation("input", (), (node,))
            given[node] = self._sum_at(node, H)
        operations, wanted = pruned(replaced, [self.atoms[a] for a in used])
        given |= {nx + k: _Sum(None, 0.0, {k: 1.0}, 0.0) for k in range(nu)}
        order = [given[k] for k, operation in enumerate(replaced) if operation.name == "input"]
        needed = {s for found in (ancestors(operations)[k] for k in wanted) for s in found}
        order = [entry if k in needed else _Sum(None, 0.0, {}, 0.0) for k, entry in enumerate(order)]

        def phi(z: Any, u: Any) -> jax.Array:
            values = run(operations, [entry.at(z, u) for entry in order], JAX)
            rows: list[Any] = []
            for k in range(len(constants)):
                terms = [_times(weights[k, a], values[place]) for a, place in zip(used, wanted, strict=True)]
                terms += [_times(-linear[k, j], z[j]) for j in range(len(H))]
                kept = [t for t in terms if t is not None]
                if constants[k] or not kept:
                    # Something of the argument's type, so that a constant channel has it too.
                    kept.insert(0, 0.0 * z[0] + float(constants[k]))
                rows.append(reduce(add, kept))
            return jnp.stack([jnp.asarray(row, dtype=jnp.result_type(z[0])) for row in rows])

        return phi

    def _sum_at(self, node: int, H: np.ndarray) -> "_Sum":
        """An affine operation in terms of z = H x, u and a constant."""
        form, nx = self.forms[node], self.A.shape[1]
        direction = self._direction(node)
        entry = int(np.argmin(abs(H - direction).max(axis=1)))
        lead = int(np.argmax(abs(direction)))
        inputs = {key - nx: float(c) for key, c in form.items() if key >= nx}
        return _Sum(entry, float(form[lead]), inputs, float(form.get(ONE, 0.0)))


@dataclass(frozen=True)
class _Sum:
    """factor z[entry] + weights u + constant; without the first term where `entry` is None."""

    entry: int | None
    factor: float
    inputs: dict[int, float]
    constant: float

    def at(self, z: Any, u: Any) -> Any:
        terms = [] if self.entry is None else [_times(self.factor, z[self.entry])]
        terms += [_times(c, u[k]) for k, c in self.inputs.items()]
        return reduce(add, [*terms, self.constant] if self.constant or not terms else terms)


def ancestors(operations: Sequence[Operation]) -> list[frozenset[int]]:
    """Return for every operation the numbers of the inputs that it depends on.

    Args:
        operations: in order.
    """
    found: list[frozenset[int]] = []
    count = 0
    for operation in operations:
        if operation.name == "input":
            found.append(frozenset((count,)))
            count += 1
        else:
            found.append(frozenset[int]().union(*(found[k] for k in operation.operands)))
    return found


def _times(factor: float, value: Any) -> Any:
    return None if factor == 0 else value if factor == 1 else float(factor) * value


def affine_forms(operations: Sequence[Operation], lift: Callable[[float], Any] = float) -> list[Form]:
    """Return every operation as an affine form of inputs and atoms: key -> coefficient, no zeros.

    Args:
        operations: in order.
        lift: turns a constant into the arithmetic of the coefficients; `rational` keeps them exact.
    """
    forms: list[Form] = []
    for k, (name, operands, static) in enumerate(operations):
        given = [forms[j] for j in operands]
        form: Form | None = None
        if name == "constant":
            form = {ONE: lift(float(static[0]))}
        elif name in ("add", "sub"):
            form = _sum(given[0], given[1], 1 if name == "add" else -1)
        elif name == "neg":
            form = {key: -c for key, c in given[0].items()}
        elif name == "mul" and (known := [f for f in given if set(f) <= {ONE}]):
            other = given[1] if known[0] is given[0] else given[0]
            form = {key: c * known[0].get(ONE, 0) for key, c in other.items()}
        elif name == "div" and set(given[1]) == {ONE}:
            form = {key: c / given[1][ONE] for key, c in given[0].items()}
        forms.append({k: lift(1.0)} if form is None else {key: c for key, c in form.items() if c != 0})
    return forms


def _sum(left: Form, right: Form, sign: int) -> Form:
    total = dict(left)
    for key, c in right.items():
        total[key] = total.get(key, 0) + sign * c
    return total
