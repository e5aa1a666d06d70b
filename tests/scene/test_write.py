"""The written scene: what another reader makes of its names, places and colours, and what stayed."""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from tests.output.snapshots import make_snapshot
from tests.scene.documents import CUBE, Document
from tests.scene.test_graph import make_transform
from weathercoat.errors import CorruptError, OutputExistsError
from weathercoat.mesh.shapes import make_sphere
from weathercoat.mesh.surface import make_surface
from weathercoat.output.meshes import write_mesh
from weathercoat.output.sheets import srgb_to_linear
from weathercoat.scene.graph import AgedMesh, Scene, decompose, place
from weathercoat.scene.read import read_scene
from weathercoat.scene.write import write_scene

PNG = bytes.fromhex(
    "89504e470d0a1a0a0000000d4948445200000001000000010802000000907753de0000000c49444154789c63f8cfc0000003010100"
    "c9fe92ef0000000049454e44ae426082"
)


def aged_cube(stretch: np.ndarray | None = None, **more: Any) -> AgedMesh:
    """A cube half of whose film has fallen."""
    vertices = CUBE.vertices if stretch is None else place(CUBE.vertices, stretch)
    snapshot = make_snapshot(mesh=(vertices, CUBE.faces), lost=6)
    return AgedMesh(snapshot, stretch=np.eye(3) if stretch is None else stretch, **more)


def write(
    scene: Scene, folder: Path, aged: Mapping[str, str], films: Mapping[str, AgedMesh]
) -> tuple[dict[str, Any], bytes]:
    """Write `folder`/out.glb; its JSON and its binary chunk."""
    write_scene(folder / "out.glb", scene, aged, films)
    content = (folder / "out.glb").read_bytes()
    (length,) = struct.unpack_from("<I", content, 12)
    return json.loads(content[20 : 20 + length]), content[28 + length :]


def world_points(path: Path) -> dict[str, np.ndarray]:
    """What trimesh finds at each node, and at those it makes of it for primitives: points in the world."""
    scene = trimesh.load(path, process=False)
    found: dict[str, list[np.ndarray]] = {}
    for node in scene.graph.nodes_geometry:
        matrix, geometry = scene.graph[node]
        found[node] = trimesh.transform_points(scene.geometry[geometry].vertices, matrix)
    return found


@pytest.fixture
def row(tmp_path: Path) -> Scene:
    """Four drums of one mesh below a turned node: one mirrored, one stretched; and a wall of another mesh."""
    document = Document()
    drum, wall = document.mesh("drum"), document.mesh("wall")
    document.node(name="row", children=[1, 2, 3, 4], matrix=make_transform(3).T.ravel().tolist())
    document.node(name="a", mesh=drum, translation=[1, 2, 3], extras={"asset": 7})
    document.node(name="b", mesh=drum, scale=[-1, 1, 1])
    document.node(name="c", mesh=drum, scale=[1, 3, 0.5], rotation=[0.6, 0, 0, 0.8])
    document.node(name="d", mesh=drum)
    document.node(name="wall", mesh=wall)
    return read_scene(document.write(tmp_path / "in.glb"))


def test_names_and_transforms_are_those_of_the_input(row: Scene, tmp_path: Path) -> None:
    aged = {"a": "drum", "b": "drum", "c": "drum", "d": "other"}
    document, _ = write(row, tmp_path, aged, {"drum": aged_cube(), "other": aged_cube()})
    before = json.loads(json.dumps(row.source.json))  # type: ignore[union-attr]
    for old, new in zip(before["nodes"], document["nodes"], strict=True):
        assert {k: v for k, v in old.items() if k != "mesh"} == {k: v for k, v in new.items() if k != "mesh"}
    # the wall, then one mesh for each variant, which the three drums share
    assert [mesh["name"] for mesh in document["meshes"]] == ["wall", "drum", "other"]
    assert [node.get("mesh") for node in document["nodes"]] == [None, 1, 1, 1, 2, 0]
    ours, theirs = trimesh.load(tmp_path / "out.glb"), trimesh.load(tmp_path / "in.glb")
    for name in theirs.graph.nodes:
        assert np.allclose(ours.graph[name][0], theirs.graph[name][0])


