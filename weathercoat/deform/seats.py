"""Seats: a copy of the positions that sweeps work on, in which a tile's vertices lie side by side.

Vertices that splits add are numbered as they come, all over the film, and those of a tile would lie far apart
in memory. So every vertex that a constraint has ever needed has a seat in the range of its tile, from the
front; its position is brought there before the sweeps of a step and taken back after them. Seats are kept.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from weathercoat.compile import formula, kernel
from weathercoat.deform.runs import TILE, tile_count
from weathercoat.mesh.halfedge import HalfEdgeMesh
from weathercoat.mesh.surface import Indices, Vectors


class Seats(NamedTuple):
    """Seats of film vertices, t tiles.

    first: int32 (t + 1,), where the range of each tile begins; filled (t,), how many seats of it are taken;
    seat (3 m,), of a film vertex, or -1; vertex (3 m,), who sits there; plane (3 m, 4), normal and offset of
    n . p = offset, below which it must not go, zero for one that does not move; positions (3 m, 3), only good
    within a step.
    """

    first: Indices
    filled: Indices
    seat: Indices
    vertex: Indices
    plane: Vectors
    positions: Vectors


def make_seats(mesh: HalfEdgeMesh) -> Seats:
    """No seat is taken; there is one for each corner of a face, and so for each copy that there can be."""
    capacity = len(mesh.tail)
    corners = np.bincount(mesh.origin[mesh.tail] // TILE, minlength=tile_count(len(mesh.rest_positions)))
    return Seats(
        first=np.concatenate([[0], np.cumsum(corners)]).astype(np.int32),
        filled=np.zeros(len(corners), np.int32),
        seat=np.full(capacity, -1, np.int32),
        vertex=np.full(capacity, -1, np.int32),
        plane=np.zeros((capacity, 4)),
        positions=np.zeros((capacity, 3)),  # what empty lanes point to must be readable
    )


@formula
def take_seat(
    v: int, origin: Indices, seat: Indices, vertex: Indices, first: Indices, filled: Indices
) -> int:
    """The seat of film vertex v, from now on."""
    if seat[v] < 0:
        tile = origin[v] // TILE
        seat[v] = first[tile] + filled[tile]
        vertex[seat[v]] = v
        filled[tile] += 1
    return seat[v]


@kernel
def let_move(mesh: HalfEdgeMesh, seats: Seats, v: int) -> None:
    """Hold film vertex v above the tangent plane of its origin from now on."""
    s = take_seat(v, mesh.origin, seats.seat, seats.vertex, seats.first, seats.filled)
    o = mesh.origin[v]
    offset = 0.0
    for axis in range(3):
        seats.plane[s, axis] = mesh.rest_normals[o, axis]
        offset += mesh.rest_normals[o, axis] * mesh.rest_positions[o, axis]
    seats.plane[s, 3] = offset


@kernel
def let_be(seats: Seats, v: int) -> None:
    """Leave film vertex v where it is: it is gone or sleeps."""
    if seats.seat[v] >= 0:
        seats.plane[seats.seat[v]] = 0.0


@kernel
def seat_positions(positions: Vectors, seats: Seats, first_tile: int, last_tile: int) -> None:
    """Bring the positions of the tiles' vertices to their seats."""
    vertex, seated = seats.vertex, seats.positions
    for tile in range(first_tile, last_tile):
        first = seats.first[tile]
        for s in range(first, first + seats.filled[tile]):
            for axis in range(3):
                seated[s, axis] = positions[vertex[s], axis]


@kernel
def return_positions(positions: Vectors, seats: Seats, first_tile: int, last_tile: int) -> None:
    """Take the positions of the tiles' vertices back from their seats; changes positions."""
    vertex, seated = seats.vertex, seats.positions
    for tile in range(first_tile, last_tile):
        first = seats.first[tile]
        for s in range(first, first + seats.filled[tile]):
            for axis in range(3):
                positions[vertex[s], axis] = seated[s, axis]
