"""Which points are one: exactly at the same place, or within the rounding of float32."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.mesh.buckets import compact_indices

Points = NDArray[np.float64]
Indices = NDArray[np.int64]

SINGLE = 2.0**-23
"""Spacing of float32 numbers, relative."""


def weld(
    positions: Points, corners: Indices, part: Indices | None = None
) -> tuple[NDArray[np.int32], Indices, int]:
    """Merge the vertices in use that lie at the same position and in the same `part` (n,).

    The tolerance is the rounding of float32, relative, so that no scale, proportion or offset changes what
    is merged: two coordinates are the same where they differ by 2^-23 of their own magnitude, since most
    programs round to float32 whatever they write afterwards; on an axis on which the model lies far from
    the origin, 2^-23 of its extent there instead. It never exceeds 2^-22 of the extent, far below the
    thickness of any sheet.

    Returns for each corner its vertex after welding, (k,); for each of those the first vertex of the file
    there; and how many vertices were merged away.
    """
    used, compact = compact_indices(corners, len(positions))
    points = positions[used]
    within = np.zeros(len(points), np.int64) if part is None else part[used]
    # What lies near a point lies near all at its place, so only one of them is looked at further.
    twin = first_at_place(points, within)
    distinct = np.flatnonzero(twin == np.arange(len(twin)))
    near = distinct[_first_near(points[distinct], within[distinct])]
    number = np.empty(len(points), np.int64)
    number[distinct] = near
    first = number[twin]
    kept, place = compact_indices(first, len(points))
    return place[compact], used[kept], len(points) - len(kept)


def first_at_place(points: Points, part: Indices) -> NDArray[np.int32]:
    """For each of the points (n, 3), finite, the first with equal coordinates and `part` (n,); itself or one
    before."""
    first = np.empty(len(points), np.int32)
    with np.errstate(over="ignore"):  # hashes wrap round
        _match_places(points, part, first)
    return first


def _first_near(points: Points, part: Indices) -> Indices:
    """For each of the points (n, 3) the first kept one that it is merged with: itself where it is kept."""
    low, high = points.min(axis=0), points.max(axis=0)
    extent = high - low
    is_far = np.maximum(np.abs(low), np.abs(high)) > 2.0 * extent
    tolerance = SINGLE * np.where(is_far, extent, np.abs(points))
    # A lattice on which points within the tolerance are at most two steps apart: of the leading bits, or
    # even.
    bits = np.abs(points).view(np.int64) >> (52 - 23)
    step = SINGLE * extent
    even = (points - low) / np.where(step > 0, step, 1.0)
    lattice = np.where(is_far, even.astype(np.int64), np.where(points < 0, -bits, bits))
    first = np.empty(len(points), np.int64)
    with np.errstate(over="ignore"):  # hashes wrap round
        _merge_near(points, part, lattice, tolerance, first)
    return first


@kernel
def _match_places(points, part, first):  # type: ignore[no-untyped-def]
    """Hashing by all bits of the coordinates, with the next place where one is taken."""
    n = len(points)
    size = 16
    while size < 2 * n:
        size *= 2
    table = np.full(size, -1, np.int32)
    bits = np.empty(3, np.float64)
    pattern = bits.view(np.int64)
    for i in range(n):
        for k in range(3):
            bits[k] = points[i, k] + 0.0  # -0.0 is at the place of 0.0
        slot = np.int64(_hash(part[i], pattern[0], pattern[1], pattern[2]) & np.uint64(size - 1))
        first[i] = i
        while table[slot] >= 0:
            j = table[slot]
            if (
                part[j] == part[i]
                and points[j, 0] == points[i, 0]
                and points[j, 1] == points[i, 1]
                and points[j, 2] == points[i, 2]
            ):
                first[i] = j
                break
            slot = (slot + 1) & (size - 1)
        if first[i] == i:
            table[slot] = i


@kernel
def _merge_near(points, part, lattice, tolerance, first):  # type: ignore[no-untyped-def]
    """`first` (n,) becomes the first kept point within the box `tolerance` (n, 3) of each, or itself.

    Cells of four steps of the `lattice` in a hash table; only kept points are entered, so that no cell
    holds more than a few. One bit for each of many more hashes, few enough to stay in the cache, tells of
    most cells that they are empty.
    """
    n = len(points)
    size = 16
    while size < 2 * n:
        size *= 2
    head = np.full(size, -1, np.int32)
    behind = np.full(n, -1, np.int32)
    in_table, in_word = np.uint64(size - 1), np.uint64(63)
    in_bits = np.uint64(8 * size - 1)
    taken = np.zeros(8 * size // 64, np.uint64)
    for i in range(n):
        x, y, z = lattice[i]
        first[i] = i
        for a in range((x - 2) >> 2, ((x + 2) >> 2) + 1):
            for b in range((y - 2) >> 2, ((y + 2) >> 2) + 1):
                for c in range((z - 2) >> 2, ((z + 2) >> 2) + 1):
                    key = _hash(part[i], a, b, c)
                    bit = key & in_bits
                    if not (taken[bit >> np.uint64(6)] >> (bit & in_word)) & np.uint64(1):
                        continue
                    j = head[key & in_table]
                    while j >= 0:
                        near = part[j] == part[i]
                        for k in range(3):
                            near = near and abs(points[j, k] - points[i, k]) <= tolerance[i, k]
                        if near and j < first[i]:
                            first[i] = j
                        j = behind[j]
        if first[i] == i:
            key = _hash(part[i], x >> 2, y >> 2, z >> 2)
            bit = key & in_bits
            taken[bit >> np.uint64(6)] |= np.uint64(1) << (bit & in_word)
            behind[i] = head[key & in_table]
            head[key & in_table] = i


@kernel
def _hash(part, a, b, c):  # type: ignore[no-untyped-def]
    """A number of 64 bits, the lower 32 well mixed, for a cell of a grid in a part."""
    key = np.uint64(np.int64(part)) * np.uint64(0xD6E8FEB86659FD93)
    key = (key ^ (key >> np.uint64(29))) + np.uint64(np.int64(a)) * np.uint64(0x9E3779B97F4A7C15)
    key = (key ^ (key >> np.uint64(29))) + np.uint64(np.int64(b)) * np.uint64(0xBF58476D1CE4E5B9)
    key = (key ^ (key >> np.uint64(29))) + np.uint64(np.int64(c)) * np.uint64(0x94D049BB133111EB)
    return key ^ (key >> np.uint64(32))
