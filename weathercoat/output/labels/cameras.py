"""Cameras of labelled pictures: as they are written and read, and sampled ones.

Everything is in the axes and units of the model. A camera's own axes are OpenCV's: x to the right of the
picture, y down, z into it. Pixel (row, column) covers the square from (column, row) to (column + 1, row +
1), so that its centre has x = column + 0.5.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from weathercoat.errors import AccessError, UsageError
from weathercoat.mesh.surface import Vectors
from weathercoat.output.camera import Camera
from weathercoat.output.display import Normalisation
from weathercoat.output.rays import RayQueries

_SIDES = (16, 16_384)


@dataclass(frozen=True)
class View:
    """A camera in the model's axes and units, and the size of its picture in pixels."""

    name: str
    width: int
    height: int
    camera: Camera

    def entry(self) -> dict[str, Any]:
        """The camera as it stands in files; `read_views` takes it back.

        fx, fy, cx, cy: pixels. camera_to_world: a 4 x 4 matrix, row after row, that takes points of the
        camera's axes to the model's; its fourth column is where the camera stands.
        """
        camera = self.camera
        matrix = np.eye(4)
        matrix[:3] = np.stack([camera.right, -camera.up, camera.forward, camera.position], axis=1)
        return {
            "name": self.name,
            "width": self.width,
            "height": self.height,
            "fx": 0.5 * self.width / camera.tangent_x,
            "fy": 0.5 * self.height / camera.tangent_y,
            "cx": 0.5 * self.width,
            "cy": 0.5 * self.height,
            "camera_to_world": matrix.tolist(),
        }

    def displayed(self, normalise: Normalisation) -> Camera:
        """The camera in display units."""
        return replace(self.camera, position=normalise(self.camera.position[None])[0])


