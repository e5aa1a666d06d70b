"""Labelled pictures: classes to the pixel, depth and normals, boxes, cameras, and the JSON."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from PIL import Image

import weathercoat
from tests.output.scenes import make_peeled_snapshot, make_plate, make_sphere
from weathercoat.errors import UsageError
from weathercoat.output.condition import BARE, CLASSES, CRACK, LIFTED, RUST, film_classes, metal_classes
from weathercoat.output.labels.cameras import View, looking, read_views
from weathercoat.output.labels.dataset import (
    LABELS,
    PASSES,
    LabelledRun,
    LabelRequest,
    annotate,
    write_labels,
)
from weathercoat.output.labels.passes import NAMES
from weathercoat.output.pictures import PictureParameters
from weathercoat.output.pieces import number_pieces
from weathercoat.sim.snapshot import Snapshot

PARAMETERS = PictureParameters(film_thickness=0.0, metal_thickness=0.0)
UP = np.array([0.0, 1.0, 0.0])
ABOUT = {"name": "plate", "fingerprint": "f", "seed": 1, "inputs": {"plate.obj": "0"}, "config": {}}
RUN = LabelledRun(ABOUT, (0.0, 1.0, 0.0))


def half_bare(lifted: bool = False) -> Snapshot:
    """A square of side 2 that faces +z, whose film is there on the left, far from the origin."""
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, 9), np.linspace(-1.0, 1.0, 9))
    vertices = np.stack([x.ravel() + 3.0, y.ravel() - 2.0, np.full(81, 5.0)], axis=1)
    corner = np.arange(81).reshape(9, 9)
    a, b, c, d = (
        part.ravel() for part in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1])
    )
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32)
    whole = make_peeled_snapshot(vertices, faces, 0.0)
    kept = np.flatnonzero(vertices[faces].mean(axis=1)[:, 0] < 3.0).astype(np.int32)
    used, film_faces = np.unique(faces[kept], return_inverse=True)
    return replace(
        whole,
        film_vertices=vertices[used],
        film_faces=film_faces.reshape(-1, 3).astype(np.int32),
        film_face=kept,
        film_origin=used.astype(np.int32),
        film_rust=np.zeros(len(used)),
        separated=np.full(len(used), lifted),
        bare=~np.isin(np.arange(81), used),
        substrate_rust=np.zeros(81),
        dust=np.zeros(81),
    )


def frontal() -> View:
    """Straight on from 4 units away, so that the square fills half of the picture's side."""
    camera = looking(np.array([3.0, -2.0, 9.0]), np.array([3.0, -2.0, 5.0]), UP, 0.5, 0.5)
    return View("front", 64, 64, camera)


def written(folder: Path, snapshot: Snapshot, *views: View, **more: Any) -> dict[str, Any]:
    request = LabelRequest(PASSES, views, width=64, height=48, **more)
    folder.mkdir(exist_ok=True)
    write_labels(folder, [snapshot], RUN, PARAMETERS, request)
    return json.loads((folder / LABELS).read_text())


def picture(folder: Path, content: dict[str, Any], name: str, index: int = 0) -> np.ndarray:
    return np.asarray(Image.open(folder / content["images"][index]["files"][name]))


def test_a_half_bare_plate_has_the_shares_it_has_to_the_pixel(tmp_path: Path) -> None:
    content = written(tmp_path, half_bare(), frontal())
    expected = np.zeros((64, 64), np.uint8)
    expected[16:48, 16:32], expected[16:48, 32:48] = NAMES.index("paint"), NAMES.index("bare")
    assert np.array_equal(picture(tmp_path, content, "class"), expected)
    image = content["images"][0]
    assert image["pixels"]["paint"] == image["pixels"]["bare"] == 512
    assert image["shares"]["paint"] == image["shares"]["bare"] == 0.5
    shares = content["snapshots"][0]["area_shares"]
    assert shares["paint"] == pytest.approx(0.5) and shares["bare"] == pytest.approx(0.5)


