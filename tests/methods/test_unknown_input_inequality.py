"""The inequality of the unknown-input observer: its levels on the car, its freedom, and what it says at a solution."""

from dataclasses import replace

import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.lmi import Bernstein, solve
from luenberger.methods.unknown_input_claims import shown_supply
from luenberger.methods.unknown_input_inequality import Form, posed_gain, posed_supply
from luenberger.methods.unknown_input_plant import OpenMode
from luenberger.systems import System
from luenberger.systems.discretize import discretize
from luenberger.vehicle import gust_car
from luenberger.vehicle.wind import wind_plant

COMMON = Form("common", "lumped", 4.0, False, False, Bernstein())
MODE, DWELL = replace(COMMON, storage="mode"), replace(COMMON, storage="dwell")
LAST = replace(COMMON, storage="last")
SLACK = replace(COMMON, slack=True)


def gusty(step: float) -> tuple[OpenMode, ...]:
    """The car in a side wind at three speeds, sampled by Euler's method."""
    plant = discretize(wind_plant(gust_car, (6.0, 19.9), gust_arm=0.4), step, "euler")
    return tuple(OpenMode.of(plant.freeze(speed=v, inverse_speed=1 / v)) for v in (8.5, 13.55, 18.05))


def random_modes(seed: int, states: int = 3, outputs: int = 1, noise: float = 0.1) -> tuple[OpenMode, ...]:
    """Two modes with one unknown input and eigenvalues up to the unit circle."""
    rng = np.random.default_rng(seed)
    C = rng.standard_normal((outputs, states))
    modes = []
    for _ in range(2):
        A = rng.standard_normal((states, states))
        A *= 1.0 / np.abs(np.linalg.eigvals(A)).max()
        E = rng.standard_normal((states, 1))
        modes.append(OpenMode.of(System.linear(A, C=C, E=E, dt=1.0, noise_bound=[noise] * outputs)))
    return tuple(modes)


def supply(modes: tuple[OpenMode, ...], form: Form, fade: float, alpha: float = 1.0) -> float:
    found = solve(posed_gain(modes, form, fade, alpha).problem)
    return np.inf if found is None else found.objective


@pytest.mark.parametrize(("step", "level"), [(0.06, 2.47274), (0.1, 3.83063), (0.05, 4.39233)])
@pytest.mark.parametrize("form", [COMMON, SLACK, MODE, LAST, DWELL], ids=["common", "slack", "mode", "last", "dwell"])
def test_the_car_has_its_levels_and_switching_costs_nothing(step: float, level: float, form: Form) -> None:
    # Worst mode: (1 - fade) / (1 - fade - z^2); N is diagonal there, so one Q serves all speeds and no freedom helps.
    assert supply(gusty(step), form, 0.5) == pytest.approx(level, abs=1e-4)


@pytest.mark.parametrize("step", [0.6, 0.02, 0.01])
def test_the_fade_of_a_half_needs_the_right_step(step: float) -> None:
    assert supply(gusty(step), COMMON, 0.5) == np.inf


@pytest.mark.parametrize("alpha", [1.0, 1e-2, 1e-4])
def test_the_level_is_proportional_to_the_scale_of_the_storage(alpha: float) -> None:
    # As printed nothing holds the scale, so the least supply is zero.
    assert supply(gusty(0.06), COMMON, 0.5, alpha) == pytest.approx(2.47274 * alpha, rel=1e-4)


@pytest.mark.parametrize("seed", [10, 13, 32, 38])
def test_a_free_slack_helps_no_common_storage(seed: int) -> None:
    modes = random_modes(seed)
    assert supply(modes, SLACK, 0.1) == pytest.approx(supply(modes, COMMON, 0.1), rel=1e-5)


@pytest.mark.parametrize("seed", [225, 273])
def test_storages_of_the_modes_reach_plants_that_a_common_one_does_not(seed: int) -> None:
    modes = random_modes(seed)
    assert supply(modes, COMMON, 0.1) == np.inf
    assert supply(modes, MODE, 0.1) < 30


@pytest.mark.parametrize("seed", [106, 295])
def test_a_dwell_time_reaches_more(seed: int) -> None:
    modes = random_modes(seed)
    assert supply(modes, MODE, 0.1) == np.inf
    assert supply(modes, DWELL, 0.1) < 6


@pytest.mark.parametrize("seed", [10, 32, 33, 47])
def test_more_freedom_is_never_worse(seed: int) -> None:
    modes = random_modes(seed)
    common, mode, last, dwell = (supply(modes, form, 0.1) for form in (COMMON, MODE, LAST, DWELL))
    assert mode <= common * (1 + 1e-6)
    # S = Q of the mode that acted, in the place of one S for every mode that may follow.
    assert last <= mode * (1 + 1e-6)
    # One Q for all meets the inequality of the dwell time as well.
    assert dwell <= common * (1 + 1e-6)