def test_what_is_seen_lies_where_the_input_lay(row: Scene, tmp_path: Path) -> None:
    write(row, tmp_path, dict.fromkeys("abcd", "drum"), {"drum": aged_cube()})
    found, objects = world_points(tmp_path / "out.glb"), {o.name: o for o in row.objects}
    for name in "abcd":
        points = np.concatenate([v for node, v in found.items() if node.startswith(name)])
        expected = place(CUBE.vertices, objects[name].transform)
        # film where the surface was, metal a hair within
        assert np.allclose(points.min(axis=0), expected.min(axis=0), atol=1e-5)
        assert np.allclose(points.max(axis=0), expected.max(axis=0), atol=1e-5)
    again = read_scene(tmp_path / "out.glb")
    assert [(o.name, o.node) for o in again.objects] == [(o.name, o.node) for o in row.objects]
    for ours, theirs in zip(again.objects, row.objects, strict=True):
        assert np.array_equal(ours.transform, theirs.transform)


def test_faces_look_outwards_under_mirrors_and_stretches(row: Scene, tmp_path: Path) -> None:
    """In the mesh's own coordinates the volume of the metal is positive, as the format asks, and that of the
    cube, whatever the size that it was aged in.
    """
    films = {o.name: aged_cube(decompose(o.transform)[1]) for o in row.objects}
    document, body = write(row, tmp_path, {o.name: o.name for o in row.objects}, films)
    for thing in row.objects:
        metal = primitive(document, thing.node, "metal")
        points = array(document, body, metal["attributes"]["POSITION"]).astype(np.float64)
        corner = points[array(document, body, metal["indices"]).reshape(-1, 3)]
        assert np.linalg.det(corner).sum() / 6 == pytest.approx(1.0, rel=0.05)


def test_normals_survive_a_stretch(row: Scene, tmp_path: Path) -> None:
    """A ball that was aged as an ellipsoid, and is one, has the normals of a ball in its own coordinates."""
    ball, stretch = make_sphere(0.5, 3), np.diag([1.0, 3.0, 0.5])
    film = AgedMesh(make_snapshot(mesh=(place(ball.vertices, stretch), ball.faces)), stretch=stretch)
    document, body = write(row, tmp_path, {"a": "v"}, {"v": film})
    metal = primitive(document, 1, "metal")
    points = array(document, body, metal["attributes"]["POSITION"])
    normals = array(document, body, metal["attributes"]["NORMAL"])
    assert (np.sum(points * normals, axis=1) > 0.98 * np.linalg.norm(points, axis=1)).all()


def primitive(document: dict[str, Any], node: int | None, material: str) -> dict[str, Any]:
    """The first primitive of a node's mesh that has a material of this name."""
    assert node is not None
    mesh: dict[str, Any] = document["meshes"][document["nodes"][node]["mesh"]]
    return next(p for p in mesh["primitives"] if document["materials"][p["material"]]["name"] == material)


def array(document: dict[str, Any], body: bytes, number: int) -> np.ndarray:
    accessor = document["accessors"][number]
    view = document["bufferViews"][accessor["bufferView"]]
    kind = {5126: "<f4", 5125: "<u4", 5123: "<u2"}[accessor["componentType"]]
    width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}[accessor["type"]]
    values = np.frombuffer(body, kind, accessor["count"] * width, view["byteOffset"])
    return values.reshape(-1, width) if width > 1 else values


