"""The designs that are compared, one line each, and what they are given: box, hull, Lipschitz constant, coordinates."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

import numpy as np
from scipy.optimize import minimize

from luenberger.algebra import Polynomial
from luenberger.certify import Claim
from luenberger.core import Infeasible
from luenberger.experiment.published.conservatism_plants import Plant
from luenberger.methods.extended_luenberger import ExtendedLuenberger
from luenberger.methods.full_block import FullBlockLuenberger
from luenberger.methods.lipschitz_margin import margin_at, storage_at
from luenberger.methods.lipschitz_plant import LumpedPlant, Transform
from luenberger.methods.lipschitz_riccati import LipschitzRiccati, feasible_epsilon, require_lumped
from luenberger.methods.method import Candidate, Method, gain_bound
from luenberger.methods.polytopic import PolytopicLuenberger
from luenberger.methods.printed_two_dof import PrintedTwoDof
from luenberger.methods.structured_lipschitz import StructuredLipschitz
from luenberger.methods.two_dof import TwoDofLuenberger
from luenberger.systems import Nonlinearity, System
from luenberger.systems.jacobian_box import as_floats

View = Literal["box", "hull", "middle"]
# Weights of the outputs that a lumped design is tried with, smallest gain wins.
EPSILONS = np.geomspace(1e2, 1e-6, 33)
# Where the coordinates of a lumped design are judged: the margin hardly grows below.
SMALL_EPSILON = 1e-6
# Largest natural logarithm of the ratio of two coordinates.
WIDEST = 7.0
# Parts of the logarithms of those coordinates that are tried too, since the best margin may ask for any gain.
PARTS = (0.0, 0.25, 0.5, 0.75, 1.0)
LIMIT_WORDS = "the limit of this comparison"


@dataclass(frozen=True)
class Entrant:
    """One column of the comparison.

    Args:
        name: how it is called.
        short: how it is called in a figure.
        method: makes the method for a plant.
        view: "box" gives it the plant as it stands, "hull" the proved hull, "middle" the plant written about the middle of
            its Jacobian box.
        on_random: whether it runs on the random plants too.
    """

    name: str
    short: str
    method: Callable[[Plant], Method]
    view: View = "box"
    on_random: bool = True

    def plant(self, plant: Plant, strength: float) -> System:
        """Return what the method is given.

        Args:
            plant: row of the comparison.
            strength: factor of its nonlinearity.
        """
        system = plant.at(strength, hull=self.view == "hull")
        return about_the_middle(system) if self.view == "middle" else system


@dataclass(frozen=True)
class Limited:
    """A method that may not inject more than a gain.

    Args:
        method: what is limited.
        gain_limit: largest |L|.
    """

    method: Method
    gain_limit: float

    references: ClassVar[tuple[str, ...]] = ()

    def accept(self, system: System) -> None:
        """Refuse what the method refuses; see `Method`."""
        self.method.accept(system)

    def design(self, system: System) -> Candidate:
        """Return its candidate, or refuse a gain above the limit; see `Method`."""
        found = self.method.design(system)
        level = gain_bound(system, found.gain).level
        if level > self.gain_limit:
            raise Infeasible(
                f"The smallest gain that was found is {level:.4g}; {LIMIT_WORDS} is {self.gain_limit:g}.",
                "gain",
                level,
            )
        return found


@dataclass(frozen=True)
class BestRiccati:
    """`LipschitzRiccati` at the output weight and in the coordinates, of fixed lists, that give the smallest gain.

    Args:
        transforms: coordinates, None for the states as they are.
    """

    transforms: tuple[Transform, ...] = (None,)

    references: ClassVar[tuple[str, ...]] = LipschitzRiccati.references

    def accept(self, system: System) -> None:
        """Refuse what `LipschitzRiccati` refuses; see `Method`."""
        for transform in self.transforms:
            require_lumped(system, transform, "riccati")

    def design(self, system: System) -> Candidate:
        """Try the lists; see `Method`."""
        sizes: dict[tuple[float, int], float] = {}
        for k, transform in enumerate(self.transforms):
            plant = LumpedPlant.of(system, transform)
            for epsilon in map(float, EPSILONS):
                P = storage_at(plant, epsilon)
                if P is not None:
                    sizes[epsilon, k] = float(np.linalg.norm(plant.gain(P, epsilon), 2))
        if sizes:
            epsilon, k = min(sizes, key=lambda key: sizes[key])
        else:
            # Raises with the reason where no weight at all is feasible.
            k = len(self.transforms) - 1
            epsilon = 0.5 * feasible_epsilon(LumpedPlant.of(system, self.transforms[k]))
        return LipschitzRiccati(epsilon, self.transforms[k]).design(system)


@dataclass(frozen=True)
class Spoiled:
    """A method whose gain is turned round after the design: what a proof has to notice.

    Args:
        method: what is spoiled.
    """

    method: Method

    references: ClassVar[tuple[str, ...]] = ()

    def accept(self, system: System) -> None:
        """Refuse what the method refuses; see `Method`."""
        self.method.accept(system)

    def design(self, system: System) -> Candidate:
        """Return its candidate with the other sign of the gain; see `Method`."""
        found = self.method.design(system)

        def claims(gain: Polynomial, *second: Polynomial) -> Sequence[Claim]:
            return found.claims(gain, *second)

        return replace(found, gain=found.gain * -1.0, claims=claims)


def about_the_middle(system: System) -> System:
    """Return the same plant with the middle slopes in A: f(z) - K z has the smallest Lipschitz constant its box allows.

    Args:
        system: plant with a Jacobian box.
    """
    f = system.nonlinearity
    assert f is not None
    assert f.jacobian_lower is not None
    assert f.jacobian_upper is not None
    K = 0.5 * (f.jacobian_lower + f.jacobian_upper)
    original = f.function

    def rest(z: Any, u: Any) -> Any:
        return original(z, u) - K @ z

    box = f.jacobian_lower - K, f.jacobian_upper - K
    centred = Nonlinearity.bounded(rest, f.H, size=f.size, jacobian=box, domain=f.domain)
    return system.replace(A=as_floats(system.A) + as_floats(system.F) @ (K @ f.H), nonlinearity=centred)


def coordinates(plant: Plant) -> tuple[Transform, ...]:
    """Return coordinates for lumped designs: of the literature, or the best diagonal that a simplex search finds, and parts of it.

    Args:
        plant: row of the comparison.
    """
    system = plant.system
    if plant.transform is not None or system.nr:
        return (plant.transform,)
    free = Nonlinearity.bounded(lambda z, u: 0.0 * z, np.eye(system.nx), lipschitz=1.0, size=system.nx)
    rough = system.replace(nonlinearity=free, F=np.eye(system.nx))

    def lost(logarithms: np.ndarray) -> float:
        if np.abs(logarithms).max() > WIDEST:
            return 0.0
        T = np.exp(np.concatenate([[0.0], logarithms]))
        return -margin_at(rough, SMALL_EPSILON, T) / LumpedPlant.of(system, T).lipschitz

    found = minimize(lost, np.zeros(system.nx - 1), method="Nelder-Mead", options={"maxfev": 60 * (system.nx - 1)})
    return tuple(tuple(float(v) for v in np.exp(part * np.concatenate([[0.0], found.x]))) for part in PARTS)


ENTRANTS: tuple[Entrant, ...] = (
    Entrant("Lipschitz constant, Riccati, states as they are", "Riccati", lambda p: BestRiccati()),
    Entrant(
        "Lipschitz constant, Riccati, good coordinates", "Riccati, coordinates", lambda p: BestRiccati(coordinates(p))
    ),
    Entrant("Lipschitz constant in its channel", "channel", lambda p: StructuredLipschitz()),
    Entrant(
        "Lipschitz constant in its channel, about the middle slope",
        "channel, centred",
        lambda p: StructuredLipschitz(),
        "middle",
    ),
    Entrant("printed sector condition with second gain", "printed sector", lambda p: PrintedTwoDof()),
    Entrant("multiplier a channel", "multipliers", lambda p: TwoDofLuenberger(argument_gain_limit=0.0)),
    Entrant("vertices of the Jacobian box", "vertices", lambda p: ExtendedLuenberger()),
    Entrant("vertices, linear design code", "vertices (polytopic)", lambda p: PolytopicLuenberger(), on_random=False),
    Entrant("full-block multiplier", "full block", lambda p: FullBlockLuenberger()),
    Entrant("vertices of the proved Jacobian hull", "hull", lambda p: ExtendedLuenberger(), "hull"),
    Entrant("multiplier a channel with second gain", "second gain", lambda p: TwoDofLuenberger()),
)