def test_depth_and_normals_are_those_of_the_geometry(tmp_path: Path) -> None:
    """A plate seen at an angle: the depth of each pixel from where its ray meets the plane."""
    camera = looking(np.array([5.0, 0.5, 8.0]), np.array([3.0, -2.0, 5.0]), UP, 0.4, 0.3)
    content = written(tmp_path, half_bare(), View("odd", 80, 60, camera))
    entry = content["images"][0]
    pose = entry["camera"]
    matrix = np.array(pose["camera_to_world"])
    column, row = np.meshgrid(np.arange(80) + 0.5, np.arange(60) + 0.5)
    x, y = (column - pose["cx"]) / pose["fx"], (row - pose["cy"]) / pose["fy"]
    ray = np.stack([x, y, np.ones_like(x)], axis=2) @ matrix[:3, :3].T
    expected = (5.0 - matrix[2, 3]) / ray[:, :, 2]
    bare = picture(tmp_path, content, "class") == NAMES.index("bare")
    assert bare.sum() > 300
    depth = picture(tmp_path, content, "depth") * entry["depth_unit"]
    assert np.abs(depth - expected)[bare].max() < entry["depth_unit"] + 1e-5  # Embree's single precision
    normal = picture(tmp_path, content, "normal")[bare] / 127.5 - 1.0
    assert np.abs(normal - matrix[:3, :3].T @ [0.0, 0.0, 1.0]).max() < 0.006  # half a step of a byte
    nothing = picture(tmp_path, content, "class") == 0
    assert (picture(tmp_path, content, "depth")[nothing] == 0).all()
    assert (picture(tmp_path, content, "normal")[nothing] == 128).all()


def test_boxes_are_those_of_the_picture_of_instances(tmp_path: Path) -> None:
    snapshot = make_peeled_snapshot(*make_plate(20), 0.6, pieces=60)
    content = written(tmp_path, snapshot, count=3, seed=5)
    flakes = content["snapshots"][0]["flakes"]
    assert flakes > 3
    for index, image in enumerate(content["images"]):
        instance = picture(tmp_path, content, "instance", index)
        assert [entry["instance"] for entry in image["annotations"]] == sorted(set(instance[instance > 0]))
        for entry in image["annotations"]:
            row, column = np.nonzero(instance == entry["instance"])
            x, y, width, height = entry["bbox"]
            assert (column.min(), row.min()) == (x, y)
            assert (column.max() + 1, row.max() + 1) == (x + width, y + height)
            assert entry["area"] == len(row) == sum(entry["classes"].values())
            assert entry["category"] == ("flake" if entry["instance"] <= flakes else "patch")


def test_points_land_where_the_written_matrices_project_them(tmp_path: Path) -> None:
    """The middle of each face has the class and the depth of the pixel that the matrices say."""
    place, target = np.array([4.5, -1.0, 9.0]), np.array([3.0, -2.0, 5.0])
    snapshot = half_bare()
    content = written(tmp_path, snapshot, View("far", 640, 480, looking(place, target, UP, 0.4, 0.3)))
    pose = content["images"][0]["camera"]
    centres = snapshot.substrate_vertices[snapshot.substrate_faces].mean(axis=1)
    local = np.linalg.inv(np.array(pose["camera_to_world"])) @ np.c_[centres, np.ones(len(centres))].T
    x = (pose["fx"] * local[0] / local[2] + pose["cx"]).astype(int)
    y = (pose["fy"] * local[1] / local[2] + pose["cy"]).astype(int)
    expected = np.where(np.isin(np.arange(len(centres)), snapshot.film_face), "paint", "bare")
    category = picture(tmp_path, content, "class")
    assert [NAMES[number] for number in category[y, x]] == list(expected)
    depth = picture(tmp_path, content, "depth")[y, x] * content["images"][0]["depth_unit"]
    assert depth == pytest.approx(local[2], abs=0.01)  # the slope of the plate over a pixel


def test_cameras_come_back_from_labels_json_and_give_the_same_labels(tmp_path: Path) -> None:
    snapshot = make_peeled_snapshot(*make_sphere(400), 0.5)
    content = written(tmp_path / "one", snapshot, count=4, seed=3)
    again = written(tmp_path / "two", snapshot, *read_views(tmp_path / "one" / LABELS, UP, 64, 48))
    for index, image in enumerate(content["images"]):
        # rounding of the matrices may turn single pixels at edges
        one, two = (
            picture(tmp_path / name, of, "class", index) for name, of in (("one", content), ("two", again))
        )
        assert (one != two).mean() < 0.002
        assert again["images"][index]["camera"]["name"] == image["camera"]["name"]


def test_the_same_seed_gives_the_same_bytes_and_another_other_cameras(tmp_path: Path) -> None:
    snapshot = make_peeled_snapshot(*make_plate(14), 0.6)
    first = written(tmp_path / "a", snapshot, count=3, seed=1)
    written(tmp_path / "b", snapshot, count=3, seed=1)
    other = written(tmp_path / "c", snapshot, count=3, seed=2)
    files = sorted(path.relative_to(tmp_path / "a") for path in (tmp_path / "a").rglob("*.*"))
    assert len(files) == 3 * len(PASSES) + 4 + 1
    for path in files:
        assert (tmp_path / "a" / path).read_bytes() == (tmp_path / "b" / path).read_bytes()
    assert first["images"][0]["camera"] != other["images"][0]["camera"]


