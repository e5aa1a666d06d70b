"""How much key light and sky reaches each sample: a few rays, then a filter that respects edges."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.mesh.surface import Indices, Vectors
from weathercoat.output.lights import Light
from weathercoat.output.rays import RayQueries
from weathercoat.output.shading import add_sky

_STRATA = (
    16  # neighbouring samples share one set of directions: each 4 x 4 block covers the hemisphere evenly
)
_LIFT = 3e-4  # start of a ray above its surface, in sizes


def gather_light(
    rays: RayQueries,
    row: NDArray[np.int32],
    column: NDArray[np.int32],
    position: NDArray[np.float64],
    facet: NDArray[np.float64],
    normal: NDArray[np.float64],
    *,
    key: NDArray[np.float64],
    up: NDArray[np.float64],
    light: Light,
    sky_rays: int,
    key_rays: int,
    reach: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The visible share of the key light (s,) and the mean radiance of the sky over the cosine-weighted
    hemisphere (s, 3).

    position, facet (the face's normal), normal (the shading normal): (s, 3), for samples in the pixels at
    `row`, `column`. Sky is blocked by what lies within `reach`.
    """
    count = len(position)
    origins = (position + _LIFT * facet).astype(np.float32)
    radiance = light.sky()
    directions = np.empty((count, 3), np.float32)
    lit, sky = np.zeros(count), np.zeros((count, 3))
    for index in range(key_rays):
        key_directions(row, column, key, light.radius, index, key_rays, directions)
        lit += ~rays.blocked(origins, directions, 1e4)
    for index in range(sky_rays):
        sky_directions(row, column, facet, normal, index, sky_rays, directions)
        add_sky(directions, rays.blocked(origins, directions, reach), up, radiance, sky)
    return lit / key_rays, sky / sky_rays


@kernel
def _hash(a: int, b: int, c: int) -> float:
    """A fixed value in [0, 1) for three integers (murmur3's finaliser)."""
    h = (
        (np.uint32(a) * np.uint32(0x9E3779B1))
        ^ (np.uint32(b) * np.uint32(0x85EBCA77))
        ^ (np.uint32(c) * np.uint32(0xC2B2AE3D))
    )
    h = np.uint32(h ^ (h >> np.uint32(16)))
    h = np.uint32(h * np.uint32(0x85EBCA6B))
    h = np.uint32(h ^ (h >> np.uint32(13)))
    h = np.uint32(h * np.uint32(0xC2B2AE35))
    return np.float64(np.uint32(h ^ (h >> np.uint32(16)))) * 2.3283064365386963e-10


@kernel
def _stratified(row: int, column: int, index: int, total: int, out: Vectors) -> None:
    """A point of the unit square: point `index` of the sample's own set of an R2 sequence, jittered; to `out`
    (2,).

    Source: Roberts, The unreasonable effectiveness of quasirandom sequences, 2018.
    """
    place = (row % 4) * 4 + (column % 4)
    number = ((place * 7) % _STRATA) * total + index
    jitter = 0.7 / np.sqrt(_STRATA * total)
    out[0] = (0.5 + number * 0.7548776662466927 + jitter * _hash(row, column, 2 * index)) % 1.0
    out[1] = (0.5 + number * 0.5698402909980532 + jitter * _hash(row, column, 2 * index + 1)) % 1.0


@kernel
def _frame(n: Vectors, t: Vectors, b: Vectors) -> None:
    """Two unit vectors that complete n to a frame (Duff et al., Orthonormal basis, revisited, 2017)."""
    sign = 1.0 if n[2] >= 0.0 else -1.0
    p = -1.0 / (sign + n[2])
    q = n[0] * n[1] * p
    t[0], t[1], t[2] = 1.0 + sign * n[0] * n[0] * p, sign * q, -sign * n[0]
    b[0], b[1], b[2] = q, sign + n[1] * n[1] * p, -n[1]


@kernel
def sky_directions(
    row: Indices,
    column: Indices,
    facet: Vectors,
    normal: Vectors,
    index: int,
    total: int,
    out: NDArray[np.float32],
) -> None:
    """A cosine-distributed direction for each sample, (s, 3), never under its face."""
    t, b, point = np.empty(3), np.empty(3), np.empty(2)
    for i in range(len(row)):
        _frame(normal[i], t, b)
        _stratified(row[i], column[i], index, total, point)
        radius, angle = np.sqrt(point[0]), 2.0 * np.pi * point[1]
        x, y, z = radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1.0 - point[0])
        under = 0.0
        for c in range(3):
            out[i, c] = x * t[c] + y * b[c] + z * normal[i, c]
            under += out[i, c] * facet[i, c]
        if under < 0.02:
            for c in range(3):
                out[i, c] += (0.02 - under) * facet[i, c]


