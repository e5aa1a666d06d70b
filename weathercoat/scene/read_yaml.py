"""Scenes from YAML: objects with models and places, or a GLB to which rules and a camera are added.

All problems of the file are found at once, those of the configs that it asks for included:
`ConfigError.problems` has one for each, with file, line and key.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from weathercoat.config.document import Item, read_items, without_lines
from weathercoat.config.load import Override, load_config
from weathercoat.config.presets import preset_names
from weathercoat.config.wording import did_you_mean, explain
from weathercoat.errors import ConfigError, ConfigProblem, LimitError, WeathercoatError
from weathercoat.mesh.formats.gltf_document import trs_matrices
from weathercoat.mesh.read import load_bytes, read_surface
from weathercoat.mesh.surface import Surface, Vectors
from weathercoat.scene import scene_file
from weathercoat.scene.graph import CameraPath, Rule, Scene, SceneObject, unique_names
from weathercoat.scene.read_glb import has_body, parse_glb

LARGEST_FILE = 64 << 20
MOST_VALUES = 2_000_000
_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def parse_yaml(data: bytes, path: Path, *, max_faces: int) -> Scene:
    """The scene in a YAML file that holds `data`; models and configs lie relative to `path`.

    Errors: ConfigError with every problem, and those of `read_surface` for its models.
    """
    where = str(path)
    if len(data) > LARGEST_FILE:
        raise ConfigError.at(where, f"larger than {LARGEST_FILE >> 20} MiB, this is no scene")
    items = read_items(data, where, MOST_VALUES) or {}
    if not isinstance(items, dict):
        raise ConfigError.at(where, "must be a mapping of keys to values", line=1)
    try:
        entry = scene_file.SceneFile.model_validate(without_lines(items))
    except ValidationError as error:
        found = [_problem(detail, items, where) for detail in error.errors(include_url=False)]
        raise ConfigError(problems=tuple(sorted(found, key=lambda p: p.line))) from None
    return _Builder(entry, items, path).scene(max_faces)


class _Builder:
    def __init__(self, entry: scene_file.SceneFile, items: dict[str, Item], path: Path) -> None:
        self.entry = entry
        self.items = items
        self.path = path
        self.problems: list[ConfigProblem] = []

    def scene(self, max_faces: int) -> Scene:
        entry = self.entry
        self._check_names()
        config = self._config(entry.config, ("config",))
        rules = tuple(
            Rule(
                r.match,
                None if r.config is None else self._config(r.config, ("rules", i, "config")),
                _flat(r.set),
                r.age,
                r.variants,
                r.weathered,
                r.exposure,
            )
            for i, r in enumerate(entry.rules)
        )
        # A config is checked as it will be used: with a camera, where the scene has one.
        has_camera = entry.camera is not None or bool(entry.path) or entry.scene is not None
        common = self._settings(("set",))
        self._check_settings(config, common, has_camera)
        for i, rule in enumerate(rules):
            if rule.set or rule.config is not None:
                own = self._settings(("rules", i, "set"))
                self._check_settings(rule.config or config, [*common, *own], has_camera)
        if self.problems:
            raise ConfigError(problems=tuple(sorted(dict.fromkeys(self.problems), key=lambda p: p.line)))
        base = self._base(max_faces)
        return replace(
            base,
            name=self.path.stem,
            ground=entry.ground,
            camera=self._camera(base.camera),
            config=config,
            overrides=_flat(entry.set),
            rules=rules,
        )

    def _base(self, max_faces: int) -> Scene:
        """The scene without what the file adds to its objects."""
        if self.entry.scene is not None:
            source = self.path.parent / self.entry.scene
            try:
                return parse_glb(load_bytes(source), source, max_faces=max_faces)
            except WeathercoatError as error:
                error.file = error.file or str(source)
                raise
        meshes, keys = self._models(max_faces)
        objects = [_object(o.name, keys[o.model], o) for o in self.entry.objects] + [
            _object(f"{group.name}/{i}", keys[group.model], place)
            for group in self.entry.instances
            for i, place in enumerate(group.places)
        ]
        return Scene("", meshes, tuple(objects), up=_up(self.entry.up))

    def _models(self, max_faces: int) -> tuple[dict[str, Surface], dict[str, str]]:
        """The surfaces by their keys, and the key of each model that the file names."""
        models = [o.model for o in self.entry.objects] + [group.model for group in self.entry.instances]
        named = list(dict.fromkeys(models))
        keys = dict(zip(named, unique_names([(Path(name).stem,) for name in named]), strict=True))
        meshes: dict[str, Surface] = {}
        for model, key in keys.items():
            left = max_faces - sum(len(surface.faces) for surface in meshes.values())
            if left <= 0:
                raise LimitError(f"the models have more than {max_faces} triangles together")
            meshes[key] = read_surface(self.path.parent / model, max_faces=left)
        return meshes, keys

    def _camera(self, own: CameraPath | None) -> CameraPath | None:
        """The camera of the file; what it leaves open is that of the GLB."""
        camera, path = self.entry.camera or scene_file.Camera(), self.entry.path
        if path:
            places = [(view.position, view.target) for view in path]
        elif camera.position is not None and camera.target is not None:
            places = [(camera.position, camera.target)]
        else:
            places = []
        if places:
            positions, targets = np.array(places).transpose(1, 0, 2)
            away = targets - positions
            own = CameraPath(positions, away / np.linalg.norm(away, axis=1, keepdims=True))
        if own is None:
            return None
        lens = {
            name: getattr(camera, name)
            for name in ("field_of_view", "image_height", "aspect")
            if getattr(camera, name) is not None
        }
        return replace(own, **lens)

    def _config(self, name: str, location: tuple[str | int, ...]) -> str:
        """A config as `load_config` takes it: the path of a file beside the scene, or a shipped name."""
        beside = self.path.parent / name
        if beside.is_file():
            return str(beside)
        if name not in preset_names():
            known = ", ".join(preset_names())
            what = f"no file {name!r} beside the scene, and no shipped config; there are {known}"
            self._report(location, what + did_you_mean(name, preset_names()))
        return name

    def _report(self, location: tuple[str | int, ...], what: str) -> None:
        key = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location)
        line = _line(location, self.items)
        self.problems.append(ConfigProblem(str(self.path), line, key.removeprefix("."), what))

    def _check_names(self) -> None:
        """Note every name that another object has already."""
        lines: dict[str, int] = {}
        given = [("objects", i, [o.name]) for i, o in enumerate(self.entry.objects)] + [
            ("instances", i, [f"{group.name}/{k}" for k in range(len(group.places))])
            for i, group in enumerate(self.entry.instances)
        ]
        for kind, i, names in given:
            taken = next((name for name in names if name in lines), None)
            if taken is not None:
                self._report((kind, i, "name"), f"the name {taken!r} is taken by line {lines[taken]}")
            line = _line((kind, i, "name"), self.items)
            lines.update((name, line) for name in names if name not in lines)

    def _settings(self, location: tuple[str | int, ...]) -> list[Override]:
        """The values of the config that are set at `location`, each with its line."""
        found = _follow(location, self.items)
        if len(found) < len(location):
            return []
        settings: list[Override] = []
        rest = list(reversed(found[-1].value.items()))
        while rest:
            key, item = rest.pop()
            if isinstance(item.value, dict):
                rest += [(f"{key}.{below}", part) for below, part in reversed(item.value.items())]
            else:
                settings.append(Override(key, without_lines(item.value), f"{self.path}:{item.line}"))
        return settings

    def _check_settings(self, config: str, settings: list[Override], has_camera: bool) -> None:
        """Note what is wrong with a config and with what is set in it, unless it was not found."""
        if self.problems and not Path(config).is_file() and config not in preset_names():
            return
        try:
            load_config(config, settings)
        except ConfigError as error:
            problems = error.problems
            # `auto` gets its distance from the camera later, so the config is looked at as it will be then
            if has_camera and any(problem.key == "quality" for problem in problems):
                try:
                    load_config(config, [*settings, Override("scene.nearest", 1.0)])
                    problems = ()
                except ConfigError as other:
                    problems = other.problems
            self.problems += map(self._in_file, problems)

    def _in_file(self, problem: ConfigProblem) -> ConfigProblem:
        """A problem of a value that the scene file sets, at its line there."""
        where, _, line = problem.where.rpartition(":")
        return replace(problem, where=where, line=int(line)) if where == str(self.path) else problem


def _object(name: str, mesh: str, place: scene_file.Placement) -> SceneObject:
    transform = transform_of(place)
    return SceneObject(name, mesh, transform, kept="" if has_body(transform) else "its transform flattens it")


def transform_of(place: scene_file.Placement) -> Vectors:
    """The matrix (4, 4) of a placement."""
    if place.matrix is not None:
        return np.array([*place.matrix, (0.0, 0.0, 0.0, 1.0)])
    quaternion = np.array([[0.0, 0.0, 0.0, 1.0]])
    if place.quaternion is not None:
        quaternion = np.array([place.quaternion]) / np.linalg.norm(place.quaternion)
    elif place.rotation is not None:
        quaternion = _of_angles(place.rotation)[None]
    return trs_matrices(np.array([place.position]), quaternion, np.array([place.scale]))[0]


def _of_angles(degrees: tuple[float, ...]) -> Vectors:
    """The quaternion x, y, z, w of turns about the world's x, then y, then z axis."""
    (sx, sy, sz), (cx, cy, cz) = np.sin(np.radians(degrees) / 2), np.cos(np.radians(degrees) / 2)
    return np.array(
        [
            sx * cy * cz - cx * sy * sz,
            cx * sy * cz + sx * cy * sz,
            cx * cy * sz - sx * sy * cz,
            cx * cy * cz + sx * sy * sz,
        ]
    )


