"""Polygons to triangles, concave ones included: small ones as fans where that fits, others by ear clipping.

Source of ear clipping: Meisters, Polygons have ears, American Mathematical Monthly 82, 1975.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.errors import LimitError

# Up to here a fan has no slivers to speak of; and a fan from the first corner is what other programs show.
MAX_FAN = 8
# Times that all corners of a polygon that crosses itself are looked at for ears.
MAX_LOOKS = 4
# Corners that may be looked at in all to tell whether others are ears: some 20 s.
MAX_WORK = 20_000_000_000


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
        work = np.array([MAX_WORK])
        _clip_polygons(positions, corners, first[rest], sizes[rest], begin[rest], longest, work, triangles)
        if work[0] < 0:
            raise LimitError(
                f"concave polygons, of up to {longest} corners, take too long to cut into triangles",
                remedy="triangulate the model before exporting",
            )
    return triangles, polygon


def _is_fan(points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether the triangles from the first corner to each edge are all oriented as the polygon (q, n, 3)."""
    arm = points[:, 1:] - points[:, :1]
    normals = np.cross(arm[:, :-1], arm[:, 1:])
    along = np.einsum("qij,qj->qi", normals, normals.sum(axis=1))
    return (along > 0).all(axis=1)  # type: ignore[no-any-return]


@kernel
def _clip_polygons(positions, corners, first, sizes, begin, longest, work, triangles):  # type: ignore[no-untyped-def]
    """`work` (1,) is what may be done, then what is left of it; below 0 not all triangles are set."""
    flat = np.empty((longest, 2))
    for q in range(len(first)):
        n = sizes[q]
        _flatten(positions, corners[first[q] : first[q] + n], flat)
        part = triangles[begin[q] : begin[q] + n - 2]
        _clip_ears(flat[:n], work, part)
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
def _make_grid(p):  # type: ignore[no-untyped-def]
    """The points (n, 2) in about n cells, nearly square, of a grid over them: its origin and cells per length
    along both axes, its shape, where each cell begins, and the points cell by cell."""
    n = len(p)
    origin = np.array([p[:, 0].min(), p[:, 1].min()])
    extent = np.array([p[:, 0].max(), p[:, 1].max()]) - origin
    shape = np.ones(2, np.int64)
    if extent[0] > 0 and extent[1] > 0:
        shape[0] = np.int64(min(max(np.sqrt(n * (extent[0] / extent[1])), 1), n))
    elif extent[0] > 0:
        shape[0] = n
    shape[1] = n // shape[0]
    rate = np.zeros(2)
    for axis in range(2):
        if extent[axis] > 0:
            rate[axis] = shape[axis] / extent[axis]
    begin = np.zeros(shape[0] * shape[1] + 1, np.int64)
    cell = np.empty(n, np.int64)
    for i in range(n):
        x = _place(p[i, 0], origin[0], rate[0], shape[0])
        y = _place(p[i, 1], origin[1], rate[1], shape[1])
        cell[i] = x * shape[1] + y
        begin[cell[i] + 1] += 1
    begin = np.cumsum(begin)
    fill = begin.copy()
    points = np.empty(n, np.int64)
    for i in range(n):
        points[fill[cell[i]]] = i
        fill[cell[i]] += 1
    return origin, rate, shape, begin, points


@kernel
def _place(x, origin, rate, count):  # type: ignore[no-untyped-def]
    """The cell of a coordinate, which never falls as the coordinate rises."""
    place = (x - origin) * rate
    if place >= count:
        return count - 1
    # No comparison holds where a tiny extent makes the rate infinite and the place 0 times that.
    return np.int64(place) if place > 0 else 0


@kernel
def _is_ear(p, grid, reflex, work, a, b, c):  # type: ignore[no-untyped-def]
    """Whether no reflex corner of the rest lies in the triangle a, b, c, except at its corners."""
    origin, rate, shape, begin, points = grid
    first = np.empty(2, np.int64)
    last = np.empty(2, np.int64)
    for axis in range(2):
        low = min(p[a, axis], p[b, axis], p[c, axis])
        high = max(p[a, axis], p[b, axis], p[c, axis])
        first[axis] = _place(low, origin[axis], rate[axis], shape[axis])
        last[axis] = _place(high, origin[axis], rate[axis], shape[axis])
    for x in range(first[0], last[0] + 1):
        row = x * shape[1]
        start, stop = begin[row + first[1]], begin[row + last[1] + 1]
        work[0] -= stop - start
        for k in range(start, stop):
            i = points[k]
            if not reflex[i] or i in (a, b, c):
                continue
            at_corner = False
            for j in (a, b, c):
                at_corner = at_corner or (p[i, 0] == p[j, 0] and p[i, 1] == p[j, 1])
            if not at_corner and _turn(p, a, b, i) >= 0 and _turn(p, b, c, i) >= 0 and _turn(p, c, a, i) >= 0:
                return False
    return True


@kernel
def _clip_ears(p, work, triangles):  # type: ignore[no-untyped-def]
    """Triangles (n - 2, 3) of the polygon `p` (n, 2); without an ear (self-crossing), the next is cut off.

    A corner that is no ear stays none until a neighbour of it is cut off, so it is not looked at before; only
    where no candidate is left, which no simple polygon leads to, are all looked at again, so many times that
    the work stays in proportion.
    """
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
    grid = _make_grid(p)
    # The candidates for the next ear, in the order of the outline.
    before, after = previous.copy(), following.copy()
    is_candidate = np.ones(n, np.bool_)
    candidates = n
    looks = MAX_LOOKS * n
    b = home = 1
    done = 0
    is_new = True  # since all were looked at
    while done < n - 2 and work[0] >= 0:
        if candidates == 0 and is_new and looks >= n - done:
            is_new = False
            looks -= n - done
            candidates = n - done
            i = b = home
            while True:
                before[i], after[i] = previous[i], following[i]
                is_candidate[i] = True
                i = following[i]
                if i == home:
                    break
        is_forced = candidates == 0
        if is_forced:
            b = home
        a, c = previous[b], following[b]
        if not is_forced and (reflex[b] or not (reflexes == 0 or _is_ear(p, grid, reflex, work, a, b, c))):
            is_candidate[b] = False
            candidates -= 1
            before[after[b]], after[before[b]] = before[b], after[b]
            b = after[b]
            continue
        triangles[done, 0] = a
        triangles[done, 1] = b
        triangles[done, 2] = c
        done += 1
        is_new = True
        following[a] = c
        previous[c] = a
        reflexes -= reflex[b]
        reflex[b] = False
        for i in (a, c):
            now = _turn(p, previous[i], i, following[i]) <= 0
            reflexes += np.int64(now) - np.int64(reflex[i])
            reflex[i] = now
        # Going on behind c spreads the ears instead of fanning them around one corner.
        home = following[c]
        candidates = _replace(a, b, c, before, after, is_candidate, candidates)
        b = after[c]


@kernel
def _replace(a, b, c, before, after, is_candidate, candidates):  # type: ignore[no-untyped-def]
    """Take b out of the ring of candidates and its neighbours a and c in; returns their number."""
    if not is_candidate[b]:  # the ring is empty
        before[b] = after[b] = b
        is_candidate[b] = True
        candidates = 1
    for i, at in ((a, before[b]), (c, b)):
        if not is_candidate[i]:
            is_candidate[i] = True
            candidates += 1
            before[i], after[i] = at, after[at]
            before[after[at]] = i
            after[at] = i
    before[after[b]], after[before[b]] = before[b], after[b]
    is_candidate[b] = False
    return candidates - 1
