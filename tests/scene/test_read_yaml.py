"""Scenes in YAML: places, names, cameras, rules, and every mistake at its line."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest

import weathercoat
from tests.scene.documents import Document
from weathercoat.errors import AccessError, ConfigError
from weathercoat.mesh.shapes import SHAPES, make_box
from weathercoat.output.meshes import write_mesh
from weathercoat.scene.graph import Rule, Scene, place
from weathercoat.scene.read import read_scene
from weathercoat.scene.scene_file import scene_schema

BOX = "objects: [{name: a, model: box.obj}]\n"
SCHEMA = Path(weathercoat.__file__).parent / "schemas" / "scene.json"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with `box.obj` and `yard.glb`, which has an object `drum` and a camera."""
    write_mesh(tmp_path / "box.obj", make_box(cells=1))
    document = Document()
    document.node(name="drum", mesh=document.mesh())
    document.node(camera=0, translation=[0, 0, 9])
    lens = {"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}
    document.write(tmp_path / "yard.glb", cameras=[lens])
    return tmp_path


def read(folder: Path, text: str) -> Scene:
    path = folder / "scene.yaml"
    path.write_text(text)
    return read_scene(path)


def problems(folder: Path, text: str) -> list[tuple[int, str]]:
    """Line and key of every problem, all of which lie in the scene file."""
    with pytest.raises(ConfigError) as caught:
        read(folder, text)
    assert {p.where for p in caught.value.problems} == {str(folder / "scene.yaml")}
    return [(p.line, p.key) for p in caught.value.problems]


def test_objects_and_instances(folder: Path) -> None:
    scene = read(
        folder,
        """
        up: -z
        ground: 1.5
        objects:
          - {name: crate, model: box.obj, position: [1, 2, 3], scale: 2}
        instances:
          - name: bolt
            model: ./box.obj
            places: [{position: [0, 0, 1]}, {matrix: [[1, 0, 0, 5], [0, 0, 1, 6], [0, 1, 0, 7]]}]
        """,
    )
    assert [o.name for o in scene.objects] == ["crate", "bolt/0", "bolt/1"]
    assert scene.up == (0.0, 0.0, -1.0) and scene.ground == 1.5 and scene.name == "scene"
    point = np.array([[1.0, 2.0, 3.0]])
    places = [place(point, o.transform)[0].tolist() for o in scene.objects]
    assert places == [[3, 6, 9], [1, 2, 4], [6, 9, 9]]
    assert [o.is_mirrored() for o in scene.objects] == [False, False, True]


def test_angles_turn_about_the_axes_of_the_world_in_order(folder: Path) -> None:
    scene = read(
        folder,
        """
        objects:
          - {name: x, model: box.obj, rotation: [90, 0, 0]}
          - {name: xyz, model: box.obj, rotation: [90, 90, 90]}
          - {name: odd, model: box.obj, rotation: [10, 20, 30]}
          - {name: quaternion, model: box.obj, quaternion: [0, 0, 3, 3]}
        """,
    )
    x, xyz, odd, quaternion = (o.transform[:3, :3] for o in scene.objects)
    assert np.allclose(x @ [0, 1, 0], [0, 0, 1])
    assert np.allclose(xyz @ [0, 1, 0], [0, 1, 0])  # y -> z -> x -> y
    a, b, c = np.radians([10, 20, 30])
    about_x = [[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]]
    about_y = [[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]]
    about_z = [[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], [0, 0, 1]]
    assert np.allclose(odd, np.array(about_z) @ about_y @ about_x)
    assert np.allclose(quaternion @ [1, 0, 0], [0, 1, 0])


def test_rules_and_a_camera_are_added_to_a_glb(folder: Path) -> None:
    scene = read(
        folder,
        """
        scene: yard.glb
        ground: 0
        config: crackle
        set: {ageing.steps: 50, cohesion: {scatter: 0.1}}
        camera: {image_height: 400}
        rules:
          - {match: "d*", age: 2, variants: each, exposure: 0.5, set: {seed: 4}}
          - {match: x, weathered: off, config: rusting}
        """,
    )
    assert [o.name for o in scene.objects] == ["drum"]
    assert scene.config == "crackle"
    assert scene.overrides == {"ageing.steps": 50, "cohesion.scatter": 0.1}
    assert scene.rules == (
        Rule("d*", None, {"seed": 4}, 2, "each", None, 0.5),
        Rule("x", "rusting", {}, weathered=False),
    )
    assert scene.camera is not None
    assert scene.camera.positions.tolist() == [[0, 0, 9]] and scene.camera.image_height == 400
    assert scene.camera.field_of_view == pytest.approx(np.degrees(1.0))


def test_a_path_takes_the_place_of_the_camera_of_the_glb(folder: Path) -> None:
    views = "[{position: [0, 0, 4], target: [0, 0, 0]}, {position: [3, 0, 0], target: [1, 0, 0]}]"
    camera = read(folder, f"scene: yard.glb\npath: {views}\ncamera: {{field_of_view: 20}}\n").camera
    assert camera is not None
    assert camera.positions.tolist() == [[0, 0, 4], [3, 0, 0]]
    assert camera.directions.tolist() == [[0, 0, -1], [-1, 0, 0]]
    assert camera.field_of_view == 20


def test_configs_lie_beside_the_scene(folder: Path) -> None:
    (folder / "wet.yaml").write_text("seed: 3\n")
    scene = read(folder, BOX + "config: wet.yaml\nrules: [{match: a, config: wet.yaml}]\n")
    assert scene.config == scene.rules[0].config == str(folder / "wet.yaml")


def test_all_mistakes_of_the_form_are_found_at_their_lines(folder: Path) -> None:
    text = """up: w
confg: x
objects:
  - name: a
    model: box.obj
    position: [1, 2]
  - model: box.obj
    scale: 0
instances:
  - name: b
    model: box.obj
    places:
      - {position: [0, 0, 1]}
      - rotation: [0, 0, .nan]
rules:
  - match: "*"
    variants: many
"""
    assert problems(folder, text) == [
        (1, "up"),
        (2, "confg"),
        (6, "objects[0].position"),
        (7, "objects[1].name"),
        (8, "objects[1].scale"),
        (14, "instances[0].places[1].rotation"),
        (17, "rules[0].variants"),
    ]


def test_all_mistakes_of_the_content_are_found_at_their_lines(folder: Path) -> None:
    text = """config: standrad
set: {seed: -1}
objects:
  - {name: a/1, model: box.obj}
instances:
  - name: a
    model: box.obj
    places: [{}, {}]
rules:
  - match: "*"
    config: crackle
    set:
      rust: {rat: 3}
      ageing.steps: -1
"""
    assert problems(folder, text) == [
        (1, "config"),
        (2, "seed"),
        (6, "instances[0].name"),
        (13, "rust.rat"),
        (14, "ageing.steps"),
    ]


@pytest.mark.parametrize(
    "text",
    [
        "up: z\n",
        BOX + "scene: yard.glb\n",
        "scene: yard.glb\nup: z\n",
        BOX + "camera: {field_of_view: 30}\n",
        BOX + "camera: {position: [0, 0, 1]}\n",
        "objects: [{name: a, model: box.obj, scale: 2, matrix: [[1,0,0,0],[0,1,0,0],[0,0,1,0]]}]\n",
        "objects: [{name: a, model: box.obj, rotation: [0,0,0], quaternion: [0,0,0,1]}]\n",
        BOX + "path: [{position: [1, 1, 1], target: [1, 1, 1]}]\n",
    ],
)
def test_what_does_not_go_together_is_refused(text: str, folder: Path) -> None:
    assert len(problems(folder, text)) == 1


def test_auto_gets_its_distance_from_the_camera(folder: Path) -> None:
    text = BOX + "set: {quality: auto}\n"
    assert problems(folder, text) == [(2, "quality")]
    assert read(folder, text + "camera: {position: [0, 0, 9], target: [0, 0, 0]}\n").camera is not None


def test_a_missing_model_is_named(folder: Path) -> None:
    with pytest.raises(AccessError) as caught:
        read(folder, "objects: [{name: a, model: none.obj}]\n")
    assert caught.value.file == str(folder / "none.obj")


def test_the_example_of_the_documentation_holds(tmp_path: Path) -> None:
    page = Path(weathercoat.__file__).parents[1] / "docs" / "scenes.md"
    example = page.read_text(encoding="utf-8").split("```yaml\n")[1].partition("```")[0]
    for name in ("sign", "barrel"):
        write_mesh(tmp_path / f"{name}.obj", SHAPES[name]())
    scene = read(tmp_path, example)
    assert [o.name for o in scene.objects] == ["sign", "barrel/0", "barrel/1"]
    for thing in scene.objects:
        extent = np.ptp(place(scene.meshes[thing.mesh].vertices, thing.transform), axis=0)
        assert extent[2] > 0.6  # upright: the sign is 0.7 high, the barrel 0.88


def test_the_published_schema_is_that_of_the_model(folder: Path) -> None:
    published = json.loads(SCHEMA.read_text(encoding="utf-8"))
    assert published == scene_schema()
    jsonschema.Draft202012Validator.check_schema(published)
    validator = jsonschema.Draft202012Validator(published)
    good = {
        "up": "-z",
        "objects": [{"name": "a", "model": "b.obj", "position": [1, 2, 3], "scale": 2}],
        "instances": [{"name": "b", "model": "b.obj", "places": [{"matrix": [[1, 0, 0, 0]] * 3}]}],
        "camera": {"position": [0, 0, 1], "target": [0, 0, 0]},
        "rules": [{"match": "*", "variants": "each", "weathered": "off", "set": {"seed": 1}}],
    }
    assert validator.is_valid(good)
    for wrong in ({"up": "w"}, {"objects": [{"name": "a"}]}, {"rules": [{"match": "*", "variants": 0}]}):
        assert not validator.is_valid(good | wrong)
