"""The energy: its derivatives by differences, and that it is a plate's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from tests import zoo
from tests.checked import COMPILED
from tests.deform.folds import STILL, clamped
from tests.sim.runs import make_run
from tests.zoo import make_mesh
from weathercoat.deform.constraints import make_constraints, release
from weathercoat.deform.energy import Elastic, energy, gradient, hessian_product, make_elastic, sum_of_forces
from weathercoat.deform.parameters import DeformParameters
from weathercoat.deform.stiffness import fill_blocks, find_places, hinge_second_derivative
from weathercoat.mesh.shapes import make_random_sheet
from weathercoat.mesh.surface import Vectors


def cracked_film(seed: int) -> tuple[Elastic, Vectors]:
    """An elastic from the middle of a run, and positions that are shaken by a tenth of an edge."""
    simulation = make_run(make_random_sheet(250, 1.0, 0.8, seed), steps=20, seed=seed)
    simulation.step(14)
    simulation.step()
    elastic = make_elastic(
        simulation.mesh, simulation.constraints, simulation.deform_parameters, simulation.age
    )
    positions = simulation.mesh.positions[: simulation.mesh.vertex_count].copy()
    generator = np.random.default_rng(seed)
    positions[elastic.free] += 0.005 * generator.standard_normal((len(elastic.free), 3))
    return elastic, positions


def moved(elastic: Elastic, positions: Vectors, direction: Vectors, step: float) -> Vectors:
    out = positions.copy()
    out[elastic.free] += step * direction
    return out


@settings(max_examples=8 if COMPILED else 1, deadline=None)
@given(seed=st.integers(0, 1000))
def test_derivatives_are_those_of_differences(seed: int) -> None:
    elastic, x = cracked_film(seed)
    assert len(elastic.free) > 10 and len(elastic.hinges) > 10
    d = np.random.default_rng(seed + 1).standard_normal((len(elastic.free), 3))
    step = 1e-6
    ahead, behind = moved(elastic, x, d, step), moved(elastic, x, d, -step)
    slope = (energy(elastic, ahead).sum() - energy(elastic, behind).sum()) / (2 * step)
    share = gradient(elastic, x) * d
    assert abs(slope - share.sum()) < 1e-5 * np.abs(share).sum()
    change = (gradient(elastic, ahead) - gradient(elastic, behind)) / (2 * step)
    product = hessian_product(elastic, x, d)
    assert np.abs(product - change).max() < 1e-4 * np.abs(product).max()


@settings(max_examples=8 if COMPILED else 1, deadline=None)
@given(seed=st.integers(0, 1000))
def test_blocks_are_the_hessian(seed: int) -> None:
    elastic, x = cracked_film(seed)
    places = find_places(elastic)
    islands = len(elastic.scale)
    d = np.random.default_rng(seed).standard_normal((len(elastic.free), 3))
    whole = multiply(places.pattern, fill_blocks(elastic, places, x, np.ones(islands, bool)), d)
    expected = hessian_product(elastic, x, d)
    assert np.abs(whole - expected).max() < 1e-12 * np.abs(expected).max()
    part = multiply(places.pattern, fill_blocks(elastic, places, x, np.zeros(islands, bool)), d)
    assert np.sum(part * d) > 0.0, "the Gauss-Newton part is never negative"


def multiply(pattern: object, blocks: Vectors, d: Vectors) -> Vectors:
    out = np.zeros_like(d)
    for j in range(len(d)):
        for b in range(pattern.start[j], pattern.start[j + 1]):  # type: ignore[attr-defined]
            i = pattern.row[b]  # type: ignore[attr-defined]
            out[i] += blocks[b] @ d[j]
            if i != j:
                out[j] += blocks[b].T @ d[i]
    return out


def test_the_second_derivative_of_a_hinge_is_symmetric() -> None:
    from weathercoat.deform.energy import hinge_gradient

    x = np.random.default_rng(3).standard_normal((4, 3))
    hinge = np.arange(4, dtype=np.int32)
    _, *rest = hinge_gradient(x, 0, 1, 2, 3)
    u, v, s, t = np.array(rest[:3]), np.array(rest[3:6]), rest[6], rest[7]
    g = np.array([-(1 - s) * u - (1 - t) * v, -s * u - t * v, u, v])
    out = np.empty((4, 4, 3, 3))
    hinge_second_derivative(x, hinge, g, s, t, out)
    matrix = out.transpose(0, 2, 1, 3).reshape(12, 12)
    assert np.abs(matrix - matrix.T).max() < 1e-13 * np.abs(matrix).max()
    for axis in np.eye(3):
        shift = np.tile(axis, 4)
        assert np.abs(matrix @ shift).max() < 1e-13 * np.abs(matrix).max(), "moving it whole changes nothing"


@pytest.mark.parametrize(("across", "expected"), [(0.0, 1.0), (1.0, 4.0 / 3.0), (-1.0, 8.0 / 3.0)])
def test_bending_is_that_of_a_plate(across: float, expected: float) -> None:
    """Curvatures k and c k: 9 / 8 k^2 t^2 / 24 (1 + c^2 - 2 c / 3) by area. For a cylinder that is a plate
    whose Poisson's ratio is 1/3; Gaussian curvature costs hinges what it would a plate of -1/3.
    """
    curvature, thickness = 1e-3, 0.1
    mesh = make_mesh(zoo.make_lattice(24, 24))
    constraints = make_constraints(mesh)
    release(mesh, constraints, np.arange(mesh.vertex_count, dtype=np.int32), 0.0)
    parameters = DeformParameters(curl_rate=0.0, deformation_film_thickness=thickness)
    elastic = make_elastic(mesh, constraints, parameters, 0.0)
    x = mesh.positions[: mesh.vertex_count].copy()
    x[:, 2] = 0.5 * curvature * (x[:, 0] ** 2 + across * x[:, 1] ** 2)
    bending = elastic._replace(length_weight=np.zeros(len(elastic.ends)))
    area = len(elastic.hinges) * 2.0 / 3.0 * np.sqrt(3.0) / 4.0
    density = energy(bending, x).sum() / area
    assert density == pytest.approx(expected * 9.0 / 8.0 * curvature**2 * thickness**2 / 24, rel=0.02)


def test_stretching_is_that_of_a_plate() -> None:
    """Pulled by e along x and let shrink by e / 3 across: e^2 / 2 times the area, of an infinite lattice."""
    strain = 1e-4
    mesh = make_mesh(zoo.make_lattice(24, 24))
    constraints = make_constraints(mesh)
    release(mesh, constraints, np.arange(mesh.vertex_count, dtype=np.int32), 0.0)
    elastic = make_elastic(mesh, constraints, DeformParameters(curl_rate=0.0), 0.0)
    x = mesh.positions[: mesh.vertex_count] * [1 + strain, 1 - strain / 3, 1]
    area = elastic.length_weight.sum() / 3.0
    assert energy(elastic, x).sum() == pytest.approx(0.5 * strain**2 * area, rel=0.02)


def test_energy_is_a_sum_over_islands() -> None:
    """Islands are what edges and hinges connect over free vertices, by the definition."""
    elastic, x = cracked_film(5)
    pairs = [elastic.hinges[:, [i, j]] for i in range(4) for j in range(i)]
    pairs = elastic.unknown[np.concatenate([*pairs, elastic.ends])]
    pairs = pairs[(pairs >= 0).all(axis=1)]
    count = len(elastic.free)
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(count, count))
    found, label = connected_components(graph, directed=False)
    assert found == len(elastic.scale) > 1
    assert len(np.unique(np.stack([label, elastic.island]), axis=1).T) == found
    assert (np.diff(elastic.island) >= 0).all()
    parts = energy(elastic, x)
    for i in range(found):
        alone = elastic._replace(
            length_weight=np.where(elastic.length_island == i, elastic.length_weight, 0.0),
            angle_weight=np.where(elastic.angle_island == i, elastic.angle_weight, 0.0),
        )
        assert energy(alone, x).sum() == pytest.approx(parts[i], rel=1e-12)


def test_the_scale_is_the_energy_at_rest() -> None:
    mesh, constraints = clamped(8, -0.3)
    elastic = make_elastic(mesh, constraints, STILL, 0.0)
    at_rest = energy(elastic, mesh.positions[: mesh.vertex_count])
    assert elastic.scale == pytest.approx(at_rest, rel=1e-3)


def test_forces_that_cancel_still_count() -> None:
    elastic, x = cracked_film(2)
    net = np.linalg.norm(gradient(elastic, x), axis=1)
    assert (sum_of_forces(elastic, x) >= net * (1 - 1e-12)).all()
