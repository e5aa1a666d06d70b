"""A textured GLB goes in and comes back textured, weathered, and named as before."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import igl
import numpy as np
import pytest
import trimesh
from PIL import Image

from tests.output.textured import NODES, picture, write_gate
from tests.output.validator import validate
from weathercoat.config.load import load_config
from weathercoat.export import ExportParameters, export_run
from weathercoat.finished import open_run
from weathercoat.mesh.formats.gltf_document import FLOATS, GltfDocument
from weathercoat.mesh.materials import SourceMaterial, Texture
from weathercoat.mesh.read import read_surface
from weathercoat.output.glb import GlbBuffer, Material, MaterialTable
from weathercoat.run import run_asset

SETTINGS = [
    "remesh.faces=2000",
    "ageing.steps=60",
    "snapshots.steps=[0, 60]",
    "output.preview=off",
    "adhesion.base=0.6",
]


@pytest.fixture(scope="module")
def gate(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The model, and the folder of its run."""
    folder = tmp_path_factory.mktemp("gate")
    model = write_gate(folder / "gate.glb")
    run_asset(load_config("rusting", SETTINGS), model, folder / "out")
    return model, folder / "out" / "snapshots"


def document_of(path: Path) -> dict[str, Any]:
    return GltfDocument(path.read_bytes(), None).json


def primitives_of(document: dict[str, Any], node: int, role: str) -> list[dict[str, Any]]:
    mesh = document["meshes"][document["nodes"][node]["mesh"]]
    return [p for p in mesh["primitives"] if p["extras"]["role"] == role]


@pytest.mark.parametrize("step", [0, 60])
def test_names_transforms_materials_and_pictures_come_back(gate: tuple[Path, Path], step: int) -> None:
    document = document_of(gate[1] / f"step_{step:04}.glb")
    for before, after in zip(NODES, document["nodes"], strict=False):
        assert {key: value for key, value in before.items() if key != "mesh"} == {
            key: value for key, value in after.items() if key != "mesh"
        }
    for node in (1, 2):
        fronts = primitives_of(document, node, "film")
        names = [document["materials"][primitive["material"]]["name"] for primitive in fronts]
        assert names == ["oak panel", "blue frame"]
        for primitive, color in zip(fronts, ((170, 110, 60), (60, 90, 150)), strict=True):
            material = document["materials"][primitive["material"]]
            texture = document["textures"][material["pbrMetallicRoughness"]["baseColorTexture"]["index"]]
            assert document["samplers"][texture["sampler"]] == {"wrapS": 33071, "wrapT": 33648}
            view = document["bufferViews"][document["images"][texture["source"]]["bufferView"]]
            content = (gate[1] / f"step_{step:04}.glb").read_bytes()
            start = content.index(b"BIN\0") + 4 + view["byteOffset"]
            assert content[start : start + view["byteLength"]] == picture(color)
            assert material["doubleSided"] is True
            assert {"TEXCOORD_0", "COLOR_0", "NORMAL"} <= set(primitive["attributes"])
        assert len(primitives_of(document, node, "substrate")) == 2


def test_an_independent_reader_sees_the_texture_where_it_was(gate: tuple[Path, Path]) -> None:
    """Through trimesh: at the places of the model's surface the film shows the same texels as the model."""
    model, snapshots = gate
    before = trimesh.load(model, process=False)
    after = trimesh.load(snapshots / "step_0000.glb", process=False)
    np.testing.assert_allclose(after.bounds, before.bounds, atol=0.02)
    checked = 0
    for node in ("left wing", "right wing"):
        for name in ("oak panel", "blue frame"):
            (own,), (front,) = (placed(scene, node, name) for scene in (before, after))
            centers = np.ascontiguousarray(front.triangles_center)
            squared, face, near = igl.point_mesh_squared_distance(centers, own.vertices, own.faces)
            assert squared.max() < 0.02**2  # the front lies as high as the film is thick
            weights = trimesh.triangles.points_to_barycentric(own.triangles[face], near)
            expected = np.einsum("ni,nij->nj", weights, own.visual.uv[own.faces[face]])
            found = front.visual.uv[front.faces].mean(axis=1)
            error = np.abs(found - expected).max(axis=1)
            assert np.median(error) < 1e-6
            assert error.max() < 0.01  # the front draws back from its rims by half of its thickness
            checked += len(near)
    assert checked > 1000


def placed(scene: trimesh.Scene, node: str, material: str) -> list[trimesh.Trimesh]:
    """The meshes of a node with a material, in the scene's axes; trimesh splits meshes by their materials."""
    found = []
    for name in scene.graph.nodes_geometry:
        matrix, geometry = scene.graph.get(name)
        mesh = scene.geometry[geometry]
        if name.startswith(node) and mesh.visual.material.name == material:
            found.append(mesh.copy().apply_transform(matrix))
    return found


