"""Polygons to triangles, concave ones included: small ones as fans where that fits, others by ear clipping.

Source of ear clipping: Meisters, Polygons have ears, American Mathematical Monthly 82, 1975.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel

# Up to here a fan has no slivers to speak of; and a fan from the first corner is what other programs show.
MAX_FAN = 8


def triangulate(
    positions: NDArray[np.float64], corners: NDArray[np.int64], sizes: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Triangles (t, 3) as indices into `corners`, so that data per corner follow; (t,) the polygon of each.

    positions: (n, 3), finite where used; corners: (k,) vertex of each corner; sizes: (m,) corners of each
    polygon. Polygons of fewer than three corners give none. Triangles keep the order and the orientation of
    the polygons.
    """
    if (sizes == 3).all():
        return np.arange(len(corners)).reshape(-1, 3), np.arange(len(sizes))
    first = np.cumsum(sizes) - sizes
    count = np.maximum(sizes - 2, 0)
    polygon = np.repeat(np.arange(len(sizes)), count)
    triangles = np.empty((len(polygon), 3), np.int64)
    begin = np.cumsum(count) - count
    fanned = sizes <= 3
    for n in range(3, MAX_FAN + 1):
        chosen = np.flatnonzero(sizes == n)
        steps = np.arange(n - 2)
        fan = np.stack([np.zeros(n - 2, np.int64), steps + 1, steps + 2], axis=1)
        triangles[begin[chosen, None] + steps] = first[chosen, None, None] + fan
        if n > 3:
            fanned[chosen] = _is_fan(positions[corners[first[chosen, None] + np.arange(n)]])
    rest = np.flatnonzero(~fanned)
    if len(rest):
        longest = int(sizes[rest].max())
        _clip_polygons(positions, corners, first[rest], sizes[rest], begin[rest], longest, triangles)
    return triangles, polygon


def _is_fan(points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether the triangles from the first corner to each edge are all oriented as the polygon (q, n, 3)."""
    arm = points[:, 1:] - points[:, :1]
    normals = np.cross(arm[:, :-1], arm[:, 1:])
    along = np.einsum("qij,qj->qi", normals, normals.sum(axis=1))
    return (along > 0).all(axis=1)  # type: ignore[no-any-return]


@kernel
def _clip_polygons(positions, corners, first, sizes, begin, longest, triangles):  # type: ignore[no-untyped-def]
    flat = np.empty((longest, 2))
    for q in range(len(first)):
        n = sizes[q]
        _flatten(positions, corners[first[q] : first[q] + n], flat)
        part = triangles[begin[q] : begin[q] + n - 2]
        _clip_ears(flat[:n], part)
        part += first[q]


@kernel
def _flatten(positions, corners, flat):  # type: ignore[no-untyped-def]
    """The polygon seen along the axis nearest to its normal, counter-clockwise, into `flat` (n, 2).

    Source of the normal: Newell's method (Sutherland, Sproull and Schumacker, 1974).
    """
    normal = np.zeros(3)
    origin = positions[corners[0]]
    for i in range(len(corners)):
        p = positions[corners[i]] - origin
        q = positions[corners[(i + 1) % len(corners)]] - origin
        normal[0] += p[1] * q[2] - p[2] * q[1]
        normal[1] += p[2] * q[0] - p[0] * q[2]
        normal[2] += p[0] * q[1] - p[1] * q[0]
    axis = np.argmax(np.abs(normal))
    u, v = (axis + 1) % 3, (axis + 2) % 3
    if normal[axis] < 0:
        u, v = v, u
    for i in range(len(corners)):
        flat[i, 0] = positions[corners[i], u] - origin[u]
        flat[i, 1] = positions[corners[i], v] - origin[v]


@kernel
def _turn(p, a, b, c):  # type: ignore[no-untyped-def]
    """Twice the signed area of a triangle of points of `p` (n, 2): positive counter-clockwise."""
    return (p[b, 0] - p[a, 0]) * (p[c, 1] - p[a, 1]) - (p[b, 1] - p[a, 1]) * (p[c, 0] - p[a, 0])


@kernel
def _is_ear(p, following, reflex, a, b, c):  # type: ignore[no-untyped-def]
    """Whether no reflex corner of the rest lies in the triangle a, b, c, except at its corners."""
    i = following[c]
    while i != a:
        if reflex[i]:
            at_corner = False
            for j in (a, b, c):
                at_corner = at_corner or (p[i, 0] == p[j, 0] and p[i, 1] == p[j, 1])
            if not at_corner and _turn(p, a, b, i) >= 0 and _turn(p, b, c, i) >= 0 and _turn(p, c, a, i) >= 0:
                return False
        i = following[i]
    return True


@kernel
def _clip_ears(p, triangles):  # type: ignore[no-untyped-def]
    """Triangles (n - 2, 3) of the polygon `p` (n, 2); without an ear (self-crossing), the next is cut off."""
    n = len(p)
    previous = np.arange(-1, n - 1)
    previous[0] = n - 1
    following = np.arange(1, n + 1)
    following[n - 1] = 0
    reflex = np.zeros(n, np.bool_)
    reflexes = 0
    for i in range(n):
        reflex[i] = _turn(p, previous[i], i, following[i]) <= 0
        reflexes += reflex[i]
    b = 1
    done = 0
    tried = 0
    while done < n - 2:
        a, c = previous[b], following[b]
        ear = not reflex[b] and (reflexes == 0 or _is_ear(p, following, reflex, a, b, c))
        if not ear and tried < n - done:
            b = c
            tried += 1
            continue
        triangles[done, 0] = a
        triangles[done, 1] = b
        triangles[done, 2] = c
        done += 1
        tried = 0
        following[a] = c
        previous[c] = a
        reflexes -= reflex[b]
        for i in (a, c):
            now = _turn(p, previous[i], i, following[i]) <= 0
            reflexes += np.int64(now) - np.int64(reflex[i])
            reflex[i] = now
        # Going on behind c spreads the ears instead of fanning them around one corner.
        b = following[c]
