"""Which half-edges run along the same edge: in linear time, in buckets by the smaller vertex of the edge."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel

Indices = NDArray[np.int32]


@kernel
def pair_half_edges(faces: Indices, vertex_count: int) -> tuple[Indices, Indices, int]:
    """Pair the first two half-edges of each edge of the faces (m, 3), contiguous, whichever way they run.

    Returns the other one of each half-edge h = 3 f + i, int32 (3 m,), -1 where there is none; for each
    half-edge beyond the second of its edge the first one there and itself, int32 (k, 2), in ascending order
    within an edge; and how many pairs run the same way.
    """
    tail = faces.reshape(-1)
    half_edges = len(tail)
    begin = np.zeros(vertex_count + 1, np.int32)
    for h in range(half_edges):
        begin[min(tail[h], tail[h - 2 if h % 3 == 2 else h + 1]) + 1] += 1
    for v in range(vertex_count):
        begin[v + 1] += begin[v]
    by_smaller = np.empty(half_edges, np.int32)
    filled = begin[:-1].copy()
    for h in range(half_edges):
        v = min(tail[h], tail[h - 2 if h % 3 == 2 else h + 1])
        by_smaller[filled[v]] = h
        filled[v] += 1
    twin = np.full(half_edges, -1, np.int32)
    beyond = np.empty((half_edges, 2), np.int32)
    crowded = alike = 0
    # Where a half-edge to each larger vertex stands; what lies before the present bucket belongs to another
    # edge.
    met = np.full(vertex_count, -1, np.int32)
    for v in range(vertex_count):
        for k in range(begin[v], begin[v + 1]):
            h = by_smaller[k]
            larger = max(tail[h], tail[h - 2 if h % 3 == 2 else h + 1])
            if met[larger] < begin[v]:
                met[larger] = k
                continue
            first = by_smaller[met[larger]]
            if twin[first] >= 0:
                beyond[crowded, 0] = first
                beyond[crowded, 1] = h
                crowded += 1
                continue
            twin[first] = h
            twin[h] = first
            alike += tail[first] == tail[h]
    return twin, beyond[:crowded].copy(), alike
