"""Constraints in runs: which of them may be met at the same time, and in which order all are met.

A constraint moves its vertices, so two that share one must be met one after the other. The order is made
once, from the rest surface, and is part of the result:

- the vertices, which lie along a space-filling curve, are cut into *tiles* that fit a first cache;
- constraints inside one tile come first, tile by tile; those across tiles follow, in groups along the curve;
- within a tile, constraints are coloured greedily, so that no two of a colour share a vertex. The
  constraints of a colour are a *run*, and runs follow one another.

Members of a run do not affect each other, so any order within it gives the same bits, and so does meeting
many of them at once; tiles do not affect each other either, so threads can share them.

Every constraint that can ever exist has a fixed *slot* in its run. The active ones are packed into *lanes*,
blocks of 16, without gaps from the start of the run: one that becomes active is put behind the last, and
the last takes the place of one that ends. An event costs what it changes, and nothing is packed anew.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import formula, kernel
from weathercoat.mesh.surface import Indices, Vectors

LANES = 16  # constraints that are met at once: two registers of 8, which hide each other's latency
TILE = 1365  # vertices of a tile: 32 KB of positions
_GROUP = 8  # tiles whose constraints to other tiles are one group
_COLORS = 64  # bits of the mask that colours a vertex


class Runs(NamedTuple):
    """All constraints of one kind, k vertices each. s slots in r runs in t tiles (groups included), b blocks.

    Static: slot int32 (3 m,), the slot of a half-edge or -1; half_edge (s,), the half-edge of a slot; run
    (s,); first_block (r + 1,); tile_run (t + 1,), the first run of each tile. Of these, the tiles before
    `inside` share no vertex with each other. Changing: filled (r,), lanes in use; lane (s,), where a
    slot is packed, or -1; slot_at (16 b,), its inverse; seats int32 (b, k, 16), of its vertices; moves uint8
    (b, k, 16), whether the vertex has an inverse mass; data (b, d, 16), what the target is made from; target
    (b, 16).
    """

    slot: Indices
    half_edge: Indices
    run: Indices
    first_block: Indices
    tile_run: Indices
    inside: int
    filled: Indices
    lane: Indices
    slot_at: Indices
    seats: Indices
    moves: NDArray[np.uint8]
    data: Vectors
    target: Vectors


def tile_count(vertex_count: int) -> int:
    """How many tiles the vertices are cut into."""
    return -(-vertex_count // TILE)


def make_runs(
    half_edges: Indices, vertices: Indices, slot_of: Indices, vertex_count: int, data_rows: int
) -> Runs:
    """Runs with no active constraint.

    half_edges: (s,), one for each constraint, ascending; vertices: (s, k), rest vertices of each; slot_of:
    (3 m,), for every half-edge the row of its constraint in these, or -1.
    """
    tiles = tile_count(vertex_count)
    groups = -(-tiles // _GROUP)
    lowest = vertices.min(axis=1) // TILE
    is_inside = lowest == vertices.max(axis=1) // TILE
    tile = np.where(is_inside, lowest, tiles + lowest // _GROUP).astype(np.int32)
    by_tile, first_of_tile = bucket(tile, tiles + groups)
    color = np.empty(len(tile), np.int32)
    tile_colors = np.empty(tiles + groups, np.int32)
    _color(np.ascontiguousarray(vertices), by_tile, first_of_tile, vertex_count, color, tile_colors)
    tile_run = np.concatenate([[0], np.cumsum(tile_colors)]).astype(np.int32)
    order, first_of_run = bucket(tile_run[tile] + color, int(tile_run[-1]))
    sizes = np.diff(first_of_run)
    first_block = np.concatenate([[0], np.cumsum(-(-sizes // LANES))]).astype(np.int32)
    place = np.empty(len(order), np.int32)
    place[order] = np.arange(len(order), dtype=np.int32)
    blocks, corners = int(first_block[-1]), vertices.shape[1]
    return Runs(
        slot=np.where(slot_of >= 0, place[slot_of] if len(place) else -1, -1).astype(np.int32),
        half_edge=half_edges[order].astype(np.int32),
        run=np.repeat(np.arange(len(sizes), dtype=np.int32), sizes),
        first_block=first_block,
        tile_run=tile_run,
        inside=tiles,
        filled=np.zeros(len(sizes), np.int32),
        lane=np.full(len(order), -1, np.int32),
        slot_at=np.full(LANES * blocks, -1, np.int32),
        # lanes behind the last active one are computed as well, and thrown away: they must be readable
        seats=np.zeros((blocks, corners, LANES), np.int32),
        moves=np.zeros((blocks, corners, LANES), np.uint8),
        data=np.zeros((blocks, data_rows, LANES)),
        target=np.zeros((blocks, LANES)),
    )


@kernel
def bucket(keys: Indices, count: int) -> tuple[Indices, Indices]:
    """A stable order of keys below `count`, and where each key begins in it, (count + 1,); linear."""
    first = np.zeros(count + 1, np.int32)
    for key in keys:
        first[key + 1] += 1
    for i in range(count):
        first[i + 1] += first[i]
    following = first.copy()
    order = np.empty(len(keys), np.int32)
    for i in range(len(keys)):
        order[following[keys[i]]] = i
        following[keys[i]] += 1
    return order, first


@kernel
def _color(
    vertices: Indices,
    by_tile: Indices,
    first_of_tile: Indices,
    vertex_count: int,
    color: Indices,
    tile_colors: Indices,
) -> None:
    """Give each constraint the least colour that no earlier one of its tile has at one of its vertices.

    Where a vertex has used up the mask, the constraint gets a colour to itself.
    """
    used = np.zeros(vertex_count, np.uint64)
    used_in = np.full(vertex_count, -1, np.int32)
    one = np.uint64(1)
    for t in range(len(tile_colors)):
        lonely = 0
        most = 0
        for i in range(first_of_tile[t], first_of_tile[t + 1]):
            c = by_tile[i]
            mask = np.uint64(0)
            for k in range(vertices.shape[1]):
                v = vertices[c, k]
                if used_in[v] != t:
                    used_in[v] = t
                    used[v] = np.uint64(0)
                mask |= used[v]
            free = 0
            while free < _COLORS and mask & (one << np.uint64(free)):
                free += 1
            if free == _COLORS:
                color[c] = _COLORS + lonely
                lonely += 1
            else:
                color[c] = free
                for k in range(vertices.shape[1]):
                    used[vertices[c, k]] |= one << np.uint64(free)
            most = max(most, color[c] + 1)
        tile_colors[t] = most


@formula
def activate(
    slot: int, run: Indices, first_block: Indices, filled: Indices, lane: Indices, slot_at: Indices
) -> int:
    """The lane of a constraint, which is active from now on; the caller fills it."""
    if lane[slot] < 0:
        r = run[slot]
        lane[slot] = LANES * first_block[r] + filled[r]
        slot_at[lane[slot]] = slot
        filled[r] += 1
    return lane[slot]


@formula
def deactivate(
    slot: int, run: Indices, first_block: Indices, filled: Indices, lane: Indices, slot_at: Indices,
    seats: Indices, moves: NDArray[np.uint8], data: Vectors, target: Vectors,
) -> None:  # fmt: skip
    """End a constraint, if it is active: the last one of its run takes its lane."""
    if lane[slot] >= 0:
        r = run[slot]
        filled[r] -= 1
        last = LANES * first_block[r] + filled[r]
        b, i, c, j = lane[slot] // LANES, lane[slot] % LANES, last // LANES, last % LANES
        for k in range(seats.shape[1]):
            seats[b, k, i] = seats[c, k, j]
            moves[b, k, i] = moves[c, k, j]
        for k in range(data.shape[1]):
            data[b, k, i] = data[c, k, j]
        target[b, i] = target[c, j]
        lane[slot_at[last]] = lane[slot]
        slot_at[lane[slot]] = slot_at[last]
        lane[slot] = -1


@kernel
def end_constraint(runs: Runs, slot: int) -> None:
    """End a constraint, if it is active."""
    deactivate(
        slot, runs.run, runs.first_block, runs.filled, runs.lane, runs.slot_at,
        runs.seats, runs.moves, runs.data, runs.target,
    )  # fmt: skip
