"""Sweeps with momentum: each starts from where the last displacement, taken once more in part, would lead.

Sweeps alone carry a bend along by an edge each, like heat, so that the number needed grows with a power of
the length of a curl. With y = x + b (x - x_before) the next positions are sweep(y) instead of sweep(x), and
b = k / (k + 3) in the k-th sweep since the last restart (Nesterov 1983; Su, Boyd and Candes 2016). Where a
sweep takes back more than it was given, the momentum has overshot: k begins again at 0 (O'Donoghue and Candes
2015). That is decided for each island of free film by itself, so that neither a flake that has come to rest
slows down a long curl, nor one far away changes it.

Velocities live on from step to step, since few sweeps are made in one; film that has just been let go, or cut
free as a copy, begins without. What is at rest under the sweeps is so under these too: they arrive earlier at
the same place, and that is no minimum of the energy of a thin film where targets contradict each other.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from weathercoat.compile import kernel
from weathercoat.deform.constraints import Constraints
from weathercoat.deform.islands import find_root
from weathercoat.deform.runs import TILE, bucket
from weathercoat.deform.seats import Seats, return_positions, seat_positions
from weathercoat.deform.sleep import join_islands
from weathercoat.deform.sweeps import sweep_angles, sweep_lengths, sweep_substrate
from weathercoat.deform.team import Team
from weathercoat.mesh.halfedge import HalfEdgeMesh
from weathercoat.mesh.surface import Indices, Vectors

_LAG = 3.0  # of b = k / (k + lag): the least for which convergence of order 1 / k^2 is proven
_REACH = 0.25  # of the shortest edge at a vertex: further extrapolation could fold a hinge over


class Momentum(NamedTuple):
    """How the film moves, from step to step.

    velocity: (3 m, 3), the displacement of a film vertex by the last sweep, zero where there was none; run:
    int32 (3 m,), sweeps since the last restart of its island; reach: (n0,), the longest extrapolation of a
    vertex by its origin. Lengths in sizes.
    """

    velocity: Vectors
    run: Indices
    reach: Vectors


class Movers(NamedTuple):
    """The k film vertices that move in a step, by tiles (t) and in these by ascending numbers.

    first: int32 (t + 1,), the first of each tile; vertex, seat: int32 (k,); island: int32 (k,), the first
    one of its island; velocity (k, 3), its last displacement or, while a sweep is made, its push; start
    (k, 3), its position before that; reach (k,); onwards (k,), the part of a displacement that the sweep
    itself made, times the whole. At the first one of an island: run int32 (k,), share (k,) of the velocity
    that is added again, total (k,), the sum of `onwards`.
    """

    first: Indices
    vertex: Indices
    seat: Indices
    island: Indices
    velocity: Vectors
    start: Vectors
    reach: Vectors
    onwards: Vectors
    run: Indices
    share: Vectors
    total: Vectors


def make_momentum(mesh: HalfEdgeMesh, constraints: Constraints) -> Momentum:
    """Nothing moves yet."""
    capacity = len(mesh.twin)
    shortest = np.full(len(mesh.rest_positions), np.inf)
    length = constraints.rest_length.reshape(-1, 3)
    for corner in range(3):
        np.minimum.at(shortest, mesh.faces[:, corner], np.minimum(length[:, corner], length[:, corner - 1]))
    return Momentum(np.zeros((capacity, 3)), np.zeros(capacity, np.int32), _REACH * shortest)


@kernel
def sweep_with_momentum(
    sweeps: int, form: int, stiffness: float, mesh: HalfEdgeMesh, constraints: Constraints, momentum: Momentum
) -> None:
    """A number of sweeps over all that is active; changes positions of film vertices, and the momentum."""
    lengths, angles, seats = constraints.lengths, constraints.angles, constraints.seats
    tiles, length_tiles, angle_tiles = len(seats.filled), len(lengths.tile_run) - 1, len(angles.tile_run) - 1
    movers = gather(mesh, constraints, momentum)
    seat_positions(mesh.positions, seats, 0, tiles)
    for _ in range(sweeps):
        extrapolate(movers, seats, 0, tiles)
        sweep_lengths(seats, lengths, 0, length_tiles)
        sweep_angles(form, seats, angles, stiffness, 0, angle_tiles)
        sweep_substrate(seats, 0, tiles)
        look_back(movers, seats, 0, tiles)
        restart(movers)
    return_positions(mesh.positions, seats, 0, tiles)
    scatter(movers, momentum)


def sweep_with_momentum_together(
    sweeps: int,
    form: int,
    stiffness: float,
    mesh: HalfEdgeMesh,
    constraints: Constraints,
    momentum: Momentum,
    team: Team,
    cuts: list[int],
) -> None:
    """The same bits, with the tiles from cuts[i] to before cuts[i + 1] left to the i-th thread."""
    lengths, angles, seats = constraints.lengths, constraints.angles, constraints.seats
    inside, length_tiles, angle_tiles = lengths.inside, len(lengths.tile_run) - 1, len(angles.tile_run) - 1

    def begin(number: int) -> None:
        tiles = cuts[number], cuts[number + 1]
        extrapolate(movers, seats, *tiles)
        sweep_lengths(seats, lengths, *tiles)

    def bend(number: int) -> None:
        sweep_angles(form, seats, angles, stiffness, cuts[number], cuts[number + 1])

    def end(number: int) -> None:
        tiles = cuts[number], cuts[number + 1]
        sweep_substrate(seats, *tiles)
        look_back(movers, seats, *tiles)

    movers = gather(mesh, constraints, momentum)
    team.share(lambda number: seat_positions(mesh.positions, seats, cuts[number], cuts[number + 1]))
    for _ in range(sweeps):
        team.share(begin)
        sweep_lengths(seats, lengths, inside, length_tiles)
        team.share(bend)
        sweep_angles(form, seats, angles, stiffness, inside, angle_tiles)
        team.share(end)
        restart(movers)
    team.share(lambda number: return_positions(mesh.positions, seats, cuts[number], cuts[number + 1]))
    scatter(movers, momentum)


@kernel
def gather(mesh: HalfEdgeMesh, constraints: Constraints, momentum: Momentum) -> Movers:
    """The vertices that move in this step, with the momentum that they have; an island goes on with the
    longest run of its vertices.

    What does not move, since it sleeps or is gone, loses its momentum.
    """
    mass, half_edge, origin, used = constraints.inverse_mass, mesh.half_edge, mesh.origin, mesh.used[0]
    moving = np.empty(used, np.int32)
    count = 0
    for v in range(used):
        if mass[v] > 0.0 and half_edge[v] >= 0:
            moving[count] = v
            count += 1
        else:
            momentum.velocity[v] = 0.0
            momentum.run[v] = 0
    order, first = bucket(origin[moving[:count]] // TILE, len(constraints.seats.filled))
    vertex = moving[order]
    joined = np.arange(used).astype(np.int32)
    join_islands(constraints.lengths, constraints.seats.vertex, joined)
    join_islands(constraints.angles, constraints.seats.vertex, joined)
    first_of = np.full(used, -1, np.int32)
    island, run, share = np.empty(count, np.int32), np.zeros(count, np.int32), np.zeros(count)
    for i in range(count):
        root = find_root(joined, vertex[i])
        if first_of[root] < 0:
            first_of[root] = i
        island[i] = first_of[root]
        run[island[i]] = max(run[island[i]], momentum.run[vertex[i]])
    for i in range(count):
        share[i] = run[i] / (run[i] + _LAG)
    return Movers(
        first, vertex, constraints.seats.seat[vertex], island,
        momentum.velocity[vertex], np.empty((count, 3)), momentum.reach[origin[vertex]],
        np.empty(count), run, share, np.empty(count),
    )  # fmt: skip


@kernel
def extrapolate(movers: Movers, seats: Seats, first_tile: int, last_tile: int) -> None:
    """Push what moves in the tiles on by a share of its velocity; changes seated positions."""
    seat, island, share, reach = movers.seat, movers.island, movers.share, movers.reach
    velocity, start, positions = movers.velocity, movers.start, seats.positions
    for i in range(movers.first[first_tile], movers.first[last_tile]):
        s, part = seat[i], share[island[i]]
        x, y, z = part * velocity[i, 0], part * velocity[i, 1], part * velocity[i, 2]
        squared = x * x + y * y + z * z
        if squared > reach[i] * reach[i]:
            within = reach[i] / math.sqrt(squared)
            x, y, z = within * x, within * y, within * z
        velocity[i, 0], velocity[i, 1], velocity[i, 2] = x, y, z
        for axis in range(3):
            start[i, axis] = positions[s, axis]
            positions[s, axis] += velocity[i, axis]


@kernel
def look_back(movers: Movers, seats: Seats, first_tile: int, last_tile: int) -> None:
    """Note how what moves in the tiles was displaced, and how far the sweep itself went along with that."""
    seat, onwards = movers.seat, movers.onwards
    velocity, start, positions = movers.velocity, movers.start, seats.positions
    for i in range(movers.first[first_tile], movers.first[last_tile]):
        s = seat[i]
        along = 0.0
        for axis in range(3):
            moved = positions[s, axis] - start[i, axis]
            along += (moved - velocity[i, axis]) * moved
            velocity[i, axis] = moved
        onwards[i] = along


@kernel
def restart(movers: Movers) -> None:
    """End the run of each island that the sweep has turned back as a whole, and go on with the others."""
    island, onwards, total, run, share = (
        movers.island,
        movers.onwards,
        movers.total,
        movers.run,
        movers.share,
    )
    total[:] = 0.0
    for i in range(len(island)):
        total[island[i]] += onwards[i]
    for i in range(len(island)):
        if island[i] == i:
            run[i] = run[i] + 1 if total[i] >= 0.0 else 0
            share[i] = run[i] / (run[i] + _LAG)


@kernel
def scatter(movers: Movers, momentum: Momentum) -> None:
    """Leave each vertex its velocity and the run of its island, to which it may no longer belong in the next
    step.
    """
    vertex, island, run, velocity = movers.vertex, movers.island, movers.run, movers.velocity
    for i in range(len(vertex)):
        v = vertex[i]
        momentum.run[v] = run[island[i]]
        for axis in range(3):
            momentum.velocity[v, axis] = velocity[i, axis]