def test_colors_and_materials_are_those_of_snapshots(row: Scene, tmp_path: Path) -> None:
    film = aged_cube(thickness=0.01, back_color=(1.0, 0.0, 0.0))
    document, body = write(row, tmp_path, {"a": "x"}, {"x": film})
    primitives = document["meshes"][document["nodes"][1]["mesh"]]["primitives"]
    names = [document["materials"][p["material"]]["name"] for p in primitives]
    assert names == ["paint", "primer", "primer", "metal"]
    front = array(document, body, primitives[0]["attributes"]["COLOR_0"])
    linear = srgb_to_linear(film.snapshot.film_color)
    lowest, highest = linear.min(axis=0), linear.max(axis=0)
    assert (front >= lowest - 1e-6).all() and (front <= highest + 1e-6).all()
    assert np.allclose(array(document, body, primitives[1]["attributes"]["COLOR_0"]), [1, 0, 0])
    assert {"_RUST", "_DIRT", "_BARE"} <= primitives[3]["attributes"].keys()


def test_unweathered_objects_keep_their_bytes_materials_and_textures(tmp_path: Path) -> None:
    document = Document()
    uv = document.accessor(np.zeros((8, 4), "<f4"))  # not read, carried along
    picture = len(document.json["bufferViews"])
    document.json["bufferViews"].append(
        {"buffer": 0, "byteOffset": len(document.body), "byteLength": len(PNG), "name": "picture"}
    )
    document.body += PNG + bytes(-len(PNG) % 4)
    gone, kept = document.mesh("gone", material=1), document.mesh("kept", material=0)
    document.json["meshes"][kept]["primitives"][0]["attributes"]["_MARK"] = uv
    document.node(name="aged", mesh=gone)
    document.node(name="plain", mesh=kept, extensions={"KHR_lights_punctual": {"light": 0}})
    (tmp_path / "beside.png").write_bytes(PNG)
    path = document.write(
        tmp_path / "in.gltf",
        materials=[
            {"name": "brick", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}},
            {"name": "x"},
        ],
        textures=[{"source": 0}],
        images=[{"bufferView": picture, "mimeType": "image/png"}, {"uri": "beside.png"}, {"uri": "none.png"}],
        extensionsUsed=["KHR_lights_punctual"],
        extensions={"KHR_lights_punctual": {"lights": [{"type": "point"}]}},
        asset={"version": "2.0", "copyright": "me", "extras": {"a": 1}},
    )
    source = read_scene(path)
    before = json.dumps(source.source.json)  # type: ignore[union-attr]
    out, body = write(source, tmp_path, {"aged": "v"}, {"v": aged_cube()})
    assert json.dumps(source.source.json) == before  # type: ignore[union-attr]
    assert out["asset"]["copyright"] == "me" and out["asset"]["extras"] == {"a": 1}
    assert out["extensions"]["KHR_lights_punctual"]["lights"] == [{"type": "point"}]
    assert out["nodes"][1]["extensions"] == {"KHR_lights_punctual": {"light": 0}}
    assert out["materials"][0]["name"] == "brick"
    plain = out["meshes"][out["nodes"][1]["mesh"]]["primitives"][0]
    assert plain["material"] == 0
    assert np.array_equal(array(out, body, plain["attributes"]["POSITION"]), CUBE.vertices.astype("<f4"))
    assert np.array_equal(array(out, body, plain["indices"]).reshape(-1, 3), CUBE.faces)
    for image in out["images"][:2]:
        view = out["bufferViews"][image["bufferView"]]
        assert body[view["byteOffset"] :][: view["byteLength"]] == PNG and image["mimeType"] == "image/png"
    assert out["images"][2] == {"uri": "none.png"}
    # the bytes of the mesh that nothing shows any more are gone
    primitives = [p for mesh in out["meshes"] for p in mesh["primitives"]]
    used = {p["indices"] for p in primitives}.union(*(p["attributes"].values() for p in primitives))
    assert used == set(range(len(out["accessors"])))
    views = {a["bufferView"] for a in out["accessors"]} | {i["bufferView"] for i in out["images"][:2]}
    assert views == set(range(len(out["bufferViews"])))


