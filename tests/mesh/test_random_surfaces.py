"""What reading makes of random surfaces, at any scale and place: an oriented manifold of the same area."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.mesh.test_repair import assert_is_oriented_manifold
from tests.random_surfaces import Damage, area_of, brought_in, damaged, damages
from tests.zoo import fans_by_vertex, make_mesh
from weathercoat.mesh.halfedge import check_half_edges


@given(damages)
def test_it_is_an_oriented_manifold_of_the_same_area(damage: Damage) -> None:
    """Areas of up to a few hundred faces add up to roundings."""
    positions, faces = damaged(damage)
    surface = brought_in(positions, faces)
    assert_is_oriented_manifold(surface)
    assert len(surface.faces) == len(faces)
    assert surface.area() == pytest.approx(area_of(positions, faces), rel=1e-9)
    mesh = make_mesh(surface)
    assert check_half_edges(mesh) == ""
    assert set(fans_by_vertex(mesh).values()) == {1}


@given(damages, st.integers(-9, 9))
def test_scale_changes_nothing_but_the_scale(damage: Damage, exponent: int) -> None:
    positions, faces = damaged(damage)
    scale = 10.0**exponent
    one, other = brought_in(positions, faces), brought_in(positions * scale, faces)
    assert np.array_equal(one.faces, other.faces) and np.array_equal(one.face_group, other.face_group)
    np.testing.assert_allclose(other.vertices / scale, one.vertices, rtol=1e-12, atol=1e-15)
    assert [note.code for note in one.notes] == [note.code for note in other.notes]


@given(damages, st.tuples(*[st.sampled_from([0.0, -3.0, 1e3, -1e7])] * 3))
def test_an_offset_changes_nothing_but_the_place(damage: Damage, offset: tuple[float, float, float]) -> None:
    """Coordinates of 1e7 round at 2e-9."""
    positions, faces = damaged(damage)
    one, other = brought_in(positions, faces), brought_in(positions + np.array(offset), faces)
    assert np.array_equal(one.faces, other.faces)
    np.testing.assert_allclose(other.vertices - np.array(offset), one.vertices, atol=4e-9)


@given(damages)
def test_what_was_brought_in_comes_in_again_as_it_is(damage: Damage) -> None:
    """There is nothing left to mend, but that copies of a vertex with several fans are one vertex again."""
    once = brought_in(*damaged(damage))
    again = brought_in(once.vertices, once.faces.tolist())
    assert np.array_equal(once.vertices[once.faces], again.vertices[again.faces])
    left = {"W-BOUNDARY", "W-COMPONENTS"}
    if "W-NONMANIFOLD-VERTEX" in {note.code for note in once.notes}:
        left |= {"W-NONMANIFOLD-VERTEX", "W-WELDED"}
    assert {note.code for note in again.notes} <= left
