"""Ray queries without Embree: a tree of bounding boxes over the faces in Morton order."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.mesh.surface import Indices, Vectors

_LEAF = 4  # faces in a leaf
_DEPTH = 64  # of the stack: a complete tree of 2**31 leaves needs 33


class TreeRays:
    """Ray queries on a mesh, as `rays.RayQueries`; slower than Embree, with the same answers up to rounding.

    The tree is complete and implicit: the children of node i are 2 i + 1 and 2 i + 2, and the leaves, the
    last nodes, hold `_LEAF` faces each in the order of their centres along a Morton curve.
    """

    def __init__(self, vertices: Vectors, faces: Indices) -> None:
        corners = np.asarray(vertices, np.float64)[faces]
        self._order = np.argsort(_morton_codes(corners.mean(axis=1)), kind="stable").astype(np.int32)
        self._corners = np.ascontiguousarray(corners[self._order])
        leaves = 1
        while leaves * _LEAF < len(faces):
            leaves *= 2
        self._first_leaf = leaves - 1
        self._low = np.full((2 * leaves - 1, 3), np.inf)
        self._high = np.full((2 * leaves - 1, 3), -np.inf)
        leaf = self._first_leaf + np.arange(len(faces)) // _LEAF
        np.minimum.at(self._low, leaf, self._corners.min(axis=1))
        np.maximum.at(self._high, leaf, self._corners.max(axis=1))
        level = self._first_leaf
        while level > 0:
            parent = (level - 1) // 2
            for bounds, merge in ((self._low, np.minimum), (self._high, np.maximum)):
                below = bounds[level : 2 * level + 1]
                bounds[parent:level] = merge(below[0::2], below[1::2])
            level = parent

    def nearest(
        self, origins: NDArray[np.float32], directions: NDArray[np.float32]
    ) -> tuple[Indices, NDArray[np.float32]]:
        """The first face each ray meets, -1 for none, and the weights of its second and third corner."""
        face, weights = np.full(len(origins), -1, np.int32), np.zeros((len(origins), 2), np.float32)
        _trace(
            origins,
            directions,
            np.inf,
            False,
            self._first_leaf,
            self._low,
            self._high,
            self._corners,
            face,
            weights,
        )
        met = face >= 0
        face[met] = self._order[face[met]]
        return face, weights

    def blocked(
        self, origins: NDArray[np.float32], directions: NDArray[np.float32], reach: float
    ) -> NDArray[np.bool_]:
        """Whether each ray meets any face within `reach`."""
        face, weights = np.full(len(origins), -1, np.int32), np.zeros((len(origins), 2), np.float32)
        _trace(
            origins,
            directions,
            reach,
            True,
            self._first_leaf,
            self._low,
            self._high,
            self._corners,
            face,
            weights,
        )
        return face >= 0


def _morton_codes(points: Vectors) -> NDArray[np.uint64]:
    """Place of each point (k, 3) along a Morton curve with 20 bits an axis."""
    low, extent = points.min(axis=0), np.ptp(points, axis=0).max()
    cell = ((points - low) / max(float(extent), 1e-300) * (2**20 - 1)).astype(np.uint64)
    code = np.zeros(len(points), np.uint64)
    for bit in range(20):
        for axis in range(3):
            code |= ((cell[:, axis] >> np.uint64(bit)) & np.uint64(1)) << np.uint64(3 * bit + axis)
    return code


@kernel
def _enter(low: Vectors, high: Vectors, node: int, origin: Vectors, inverse: Vectors, reach: float) -> float:
    """Distance at which a ray enters the box of a node; infinite where it misses or enters beyond `reach`."""
    if low[node, 0] > high[node, 0]:
        return np.inf  # a leaf without faces
    first, last = 0.0, reach
    for axis in range(3):
        a = (low[node, axis] - origin[axis]) * inverse[axis]
        b = (high[node, axis] - origin[axis]) * inverse[axis]
        first, last = max(first, min(a, b)), min(last, max(a, b))
    return first if first <= last else np.inf


@kernel
def _meet(corners: Vectors, k: int, origin: Vectors, direction: Vectors) -> tuple[float, float, float]:
    """Distance to triangle k of (m, 3, 3), or infinity, and the weights of its second and third corner.

    Source: Moeller and Trumbore, Fast, minimum storage ray-triangle intersection, 1997.
    """
    ax, ay, az = corners[k, 0, 0], corners[k, 0, 1], corners[k, 0, 2]
    ex, ey, ez = corners[k, 1, 0] - ax, corners[k, 1, 1] - ay, corners[k, 1, 2] - az
    fx, fy, fz = corners[k, 2, 0] - ax, corners[k, 2, 1] - ay, corners[k, 2, 2] - az
    dx, dy, dz = direction[0], direction[1], direction[2]
    px, py, pz = dy * fz - dz * fy, dz * fx - dx * fz, dx * fy - dy * fx
    determinant = ex * px + ey * py + ez * pz
    if determinant == 0.0:
        return np.inf, 0.0, 0.0
    tx, ty, tz = origin[0] - ax, origin[1] - ay, origin[2] - az
    u = (tx * px + ty * py + tz * pz) / determinant
    if u < 0.0 or u > 1.0:
        return np.inf, 0.0, 0.0
    qx, qy, qz = ty * ez - tz * ey, tz * ex - tx * ez, tx * ey - ty * ex
    v = (dx * qx + dy * qy + dz * qz) / determinant
    distance = (fx * qx + fy * qy + fz * qz) / determinant
    if v < 0.0 or u + v > 1.0 or distance <= 0.0:
        return np.inf, 0.0, 0.0
    return distance, u, v


@kernel
def _trace(
    origins: NDArray[np.float32],
    directions: NDArray[np.float32],
    reach: float,
    any_hit: bool,
    first_leaf: int,
    low: Vectors,
    high: Vectors,
    corners: Vectors,
    face: Indices,
    weights: NDArray[np.float32],
) -> None:
    origin, direction, inverse = np.empty(3), np.empty(3), np.empty(3)
    stack, entry = np.empty(_DEPTH, np.int64), np.empty(_DEPTH)
    for ray in range(len(origins)):
        for c in range(3):
            origin[c], direction[c] = origins[ray, c], directions[ray, c]
            inverse[c] = 1.0 / direction[c] if abs(direction[c]) > 1e-12 else np.copysign(1e12, direction[c])
        best = reach
        stack[0], entry[0], top = 0, _enter(low, high, 0, origin, inverse, best), 1
        while top > 0:
            top -= 1
            node = stack[top]
            if entry[top] >= best:
                continue
            if node >= first_leaf:
                start = (node - first_leaf) * _LEAF
                for k in range(start, min(start + _LEAF, len(corners))):
                    distance, u, v = _meet(corners, k, origin, direction)
                    if distance < best:
                        best = distance
                        face[ray], weights[ray, 0], weights[ray, 1] = k, u, v
                if any_hit and face[ray] >= 0:
                    break
                continue
            near, far = 2 * node + 1, 2 * node + 2
            near_entry = _enter(low, high, near, origin, inverse, best)
            far_entry = _enter(low, high, far, origin, inverse, best)
            if far_entry < near_entry:
                near, far, near_entry, far_entry = far, near, far_entry, near_entry
            stack[top], entry[top] = far, far_entry
            stack[top + 1], entry[top + 1] = near, near_entry
            top += 2
