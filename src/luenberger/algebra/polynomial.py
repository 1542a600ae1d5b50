"""Matrix polynomials over named parameters, with coefficients of any arithmetic.

A coefficient is a 2-D NumPy array of floats, a 2-D object array (exact rationals, balls), a JAX array, or a cvxpy
expression. One theorem written over `Polynomial` therefore serves design (cvxpy), proof (rationals, balls) and running
code (JAX) alike.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import lru_cache
from itertools import product
from typing import Any

import jax
import numpy as np
from flint import fmpq

from luenberger.core import BadInput

Exponents = tuple[int, ...]
Box = Mapping[str, tuple[Any, Any]]


class Polynomial:
    """A matrix that depends polynomially on named parameters.

    Args:
        names: parameter names; the exponents below follow their order.
        terms: exponent tuple -> coefficient, all coefficients of one shape (rows, columns).

    Raises:
        BadInput: no term, a name given twice, exponents of the wrong length or negative, coefficients of different shape.
    """

    # NumPy arrays on the left hand side must leave the operation to us.
    __array_ufunc__ = None

    def __init__(self, names: Sequence[str], terms: Mapping[Exponents, Any]):
        if not terms:
            raise BadInput("A matrix polynomial needs at least one term; give the zero matrix for a zero polynomial.")
        self.names = tuple(names)
        self.terms: dict[Exponents, Any] = {e: _matrix(c) for e, c in terms.items()}
        shapes = {tuple(c.shape) for c in self.terms.values()}
        if len(shapes) != 1 or len(next(iter(shapes))) != 2:
            raise BadInput(f"Coefficients have shapes {sorted(shapes)}; all need one shape (rows, columns).")
        if len(set(self.names)) != len(self.names):
            raise BadInput(f"Parameters {self.names} repeat a name; give each its own.")
        if any(len(e) != len(self.names) or min(e, default=0) < 0 for e in self.terms):
            raise BadInput(f"Every exponent tuple needs {len(self.names)} entries >= 0, one for each of {self.names}.")
        self.shape: tuple[int, int] = next(iter(shapes))

    @staticmethod
    def constant(coefficient: Any) -> "Polynomial":
        """Lift a matrix of any arithmetic (a decision variable, say) to a polynomial of degree zero."""
        if isinstance(coefficient, Polynomial):
            return coefficient
        return Polynomial((), {(): coefficient})

    @staticmethod
    def affine(constant: Any, **slopes: Any) -> "Polynomial":
        """Return constant + sum of parameter times slope, e.g. ``affine(A0, speed=A1)``."""
        names = tuple(slopes)
        terms: dict[Exponents, Any] = {(0,) * len(names): constant}
        for k, name in enumerate(names):
            terms[tuple(int(j == k) for j in range(len(names)))] = slopes[name]
        return Polynomial(names, terms)

    @property
    def T(self) -> "Polynomial":
        """The transpose."""
        return self.map(lambda c: c.T)

    @property
    def degree(self) -> dict[str, int]:
        """Highest exponent of each parameter."""
        return {name: max(e[k] for e in self.terms) for k, name in enumerate(self.names)}

    @property
    def is_multi_affine(self) -> bool:
        """True where no parameter appears with a power above one, so that vertices decide."""
        return all(d <= 1 for d in self.degree.values())

    def map(self, function: Callable[[Any], Any]) -> "Polynomial":
        """Return the polynomial whose coefficients are `function(coefficient)`."""
        return Polynomial(self.names, {e: function(c) for e, c in self.terms.items()})

    def over(self, names: Sequence[str]) -> "Polynomial":
        """Return the same polynomial written over `names`, which must contain every parameter of this one."""
        if tuple(names) == self.names:
            return self
        if missing := [name for name in self.names if name not in names]:
            raise BadInput(
                f"The polynomial depends on {missing}, which {tuple(names)} leaves out; name every parameter."
            )
        place = [tuple(names).index(name) for name in self.names]
        terms: dict[Exponents, Any] = {}
        for exponents, coefficient in self.terms.items():
            wide = [0] * len(names)
            for k, power in zip(place, exponents, strict=True):
                wide[k] = power
            terms[tuple(wide)] = coefficient
        return Polynomial(names, terms)

    def __add__(self, other: Any) -> "Polynomial":
        left, right = _aligned(self, Polynomial.constant(other))
        terms = dict(left.terms)
        for exponents, coefficient in right.terms.items():
            terms[exponents] = terms[exponents] + coefficient if exponents in terms else coefficient
        return Polynomial(left.names, terms)

    __radd__ = __add__

    def __neg__(self) -> "Polynomial":
        return self.map(lambda c: -c)

    def __sub__(self, other: Any) -> "Polynomial":
        return self + -Polynomial.constant(other)

    def __rsub__(self, other: Any) -> "Polynomial":
        return Polynomial.constant(other) + -self

    def __matmul__(self, other: Any) -> "Polynomial":
        return _product(self, Polynomial.constant(other), lambda a, b: a @ b)

    def __rmatmul__(self, other: Any) -> "Polynomial":
        return _product(Polynomial.constant(other), self, lambda a, b: a @ b)

    def __mul__(self, other: Any) -> "Polynomial":
        """Product with a scalar, or with a 1 x 1 polynomial."""
        if isinstance(other, Polynomial):
            if other.shape != (1, 1):
                raise BadInput(f"`*` takes a scalar or a polynomial of shape (1, 1), not {other.shape}; use `@`.")
            return _product(self, other, lambda a, b: a * b[0, 0])
        if getattr(other, "shape", ()) not in ((), (1,), (1, 1)):
            raise BadInput(f"`*` takes a scalar, not an array of shape {other.shape}; use `@`.")
        return self.map(lambda c: c * other)

    def __rmul__(self, other: Any) -> "Polynomial":
        return self * other

    def __call__(self, values: Mapping[str, Any]) -> Any:
        """Return the coefficient-typed matrix at a point; every parameter needs a value.

        Args:
            values: parameter name -> number of any arithmetic (float, rational, ball, JAX scalar).
        """
        return next(iter(self.substitute(values, tuple(values)).terms.values()))

    def substitute(self, values: Mapping[str, Any], drop: Sequence[str] | None = None) -> "Polynomial":
        """Return the polynomial with some parameters replaced by numbers.

        Args:
            values: parameter name -> number.
            drop: names that disappear; default: those in `values`.

        Raises:
            BadInput: a parameter is neither given nor left free.
        """
        gone = set(values if drop is None else drop)
        if drop is not None and (missing := set(self.names) - gone):
            raise BadInput(
                f"No value is given for {sorted(missing)}; evaluate with one value for each of {self.names}."
            )
        kept = [k for k, name in enumerate(self.names) if name not in gone]
        terms: dict[Exponents, Any] = {}
        for exponents, coefficient in self.terms.items():
            for k, name in enumerate(self.names):
                if name in gone:
                    for _ in range(exponents[k]):
                        coefficient = coefficient * values[name]
            key = tuple(exponents[k] for k in kept)
            terms[key] = terms[key] + coefficient if key in terms else coefficient
        return Polynomial([self.names[k] for k in kept], terms)

    def compose(self, inner: Mapping[str, "Polynomial"]) -> "Polynomial":
        """Return the polynomial with some parameters replaced by scalar polynomials of other parameters.

        Args:
            inner: parameter name -> polynomial of shape (1, 1), in an arithmetic that multiplies with this one.
        """
        total: Polynomial | None = None
        for exponents, coefficient in self.terms.items():
            left = [e if n not in inner else 0 for n, e in zip(self.names, exponents, strict=True)]
            part = Polynomial(self.names, {tuple(left): coefficient})
            for name, power in zip(self.names, exponents, strict=True):
                for _ in range(power if name in inner else 0):
                    part = part * inner[name]
            total = part if total is None else total + part
        assert total is not None
        # Names that were replaced have no power left; substituting any number drops them.
        degree = total.degree
        return total.substitute({n: 0 for n in total.names if n in inner and not degree[n]})

    def partial(self, name: str) -> "Polynomial":
        """Return the partial derivative with respect to one parameter (the zero matrix where it is absent)."""
        k = self.names.index(name) if name in self.names else -1
        if k < 0 or not any(e[k] for e in self.terms):
            return Polynomial(self.names, {e: c * 0 for e, c in list(self.terms.items())[:1]})
        terms = {
            (*e[:k], e[k] - 1, *e[k + 1 :]): coefficient * e[k] for e, coefficient in self.terms.items() if e[k] > 0
        }
        return Polynomial(self.names, terms)

    def bernstein(self, box: Box, degree: Mapping[str, int] | int | None = None) -> dict[Exponents, Any]:
        """Return the tensor Bernstein coefficients on a box; their convex hull contains every value on the box.

        For a multi-affine polynomial these are exactly the values at the vertices. Raising `degree` above the true one
        (degree elevation) tightens the hull.

        Args:
            box: parameter name -> (lower, upper); floats or exact rationals.
            degree: Bernstein degree of each parameter, or one added to all true degrees; default: the true degrees.

        Returns:
            index tuple in the order of `names` -> coefficient.

        Raises:
            BadInput: a parameter without an interval, or a degree below the true one.
        """
        true = self.degree
        if missing := [n for n, d in true.items() if d and n not in box]:
            raise BadInput(f"The box gives no interval for {missing}; it needs one for each of {self.names}.")
        extra = degree if isinstance(degree, int) else 0
        wanted = {
            n: (degree.get(n, d) if isinstance(degree, Mapping) else d + extra * (d > 0)) for n, d in true.items()
        }
        if low := [n for n in true if wanted[n] < true[n]]:
            raise BadInput(f"Bernstein degree {wanted} is below the polynomial degree {true} for {low}; raise it.")
        axes = [
            _axis_weights(wanted[n], true[n], *map(fraction, box[n]))
            if true[n]
            else ((Fraction(1),),) * (wanted[n] + 1)
            for n in self.names
        ]
        indices = product(*(range(wanted[n] + 1) for n in self.names))
        if self._is_exact:
            # Exact sums may be taken in any order, and one axis after the other is cheapest.
            found, zero = self._axis_by_axis(axes), next(iter(self.terms.values())) * 0
            return {index: found.get(index, zero) for index in indices}
        return {i: self._weighted([axis[k] for axis, k in zip(axes, i, strict=True)]) for i in indices}

    def _axis_by_axis(self, axes: Sequence[tuple[tuple[Fraction, ...], ...]]) -> dict[Exponents, Any]:
        terms = dict(self.terms)
        for k, axis in enumerate(axes):
            turned: dict[Exponents, Any] = {}
            for e, coefficient in terms.items():
                for i, row in enumerate(axis):
                    if row[e[k]]:
                        key = (*e[:k], i, *e[k + 1 :])
                        part = coefficient if row[e[k]] == 1 else coefficient * as_fmpq(row[e[k]])
                        turned[key] = turned[key] + part if key in turned else part
            terms = turned
        return terms

    def _weighted(self, rows: list[tuple[Fraction, ...]]) -> Any:
        total = None
        for exponents, coefficient in self.terms.items():
            weight = math.prod((row[e] for row, e in zip(rows, exponents, strict=True)), start=Fraction(1))
            if weight:
                part = coefficient if weight == 1 else coefficient * float(weight)
                total = part if total is None else total + part
        return next(iter(self.terms.values())) * 0 if total is None else total

    @property
    def _is_exact(self) -> bool:
        return any(getattr(c, "dtype", None) == np.dtype(object) for c in self.terms.values())

    def __iter__(self) -> Iterator[tuple[Exponents, Any]]:
        return iter(self.terms.items())

    def __repr__(self) -> str:
        return f"Polynomial(shape={self.shape}, degree={self.degree})"


def _unflatten(form: tuple[tuple[str, ...], tuple[Exponents, ...]], leaves: Sequence[Any]) -> Polynomial:
    # JAX rebuilds trees with placeholders that have no shape, so the checks of __init__ are passed by.
    polynomial = object.__new__(Polynomial)
    polynomial.names = form[0]
    polynomial.terms = dict(zip(form[1], leaves, strict=True))
    shape: Any = getattr(leaves[0], "shape", ()) if leaves else ()
    polynomial.shape = shape
    return polynomial


def _flatten(polynomial: Polynomial) -> tuple[tuple[Any, ...], tuple[tuple[str, ...], tuple[Exponents, ...]]]:
    return tuple(polynomial.terms.values()), (polynomial.names, tuple(polynomial.terms))


jax.tree_util.register_pytree_node(Polynomial, _flatten, _unflatten)  # pyright: ignore[reportUnknownMemberType]


def _matrix(coefficient: Any) -> Any:
    """Leave matrices of any arithmetic alone, read nested lists."""
    return coefficient if hasattr(coefficient, "shape") else np.asarray(coefficient)


def fraction(number: Any) -> Fraction:
    """Return the exact value of a finite float, integer or flint rational as a `Fraction`.

    Args:
        number: float, integer, `Fraction` or flint rational.
    """
    if isinstance(number, fmpq):
        return Fraction(int(number.p), int(number.q))
    if isinstance(number, float) and not math.isfinite(number):
        raise BadInput(f"{number} is no exact number; interval ends and coefficients need to be finite.")
    return Fraction(number)


def as_fmpq(number: Fraction) -> fmpq:
    """Return a fraction as a flint rational.

    Args:
        number: the fraction.
    """
    return fmpq(number.numerator, number.denominator)


# Bounded: a proof by subdivision asks for ever new boxes.
@lru_cache(maxsize=4096)
def _axis_weights(n: int, degree: int, lower: Fraction, upper: Fraction) -> tuple[tuple[Fraction, ...], ...]:
    """Weight of the monomial x^k in the i-th Bernstein coefficient of degree n on [lower, upper]: its polar form."""
    width = upper - lower
    return tuple(
        tuple(
            sum(
                (Fraction(math.comb(i, j), math.comb(n, j)) * math.comb(k, j) * lower ** (k - j) * width**j)
                for j in range(min(i, k) + 1)
            )
            + Fraction(0)
            for k in range(degree + 1)
        )
        for i in range(n + 1)
    )


def _aligned(left: Polynomial, right: Polynomial) -> tuple[Polynomial, Polynomial]:
    names = left.names + tuple(n for n in right.names if n not in left.names)
    return left.over(names), right.over(names)


def _product(left: Polynomial, right: Polynomial, multiply: Callable[[Any, Any], Any]) -> Polynomial:
    left, right = _aligned(left, right)
    terms: dict[Exponents, Any] = {}
    for (e1, c1), (e2, c2) in product(left.terms.items(), right.terms.items()):
        key = tuple(a + b for a, b in zip(e1, e2, strict=True))
        part = multiply(c1, c2)
        terms[key] = terms[key] + part if key in terms else part
    return Polynomial(left.names, terms)