def read_views(path: Path, up: Vectors, width: int, height: int) -> list[View]:
    """The cameras of a JSON file: `labels.json`, or an object with a list `cameras`.

    A camera is written as by `View.entry`, or has `position`, `target` and `field_of_view` (degrees, of the
    picture's height), and may have `up` instead of the model's. Its picture has `width` x `height` pixels
    unless it says so itself. Raises AccessError, and UsageError where something is missing or wrong.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise AccessError(error.strerror or "cannot be read", file=str(path)) from error
    except ValueError as error:
        raise UsageError(f"is no JSON: {error}", file=str(path)) from error
    entries = content.get("cameras") if isinstance(content, dict) else None
    if entries is None and isinstance(content, dict) and isinstance(content.get("images"), list):
        named = {image["camera"]["name"]: image["camera"] for image in content["images"]}
        entries = list(named.values())
    if not isinstance(entries, list) or not entries:
        raise UsageError("holds no cameras", file=str(path), remedy="give a list named cameras")
    views = []
    for index, entry in enumerate(entries):
        try:
            views.append(_view(entry, f"camera-{index:04}", up, width, height))
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            what = f"lacks {error}" if isinstance(error, KeyError) else str(error)
            raise UsageError(f"camera {index} is not valid: {what}", file=str(path)) from error
    names = [view.name for view in views]
    if len(set(names)) < len(names):
        raise UsageError("two cameras have the same name", file=str(path))
    return views


def _view(entry: Mapping[str, Any], name: str, up: Vectors, width: int, height: int) -> View:
    width, height = int(entry.get("width", width)), int(entry.get("height", height))
    if not (_SIDES[0] <= min(width, height) and max(width, height) <= _SIDES[1]):
        raise ValueError(f"width and height must lie between {_SIDES[0]} and {_SIDES[1]}")
    if "camera_to_world" in entry:
        camera = _posed(entry, width, height)
    else:
        position, target = _triple(entry["position"]), _triple(entry["target"])
        tangent = float(np.tan(np.radians(float(entry["field_of_view"])) / 2.0))
        if not 0.0 < tangent < 100.0:
            raise ValueError("field_of_view must lie between 0 and 178 degrees")
        camera = looking(position, target, _triple(entry.get("up", up)), tangent * width / height, tangent)
    return View(str(entry.get("name", name)), width, height, camera)


def _posed(entry: Mapping[str, Any], width: int, height: int) -> Camera:
    matrix = np.array(entry["camera_to_world"], np.float64)
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise ValueError("camera_to_world must be 4 x 4 numbers")
    turn = matrix[:3, :3]
    if np.abs(turn.T @ turn - np.eye(3)).max() > 1e-4 or np.linalg.det(turn) < 0.0:
        raise ValueError("camera_to_world must turn without scaling or mirroring")
    focal_x, focal_y = float(entry["fx"]), float(entry["fy"])
    if min(focal_x, focal_y) <= 0.0:
        raise ValueError("fx and fy must be above 0")
    for key, middle in (("cx", 0.5 * width), ("cy", 0.5 * height)):
        if abs(float(entry.get(key, middle)) - middle) > 1e-6 * middle:
            raise ValueError(f"{key} must be the middle of the picture, {middle:g}")
    return Camera(
        matrix[:3, 3], turn[:, 0], -turn[:, 1], turn[:, 2], 0.5 * width / focal_x, 0.5 * height / focal_y
    )


def _triple(value: Any) -> Vectors:
    triple = np.array(value, np.float64)
    if triple.shape != (3,) or not np.isfinite(triple).all():
        raise ValueError(f"{value} is not three numbers")
    return triple


def looking(position: Vectors, target: Vectors, up: Vectors, tangent_x: float, tangent_y: float) -> Camera:
    """A camera at a place that looks at another, upright where it can be. Raises ValueError where both are
    the same place.
    """
    forward = target - position
    length = float(np.linalg.norm(forward))
    if length == 0.0:
        raise ValueError("position and target are the same")
    forward = forward / length
    if abs(forward @ up) > 0.999 * np.linalg.norm(up):  # straight up or down any direction will do
        up = np.roll(up, 1)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    return Camera(position, right, np.cross(right, forward), forward, tangent_x, tangent_y)


@dataclass(frozen=True)
class Scenery:
    """What sampled cameras look at, in the model's units.

    points (k, 3): all that is to be seen; up (3,); size: the root of the substrate's area; damage (d, 3) and
    normals (d, 3): places of damage, as many as there are; rays: of the mesh in display units, see
    `normalise`.
    """

    points: Vectors
    up: Vectors
    size: float
    damage: Vectors
    normals: Vectors
    rays: RayQueries
    normalise: Normalisation


_HALF_ANGLES = (10.0, 25.0)  # degrees, of half the picture's height
_HIGHEST = np.sin(np.radians(80.0))  # nothing is learnt from straight above
_FILL = (0.85, 1.15)  # of the distance at which the whole object just fits
_CLOSE_RADII = (0.08, 0.3)  # in sizes, of what a close-up shows
_TILT = 0.7  # of the view against the surface's normal, as the tangent of the angle
_CLOSE_EVERY = 3
_TRIES = 12


def sample_views(scenery: Scenery, count: int, width: int, height: int, seed: int) -> list[View]:
    """`count` cameras on the upper hemisphere that are filled by the object; every third one is a close-up of
    damage, where there is any. The same seed gives the same cameras.
    """
    random = np.random.default_rng([seed, 7])
    views = []
    for index in range(count):
        close = None
        if index % _CLOSE_EVERY == _CLOSE_EVERY - 1 and len(scenery.damage):
            close = _close_up(scenery, width / height, random)
        camera = close or _overview(scenery, width / height, random)
        views.append(View(f"camera-{index:04}", width, height, camera))
    return views


def _tangents(aspect: float, random: np.random.Generator) -> tuple[float, float]:
    tangent = float(np.tan(np.radians(random.uniform(*_HALF_ANGLES))))
    return tangent * aspect, tangent


def _overview(scenery: Scenery, aspect: float, random: np.random.Generator) -> Camera:
    up = scenery.up
    side = np.roll(up, 1)
    side = side - (side @ up) * up
    side /= np.linalg.norm(side)
    angle, high = random.uniform(0.0, 2.0 * np.pi), random.uniform(0.0, _HIGHEST)
    level = np.cos(angle) * side + np.sin(angle) * np.cross(up, side)
    backward = np.sqrt(1.0 - high**2) * level + high * up
    tangent_x, tangent_y = _tangents(aspect, random)
    centre = 0.5 * (scenery.points.min(axis=0) + scenery.points.max(axis=0))
    camera = looking(centre + backward, centre, up, tangent_x, tangent_y)
    away = scenery.points - centre
    distance = max(
        float((np.abs(away @ axis) / tangent - away @ camera.forward).max())
        for axis, tangent in ((camera.right, tangent_x), (camera.up, tangent_y))
    )
    return replace(camera, position=centre + distance * random.uniform(*_FILL) * backward)


def _close_up(scenery: Scenery, aspect: float, random: np.random.Generator) -> Camera | None:
    """A camera near a place of damage that nothing hides; None where there was none in some tries."""
    for _ in range(_TRIES):
        chosen = int(random.integers(len(scenery.damage)))
        point, normal = scenery.damage[chosen], scenery.normals[chosen]
        backward = normal + _TILT * random.uniform(-1.0, 1.0, 3)
        backward /= np.linalg.norm(backward)
        tangent_x, tangent_y = _tangents(aspect, random)
        radius = scenery.size * random.uniform(*_CLOSE_RADII)
        position = point + radius / min(tangent_x, tangent_y) * backward
        if _is_seen(scenery, position, point):
            return looking(position, point, scenery.up, tangent_x, tangent_y)
    return None


def _is_seen(scenery: Scenery, position: Vectors, point: Vectors) -> bool:
    """Whether nothing stands between a place and a point, but what is within a hundredth of the way of it."""
    start, end = scenery.normalise(np.stack([position, point]))
    way = (end - start)[None].astype(np.float32)
    return not bool(scenery.rays.blocked(start[None].astype(np.float32), way, 0.99)[0])