def test_animations_and_skins_keep_their_accessors(tmp_path: Path) -> None:
    document = Document()
    gone = document.mesh("gone")
    times, moves = np.array([0, 1], "<f4"), np.array([[0, 0, 0], [5, 6, 7]], "<f4")
    sampler = {"input": document.accessor(times), "output": document.accessor(moves)}
    matrices = document.accessor(np.eye(4, dtype="<f4")[:, :3].reshape(-1, 3))
    skinned = document.mesh("skinned")
    document.node(name="mover", mesh=gone, children=[1])
    document.node(name="figure", mesh=skinned, skin=0)
    animation = {
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}],
        "samplers": [sampler],
    }
    path = document.write(
        tmp_path / "in.glb", animations=[animation], skins=[{"joints": [0], "inverseBindMatrices": matrices}]
    )
    out, body = write(read_scene(path), tmp_path, {"mover": "v"}, {"v": aged_cube()})
    kept = out["animations"][0]["samplers"][0]
    assert np.array_equal(array(out, body, kept["input"]), times)
    assert np.array_equal(array(out, body, kept["output"]), moves)
    assert out["skins"][0]["inverseBindMatrices"] == 2
    assert [mesh["name"] for mesh in out["meshes"]] == ["skinned", "v"]


def test_materials_and_pictures_go_with_what_alone_shows_them(tmp_path: Path) -> None:
    document = Document()
    document.json["bufferViews"] += [{"buffer": 0, "byteLength": 4 * i} for i in (1, 2, 3)]
    document.body = bytes(12)
    aged = document.mesh("aged", material=0)
    shared = document.mesh("shared", material=1)
    kept = document.mesh("kept", material=1)
    several = document.mesh("several", material=2)
    document.json["meshes"][several]["primitives"].append(
        {**document.json["meshes"][several]["primitives"][0], "material": 3}
    )
    extensions = {"KHR_materials_variants": {"mappings": [{"material": 4, "variants": [0]}]}}
    document.json["meshes"][kept]["primitives"][0]["extensions"] = extensions
    for name, mesh in (("a", aged), ("b", shared), ("c", kept), ("d", several)):
        document.node(name=name, mesh=mesh)

    def textured(name: str, index: int) -> dict[str, Any]:
        coat = {"KHR_materials_clearcoat": {"clearcoatTexture": {"index": index}}}
        return {"name": name, "extensions": coat, "extras": {"index": index}}

    path = document.write(
        tmp_path / "in.glb",
        materials=[textured("m0", 0), textured("m1", 1), {"name": "m2"}, {"name": "m3"}, textured("m4", 2)],
        textures=[{"source": 0}, {"source": 1}, {"extensions": {"KHR_texture_basisu": {"source": 2}}}],
        images=[{"bufferView": i, "mimeType": "image/png", "name": f"i{i}"} for i in range(3)],
        extensionsUsed=["KHR_materials_variants", "KHR_materials_clearcoat", "KHR_texture_basisu"],
    )
    film = aged_cube()
    out, _ = write(read_scene(path), tmp_path, {"a": "v", "b": "v", "d": "v"}, {"v": film})
    assert [m["name"] for m in out["materials"]] == ["m1", "m2", "m3", "m4", "paint", "metal"]
    assert [i["name"] for i in out["images"]] == ["i1", "i2"]
    first = out["meshes"][0]["primitives"][0]
    assert first["material"] == 0
    assert first["extensions"]["KHR_materials_variants"]["mappings"][0]["material"] == 3
    coats = [out["materials"][i]["extensions"]["KHR_materials_clearcoat"] for i in (0, 3)]
    assert [coat["clearcoatTexture"]["index"] for coat in coats] == [0, 1]
    assert out["textures"] == [{"source": 0}, {"extensions": {"KHR_texture_basisu": {"source": 1}}}]
    assert [out["bufferViews"][i["bufferView"]]["byteLength"] for i in out["images"]] == [8, 12]