def test_stains_tint_what_the_material_shows(gate: tuple[Path, Path]) -> None:
    fresh, aged = (trimesh.load(gate[1] / f"step_{step:04}.glb", process=False) for step in (0, 60))

    def tints(scene: trimesh.Scene) -> np.ndarray:
        names = ("oak panel", "blue frame")
        fronts = [m for m in scene.geometry.values() if m.visual.material.name in names]
        return np.concatenate([front.visual.vertex_attributes["color"] for front in fronts])

    fresh_tints, aged_tints = tints(fresh), tints(aged)
    full = 1.0 if fresh_tints.dtype.kind == "f" else np.iinfo(fresh_tints.dtype).max
    assert fresh_tints[:, :3].min() > 0.99 * full
    assert aged_tints[:, :3].min() < 0.8 * full


def test_khronos_finds_nothing_wrong(gate: tuple[Path, Path]) -> None:
    for path in sorted(gate[1].glob("*.glb")):
        issues = validate(path)
        assert (issues["numErrors"], issues["numWarnings"]) == (0, 0), issues["messages"][:5]


def test_the_result_reads_back_as_a_model(gate: tuple[Path, Path]) -> None:
    surface = read_surface(gate[1] / "step_0060.glb")
    assert {material.name for material in surface.materials} >= {"oak panel", "blue frame", "metal"}
    base = next(m for m in surface.materials if m.name == "oak panel").base_texture
    assert base is not None
    assert Image.open(io.BytesIO(base.image)).size == (16, 16)


@pytest.mark.parametrize(("formats", "lods"), [(("animation",), 0), (("glb",), 2)])
def test_khronos_finds_nothing_wrong_in_exports(
    gate: tuple[Path, Path], tmp_path: Path, formats: tuple[str, ...], lods: int
) -> None:
    if lods:
        pytest.importorskip("pyfqmr")
    model, snapshots = gate
    parameters = ExportParameters(formats, steps=[0, 60], lods=lods, model=read_surface(model))
    files = export_run(open_run(snapshots.parent), tmp_path, parameters)
    assert len(files) == (6 if lods else 1)
    for path in files:
        issues = validate(path)
        assert (issues["numErrors"], issues["numWarnings"]) == (0, 0), issues["messages"][:5]


def test_an_animation_shows_one_snapshot_at_a_time_and_stores_pictures_once(
    gate: tuple[Path, Path], tmp_path: Path
) -> None:
    model, snapshots = gate
    parameters = ExportParameters(("animation",), steps=[0, 60], model=read_surface(model))
    (path,) = export_run(open_run(snapshots.parent), tmp_path, parameters)
    document = GltfDocument(path.read_bytes(), None)
    (animation,) = document.json["animations"]
    scales = [
        document.accessor(sampler["output"], ("VEC3",), FLOATS)[:, 0] for sampler in animation["samplers"]
    ]
    np.testing.assert_array_equal(np.sum(scales, axis=0), 1.0)
    assert len(document.json["images"]) == 2
    assert {"oak panel", "blue frame"} <= {material["name"] for material in document.json["materials"]}


@pytest.mark.parametrize("kind", ["BMP", "TGA", "GIF", "TIFF"])
def test_pictures_that_gltf_cannot_hold_become_png(kind: str) -> None:
    """Material libraries of OBJ name such pictures; no extension of glTF allows them."""
    pixels = np.arange(8 * 8 * 3, dtype=np.uint8).reshape(8, 8, 3)
    source = Image.fromarray(pixels)
    if kind == "GIF":
        source = source.quantize(64)
    stream = io.BytesIO()
    source.save(stream, kind)
    buffer, document = GlbBuffer(), dict[str, Any]()
    table = MaterialTable(buffer)
    table.number(textured_material(Texture(stream.getvalue(), "image/png", "skin")))
    table.add_to(document)
    assert not {"extensionsUsed", "extensionsRequired"} & set(document)
    assert [image["mimeType"] for image in document["images"]] == ["image/png"]
    with Image.open(io.BytesIO(buffer.pieces[0])) as shown:
        assert shown.format == "PNG"
        np.testing.assert_array_equal(np.asarray(shown.convert("RGB")), np.asarray(source.convert("RGB")))


@pytest.mark.parametrize(
    ("place", "is_kept"),
    [
        ({}, True),
        ({"texCoord": 1}, False),
        ({"extensions": {"KHR_texture_transform": {"texCoord": 1}}}, False),
        ({"texCoord": 1, "extensions": {"KHR_texture_transform": {"texCoord": 0}}}, True),
    ],
)
def test_textures_of_second_coordinates_go(place: dict[str, Any], is_kept: bool) -> None:
    table = MaterialTable(GlbBuffer())
    table.number(textured_material(Texture(picture((9, 8, 7)), "image/png"), place))
    assert ("baseColorTexture" in table.entries[0]["pbrMetallicRoughness"]) is is_kept
    assert "texCoord" not in str(table.entries[0])


def test_a_picture_that_cannot_be_decoded_is_left_out() -> None:
    table = MaterialTable(GlbBuffer())
    table.number(textured_material(Texture(b"no picture", "image/png")))
    assert table.entries[0]["pbrMetallicRoughness"] == {}
    assert table.images == []


def textured_material(texture: Texture, place: dict[str, Any] | None = None) -> Material:
    entry = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, **(place or {})}}}
    return Material("skin", 0.0, 1.0, True, source=SourceMaterial("skin", entry, (texture,)))
