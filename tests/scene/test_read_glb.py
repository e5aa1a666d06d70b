"""Nodes of glTF files as objects."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.scene.documents import CUBE, Document
from weathercoat.errors import CorruptError, EmptyFileError, FormatError, LimitError, NoFacesError
from weathercoat.mesh.read import read_surface
from weathercoat.scene.graph import place, world_surface
from weathercoat.scene.read import read_scene

QUARTER = [0.0, float(np.sqrt(0.5)), 0.0, float(np.sqrt(0.5))]  # about y


def test_instances_share_a_mesh_and_keep_their_places(tmp_path: Path) -> None:
    document = Document()
    mesh = document.mesh("drum")
    document.node(name="rack", children=[1, 2], translation=[10, 0, 0], rotation=QUARTER)
    document.node(name="left", mesh=mesh, translation=[1, 2, 3])
    document.node(name="right", mesh=mesh, scale=[-1, 1, 2])
    scene = read_scene(document.write(tmp_path / "a.glb"))
    assert [(o.name, o.mesh, o.node) for o in scene.objects] == [("left", "drum", 1), ("right", "drum", 2)]
    assert list(scene.meshes) == ["drum"]
    left, right = scene.objects
    # a quarter turn about y takes z to x and x to -z
    assert np.allclose(place(np.zeros((1, 3)), left.transform), [[13, 2, -1]])
    assert np.allclose(place(np.array([[1.0, 1.0, 1.0]]), right.transform), [[12, 1, 1]])
    assert (left.is_mirrored(), right.is_mirrored()) == (False, True)


def test_objects_at_their_places_are_what_read_surface_reads(tmp_path: Path) -> None:
    document = Document()
    mesh = document.mesh()
    document.node(mesh=mesh, children=[1], rotation=QUARTER, scale=[1, 2, 3])
    document.node(mesh=mesh, translation=[0, 4, 0], scale=[-1, 1, 1])
    path = document.write(tmp_path / "a.gltf")
    scene, whole = read_scene(path), read_surface(path)
    placed = [world_surface(scene, o) for o in scene.objects]
    assert np.allclose(np.concatenate([s.vertices for s in placed]), whole.vertices)
    volumes = [np.linalg.det(s.vertices[s.faces]).sum() / 6 for s in placed]
    assert np.allclose(volumes, [6.0, 6.0])  # faces look outwards, mirrored or not


def test_names_are_made_unique(tmp_path: Path) -> None:
    document = Document()
    mesh, other = document.mesh("m"), document.mesh("m")
    document.node(name="rack", children=[2, 3])
    document.node(name="shelf", mesh=mesh)
    document.node(name="shelf", mesh=mesh)
    document.node(mesh=other)
    scene = read_scene(document.write(tmp_path / "a.glb"))
    # in the order of the tree
    assert [(o.name, o.mesh) for o in scene.objects] == [
        ("rack/shelf", "m"),
        ("node_3", "m-2"),
        ("shelf", "m"),
    ]


def test_instances_of_one_node(tmp_path: Path) -> None:
    document = Document()
    mesh = document.mesh("bolt")
    places = np.array([[0, 0, 0], [0, 0, 5], [0, 1, 0]], "<f4")
    attributes = {"TRANSLATION": document.accessor(places)}
    extension = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    document.node(name="bolts", mesh=mesh, scale=[2, 2, 2], extensions=extension)
    scene = read_scene(document.write(tmp_path / "a.glb", extensionsRequired=["EXT_mesh_gpu_instancing"]))
    assert [(o.name, o.instance) for o in scene.objects] == [("bolts/0", 0), ("bolts/1", 1), ("bolts/2", 2)]
    assert np.allclose([o.transform[:3, 3] for o in scene.objects], 2.0 * places)


def test_what_cannot_be_weathered_says_why(tmp_path: Path) -> None:
    document = Document()
    mesh = document.mesh()
    morphed = document.mesh(targets=[{"POSITION": document.accessor(CUBE.vertices.astype("<f4"))}])
    lines = document.mesh(mode=1)
    document.node(name="skinned", mesh=mesh, skin=0)
    document.node(name="morphed", mesh=morphed)
    document.node(name="flat", mesh=mesh, scale=[1, 0, 1])
    document.node(name="wire", mesh=lines)
    document.node(name="plain", mesh=mesh)
    document.node(name="sheet", mesh=mesh, scale=[2, 1, 0.001])
    scene = read_scene(document.write(tmp_path / "a.glb", skins=[{"joints": [0]}]))
    assert {o.name: o.kept for o in scene.objects} == {
        "skinned": "it is skinned",
        "morphed": "it has morph targets",
        "flat": "its transform flattens it",
        "plain": "",
        "sheet": "",
    }
    assert [(note.code, note.count) for note in scene.notes] == [("W-OBJECT", 3), ("W-OBJECT", 1)]


def test_moving_objects_are_named(tmp_path: Path) -> None:
    document = Document()
    mesh = document.mesh()
    document.node(name="arm", children=[1])
    document.node(name="hand", mesh=mesh)
    document.node(name="wall", mesh=mesh)
    sampler = {
        "input": document.accessor(np.array([0, 1], "<f4")),
        "output": document.accessor(np.zeros((2, 3), "<f4")),
    }
    channels = [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]
    scene = read_scene(
        document.write(tmp_path / "a.glb", animations=[{"channels": channels, "samplers": [sampler]}])
    )
    assert [(note.code, note.count) for note in scene.notes] == [("W-ANIMATION", 1)]


@pytest.mark.parametrize(
    ("name", "content", "error"),
    [
        ("a.glb", b"", EmptyFileError),
        ("a.obj", b"v 0 0 0\n", FormatError),
        ("a.glb", b"nothing of the kind", CorruptError),
        ("a.gltf", b'{"asset": {"version": "2.0"}, "nodes": [{"mesh": 0}]}', CorruptError),
        ("a.gltf", b'{"asset": {"version": "2.0"}}', NoFacesError),
        ("a.gltf", b'{"asset": 2}', CorruptError),
    ],
)
def test_broken_files_are_named(name: str, content: bytes, error: type[Exception], tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(error) as caught:
        read_scene(path)
    assert caught.value.file == str(path)  # type: ignore[attr-defined]


def test_the_limit_of_faces_is_that_of_all_meshes(tmp_path: Path) -> None:
    document = Document()
    for _ in range(3):
        document.node(mesh=document.mesh())
    path = document.write(tmp_path / "a.glb")
    assert len(read_scene(path, max_faces=36).objects) == 3
    with pytest.raises(LimitError, match="35 triangles"):
        read_scene(path, max_faces=35)
