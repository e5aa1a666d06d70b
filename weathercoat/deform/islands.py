"""Islands of free film: what no edge and no hinge connects over vertices that may move.

Held vertices part the film, so the energy is a sum of one for each island, and each is minimised alone: with
its own step length, its own damping, its own end.
"""

from __future__ import annotations

import numpy as np

from weathercoat.compile import kernel
from weathercoat.mesh.surface import Indices


def label_islands(
    unknown: Indices, count: int, ends: Indices, hinges: Indices
) -> tuple[Indices, Indices, Indices, int]:
    """The islands of `count` free vertices, of edges (l, 2) and of hinges (a, 4), and how many there are.

    `unknown` numbers the free vertices and is -1 for held ones; every edge and hinge has a free one. Islands
    are numbered by their first vertex.
    """
    island = np.empty(count, np.int32)
    length_island, angle_island = np.empty(len(ends), np.int32), np.empty(len(hinges), np.int32)
    found = _label(unknown, ends, hinges, island, length_island, angle_island)
    return island, length_island, angle_island, found


@kernel
def _label(
    unknown: Indices, ends: Indices, hinges: Indices, island: Indices, length_island: Indices,
    angle_island: Indices,
) -> int:  # fmt: skip
    parent = np.arange(len(island)).astype(np.int32)
    _join(unknown, ends, parent)
    _join(unknown, hinges, parent)
    found = 0
    for i in range(len(parent)):
        root = find_root(parent, i)
        if root == i:  # a root is the first of its island
            island[i] = found
            found += 1
        else:
            island[i] = island[root]
    _take(unknown, ends, island, length_island)
    _take(unknown, hinges, island, angle_island)
    return found


@kernel
def _join(unknown: Indices, elements: Indices, parent: Indices) -> None:
    """Unite the free vertices of each element under the first of them all."""
    for i in range(len(elements)):
        first = np.int32(-1)
        for k in range(elements.shape[1]):
            j = unknown[elements[i, k]]
            if j < 0:
                continue
            root = find_root(parent, j)
            if first < 0:
                first = root
            elif root < first:
                parent[first] = root
                first = root
            else:
                parent[root] = first


@kernel
def find_root(parent: Indices, i: int) -> int:
    """The root of i's tree in a union-find forest (k,); halves the path to it."""
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@kernel
def _take(unknown: Indices, elements: Indices, island: Indices, out: Indices) -> None:
    """The island of each element: that of any of its free vertices."""
    for i in range(len(elements)):
        for k in range(elements.shape[1]):
            if unknown[elements[i, k]] >= 0:
                out[i] = island[unknown[elements[i, k]]]
                break
