"""What a remeshed surface keeps of the model: texture coordinates, normals, colours, groups, parts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from weathercoat.mesh.charts import find_seams, number_charts, signed_areas
from weathercoat.mesh.closest import find_closest, make_closest_tree
from weathercoat.mesh.halfedge import make_twins
from weathercoat.mesh.remesh import RemeshParameters, remesh
from weathercoat.mesh.shapes import make_plate, make_sphere
from weathercoat.mesh.surface import Part, Surface, face_areas, make_surface

BOX = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])


def make_box() -> Surface:
    """A box with a chart, a group and a part a side, of which every other one is mirrored in the texture."""
    corner = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 0.7) for z in (0.0, 0.5)])
    faces = np.concatenate([BOX[:, [0, 1, 2]], BOX[:, [0, 2, 3]]])
    side = np.tile(np.arange(6), 2)
    square = np.array([[0.0, 0.0], [0.3, 0.0], [0.3, 0.4], [0.0, 0.4]])
    mirrored = square * (-1.0, 1.0) + (0.3, 0.0)
    uv = np.empty((12, 3, 2))
    for f in range(12):
        chart = mirrored if side[f] % 2 else square
        uv[f] = chart[[0, 1, 2] if f < 6 else [0, 2, 3]] + (0.33 * (side[f] % 3), 0.5 * (side[f] // 3))
    normal = np.cross(corner[faces[:, 1]] - corner[faces[:, 0]], corner[faces[:, 2]] - corner[faces[:, 0]])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return make_surface(
        corner,
        faces,
        face_group=side % 3,
        groups=("red", "green", "blue"),
        uv=uv,
        normals=np.repeat(normal[:, None], 3, axis=1),
        colors=np.column_stack([corner / corner.max(axis=0), np.ones(8)]),
        face_part=side.astype(np.int32),
        parts=tuple(Part(f"side {i}", i % 2) for i in range(6)),
    )


def texture_at(surface: Surface, points: np.ndarray, face: np.ndarray) -> np.ndarray:
    """The texture coordinates (k, 2) of points (k, 3) in the planes of faces, by solving for them."""
    found = np.empty((len(points), 2))
    for row, (point, f) in enumerate(zip(points, face, strict=True)):
        corner = surface.vertices[surface.faces[f]]
        system = np.vstack([corner.T, np.ones(3)])
        weights = np.linalg.lstsq(system, np.append(point, 1.0), rcond=None)[0]
        found[row] = weights @ surface.uv[f]
    return found


def below_centres(model: Surface, meshed: Surface) -> np.ndarray:
    centres = meshed.vertices[meshed.faces].mean(axis=1)
    tree = make_closest_tree(model.vertices, model.faces)
    return find_closest(tree, centres, np.zeros(len(centres), np.int32))[0]


@pytest.mark.parametrize("faces", [600, 5000])
def test_texture_coordinates_are_those_of_the_model_at_every_corner(faces: int) -> None:
    model = make_box()
    meshed = remesh(model, RemeshParameters(faces=faces))
    below = below_centres(model, meshed)
    assert meshed.uv is not None
    for i in range(3):
        expected = texture_at(model, meshed.vertices[meshed.faces[:, i]], below)
        np.testing.assert_allclose(meshed.uv[:, i], expected, atol=1e-9)
    np.testing.assert_array_equal(np.sign(signed_areas(meshed.uv)), np.sign(signed_areas(model.uv))[below])


def test_groups_parts_normals_and_colours_come_along() -> None:
    model = make_box()
    meshed = remesh(model, RemeshParameters(faces=900))
    below = below_centres(model, meshed)
    assert (meshed.parts, meshed.groups) == (model.parts, model.groups)
    np.testing.assert_array_equal(meshed.face_part, model.face_part[below])
    np.testing.assert_array_equal(meshed.face_group, model.face_group[below])
    np.testing.assert_allclose(
        meshed.normals, np.broadcast_to(model.normals[below][:, :1], meshed.normals.shape)
    )
    np.testing.assert_allclose(meshed.colors[:, :3], meshed.vertices / model.vertices.max(axis=0), atol=1e-9)
    place = np.einsum("nij,ni->nj", model.vertices[model.faces[meshed.place.face]], meshed.place.barycentric)
    np.testing.assert_allclose(place, meshed.vertices, atol=1e-9)


def unrolled_sphere() -> Surface:
    """A sphere whose texture is a map, cut along half a meridian: one chart that is its own neighbour."""
    sphere = make_sphere()
    corner = sphere.vertices[sphere.faces]
    angle = np.arctan2(corner[..., 2], corner[..., 0]) / (2.0 * np.pi) + 0.5
    wraps = np.ptp(angle, axis=1) > 0.5
    angle[wraps] = np.where(angle[wraps] < 0.5, angle[wraps] + 1.0, angle[wraps])
    radius = np.linalg.norm(corner, axis=2)
    height = np.arcsin(np.clip(corner[..., 1] / radius, -1.0, 1.0)) / np.pi + 0.5
    return replace(sphere, uv=np.stack([angle, height], axis=2))


def test_a_chart_that_meets_itself_is_not_crossed() -> None:
    """No face spans the whole width of the map, and the map is covered as before."""
    model = unrolled_sphere()
    seams = find_seams(model.uv, make_twins(model.faces))
    assert seams.any() and number_charts(model.faces, make_twins(model.faces), seams).max() == 0
    meshed = remesh(model, RemeshParameters(faces=4000))
    away_from_poles = np.abs(meshed.vertices[meshed.faces][..., 1]).max(axis=1) < 0.8 * model.vertices.max()
    assert np.ptp(meshed.uv[away_from_poles][..., 0], axis=1).max() < 0.05
    covered = np.abs(signed_areas(meshed.uv)).sum()
    assert covered == pytest.approx(1.0, abs=0.03)  # but for the fans at the poles, whose tips have no width


def test_an_atlas_of_single_faces_leaves_the_mesh_even() -> None:
    """Its seams would be lines at every edge, so they are crossed instead."""
    plate = make_plate(width=1.0, height=1.0)
    rough = remesh(plate, RemeshParameters(faces=3000))
    corners = np.array([[0.1, 0.1], [0.9, 0.1], [0.1, 0.9]])
    grid = np.stack(np.divmod(np.arange(len(rough.faces)), 64), axis=1)
    atlas = replace(rough, place=None, uv=(grid[:, None] + corners) / 64.0)
    plain, meshed = (
        remesh(surface, RemeshParameters(faces=2000)) for surface in (replace(atlas, uv=None), atlas)
    )
    np.testing.assert_array_equal(meshed.vertices, plain.vertices)
    np.testing.assert_array_equal(meshed.faces, plain.faces)
    tile = np.floor(meshed.uv * 64.0)
    assert (tile == tile[:, :1]).all(), "each face stays in the chart of one face"


def test_long_seams_are_lines_of_the_mesh() -> None:
    plate = make_plate(width=2.0, height=1.0)
    rough = remesh(plate, RemeshParameters(faces=2000))
    corner = rough.vertices[rough.faces]
    axis = np.ptp(rough.vertices, axis=0).argmax()
    left = corner[..., axis].mean(axis=1) < np.median(rough.vertices[:, axis])
    uv = corner[..., :2] * 0.2 + np.where(left, 0.0, 0.5)[:, None, None]
    meshed = remesh(replace(rough, place=None, uv=uv), RemeshParameters(faces=1500))
    low = meshed.uv[..., 0] < 0.5 * (uv[left][..., 0].max() + uv[~left][..., 0].min())
    assert (low == low[:, :1]).all()
    share = face_areas(meshed.vertices, meshed.faces)[low[:, 0]].sum() / meshed.area()
    expected = face_areas(rough.vertices, rough.faces)[left].sum() / rough.area()
    assert share == pytest.approx(expected, rel=5e-3)  # the ragged line is followed to the length of an edge
