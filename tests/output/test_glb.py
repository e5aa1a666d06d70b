"""GLB: structure after the specification, and what another reader makes of it."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from tests.output.snapshots import make_grouped_surface, make_snapshot
from weathercoat.mesh.surface import face_normals, make_surface
from weathercoat.output.glb import rotation_to_y
from weathercoat.output.meshes import write_mesh
from weathercoat.output.sheets import split_corners, srgb_to_linear
from weathercoat.output.snapshots import hair, write_snapshot_glb

WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}
TYPES = {5125: "<u4", 5126: "<f4"}


def read_chunks(path: Path) -> tuple[dict[str, Any], bytes]:
    """The JSON and the binary chunk, with the framing of section 4 of the specification checked."""
    content = path.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", content)
    assert (magic, version, length) == (b"glTF", 2, len(content))
    text_length, kind = struct.unpack_from("<I4s", content, 12)
    assert kind == b"JSON" and text_length % 4 == 0
    document = json.loads(content[20 : 20 + text_length])
    start = 20 + text_length
    if start == len(content):
        return document, b""
    length, kind = struct.unpack_from("<I4s", content, start)
    assert kind == b"BIN\0" and length % 4 == 0 and start + 8 + length == len(content)
    return document, content[start + 8 :]


def read_accessor(document: dict[str, Any], buffer: bytes, number: int) -> np.ndarray:
    accessor = document["accessors"][number]
    view = document["bufferViews"][accessor["bufferView"]]
    assert view["byteOffset"] % 4 == 0 and view["byteOffset"] + view["byteLength"] <= len(buffer)
    width = WIDTHS[accessor["type"]]
    kind = np.dtype(TYPES[accessor["componentType"]])
    assert view["byteLength"] == accessor["count"] * width * kind.itemsize
    values = np.frombuffer(buffer, kind, accessor["count"] * width, view["byteOffset"]).reshape(-1, width)
    if "min" in accessor:
        np.testing.assert_array_equal(values.min(axis=0), np.array(accessor["min"], np.float32))
        np.testing.assert_array_equal(values.max(axis=0), np.array(accessor["max"], np.float32))
    return values


def read_meshes(path: Path) -> dict[str, list[dict[str, np.ndarray]]]:
    """The arrays of every primitive by the name of its node, with positions moved by the root node."""
    document, buffer = read_chunks(path)
    root = document["nodes"][document["scenes"][document["scene"]]["nodes"][0]]
    found: dict[str, list[dict[str, np.ndarray]]] = {}
    for number in root["children"]:
        node = document["nodes"][number]
        found[node["name"]] = []
        for primitive in document["meshes"][node["mesh"]]["primitives"] if "mesh" in node else []:
            arrays = {k: read_accessor(document, buffer, a) for k, a in primitive["attributes"].items()}
            count = {len(values) for values in arrays.values()}
            arrays["faces"] = read_accessor(document, buffer, primitive["indices"]).reshape(-1, 3)
            assert count == {len(arrays["POSITION"])} and arrays["faces"].max() < len(arrays["POSITION"])
            assert "min" in document["accessors"][primitive["attributes"]["POSITION"]]
            np.testing.assert_allclose(np.linalg.norm(arrays["NORMAL"], axis=1), 1.0, atol=1e-6)
            arrays["POSITION"] = arrays["POSITION"] + np.array(root["translation"])
            found[node["name"]].append(arrays)
    return found


def test_film_and_metal_are_named_nodes_with_linear_colors(tmp_path: Path) -> None:
    snapshot = make_snapshot(split_column=2)
    write_snapshot_glb(tmp_path / "a.glb", snapshot)
    meshes = read_meshes(tmp_path / "a.glb")
    assert list(meshes) == ["film", "substrate"]
    (film,), (metal,) = meshes["film"], meshes["substrate"]
    np.testing.assert_allclose(film["POSITION"], snapshot.film_vertices, atol=1e-6)
    np.testing.assert_array_equal(film["faces"], snapshot.film_faces)
    np.testing.assert_allclose(film["_RUST"].ravel(), snapshot.film_rust, atol=1e-6)
    np.testing.assert_array_equal(film["_SEPARATED"].ravel() > 0.5, snapshot.separated)
    np.testing.assert_allclose(film["_DIRT"].ravel(), snapshot.dust[snapshot.film_origin], atol=1e-6)
    np.testing.assert_allclose(metal["POSITION"][:, 1], -hair(snapshot), atol=1e-6)
    # 0.2 and 0.5 in sRGB, by the table of IEC 61966-2-1.
    np.testing.assert_allclose(film["COLOR_0"][:, 1], 0.0331048, atol=1e-6)
    np.testing.assert_allclose(film["COLOR_0"][:, 2], 0.2140411, atol=1e-6)


def test_trimesh_reads_the_same_shapes_and_colors(tmp_path: Path) -> None:
    snapshot = make_snapshot(lost=5, split_column=2)
    write_snapshot_glb(tmp_path / "a.glb", snapshot, untouched=make_grouped_surface())
    scene = trimesh.load(tmp_path / "a.glb", process=False)
    assert set(scene.graph.nodes_geometry) == {"film", "substrate", "body", "tyre left"}
    film = scene.geometry["film"]
    transform, _ = scene.graph["film"]
    positions = trimesh.transform_points(film.vertices, transform)
    np.testing.assert_allclose(positions, snapshot.film_vertices, atol=1e-6)
    np.testing.assert_array_equal(film.faces, snapshot.film_faces)
    linear = np.asarray(film.visual.vertex_attributes["color"], np.float64)[:, :3]
    linear = linear / 255 if linear.max() > 1 else linear
    np.testing.assert_allclose(linear, srgb_to_linear(snapshot.film_color), atol=0.5 / 255 + 1e-6)


def test_materials_are_not_the_metallic_default(tmp_path: Path) -> None:
    write_snapshot_glb(tmp_path / "a.glb", make_snapshot())
    document, _ = read_chunks(tmp_path / "a.glb")
    paint, metal = document["materials"]
    assert paint["pbrMetallicRoughness"]["metallicFactor"] == 0.0 and paint["doubleSided"]
    assert metal["pbrMetallicRoughness"]["metallicFactor"] < 0.5


def test_a_film_with_thickness_is_closed_and_its_back_shows_the_primer(tmp_path: Path) -> None:
    snapshot = make_snapshot(split_column=2)
    write_snapshot_glb(tmp_path / "a.glb", snapshot, thickness=0.01, back_color=(1.0, 0.0, 0.0))
    front, back, rim = read_meshes(tmp_path / "a.glb")["film"]
    np.testing.assert_array_equal(back["COLOR_0"], np.tile(np.float32([1, 0, 0]), (len(back["COLOR_0"]), 1)))
    assert len(front["faces"]) == len(back["faces"]) == len(snapshot.film_faces)
    # The signed volume of a closed surface is that of two plates, whose bevel takes less than its own share.
    volume = 0.0
    for part in (front, back, rim):
        corner = part["POSITION"][part["faces"]]
        volume += np.einsum("ij,ij->", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])) / 6
    assert 0.01 * 0.9 < volume < 0.01


def test_a_snapshot_without_film_keeps_an_empty_node(tmp_path: Path) -> None:
    for thickness in (0.0, 0.01):
        write_snapshot_glb(tmp_path / "a.glb", make_snapshot(lost=32), thickness=thickness)
        meshes = read_meshes(tmp_path / "a.glb")
        assert meshes["film"] == [] and len(meshes["substrate"]) == 1


def test_a_model_far_from_its_origin_keeps_its_shape(tmp_path: Path) -> None:
    snapshot = make_snapshot(offset=1e7)
    write_snapshot_glb(tmp_path / "a.glb", snapshot)
    film = read_meshes(tmp_path / "a.glb")["film"][0]
    np.testing.assert_allclose(film["POSITION"], snapshot.film_vertices, rtol=0, atol=1e-6)


def test_z_up_models_are_turned_y_up(tmp_path: Path) -> None:
    snapshot = make_snapshot()
    write_snapshot_glb(tmp_path / "a.glb", snapshot, up=(0.0, 0.0, 1.0))
    film = read_meshes(tmp_path / "a.glb")["film"][0]
    x, y, z = snapshot.film_vertices.T
    np.testing.assert_allclose(film["POSITION"], np.column_stack([x, z, -y]), atol=1e-6)
    np.testing.assert_allclose(film["NORMAL"], np.tile([0.0, 0.0, -1.0], (len(x), 1)), atol=1e-6)


@given(st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 1e-3))
def test_rotations_are_proper_and_take_up_to_y(direction: tuple[float, float, float]) -> None:
    up = np.array(direction) / np.linalg.norm(direction)
    rotation = rotation_to_y(tuple(up))
    np.testing.assert_allclose(rotation @ up, [0.0, 1.0, 0.0], atol=1e-14)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(rotation) > 0


def test_corners_split_only_where_their_values_differ() -> None:
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1]], np.int32)
    values = np.zeros((3, 3, 1))
    values[1] = 7.0
    split, source, kept = split_corners(faces, values, 4)
    np.testing.assert_array_equal(source[split], faces)
    np.testing.assert_array_equal(kept[split], values)
    assert len(source) == 4 + 3


def test_a_cube_has_flat_faces(tmp_path: Path) -> None:
    box = trimesh.creation.box()
    write_mesh(tmp_path / "a.glb", make_surface(box.vertices, box.faces))
    cube = read_meshes(tmp_path / "a.glb")["default"][0]
    assert len(cube["POSITION"]) == 24
    expected = face_normals(cube["POSITION"], cube["faces"])
    for corner in range(3):
        np.testing.assert_allclose(cube["NORMAL"][cube["faces"][:, corner]], expected, atol=1e-6)


def test_texture_coordinates_count_from_the_top(tmp_path: Path) -> None:
    surface = make_grouped_surface()
    write_mesh(tmp_path / "a.glb", surface)
    assert surface.uv is not None
    for number, name in enumerate(surface.groups):
        part = read_meshes(tmp_path / "a.glb")[name][0]
        u, v = part["TEXCOORD_0"][part["faces"]].reshape(-1, 2).T
        expected = surface.uv[surface.face_group == number].reshape(-1, 2)
        np.testing.assert_allclose(np.column_stack([u, 1 - v]), expected, atol=1e-6)


def test_the_same_snapshot_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_snapshot_glb(tmp_path / f"{name}.glb", make_snapshot(lost=3), thickness=0.01)
    assert (tmp_path / "a.glb").read_bytes() == (tmp_path / "b.glb").read_bytes()
