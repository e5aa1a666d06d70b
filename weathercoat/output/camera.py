"""Where a picture is taken from: one camera that frames the substrate, the same for every frame of a run."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from weathercoat.mesh.surface import Vectors

_HALF_ANGLE = np.radians(
    13.0
)  # of the picture's shorter side: a long lens, which keeps plates from looking warped


@dataclass(frozen=True)
class Camera:
    """A pinhole camera.

    position, right, up, forward: float64 (3,), the last three an orthonormal frame, in the model's units.
    tangent_x, tangent_y: tangents of half the angle of view across and down the picture.
    """

    position: Vectors
    right: Vectors
    up: Vectors
    forward: Vectors
    tangent_x: float
    tangent_y: float

    def window(self, vertices: Vectors, width: int, height: int) -> tuple[slice, slice]:
        """The rows and columns of a picture outside which none of `vertices` shows."""
        away = vertices - self.position
        depth = np.maximum(away @ self.forward, 1e-9)
        x = (away @ self.right / depth / self.tangent_x + 1.0) * 0.5 * width
        y = (1.0 - away @ self.up / depth / self.tangent_y) * 0.5 * height
        rows, columns = (
            slice(int(np.clip(np.floor(at.min()), 0, limit)), int(np.clip(np.ceil(at.max()), 0, limit)))
            for at, limit in ((y, height), (x, width))
        )
        return rows, columns

    def directions(
        self, rows: NDArray[np.int64], columns: NDArray[np.int64], width: int, height: int
    ) -> NDArray[np.float32]:
        """Directions, not of unit length, through pixels at `rows` x `columns`, (rows * columns, 3)."""
        x = ((columns + 0.5) / width * 2.0 - 1.0) * self.tangent_x
        y = (1.0 - (rows + 0.5) / height * 2.0) * self.tangent_y
        direction = np.empty((len(rows), len(columns), 3), np.float32)
        for axis in range(3):
            direction[:, :, axis] = np.add.outer(self.forward[axis] + y * self.up[axis], x * self.right[axis])
        return direction.reshape(-1, 3)


def make_camera(
    vertices: Vectors,
    normals: Vectors,
    up: tuple[float, float, float],
    *,
    aspect: float,
    azimuth: float,
    elevation: float,
    margin: float,
) -> Camera:
    """The camera that sees all `vertices`, as near as the `margin` (a share of the picture's half size)
    allows.

    An object is seen from `azimuth` and `elevation` [degrees]: azimuth 0 is its front (+z where y is up, -y
    where z is up), positive azimuths lie to its right. A plate, open or closed, is seen from its normal side,
    turned by the same azimuth and from a little above, so that its curls show.
    """
    upward = _unit(np.asarray(up, np.float64))
    front = _front(upward)
    facing = _facing(normals, upward + front)
    if facing is not None:
        backward = _turned_from(facing, upward, front, azimuth, elevation)
    else:
        side = np.cross(upward, front)
        a, e = np.radians(azimuth), np.radians(elevation)
        backward = np.cos(e) * (np.cos(a) * front + np.sin(a) * side) + np.sin(e) * upward
    forward = -backward
    level = upward if abs(forward @ upward) < 0.999 else -front * np.sign(forward @ upward)
    right = _unit(np.cross(forward, level))
    upright = np.cross(right, forward)
    tangent = np.tan(_HALF_ANGLE)
    tangent_x, tangent_y = (tangent * aspect, tangent) if aspect >= 1.0 else (tangent, tangent / aspect)
    position = _fit(vertices, right, upright, forward, tangent_x * (1.0 - margin), tangent_y * (1.0 - margin))
    return Camera(position, right, upright, forward, float(tangent_x), float(tangent_y))


def _unit(vector: Vectors) -> Vectors:
    return vector / np.linalg.norm(vector)  # type: ignore[no-any-return]


def _facing(normals: Vectors, preferred: Vectors) -> Vectors | None:
    """The side that a plate faces (`preferred` decides between two alike); None for what is no plate."""
    if len(normals) == 0:
        return None
    mean = normals.mean(axis=0)
    if np.linalg.norm(mean) > 0.4:  # an open sheet, however curved: closed surfaces come near 0
        return _unit(mean)
    share, axes = np.linalg.eigh(normals.T @ normals / len(normals))
    if share[2] < 0.7:
        return None
    return axes[:, 2] * (1.0 if axes[:, 2] @ preferred > 0.0 else -1.0)


def _front(upward: Vectors) -> Vectors:
    """The horizontal direction that counts as the front."""
    guess = np.array([0.0, -1.0, 0.0]) if abs(upward[2]) > 0.9 else np.array([0.0, 0.0, 1.0])
    return _unit(guess - (guess @ upward) * upward)


def _turned_from(
    facing: Vectors, upward: Vectors, front: Vectors, azimuth: float, elevation: float
) -> Vectors:
    """Direction to the viewer of a plate that faces `facing`: three-quarter, a little from above."""
    steep = abs(facing @ upward)
    if steep > 0.9:
        # Lying flat: from the front, high enough that the surface is not foreshortened away.
        a, e = np.radians(azimuth), np.radians(max(2.0 * elevation, 42.0))
        side = np.cross(upward, front)
        return (
            np.cos(e) * (np.cos(a) * front + np.sin(a) * side) + np.sin(e) * np.sign(facing @ upward) * upward
        )
    level = _unit(facing - (facing @ upward) * upward)
    side = np.cross(upward, level)
    a = np.radians(azimuth)
    turned = _unit(np.cos(a) * level + np.sin(a) * side)
    e = np.radians(0.5 * elevation) + 0.5 * np.arcsin(np.clip(facing @ upward, -1.0, 1.0))
    return np.cos(e) * turned + np.sin(e) * upward  # type: ignore[no-any-return]


def _fit(
    vertices: Vectors, right: Vectors, up: Vectors, forward: Vectors, tan_x: float, tan_y: float
) -> Vectors:
    """The nearest position from which all vertices lie within the angle of view.

    Each side of the view is a plane through the camera; a vertex is inside when its signed distance is not
    positive. The extreme vertex of each side gives that plane's place, and two opposite planes meet at the
    greatest depth possible.
    """
    depth = vertices @ forward
    centre, nearest = [], []
    for axis, tangent in ((right, tan_x), (up, tan_y)):
        along = vertices @ axis
        high, low = (along - tangent * depth).max(), (-along - tangent * depth).max()
        centre.append(0.5 * (high - low))
        nearest.append(-(high + low) / (2.0 * tangent))
    extent = float(np.ptp(vertices, axis=0).max())
    back = min(*nearest, float(depth.min()) - 0.05 * extent)
    return centre[0] * right + centre[1] * up + back * forward  # type: ignore[no-any-return]


def zoomed(camera: Camera, zoom: float, centre: Vectors | None = None) -> Camera:
    """The camera with a lens `zoom` times as long, moved sideways so that `centre` (3,), where one is given,
    is in the middle of the picture.
    """
    position = camera.position
    if centre is not None:
        away = centre - position
        position = centre - (away @ camera.forward) * camera.forward
    return replace(
        camera, position=position, tangent_x=camera.tangent_x / zoom, tangent_y=camera.tangent_y / zoom
    )


def turntable(camera: Camera, points: Vectors, up: Vectors, count: int, *, margin: float) -> list[Camera]:
    """`count` cameras once round the points (k, 3), beginning at the azimuth of `camera`, all as far from the
    middle of the points that none of them leaves any picture.

    `up` (3,) is the unit vector that they turn about; margin: share of half the picture that stays free.
    """
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    away = points - centre
    turned, distance = [], 0.0
    for index in range(count):
        angle = 2.0 * np.pi * index / count
        right, upright, forward = (
            _turned_about(axis, up, angle) for axis in (camera.right, camera.up, camera.forward)
        )
        turned.append((right, upright, forward))
        for axis, tangent in ((right, camera.tangent_x), (upright, camera.tangent_y)):
            needed = np.abs(away @ axis) / (tangent * (1.0 - margin)) - away @ forward
            distance = max(distance, float(needed.max()))
    return [
        replace(camera, position=centre - distance * forward, right=right, up=upright, forward=forward)
        for right, upright, forward in turned
    ]


def _turned_about(vector: Vectors, axis: Vectors, angle: float) -> Vectors:
    """A vector turned about a unit axis (Rodrigues' formula)."""
    c, s = np.cos(angle), np.sin(angle)
    return c * vector + s * np.cross(axis, vector) + (1.0 - c) * (axis @ vector) * axis  # type: ignore[no-any-return]
