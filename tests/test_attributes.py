"""What the model has goes through a run, and comes back with its snapshots."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from weathercoat.config.load import load_config
from weathercoat.finished import open_run
from weathercoat.mesh.read import read_surface, side_files
from weathercoat.run import run_asset

STEPS = [
    "remesh.faces=800",
    "ageing.steps=30",
    "ageing.duration=3",
    "snapshots.steps=[0, 30]",
    "output.preview=off",
]


def write_crate(folder: Path) -> Path:
    """An OBJ of two objects and two materials, one of them with a picture, mirrored on one side."""
    Image.fromarray(np.full((8, 8, 3), (200, 40, 30), np.uint8)).save(folder / "planks.png")
    (folder / "crate.mtl").write_text(
        "newmtl wood\nKd 0.5 0.5 0.5\nmap_Kd -s 1 1 1 planks.png\nNs 10\n"
        "newmtl iron\nKd 0.2 0.2 0.3\nPm 1\nPr 0.4\nd 0.5\nmap_Kd missing.png\n"
    )
    lines = ["mtllib crate.mtl"]
    for k, (name, material) in enumerate((("lid", "wood"), ("band", "iron"))):
        x = 3.0 * k
        lines += [f"o {name}", f"usemtl {material}"]
        lines += [f"v {x + u} {v} 0 {u} {v} 0.5" for u, v in ((0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1))]
        lines += [f"vt {u} {v}" for u, v in ((0, 0), (1, 0), (0, 0), (0, 1), (1, 1), (0, 1))]
        lines += ["vn 0 0 1"]
        a = 6 * k
        for corners in ((1, 2, 5), (1, 5, 4), (2, 3, 6), (2, 6, 5)):
            lines += ["f " + " ".join(f"{a + c}/{a + c}/{k + 1}" for c in corners)]
    path = folder / "crate.obj"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_an_obj_is_read_with_its_materials_parts_and_normals(tmp_path: Path) -> None:
    model = read_surface(write_crate(tmp_path))
    assert [(part.name, model.materials[part.material].name) for part in model.parts] == [
        ("lid", "wood"),
        ("band", "iron"),
    ]
    wood, iron = model.materials
    assert wood.base_texture is not None and wood.base_texture.mime == "image/png"
    assert wood.base_texture.image == (tmp_path / "planks.png").read_bytes()
    assert wood.base_color == (1.0, 1.0, 1.0, 1.0)
    assert iron.base_texture is None and iron.base_color[3] == 0.5
    assert iron.entry["pbrMetallicRoughness"]["metallicFactor"] == 1.0
    np.testing.assert_array_equal(model.normals, np.broadcast_to([0.0, 0.0, 1.0], model.normals.shape))
    assert {note.code for note in model.notes} >= {"W-MATERIAL"}
    beside = {path.name for path in side_files(tmp_path / "crate.obj")}
    assert beside == {"crate.mtl", "planks.png"}


@pytest.mark.parametrize("more", [[], ["remesh=off"]], ids=["remeshed", "as it is"])
def test_a_run_keeps_what_the_model_has(tmp_path: Path, more: list[str]) -> None:
    model = read_surface(write_crate(tmp_path))
    faces = [] if more else STEPS[:1]
    run_asset(load_config("standard", [*faces, *STEPS[1:], *more]), tmp_path / "crate.obj", tmp_path / "out")
    run = open_run(tmp_path / "out")
    for step in (0, 30):
        snapshot = run.read_snapshot(step)
        surface = snapshot.surface
        assert surface is not None and surface.place is not None
        assert surface.groups == model.groups
        assert [part.name for part in surface.parts] == ["lid", "band"]
        assert [part.material for part in surface.parts] == [0, 1]
        corner = surface.vertices[surface.faces]
        u = np.where(corner[..., 0] < 2.5, corner[..., 0], corner[..., 0] - 3.0)
        expected = np.stack([1.0 - np.abs(u - 1.0), corner[..., 1]], axis=2)
        np.testing.assert_allclose(surface.uv, expected, atol=1e-6)
        at = np.einsum(
            "nij,ni->nj", model.vertices[model.faces[surface.place.face]], surface.place.barycentric
        )
        np.testing.assert_allclose(at, surface.vertices, atol=1e-6)
        color = np.stack([np.minimum(u, 1.0), corner[..., 1]], axis=2)  # beyond 1 it is clipped
        found = surface.colors[surface.faces][..., :2]
        np.testing.assert_allclose(found, color, atol=0.6 / 255)
    assert sorted(run.report["inputs"]) == ["crate.mtl", "crate.obj", "planks.png"]
    np.testing.assert_array_equal(run.read_model().uv, model.uv)


def test_parts_without_paint_leave_places_on_the_whole_model(tmp_path: Path) -> None:
    model = read_surface(write_crate(tmp_path))
    run_asset(load_config("standard", [*STEPS, "paint.only=iron"]), tmp_path / "crate.obj", tmp_path / "out")
    surface = open_run(tmp_path / "out").read_snapshot().surface
    assert surface is not None and surface.place is not None
    at = np.einsum("nij,ni->nj", model.vertices[model.faces[surface.place.face]], surface.place.barycentric)
    np.testing.assert_allclose(at, surface.vertices, atol=1e-6)
    assert surface.vertices[:, 0].min() > 2.5


def test_no_steps_record_the_intact_start(tmp_path: Path) -> None:
    config = load_config("standard", ["remesh.faces=800", "ageing.steps=0", "output.preview=off"])
    report = run_asset(config, write_crate(tmp_path), tmp_path / "out")
    assert [(row["step"], row["age"], row["affected_share"]) for row in report["snapshots"]] == [
        (0, 0.0, 0.0)
    ]
    snapshot = open_run(tmp_path / "out").read_snapshot()
    assert not snapshot.separated.any() and len(snapshot.film_faces) == len(snapshot.substrate_faces)
    assert run_asset(config, tmp_path / "crate.obj", tmp_path / "out", resume=True)["snapshots"]


def test_a_gltf_is_read_with_its_nodes_materials_and_normals(tmp_path: Path) -> None:
    position = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4")
    normal = np.array([[0, 0.6, 0.8]] * 3, "<f4")
    picture = (b"\x89PNG not really a picture").ljust(28)
    blob = position.tobytes() + normal.tobytes() + np.arange(3, dtype="<u4").tobytes() + picture
    lengths = [36, 36, 12, len(picture)]
    starts = np.cumsum([0, *lengths]).tolist()
    document = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [
            {"name": "frame", "children": [1], "translation": [0, 0, 5]},
            {"name": "door", "mesh": 0, "scale": [-2, 1, 1]},
        ],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1}, "indices": 2, "material": 1}]}
        ],
        "materials": [
            {"name": "unused"},
            {"name": "oak", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}},
        ],
        "textures": [{"source": 0, "sampler": 0}],
        "samplers": [{"wrapS": 33071}],
        "images": [{"bufferView": 3, "mimeType": "image/png"}],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": 3,
                "type": "VEC3",
                "min": [0, 0, 0],
                "max": [1, 1, 0],
            },
            {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 2, "componentType": 5125, "count": 3, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": at, "byteLength": length}
            for at, length in zip(starts, lengths, strict=False)
        ],
        "buffers": [{"byteLength": len(blob)}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    header = struct.pack("<4sIII4s", b"glTF", 2, 28 + len(text) + len(blob), len(text), b"JSON")
    path = tmp_path / "door.glb"
    path.write_bytes(header + text + struct.pack("<I4s", len(blob), b"BIN\0") + blob)
    model = read_surface(path)
    (part,) = model.parts
    assert (part.name, part.node, model.materials[part.material].name) == ("door", 1, "oak")
    assert np.reshape(part.matrix, (4, 4))[:3, 3].tolist() == [0, 0, 5]
    texture = model.materials[1].base_texture
    assert texture is not None and (texture.image, texture.sampler) == (picture, {"wrapS": 33071})
    np.testing.assert_allclose(model.normals, np.broadcast_to([0.0, 0.6, 0.8], (1, 3, 3)), atol=1e-6)
