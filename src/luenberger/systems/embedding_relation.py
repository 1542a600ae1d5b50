"""Exact affine relations between scalars that were read from a JAX function, e.g. between the entries of a Jacobian.

Every operation is written as a polynomial of inputs and *atoms* (sines, roots, branches, ...) with rational coefficients.
Equal polynomials are equal functions wherever they are defined; unequal ones may be equal all the same, so a relation
may be missed but never invented.
"""

# pyright: reportUnknownMemberType=false, reportUnknownArgumentType=false
from collections.abc import Mapping, Sequence
from typing import Any

from flint import fmpq, fmpq_mat

from luenberger.algebra.endpoint import OutsideDomain, rational
from luenberger.algebra.graph import Operation

# Monomial -> coefficient; a monomial is a sorted tuple of inputs and atoms, the empty one stands for the constant.
Form = Mapping[tuple[int, ...], fmpq]

_TERMS = 200
_POWER = 6
_CONSTANT: frozenset[tuple[int, ...]] = frozenset({()})
_ZERO, _UNIT = fmpq(0), fmpq(1)


def polynomial_forms(operations: Sequence[Operation]) -> list[Form]:
    """Return every operation as a polynomial of inputs and atoms, no zero coefficients.

    Args:
        operations: in order.
    """
    forms: list[Form] = []
    atoms: dict[Any, int] = {}
    for k, operation in enumerate(operations):
        given = [forms[j] for j in operation.operands]
        form = _expanded(operation, given)
        if form is None:
            # A branch is b + [question] (a - b), whatever an undefined side is taken for where it is not chosen.
            sides = _sum(given[1], given[2], -1) if operation.name == "select" else {}
            branch = operation.name == "select" and len(sides) <= _TERMS
            # Atoms of equal operands are one.
            what = (operation.name, branch, tuple(frozenset(f.items()) for f in (given[:1] if branch else given)))
            atom: Form = {(atoms.setdefault((*what, operation.static), k),): _UNIT}
            form = _sum(given[2], _product(atom, sides), 1) if branch else atom
        forms.append({key: c for key, c in form.items() if c != 0})
    return forms


def independent(rows: Sequence[Form]) -> tuple[list[int], dict[int, list[fmpq]]]:
    """Choose rows of which all others are exact affine combinations.

    Args:
        rows: polynomials.

    Returns:
        the chosen rows, and for every other row the weights of the chosen ones followed by a constant.
    """
    keys = sorted({key for row in rows for key in row} - _CONSTANT)
    chosen: list[int] = []
    followers: dict[int, list[fmpq]] = {}
    for k, row in enumerate(rows):
        weights = _combination([rows[c] for c in chosen], row, keys)
        if weights is None:
            chosen.append(k)
            continue
        constant = row.get((), _ZERO)
        for w, c in zip(weights, chosen, strict=True):
            constant = constant - w * rows[c].get((), _ZERO)
        followers[k] = [*weights, constant]
    # Rows chosen after a follower have no part in it.
    full = {k: [*w[:-1], *[_ZERO] * (len(chosen) + 1 - len(w)), w[-1]] for k, w in followers.items()}
    return chosen, full


def _expanded(operation: Operation, given: list[Form]) -> Form | None:
    """The operation as a polynomial of its operands' polynomials; None where it is an atom."""
    name, static = operation.name, operation.static
    if name == "constant":
        try:
            return {(): rational(float(static[0]))}
        except OutsideDomain:
            return None
    if name in ("add", "sub"):
        return _sum(given[0], given[1], 1 if name == "add" else -1)
    if name == "neg":
        return {key: -c for key, c in given[0].items()}
    if name == "mul":
        return _product(given[0], given[1]) if len(given[0]) * len(given[1]) <= _TERMS else None
    if name == "div" and set(given[1]) == _CONSTANT:
        return {key: c / given[1][()] for key, c in given[0].items()}
    power = 2 if name == "square" else int(static[0]) if name == "integer_pow" else 0
    if not 0 < power <= _POWER or len(given[0]) ** power > _TERMS:
        return None
    total = given[0]
    for _ in range(power - 1):
        total = _product(total, given[0])
    return total


def _sum(left: Form, right: Form, sign: int) -> Form:
    total = dict(left)
    for key, c in right.items():
        total[key] = total.get(key, _ZERO) + sign * c
    return total


def _product(left: Form, right: Form) -> Form:
    total: dict[tuple[int, ...], fmpq] = {}
    for a, x in left.items():
        for b, y in right.items():
            key = tuple(sorted(a + b))
            total[key] = total.get(key, _ZERO) + x * y
    return total


def _combination(basis: list[Form], row: Form, keys: list[tuple[int, ...]]) -> list[fmpq] | None:
    """Weights with which independent rows add up to a row, constants left out; None where they do not."""
    if not any(key in row for key in keys):
        return [_ZERO] * len(basis)
    if not basis:
        return None
    columns = [[form.get(key, _ZERO) for form in basis] + [row.get(key, _ZERO)] for key in keys]
    reduced, rank = fmpq_mat(len(keys), len(basis) + 1, [x for line in columns for x in line]).rref()
    # The basis has full column rank, so its columns reduce to unit vectors.
    return None if rank > len(basis) else [reduced[k, len(basis)] for k in range(len(basis))]
