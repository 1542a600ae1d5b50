"""The plants on which observer inequalities are compared: each with a strength of its nonlinearity that can be turned up.

The strength multiplies F, so that the Jacobian set itself, and the proof of its hull, are the same at every strength. All
Jacobian boxes contain zero: the set at one strength lies in that at any larger one.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from luenberger.core import BadInput
from luenberger.core.checks import nearest
from luenberger.experiment.published.flexible_joint import TRANSFORM, flexible_joint
from luenberger.experiment.published.van_der_pol import van_der_pol
from luenberger.systems import Nonlinearity, System
from luenberger.systems.jacobian_hull import prove_hull, proved_hull
from luenberger.systems.matrix import polynomial
from luenberger.vehicle import brush_tyres, slip_angle_plant, wang_car

RADII = (1.0, 2.0, 2.7, 5.0)
RANDOM = 50
# Enough for the Van der Pol hulls that more vertices change no entry by more than the tolerance of the search.
HULL_VERTICES = 12
_SEED = 2026
# Where the data of the published plants stand.
SOURCES: Mapping[str, str] = {
    "flexible-joint robot": "S. Raghavan, J. K. Hedrick 1994; B. Song, J. K. Hedrick 2011, (35)",
    **{f"Van der Pol, r = {r:g}": "Y. Wang 2014, (5.57) to (5.61)" for r in RADII},
    "slip angles": "Y. Wang 2014, (3.20) and (5.64) to (5.68); the strength is the part kappa of the stiffness that may be lost",
    "FitzHugh nerve": "R. FitzHugh 1961, (1) and (2), derived from the stated plant on |x| <= 2.5, recovery measured",
    "moving object": "M. Abbaszadeh, H. J. Marquez 2010, derived from the stated plant on |x|, |y| <= 1, y measured",
    "tunnel diode": "H. K. Khalil 2002, section 1.2.2 and example 2.1, derived from the stated plant on 0 to 1 V, current measured",
}
# Vertices that only just reach the set leave a proof no room.
_ROOM = 1.0 + 2.0**-10


@dataclass(frozen=True, eq=False)
class Plant:
    """One row of the comparison.

    Args:
        name: how it is called.
        source: where its data stand.
        system: the plant at strength one, with a Jacobian box that contains zero.
        nominal: strength at which gains are compared; None for half of what the vertices of the box admit.
        transform: coordinates that the literature gives for lumped designs; None where they have to be searched.
        hull: the nonlinearity with a proved hull of its Jacobian; None where the Jacobian fills its box.
        is_random: drawn, not published.
    """

    name: str
    source: str
    system: System
    nominal: float | None = 1.0
    transform: tuple[float, ...] | None = None
    hull: Nonlinearity | None = None
    is_random: bool = False

    def at(self, strength: float, *, hull: bool = False) -> System:
        """Return the plant with its nonlinearity multiplied.

        Args:
            strength: factor of F.
            hull: with the proved hull in place of the box.
        """
        changes: dict[str, Any] = {"F": polynomial("F", self.system.F) * strength}
        if hull and self.hull is not None:
            changes["nonlinearity"] = self.hull
        return self.system.replace(**changes)


@cache
def plant_called(name: str) -> Plant:
    """Return one plant, its hull proved; the same object at every call.

    Args:
        name: one of `NAMED`, or "random 0", "random 1" and so on.

    Raises:
        BadInput: no such plant.
    """
    if name in NAMED:
        return NAMED[name]()
    word, _, seed = name.rpartition(" ")
    if word != "random" or not seed.isdecimal():
        raise BadInput(f"No plant is called `{name}`.{nearest(name, NAMED)} Drawn ones are `random 0`, `random 1`, ...")
    return _random(int(seed))


def plant_names(count: int = RANDOM) -> tuple[str, ...]:
    """Return the names of the published plants, then of the random ones.

    Args:
        count: how many random ones.
    """
    return (*NAMED, *(f"random {seed}" for seed in range(count)))


def _published(name: str, system: System, **more: Any) -> Plant:
    return Plant(name, SOURCES[name], system, **more)


def _robot() -> Plant:
    arm = flexible_joint("none")
    assert arm.nonlinearity is not None
    f = arm.nonlinearity
    slopes = Nonlinearity.bounded(f.function, f.H, jacobian=([[-3.33]], [[3.33]]))
    return _published("flexible-joint robot", arm.replace(nonlinearity=slopes), transform=TRANSFORM)


def _oscillator(radius: float) -> Plant:
    plant = van_der_pol(radius)
    assert plant.nonlinearity is not None
    hull = proved_hull(plant.nonlinearity, vertices=HULL_VERTICES)
    return _published(f"Van der Pol, r = {radius:g}", plant, hull=hull)


def _car() -> Plant:
    """Slopes of the tyre remainder in [-C, 0]: the strength is the part kappa of the stiffness that may be lost."""
    plant = slip_angle_plant(wang_car, (15 / 3.6, 150 / 3.6), (-8.0, 8.0), tyres=brush_tyres(wang_car))
    return _published("slip angles", plant, nominal=0.65)


def _nerve() -> Plant:
    """x' = c (y + x - x^3 / 3), y' = -(x - a + b y) / c with a = 0.7, b = 0.8, c = 3, the recovery y measured."""
    b, c = 0.8, 3.0

    def recovery(z: Any, u: Any) -> jax.Array:
        return -c * z**3 / 3.0

    f = Nonlinearity.enclosed(recovery, [[1, 0]], ([-2.5, -5.0], [2.5, 5.0]))
    plant = System.nonlinear([[c, c], [-1 / c, -b / c]], C=[[0, 1]], F=[[1], [0]], nonlinearity=f, name="nerve")
    return _published("FitzHugh nerve", plant)


def _moving_object() -> Plant:
    """x' = x - y - x (x^2 + y^2), y' = x + y - y (x^2 + y^2), y measured, on |x|, |y| <= 1."""

    def drag(z: Any, u: Any) -> jax.Array:
        return -z * (z[0] ** 2 + z[1] ** 2)

    f = Nonlinearity.enclosed(drag, np.eye(2), ([-1, -1], [1, 1]))
    # J = -[[3 s + t, 2 p], [2 p, s + 3 t]] with s = x^2, t = y^2, p = x y, and |p| <= (s + t) / 2.
    points = [(0.0, 0.0, 0.0), *((s, t, sign * (s + t) / 2) for s, t in ((1, 0), (0, 1), (1, 1)) for sign in (-1, 1))]
    corners = np.array([[[-3 * s - t, -2 * p], [-2 * p, -s - 3 * t]] for s, t, p in points])
    middle = np.array([[-2.0, 0.0], [0.0, -2.0]])
    # Seven vertices; those a search finds are more and hold no less.
    hull = prove_hull(f, middle + _ROOM * (corners - middle))
    plant = System.nonlinear([[1, -1], [1, 1]], C=[[0, 1]], F=np.eye(2), nonlinearity=f, name="moving object")
    return _published("moving object", _with_zero(plant), hull=hull)


def _tunnel_diode() -> Plant:
    """x1' = (x2 - h(x1)) / 2, x2' = (u - x1 - 1.5 x2) / 5 in V, mA and ns, the current x2 measured, 0 <= x1 <= 1 V."""

    def current(z: Any, u: Any) -> jax.Array:
        v = z[0]
        h = v * (17.76 + v * (-103.79 + v * (229.62 + v * (-226.31 + v * 83.72))))
        return jnp.stack([-0.5 * h])

    f = Nonlinearity.enclosed(current, [[1, 0]], ([0.0, -2.0], [1.0, 2.0]))
    plant = System.nonlinear([[0, 0.5], [-0.2, -0.3]], C=[[0, 1]], F=[[1], [0]], nonlinearity=f, name="tunnel diode")
    return _published("tunnel diode", plant)


def _with_zero(plant: System) -> System:
    """Widen the Jacobian box to hold zero, which an enclosure may miss by its last digits."""
    f = plant.nonlinearity
    assert f is not None
    assert f.jacobian_lower is not None
    assert f.jacobian_upper is not None
    box = np.minimum(f.jacobian_lower, 0.0), np.maximum(f.jacobian_upper, 0.0)
    return plant.replace(nonlinearity=Nonlinearity.bounded(f.function, f.H, size=f.size, jacobian=box, domain=f.domain))


def _random(seed: int) -> Plant:
    """Normal matrices, one output and two to four states; in turn one channel of one argument, one of two, two of one each.

    Slopes lie in [-a, b], a and b uniform in [0, 1] for each entry.
    """
    generator = np.random.default_rng((_SEED, seed))
    nx = (2, 2, 2, 3, 4)[seed % 5]
    nf, nz = ((1, 1), (1, 2), (2, 2))[seed % 3]
    A, C = generator.normal(size=(nx, nx)), generator.normal(size=(1, nx))
    F, H = generator.normal(size=(nx, nf)), generator.normal(size=(nz, nx))
    used = np.eye(2) if nf == 2 else np.ones((nf, nz))
    low, high = (generator.uniform(0.0, 1.0, (nf, nz)) * used for _ in range(2))
    # A hair less than half of the width, so that no rounded slope leaves the box.
    middle, half = 0.5 * (high - low), 0.5 * (low + high) * (1 - 1e-12)

    def f(z: Any, u: Any) -> jax.Array:
        return jnp.asarray(middle) @ z + jnp.asarray(half) @ jnp.sin(z)

    bounded = Nonlinearity.bounded(f, H, size=nf, jacobian=(-low, high))
    plant = System.nonlinear(A, C=C, F=F, nonlinearity=bounded, name=f"random plant {seed}")
    words = f"{nx} states, {nf} channel{'s' * (nf > 1)}, {nz} argument{'s' * (nz > 1)}"
    return Plant(f"random {seed}", f"drawn here, seed {seed}: {words}", plant, nominal=None, is_random=True)


NAMED: Mapping[str, Callable[[], Plant]] = {
    "flexible-joint robot": _robot,
    **{f"Van der Pol, r = {r:g}": partial(_oscillator, r) for r in RADII},
    "slip angles": _car,
    "FitzHugh nerve": _nerve,
    "moving object": _moving_object,
    "tunnel diode": _tunnel_diode,
}
