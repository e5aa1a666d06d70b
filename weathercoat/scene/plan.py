"""What ageing a scene will be like before it begins: how each object weathers, and what shares a result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from weathercoat.config.derived import with_values
from weathercoat.config.load import LoadedConfig, Override, load_config
from weathercoat.config.quality import AUTO
from weathercoat.cost import Cost, estimate_cost
from weathercoat.errors import ConfigError, WeathercoatError
from weathercoat.mesh.surface import Surface
from weathercoat.plan import Plan, make_plan
from weathercoat.run import split_paint
from weathercoat.scene.detail import UNSEEN, nearest_distances
from weathercoat.scene.exposure import measure_exposure
from weathercoat.scene.graph import Rule, Scene, SceneObject, place
from weathercoat.scene.groups import Member, Variant, group_members, placement_of
from weathercoat.scene.weathering import SPLASH_HEIGHT, Weathering, weather, weathered_config

_CAMERA = "the scene's camera"
# What a scene needs of each run: the last film as PLY. A config that asks for more gets it.
_NEEDED = "ply"
MODELS = "models"  # folder of the surfaces that variants age


@dataclass(frozen=True)
class Choices:
    """What the command line says. config: instead of the scene's own. overrides: of every object's config,
    with the last word. age [ages] and variants: of objects whose rules give none. seed: that all seeds are
    derived from.
    """

    config: str | None = None
    overrides: Sequence[str | Override] = ()
    age: float | None = None
    seed: int | None = None
    variants: int | Literal["each"] | None = None


@dataclass(frozen=True)
class VariantPlan:
    """A variant with its surface, in the size in which its mesh stands but for the even scale; the painted
    part and the rest of that; the plan before weathering, and the config and the cost after it.
    """

    variant: Variant
    surface: Surface
    painted: Surface
    untouched: Surface | None
    age: float
    plan: Plan
    loaded: LoadedConfig
    cost: Cost


@dataclass(frozen=True)
class ScenePlan:
    """A scene to be aged. weathering, distances: by the names of objects; distances are {} without a camera,
    and None for what is never seen.
    """

    scene: Scene
    weathering: Mapping[str, Weathering]
    distances: Mapping[str, float | None]
    variants: tuple[VariantPlan, ...]

    @cached_property
    def shown(self) -> dict[str, VariantPlan]:
        """The plan of the variant that each object shows, by the object's name; without those that stay as
        they are.
        """
        return {member.item.name: plan for plan in self.variants for member in plan.variant.members}

    @cached_property
    def assets(self) -> dict[str, str]:
        """The model of each variant, by its name, relative to the folder: one for all variants of a mesh that
        are stretched alike.
        """
        models: dict[tuple[str, bytes], str] = {}
        for shown in self.variants:
            models.setdefault(_asset_key(shown), f"{MODELS}/{shown.variant.name}.obj")
        return {shown.variant.name: models[_asset_key(shown)] for shown in self.variants}

    def why_kept(self, item: SceneObject) -> str:
        """Why an object stays as it is; empty for one that is weathered."""
        if item.name in self.shown:
            return ""
        return item.kept or "a rule says so"


def _asset_key(shown: VariantPlan) -> tuple[str, bytes]:
    return shown.variant.mesh, shown.variant.placement.shape.tobytes()


def plan_scene(scene: Scene, choices: Choices | None = None) -> ScenePlan:
    """The plan of a scene: exposure, degrees, variants, and their configs with the detail that the camera
    asks for.

    Raises ConfigError for what is wrong with a config, NoFacesError for a mesh on which nothing is painted.
    """
    choices = choices or Choices()
    configs = _Configs(scene, choices)
    rules = {item.name: _decision(scene, item.name, choices) for item in scene.objects}
    wanted = [item for item in scene.objects if not item.kept and rules[item.name].weathered is not False]
    names = [item.name for item in wanted]
    metres = configs.of(Rule("*")).config.metres_per_unit() or 1.0
    exposure = measure_exposure(scene, names, near=SPLASH_HEIGHT / metres)
    weathering = {name: weather(exposure[name], metres, rules[name].exposure) for name in names}
    distances = nearest_distances(scene, names)
    members = [
        Member(
            item, rules[item.name], weathering[item.name], placement_of(scene, item), distances.get(item.name)
        )
        for item in wanted
    ]
    plans = tuple(_plan_variant(scene, variant, configs) for variant in group_members(members))
    return ScenePlan(scene, weathering, distances, plans)


def stretched(surface: Surface, variant: Variant) -> Surface:
    """The surface that a variant ages: that of its mesh, stretched as its objects are, but for their size."""
    shape, up = variant.placement.shape, variant.placement.up
    vertices = surface.vertices if (shape == np.eye(3)).all() else place(surface.vertices, shape)
    return replace(surface, vertices=vertices, up=(float(up[0]), float(up[1]), float(up[2])))


def _decision(scene: Scene, name: str, choices: Choices) -> Rule:
    rule = scene.decision(name)
    return rule if rule.variants is not None else replace(rule, variants=choices.variants)


class _Configs:
    """The configs of a scene by what rules say, each loaded once."""

    def __init__(self, scene: Scene, choices: Choices) -> None:
        self._scene = scene
        self._choices = choices
        self._loaded: dict[str, LoadedConfig] = {}

    def of(self, rule: Rule) -> LoadedConfig:
        """The config of objects for which `rule` is decided, seen from nearby where there is a camera."""
        key = repr((rule.config, sorted(rule.set.items())))
        if key not in self._loaded:
            self._loaded[key] = self._load(rule)
        return self._loaded[key]

    def age_of(self, rule: Rule, loaded: LoadedConfig) -> float:
        """How long objects have been exposed."""
        given = (rule.age, self._choices.age, loaded.config.ageing.duration)
        return next(age for age in given if age is not None)

    def _load(self, rule: Rule) -> LoadedConfig:
        name = rule.config or self._choices.config or self._scene.config
        said = [
            *(Override(key, value, "the scene's set") for key, value in self._scene.overrides.items()),
            *(Override(key, value, "a rule's set") for key, value in rule.set.items()),
            *self._choices.overrides,
        ]
        if self._choices.seed is not None:
            said.append(Override("seed", self._choices.seed, "--seed"))
        camera = self._scene.camera
        first: list[Override] = []
        if camera is not None:
            first = [
                Override("scene.nearest", 1.0, _CAMERA),
                Override("scene.field_of_view", camera.field_of_view, _CAMERA),
                Override("scene.image_height", camera.image_height, _CAMERA),
            ]
        try:
            loaded = load_config(name, [*first, *said])
        except ConfigError as error:
            if not first or all(problem.key != "scene.pixels_per_metre" for problem in error.problems):
                raise
            first = []  # a size in pixels that the config gives stands instead of the camera
            loaded = load_config(name, said)
        if camera is not None and _is_left_open(loaded, "quality"):
            loaded = load_config(name, [Override("quality", AUTO, _CAMERA), *first, *said])
        values: dict[str, Any] = {}
        if _is_left_open(loaded, "output.preview"):
            values["output.preview"] = False
        if _is_left_open(loaded, "output.formats"):
            values["output.formats"] = [_NEEDED]
        elif _NEEDED not in loaded.config.output.formats:
            values["output.formats"] = [_NEEDED, *loaded.config.output.formats]
        return with_values(loaded, values, "the scene")


def _is_left_open(loaded: LoadedConfig, key: str) -> bool:
    """Whether neither a config file nor an option says anything about a key; shipped configs do not count."""
    return loaded.origins[key].startswith(("default", "preset "))


def _plan_variant(scene: Scene, variant: Variant, configs: _Configs) -> VariantPlan:
    rule = variant.rule
    loaded = configs.of(rule)
    age = configs.age_of(rule, loaded)
    loaded = _seen(loaded, variant, has_camera=scene.camera is not None)
    surface = stretched(scene.meshes[variant.mesh], variant)
    try:
        painted, untouched = split_paint(surface, loaded.config)
        plan = make_plan(loaded, painted, len(surface.faces))
    except WeathercoatError as error:
        error.file = error.file or variant.mesh
        raise
    settled = plan.loaded
    if settled.config.quality == AUTO:
        # It has set what it sets. In the shortened run it would choose the steps of a whole one.
        settled = with_values(settled, {"quality": None}, "the scene")
    loaded = weathered_config(
        settled, variant.weathering, age=age, up=surface.up, seed=variant.seed(settled.config.seed)
    )
    cost = estimate_cost(loaded.config, len(surface.faces))
    return VariantPlan(variant, surface, painted, untouched, age, plan, loaded, cost)


def _seen(loaded: LoadedConfig, variant: Variant, *, has_camera: bool) -> LoadedConfig:
    """The config with the distance of the camera, or the size of a unit, in units of the variant's mesh."""
    scene = loaded.config.scene
    if has_camera and loaded.origins["scene.nearest"] == _CAMERA:
        nearest = UNSEEN if variant.nearest is None else min(variant.nearest, UNSEEN)
        return with_values(loaded, {"scene.nearest": nearest}, _CAMERA)
    if scene.pixels_per_metre is not None:
        largest = max(member.placement.scale for member in variant.members)
        metres = (loaded.config.metres_per_unit() or 1.0) * largest
        return with_values(loaded, {"scene.metres_per_unit": metres}, "the scene")
    return loaded
