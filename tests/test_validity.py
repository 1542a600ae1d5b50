"""Where a Jacobian bound holds on a square only: the errors from which the oscillator may be observed, proved and driven."""

from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from catalogue import saturating_car
from luenberger.algebra import Polynomial
from luenberger.certify import Certificate, Claim, certify_claims, prove
from luenberger.core import BadInput, NotCertified, Outcome
from luenberger.design import Design
from luenberger.lmi import decay_storage
from luenberger.methods import PolytopicLuenberger
from luenberger.observers import TwoDofObserver
from luenberger.synthesize import synthesize
from luenberger.systems import Nonlinearity, System
from luenberger.validity import admits, domain_of_validity
from van_der_pol_plants import (
    ARGUMENT_GAIN,
    GAIN,
    OPERATING,
    TWO_GAIN,
    motions,
    on_the_boundary,
    on_the_limit_cycle,
    van_der_pol,
)

NONE = np.zeros((2, 1))


def design_of(gain: np.ndarray = GAIN, argument_gain: np.ndarray | None = None, plant: System | None = None) -> Design:
    """A design with a proved decay for gains that are given."""
    plant, L = plant or van_der_pol(), Polynomial.constant(gain)
    L2 = None if argument_gain is None else Polynomial.constant(argument_gain)
    found = decay_storage(plant, L, 0.0, argument_gain=L2)
    assert found is not None
    claims = [Claim("decay", 0.0, found[0], multiplier=found[1])]
    return Design(plant, L, certify_claims(plant, L, claims, argument_gain=L2), "by hand", argument_gain=L2)


def domain_claim(design: Design) -> tuple[Claim, np.ndarray]:
    claim = next(p.claim for p in design.certificate.proofs if p.claim.kind == "domain")
    assert isinstance(claim.storage, np.ndarray)
    return claim, claim.storage


DESIGNS = {"one gain": (GAIN, None), "two gains": (TWO_GAIN, ARGUMENT_GAIN)}


def test_an_argument_gain_frees_the_estimate_from_the_domain() -> None:
    # f sees the measured x1 and x2 - (e2 - 1.5 e1): errors along (1, 1.5) never reach it.
    design = domain_of_validity(design_of(TWO_GAIN, ARGUMENT_GAIN), OPERATING)
    assert admits(design, [[4.0, 6.0], [-4.0, -6.0]]).all()
    assert not admits(design, [4.0, -6.0])


@pytest.mark.parametrize("name", DESIGNS)
def test_the_level_is_proved_and_a_larger_one_refuted(name: str) -> None:
    design = domain_of_validity(design_of(*DESIGNS[name]), OPERATING)
    assert [p.outcome for p in design.certificate.proofs] == [Outcome.PROVED] * 2
    claim, _ = domain_claim(design)
    # The face at 5 less the operating box, rounded down.
    np.testing.assert_allclose(np.asarray(claim.state_bound), [2.9, 2.2], rtol=1e-15)
    spoiled = replace(claim, level=1.5 * claim.level)
    proof = prove(design.system, design.gain, spoiled, argument_gain=design.argument_gain)
    assert proof.outcome is Outcome.REFUTED
    assert "`argument x2` of `domain`" in proof.reason
    far = replace(claim, state_bound=0.9 * np.asarray(claim.state_bound))
    assert prove(design.system, design.gain, far, argument_gain=design.argument_gain).outcome is Outcome.REFUTED


@pytest.mark.parametrize("name", DESIGNS)
def test_errors_from_the_boundary_stay_in_the_set_and_the_argument_in_the_domain(name: str) -> None:
    design = domain_of_validity(design_of(*DESIGNS[name]), OPERATING)
    claim, P = domain_claim(design)
    L2 = DESIGNS[name][1]
    L2 = NONE if L2 is None else L2
    e0 = on_the_boundary(P, claim.level, 100)
    x, xhat, zeta = motions(design.system, DESIGNS[name][0], L2, on_the_limit_cycle(100), e0, 0.002, 10_000)
    assert np.all(np.abs(x) < OPERATING[1])
    assert np.all(np.abs(zeta) < 5.0)
    V = np.einsum("nti,ij,ntj->nt", x - xhat, P, x - xhat)
    # Rates up to 30 1/s at 2 ms: Runge-Kutta follows to 1e-8 of V a step; squares of rounding errors stay at the floor.
    assert np.all(np.diff(V, axis=1) <= 1e-8 * V[:, :-1] + 1e-28)
    # The slower of both designs decays with 0.5 1/s: 5e-5 is left after 20 s, a few times that where e1 first grows by eta.
    assert np.all(np.abs(x - xhat)[:, -1] < 3e-4 * np.abs(e0).max(axis=1, keepdims=True) + 1e-9)


