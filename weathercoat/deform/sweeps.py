"""Gauss-Seidel sweeps over the constraints, 16 independent ones at a time (paper 4, 5).

One sweep is all active lengths, then all active angles, then the substrate, each in the order of `runs`. The
kernels take seated positions and a range of tiles, so that one call or several threads can do the work, with
the same bits.
"""

from __future__ import annotations

import numpy as np

from weathercoat.compile import kernel
from weathercoat.deform.angle import (
    DIHEDRAL,
    SPLIT,
    meet_arccos_angle,
    meet_dihedral,
    meet_split_angle,
)
from weathercoat.deform.length import meet_length
from weathercoat.deform.runs import LANES, Runs
from weathercoat.deform.seats import Seats, return_positions, seat_positions
from weathercoat.deform.substrate import depth_below
from weathercoat.deform.targets import curved_bend, half_tangent, share_grown, shrunk_bend
from weathercoat.mesh.surface import Vectors

_CACHED_TILES = 32  # so many stay in a second cache; of more, each comes from farther away


@kernel
def meet_lengths(positions: Vectors, lengths: Runs, first_tile: int, last_tile: int) -> None:
    """Meet the active lengths of tiles from `first_tile` to before `last_tile`; changes positions."""
    first_block, filled, seats, moves, target = (
        lengths.first_block,
        lengths.filled,
        lengths.seats,
        lengths.moves,
        lengths.target,
    )
    p = np.empty((6, LANES))
    for run in range(lengths.tile_run[first_tile], lengths.tile_run[last_tile]):
        left = filled[run]
        b = first_block[run]
        while left > 0:
            for k in range(2):
                for i in range(LANES):
                    v = seats[b, k, i]
                    for axis in range(3):
                        p[3 * k + axis, i] = positions[v, axis]
            for i in range(LANES):
                p[0, i], p[1, i], p[2, i], p[3, i], p[4, i], p[5, i] = meet_length(
                    p[0, i], p[1, i], p[2, i], p[3, i], p[4, i], p[5, i],
                    1.0 * moves[b, 0, i], 1.0 * moves[b, 1, i], target[b, i],
                )  # fmt: skip
            for k in range(2):
                for i in range(min(left, LANES)):
                    v = seats[b, k, i]
                    for axis in range(3):
                        positions[v, axis] = p[3 * k + axis, i]
            left -= LANES
            b += 1


@kernel
def meet_angles(
    form: int, positions: Vectors, angles: Runs, stiffness: float, first_tile: int, last_tile: int
) -> None:
    """Bring the active hinges of tiles from `first_tile` to before `last_tile` towards their targets."""
    if form != DIHEDRAL:
        _meet_other_angles(form, positions, angles, stiffness, first_tile, last_tile)
        return
    first_block, filled, seats, moves, target = (
        angles.first_block,
        angles.filled,
        angles.seats,
        angles.moves,
        angles.target,
    )
    p = np.empty((12, LANES))
    for run in range(angles.tile_run[first_tile], angles.tile_run[last_tile]):
        left = filled[run]
        b = first_block[run]
        while left > 0:
            for k in range(4):
                for i in range(LANES):
                    v = seats[b, k, i]
                    for axis in range(3):
                        p[3 * k + axis, i] = positions[v, axis]
            for i in range(LANES):
                (
                    p[0, i], p[1, i], p[2, i], p[3, i], p[4, i], p[5, i],
                    p[6, i], p[7, i], p[8, i], p[9, i], p[10, i], p[11, i],
                ) = meet_dihedral(
                    p[0, i], p[1, i], p[2, i], p[3, i], p[4, i], p[5, i],
                    p[6, i], p[7, i], p[8, i], p[9, i], p[10, i], p[11, i],
                    1.0 * moves[b, 0, i], 1.0 * moves[b, 1, i], 1.0 * moves[b, 2, i], 1.0 * moves[b, 3, i],
                    target[b, i], stiffness,
                )  # fmt: skip
            for k in range(4):
                for i in range(min(left, LANES)):
                    v = seats[b, k, i]
                    for axis in range(3):
                        positions[v, axis] = p[3 * k + axis, i]
            left -= LANES
            b += 1


@kernel
def _meet_other_angles(
    form: int, positions: Vectors, angles: Runs, stiffness: float, first_tile: int, last_tile: int
) -> None:
    """The forms that are kept for comparison, one hinge after another."""
    gradient = np.empty((4, 3))
    for run in range(angles.tile_run[first_tile], angles.tile_run[last_tile]):
        first = LANES * angles.first_block[run]
        for lane in range(first, first + angles.filled[run]):
            b, i = lane // LANES, lane % LANES
            p, w, target = angles.seats[b, :, i], angles.moves[b, :, i], angles.target[b, i]
            w1, w2, w3, w4 = 1.0 * w[0], 1.0 * w[1], 1.0 * w[2], 1.0 * w[3]
            if form == SPLIT:
                meet_split_angle(positions, p[0], p[1], p[2], p[3], w1, w2, w3, w4, target, stiffness)
            else:
                meet_arccos_angle(
                    positions, p[0], p[1], p[2], p[3], w1, w2, w3, w4, target, stiffness, gradient
                )