def _up(up: str | tuple[float, ...] | None) -> tuple[float, float, float]:
    if up is None:
        return _AXES["y"]
    if isinstance(up, str):
        x, y, z = _AXES[up[-1]]
        return (-x or 0.0, -y or 0.0, -z or 0.0) if up.startswith("-") else (x, y, z)
    x, y, z = (np.array(up) / np.linalg.norm(up)).tolist()
    return (x, y, z)


def _flat(values: Mapping[str, Any], above: str = "") -> dict[str, Any]:
    """Values of nested sections by dotted keys."""
    result: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, dict):
            result.update(_flat(value, f"{above}{key}."))
        else:
            result[above + key] = value
    return result


def _problem(detail: Any, items: dict[str, Item], where: str) -> ConfigProblem:
    path, what = explain({**detail, "type": "unknown"} if detail["type"] == "extra_forbidden" else detail)
    location = tuple(detail["loc"])
    if detail["type"] == "extra_forbidden":
        what = "unknown key" + did_you_mean(location[-1], _known_keys(location[:-1]))
    elif detail["type"] == "missing":
        what = "is missing"
    key = ".".join(path).replace(".[", "[")
    return ConfigProblem(where, _line(location, items), key, what)


def _known_keys(location: tuple[str | int, ...]) -> list[str]:
    """The keys of the part of a scene file at `location`."""
    parts: dict[tuple[str, ...], type[scene_file.Entry]] = {
        ("objects",): scene_file.Object,
        ("instances",): scene_file.Instances,
        ("instances", "places"): scene_file.Placement,
        ("camera",): scene_file.Camera,
        ("path",): scene_file.Viewpoint,
        ("rules",): scene_file.RuleEntry,
    }
    kind = parts.get(tuple(part for part in location if isinstance(part, str)), scene_file.SceneFile)
    return list(kind.model_fields)


def _line(location: tuple[str | int, ...], items: dict[str, Item]) -> int:
    """The line of what lies at `location`, or of the nearest part above it that is there; 0 for none."""
    found = _follow(location, items)
    return found[-1].line if found else 0


def _follow(location: tuple[str | int, ...], items: dict[str, Item]) -> list[Item]:
    """What lies on the way to `location`, as far as it is there."""
    way: list[Item] = []
    here: Any = items
    for part in location:
        found: Any = None
        if isinstance(here, dict):
            found = here.get(str(part))
        elif isinstance(here, list) and isinstance(part, int) and part < len(here):
            found = here[part]
        if not isinstance(found, Item):
            break
        way.append(found)
        here = found.value
    return way
