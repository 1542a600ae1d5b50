"""What an unknown-input observer sees of a mode: the matrices that decouple, the free part of them, and the fixed zeros."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from luenberger.algebra import Polynomial, block
from luenberger.core import BadInput, NotAccepted
from luenberger.systems import Switched, System
from luenberger.systems.hidden_subspace import RELATIVE_TOLERANCE
from luenberger.systems.jacobian_box import as_floats
from luenberger.systems.mode import Mode
from luenberger.systems.strong_detectability import strong_detectability
from luenberger.systems.uncertainty import Uncertain


@dataclass(frozen=True, eq=False)
class OpenMode:
    """One mode before its gain is chosen: with H = U + Z M' every Z decouples, and N = (I + H C) A - K C.

    Args:
        A: nominal state matrix over the measured scheduling, (nx, nx).
        C: outputs, (ny, nx).
        E: unknown inputs, (nx, nd).
        U: -E (C E)^+, (nx, ny).
        M: orthonormal basis of the outputs that C E leaves free, (ny, free); H may be chosen along it.
        uncertain: directions of the uncertain factors, (nx, nk).
        sizes: length of the row that each factor multiplies [x; u; d] with in the middle of the box, d in units of its bound, (nk,).
        measured: G with its columns in units of the noise bounds, (ny, nv).
        applied: B N with its columns in units of the noise bounds, (nx, nv).
        box: measured scheduling -> interval.
    """

    A: Polynomial
    C: np.ndarray
    E: np.ndarray
    U: np.ndarray
    M: np.ndarray
    uncertain: np.ndarray
    sizes: np.ndarray
    measured: Polynomial
    applied: Polynomial
    box: dict[str, tuple[float, float]]

    @staticmethod
    def of(system: System) -> "OpenMode":
        """Read a mode that `require_decouplable` accepts.

        Args:
            system: one mode.
        """
        uncertain = Uncertain.of(system)
        plant = uncertain.nominal
        C, E = constant(plant, "C"), constant(plant, "E")
        # Columns of unit length first: forces and torques enter with numbers of unlike size.
        length = np.linalg.norm(E, axis=0)
        directions = E[:, length > 0] / length[length > 0]
        left, values, right = np.linalg.svd(C @ directions)
        rank = int(np.sum(values > RELATIVE_TOLERANCE * np.linalg.norm(C, 2)))
        U = -(directions @ right[:rank].T / values[:rank]) @ left[:, :rank].T
        bound = np.diag(np.asarray(system.noise_bound or np.zeros(system.nv), dtype=float))
        return OpenMode(
            A=as_floats(plant.A),
            C=C,
            E=E,
            U=U,
            M=left[:, rank:],
            uncertain=np.asarray(uncertain.directions, dtype=float),
            sizes=_sizes(uncertain),
            measured=as_floats(plant.G) @ bound,
            applied=as_floats(plant.B) @ as_floats(plant.N) @ bound,
            box=dict(plant.scheduling_box),
        )

    @property
    def free(self) -> int:
        """Number of outputs beyond those that decoupling needs."""
        return self.M.shape[1]

    def decoupling(self, Z: np.ndarray) -> np.ndarray:
        """Return H = U + Z M', (nx, ny).

        Args:
            Z: what was chosen freely, (nx, free).
        """
        return self.U + Z @ self.M.T

    def error(self, K: Polynomial, H: np.ndarray) -> Polynomial:
        """Return N = (I + H C) A - K C, (nx, nx).

        Args:
            K: gain, (nx, ny).
            H: decoupling matrix, (nx, ny).
        """
        return self.projection(H) @ self.A - K @ self.C

    def projection(self, H: np.ndarray) -> np.ndarray:
        """Return P = I + H C, (nx, nx).

        Args:
            H: decoupling matrix, (nx, ny).
        """
        return np.eye(len(self.C.T)) + H @ self.C

    def driven(self, K: Polynomial, H: np.ndarray) -> Polynomial:
        """Return what factors, the next noise and the present noise do to the error, one column each, noises in their bounds.

        Args:
            K: gain, (nx, ny).
            H: decoupling matrix, (nx, ny).
        """
        P = self.projection(H)
        now = -(K @ self.measured) - P @ self.applied
        return block([[Polynomial.constant(P @ self.uncertain), H @ self.measured, now]])


def _sizes(uncertain: Uncertain) -> np.ndarray:
    plant = uncertain.nominal
    middle = {name: 0.5 * (lower + upper) for name, (lower, upper) in plant.scheduling_box.items()}
    rows = np.asarray(uncertain.rows({name: middle[name] for name in uncertain.rows.names}), dtype=float)
    bound = np.asarray(plant.disturbance_bound or np.zeros(plant.nd), dtype=float)
    return np.linalg.norm(rows * np.concatenate([np.ones(plant.nx + plant.nu), bound]), axis=1)


def constant(system: System, letter: str) -> np.ndarray:
    """Return a matrix without parameters as an array.

    Args:
        system: plant.
        letter: which matrix.
    """
    matrix = as_floats(getattr(system, letter))
    return np.asarray(matrix(dict.fromkeys(matrix.names, 0.0)), dtype=float)


def require_decouplable(plant: Switched) -> tuple[tuple[int, Mode], ...]:
    """Refuse plants whose unknown input cannot be decoupled with a stable error; return the zeros that no gain moves.

    Args:
        plant: switched plant.

    Returns:
        (number of the mode, zero), the slowest first.

    Raises:
        NotAccepted: a continuous plant, a feedthrough, scheduled E or C, rank(C E) < rank(E), or a zero on or outside the unit circle.
        BadInput: the plant has no outputs.
    """
    found: list[tuple[int, Mode]] = []
    for number, system in enumerate(plant.modes):
        where = f"`{system.name}`" if len(plant.modes) == 1 else f"mode {number} of `{plant.name}`"
        if system.nd == 0:
            raise NotAccepted(
                f"{where} has no unknown input E, so there is nothing to decouple. State its direction, or take a method without one, e.g. "
                "`KalmanGain` or `SteadyWidth`."
            )
        _require_form(system, where)
        nominal = Uncertain.of(system).nominal
        report = strong_detectability(nominal)
        if report.matching is False:
            raise NotAccepted(_rank_error(nominal, where))
        if not report:
            raise NotAccepted(_zero_error(report.modes, where))
        found += [(number, mode) for mode in report.modes]
    return tuple(sorted(found, key=lambda pair: -abs(pair[1].eigenvalue)))


def largest_fade(zeros: Sequence[tuple[int, Mode]]) -> float:
    """Return 1 - max |z|^2, the fade that no gain reaches.

    Args:
        zeros: those that no gain moves.
    """
    return 1.0 - max((abs(mode.eigenvalue) ** 2 for _, mode in zeros), default=0.0)


def _require_form(system: System, where: str) -> None:
    if system.dt is None:
        raise NotAccepted(
            f"The unknown-input observer is a discrete-time one, but {where} is continuous (dt = None); "
            "sample it first, e.g. `discretize(plant, dt)`."
        )
    if system.ny == 0:
        raise BadInput(f"{where} has no outputs; an observer needs at least one.")
    if system.nonlinearity is not None:
        raise NotAccepted(f"{where} has a nonlinearity; this theorem is about linear plants.")
    for letter, role in (("E", "unknown-input"), ("C", "output")):
        matrix = as_floats(getattr(system, letter))
        moved = [n for n, d in matrix.degree.items() if d and n in system.scheduling_names]
        if moved and not (letter == "E" and system.disturbance_bound is not None):
            more = ", or give a `disturbance_bound` for what is left of d" if letter == "E" else ""
            raise NotAccepted(
                f"The {role} matrix `{letter}` of {where} depends on the measured {moved}; the decoupling matrix has to be constant "
                f"within a mode. Freeze these parameters and switch between modes{more}."
            )
    if np.any(constant(system, "D")) or any(as_floats(system.D).degree.values()):
        raise NotAccepted(f"{where} has a feedthrough `D`; take D u off the outputs first and give a plant with D = 0.")


def _rank_error(system: System, where: str) -> str:
    C, E = constant(system, "C"), constant(system, "E")
    scale = np.linalg.norm(E, axis=0)
    E = E / np.where(scale > 0, scale, 1.0)
    have = np.linalg.matrix_rank(C @ E, tol=RELATIVE_TOLERANCE * np.linalg.norm(C, 2))
    need = np.linalg.matrix_rank(E, tol=RELATIVE_TOLERANCE)
    return (
        f"Rank error in {where}: rank(C E) = {have}, but rank(E) = {need} is needed; the outputs do not feel every unknown input one "
        "step later. Measure a state that the unknown input drives directly, or state a `disturbance_bound` and use a bounding method."
    )


def _zero_error(modes: Sequence[Mode], where: str) -> str:
    slow = next((mode for mode in modes if not mode.fades(0.0)), None)
    if slow is None:
        return f"Some unknown input of {where} leaves no trace in the outputs; add a sensor that sees it."
    z = slow.eigenvalue
    advice = (
        "If an Euler step made it, a shorter sample time or the exact hold may move it inside."
        if z.real < 0
        else "Measure more, or move the sensor; no gain, sample time or hold changes on which side it lies."
    )
    return (
        f"The decoupled error of {where} has the unstable zero z = {slow.value} ({slow.direction}), |z| = {abs(z):.4g}; |z| < 1 is "
        f"needed, and no gain moves it. {advice}"
    )
