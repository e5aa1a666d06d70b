"""Plans of scenes: configs in order of say, detail by the camera, and what stays as it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.scene.test_detail import looking
from tests.scene.yards import at, box, yard
from weathercoat.errors import ConfigError
from weathercoat.scene.graph import Rule, Scene, SceneObject
from weathercoat.scene.plan import Choices, ScenePlan, plan_scene

_ROOF = box("roof", 0, 3, 0, scale=(6, 0.1, 6))


def config_of(plan: ScenePlan, name: str) -> dict[str, object]:
    return plan.shown[name].loaded.config.as_dict()


def test_rules_win_over_the_scene_and_the_command_line_over_all() -> None:
    rules = (Rule("a", config="rusting", set={"curl.rate": 7.0}), Rule("*", set={"curl.radius": 0.3}))
    scene = yard(box("a"), box("b", 5), config="crackle", overrides={"curl.rate": 5.0}, rules=rules)
    plan = plan_scene(scene, Choices(overrides=["curl.radius=0.4"]))
    assert [plan.shown[name].loaded.source for name in "ab"] == ["rusting", "crackle"]
    assert [config_of(plan, name)["curl"]["rate"] for name in "ab"] == [7.0, 5.0]
    assert [config_of(plan, name)["curl"]["radius"] for name in "ab"] == [0.4, 0.4]
    assert plan_scene(scene, Choices(config="curling")).shown["b"].loaded.source == "curling"


def test_age_is_the_rule_s_or_the_command_line_s_or_the_config_s() -> None:
    scene = yard(box("a"), box("b", 5), rules=(Rule("a", age=3.0),))
    assert [plan_scene(scene).shown[name].age for name in "ab"] == [3.0, 1.0]
    plan = plan_scene(scene, Choices(age=2.0))
    assert [plan.shown[name].age for name in "ab"] == [3.0, 2.0]
    shown = plan.shown["b"]
    duration = shown.loaded.config.ageing.duration
    assert duration == pytest.approx(2.0 * shown.variant.weathering.degree, abs=1e-3)


def test_near_objects_get_more_detail_than_far_and_unseen_ones() -> None:
    things = [box("near", 0, 0.5, 7), box("far", 0, 0.5, -300), box("unseen", 0, 0.5, 90)]
    scene = yard(*things, camera=looking((0, 0.5, 10)), rules=(Rule("*", variants="each"),))
    plan = plan_scene(scene)
    near, far, unseen = (plan.shown[name] for name in ("near", "far", "unseen"))
    assert near.cost.seconds > 2.0 * far.cost.seconds
    assert far.cost.seconds >= unseen.cost.seconds
    for shown in (near, far, unseen):
        assert shown.plan.quality is not None
        assert shown.plan.quality["asked"] == "auto"
    assert near.plan.quality["expected"]["errors"]["pixels"] <= 1.0
    assert unseen.plan.quality["expected"]["errors"]["pixels"] == pytest.approx(0.0, abs=1e-3)


def test_the_nearest_instance_decides_for_all() -> None:
    alone = plan_scene(yard(box("near", 0, 0.5, 7), camera=looking((0, 0.5, 10))))
    both = plan_scene(yard(box("near", 0, 0.5, 7), box("far", 0, 0.5, -300), camera=looking((0, 0.5, 10))))
    assert both.shown["far"] is both.shown["near"]
    faces = [plan.shown["near"].loaded.config.remesh.faces for plan in (alone, both)]
    assert faces[0] == faces[1]


def test_scaled_objects_are_seen_in_units_of_their_mesh() -> None:
    small = plan_scene(yard(box("a"), camera=looking((0, 0, 5)))).shown["a"]
    large = plan_scene(yard(box("a", scale=(3, 3, 3)), camera=looking((0, 0, 15)))).shown["a"]
    assert large.variant.nearest == pytest.approx(small.variant.nearest, rel=0.02)


def test_what_is_set_by_hand_is_kept() -> None:
    scene = yard(box("a"), camera=looking((0, 0.5, 10)))
    plan = plan_scene(scene, Choices(overrides=["remesh.faces=500", "quality=draft"]))
    assert plan.shown["a"].loaded.config.remesh.faces == 500
    assert plan.shown["a"].plan.quality["asked"] == "draft"
    assert plan_scene(yard(box("a"))).shown["a"].plan.quality is None


def test_auto_without_a_camera_is_refused() -> None:
    with pytest.raises(ConfigError, match="auto"):
        plan_scene(yard(box("a"), overrides={"quality": "auto"}))


def test_what_is_kept_still_shelters() -> None:
    rules = (Rule("roof", weathered=False),)
    kept = replace(box("odd", 9), kept="it is skinned")
    plan = plan_scene(yard(_ROOF, box("under", 0, 0.5, 0), kept, rules=rules))
    assert list(plan.shown) == ["under"]
    assert plan.weathering["under"].rain == 0.0
    assert [plan.why_kept(item) for item in plan.scene.objects] == ["a rule says so", "", "it is skinned"]


def test_a_given_degree_counts() -> None:
    plan = plan_scene(yard(_ROOF, box("under", 0, 0.5, 0), rules=(Rule("under", exposure=0.9),)))
    assert plan.weathering["under"].degree == 0.9
    assert plan.weathering["under"].is_given


def test_variants_of_the_command_line_are_for_what_rules_leave_open() -> None:
    things = [box(f"o{i}", 3.0 * i, 0.5 + i, 0) for i in range(4)]
    rules = (Rule("o0", variants=1), Rule("o1", variants=1))
    plan = plan_scene(yard(*things, rules=rules), Choices(variants="each"))
    assert [len(shown.variant.members) for shown in plan.variants] == [2, 1, 1]


def test_gravity_is_that_of_the_object() -> None:
    lying = np.array([[1.0, 0, 0, 0], [0, 0, 1.0, 1.0], [0, -1.0, 0, 0], [0, 0, 0, 1]])
    plan = plan_scene(yard(SceneObject("lid", "cube", lying)))
    assert plan.shown["lid"].loaded.config.model.up == pytest.approx((0.0, 0.0, 1.0))
    assert plan.shown["lid"].surface.up == pytest.approx((0.0, 0.0, 1.0))


def test_an_uneven_scale_is_baked_into_the_model() -> None:
    scene = yard(SceneObject("slab", "cube", at(scale=(4.0, 1.0, 2.0))))
    shown = plan_scene(scene).shown["slab"]
    assert np.ptp(shown.surface.vertices, axis=0) == pytest.approx([2.0, 0.5, 1.0], rel=1e-4)
    plain = plan_scene(yard(box("a"))).shown["a"]
    assert plain.surface.vertices.tobytes() == scene.meshes["cube"].vertices.tobytes()


def test_an_object_that_is_added_changes_no_other_plan() -> None:
    def plans(scene: Scene) -> dict[str, tuple[int, dict[str, object]]]:
        plan = plan_scene(scene, Choices(variants="each"))
        return {s.variant.name: (s.loaded.config.seed, s.loaded.config.as_dict()) for s in plan.variants}

    few = plans(yard(box("a", 0, 0.5), box("b", 9, 0.5)))
    more = plans(yard(box("a", 0, 0.5), box("b", 9, 0.5), SceneObject("c", "sphere", at(0, 0.5, -500))))
    assert few["a"][0] == more["a"][0]
    assert few["b"][1]["ageing"]["duration"] == pytest.approx(more["b"][1]["ageing"]["duration"], abs=0.005)


def test_a_size_in_pixels_stands_instead_of_the_camera() -> None:
    scene = yard(box("a", scale=(2, 2, 2)), camera=looking((0, 0.5, 10)))
    plan = plan_scene(scene, Choices(overrides=["scene.pixels_per_metre=50"]))
    assert plan.shown["a"].plan.quality["scene"]["per_unit"] == pytest.approx(100.0)


def test_rates_that_grow_out_of_bounds_are_refused() -> None:
    scene = yard(_ROOF, box("a", 0, 0.5, 0), overrides={"dust.rate": 1e6})
    with pytest.raises(ConfigError, match=r"dust\.rate"):
        plan_scene(scene)
