"""Sleep: islands of free film that hardly move are left alone for a while.

An island is separated film that constraints connect; between islands lie attached vertices. Every `_PERIOD`
steps the film is looked at: an island none of whose vertices has moved by more than a tolerance a step in two
periods one after another falls asleep, and its constraints are not met. It wakes when a vertex beside it lets
go or an edge of it breaks, and every `_NAP` periods, so that what its targets have drifted in the meantime is
made up for: the error is that of so many slow steps taken at once.

Parts of an island cannot sleep: where targets cannot all be met, the corrections of a sweep cancel each other
but do not vanish, and film whose neighbour is held moves to another balance at once.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.deform.constraints import Constraints, refresh_round, wake
from weathercoat.deform.islands import find_root
from weathercoat.deform.runs import LANES, Runs
from weathercoat.deform.seats import let_be
from weathercoat.mesh.halfedge import HalfEdgeMesh
from weathercoat.mesh.surface import Indices, Vectors

_PERIOD = 8  # steps
_NAP = 4  # periods
_CALM = 2  # periods


class Rest(NamedTuple):
    """How calm the film is; arrays over film vertices, (3 m,).

    calm: uint8, periods one after another in which the vertex moved less than the tolerance; last: (3 m, 3),
    its position at the end of the period before, NaN before it could move; clock: (1,), steps taken.
    """

    calm: NDArray[np.uint8]
    last: Vectors
    clock: Indices


def make_rest(capacity: int) -> Rest:
    """Nothing is calm yet; room for so many film vertices."""
    return Rest(np.zeros(capacity, np.uint8), np.full((capacity, 3), np.nan), np.zeros(1, np.int32))


@kernel
def settle(mesh: HalfEdgeMesh, constraints: Constraints, rest: Rest, tolerance: float) -> None:
    """After a step, let calm islands fall asleep and wake what has slept enough; changes the constraints.

    tolerance: length per step.
    """
    used = mesh.used[0]
    rest.clock[0] += 1
    if rest.clock[0] % _PERIOD != 0:
        return
    mass, asleep = constraints.inverse_mass, constraints.asleep
    if rest.clock[0] % (_PERIOD * _NAP) == 0:
        woken = np.flatnonzero(asleep[:used]).astype(np.int32)
        wake(mesh, constraints, woken)
        refresh_round(mesh, constraints, woken)
    note_moves(mesh.positions[:used], mass, _PERIOD * tolerance, rest.calm, rest.last)
    island = np.arange(used).astype(np.int32)
    join_islands(constraints.lengths, constraints.seats.vertex, island)
    join_islands(constraints.angles, constraints.seats.vertex, island)
    least_calm = np.full(used, _CALM, np.uint8)
    for v in range(used):
        if mass[v] > 0.0:
            root = find_root(island, v)
            least_calm[root] = min(least_calm[root], rest.calm[v])
    falling = np.empty(used, np.int32)
    count = 0
    for v in range(used):
        if mass[v] > 0.0 and mesh.half_edge[v] >= 0 and least_calm[find_root(island, v)] >= _CALM:
            falling[count] = v
            count += 1
    for v in falling[:count]:
        asleep[v] = True
        mass[v] = 0.0
        let_be(constraints.seats, v)
    refresh_round(mesh, constraints, falling[:count])


@kernel
def note_moves(
    positions: Vectors, inverse_mass: Vectors, tolerance: float, calm: NDArray[np.uint8], last: Vectors
) -> None:
    """Count the calm periods of each vertex (k,) that may move; a sleeper begins anew."""
    for v in range(len(positions)):
        if inverse_mass[v] == 0.0:
            calm[v] = 0
            continue
        squared = 0.0
        for axis in range(3):
            moved = positions[v, axis] - last[v, axis]
            squared += moved * moved
            last[v, axis] = positions[v, axis]
        # false for a vertex that has no last position: NaN
        calm[v] = min(calm[v] + 1, _CALM) if squared < tolerance * tolerance else 0


@kernel
def join_islands(runs: Runs, vertex: Indices, island: Indices) -> None:
    """Join the vertices that may move and that share an active constraint, in a union-find forest (k,).

    vertex: who sits on a seat. A hinge with an edge of which an end moves is left to the lengths: its other
    edges have one each.
    """
    first_block, filled, seats, moves = runs.first_block, runs.filled, runs.seats, runs.moves
    corners = seats.shape[1]
    for run in range(len(filled)):
        first = LANES * first_block[run]
        for lane in range(first, first + filled[run]):
            b, i = lane // LANES, lane % LANES
            if corners == 4 and moves[b, 0, i] + moves[b, 1, i] > 0:
                continue
            one = -1
            for k in range(corners):
                if moves[b, k, i] > 0:
                    root = find_root(island, vertex[seats[b, k, i]])
                    if one >= 0 and root != one:
                        # the smaller number is the root, whatever the order in which vertices are joined
                        island[max(one, root)] = min(one, root)
                        root = min(one, root)
                    one = root
