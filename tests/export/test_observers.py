"""Observers that no catalogue row hands out: filters, sets with a gain of their own, modes. The exported step is the Python step."""

from collections.abc import Callable
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from c_programs import needs_compiler
from export_plants import scheduled, vectors
from luenberger.algebra import Polynomial
from luenberger.export import Golden, Guarded, Signals, build, c_code, golden, write_c
from luenberger.export.golden import random_drive
from luenberger.observers import (
    AlgebraicEstimate,
    ExtendedKalmanFilter,
    KalmanFilter,
    UnknownInputObserver,
    UnscentedKalmanFilter,
    ZonotopicFilter,
    ZonotopicKalmanFilter,
)
from luenberger.sets import combastel
from luenberger.systems import Nonlinearity, Parameter, Switched, System

pytestmark = needs_compiler
TUNING = {"measurement_covariance": np.eye(1), "initial_covariance": np.eye(2), "process_density": 0.1 * np.eye(2)}


def pendulum() -> System:
    f = Nonlinearity.bounded(lambda z, u: -np.float64(2.0) * z / (1.0 + z * z), [[1.0, 0.0]], lipschitz=2.0)
    return System.nonlinear([[0.0, 1.0], [-1.0, -0.3]], [[0.0], [1.0]], [[1.0, 0.0]], F=[[0.0], [1.0]], nonlinearity=f)


def bounded(uncertain: bool = False) -> System:
    A: object = [[0.9, 0.1], [0.0, 0.8]]
    parameters = []
    if uncertain:
        A = Polynomial.affine(np.array(A), damping=np.array([[0.0, 0.0], [0.0, 0.1]]))
        parameters = [Parameter("damping", -1.0, 1.0, measured=False)]
    return System.build(
        A,
        [[0.0], [1.0]],
        [[0.0, 1.0]],
        E=[[0.2], [1.0]],
        dt=0.1,
        parameters=parameters,
        disturbance_bound=[0.1],
        noise_bound=[0.05],
    )


def modes() -> Guarded:
    free = bounded(uncertain=True).replace(disturbance_bound=None)
    A = free.polynomial("A")
    plant = Switched.of([free, free.replace(A=A * 0.5)], "level", (0.0, 1.0, 2.0))
    H, K = np.array([[-0.2], [-1.0]]), np.array([[0.1], [0.0]])
    observer = UnknownInputObserver(
        plant, (K, K), (H, H), initial_half_width=[0.1, 0.1], state_bound=[2.0, 2.0], count=8
    )
    return Guarded.of(observer, plant)


def filtered(kind: type, plant: Callable[[], System]) -> Guarded:
    return Guarded.of(kind(plant(), 0.02, **TUNING), plant())


def carried(kind: type, **options: object) -> Guarded:
    plant = bounded(uncertain=True)
    return Guarded.of(kind(plant, initial_half_width=[0.5, 0.5], count=6, **options), plant)


BUILT: dict[str, Callable[[], Guarded]] = {
    "Kalman": lambda: filtered(KalmanFilter, scheduled),
    "extended Kalman": lambda: filtered(ExtendedKalmanFilter, pendulum),
    "unscented Kalman": lambda: filtered(UnscentedKalmanFilter, pendulum),
    "zonotopic Kalman": lambda: carried(ZonotopicKalmanFilter),
    "zonotopic filter, Combastel": lambda: carried(ZonotopicFilter, reduction=combastel),
    "modes and an unknown input": modes,
    "without memory": lambda: Guarded.of(
        AlgebraicEstimate(lambda u, y, r: jnp.stack([2.0 * y[0], y[0] - u[0]]), 0.1, ("a", "b")),
        signals=Signals(("a", "b"), ("force",), ("angle",)),
    ),
}


def _agrees(watched: Guarded, run: Golden, folder: Path, tolerance: float) -> bool:
    write_c(c_code(watched, "kept"), run, folder, tolerance=tolerance)
    said = build(folder, "kept", sanitize=True)
    assert said.agrees, said.says
    return said.agrees


@pytest.mark.parametrize("name", BUILT)
def test_the_exported_step_is_the_python_step(name: str, tmp_path: Path) -> None:
    watched = BUILT[name]()
    run = vectors(watched, 50, 40)
    if name == "unscented Kalman":
        # After an output of 1e9 its covariance is the difference of points that far apart; without that it agrees like the others.
        assert _agrees(watched, golden(watched, *random_drive(watched, 50, 40)), tmp_path, 1e-12)
    assert _agrees(watched, run, tmp_path, 1e-6 if name == "unscented Kalman" else 1e-12)
    # The extremes were met, and no estimate was lost to them.
    assert (run.status & 1).any()
    assert np.isfinite(run.estimate[: len(run.estimate) // 2]).all()
