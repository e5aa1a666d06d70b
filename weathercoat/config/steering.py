"""The entries of `steering`: which parameter changes, by how much, where and when."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Any, Literal, get_args

from pydantic import (
    BeforeValidator,
    GetJsonSchemaHandler,
    PlainSerializer,
    SerializerFunctionWrapHandler,
    WithJsonSchema,
    model_serializer,
    model_validator,
)

from weathercoat.config.section import Names, Real, Section, Switch, Words, parameter

Keys = tuple[tuple[float, float], ...]
Polyline = tuple[tuple[float, float, float], ...]
Direction = Literal["up", "down", "x", "y", "z", "-x", "-y", "-z"]

_LARGEST = 1e6
_NUMBER = {"type": "number", "minimum": 0, "maximum": _LARGEST}
_POINT_SCHEMA = {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}
_LINE_SCHEMA = {"type": "array", "items": _POINT_SCHEMA, "minItems": 2}


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _parse_timed(value: object) -> Keys:
    """A number, or keys of (age, value)."""
    if _is_number(value):
        keys: Any = [[0.0, value]]
    elif isinstance(value, dict) and list(value) == ["keys"]:
        keys = value["keys"]
    else:
        keys = value if isinstance(value, tuple) else None
    is_pairs = isinstance(keys, list | tuple) and all(
        isinstance(key, list | tuple) and len(key) == 2 and all(map(_is_number, key)) for key in keys
    )
    if not is_pairs or not keys:
        raise ValueError("must be a number, or {keys: [[age, value], ...]}")
    if any(later[0] <= earlier[0] for earlier, later in pairwise(keys)) or keys[0][0] < 0.0:
        raise ValueError("the ages of the keys must rise from 0 or later")
    if any(not 0.0 <= x <= _LARGEST for _, x in keys):
        raise ValueError("must be from 0 to 1,000,000")
    return tuple((float(age), float(x)) for age, x in keys)


def _written_timed(keys: Keys | None) -> Any:
    if keys is None:
        return None
    return keys[0][1] if len(keys) == 1 else {"keys": [list(key) for key in keys]}


def _parse_lines(value: object) -> str | tuple[Polyline, ...]:
    """The name of a file, a polyline, or a list of them."""
    if isinstance(value, str) and value:
        return value
    lines = value if isinstance(value, list | tuple) else ()
    if lines and isinstance(lines[0], list | tuple) and lines[0] and _is_number(lines[0][0]):
        lines = (lines,)
    is_lines = all(
        isinstance(line, list | tuple)
        and len(line) >= 2
        and all(
            isinstance(point, list | tuple) and len(point) == 3 and all(map(_is_number, point))
            for point in line
        )
        for line in lines
    )
    if not lines or not is_lines:
        raise ValueError(
            "must be points [x, y, z], two or more, a list of such lines, or the name of a file (.obj, .csv)"
        )
    return tuple(tuple((float(x), float(y), float(z)) for x, y, z in line) for line in lines)


def _parse_direction(value: object) -> object:
    if isinstance(value, str) and value in get_args(Direction):
        return value
    if isinstance(value, list | tuple) and len(value) == 3 and all(map(_is_number, value)) and any(value):
        return tuple(map(float, value))
    raise ValueError("must be up, down, x, y, z, -x, -y, -z or three numbers that are not all 0")


def _one_or_many(value: object) -> object:
    return [value] if isinstance(value, dict | Section) else value


class _OneOrMany:
    """For editors: a list may be left out round a single mapping."""

    def __get_pydantic_json_schema__(self, schema: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        found = handler(schema)
        return {"anyOf": [found["items"], found]}


Timed = Annotated[
    Keys,
    BeforeValidator(_parse_timed),
    PlainSerializer(_written_timed),
    Words("number from 0, or {keys: [[age, value], ...]}"),
    WithJsonSchema(
        {
            "anyOf": [
                _NUMBER,
                {
                    "type": "object",
                    "properties": {
                        "keys": {
                            "type": "array",
                            "items": {"type": "array", "items": _NUMBER, "minItems": 2, "maxItems": 2},
                            "minItems": 1,
                        }
                    },
                    "required": ["keys"],
                    "additionalProperties": False,
                },
            ]
        }
    ),
]
Lines = Annotated[
    str | tuple[Polyline, ...],
    BeforeValidator(_parse_lines),
    Words("list of points [x, y, z], list of such lines, or a file (.obj, .csv)"),
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "string"},
                _LINE_SCHEMA,
                {"type": "array", "items": _LINE_SCHEMA, "minItems": 1},
            ]
        }
    ),
]


class _Entry(Section):
    """A section in a list, which is written as it was given."""

    @model_serializer(mode="wrap")
    def _as_given(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        names = {
            field.alias or name: name in self.model_fields_set
            for name, field in type(self).model_fields.items()
        }
        return {
            key: value for key, value in write(self).items() if names.get(key, key in self.model_fields_set)
        }


class ImageMask(_Entry):
    """A picture on the model's texture coordinates, from 0 (black) to 1 (white)."""

    file: str = parameter(..., "The picture; its path is relative to the config file")
    channel: Literal["grey", "r", "g", "b", "a"] = parameter("grey", "Channel of the picture")


