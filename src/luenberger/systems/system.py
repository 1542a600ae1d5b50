"""The one plant all methods speak of, with parts left out."""

from collections.abc import Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.core import BadInput
from luenberger.core.checks import finite_array, known_keys
from luenberger.systems.matrix import MatrixFunction, PlantMatrix, plant_matrix, polynomial
from luenberger.systems.nonlinearity import Nonlinearity
from luenberger.systems.parameter import Parameter, box
from luenberger.systems.scheduling_error import SchedulingError


class System(eqx.Module):
    """What we assume of a plant. Build one with `System.linear`, `System.lpv` or `System.nonlinear`.

    Continuous (dt None) or discrete (x+ for dx):

        dx = A(r,q) x + B(r,q) u + F(r,q) f(H x, u) + E(r) d
        y  = C(r) x + D(r) u + G v          u measured as u + N(r) v

    r measured scheduling (nr), q unmeasured uncertainty (nq), d unknown input (nd), v noise (nv). Gains and solver
    choices never live here. The matrices are pytree leaves, so plants can be batched with `vmap`.
    """

    A: PlantMatrix
    B: PlantMatrix
    C: PlantMatrix
    D: PlantMatrix
    E: PlantMatrix
    F: PlantMatrix
    G: PlantMatrix
    N: PlantMatrix
    scheduling_error: SchedulingError | None
    nonlinearity: Nonlinearity | None
    parameters: tuple[Parameter, ...] = eqx.field(static=True)
    dt: float | None = eqx.field(static=True)
    states: tuple[str, ...] = eqx.field(static=True)
    inputs: tuple[str, ...] = eqx.field(static=True)
    outputs: tuple[str, ...] = eqx.field(static=True)
    units: Mapping[str, str] = eqx.field(static=True)
    name: str = eqx.field(static=True)
    disturbance_bound: tuple[float, ...] | None = eqx.field(static=True)
    noise_bound: tuple[float, ...] | None = eqx.field(static=True)

    @staticmethod
    def linear(A: Any, B: Any = None, C: Any = None, D: Any = None, **options: Any) -> "System":
        """Return a linear plant with constant matrices; see `System.build` for the options."""
        return System.build(A, B, C, D, **options)

    @staticmethod
    def lpv(
        A: Any, B: Any = None, C: Any = None, D: Any = None, *, parameters: Sequence[Parameter], **options: Any
    ) -> "System":
        """Return a plant whose matrices depend on named parameters; see `System.build` for the options."""
        return System.build(A, B, C, D, parameters=parameters, **options)

    @staticmethod
    def nonlinear(
        A: Any, B: Any = None, C: Any = None, D: Any = None, *, F: Any, nonlinearity: Nonlinearity, **options: Any
    ) -> "System":
        """Return a plant with a nonlinearity F f(H x, u); see `System.build` for the options."""
        return System.build(A, B, C, D, F=F, nonlinearity=nonlinearity, **options)

    @staticmethod
    def build(
        A: Any,
        B: Any = None,
        C: Any = None,
        D: Any = None,
        *,
        E: Any = None,
        F: Any = None,
        G: Any = None,
        N: Any = None,
        scheduling_error: SchedulingError | None = None,
        disturbance_bound: Sequence[float] | None = None,
        noise_bound: Sequence[float] | None = None,
        nonlinearity: Nonlinearity | None = None,
        parameters: Sequence[Parameter] = (),
        dt: float | None = None,
        states: Sequence[str] = (),
        inputs: Sequence[str] = (),
        outputs: Sequence[str] = (),
        units: Mapping[str, str] | None = None,
        name: str = "plant",
    ) -> "System":
        """Check all parts of a plant and put it together.

        Args:
            A: (nx, nx), constant, `Polynomial` or `MatrixFunction`.
            B: (nx, nu); left out for a plant without inputs.
            C: (ny, nx); left out: every state is measured.
            D: (ny, nu); left out: zero.
            E: (nx, nd) direction of the unknown input d.
            F: (nx, nf) direction of the nonlinearity.
            G: (ny, nv) direction of the noise; left out: one noise an output.
            N: (nu, nv) noise of the measured inputs, the same v as in the outputs; left out: inputs are known exactly.
            scheduling_error: how measured and true scheduling differ; left out: what the parameters say of themselves.
            disturbance_bound: |d_k| <= bound, nd numbers; left out: no bound is trusted.
            noise_bound: |v_k| <= bound, nv numbers; left out: no bound is trusted.
            nonlinearity: f with its bounds; needed with F.
            parameters: scheduling and uncertainty with their intervals.
            dt: sample time [s] of a discrete plant, None for a continuous one.
            states: names, default x1, x2, ...
            inputs: names, default u1, ...
            outputs: names, default y1, ...
            units: name -> SI unit text.
            name: how the plant is called in tables.

        Raises:
            BadInput: wrong shape, NaN/Inf, F without nonlinearity or the reverse, unknown parameter or signal name.
        """
        names = [p.name for p in parameters]
        if len(set(names)) != len(names):
            raise BadInput(f"Parameters {names} repeat a name; give each its own.")
        nx = _rows("A", A)
        if dt is not None and (isinstance(dt, str) or not (np.isfinite(dt) and dt > 0)):
            raise BadInput(f"`dt` is {dt!r}; a discrete plant needs a positive step in seconds, a continuous one None.")
        if (F is None) != (nonlinearity is None):
            raise BadInput("`F` and `nonlinearity` belong together; give both or neither.")
        nu, nd = _columns("B", B, 0), _columns("E", E, 0)
        C = np.eye(nx) if C is None else C
        ny = _rows("C", C)
        nf = 0 if nonlinearity is None else nonlinearity.size
        have = f"the system has {nx} states"
        nv = _columns("G", G, _columns("N", N, ny))
        if nonlinearity is not None and nonlinearity.H.shape[1] != nx:
            raise BadInput(f"`H` has shape {nonlinearity.H.shape} but {have}; `H` needs shape (nz, {nx}).")
        system = System(
            A=plant_matrix("A", A, nx, nx, names, f"a state matrix is square and {have}"),
            B=plant_matrix("B", B, nx, nu, names, have),
            C=plant_matrix("C", C, ny, nx, names, have),
            D=plant_matrix("D", D, ny, nu, names, f"the system has {ny} outputs and {nu} inputs"),
            E=plant_matrix("E", E, nx, nd, names, have),
            F=plant_matrix("F", F, nx, nf, names, f"{have} and the nonlinearity {nf} outputs"),
            G=plant_matrix(
                "G", np.eye(ny, nv) * (N is None) if G is None else G, ny, nv, names, f"the system has {ny} outputs"
            ),
            N=plant_matrix("N", N, nu, nv, names, f"the system has {nu} inputs and {nv} noises"),
            scheduling_error=scheduling_error,
            nonlinearity=nonlinearity,
            parameters=tuple(parameters),
            dt=dt,
            states=_names("states", states, "x", nx),
            inputs=_names("inputs", inputs, "u", nu),
            outputs=_names("outputs", outputs, "y", ny),
            units=dict(units or {}),
            name=name,
            disturbance_bound=_bounds("disturbance_bound", disturbance_bound, nd),
            noise_bound=_bounds("noise_bound", noise_bound, nv),
        )
        if scheduling_error is not None:
            scheduling_error.require(system.scheduling_names)
        known_keys("`units`", system.units, [*system.states, *system.inputs, *system.outputs, *names])
        return system

    @property
    def nx(self) -> int:
        """Number of states."""
        return self.A.shape[0]

    @property
    def nu(self) -> int:
        """Number of inputs."""
        return self.B.shape[1]

    @property
    def ny(self) -> int:
        """Number of outputs."""
        return self.C.shape[0]

    @property
    def nd(self) -> int:
        """Number of unknown inputs."""
        return self.E.shape[1]

    @property
    def nv(self) -> int:
        """Number of noises."""
        return self.G.shape[1]

    @property
    def nr(self) -> int:
        """Number of scheduling parameters."""
        return len(self.scheduling_names)

    @property
    def scheduling_names(self) -> tuple[str, ...]:
        """Names of the measured parameters, the order of every vector r."""
        return tuple(p.name for p in self.parameters if p.measured)

    @property
    def scheduling_box(self) -> dict[str, tuple[float, float]]:
        """name -> (lower, upper) of the measured parameters."""
        return box([p for p in self.parameters if p.measured])

    @property
    def uncertainty(self) -> dict[str, float]:
        """Nominal values (interval midpoints) of the unmeasured parameters."""
        return {p.name: p.middle for p in self.parameters if not p.measured}

    @property
    def is_lti(self) -> bool:
        """True where no matrix depends on a parameter and there is no nonlinearity."""
        return self.nonlinearity is None and all(not m.names for m in self.matrices.values())

    @property
    def matrices(self) -> dict[str, PlantMatrix]:
        """The eight matrices by letter."""
        return {letter: getattr(self, letter) for letter in "ABCDEFGN"}

    @property
    def measured_scheduling(self) -> SchedulingError | None:
        """How measured and true scheduling differ: as declared, or from the errors of the parameters; None where exact."""
        if self.scheduling_error is not None:
            return self.scheduling_error
        return SchedulingError.of([p for p in self.parameters if p.measured])

    def polynomial(self, letter: str) -> Polynomial:
        """Return a matrix in polynomial form.

        Raises:
            NotAccepted: it is a function on the domain.
        """
        return polynomial(letter, getattr(self, letter))

    def at(self, letter: str, r: Any = ()) -> Any:
        """Return a matrix at a scheduling vector r, shape (nr,), uncertainties at their midpoints; works under JAX.

        Args:
            letter: one of A to G, or N.
            r: scheduling, shape (nr,), in the order of `scheduling_names`.

        Raises:
            BadInput: r of the wrong length.
        """
        if len(r) != self.nr:
            raise BadInput(
                f"`r` has {len(r)} entries but `{self.name}` is scheduled by {list(self.scheduling_names)}; give one for each."
            )
        values = {name: r[k] for k, name in enumerate(self.scheduling_names)} | self.uncertainty
        return getattr(self, letter)(values)

    def dynamics(self, t: Any, x: Any, u: Any, r: Any = ()) -> jax.Array:
        """Return dx/dt (continuous) or x+ (discrete), shape (nx,), with d = 0.

        Args:
            t: time [s]; the plant class is time invariant, t keeps the common signature.
            x: state, shape (nx,).
            u: input, shape (nu,).
            r: scheduling, shape (nr,).
        """
        dx = self.at("A", r) @ x
        if self.nu:
            dx = dx + self.at("B", r) @ u
        if self.nonlinearity is not None:
            dx = dx + self.at("F", r) @ self.nonlinearity(x, u)
        return jnp.asarray(dx)

    def output(self, t: Any, x: Any, u: Any, r: Any = ()) -> jax.Array:
        """Return the noise-free output, shape (ny,); arguments as in `dynamics`."""
        y = self.at("C", r) @ x
        return jnp.asarray(y + self.at("D", r) @ u if self.nu else y)

    def freeze(self, **values: float) -> "System":
        """Return the plant at given parameter values; the others stay, a declared scheduling error goes with its parameters.

        Args:
            values: parameter name -> value inside its interval.

        Raises:
            BadInput: unknown parameter, or a value outside its interval.
        """
        intervals = box(self.parameters)
        known_keys(f"`freeze` of `{self.name}`", values, list(intervals))
        for name, value in values.items():
            lower, upper = intervals[name]
            if not lower <= value <= upper:
                raise BadInput(f"`{name}` = {value} lies outside its interval [{lower}, {upper}]; freeze inside it.")
        frozen: dict[str, Any] = {
            k: _substitute(m, values) for k, m in self.matrices.items() if k != "F" or self.nonlinearity is not None
        }
        # A declared map of the scheduling says nothing of a plant that is scheduled by less.
        if set(values) & set(self.scheduling_names):
            frozen["scheduling_error"] = None
        kept = [p for p in self.parameters if p.name not in values]
        return self.replace(**frozen, parameters=kept, units={k: v for k, v in self.units.items() if k not in values})

    def replace(self, **changes: Any) -> "System":
        """Return a copy with some parts of `System.build` changed; everything is checked again."""
        rest = ("nonlinearity", "parameters", "dt", "states", "inputs", "outputs", "units", "name")
        rest += ("scheduling_error", "disturbance_bound", "noise_bound")
        parts = {**self.matrices, **{k: getattr(self, k) for k in rest}}
        if self.nonlinearity is None:
            parts["F"] = None
        known_keys("`replace`", changes, list(parts))
        return System.build(**(parts | changes))