def test_views_that_begin_between_words_are_read_the_same(tmp_path: Path) -> None:
    document = Document()
    document.node(name="a", mesh=document.mesh())
    positions, indices = document.json["bufferViews"]
    document.body = bytes(2) + document.body
    positions["byteOffset"], indices["byteOffset"] = 0, indices["byteOffset"] + 2
    positions["byteLength"] += 2
    document.json["accessors"][0]["byteOffset"] = 2
    with pytest.raises(CorruptError, match="multiple"):  # floats at byte 2
        read_scene(document.write(tmp_path / "in.glb"))
    document.body = bytes(2) + document.body
    positions["byteOffset"], indices["byteOffset"] = 2, indices["byteOffset"] + 2
    scene = read_scene(document.write(tmp_path / "in.glb"))
    write(scene, tmp_path, {}, {})
    again = read_scene(tmp_path / "out.glb")
    assert np.array_equal(again.meshes["mesh_0"].vertices, scene.meshes["mesh_0"].vertices)


def test_accessors_stay_where_an_unknown_extension_may_mean_them(tmp_path: Path) -> None:
    document = Document()
    document.node(name="a", mesh=document.mesh())
    path = document.write(tmp_path / "in.glb", extensionsUsed=["ACME_points"])
    out, _ = write(read_scene(path), tmp_path, {"a": "v"}, {"v": aged_cube()})
    assert [a["count"] for a in out["accessors"][:2]] == [8, 36]


def test_untouched_parts_keep_the_material_of_their_name(tmp_path: Path) -> None:
    document = Document()
    cart = document.mesh(material=1)
    primitives = document.json["meshes"][cart]["primitives"]
    primitives.append({**primitives[0], "material": 2})
    document.node(name="cart", mesh=cart)
    materials = [{"name": "metal"}, {"name": "rubber"}, {"name": "body"}]
    path = document.write(tmp_path / "in.glb", materials=materials)
    rubber = make_surface(CUBE.vertices + 2.0, CUBE.faces, groups=("rubber",))
    out, _ = write(read_scene(path), tmp_path, {"cart": "v"}, {"v": aged_cube(untouched=rubber)})
    primitives = out["meshes"][0]["primitives"]
    # the film's metal is not the material that happens to have this name
    assert [p["material"] for p in primitives] == [3, 4, 1]


