"""A frame that belongs to the shape and to gravity, so that moving, scaling or turning both changes nothing.

Random numbers and noise are read off positions in this frame: origin at the centre of the area, unit the size
(square root of the area), third axis `up`. The first axis is the horizontal direction in which the shape is
longest, and points to its heavier-tailed side. A shape that has no such direction (a ball, a drum on its end,
a rectangle) has no frame of its own; there the model's axes decide.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from weathercoat.mesh.order import order_surface
from weathercoat.mesh.surface import Surface, Vectors

# relative difference of the principal moments, and skewness, below which a shape counts as symmetric
_DISTINCT = 1e-3


@dataclass(frozen=True)
class Frame:
    """origin (3,) and size in model units; axes (3, 3), one unit vector a row, the last one up."""

    origin: Vectors
    size: float
    axes: Vectors

    def localise(self, points: Vectors) -> Vectors:
        """Model coordinates (n, 3) as coordinates of the frame, in sizes."""
        moved = (points - self.origin) / self.size
        # written out, since a BLAS product may change its last bits with the number of threads
        return (
            moved[:, :1] * self.axes[:, 0] + moved[:, 1:2] * self.axes[:, 1] + moved[:, 2:3] * self.axes[:, 2]
        )

    def globalise(self, points: Vectors) -> Vectors:
        """Coordinates of the frame (n, 3) as model coordinates."""
        turned = points[:, :1] * self.axes[0] + points[:, 1:2] * self.axes[1] + points[:, 2:3] * self.axes[2]
        return turned * self.size + self.origin

    def turn(self, directions: Vectors) -> Vectors:
        """Directions of the frame (n, 3) as directions of the model."""
        d = directions
        return d[:, :1] * self.axes[0] + d[:, 1:2] * self.axes[1] + d[:, 2:3] * self.axes[2]


def make_frame(surface: Surface) -> Frame:
    """The frame of a surface with an area, by its `up`; the same bits however the surface is numbered."""
    surface, _ = order_surface(surface, surface.vertices)
    corners = surface.vertices[surface.faces]
    areas = surface.face_areas()
    weight = areas / areas.sum()
    centres = corners.mean(axis=1)
    origin = np.array([np.sum(weight * centres[:, axis]) for axis in range(3)])
    size = surface.size()
    up = np.asarray(surface.up, np.float64)
    up = up / np.linalg.norm(up)
    side, ahead = _model_axes(up)
    x = np.sum((centres - origin) * side, axis=1) / size
    y = np.sum((centres - origin) * ahead, axis=1) / size
    xx, xy, yy = np.sum(weight * x * x), np.sum(weight * x * y), np.sum(weight * y * y)
    spread = np.hypot(xx - yy, 2 * xy)
    if spread > _DISTINCT * (xx + yy):
        angle = 0.5 * np.arctan2(2 * xy, xx - yy)
        along = np.cos(angle) * x + np.sin(angle) * y
        skew = np.sum(weight * along**3) / np.sum(weight * along**2) ** 1.5
        if abs(skew) > _DISTINCT:
            angle += np.pi if skew < 0 else 0.0
            side, ahead = (
                np.cos(angle) * side + np.sin(angle) * ahead,
                np.cos(angle) * ahead - np.sin(angle) * side,
            )
    return Frame(origin, size, np.stack([side, ahead, up]))


def _model_axes(up: Vectors) -> tuple[Vectors, Vectors]:
    """Two horizontal unit vectors that make a right-handed frame with `up`: the model's own axes where up is
    one.
    """
    seed = np.array([0.0, 1.0, 0.0]) if abs(up[0]) > 0.9 else np.array([1.0, 0.0, 0.0])
    side = seed - np.dot(seed, up) * up
    side /= np.linalg.norm(side)
    return side, np.cross(up, side)