def _substitute(matrix: PlantMatrix, values: Mapping[str, float]) -> PlantMatrix:
    here = {n: v for n, v in values.items() if n in matrix.names}
    if isinstance(matrix, Polynomial):
        return matrix.substitute(here)
    inner = matrix.function
    left = tuple(n for n in matrix.names if n not in here)
    return MatrixFunction(lambda free: inner({**free, **here}), left, matrix.shape)


def _rows(name: str, value: Any) -> int:
    shape = tuple(value.shape) if hasattr(value, "shape") else finite_array(name, value).shape
    if len(shape) != 2:
        raise BadInput(f"`{name}` has shape {shape}; a matrix with two axes is needed.")
    return shape[0]


def _columns(name: str, value: Any, default: int) -> int:
    if value is None:
        return default
    _rows(name, value)
    return (value.shape if hasattr(value, "shape") else np.shape(value))[1]


def _names(what: str, given: Sequence[str], letter: str, count: int) -> tuple[str, ...]:
    names = tuple(given) or tuple(f"{letter}{k + 1}" for k in range(count))
    if len(names) != count or len(set(names)) != count:
        raise BadInput(f"`{what}` names {list(names)} but the system has {count}; give {count} different names.")
    return names


def _bounds(name: str, given: Sequence[float] | None, count: int) -> tuple[float, ...] | None:
    if given is None:
        return None
    if np.ndim(given) != 1 or isinstance(given, str):
        raise BadInput(f"`{name}` is {given!r}; a list of {count} numbers >= 0 is needed, one for each signal.")
    values = tuple(float(v) for v in given)
    if len(values) != count or not all(np.isfinite(v) and v >= 0 for v in values):
        raise BadInput(f"`{name}` is {list(values)}; {count} finite numbers >= 0 are needed, one for each signal.")
    return values
