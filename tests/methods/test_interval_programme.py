"""The linear programmes against solved equations, random gains, and a change of units."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from interval_plants import FLIP, thesis_car, uncertain_pair
from luenberger.methods.interval_programme import Programme, through_vertices, vertices_of
from luenberger.systems import Parameter, System
from luenberger.systems.enclosure_system import EnclosureSystem

ONES = np.ones(2)
generator = np.random.default_rng(1)


def test_fixed_gain_is_a_linear_equation() -> None:
    plant = uncertain_pair(noise_bound=(0.2,))
    (vertex,) = vertices_of(EnclosureSystem.of(plant), ONES)
    L = np.array([0.8, 0.1])
    found = Programme(vertex, ONES, np.array([0.5]), 0.0, L).at(None)
    assert found is not None
    loop = np.array([[-0.9, 0.7], [0.5, -1.7]]) - np.outer(L, [1.0, 0.0])
    drive = np.array([0.2 + 0.4, 0.2 + 0.6 + 0.4 * 0.5]) + 2 * np.abs(L) * 0.2
    np.testing.assert_allclose(found.widths, np.linalg.solve(-loop, drive), rtol=1e-6)
    np.testing.assert_allclose(found.gain, L, rtol=1e-9)


@pytest.mark.parametrize("T", [np.eye(2), FLIP])
def test_no_random_gain_beats_the_line_search(T: np.ndarray) -> None:
    plant = thesis_car(noise=(1e-3, 0.02, 5e-3))
    for vertex in vertices_of(EnclosureSystem.of(plant, T), np.full(2, 0.05)):
        best = Programme(vertex, ONES, np.zeros(3), 0.0, gain_limit=90.0).best()
        assert best is not None
        low, compared = vertex.A.min(axis=0), 0
        for _ in range(200):
            L = best.gain * generator.uniform(0.5, 1.5, 2) + generator.normal(size=2)
            loop = low - np.outer(L, vertex.C)
            if min(loop[0, 1], loop[1, 0]) < 0 or np.abs(L).max() > 90:
                continue
            other = Programme(vertex, ONES, np.zeros(3), 0.0, L).at(None)
            # The line search leaves a part in ten thousand of t.
            assert other is None or best.cost <= other.cost * (1 + 2e-4)
            compared += other is not None
        assert compared >= 5


def test_small_gain_costs_what_is_allowed() -> None:
    plant = thesis_car(noise=(1e-3, 0.02, 5e-3))
    vertex = vertices_of(EnclosureSystem.of(plant), np.full(2, 0.05))[0]
    programme = Programme(vertex, ONES, np.zeros(3), 0.0, gain_limit=90.0)
    best = programme.best()
    assert best is not None
    small = programme.smallest(best, best.cost * 1.02)
    assert small is not None
    assert small.cost <= best.cost * 1.02 * (1 + 1e-6)
    assert np.abs(small.gain).sum() < np.abs(best.gain).sum()


@given(st.sampled_from([1e-3, 1.0, 1e3]), st.sampled_from([0.1, 10.0]))
def test_units_do_not_matter(length: float, output: float) -> None:
    # States in other units and an output scaled: the widths follow, and the gain with its inverse.
    A = np.array([[-1.0, 0.5], [0.4, -2.0]])
    plants = [System.linear(A, C=[[c, 0.0]], E=e * np.eye(2), disturbance_bound=(0.3, 0.2), noise_bound=(0.05 * c * e,)) for c, e in ((1.0, 1.0), (output, length))]  # fmt: skip
    costs = []
    for plant in plants:
        (vertex,) = vertices_of(EnclosureSystem.of(plant), np.zeros(2))
        best = Programme(vertex, ONES, np.zeros(0), 0.0, gain_limit=4.0 / plant.C.terms[()][0, 0]).best()
        assert best is not None
        costs.append(best.cost)
    assert costs[1] == pytest.approx(costs[0] * length, rel=1e-4)


def test_gain_goes_through_its_vertex_values() -> None:
    parameters = [Parameter("r", 1.0, 3.0), Parameter("s", -1.0, 2.0), Parameter("fixed", 0.5, 0.5)]
    plant = System.lpv(-np.eye(2), C=[[1.0, 0.0]], parameters=parameters)
    vertices = vertices_of(EnclosureSystem.of(plant), ONES)
    assert len(vertices) == 4
    values = generator.normal(size=(4, 2, 1))
    gain = through_vertices(vertices, values, plant.scheduling_box)
    assert gain.is_multi_affine
    for vertex, value in zip(vertices, values, strict=True):
        np.testing.assert_allclose(gain({n: vertex.point[n] for n in gain.names}), value, atol=1e-12)
    middle = gain({n: {"r": 2.0, "s": 0.5}[n] for n in gain.names})
    np.testing.assert_allclose(middle, values.mean(axis=0), atol=1e-12)
