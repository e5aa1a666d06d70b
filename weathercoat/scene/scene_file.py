"""What a scene in YAML may say: typed, bounded and described; its JSON Schema comes from here."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, WithJsonSchema, model_validator

from weathercoat.config.section import Real, Switch, parameter, require_number

SCHEMA_ID = "https://json-schema.org/draft/2020-12/schema"
_AXES = ("x", "y", "z", "-x", "-y", "-z")


def _numbers(*counts: int) -> Any:
    """A validator of a list of so many finite numbers."""
    words = " or ".join(map(str, counts))

    def check(value: object) -> object:
        entries = list(value) if isinstance(value, list | tuple) else []
        if len(entries) not in counts or not all(map(_is_number, entries)):
            raise ValueError(f"must be a list of {words} finite numbers")
        return tuple(map(float, entries))

    return BeforeValidator(check)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= 1e100


def _check_scale(value: object) -> object:
    entries = [value] * 3 if _is_number(value) else value
    if not isinstance(entries, list | tuple) or len(entries) != 3 or not all(map(_is_number, entries)):
        raise ValueError("must be a number or a list of 3 finite numbers")
    if not all(entries):
        raise ValueError("must not be 0, which would flatten the object")
    return tuple(map(float, entries))


def _check_matrix(value: object) -> object:
    rows = value if isinstance(value, list | tuple) else []
    if len(rows) not in (3, 4) or not all(
        isinstance(row, list | tuple) and len(row) == 4 and all(map(_is_number, row)) for row in rows
    ):
        raise ValueError("must be 3 or 4 rows of 4 finite numbers")
    if len(rows) == 4 and list(rows[3]) != [0, 0, 0, 1]:
        raise ValueError("must end with the row [0, 0, 0, 1]")
    return tuple(tuple(map(float, row)) for row in rows[:3])


def _check_up(value: object) -> object:
    if isinstance(value, str) and value in _AXES:
        return value
    if isinstance(value, list | tuple) and len(value) == 3 and all(map(_is_number, value)) and any(value):
        return tuple(map(float, value))
    raise ValueError("must be x, y, z, -x, -y, -z or three numbers that are not all 0")


def _check_variants(value: object) -> object:
    if value == "each" or (isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= 10_000):
        return value
    raise ValueError("must be each, or a whole number from 1 to 10,000")


def _list_schema(count: int) -> dict[str, Any]:
    return {"type": "array", "items": {"type": "number"}, "minItems": count, "maxItems": count}


_THREE = _list_schema(3)
_Vector = Annotated[tuple[float, ...], _numbers(3), WithJsonSchema(_THREE)]
_Quaternion = Annotated[tuple[float, ...], _numbers(4), WithJsonSchema(_list_schema(4))]
_Scale = Annotated[
    tuple[float, ...],
    BeforeValidator(_check_scale),
    WithJsonSchema({"anyOf": [{"type": "number"}, _THREE]}),
]
_Matrix = Annotated[
    tuple[tuple[float, ...], ...],
    BeforeValidator(_check_matrix),
    WithJsonSchema({"type": "array", "items": _list_schema(4), "minItems": 3, "maxItems": 4}),
]
_Up = Annotated[
    str | tuple[float, ...],
    BeforeValidator(_check_up),
    WithJsonSchema({"anyOf": [{"type": "string", "enum": list(_AXES)}, _THREE]}),
]
_Variants = Annotated[
    int | Literal["each"],
    BeforeValidator(_check_variants),
    WithJsonSchema({"anyOf": [{"const": "each"}, {"type": "integer", "minimum": 1, "maximum": 10_000}]}),
]
_Angle = Annotated[float, Field(gt=0, lt=180), BeforeValidator(require_number)]
_Pixels = Annotated[int, Field(ge=1, le=1_000_000), BeforeValidator(require_number)]
_Aspect = Annotated[float, Field(gt=0.01, lt=100), BeforeValidator(require_number)]
_Age = Annotated[float, Field(gt=0, le=1000), BeforeValidator(require_number)]
_Share = Annotated[float, Field(ge=0, le=1), BeforeValidator(require_number)]
_Text = Annotated[str, Field(min_length=1)]


class Entry(BaseModel):
    """A part of a scene file: immutable, and without unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True)


class Placement(Entry):
    """Where a model stands: position, rotation and scale, or a matrix; by default where its file has it."""

    position: _Vector = parameter(
        (0.0, 0.0, 0.0), "Where the model's origin comes to lie", unit="world units"
    )
    rotation: _Vector | None = parameter(
        None,
        "Angles about the x, the y and the z axis of the world, applied in this order, each "
        "counter-clockwise seen from the axis's positive end",
        unit="degrees",
    )
    quaternion: _Quaternion | None = parameter(None, "The rotation as x, y, z, w, instead of angles")
    scale: _Scale = parameter(
        (1.0, 1.0, 1.0), "Factor, or one along each axis of the model; negative ones mirror"
    )
    matrix: _Matrix | None = parameter(
        None, "Rows of the matrix from the model to the world, instead of all of these"
    )

    @model_validator(mode="after")
    def _one_way(self) -> Placement:
        given = self.model_fields_set
        if self.matrix is not None and given & {"position", "rotation", "quaternion", "scale"}:
            raise ValueError("matrix stands for position, rotation and scale; give it or them")
        if self.rotation is not None and self.quaternion is not None:
            raise ValueError("give rotation or quaternion, not both")
        if self.quaternion is not None and not 1e-6 < math.hypot(*self.quaternion) < 1e6:
            raise ValueError("quaternion must not be 0")
        return self


