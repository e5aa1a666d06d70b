"""Closest points on triangles: a tree of boxes over the faces, searched from a face that is near already.

The faces are the leaves, in their order along a space-filling curve, of a complete binary tree, in an array
in which node k has the children 2 k + 1 and 2 k + 2; so it is built in linear time. A vertex that is
projected again and again has last time's face as a hint, which bounds the search from the start: hardly more
boxes are opened than hold the answer.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.mesh.buckets import order_codes
from weathercoat.mesh.order import morton_codes
from weathercoat.mesh.surface import Indices, Vectors

_FLAT = 1e-8  # share of a square of sides under which the area of a face is too inexact to be relied on


class ClosestTree(NamedTuple):
    """corner: (m, 9), the corners of the faces in the order of the tree; face, place: int32 (m,), which face
    is at each place and the reverse; box: (2 p - 1, 6), low and high corners, the last p of them those of
    leaves.
    """

    corner: Vectors
    face: Indices
    place: Indices
    box: Vectors


def make_closest_tree(vertices: Vectors, faces: Indices) -> ClosestTree:
    """The tree of the faces (m, 3), at least one, of vertices (n, 3)."""
    corner = vertices[faces].reshape(-1, 9)
    face = order_codes(morton_codes(corner.reshape(-1, 3, 3).sum(axis=1)))
    place = np.empty_like(face)
    place[face] = np.arange(len(face), dtype=np.int32)
    leaves = 1
    while leaves < len(face):
        leaves *= 2
    box = np.empty((2 * leaves - 1, 6))
    corner = corner[face]
    _fill_boxes(corner, box)
    return ClosestTree(corner, face, place, box)


def find_closest(tree: ClosestTree, points: Vectors, hint: Indices) -> tuple[Indices, Vectors]:
    """The nearest face (k,) and the nearest point on it (k, 3) for points (k, 3); any faces as `hint` (k,).

    Of faces that are equally near, the hint is taken.
    """
    face, near = np.empty(len(points), np.int32), np.empty((len(points), 3))
    _search(tree.corner, tree.face, tree.place, tree.box, points, hint, face, near)
    return face, near


def are_within(tree: ClosestTree, points: Vectors, faces: Indices, distance: float) -> NDArray[np.bool_]:
    """Whether each of the points (k, 3) is within `distance` of its own one of the `faces` (k,)."""
    near = np.empty(len(points), np.bool_)
    _compare(tree.corner, tree.place, points, faces, distance, near)
    return near


@kernel
def _compare(
    corner: Vectors, place: Indices, points: Vectors, faces: Indices, distance: float, near: NDArray[np.bool_]
) -> None:
    for i in range(len(points)):
        squared = _closest_at(corner, place[faces[i]], points[i, 0], points[i, 1], points[i, 2])[0]
        near[i] = squared <= distance * distance


@kernel
def _fill_boxes(corner: Vectors, box: Vectors) -> None:
    first_leaf = len(box) // 2
    box[:, :3] = np.inf
    box[:, 3:] = -np.inf
    for k in range(len(corner)):
        for i in range(9):
            box[first_leaf + k, i % 3] = min(box[first_leaf + k, i % 3], corner[k, i])
            box[first_leaf + k, 3 + i % 3] = max(box[first_leaf + k, 3 + i % 3], corner[k, i])
    for node in range(first_leaf - 1, -1, -1):
        for axis in range(3):
            box[node, axis] = min(box[2 * node + 1, axis], box[2 * node + 2, axis])
            box[node, 3 + axis] = max(box[2 * node + 1, 3 + axis], box[2 * node + 2, 3 + axis])


@kernel
def _box_distance(box: Vectors, node: int, x: float, y: float, z: float) -> float:
    """Squared distance of a point from a box; infinite where the box is empty."""
    dx = max(box[node, 0] - x, x - box[node, 3], 0.0)
    dy = max(box[node, 1] - y, y - box[node, 4], 0.0)
    dz = max(box[node, 2] - z, z - box[node, 5], 0.0)
    return dx * dx + dy * dy + dz * dz


@kernel
def _search(
    corner: Vectors,
    face: Indices,
    place: Indices,
    box: Vectors,
    points: Vectors,
    hint: Indices,
    out_face: Indices,
    out_point: Vectors,
) -> None:
    first_leaf = len(box) // 2
    waiting = np.empty(64, np.int64)
    bound = np.empty(64)
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        best = place[hint[i]]
        distance, px, py, pz = _closest_at(corner, best, x, y, z)
        waiting[0] = 0
        bound[0] = 0.0
        count = 1
        while count > 0:
            count -= 1
            if bound[count] >= distance:
                continue
            node = waiting[count]
            while node < first_leaf:
                left = 2 * node + 1
                d_left, d_right = _box_distance(box, left, x, y, z), _box_distance(box, left + 1, x, y, z)
                near, d_near, far, d_far = left, d_left, left + 1, d_right
                if d_right < d_left:
                    near, d_near, far, d_far = left + 1, d_right, left, d_left
                if d_far < distance:
                    waiting[count] = far
                    bound[count] = d_far
                    count += 1
                if d_near >= distance:
                    break
                node = near
            if node < first_leaf:
                continue
            d, qx, qy, qz = _closest_at(corner, node - first_leaf, x, y, z)
            if d < distance:
                best, distance, px, py, pz = node - first_leaf, d, qx, qy, qz
        out_face[i] = face[best]
        out_point[i, 0], out_point[i, 1], out_point[i, 2] = px, py, pz


@kernel
def _closest_at(corner: Vectors, k: int, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    return closest_on_triangle(
        x, y, z,
        corner[k, 0], corner[k, 1], corner[k, 2],
        corner[k, 3], corner[k, 4], corner[k, 5],
        corner[k, 6], corner[k, 7], corner[k, 8],
    )  # fmt: skip


@kernel
def closest_on_triangle(
    x: float, y: float, z: float,
    ax: float, ay: float, az: float,
    bx: float, by: float, bz: float,
    cx: float, cy: float, cz: float,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Squared distance of a point from the triangle a, b, c, and the nearest point on it.

    Source: Ericson, Real-Time Collision Detection, 2005, section 5.1.5, written as plane first, edges second.
    """
    ux, uy, uz = bx - ax, by - ay, bz - az
    vx, vy, vz = cx - ax, cy - ay, cz - az
    wx, wy, wz = x - ax, y - ay, z - az
    uu, uv, vv = ux * ux + uy * uy + uz * uz, ux * vx + uy * vy + uz * vz, vx * vx + vy * vy + vz * vz
    wu, wv = wx * ux + wy * uy + wz * uz, wx * vx + wy * vy + wz * vz
    area = uu * vv - uv * uv
    s, t = vv * wu - uv * wv, uu * wv - uv * wu
    best, px, py, pz = np.inf, ax, ay, az
    if area > 0 and s >= 0 and t >= 0 and s + t <= area:
        s, t = s / area, t / area
        px, py, pz = ax + s * ux + t * vx, ay + s * uy + t * vy, az + s * uz + t * vz
        best = (px - x) ** 2 + (py - y) ** 2 + (pz - z) ** 2
        if area > _FLAT * uu * vv:
            return best, px, py, pz
    for side in range(3):
        if side == 0:
            ox, oy, oz, ex, ey, ez = ax, ay, az, ux, uy, uz
        elif side == 1:
            ox, oy, oz, ex, ey, ez = bx, by, bz, cx - bx, cy - by, cz - bz
        else:
            ox, oy, oz, ex, ey, ez = cx, cy, cz, -vx, -vy, -vz
        along = (x - ox) * ex + (y - oy) * ey + (z - oz) * ez
        length = ex * ex + ey * ey + ez * ez
        r = min(max(along / length, 0.0), 1.0) if length > 0 else 0.0
        qx, qy, qz = ox + r * ex, oy + r * ey, oz + r * ez
        d = (qx - x) ** 2 + (qy - y) ** 2 + (qz - z) ** 2
        if d < best:
            best, px, py, pz = d, qx, qy, qz
    return best, px, py, pz
