"""The shadow that the object casts on an otherwise invisible ground, which makes it stand somewhere."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from weathercoat.mesh.surface import Vectors
from weathercoat.output.camera import Camera
from weathercoat.output.lighting import filter_light, key_directions, sky_directions
from weathercoat.output.lights import Light
from weathercoat.output.rays import RayQueries

_SKY_RAYS = 2


def ground_shadow(
    rays: RayQueries,
    camera: Camera,
    wanted: NDArray[np.bool_],
    *,
    up: Vectors,
    level: float,
    radius: float,
    light: Light,
    reach: float,
) -> NDArray[np.float64]:
    """What the background of each pixel is multiplied by, (height, width): 1 on open ground, less in shadow.

    wanted (height, width): the pixels where the background shows. The ground is the plane at `level` along
    `up`; it ends softly at `radius` round the origin, and is not there for a camera that lies below it.
    """
    height, width = wanted.shape
    factor = np.ones(wanted.shape)
    key = light.direction(camera, up)
    above = float(camera.position @ up) - level
    if above <= 0.0:
        return factor
    direction = camera.directions(np.arange(height), np.arange(width), width, height)
    descent = -(direction @ up)
    met = np.flatnonzero((descent > 1e-6) & wanted.ravel())
    point = camera.position + (above / descent[met])[:, None] * direction[met]
    away = np.linalg.norm(point - (point @ up)[:, None] * up, axis=1)
    near = away < radius
    met, point, away = met[near], point[near], away[near]
    row, column = (met // width).astype(np.int32), (met % width).astype(np.int32)
    facet = np.tile(up, (len(met), 1))
    origins, directions = point.astype(np.float32), np.empty((len(met), 3), np.float32)
    key_directions(row, column, key, light.radius, 0, 1, directions)
    lit = (~rays.blocked(origins, directions, 1e4)).astype(np.float64)
    sky = np.zeros((len(met), 3))
    for index in range(_SKY_RAYS):
        sky_directions(row, column, facet, facet, index, _SKY_RAYS, directions)
        sky += ~rays.blocked(origins, directions, reach)[:, None] / _SKY_RAYS
    number = np.full(wanted.shape, -1, np.int32)
    number[row, column] = np.arange(len(met), dtype=np.int32)
    smooth_lit, smooth_sky = np.empty_like(lit), np.empty_like(sky)
    for stride in (1, 3):
        filter_light(number, stride, row, column, point, facet, 1e-3, lit, sky, smooth_lit, smooth_sky)
        lit, sky, smooth_lit, smooth_sky = smooth_lit, smooth_sky, lit, sky
    brightness = light.key_share * lit + (1.0 - light.key_share) * sky[:, 0]
    fade = np.clip((radius - away) / (0.4 * radius), 0.0, 1.0)
    factor[row, column] = 1.0 - light.shade * fade * (1.0 - brightness)
    return factor