class HeightMask(_Entry):
    """A band of heights above the model's lowest point, along `model.up`."""

    start: Real = parameter(0.0, "Lower end of the band", alias="from", ge=-1e6, le=1e6)
    end: Real = parameter(1.0, "Upper end of the band", alias="to", ge=-1e6, le=1e6)
    soft: Real = parameter(0.0, "Length over which the mask fades beyond the band", ge=0, le=1e6)
    unit: Literal["share", "sizes"] = parameter(
        "share", "What these are in: shares of the model's height, or sizes"
    )

    @model_validator(mode="after")
    def _rising(self) -> HeightMask:
        if self.end <= self.start:
            raise ValueError("to must be above from")
        return self


class DirectionMask(_Entry):
    """Surfaces that look in a direction, such as the weather side."""

    towards: Annotated[Direction | tuple[float, float, float], BeforeValidator(_parse_direction)] = parameter(
        "up", "The direction; up and down by `model.up`, x to z in the model's axes"
    )
    within: Real = parameter(45.0, "Largest angle of the surface to it", unit="degrees", ge=0, le=180)
    soft: Real = parameter(30.0, "Angle over which the mask fades beyond that", unit="degrees", ge=0, le=180)


class EdgesMask(_Entry):
    """The neighbourhood of the model's creases and rims, as simulated."""

    angle: Real = parameter(30.0, "Edges that bend by more than this count", unit="degrees", gt=0, le=180)
    rims: Switch = parameter(True, "Whether the rims of open surfaces count too")
    within: Real = parameter(0.02, "Distance up to which the mask is whole", unit="sizes", ge=0, le=1e6)
    soft: Real = parameter(0.02, "Length over which it fades beyond that", unit="sizes", ge=0, le=1e6)


class LineMask(_Entry):
    """The neighbourhood of lines drawn in the model's units."""

    points: Lines = parameter(..., "The lines")
    within: Real = parameter(0.02, "Distance up to which the mask is whole", unit="sizes", ge=0, le=1e6)
    soft: Real = parameter(0.02, "Length over which it fades beyond that", unit="sizes", ge=0, le=1e6)


class Mask(_Entry):
    """Where an entry holds, 0 to 1 at each vertex; what is given is multiplied."""

    color: Literal["r", "g", "b", "a"] | None = parameter(None, "Channel of the model's vertex colours")
    image: ImageMask | None = None
    height: HeightMask | None = None
    direction: DirectionMask | None = None
    edges: EdgesMask | None = None
    line: LineMask | None = None
    group: Names = parameter((), "Material groups, objects or parts, by names or globs")
    invert: Switch = parameter(False, "Whether 1 minus the product counts")

    @model_validator(mode="after")
    def _something(self) -> Mask:
        kinds = self.color, self.image, self.height, self.direction, self.edges, self.line, self.group
        if not any(kinds):
            raise ValueError("must have color, image, height, direction, edges, line or group")
        return self


class Steer(_Entry):
    """A change of one parameter: `multiply` or `set`, everywhere or where all masks of `by` are. The short
    form `guide` lowers the cohesion along lines that cracks are to follow.
    """

    change: Literal["adhesion", "tension", "cohesion", "thickness", "dirt", "protection"] | None = parameter(
        None, "The parameter that changes"
    )
    multiply: Timed | None = parameter(None, "Factor where the mask is 1")
    set: Timed | None = parameter(None, "Value where the mask is 1, instead of a factor")
    by: Annotated[tuple[Mask, ...], BeforeValidator(_one_or_many), _OneOrMany()] = parameter(
        (), "Masks, which are multiplied; without one, the change holds everywhere"
    )
    guide: Lines | None = parameter(None, "Lines that cracks are to follow, in the model's units")
    width: Real = parameter(
        0.02, "Width of a guide; at least two edges of the simulated mesh", unit="sizes", gt=0, le=1e6
    )

    @model_validator(mode="after")
    def _whole(self) -> Steer:
        if self.guide is not None:
            if self.change not in (None, "cohesion") or self.set is not None:
                raise ValueError("a guide multiplies the cohesion")
            return self
        if self.change is None:
            raise ValueError(f"must have change, one of {', '.join(_CHANGES)}, or guide")
        if (self.multiply is None) == (self.set is None):
            raise ValueError("must have either multiply or set")
        if "width" in self.model_fields_set:
            raise ValueError("width belongs to a guide")
        keys = self.keys
        if self.change == "protection" and any(x > 1.0 for _, x in keys):
            raise ValueError("protection must be from 0 to 1")
        if self.change == "thickness" and (len(keys) > 1 or keys[0][1] < _THINNEST):
            raise ValueError(f"thickness must be one number, at least {_THINNEST}")
        return self

    @property
    def name(self) -> str:
        """The parameter that changes."""
        return self.change or "cohesion"

    @property
    def keys(self) -> Keys:
        """The factor or the value, by age; one for a constant."""
        return self.multiply or self.set or _GUIDED

    def files(self) -> Iterator[str]:
        """The names of the files that the entry needs."""
        if isinstance(self.guide, str):
            yield self.guide
        for mask in self.by:
            if mask.image is not None:
                yield mask.image.file
            if mask.line is not None and isinstance(mask.line.points, str):
                yield mask.line.points


_CHANGES = ("adhesion", "tension", "cohesion", "thickness", "dirt", "protection")
_THINNEST = 0.01
_GUIDED: Keys = ((0.0, 0.05),)
