"""Masks from the shape: heights, directions, distances to lines and edges, pictures on it; 0 to 1, (n,)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from weathercoat.mesh.surface import Indices, Surface, Vectors, face_normals, vertex_normals


def fade(beyond: Vectors, soft: float) -> Vectors:
    """1 where `beyond` is not above 0, falling to 0 over the length `soft`, smoothly at both ends."""
    if soft <= 0.0:
        return (beyond <= 0.0).astype(np.float64)
    x = np.clip(beyond / soft, 0.0, 1.0)
    return 1.0 - x * x * (3.0 - 2.0 * x)


def along_up(surface: Surface) -> Vectors:
    """Heights of the vertices above the lowest, in the model's units."""
    height = _along(surface.vertices, np.asarray(surface.up, np.float64))
    return height - height.min()


def turned_from(surface: Surface, direction: Vectors) -> Vectors:
    """Angles [degrees] between the outward normals of the vertices and a direction."""
    unit = direction / np.linalg.norm(direction)
    cosine = _along(vertex_normals(surface.vertices, surface.faces), unit)
    return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))


def _along(vectors: Vectors, direction: Vectors) -> Vectors:
    # written out, since a BLAS product may change its last bits with the number of threads
    return vectors[:, 0] * direction[0] + vectors[:, 1] * direction[1] + vectors[:, 2] * direction[2]


def distance_to(points: Vectors, segments: Vectors) -> Vectors:
    """Distance of points (n, 3) to the nearest of segments (s, 2, 3); infinite where there are none."""
    import igl

    if len(segments) == 0:
        return np.full(len(points), np.inf)
    ends = np.arange(2 * len(segments), dtype=np.int64).reshape(-1, 2)
    squared = igl.point_mesh_squared_distance(np.ascontiguousarray(points), segments.reshape(-1, 3), ends)[0]
    return np.sqrt(squared)


def sharp_edges(surface: Surface, twin: Indices, angle: float, *, rims: bool) -> Vectors:
    """The edges (s, 2, 3) that bend by more than an angle [degrees] and, where wanted, those of one face.

    twin: (3 m,), the other half-edge of each, -1 where there is none.
    """
    normal = face_normals(surface.vertices, surface.faces)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0.0)
    here = np.arange(len(twin))
    inner = (twin >= 0) & (here < twin)
    cosine = np.sum(normal[here[inner] // 3] * normal[twin[inner] // 3], axis=1)
    is_sharp: NDArray[np.bool_] = (twin < 0) if rims else np.zeros(len(twin), np.bool_)
    is_sharp[inner] = cosine < np.cos(np.radians(angle))
    start = surface.faces.reshape(-1)
    end = np.roll(surface.faces, -1, axis=1).reshape(-1)
    return np.stack([surface.vertices[start[is_sharp]], surface.vertices[end[is_sharp]]], axis=1)


def mean_of_corners(surface: Surface, values: Vectors) -> Vectors:
    """What vertices have of values at the corners of faces, (m, 3): their mean."""
    corner = surface.faces.reshape(-1)
    count = np.bincount(corner, minlength=len(surface.vertices))
    total = np.bincount(corner, values.reshape(-1), len(surface.vertices))
    return total / np.maximum(count, 1)


def sample_picture(picture: Vectors, uv: Vectors) -> Vectors:
    """A picture (h, w), its top row first, at texture coordinates (k, 2), v upwards: bilinear, and repeated
    beyond 0 to 1.
    """
    height, width = picture.shape
    x, y = uv[:, 0] * width - 0.5, (1.0 - uv[:, 1]) * height - 0.5
    left, top = np.floor(x), np.floor(y)
    right_share, low_share = x - left, y - top
    columns = left.astype(np.int64) % width, (left.astype(np.int64) + 1) % width
    rows = top.astype(np.int64) % height, (top.astype(np.int64) + 1) % height
    upper = picture[rows[0], columns[0]] * (1.0 - right_share) + picture[rows[0], columns[1]] * right_share
    lower = picture[rows[1], columns[0]] * (1.0 - right_share) + picture[rows[1], columns[1]] * right_share
    return upper * (1.0 - low_share) + lower * low_share
