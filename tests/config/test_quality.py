"""Quality as one word: what it sets, what it leaves, and the front that is shipped."""

from __future__ import annotations

import json
from pathlib import Path
from typing import get_args

import pytest

from weathercoat.config.load import LoadedConfig, Override, load_config
from weathercoat.config.quality import (
    AUTO,
    FRONT,
    LEVELS,
    MOST_FACES,
    Errors,
    Point,
    kept_keys,
    point_of,
    read_front,
    with_point,
)
from weathercoat.config.schema import Config
from weathercoat.cost import estimate_cost
from weathercoat.errors import ConfigError

COARSE = Point(0.5, {"ageing.steps": 60, "deformation.solver": "none"}, None)


def faces_of(loaded: LoadedConfig) -> int:
    assert loaded.config.remesh
    return loaded.config.remesh.faces


def load_text(tmp_path: Path, text: str, *overrides: str | Override) -> LoadedConfig:
    file = tmp_path / "c.yaml"
    file.write_text(text, encoding="utf-8")
    return load_config(file, overrides)


def test_the_schema_knows_every_level() -> None:
    choices = [
        word for kind in get_args(Config.model_fields["quality"].annotation) for word in get_args(kind)
    ]
    assert choices == [*LEVELS, AUTO]


def test_the_shipped_front_rises_in_cost_to_the_reference() -> None:
    front = read_front()
    assert [front.levels[name] for name in LEVELS][-1] is front.points[-1]
    assert front.points[-1].errors is None
    assert all(point.errors is not None for point in front.points[:-1])
    costs = [estimate_cost(load_config("standard", [f"quality={name}"]).config, 2).seconds for name in LEVELS]
    assert costs == sorted(costs)
    assert {"cpu", "date"} <= set(json.loads(FRONT.read_text(encoding="utf-8"))["measured"])


@pytest.mark.parametrize("name", LEVELS)
def test_a_level_sets_what_it_stands_for(name: str) -> None:
    loaded = load_config("standard", [Override("quality", name, "--quality")])
    point = point_of(name)
    assert faces_of(loaded) == point.faces(0.04)
    assert loaded.config.ageing.steps == point.values["ageing.steps"]
    assert loaded.config.deformation.solver == point.values["deformation.solver"]
    assert loaded.origins["ageing.steps"] == f"quality {name}"
    assert loaded.origins["curl.radius"].startswith("preset standard")


def test_without_a_quality_nothing_changes() -> None:
    assert load_config("standard").config == Config()


def test_finer_cracks_get_shorter_edges() -> None:
    assert COARSE.faces(0.02) == pytest.approx(4 * COARSE.faces(0.04), rel=0.01)
    assert COARSE.faces(1e-5) == MOST_FACES
    crackle = load_config("crackle", ["quality=fine"])
    assert faces_of(crackle) == point_of("fine").faces(0.022)


def test_what_is_set_beside_or_after_the_quality_stays(tmp_path: Path) -> None:
    """The order is presets, file, options."""
    text = "preset: curling\nageing:\n  steps: 77\n"
    by_file = load_text(tmp_path, text + "quality: draft\n")
    assert by_file.config.ageing.steps == 77
    assert kept_keys(by_file, point_of("draft"))["ageing.steps"].endswith("c.yaml:3")
    by_option = load_text(tmp_path, text, "quality=draft", Override("remesh.faces", 4321, "--faces"))
    assert by_option.config.ageing.steps == point_of("draft").values["ageing.steps"]
    assert faces_of(by_option) == 4321
    assert kept_keys(by_option, point_of("draft")) == {"remesh.faces": "--faces"}


def test_values_of_a_shipped_config_give_way_to_a_quality_that_names_it(tmp_path: Path) -> None:
    loaded = load_text(tmp_path, "preset: crackle\nquality: draft\n")
    assert faces_of(loaded) == point_of("draft").faces(0.022)


def test_a_model_that_is_not_remeshed_keeps_its_faces(tmp_path: Path) -> None:
    loaded = load_text(tmp_path, "remesh: off\nquality: draft\n")
    assert loaded.config.remesh is False
    assert loaded.config.ageing.steps == point_of("draft").values["ageing.steps"]
    assert kept_keys(loaded, point_of("draft")) == {}


def test_auto_is_left_for_the_model() -> None:
    loaded = load_config("standard", ["quality=auto", "scene.distance=2"])
    assert faces_of(loaded) == 10_000
    assert with_point(loaded, COARSE, "quality auto").config.ageing.steps == 60


def test_steps_that_end_before_a_snapshot_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"quality draft: snapshots.steps: step 1000 is after the end"):
        load_text(tmp_path, "quality: draft\nsnapshots:\n  steps: [1000]\n")


@pytest.mark.parametrize(
    ("lines", "key", "what"),
    [
        ("quality: auto", "quality", "auto needs scene.distance"),
        ("quality: best", "quality", "must be draft, standard"),
        ("scene:\n  distance: 1\n  pixels_per_metre: 5", "scene.pixels_per_metre", "not both"),
        ("scene:\n  distance: 0", "scene.distance", "above 0"),
        ("scene:\n  field_of_view: 180", "scene.field_of_view", "below 180"),
        ("scene:\n  image_height: 1.5", "scene.image_height", "whole number"),
    ],
)
def test_scenes_that_do_not_tell_are_refused(tmp_path: Path, lines: str, key: str, what: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_text(tmp_path, lines + "\n")
    assert caught.value.problems[0].key == key
    assert what in caught.value.problems[0].what


def test_pixels_are_those_of_a_pinhole() -> None:
    """At the distance d a picture shows 2 d tan(angle / 2): 2 units at 1 unit and 90 degrees."""
    scene = {"distance": 1.0, "field_of_view": 90, "image_height": 1000}
    assert Config.model_validate({"scene": scene}).scene.pixels_per_unit() == pytest.approx(500.0)
    nearer = Config.model_validate({"scene": {**scene, "nearest": 0.1}}).scene
    assert nearer.pixels_per_unit() == pytest.approx(5000.0)
    metres = Config.model_validate({"scene": {"pixels_per_metre": 300, "metres_per_unit": 0.01}})
    assert metres.pixels_per_unit() == pytest.approx(3.0)
    assert Config().scene.pixels_per_unit() is None


def test_errors_of_pictures_are_read_between_the_measured_sizes() -> None:
    errors = Errors(0.0, 0.0, 0.0, {1.0: 0.2, 100.0: 0.6})
    assert [errors.image_at(pixels) for pixels in (0.1, 1.0, 10.0, 100.0, 1e4)] == pytest.approx(
        [0.2, 0.2, 0.4, 0.6, 0.6]
    )
