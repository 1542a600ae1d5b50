"""From a plant as one JAX function to the plants that observer designs ask for, with proved bounds on what is nonlinear."""

# pyright: reportUnknownMemberType=false, reportUnknownArgumentType=false
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np

from luenberger.core import BadInput, NotAccepted, NotCertified
from luenberger.core.checks import matrix
from luenberger.systems.embedding_channels import bounded_channels
from luenberger.systems.embedding_reading import called, input_box, output_matrices, read, require_finite, state_box
from luenberger.systems.embedding_schedule import scheduled_plant
from luenberger.systems.embedding_split import AffineSplit, Channels
from luenberger.systems.embedding_table import JacobianSets, channel_rows, set_rows
from luenberger.systems.embedding_weights import lipschitz_plant
from luenberger.systems.jacobian_hull import proved_hull
from luenberger.systems.nonlinearity import Nonlinearity
from luenberger.systems.system import System

Box = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True, eq=False)
class Embedding:
    """A plant given as a function, split as dx = A x + B u + F f(H x, u), with one view for each kind of design.

    Args:
        plant: the split, its nonlinearity bounded by a Jacobian box; linear where f is.
        input_box: inputs for which the bounds hold, (lower, upper) each (nu,); equal ends where no bound depends on them.
        assumptions: False where the Jacobian box is proved for all differences of f, True where it takes continuity across
            a branch on trust.
        vertices: largest number of vertices of the hull.
        inflation: how far the hull stays away from sampled Jacobians; see `proved_hull`.
    """

    plant: System
    input_box: Box
    assumptions: bool
    vertices: int = 32
    inflation: float = 1e-3

    @property
    def A(self) -> np.ndarray:
        """Constant part of df/dx, shape (nx, nx)."""
        return np.asarray(self.plant.at("A"))

    @property
    def B(self) -> np.ndarray:
        """Constant part of df/du, shape (nx, nu)."""
        return np.asarray(self.plant.at("B"))

    @property
    def F(self) -> np.ndarray:
        """Where the channels enter, shape (nx, nf)."""
        return np.asarray(self.plant.at("F"))

    @property
    def nonlinearity(self) -> Nonlinearity | None:
        """The channels with their Jacobian box, None for a linear plant."""
        return self.plant.nonlinearity

    @property
    def H(self) -> np.ndarray:
        """States that enter the nonlinearity, shape (nz, nx); no rows for a linear plant."""
        f = self.nonlinearity
        return np.zeros((0, self.plant.nx)) if f is None else np.asarray(f.H)

    def system(self, C: Any = None, *, bound: Literal["box", "hull", "lipschitz"] = "box", **options: Any) -> System:
        """Return the plant with another output matrix and a bound of the wanted kind.

        Args:
            C: output matrix (ny, nx); left out: the outputs given to `embed`.
            bound: "box" entrywise Jacobian bounds, "hull" a polytope of Jacobians, "lipschitz" a weighted constant.
            options: further parts of `System.build`, e.g. E, G, noise_bound.
        """
        plant = {"box": self.box, "hull": self.hull, "lipschitz": self.lipschitz}[bound]()
        if C is not None:
            C = matrix("C", C, None, plant.nx, f"the system has {plant.nx} states")
            # Another number of outputs: what was said of the old ones goes.
            options = {"D": None, "G": None, "N": None, "outputs": (), "noise_bound": None} | options | {"C": C}
            kept = set(plant.states) | set(plant.inputs) | set(options["outputs"])
            options.setdefault("units", {k: v for k, v in plant.units.items() if k in kept})
        return plant.replace(**options)

    def box(self, **options: Any) -> System:
        """Return the plant with entrywise Jacobian bounds; for the vertex, multiplier and two-degree-of-freedom designs.

        Args:
            options: parts of `System.build` to change.
        """
        return self.plant.replace(**options)

    def sector(self, shift: Literal["none", "lower", "middle"] = "none", **options: Any) -> System:
        """Return the plant with slopes in a sector, part of every slope moved into A.

        Args:
            shift: "none" leaves the bounds [l, u], "lower" makes them [0, u - l], "middle" [-(u - l)/2, (u - l)/2], to
                rounding.
            options: parts of `System.build` to change.

        Raises:
            BadInput: an unknown shift.
        """
        if shift not in ("none", "lower", "middle"):
            raise BadInput(f"`shift` is {shift!r}; `none`, `lower` or `middle` is needed.")
        f = self.nonlinearity
        if f is None or shift == "none":
            return self.plant.replace(**options)
        lower, upper = _bounds(f)
        K = lower if shift == "lower" else 0.5 * (lower + upper)
        inner = f.function

        def moved(z: Any, u: Any) -> jax.Array:
            return jnp.atleast_1d(inner(z, u)) - (K.astype(z.dtype) * z).sum(axis=1)

        # One ulp outward: the difference of two doubles is rounded.
        low, high = np.nextafter(lower - K, -np.inf), np.nextafter(upper - K, np.inf)
        still = lower == upper
        low, high = np.where(still | (lower == K), 0.0, low), np.where(still, 0.0, high)
        g = replace(f, function=moved, jacobian_lower=low, jacobian_upper=high)
        return self.plant.replace(**({"A": self.A + self.F @ K @ self.H, "nonlinearity": g} | options))

    def hull(self, **options: Any) -> System:
        """Return the plant with a proved convex hull of the Jacobian; for the vertex designs, tighter than the box.

        Args:
            options: parts of `System.build` to change.

        Raises:
            BadInput: too many varying entries or too few vertices; see `proved_hull`.
            NotCertified: the hull could not be proved; give `embed` a larger `inflation`.
        """
        return self.plant.replace(**({} if self.nonlinearity is None else {"nonlinearity": self._hull}) | options)

    @cached_property
    def _hull(self) -> Nonlinearity:
        assert self.nonlinearity is not None
        return proved_hull(self.nonlinearity, inputs=self.input_box, vertices=self.vertices, inflation=self.inflation)

    def lipschitz(self, weighted: bool = True, **options: Any) -> System:
        """Return the plant with a Lipschitz constant, the middle of the Jacobian box moved into A.

        The hull is used where it can be proved. For the Lipschitz designs; several entries that vary cost more here than
        in any other view.

        Args:
            weighted: scale channels and arguments so that the constant admits the fewest Jacobians.
            options: parts of `System.build` to change.
        """
        if self.nonlinearity is None:
            return self.plant.replace(**options)
        tight = self._tightest
        plant = self.plant if tight is None else self.plant.replace(nonlinearity=tight)
        return lipschitz_plant(plant, weighted=weighted).replace(**options)

    def polytopic(self, **options: Any) -> System:
        """Return dx = A(r) x + B u with r the measured states and known inputs that enter f; for the scheduled designs.

        The parameters are called measured_<name> and are taken as known exactly; give them an `error` otherwise.

        Args:
            options: parts of `System.build` to change.

        Raises:
            NotAccepted: a slope depends on a state that is not measured on its own, is no polynomial, or the plant has a
                nonlinear term without a state.
        """
        return scheduled_plant(self.plant, self.input_box).replace(**options)

    @cached_property
    def _tightest(self) -> Nonlinearity | None:
        """The hull where it is worth having and can be proved."""
        f = self.nonlinearity
        if f is None or int(np.less(*_bounds(f)).sum()) < 2:
            return None
        try:
            return self._hull
        except (BadInput, NotCertified):
            return None

    def table(self) -> str:
        """Return the channels and how much each kind of bound admits beyond the Jacobians of the plant, as text."""
        plant, f = self.plant, self.nonlinearity
        head = f"{plant.name}: {plant.nx} states, {plant.nu} inputs, {plant.ny} outputs"
        if f is None:
            return f"{head}; linear, nothing to bound. Any linear design applies."
        trust = (
            "declared (takes continuity across a branch on trust)" if self.assumptions else "proved by ball arithmetic"
        )
        try:
            names = ", ".join(self.polytopic().scheduling_names)
            scheduled = f"exact with scheduling by {names}" if names else "exact, nothing to schedule"
        except NotAccepted as reason:
            scheduled = f"refused: {reason}"
        sets = JacobianSets.of(f, self._tightest)
        return "\n".join([head, f"Jacobian bounds: {trust}", "", *channel_rows(plant), "", *set_rows(sets, scheduled)])

    def __str__(self) -> str:
        return self.table()