def test_starts_outside_may_leave() -> None:
    design = domain_of_validity(design_of(), OPERATING)
    claim, P = domain_claim(design)
    start = on_the_limit_cycle(200)
    e0 = on_the_boundary(P, 4.0 * claim.level, 200)
    _, xhat, _ = motions(design.system, GAIN, NONE, start, e0, 0.002, 2000)
    began = np.all(np.abs(start - e0) < 5.0, axis=1)
    left = ~np.all(np.abs(xhat) < 5.0, axis=(1, 2))
    assert np.any(began & left)
    assert not admits(design, e0).any()


def test_the_set_is_larger_for_a_tighter_hull_and_a_smaller_operating_box() -> None:
    def area(design: Design) -> float:
        claim, P = domain_claim(design)
        return np.pi * claim.level / np.sqrt(np.linalg.det(P))

    # |g1| <= 10 sqrt(1 - g2) lies below its tangent 12.5 + 2 (1 - g2), so this polygon holds every Jacobian.
    corners = np.array([[[s * g, h]] for g, h in ((12.5, 1.0), (50.0, -17.75), (50.0, -24.0)) for s in (-1, 1)])
    soft = np.array([[8.0], [22.0]])
    box = domain_of_validity(design_of(), OPERATING)
    hull = domain_of_validity(design_of(soft, plant=van_der_pol(hull=corners)), OPERATING)
    assert area(hull) > 1.5 * area(box)
    # Vertical distance 4 in place of 2.2: the sets are similar where the same strip limits them.
    calm = domain_of_validity(design_of(), (np.array([-2.1, -1.0]), np.array([2.1, 1.0])))
    assert area(calm) > 1.5 * area(box)


def test_the_ball_is_the_largest_that_fits() -> None:
    radii = {}
    for objective in ("volume", "ball"):
        design = domain_of_validity(design_of(TWO_GAIN, ARGUMENT_GAIN), OPERATING, objective=objective)
        claim, P = domain_claim(design)
        m = np.asarray(claim.state_bound)
        radii[objective] = np.sqrt(claim.level / np.linalg.eigvalsh(P * np.outer(m, m))[-1])
    # Both give one percent away.
    assert radii["ball"] >= 0.99 * radii["volume"]


def test_admits_asks_the_ellipsoid() -> None:
    design = domain_of_validity(design_of(), OPERATING)
    claim, P = domain_claim(design)
    boundary = on_the_boundary(P, claim.level, 50)
    assert admits(design, 0.999 * boundary).all()
    assert not admits(design, 1.001 * boundary).any()
    assert admits(design, np.zeros(2)).shape == ()
    with pytest.raises(BadInput, match=r"needs shape \(\.\.\., 2\)"):
        admits(design, np.zeros(3))
    with pytest.raises(BadInput, match="no proved claim `domain`"):
        admits(design_of(), np.zeros(2))


def test_the_claim_goes_through_a_file_and_replaces_an_earlier_one(tmp_path: Path) -> None:
    design = domain_of_validity(design_of(TWO_GAIN, ARGUMENT_GAIN), OPERATING)
    again = domain_of_validity(design, (0.9 * OPERATING[0], 0.9 * OPERATING[1]))
    assert [c.kind for c in again.certificate.claims] == ["decay", "domain"]
    again.save(tmp_path / "design.json")
    loaded = Design.load(tmp_path / "design.json")
    assert loaded.certify().outcome is Outcome.PROVED
    assert loaded.certificate.level("domain") == again.certificate.level("domain")
    assert any("box [-5, 5], [-5, 5]" in sentence for sentence in loaded.certificate.assumptions)


