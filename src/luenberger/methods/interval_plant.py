"""What every interval observer design shares: the plants it takes, coordinates, order as inequalities, and the refusal."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.core import Infeasible, NotAccepted
from luenberger.lmi import Block, Problem, Relaxation, solve
from luenberger.methods.method import require_continuous, scheduled_variable
from luenberger.systems import System
from luenberger.systems.enclosure_system import EnclosureSystem, off_diagonal
from luenberger.systems.jacobian_box import as_floats
from luenberger.systems.matrix import MatrixFunction
from luenberger.systems.observability import require_detectable
from luenberger.systems.worst_vertex import entry, vertices

# An entry smaller than this share of the largest one is zero; roundoff of T A T^-1 stays far below.
_ZERO = 1e-12
# Order is asked with this share of the largest entry of A as room, so that it survives rounding to seven digits.
ROOM = 1e-5
# Coordinates in which a refusal looks for the nearest decay rate.
_NEAREST = 2


def require_enclosable(system: System, decay_rate: float, noise: bool) -> None:
    """Refuse plants that no interval observer of this form can serve, before any solver runs.

    Args:
        system: plant.
        decay_rate: wanted decay of the width [1/s].
        noise: the design asks for the noise bound.

    Raises:
        NotAccepted: discrete, nonlinear, function matrices, an output matrix that is not known at run time, missing bounds.
        BadInput: an unobservable mode is slower than the decay at some vertex of the uncertainty.
    """
    require_continuous(system)
    if system.nonlinearity is not None:
        raise NotAccepted(
            f"`{system.name}` has a nonlinearity; state its secant slopes as unmeasured parameters "
            "(for tyres `slip_angle_plant(..., stiffness=...)`)."
        )
    for letter, value in system.matrices.items():
        if isinstance(value, MatrixFunction):
            raise NotAccepted(
                f"`{letter}` of `{system.name}` is a function on the domain; this method needs polynomial matrices."
            )
    here = EnclosureSystem.of(system)
    if unknown := sorted(n for n in here.hidden if here.C.degree.get(n, 0)):
        raise NotAccepted(
            f"`C` of `{system.name}` depends on {unknown}, which is not known at run time; the gain then acts on an unknown "
            "output. Measure it, or freeze it."
        )
    for value in (here.A, here.B, here.D, here.E):
        vertices(value, here.hidden, here.box)
    if noise and system.noise_bound is None:
        raise NotAccepted(
            f"`{system.name}` has no `noise_bound`; a design against noise needs |v| <= bound, {system.nv} numbers."
        )
    if system.nd and system.disturbance_bound is None:
        raise NotAccepted(
            f"`{system.name}` has {system.nd} unknown inputs without `disturbance_bound`; no enclosure is finite without one."
        )
    hidden = {p.name: p.interval for p in system.parameters if not p.measured}
    for corner in product(*hidden.values()):
        require_detectable(system.freeze(**dict(zip(hidden, corner, strict=True))), decay_rate)


@dataclass(frozen=True)
class Coordinates:
    """A plant in one choice of coordinates, with diagonal storage P and Y = P T L as decision variables.

    Args:
        transform: T.
        true: plant over the true scheduling and its errors.
        measured: plant over the measured scheduling.
        P: diagonal storage, or the identity where only the gain is sought.
        Y: P T L over the scheduling, (nx, ny).
        variables: name -> variable.
        relaxation: how the box becomes finitely many inequalities.
    """

    transform: np.ndarray
    true: EnclosureSystem
    measured: EnclosureSystem
    P: Polynomial
    Y: Polynomial
    variables: Mapping[str, cp.Variable]
    relaxation: Relaxation

    @staticmethod
    def of(
        system: System,
        transform: np.ndarray,
        relaxation: Relaxation,
        gain: Polynomial | None = None,
        constant: bool = False,
    ) -> "Coordinates":
        """Write a plant in coordinates.

        Args:
            system: plant.
            transform: T.
            relaxation: see above.
            gain: L(r) where it is fixed and P alone is sought.
            constant: one gain for the whole box instead of the monomials of the plant.
        """
        true = EnclosureSystem.of(system, transform, view="true")
        measured = EnclosureSystem.of(system, transform)
        diagonal = cp.Variable(system.nx, name="diagonal")
        P = Polynomial.constant(cp.diag(diagonal))
        if gain is not None:
            return Coordinates(transform, true, measured, P, P @ (transform @ gain), {"diagonal": diagonal}, relaxation)
        like = [] if constant else [_nominal(system, letter) for letter in ("AC" if not system.nu else "ABCD")]
        Y, variables = scheduled_variable(system.nx, system.ny, like, system.scheduling_names, "Y")
        return Coordinates(transform, true, measured, P, Y, {"diagonal": diagonal, **variables}, relaxation)

    def loop(self) -> Polynomial:
        """Return P (T A - L_z C) T^-1 over the true scheduling."""
        return self.true.loop(self.true.at_measured(self.Y), self.P)

    def largest_loops(self) -> list[Polynomial]:
        """Return P Mbar over the measured scheduling; C is known, so the maximum is that of T A T^-1."""
        here = self.measured
        correction = self.Y @ here.C @ here.inverse
        return [self.P @ top - correction for top in here.upper(here.A @ here.inverse)]

    def ranges(self) -> list[Polynomial]:
        """Return R, the range of T A over what is not measured."""
        return self.measured.spread(self.measured.A)

    def order(self) -> list[Block]:
        """Return one block for every entry off the diagonal that the gain can move: it must be >= `ROOM`, times P."""
        loop, box, nx = self.loop(), self.true.box, self.true.system.nx
        free = self.true.A @ self.true.inverse
        room = ROOM * max(float(np.abs(c).max()) for c in free.bernstein(box).values())
        return [
            Block(self.named(i, j), entry(self.P, i, i) * room - entry(loop, i, j), box, relaxation=self.relaxation)
            for i, j in off_diagonal(nx)
            if not self._fixed(j)
        ]

    def hopeless(self) -> bool:
        """True where an entry that no gain moves is negative somewhere."""
        value = self.true.A @ self.true.inverse
        for i, j in off_diagonal(self.true.system.nx):
            coefficients = [float(c[0, 0]) for c in entry(value, i, j).bernstein(self.true.box).values()]
            # Roundoff of T A T^-1 is no violation; the exact proof has the last word.
            if self._fixed(j) and min(coefficients) < -_ZERO * max(map(abs, coefficients)):
                return True
        return False

    def named(self, i: int, j: int) -> str:
        """Name of the entry in messages."""
        return f"entry ({self.name(i)}, {self.name(j)})"

    def name(self, i: int) -> str:
        """Name of a coordinate: that of the state where T only turns signs."""
        plain = np.array_equal(np.abs(self.transform), np.eye(len(self.transform)))
        return ("-" * bool(plain and self.transform[i, i] < 0)) + self.true.system.states[i] if plain else f"z{i + 1}"

    def margin(self) -> tuple[float, str]:
        """Return the largest t with every entry off the diagonal >= t for some gain (at most one), and the entry in the way.

        A negative t is the certificate that no gain keeps order in these coordinates: the linear programme has no other
        unknowns than the gain.
        """
        # The sign of an entry does not depend on P; with P = 1 the variable Y is T L itself.
        one = Polynomial.constant(np.eye(self.true.system.nx))
        loop = self.true.loop(self.true.at_measured(self.Y), one)
        unknowns = {k: v for k, v in self.variables.items() if k != "diagonal"}
        blocks = [
            Block(self.named(i, j), -entry(loop, i, j), self.true.box, relaxation=self.relaxation)
            for i, j in off_diagonal(self.true.system.nx)
        ]
        if not blocks:
            return 1.0, ""
        t = cp.Variable()
        found = solve(Problem({**unknowns, "t": t}, blocks, t), slack=t, extra=[t >= -1.0])
        if found is None:
            return -np.inf, blocks[0].name
        return -float(found.values["t"]), max(found.duals, key=lambda k: found.duals[k])

    def _fixed(self, j: int) -> bool:
        """True where column j of C T^-1 vanishes, so that no gain moves it."""
        column = self.true.C @ self.true.inverse @ np.eye(len(self.transform), 1, -j)
        return all(np.abs(c).max() <= _ZERO for _, c in column)


def gain_of(T: np.ndarray, P: np.ndarray, Y: Polynomial) -> Polynomial:
    """Return L = T^-1 P^-1 Y at the values a solver found.

    Args:
        T: coordinates.
        P: diagonal storage.
        Y: decision matrix with values.
    """
    return Y.map(lambda y: np.linalg.solve(T, np.linalg.solve(P, np.asarray(y.value))))


def refusal(
    system: System, tried: Sequence[Coordinates], decay_rate: float, slower: Callable[[np.ndarray], float | None]
) -> Infeasible:
    """Return the error that says why no coordinates that were tried admit a gain that keeps order and converges.

    Args:
        system: plant.
        tried: coordinates.
        decay_rate: wanted decay of the width [1/s].
        slower: largest decay that is found in given coordinates, None for none.
    """
    margins = [here.margin() for here in tried]
    best, block = max(margins, key=lambda margin: margin[0])
    where = tried[margins.index((best, block))]
    T = np.array2string(where.transform, precision=4, separator=", ").replace("\n", "")
    if best >= 0:
        kept = [here.transform for here, (margin, _) in zip(tried, margins, strict=True) if margin >= 0]
        nearest = max((rate for T in kept[:_NEAREST] if (rate := slower(T)) is not None), default=None)
        found = "no slower one was found either" if nearest is None else f"the closest found was {nearest:.6g} 1/s"
        return Infeasible(
            f"Gains that keep order exist for `{system.name}`, but none was found whose width decays at decay_rate = "
            f"{decay_rate:.6g} 1/s; {found}. Ask for that or less, for a smaller box, or for other `coordinates`.",
            "width_decay",
            nearest,
        )
    return Infeasible(
        f"No gain keeps order for `{system.name}` in any of the {len(tried)} coordinates tried: at best (T = {T}) {block} stays at "
        f"{best:.4g} 1/s for every gain, and >= 0 is needed. Give other `coordinates`, or a sensor that reaches that column.",
        block,
        best,
    )


def _nominal(system: System, letter: str) -> Polynomial:
    """A matrix over the scheduling alone, the uncertainties at their midpoints."""
    value = as_floats(getattr(system, letter))
    return value.substitute({n: v for n, v in system.uncertainty.items() if n in value.names})
