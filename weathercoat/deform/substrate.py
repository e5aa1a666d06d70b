"""The substrate: no vertex goes below the tangent plane of the metal where it began (paper 5)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from weathercoat.compile import formula, kernel
from weathercoat.deform.runs import TILE, tile_count
from weathercoat.mesh.halfedge import HalfEdgeMesh
from weathercoat.mesh.surface import Indices, Vectors


class Planes(NamedTuple):
    """The vertices that may move, with their planes n . p = offset, tile by tile, each packed without gaps.

    first: int32 (t + 1,), where the room of each tile begins; filled (t,), how much of it is in use; place
    (3 m,), where a film vertex is, or -1; vertex int32 (3 m,); plane (3 m, 4), normal and offset.
    """

    first: Indices
    filled: Indices
    place: Indices
    vertex: Indices
    plane: Vectors


def make_planes(mesh: HalfEdgeMesh) -> Planes:
    """No vertex that may move, and room for as many copies of each as it has faces."""
    corners = np.bincount(mesh.tail // TILE, minlength=tile_count(len(mesh.rest_positions)))
    return Planes(
        first=np.concatenate([[0], np.cumsum(corners)]).astype(np.int32),
        filled=np.zeros(len(corners), np.int32),
        place=np.full(len(mesh.tail), -1, np.int32),
        vertex=np.zeros(len(mesh.tail), np.int32),
        plane=np.zeros((len(mesh.tail), 4)),
    )


@kernel
def let_move(mesh: HalfEdgeMesh, planes: Planes, v: int) -> None:
    """Hold film vertex v above its plane from now on."""
    if planes.place[v] >= 0:
        return
    o = mesh.origin[v]
    tile = o // TILE
    place = planes.first[tile] + planes.filled[tile]
    planes.filled[tile] += 1
    planes.place[v] = place
    planes.vertex[place] = v
    offset = 0.0
    for axis in range(3):
        planes.plane[place, axis] = mesh.rest_normals[o, axis]
        offset += mesh.rest_normals[o, axis] * mesh.rest_positions[o, axis]
    planes.plane[place, 3] = offset


@kernel
def forget(mesh: HalfEdgeMesh, planes: Planes, v: int) -> None:
    """Let film vertex v be, which is gone or at rest: the last one of its tile takes its place."""
    place = planes.place[v]
    if place < 0:
        return
    tile = mesh.origin[v] // TILE
    planes.filled[tile] -= 1
    last = planes.first[tile] + planes.filled[tile]
    moved = planes.vertex[last]
    planes.vertex[place] = moved
    for k in range(4):
        planes.plane[place, k] = planes.plane[last, k]
    planes.place[moved] = place
    planes.place[v] = -1


@formula
def stay_above(
    x: float, y: float, z: float, nx: float, ny: float, nz: float, offset: float
) -> tuple[float, float, float]:
    """The point, put back along the normal n on the plane n . p = offset where it lies below it."""
    depth = min(nx * x + ny * y + nz * z - offset, 0.0)
    return x - depth * nx, y - depth * ny, z - depth * nz