def test_slip_angles_of_a_scheduled_car_fill_the_room_they_have() -> None:
    design = synthesize(saturating_car(), PolytopicLuenberger(decay_rate=0.5))
    # The tyres are bounded up to 0.1 rad; trusting the car with 0.05 leaves the estimate 0.05 around every state.
    found = domain_of_validity(design, ([-0.05, -0.05], [0.05, 0.05]))
    assert found.certificate.outcome is Outcome.PROVED
    assert {"decay", "gain_bound", "domain"} == {c.kind for c in found.certificate.claims}
    claim, P = domain_claim(found)
    axes = np.sqrt(claim.level / np.linalg.eigvalsh(P))
    assert np.all((axes > 0.045) & (axes < 0.052))


def test_the_running_observer_starts_from_the_set() -> None:
    design = domain_of_validity(design_of(TWO_GAIN, ARGUMENT_GAIN), OPERATING)
    claim, P = domain_claim(design)
    x0 = on_the_limit_cycle(20)
    e0 = on_the_boundary(P, 0.98 * claim.level, 20)
    assert admits(design, e0).all()
    truth, _, _ = motions(design.system, NONE, NONE, x0, 0 * e0, 0.002, 5000)
    observer, none = design.observer(0.002), jnp.zeros(0)
    assert isinstance(observer, TwoDofObserver)

    def run(start: jax.Array, x: jax.Array) -> jax.Array:
        return jax.lax.scan(lambda s, y: observer.step(s, none, y, none), observer.init(start), x[:, :1])[1].x

    estimates = np.asarray(jax.vmap(run)(jnp.asarray(x0 - e0), jnp.asarray(truth)))
    # exp(-0.5 t) leaves 0.7 % after 10 s; y held for 2 ms at up to 2.7 1/s adds 0.005, times gains of 2.
    assert np.all(np.abs(estimates - truth)[:, -1] < 0.02 * np.abs(e0).max(axis=1, keepdims=True) + 0.01)


def test_what_cannot_have_such_a_claim_is_refused_with_the_reason() -> None:
    design = design_of()
    f = design.system.nonlinearity
    assert f is not None

    def with_f(changed: Nonlinearity) -> Design:
        return replace(design, system=design.system.replace(nonlinearity=changed))

    linear = synthesize(System.linear([[-1.0]], C=[[1.0]], name="lag"), PolytopicLuenberger())
    with pytest.raises(BadInput, match="`lag` has no nonlinearity"):
        domain_of_validity(linear, ([-1.0], [1.0]))
    with pytest.raises(BadInput, match="has no `domain`"):
        domain_of_validity(with_f(replace(f, domain=None)), OPERATING)
    with pytest.raises(BadInput, match="is clipped; its bound holds for every estimate"):
        domain_of_validity(with_f(f.clipped()), OPERATING)
    with pytest.raises(BadInput, match="claims no decay"):
        domain_of_validity(replace(design, certificate=Certificate((), ())), OPERATING)
    with pytest.raises(BadInput, match=r"gives x2 the interval \[-2.8, 5\] but f is bounded on \[-5, 5\]"):
        domain_of_validity(design, ([-2.1, -2.8], [2.1, 5.0]))
    with pytest.raises(BadInput, match=r"both ends need shape \(2,\), lower <= upper"):
        domain_of_validity(design, ([2.1, -2.8], [-2.1, 2.8]))
    with pytest.raises(BadInput, match=r"has shapes \(1,\) and \(2,\)"):
        domain_of_validity(design, ([2.1], [-2.1, 2.8]))
    # A gain of zero leaves the error of the oscillator growing for some Jacobians.
    with pytest.raises(NotCertified, match=r"No set of errors .* no decaying storage was found.*clipped"):
        domain_of_validity(replace(design, gain=Polynomial.constant(NONE)), OPERATING)


def test_states_that_f_does_not_read_may_be_anywhere() -> None:
    f = Nonlinearity.enclosed(lambda z, u: -jnp.sin(z), [[1.0, 0.0]], ([-1.0, -1.0], [1.0, 1.0]))
    plant = System.nonlinear([[0, 1], [0, -0.3]], None, [[1, 0]], F=[[0], [2.0]], nonlinearity=f, name="pendulum")
    design = synthesize(plant, PolytopicLuenberger(decay_rate=0.5))
    claim, _ = domain_claim(domain_of_validity(design, ([-0.4, -50.0], [0.4, 50.0])))
    np.testing.assert_allclose(np.asarray(claim.state_bound), [0.6, 0.0], rtol=1e-15)