def test_instances_of_one_node_stay_together_or_part(tmp_path: Path) -> None:
    document = Document()
    places = np.array([[0, 0, 0], [4, 0, 0], [8, 0, 0]], "<f4")
    extension = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": document.accessor(places)}}}
    document.node(name="bolts", mesh=document.mesh("bolt"), extensions=extension, scale=[2, 2, 2])
    names = ["EXT_mesh_gpu_instancing"]
    scene = read_scene(document.write(tmp_path / "in.glb", extensionsRequired=names, extensionsUsed=names))
    films = {"v": aged_cube(), "w": aged_cube()}
    one, body = write(scene, tmp_path, {f"bolts/{i}": "v" for i in range(3)}, films)
    assert one["extensionsRequired"] == names and len(one["nodes"]) == 1
    attributes = one["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]
    assert np.array_equal(array(one, body, attributes["TRANSLATION"]), places)
    (tmp_path / "out.glb").unlink()
    two, _ = write(scene, tmp_path, {"bolts/0": "v", "bolts/2": "w"}, films)
    assert "extensionsRequired" not in two and "extensions" not in two["nodes"][0]
    assert [two["meshes"][n["mesh"]]["name"] for n in two["nodes"][1:]] == ["v", "bolt", "w"]
    again = read_scene(tmp_path / "out.glb")
    assert [o.name for o in again.objects] == [o.name for o in scene.objects]
    for ours, theirs in zip(again.objects, scene.objects, strict=True):
        assert np.allclose(ours.transform, theirs.transform)


def test_far_from_its_origin_a_mesh_is_held_about_its_centre(tmp_path: Path) -> None:
    document = Document()
    document.node(name="a", mesh=document.mesh(), translation=[5, 0, 0])
    scene = read_scene(document.write(tmp_path / "in.glb"))
    far = 1e6 + CUBE.vertices
    film = AgedMesh(make_snapshot(mesh=(far, CUBE.faces)))
    out, body = write(scene, tmp_path, {"a": "v"}, {"v": film})
    assert out["nodes"][0] == {"name": "a", "translation": [5, 0, 0], "children": [1]}
    child = out["nodes"][1]
    assert child["translation"] == pytest.approx([1e6, 1e6 + 0.5, 1e6])
    front = out["meshes"][child["mesh"]]["primitives"][0]["attributes"]["POSITION"]
    points = array(out, body, front) + np.array(child["translation"])
    assert np.allclose(np.unique(points, axis=0), np.unique(far, axis=0), rtol=0, atol=1e-6)


YAML = """
up: z
camera: {position: [0, -9, 1], target: [0, 0, 0], field_of_view: 30}
objects:
  - {name: lying, model: box.obj, position: [5, 0, 0]}
instances:
  - {name: crate, model: box.obj, places: [{}, {position: [0, 3, 0], scale: [1, 1, -2]}]}
"""


def test_scenes_of_yaml_stand_upright(tmp_path: Path) -> None:
    write_mesh(tmp_path / "box.obj", CUBE)
    (tmp_path / "in.yaml").write_text(YAML)
    scene = read_scene(tmp_path / "in.yaml")
    out, _ = write(scene, tmp_path, {"crate/0": "v", "crate/1": "v"}, {"v": aged_cube()})
    assert [n.get("mesh") for n in out["nodes"]] == [0, 1, 1, None, None]
    found = world_points(tmp_path / "out.glb")
    assert {"lying"} <= found.keys() and any(name.startswith("crate/1") for name in found)
    mirrored = np.concatenate([v for name, v in found.items() if name.startswith("crate/1")])
    # z becomes y, and y becomes -z
    assert np.allclose(mirrored.min(axis=0), [-0.5, -1.0, -4.0], atol=1e-5)
    assert np.allclose(mirrored.max(axis=0), [0.5, 1.0, -3.0], atol=1e-5)
    again = read_scene(tmp_path / "out.glb")
    assert [o.name for o in again.objects] == ["lying", "crate/0", "crate/1"]
    assert again.camera is not None and again.camera.field_of_view == pytest.approx(30)
    assert np.allclose(again.camera.positions, [[0, 1, 9]])
    assert np.allclose(again.camera.directions, np.array([[0, -1, -9]]) / np.sqrt(82))


def test_the_path_of_a_yaml_camera_is_an_animation(tmp_path: Path) -> None:
    write_mesh(tmp_path / "box.obj", CUBE)
    views = "[{position: [0, 0, 5], target: [0, 0, 0]}, {position: [5, 0, 0], target: [0, 0, 0]}]"
    (tmp_path / "in.yaml").write_text(f"objects: [{{name: a, model: box.obj}}]\npath: {views}\n")
    write(read_scene(tmp_path / "in.yaml"), tmp_path, {}, {})
    camera = read_scene(tmp_path / "out.glb").camera
    assert camera is not None
    assert np.allclose(camera.positions[[0, -1]], [[0, 0, 5], [5, 0, 0]])
    assert np.allclose(camera.directions[[0, -1]], [[0, 0, -1], [-1, 0, 0]], atol=1e-6)


def test_the_same_bytes_again_and_no_file_overwritten(row: Scene, tmp_path: Path) -> None:
    aged, films = {"d": "y", "a": "x"}, {"x": aged_cube(), "y": aged_cube(thickness=0.1)}
    write(row, tmp_path, aged, films)
    stream = io.BytesIO()
    write_scene(stream, row, dict(reversed(aged.items())), films)
    assert stream.getvalue() == (tmp_path / "out.glb").read_bytes()
    with pytest.raises(OutputExistsError):
        write_scene(tmp_path / "out.glb", row, aged, films)
    with pytest.raises(KeyError):
        write_scene(tmp_path / "other.glb", row, {"a": "none"}, films)
    assert not (tmp_path / "other.glb").exists()
