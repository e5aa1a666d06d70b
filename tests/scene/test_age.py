"""Whole scenes: what is written, what is skipped, what fails, and that the report keeps to its schema."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

import weathercoat
from tests.scene.test_detail import looking
from tests.scene.yards import box, yard
from weathercoat.batch.job import Outcome
from weathercoat.batch.processes import InlineExecutor
from weathercoat.errors import Note
from weathercoat.output.pictures import read_png
from weathercoat.scene.age import age_scene
from weathercoat.scene.graph import Rule, Scene
from weathercoat.scene.plan import Choices, plan_scene
from weathercoat.scene.read import read_scene
from weathercoat.scene.report import make_report, note_lines, table_lines

_QUICK = ["remesh.faces=300", "ageing.steps=60", "checkpoint.keep=false", "ageing.duration=3"]


def shed(*rules: Rule, **more: Any) -> Scene:
    things = [
        box("roof", 0, 3, 0, scale=(6, 0.1, 6)),
        box("under", 0, 0.5, 0),
        box("open", 8, 0.5, 0),
        box("stone", -8, 0.5, 0),
    ]
    return yard(
        *things,
        config="rusting",
        rules=(Rule("stone", weathered=False), Rule("*", variants=2), *rules),
        **more,
    )


def age(
    scene: Scene, out: Path, *overrides: str, preview: bool = False
) -> tuple[dict[str, Any], Counter[str]]:
    """The report, and how many jobs ended how."""
    statuses: Counter[str] = Counter()

    def listen(event: object) -> None:
        if isinstance(event, Outcome):
            statuses[event.status] += 1

    plan = plan_scene(scene, Choices(overrides=[*_QUICK, *overrides]))
    return age_scene(plan, "shed.yaml", out, InlineExecutor(), preview=preview, listen=listen), statuses


def validate(report: dict[str, Any]) -> None:
    schema = json.loads((Path(weathercoat.__file__).parent / "schemas/scene_report.json").read_text())
    jsonschema.Draft202012Validator(schema).validate(report)


@pytest.fixture(scope="module")
def aged(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    out = tmp_path_factory.mktemp("scene") / "out"
    report, statuses = age(shed(camera=looking((0, 2, 20))), out, preview=True)
    assert statuses == {"done": 3}
    return out, report


def test_the_report_tells_of_each_object(aged: tuple[Path, dict[str, Any]]) -> None:
    out, report = aged
    validate(report)
    assert json.loads((out / "scene.json").read_text()) == json.loads(json.dumps(report))
    rows = {row["name"]: row for row in report["objects"]}
    assert list(rows) == ["roof", "under", "open", "stone"]
    assert rows["stone"]["kept"] == "a rule says so"
    assert rows["under"]["weathering"]["degree"] < rows["open"]["weathering"]["degree"]
    assert rows["under"]["detail"]["distance"] == pytest.approx(19.5, abs=0.2)
    assert rows["under"]["detail"]["faces"] == 300
    lines = list(table_lines(report))
    assert len(lines) == 1 + 4 + 1
    assert "stone" in lines[4] and "kept" in lines[4]


def test_what_is_sheltered_rusts_less(aged: tuple[Path, dict[str, Any]]) -> None:
    _, report = aged
    by_object = {name: row["figures"] for row in report["variants"] for name in row["objects"]}
    for figure in ("substrate_rust", "lost_share"):
        assert by_object["under"][figure] < by_object["open"][figure]


def test_the_scene_loads_as_it_was(aged: tuple[Path, dict[str, Any]]) -> None:
    out, _ = aged
    scene, back = shed(), read_scene(out / "scene.glb")
    assert [item.name for item in back.objects] == [item.name for item in scene.objects]
    for item, read in zip(scene.objects, back.objects, strict=True):
        assert np.allclose(item.transform, read.transform, atol=1e-6)


def test_the_picture_shows_before_and_after(aged: tuple[Path, dict[str, Any]]) -> None:
    out, _ = aged
    image = read_png(out / "preview.png").astype(np.float64)
    before, after = np.split(image, 2, axis=1)
    red = [float((half[:, :, 0] - half[:, :, 2]).clip(25).mean()) for half in (before, after)]
    assert red[1] > red[0]


def test_a_second_time_nothing_is_done_and_all_is_the_same(aged: tuple[Path, dict[str, Any]]) -> None:
    out, _ = aged
    files = ("scene.glb", "scene.json", "preview.png")
    was = [(out / name).read_bytes() for name in files]
    _, statuses = age(shed(camera=looking((0, 2, 20))), out, preview=True)
    assert statuses == {"unchanged": 3}
    assert [(out / name).read_bytes() for name in files] == was


def test_another_folder_gets_the_same_bytes(aged: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    out, _ = aged
    age(shed(camera=looking((0, 2, 20))), tmp_path)
    for name in ("scene.glb", "scene.json"):
        assert (tmp_path / name).read_bytes() == (out / name).read_bytes()


def test_only_what_a_rule_changes_is_done_again(tmp_path: Path) -> None:
    age(shed(), tmp_path)
    _, statuses = age(shed(Rule("roof", set={"rust.bare_rate": 1.0})), tmp_path)
    assert statuses == {"unchanged": 2, "done": 1}


def test_what_fails_stays_as_it_is(tmp_path: Path) -> None:
    scene = shed(Rule("roof", set={"remesh.faces": 20_000_000}))
    plan = plan_scene(scene, Choices(overrides=_QUICK[1:]))
    report = age_scene(plan, "s", tmp_path, InlineExecutor(), preview=False, max_memory=1_000_000_000)
    validate(report)
    failed = [row["name"] for row in report["variants"] if row["error"]]
    assert failed == [plan.shown["roof"].variant.name]
    back = read_scene(tmp_path / "scene.glb")
    roof = next(item for item in back.objects if item.name == "roof")
    assert len(back.meshes[roof.mesh].faces) == len(scene.meshes["cube"].faces)


def test_repairs_are_told() -> None:
    scene = shed()
    mended = {
        key: surface.with_notes(Note("W-FLIPPED", 3, "turned")) for key, surface in scene.meshes.items()
    }
    scene = replace(scene, meshes=mended, notes=(Note("W-OBJECT", 1, "passed over"),))
    report = make_report(plan_scene(scene), "shed.yaml")
    validate(report)
    assert [note["mesh"] for note in report["notes"]] == [None, "cube", "sphere", "plate"]
    assert list(note_lines(scene))[:2] == [
        "yard: W-OBJECT(1): passed over",
        "yard: cube: W-FLIPPED(3): turned",
    ]


def test_a_scene_with_nothing_to_do_is_written_as_it_is(tmp_path: Path) -> None:
    report, statuses = age(shed(Rule("*", weathered=False)), tmp_path, preview=True)
    validate(report)
    assert not statuses
    assert report["variants"] == []
    assert len(read_scene(tmp_path / "scene.glb").objects) == 4


def test_fifty_objects_of_ten_meshes_have_their_detail_and_error() -> None:
    meshes = {f"m{i}": yard().meshes["sphere"] for i in range(10)}
    from tests.scene.yards import at
    from weathercoat.scene.graph import SceneObject

    objects = [SceneObject(f"o{i}", f"m{i % 10}", at(2.0 * (i % 8), 0.5, -3.0 * (i // 8))) for i in range(50)]
    scene = Scene("many", meshes, tuple(objects), ground=0.0, camera=looking((5, 2, 10), (8, 1, 4)))
    report = make_report(plan_scene(scene), "many")
    validate(report)
    assert len(report["objects"]) == 50
    assert len(report["variants"]) == 10
    for row in report["objects"]:
        assert row["detail"]["quality"] == "auto"
        assert row["detail"]["seen"] in (True, False)
        assert row["detail"]["errors"]["pixels"] <= 1.0
