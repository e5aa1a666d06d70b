"""Quality as one word: points on the measured front of cost against error, and what each of them sets.

The front is that of `weathercoat bench fidelity`, which writes it to `quality.json`. Its lengths are in shear
lags (`fracture.shear_lag`), which set how far apart cracks run, so that a film with finer cracks gets shorter
edges: what was measured on one film stands for others at the same number of pixels per shear lag.
"""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from weathercoat.config.derived import with_values

if TYPE_CHECKING:
    from weathercoat.config.load import LoadedConfig

FRONT = Path(__file__).with_name("quality.json")
AUTO = "auto"
LEVELS = ("draft", "standard", "fine", "reference")
FEWEST_FACES, MOST_FACES = 300, 500_000
_FACES = "remesh.faces"


@dataclass(frozen=True)
class Errors:
    """How far runs at a point were from the reference with the same seed, at worst over the ages.

    areas: relative error of the separated, the lost and the rusted area, the largest; spacing: relative error
    of the distance between cracks; distance: mean distance between the two films, in shear lags; image: how
    different their pictures look, relative to those of two seeds at the reference, by pixels per shear lag.
    """

    areas: float
    spacing: float
    distance: float
    image: Mapping[float, float]

    def image_at(self, resolution: float) -> float:
        """The difference of pictures with `resolution` pixels per shear lag: between the measured ones by
        their logarithm, and beyond them the nearest.
        """
        known = sorted(self.image)
        if resolution <= known[0]:
            return self.image[known[0]]
        for low, high in itertools.pairwise(known):
            if resolution <= high:
                share = math.log(resolution / low) / math.log(high / low)
                return (1.0 - share) * self.image[low] + share * self.image[high]
        return self.image[known[-1]]


@dataclass(frozen=True)
class Point:
    """A way to run: the wanted edge length in shear lags, values of config keys, and the errors measured;
    none of the reference, which they are measured against.
    """

    edge_length: float
    values: Mapping[str, Any]
    errors: Errors | None

    def faces(self, shear_lag: float) -> int:
        """How many equilateral triangles with this edge length a surface has, whose area is 1."""
        wanted = 4.0 / (math.sqrt(3.0) * (self.edge_length * shear_lag) ** 2)
        return round(min(max(wanted, FEWEST_FACES), MOST_FACES))


@dataclass(frozen=True)
class Front:
    """The points, the reference last; those of `LEVELS` by name; and by `areas` and `spacing` the largest
    errors that are good enough: a tenth, or the spread between seeds at the reference where that is more.
    """

    points: tuple[Point, ...]
    levels: Mapping[str, Point]
    limits: Mapping[str, float]


@cache
def read_front() -> Front:
    """The front as it is stored."""
    content = json.loads(FRONT.read_text(encoding="utf-8"))
    points = tuple(
        Point(row["edge_length"], row["values"], _errors_of(row["errors"])) for row in content["points"]
    )
    levels = {name: points[place] for name, place in content["levels"].items()}
    return Front(points, levels, content["limits"])


def _errors_of(row: Mapping[str, Any] | None) -> Errors | None:
    if row is None:
        return None
    image = {float(pixels): difference for pixels, difference in row["image"].items()}
    return Errors(row["areas"], row["spacing"], row["distance"], image)


def point_of(level: str) -> Point:
    """The point of one of `LEVELS`."""
    return read_front().levels[level]


def with_point(loaded: LoadedConfig, point: Point, origin: str) -> LoadedConfig:
    """The config with the values of a point where nothing of `loaded.fixed` says otherwise; origin: what
    chose the point, for messages.

    Where remeshing is off the number of faces is not set. Raises ConfigError where the values do not go
    together with the rest.
    """
    values = {_FACES: point.faces(loaded.config.fracture.shear_lag), **point.values}
    if not loaded.config.remesh:
        del values[_FACES]
    return with_values(loaded, {k: v for k, v in values.items() if k not in loaded.fixed}, origin)


def kept_keys(loaded: LoadedConfig, point: Point) -> dict[str, str]:
    """The keys that a point would set and that the config fixes, each with where it was set."""
    keys = [_FACES, *point.values] if loaded.config.remesh else list(point.values)
    return {key: loaded.origins[key] for key in keys if key in loaded.fixed}
