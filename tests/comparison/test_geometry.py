"""Distances between films that are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.output.snapshots import make_sheet, make_snapshot
from weathercoat.comparison.geometry import compare_snapshots, sample_surface


def test_equal_films_do_not_differ() -> None:
    found = compare_snapshots(make_snapshot(), make_snapshot())
    assert found.kind == "same topology"
    assert found.is_none


def test_positions_are_compared_vertex_by_vertex_where_the_topology_agrees() -> None:
    whole = make_snapshot()  # of area 1, so that a size is a unit
    vertices = whole.film_vertices.copy()
    vertices[3, 1] += 0.25
    found = compare_snapshots(whole, replace(whole, film_vertices=vertices))
    assert found.kind == "same topology"
    assert found.positions_largest == pytest.approx(0.25)
    assert found.positions_mean == pytest.approx(0.25 / len(vertices))


def test_other_cracks_on_the_same_mesh_are_counted() -> None:
    """The cut along a grid line of 4 cells breaks 4 of the 40 inner edges and raises the half behind it."""
    found = compare_snapshots(make_snapshot(), make_snapshot(split_column=2))
    assert found.kind == "same mesh"
    assert found.broken_in_one == pytest.approx(4 / 40)
    assert found.positions_largest == pytest.approx(0.1)
    assert found.positions_mean == pytest.approx(0.05)


def test_lost_film_is_broken_along_its_edges_and_has_no_positions() -> None:
    whole = make_snapshot()
    gone = make_snapshot(lost=len(whole.film_faces))
    found = compare_snapshots(whole, gone)
    assert found.broken_in_one == 1.0
    assert found.positions_mean is None


@pytest.mark.parametrize("cells", [7, 11])
def test_films_on_other_meshes_are_compared_as_surfaces(cells: int) -> None:
    """Two parallel squares are everywhere as far apart as their planes."""
    vertices, faces = make_sheet(cells)
    other = make_snapshot(mesh=(vertices + np.array([0.0, 0.125, 0.0]), faces))
    found = compare_snapshots(make_snapshot(), other)
    assert found.kind == "other mesh"
    assert found.distance_mean == pytest.approx(0.125)
    assert found.distance_95 == pytest.approx(0.125)


def test_a_film_that_is_lost_is_infinitely_far() -> None:
    lost = make_snapshot(mesh=make_sheet(7), lost=98)
    assert compare_snapshots(make_snapshot(), lost).distance_mean == np.inf


def test_samples_share_the_area_evenly() -> None:
    """Faces of very unlike areas get points by their areas, to one point."""
    vertices = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (10, 0, 0)], np.float64)
    faces = np.array([(0, 1, 2), (1, 3, 2)], np.int32)
    points = sample_surface(vertices, faces, 1000)
    assert np.count_nonzero(points[:, 0] + points[:, 1] <= 1.0) == pytest.approx(100, abs=1)
    assert points[:100].mean(axis=0) == pytest.approx([1 / 3, 1 / 3, 0.0], abs=0.01)