def embed(
    function: Callable[..., Any],
    domain: tuple[Any, Any] | list[Any],
    *,
    inputs: int | tuple[Any, Any] | list[Any] = 0,
    outputs: Any = None,
    channels: Channels = "least",
    states: Sequence[str] = (),
    input_names: Sequence[str] = (),
    output_names: Sequence[str] = (),
    units: Mapping[str, str] | None = None,
    name: str = "plant",
    dt: float | None = None,
    vertices: int = 32,
    inflation: float = 1e-3,
    tolerance: float = 1e-3,
) -> Embedding:
    """Split a plant dx = f(x, u) into a linear part and nonlinear channels, with proved bounds on their slopes.

    Choose it to come from equations to a `System`: constant entries of the Jacobian go to A and B, what is left becomes
    F f(H x, u) with only the states that matter. Constancy is proved from the operations of f, bounds by ball arithmetic.
    `print` shows which view is least conservative.

    Args:
        function: pure JAX function f(x) or f(x, u) to dx, shape (nx,), or to a list of nx scalars.
        domain: state box (lower, upper), each (nx,), on which the bounds hold.
        inputs: number of known inputs nu, or their box (lower, upper), each (nu,), which is needed where a slope of f
            depends on them.
        outputs: C, shape (ny, nx), or a JAX function of (x) or (x, u) that is linear; left out: every state is measured.
        channels: "rows" gives each nonlinear row of f its channel, "terms" one to each nonlinear term that enters several
            rows in a fixed proportion; "least" takes what leaves fewer slopes to bound.
        states: names of the states.
        input_names: names of the inputs.
        output_names: names of the outputs.
        units: name -> SI unit text.
        name: how the plant is called in tables.
        dt: sample time [s] where f gives the next state instead of dx.
        vertices: largest number of vertices of the hull.
        inflation: how far the hull stays away from sampled Jacobians; see `proved_hull`.
        tolerance: wanted relative overestimation of the Jacobian box.

    Raises:
        BadInput: wrong shapes, NaN, inverted domain, a function that cannot be read (the primitive is named), a Jacobian
            that is not known to be bounded, a slope that depends on an input without a box.

    Example:
        >>> import luenberger as lb
        >>> van_der_pol = lb.embed(lambda x: [x[1], (1 - x[0] ** 2) * x[1] - x[0]], ([-5, -5], [5, 5]), outputs=[[1, 0]])
        >>> van_der_pol.A.tolist(), van_der_pol.F.tolist()
        ([[0.0, 1.0], [-1.0, 0.0]], [[0.0], [1.0]])
        >>> f = van_der_pol.nonlinearity
        >>> f.bound_status, f.jacobian_lower.tolist(), f.jacobian_upper.tolist()
        ('proved', [[-50.0, -24.0]], [[50.0, 1.0]])
    """
    lower, upper = state_box(domain)
    nu, box = input_box(inputs)
    rates = called(function, nu, "function")
    nx = len(lower)
    whole = read(rates, nx, nu, "function", nx)
    require_finite(rates, 0.5 * (lower + upper), nu, box)
    split = AffineSplit.of(whole, nx)
    C, D = output_matrices(outputs, nx, nu)
    signals = {"states": states, "inputs": input_names, "outputs": output_names, "units": units, "name": name, "dt": dt}
    F, weights, constants = split.channels(channels)
    A = split.A
    if not F.shape[1]:
        fixed = (np.zeros(nu), np.zeros(nu))
        return Embedding(System.build(A, split.B if nu else None, C, D, **signals), fixed, False, vertices, inflation)
    f, linear, used = bounded_channels(split, (weights, constants), (lower, upper), (nu, box), tolerance)
    plant = System.build(A + F @ linear, split.B if nu else None, C, D, F=F, nonlinearity=f, **signals)
    return Embedding(plant, used, f.bound_status == "declared", vertices, inflation)


def _bounds(f: Nonlinearity) -> Box:
    assert f.jacobian_lower is not None
    assert f.jacobian_upper is not None
    return f.jacobian_lower, f.jacobian_upper