@kernel
def key_directions(
    row: Indices,
    column: Indices,
    key: Vectors,
    disc: float,
    index: int,
    total: int,
    out: NDArray[np.float32],
) -> None:
    """A direction within the key light's disc, of the radius `disc`, for each sample, (s, 3)."""
    t, b, point = np.empty(3), np.empty(3), np.empty(2)
    _frame(key, t, b)
    for i in range(len(row)):
        _stratified(row[i], column[i], index, total, point)
        radius, angle = disc * np.sqrt(point[0]), 2.0 * np.pi * point[1]
        x, y = radius * np.cos(angle), radius * np.sin(angle)
        length = np.sqrt(1.0 + radius * radius)
        for c in range(3):
            out[i, c] = (key[c] + x * t[c] + y * b[c]) / length


@kernel
def share_samples(
    sample: Indices,
    face: Indices,
    weights: NDArray[np.float32],
    vertices: Vectors,
    faces: Indices,
    kind: NDArray[np.uint8],
    factor: int,
    tolerance: float,
    leader: Indices,
) -> None:
    """Let the samples of a pixel that lie on one smooth surface share their light and colour.

    sample int32 (height, width): the number of the sample at each place, -1 where there is none; a pixel is a
    square of `factor` samples a side. face (s,), weights (s, 2): where the samples lie on the mesh; kind (t,)
    of its faces. `leader` (s,) gets the number of the sample to use in place of each: the first of its pixel
    that has the same kind, turns by less than 14 degrees, and lies within `tolerance` of its plane.
    """
    height, width = sample.shape
    position, facet = np.empty((len(face), 3)), np.empty((len(face), 3))
    for i in range(len(face)):
        a, b, c = vertices[faces[face[i], 0]], vertices[faces[face[i], 1]], vertices[faces[face[i], 2]]
        squared = 0.0
        for x in range(3):
            y, z = (x + 1) % 3, (x + 2) % 3
            facet[i, x] = (b[y] - a[y]) * (c[z] - a[z]) - (b[z] - a[z]) * (c[y] - a[y])
            position[i, x] = a[x] + weights[i, 0] * (b[x] - a[x]) + weights[i, 1] * (c[x] - a[x])
            squared += facet[i, x] * facet[i, x]
        for x in range(3):
            facet[i, x] /= max(np.sqrt(squared), 1e-300)
    for r in range(height):
        for c in range(width):
            i = sample[r, c]
            if i < 0:
                continue
            leader[i] = i
            for before in range((r % factor) * factor + c % factor):
                j = sample[r - r % factor + before // factor, c - c % factor + before % factor]
                if j < 0 or leader[j] != j or kind[face[j]] != kind[face[i]]:
                    continue
                cosine, away = 0.0, 0.0
                for axis in range(3):
                    cosine += facet[i, axis] * facet[j, axis]
                    away += facet[i, axis] * (position[j, axis] - position[i, axis])
                if cosine > 0.97 and abs(away) < tolerance:
                    leader[i] = j
                    break


@kernel
def filter_light(
    sample: Indices,
    stride: int,
    row: Indices,
    column: Indices,
    position: Vectors,
    facet: Vectors,
    tolerance: float,
    lit: Vectors,
    sky: Vectors,
    out_lit: Vectors,
    out_sky: Vectors,
) -> None:
    """Average the light of each sample with its neighbours, `stride` places apart, that lie on the same
    surface.

    sample int32 (height, width): the number of the sample at each place, -1 where there is none. A neighbour
    counts when the two facets turn by less than 45 degrees and it lies within `tolerance` of the sample's
    plane.
    """
    height, width = sample.shape
    for i in range(len(row)):
        weight, light, x, y, z = 0.0, 0.0, 0.0, 0.0, 0.0
        for dy in range(-2, 3):
            r = row[i] + dy * stride
            if r < 0 or r >= height:
                continue
            for dx in range(-2, 3):
                c = column[i] + dx * stride
                if c < 0 or c >= width:
                    continue
                j = sample[r, c]
                if j < 0:
                    continue
                cosine, away = 0.0, 0.0
                for axis in range(3):
                    cosine += facet[i, axis] * facet[j, axis]
                    away += facet[i, axis] * (position[j, axis] - position[i, axis])
                if cosine < 0.7 or abs(away) > tolerance:
                    continue
                # The outer ring counts half, so the window is four samples wide: one full set of directions.
                w = (0.5 if abs(dx) == 2 else 1.0) * (0.5 if abs(dy) == 2 else 1.0)
                weight += w
                light += w * lit[j]
                x += w * sky[j, 0]
                y += w * sky[j, 1]
                z += w * sky[j, 2]
        out_lit[i] = light / weight
        out_sky[i, 0], out_sky[i, 1], out_sky[i, 2] = x / weight, y / weight, z / weight