def test_storages_of_the_modes_help_some_plants() -> None:
    modes = random_modes(47)
    assert supply(modes, MODE, 0.1) < 0.7 * supply(modes, COMMON, 0.1)
    assert supply(modes, LAST, 0.1) < 0.7 * supply(modes, MODE, 0.1)


@pytest.mark.parametrize("form", [COMMON, SLACK, MODE, LAST, DWELL], ids=["common", "slack", "mode", "last", "dwell"])
def test_recovered_gains_fade_as_the_inequality_says(form: Form) -> None:
    # V_j(N e + w) <= (1 - fade) V_i(e) + supply |w|^2 with the storages of the solution, random errors and inputs.
    rng = np.random.default_rng(5)
    modes = random_modes(32)
    posed = posed_gain(modes, form, 0.1)
    found = solve(posed.problem)
    assert found is not None
    K, H = posed.recovered(modes)
    Q = [np.asarray(q.value) for q in posed.storages]
    e, w = rng.standard_normal((2, 3, 4000))
    for i, k, j in form.transitions(2):
        after = np.asarray(modes[k].error(K[k], H[k])({})) @ e + w
        have, allowed = (after * (Q[j % len(Q)] @ after)).sum(0), (e * (Q[i % len(Q)] @ e)).sum(0) * 0.9
        assert (have <= allowed + found.objective * (w**2).sum(0) + 1e-6).all()
    assert min(np.linalg.eigvalsh(q)[0] for q in Q) >= 1 - 1e-7


def test_an_unknown_without_effect_is_left_out() -> None:
    # With as many outputs as unknown inputs H is fixed, and a solver that needs every unknown to matter takes the problem.
    posed = posed_gain(gusty(0.06), COMMON, 0.5)
    assert posed.free == (None, None, None)
    found = solve(posed.problem, solvers=("CVXOPT",))
    assert found is not None
    assert found.objective == pytest.approx(2.47274, abs=1e-4)


def test_free_outputs_are_used() -> None:
    # Two outputs and one unknown input: taking away the free part of H raises the level.
    modes = random_modes(0, states=4, outputs=2)
    fixed = tuple(replace(mode, M=np.zeros((2, 0))) for mode in modes)
    assert supply(modes, COMMON, 0.1) < 0.99 * supply(fixed, COMMON, 0.1)


def test_one_by_one_the_channels_get_their_own_weight() -> None:
    # The gain that is best for the lump is no better than the one that was made for the noises themselves.
    modes = random_modes(1, states=4, outputs=2)
    physical = replace(COMMON, attenuate="physical", unit=0.1)
    best = supply(modes, physical, 0.1)
    posed = posed_gain(modes, COMMON, 0.1)
    assert solve(posed.problem) is not None
    K, H = posed.recovered(modes)
    loops = [(m.error(k, h), m.driven(k, h) * 10.0, m.box) for m, k, h in zip(modes, K, H, strict=True)]
    found = solve(posed_supply(loops, physical, 0.1)[0])
    assert found is not None
    assert best <= found.objective * (1 + 1e-6)
    assert best < 0.95 * found.objective


def test_the_supply_of_fixed_gains_is_the_one_of_the_design() -> None:
    modes = gusty(0.06)
    posed = posed_gain(modes, COMMON, 0.5)
    assert solve(posed.problem) is not None
    K, H = posed.recovered(modes)
    loops = [(m.error(k, h), Polynomial.constant(np.eye(2)), m.box) for m, k, h in zip(modes, K, H, strict=True)]
    again = solve(posed_supply(loops, COMMON, 0.5)[0])
    assert again is not None
    assert again.objective == pytest.approx(2.47274, abs=1e-4)


def test_one_by_one_the_linear_form_is_the_error_that_runs() -> None:
    # What the unknowns S K and S Z make of every channel, against the channels of the gains that come out of them.
    rng = np.random.default_rng(6)
    A = rng.standard_normal((4, 4))
    plant = System.linear(
        0.9 * A / np.abs(np.linalg.eigvals(A)).max(),
        rng.standard_normal((4, 1)),
        rng.standard_normal((2, 4)),
        E=rng.standard_normal((4, 1)),
        G=rng.standard_normal((2, 3)),
        N=rng.standard_normal((1, 3)),
        dt=1.0,
        noise_bound=[0.1, 0.2, 0.3],
    )
    modes = (replace(OpenMode.of(plant), uncertain=0.3 * rng.standard_normal((4, 2)), sizes=np.ones(2)),)
    physical = replace(COMMON, attenuate="physical", unit=0.5)
    posed = posed_gain(modes, physical, 0.1)
    found = solve(posed.problem)
    assert found is not None
    K, H = posed.recovered(modes)
    loop = (modes[0].error(K[0], H[0]), modes[0].driven(K[0], H[0]) * (1 / physical.unit), modes[0].box)
    Q = [np.asarray(q.value) for q in posed.storages]
    # The storage of the design shows its own supply; what is left is the solver's gap.
    assert shown_supply(loop, Q[0], Q[0], 0.1) == pytest.approx(found.objective, rel=1e-4)
