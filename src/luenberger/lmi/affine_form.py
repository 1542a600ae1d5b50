"""Numeric form of affine cvxpy expressions: constant plus one array for each variable.

A relaxation combines the coefficients of one inequality hundreds of times. On expression trees that costs far more than
the solver; on arrays it costs nothing. The walk knows the atoms that matrix polynomials are made of and asks cvxpy's own
gradient for any other affine atom.
"""

from collections.abc import Sequence
from typing import Any

import cvxpy as cp
import numpy as np
from cvxpy.atoms.affine.add_expr import AddExpression
from cvxpy.atoms.affine.binary_operators import MulExpression, multiply
from cvxpy.atoms.affine.reshape import reshape
from cvxpy.atoms.affine.trace import Trace
from cvxpy.atoms.affine.transpose import transpose
from cvxpy.atoms.affine.unary_operators import NegExpression

from luenberger.core import BadInput

Form = tuple[np.ndarray, dict[int, np.ndarray]]  # constant (n, m); variable id -> (size, n, m)
# The expression stands beside its form: one that is gone gives its identity to the next.
Memo = dict[int, tuple[Any, Form]]


def stacked(expression: Any, variables: Sequence[cp.Variable], memo: Memo) -> np.ndarray:
    """Return K with  vec(expression) = K @ [x; 1],  rows in C order, x the variables' entries (Fortran order) stacked.

    Args:
        expression: affine cvxpy expression or array, shape (n, m).
        variables: all variables of the problem, in order.
        memo: forms of shared sub-expressions, by identity; one mapping a problem.

    Raises:
        BadInput: not affine, or a variable that the problem does not list.
    """
    constant, slopes = _form(expression, memo)
    if foreign := set(slopes) - {v.id for v in variables}:
        raise BadInput(
            f"The inequality uses {len(foreign)} variable(s) that `Problem.variables` does not list; add them."
        )
    size = constant.size
    columns = [slopes[v.id].reshape(v.size, size).T if v.id in slopes else np.zeros((size, v.size)) for v in variables]
    return np.hstack([*columns, constant.reshape(size, 1)])


def _form(expression: Any, memo: Memo) -> Form:
    if not isinstance(expression, cp.Expression):
        return np.atleast_2d(np.asarray(expression, dtype=float)), {}
    if id(expression) not in memo:
        memo[id(expression)] = (expression, _walk(expression, memo))
    return memo[id(expression)][1]


def _walk(expression: Any, memo: Memo) -> Form:
    shape = _two(expression.shape)
    if isinstance(expression, cp.Variable):
        basis = np.eye(expression.size).reshape(expression.size, *reversed(shape)).transpose(0, 2, 1)
        return np.zeros(shape), {expression.id: basis}
    if expression.is_constant():
        value = expression.value
        return np.atleast_2d(np.asarray(value.toarray() if hasattr(value, "toarray") else value, dtype=float)).reshape(
            shape
        ), {}
    if isinstance(expression, AddExpression):
        total: Form = (np.zeros(shape), {})
        for part in expression.args:
            total = _sum(total, _form(part, memo), shape)
        return total
    if isinstance(expression, NegExpression):
        return _apply(_form(expression.args[0], memo), lambda a: -a)
    if isinstance(expression, transpose) and len(expression.shape) == 2:
        return _apply(_form(expression.args[0], memo), lambda a: np.swapaxes(a, -1, -2))
    if isinstance(expression, reshape):
        order = expression.order
        return _apply(_form(expression.args[0], memo), lambda a: _reshaped(a, shape, order))
    if isinstance(expression, Trace):
        return _apply(_form(expression.args[0], memo), lambda a: np.trace(a, axis1=-2, axis2=-1)[..., None, None])
    # cvxpy derives the elementwise product from the matrix product, so it must be asked for first.
    if isinstance(expression, multiply):
        left, right = (_form(a, memo) for a in expression.args)
        return _apply(right, lambda a: left[0] * a) if not left[1] else _apply(left, lambda a: a * right[0])
    if isinstance(expression, MulExpression) and all(a.ndim == 2 for a in expression.args):
        left, right = (_form(a, memo) for a in expression.args)
        if not left[1]:
            return _apply(right, lambda a: left[0] @ a)
        return _apply(left, lambda a: a @ right[0])
    return _by_gradient(expression, shape)


def _by_gradient(expression: Any, shape: tuple[int, int]) -> Form:
    if not expression.is_affine():
        raise BadInput(
            f"`{expression}` is not affine in the decision variables; a matrix inequality needs affine entries."
        )
    for variable in expression.variables():
        variable.save_value(np.zeros(variable.shape))
    constant = np.asarray(expression.value, dtype=float).reshape(shape)
    # The gradient of a scalar in a scalar comes as a plain number.
    gradient = {
        v.id: np.atleast_2d(np.asarray(g.toarray() if hasattr(g, "toarray") else g)) for v, g in expression.grad.items()
    }
    slopes = {v: g.reshape(g.shape[0], *reversed(shape)).transpose(0, 2, 1) for v, g in gradient.items()}
    return constant, slopes


def _apply(form: Form, function: Any) -> Form:
    return function(form[0]), {v: function(a) for v, a in form[1].items()}


def _sum(left: Form, right: Form, shape: tuple[int, int]) -> Form:
    slopes = dict(left[1])
    for variable, array in right[1].items():
        wide = np.broadcast_to(array, (array.shape[0], *shape))
        slopes[variable] = slopes[variable] + wide if variable in slopes else wide
    return left[0] + right[0], slopes


def _reshaped(array: np.ndarray, shape: tuple[int, int], order: str) -> np.ndarray:
    if order == "C":
        return array.reshape(*array.shape[:-2], *shape)
    turned = np.swapaxes(array, -1, -2).reshape(*array.shape[:-2], *reversed(shape))
    return np.swapaxes(turned, -1, -2)


def _two(shape: tuple[int, ...]) -> tuple[int, int]:
    return (1, 1) if not shape else (1, shape[0]) if len(shape) == 1 else (shape[0], shape[1])
