"""Polygons to triangles: quads by the right diagonal, larger ones by ear clipping, concave ones included.

Source of ear clipping: Meisters, Polygons have ears, American Mathematical Monthly 82, 1975.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel


def triangulate(
    positions: NDArray[np.float64], corners: NDArray[np.int64], sizes: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Triangles of polygons: (t, 3) indices into `corners` (so that data per corner follow), and (t,) the polygon of each.

    positions: (n, 3), finite where used; corners: (k,) vertex of each corner; sizes: (m,) corners of each polygon. Polygons
    of fewer than three corners give none. Triangles keep the order and the orientation of the polygons.
    """
    first = np.cumsum(sizes) - sizes
    count = np.maximum(sizes - 2, 0)
    polygon = np.repeat(np.arange(len(sizes)), count)
    triangles = np.empty((len(polygon), 3), np.int64)
    begin = np.cumsum(count) - count
    three = np.flatnonzero(sizes == 3)
    triangles[begin[three]] = first[three, None] + np.arange(3)
    four = np.flatnonzero(sizes == 4)
    if len(four):
        triangles[begin[four, None] + np.arange(2)] = _split_quads(positions, corners, first[four])
    more = np.flatnonzero(sizes > 4)
    if len(more):
        _clip_polygons(positions, corners, first[more], sizes[more], begin[more], triangles)
    return triangles, polygon


def _split_quads(
    positions: NDArray[np.float64], corners: NDArray[np.int64], first: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Two triangles (q, 2, 3) a quad: by the diagonal 0-2, or 1-3 where only that one lies inside."""
    p = positions[corners[first[:, None] + np.arange(4)]]
    normal = np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])

    def along(a: int, b: int, c: int) -> NDArray[np.float64]:
        return np.einsum("ij,ij->i", np.cross(p[:, b] - p[:, a], p[:, c] - p[:, a]), normal)  # type: ignore[no-any-return]

    other = (np.minimum(along(0, 1, 2), along(0, 2, 3)) <= 0) & (
        np.minimum(along(0, 1, 3), along(1, 2, 3)) > 0
    )
    pattern = np.where(other[:, None, None], [[0, 1, 3], [1, 2, 3]], [[0, 1, 2], [0, 2, 3]])
    return first[:, None, None] + pattern


def _clip_polygons(
    positions: NDArray[np.float64],
    corners: NDArray[np.int64],
    first: NDArray[np.int64],
    sizes: NDArray[np.int64],
    begin: NDArray[np.int64],
    triangles: NDArray[np.int64],
) -> None:
    for f, n, b in zip(first.tolist(), sizes.tolist(), begin.tolist(), strict=True):
        flat = _flatten(positions[corners[f : f + n]])
        _clip_ears(flat, triangles[b : b + n - 2])
        triangles[b : b + n - 2] += f


def _flatten(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """The polygon (n, 3) in its mean plane, (n, 2), counter-clockwise.

    Source of the normal: Newell's method (Sutherland, Sproull and Schumacker, 1974).
    """
    points = points - points.mean(axis=0)
    after = np.roll(points, -1, axis=0)
    normal = np.cross(points, after).sum(axis=0)
    length = np.linalg.norm(normal)
    normal = normal / length if length > 0 else np.array([0.0, 0.0, 1.0])
    u = np.zeros(3)
    u[np.argmin(np.abs(normal))] = 1.0
    u = np.cross(normal, u)
    u /= np.linalg.norm(u)
    return np.ascontiguousarray(np.stack([points @ u, points @ np.cross(normal, u)], axis=1))


@kernel
def _turn(p, a, b, c):  # type: ignore[no-untyped-def]
    """Twice the signed area of a triangle of points of `p` (n, 2): positive counter-clockwise."""
    return (p[b, 0] - p[a, 0]) * (p[c, 1] - p[a, 1]) - (p[b, 1] - p[a, 1]) * (p[c, 0] - p[a, 0])


@kernel
def _is_ear(p, previous, following, reflex, a, b, c):  # type: ignore[no-untyped-def]
    """Whether no reflex corner of the rest lies in the triangle a, b, c, except at its corners."""
    i = following[c]
    while i != a:
        if reflex[i]:
            at_corner = False
            for j in (a, b, c):
                if p[i, 0] == p[j, 0] and p[i, 1] == p[j, 1]:
                    at_corner = True
            if not at_corner and _turn(p, a, b, i) >= 0 and _turn(p, b, c, i) >= 0 and _turn(p, c, a, i) >= 0:
                return False
        i = following[i]
    return True


@kernel
def _clip_ears(p, triangles):  # type: ignore[no-untyped-def]
    """Triangles (n - 2, 3) of the polygon `p` (n, 2); where nothing is an ear (self-crossing), the next corner is cut off."""
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
        a = previous[b]
        c = following[b]
        left = n - done
        ear = not reflex[b] and (reflexes == 0 or _is_ear(p, previous, following, reflex, a, b, c))
        if not ear and tried < left:
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