@kernel
def sweep_substrate(seats: Seats, first_tile: int, last_tile: int) -> None:
    """Put vertices of the tiles back on their planes where they are below; changes their positions."""
    positions, plane = seats.positions, seats.plane
    for tile in range(first_tile, last_tile):
        first = seats.first[tile]
        for s in range(first, first + seats.filled[tile]):
            nx, ny, nz = plane[s, 0], plane[s, 1], plane[s, 2]
            depth = depth_below(positions[s, 0], positions[s, 1], positions[s, 2], nx, ny, nz, plane[s, 3])
            if depth < 0.0:
                positions[s, 0] -= depth * nx
                positions[s, 1] -= depth * ny
                positions[s, 2] -= depth * nz


@kernel
def aim(
    angles: Runs, by_curvature: bool, radius: float, rate: float, floor: float, as_tangent: bool, age: float,
    first_tile: int, last_tile: int,
) -> None:  # fmt: skip
    """Set the targets of active hinges to the bend wanted at an age, or to the tangent of half of it.

    by_curvature: the curvature grows to 1 / radius at a rate [1 / age]; otherwise the dihedral shrinks by
    `rate` [rad / age] down to a floor. Rows of `data`: the bend at the start, the age then, the span.
    """
    data, target = angles.data, angles.target
    for run in range(angles.tile_run[first_tile], angles.tile_run[last_tile]):
        first = angles.first_block[run]
        for b in range(first, first + (angles.filled[run] + LANES - 1) // LANES):
            if by_curvature:
                for i in range(LANES):
                    grown = share_grown(rate * (age - data[b, 1, i]))
                    target[b, i] = curved_bend(data[b, 0, i], data[b, 2, i], radius, grown)
            else:
                for i in range(LANES):
                    target[b, i] = shrunk_bend(data[b, 0, i], rate * (age - data[b, 1, i]), floor)
            if as_tangent:
                for i in range(LANES):
                    target[b, i] = half_tangent(target[b, i])


@kernel
def read_ahead(seats: Seats, runs: Runs, tile: int, heard: Vectors) -> None:
    """Read what a tile is about to need, a cache line after the other, before it is wanted in another order
    and one piece at a time.

    The sum is of no use, but without one the compiler would leave the reading out. Groups of constraints
    across tiles have no seats of their own.
    """
    total = 0.0
    if tile < len(seats.filled):
        positions, first_seat = seats.positions, seats.first[tile]
        for s in range(first_seat, first_seat + seats.filled[tile], 2):
            total += positions[s, 0]
    sitting, moves, target = runs.seats, runs.moves, runs.target
    for run in range(runs.tile_run[tile], runs.tile_run[tile + 1]):
        first = runs.first_block[run]
        for b in range(first, first + (runs.filled[run] + LANES - 1) // LANES):
            for k in range(sitting.shape[1]):
                total += sitting[b, k, 0]
            total += moves[b, 0, 0] + target[b, 0] + target[b, LANES // 2]
    heard[0] += total


@kernel
def sweep_lengths(seats: Seats, lengths: Runs, first_tile: int, last_tile: int) -> None:
    """Meet the active lengths of tiles from `first_tile` to before `last_tile`; changes seated positions."""
    if len(seats.filled) <= _CACHED_TILES:
        meet_lengths(seats.positions, lengths, first_tile, last_tile)
        return
    heard = np.zeros(1)
    for tile in range(first_tile, last_tile):
        read_ahead(seats, lengths, tile, heard)
        meet_lengths(seats.positions, lengths, tile, tile + 1)


@kernel
def sweep_angles(
    form: int, seats: Seats, angles: Runs, stiffness: float, first_tile: int, last_tile: int
) -> None:
    """Bring the active hinges of tiles from `first_tile` to before `last_tile` towards their targets; changes
    seated positions.
    """
    if len(seats.filled) <= _CACHED_TILES:
        meet_angles(form, seats.positions, angles, stiffness, first_tile, last_tile)
        return
    heard = np.zeros(1)
    for tile in range(first_tile, last_tile):
        read_ahead(seats, angles, tile, heard)
        meet_angles(form, seats.positions, angles, stiffness, tile, tile + 1)


@kernel
def sweep(
    sweeps: int, form: int, stiffness: float, positions: Vectors, lengths: Runs, angles: Runs, seats: Seats
) -> None:
    """A number of sweeps over all that is active; changes positions (3 m, 3), of film vertices."""
    tiles, length_tiles, angle_tiles = len(seats.filled), len(lengths.tile_run) - 1, len(angles.tile_run) - 1
    seat_positions(positions, seats, 0, tiles)
    for _ in range(sweeps):
        sweep_lengths(seats, lengths, 0, length_tiles)
        sweep_angles(form, seats, angles, stiffness, 0, angle_tiles)
        sweep_substrate(seats, 0, tiles)
    return_positions(positions, seats, 0, tiles)
