"""Law: the error falls at least as fast as claimed, and its bound is never exceeded; checked against a stiff ODE solver."""

import numpy as np
from scipy.integrate import solve_ivp

from catalogue import Row
from luenberger.design import Design


def frozen_errors(design: Design, reach: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Integrate plant and observer at a random frozen scheduling with a sinusoidal input; return times and errors."""
    generator = np.random.default_rng(seed)
    system, nx = design.system, design.system.nx
    r = np.array([generator.uniform(*i) for i in system.scheduling_box.values()])
    values = dict(zip(system.scheduling_names, r, strict=True))
    L, C = np.asarray(design.gain(values)), np.asarray(system.at("C", r))

    def both(t: float, z: np.ndarray) -> np.ndarray:
        u = np.sin(2 * np.pi * t) * np.ones(system.nu)
        dx, dxhat = (np.asarray(system.dynamics(t, part, u, r)) for part in (z[:nx], z[nx:]))
        return np.concatenate([dx, dxhat + L @ C @ (z[:nx] - z[nx:])])

    time = np.linspace(0.0, 6.0, 61)
    start = np.concatenate([generator.uniform(-reach, reach, nx), np.zeros(nx)])
    found = solve_ivp(both, (0.0, 6.0), start, t_eval=time, rtol=1e-8, atol=1e-10, method="LSODA")
    return time, found.y[:nx].T - found.y[nx:].T


def test_storage_falls_as_claimed(design: Design, row: Row) -> None:
    claim = next(c for c in design.certificate.claims if c.kind == "decay")
    for seed in range(3):
        time, error = frozen_errors(design, row.reach, seed)
        V = np.einsum("ti,ij,tj->t", error, np.asarray(claim.storage), error)
        bound = V[0] * np.exp(-2 * claim.level * time)
        # Relative tolerance of the integrator on V and an absolute floor of its atol.
        assert np.all(bound * (1 + 1e-5) + 1e-12 >= V)


def test_gain_bound_holds_inside_the_box(design: Design) -> None:
    generator = np.random.default_rng(0)
    bound = next(c.level for c in design.certificate.claims if c.kind == "gain_bound")
    for _ in range(50):
        values = {n: generator.uniform(*i) for n, i in design.system.scheduling_box.items()}
        assert np.linalg.norm(np.asarray(design.gain(values)), 2) <= bound
