"""P-radius gains: the radius falls as posed, strips taken one by one, and sets that hold the adversary."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.core import BadInput, NotAccepted, Outcome
from luenberger.methods.zonotopic_plant import DrivenError
from luenberger.methods.zonotopic_radius import PRadiusGain
from luenberger.observers.zonotopic import ZonotopicLuenberger, ZonotopicObserver
from luenberger.observers.zonotopic_strips import ZonotopicStripFilter, together
from luenberger.synthesize import synthesize
from luenberger.systems import System

PLANT = System.build(
    [[0.9, -0.4], [0.4, 0.8]],
    None,
    [[1.0, 0.3], [0.2, 1.0]],
    E=[[1.0, 0.0], [-0.4, 0.2]],
    dt=1.0,
    disturbance_bound=[0.1, 0.3],
    noise_bound=[0.2, 0.4],
    outputs=["first", "second"],
    name="seen twice",
)
METHODS = [PRadiusGain(), PRadiusGain("current"), PRadiusGain("current", "one by one")]


def runner(method: PRadiusGain) -> ZonotopicObserver:
    """The observer that a design is made for."""
    options: dict[str, Any] = {"initial_half_width": [1.0, 1.0], "count": 20}
    if method.uses == "previous":
        return ZonotopicLuenberger(PLANT, np.asarray(method.design(PLANT).gain({})), **options)
    return ZonotopicStripFilter(PLANT, method.filter_gain(PLANT), strips=method.strips, **options)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("vertices", [False, True])
def test_the_state_never_leaves_the_set_of_its_design(method: PRadiusGain, vertices: bool) -> None:
    observer = runner(method)
    generator = np.random.default_rng(5)

    def unit(*shape: int) -> np.ndarray:
        draw = generator.uniform(-1, 1, shape)
        return np.sign(draw) if vertices else draw

    A, C, E = (np.asarray(PLANT.at(k)) for k in "ACE")
    x, rows, outs = unit(20, 2), [], []
    for _ in range(100):
        rows.append(x)
        outs.append(x @ C.T + unit(20, 2) * [0.2, 0.4])
        x = x @ A.T + (unit(20, 2) * [0.1, 0.3]) @ E.T

    @eqx.filter_jit
    def boxes(y: Any) -> Any:
        def advance(state: Any, now: Any) -> Any:
            after, seen = observer.step(state, jnp.zeros(0), now, jnp.zeros(0))
            return after, (seen.lower, seen.upper)

        return jax.lax.scan(advance, observer.init(jnp.zeros(2)), y)[1]

    low, high = jax.vmap(boxes, in_axes=1, out_axes=1)(np.array(outs))
    # Rounding of the sums is the only slack.
    assert np.maximum(np.asarray(low) - rows, rows - np.asarray(high)).max() <= 1e-12


@pytest.mark.parametrize("method", METHODS[:2])
def test_the_radius_falls_as_posed(method: PRadiusGain) -> None:
    found, (b,) = method._found(PLANT)
    P = found[0].values["P"]
    K = np.linalg.solve(P, found[0].values["Y"])
    error = DrivenError.of(PLANT) if method.uses == "previous" else DrivenError.filtered(PLANT)
    generator = np.random.default_rng(1)
    e = generator.normal(size=(2, 2000)) * generator.uniform(0, 3, 2000)
    s = np.sign(generator.normal(size=(error.base.shape[1], 2000)))
    after = error.loop(K) @ e + error.drive(K) @ s
    before = np.einsum("ik,ij,jk->k", e, P, e)
    assert (np.einsum("ik,ij,jk->k", after, P, after) <= b * before + (1 - b) + 1e-6).all()
    # The box of the ellipsoid around the steady errors holds the exact steady box.
    assert (np.sqrt(np.diag(np.linalg.inv(P))) >= error.box(K) * (1 - 1e-6)).all()


def test_one_output_has_one_strip() -> None:
    alone = PLANT.replace(C=[[1.0, 0.3]], D=None, G=[[1.0]], N=None, noise_bound=[0.2], outputs=["first"])
    one, all_at_once = (PRadiusGain("current", strips).filter_gain(alone) for strips in ("one by one", "together"))
    np.testing.assert_allclose(one, all_at_once, rtol=1e-9)


def test_strips_one_by_one_are_the_gain_of_their_product() -> None:
    method = METHODS[2]
    K = method.filter_gain(PLANT)
    C = np.asarray(PLANT.at("C"))
    joined = np.asarray(together(K, C))
    np.testing.assert_allclose(np.asarray(method.design(PLANT).gain({})), np.asarray(PLANT.at("A")) @ joined, rtol=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_designs_are_proved(method: PRadiusGain) -> None:
    design = synthesize(PLANT, method)
    filtered = ["filter_box"] if method.uses == "current" else []
    assert [c.kind for c in design.certificate.claims] == ["decay", "gain_bound", "steady_box", *filtered]
    assert design.certificate.outcome is Outcome.PROVED
    assert (design.filter_gain is not None) == bool(filtered)


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(NotAccepted, match="no filter gain"):
        PRadiusGain().filter_gain(PLANT)
    with pytest.raises(BadInput, match="are needed"):
        PRadiusGain("never").accept(PLANT)
    with pytest.raises(BadInput, match="are needed"):
        PRadiusGain("current", "twice").accept(PLANT)
    with pytest.raises(NotAccepted, match="discrete linear plant"):
        PRadiusGain().accept(PLANT.replace(dt=None))
    # Each output alone has to make the error fade; here neither sees both growing modes.
    apart = PLANT.replace(A=np.diag([1.1, 1.2]), C=np.eye(2))
    PRadiusGain("current").accept(apart)
    with pytest.raises((BadInput, NotAccepted), match="unobservable"):
        PRadiusGain("current", "one by one").filter_gain(apart)
