"""Law: a certified L2 gain is never exceeded by a simulated disturbance, started from zero error."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from luenberger.design import Design


@pytest.mark.parametrize("frequency", [0.3, 1.0, 3.0])
def test_disturbance_to_error(design: Design, frequency: float) -> None:
    claims = [c for c in design.certificate.claims if c.kind == "l2_gain" and c.inputs == "disturbance"]
    if not claims:
        return
    system, nx = design.system, design.system.nx
    r = np.array([np.mean(i) for i in system.scheduling_box.values()])
    values = dict(zip(system.scheduling_names, r, strict=True))
    L, C, E = np.asarray(design.gain(values)), np.asarray(system.at("C", r)), np.asarray(system.at("E", r))
    weight = np.asarray(claims[0].weight)
    direction = np.linalg.svd(E)[2][0]

    def both(t: float, z: np.ndarray) -> np.ndarray:
        d = np.sin(2 * np.pi * frequency * t) * np.exp(-0.2 * t) * direction
        x, xhat = z[:nx], z[nx : 2 * nx]
        dx = np.asarray(system.dynamics(t, x, np.zeros(system.nu), r)) + E @ d
        dxhat = np.asarray(system.dynamics(t, xhat, np.zeros(system.nu), r)) + L @ C @ (x - xhat)
        energy = [np.sum((weight @ (x - xhat)) ** 2), d @ d]
        return np.concatenate([dx, dxhat, energy])

    start = np.zeros(2 * nx + 2)
    end = solve_ivp(both, (0.0, 20.0), start, rtol=1e-7, atol=1e-9, method="LSODA").y[:, -1]
    # The integrator's relative tolerance is the only slack.
    assert end[-2] <= claims[0].level ** 2 * end[-1] * (1 + 1e-5)