def test_sampled_cameras_show_the_object_and_close_ups_its_damage(tmp_path: Path) -> None:
    snapshot = make_peeled_snapshot(*make_sphere(600), 0.6)
    content = written(tmp_path, snapshot, count=9, seed=4)
    for index, image in enumerate(content["images"]):
        assert image["pixels"]["background"] < 0.8 * 64 * 48
        if index % 3 == 2:
            assert image["annotations"]


def test_labels_json_keeps_to_its_schema(tmp_path: Path) -> None:
    schema = json.loads((Path(weathercoat.__file__).parent / "schemas" / "labels.json").read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    check = jsonschema.Draft202012Validator(schema)
    content = written(tmp_path, make_peeled_snapshot(*make_plate(14), 0.6), count=2)
    check.validate(content)
    assert [row["name"] for row in content["classes"]] == list(NAMES)
    for change in ({"extra": 1}, {"labels_version": 2}, {"images": [{}]}):
        assert not check.is_valid({**content, **change})


def test_faces_have_the_classes_of_the_pictures(tmp_path: Path) -> None:
    snapshot = half_bare(lifted=True)
    content = written(tmp_path, snapshot, frontal())
    files = content["snapshots"][0]["faces"]
    film, metal = (np.load(tmp_path / files[name]) for name in ("film_class", "metal_class"))
    assert (film == NAMES.index("lifted")).all() and len(film) == len(snapshot.film_faces)
    assert (metal[snapshot.film_face] == NAMES.index("crack")).all()
    assert (np.delete(metal, snapshot.film_face) == NAMES.index("bare")).all()
    assert content["images"][0]["annotations"][0]["category"] == "flake"


def test_classes_of_faces() -> None:
    base = half_bare()
    count = len(base.film_vertices)
    assert set(film_classes(base)) == {CLASSES.index("paint")}
    assert set(metal_classes(base)) == {CRACK, BARE}
    assert set(metal_classes(replace(base, substrate_rust=np.ones(81)))) == {CRACK, RUST}
    stained = replace(base, film_rust=np.ones(count), dust=np.ones(81))
    assert set(film_classes(stained)) == {CLASSES.index("runoff")}
    assert set(film_classes(replace(base, dust=np.ones(81)))) == {CLASSES.index("dirt")}
    assert set(film_classes(replace(stained, separated=np.ones(count, bool)))) == {LIFTED}


def test_pieces_are_numbered_in_the_order_of_their_first_faces() -> None:
    faces = np.array([[0, 1, 2], [10, 11, 12], [2, 1, 3], [12, 11, 13], [20, 21, 22], [2, 30, 31]], np.int32)
    chosen = np.array([True, True, True, True, False, True])
    assert number_pieces(faces, chosen).tolist() == [1, 2, 1, 2, 0, 3]
    assert number_pieces(faces, ~chosen).tolist() == [0, 0, 0, 0, 1, 0]
    assert not number_pieces(faces, np.zeros(6, bool)).any()


def test_a_picture_without_instances_has_no_annotations() -> None:
    assert annotate(np.zeros((4, 4), np.uint16), np.zeros((4, 4), np.uint8), 0) == []


TURNED = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
SIMPLE = {"position": [0, 0, 0], "target": [0, 0, 1], "field_of_view": 30}


@pytest.mark.parametrize(
    ("cameras", "message"),
    [
        ([], "no cameras"),
        ([{"position": [0, 0, 0]}], "lacks 'target'"),
        ([{**SIMPLE, "target": [0, 0, 0]}], "the same"),
        ([{**SIMPLE, "field_of_view": 190}], "field_of_view"),
        ([{**SIMPLE, "position": [0, 0]}], "three numbers"),
        ([{**SIMPLE, "width": 4}], "between 16"),
        ([{"camera_to_world": [[1]], "fx": 1, "fy": 1}], "4 x 4"),
        ([{"camera_to_world": np.diag([2, 2, 2, 1]).tolist(), "fx": 1, "fy": 1}], "without scaling"),
        ([{"camera_to_world": TURNED, "fx": 9, "fy": 9, "cx": 3}], "middle"),
        ([{**SIMPLE, "name": "a"}, {**SIMPLE, "name": "a"}], "same name"),
        (["none"], "not valid"),
    ],
)
def test_wrong_cameras_are_named(tmp_path: Path, cameras: list[Any], message: str) -> None:
    path = tmp_path / "cameras.json"
    path.write_text(json.dumps({"cameras": cameras}))
    with pytest.raises(UsageError, match=message):
        read_views(path, UP, 64, 48)


def test_what_is_no_json_is_named(tmp_path: Path) -> None:
    path = tmp_path / "cameras.json"
    path.write_text("{")
    with pytest.raises(UsageError, match="no JSON"):
        read_views(path, UP, 64, 48)