class Object(Placement):
    """One object."""

    name: _Text = parameter(..., "Name of the object, different from all others")
    model: _Text = parameter(..., "File of its model, relative to the scene file")


class Instances(Entry):
    """One model in many places: objects `NAME/0`, `NAME/1`, and so on."""

    name: _Text = parameter(..., "Name before the slash")
    model: _Text = parameter(..., "File of the model, relative to the scene file")
    places: tuple[Placement, ...] = parameter(..., "Where it stands, one entry each", min_length=1)


class Viewpoint(Entry):
    """A place of the camera."""

    position: _Vector = parameter(..., "Where the camera is")
    target: _Vector = parameter(..., "What it looks at")

    @model_validator(mode="after")
    def _apart(self) -> Viewpoint:
        if self.position == self.target:
            raise ValueError("position and target must not be the same point")
        return self


class Camera(Entry):
    """What the scene is seen with, for `quality: auto`; its place, unless `path` or the GLB gives that."""

    position: _Vector | None = parameter(None, "Where the camera is")
    target: _Vector | None = parameter(None, "What it looks at")
    field_of_view: _Angle | None = parameter(
        None,
        "Angle of view from top to bottom; 40 by default",
        unit="degrees",
    )
    image_height: _Pixels | None = parameter(
        None,
        "Height of the image; 1080 by default",
        unit="pixels",
    )
    aspect: _Aspect | None = parameter(None, "Width of the image over its height; 16:9 by default")

    @model_validator(mode="after")
    def _whole(self) -> Camera:
        if (self.position is None) != (self.target is None):
            raise ValueError("position and target belong together")
        if self.position is not None and self.position == self.target:
            raise ValueError("position and target must not be the same point")
        return self


class RuleEntry(Entry):
    """What is decided for the objects whose names match; the later rule wins."""

    match: _Text = parameter(
        ..., "Glob over names of objects and over paths of nodes; * stands for slashes too"
    )
    config: _Text | None = parameter(None, "Shipped config, or a file relative to the scene file")
    set: dict[str, Any] = parameter({}, "Values of the config, by dotted keys or as sections")
    age: _Age | None = parameter(None, "How long the objects weather", unit="ages")
    variants: _Variants | None = parameter(
        None, "How many different results the instances of a mesh share, or each"
    )
    weathered: Switch | None = parameter(None, "off leaves the objects as they are")
    exposure: _Share | None = parameter(
        None, "Degree of weathering, 0 sheltered to 1 in the open, instead of what is derived"
    )


class SceneFile(Entry):
    """A scene: a GLB to add to, or objects and instances."""

    scene: _Text | None = parameter(
        None, "GLB or glTF file, relative to this one, whose nodes are the objects"
    )
    up: _Up | None = parameter(None, "Direction against gravity in the world; y by default, fixed for a GLB")
    ground: Real | None = parameter(None, "Height of the ground along up", unit="world units")
    config: _Text = parameter("standard", "Shipped config, or a file relative to this one, of all objects")
    set: dict[str, Any] = parameter({}, "Values of the config for all objects")
    camera: Camera | None = parameter(None, "What the scene is seen with")
    path: tuple[Viewpoint, ...] = parameter((), "Where the camera goes, instead of its one place")
    objects: tuple[Object, ...] = parameter((), "Objects with a model each")
    instances: tuple[Instances, ...] = parameter((), "Models in many places")
    rules: tuple[RuleEntry, ...] = parameter((), "What is decided by name; the later rule wins")

    @model_validator(mode="after")
    def _one_source(self) -> SceneFile:
        if self.scene is not None and (self.objects or self.instances):
            raise ValueError("scene stands for objects and instances; give it or them")
        if self.scene is None and not (self.objects or self.instances):
            raise ValueError("the scene has no objects; give scene, objects or instances")
        if self.scene is not None and self.up is not None:
            raise ValueError("up of a GLB is y; leave it out")
        if self.path and self.camera is not None and self.camera.position is not None:
            raise ValueError("the camera has a place and a path; give one of them")
        lens_only = self.camera is not None and self.camera.position is None and not self.path
        if lens_only and self.scene is None:
            raise ValueError("the camera has no place; give camera.position and camera.target, or path")
        return self


def scene_schema() -> dict[str, Any]:
    """The JSON Schema of scene files."""
    return {"$schema": SCHEMA_ID, **SceneFile.model_json_schema(), "title": "Scene of weathercoat"}
