"""The substrate: no vertex goes below the tangent plane of the metal where it began (paper 5)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from weathercoat.compile import formula, kernel
from weathercoat.deform.runs import LANES, TILE, tile_count
from weathercoat.mesh.halfedge import HalfEdgeMesh
from weathercoat.mesh.surface import Indices, Vectors


class Planes(NamedTuple):
    """The vertices that may move, with their planes n . p = offset, packed in lanes as constraints are.

    first_block: int32 (t + 1,), the blocks of each tile; filled (t,), lanes in use; lane (3 m,), where a film
    vertex is packed, or -1; vertex int32 (b, 16); plane (b, 4, 16), normal and offset.
    """

    first_block: Indices
    filled: Indices
    lane: Indices
    vertex: Indices
    plane: Vectors


def make_planes(mesh: HalfEdgeMesh) -> Planes:
    """No vertex that may move, and room for as many copies of each as it has faces."""
    corners = np.bincount(mesh.tail // TILE, minlength=tile_count(len(mesh.rest_positions)))
    first_block = np.concatenate([[0], np.cumsum(-(-corners // LANES))]).astype(np.int32)
    blocks = int(first_block[-1])
    return Planes(
        first_block=first_block,
        filled=np.zeros(len(corners), np.int32),
        lane=np.full(len(mesh.tail), -1, np.int32),
        vertex=np.zeros((blocks, LANES), np.int32),
        plane=np.zeros((blocks, 4, LANES)),
    )


@kernel
def let_move(mesh: HalfEdgeMesh, planes: Planes, v: int) -> None:
    """Hold film vertex v above its plane from now on."""
    if planes.lane[v] >= 0:
        return
    o = mesh.origin[v]
    tile = o // TILE
    lane = LANES * planes.first_block[tile] + planes.filled[tile]
    planes.filled[tile] += 1
    planes.lane[v] = lane
    b, i = lane // LANES, lane % LANES
    planes.vertex[b, i] = v
    offset = 0.0
    for axis in range(3):
        planes.plane[b, axis, i] = mesh.rest_normals[o, axis]
        offset += mesh.rest_normals[o, axis] * mesh.rest_positions[o, axis]
    planes.plane[b, 3, i] = offset


@kernel
def forget(mesh: HalfEdgeMesh, planes: Planes, v: int) -> None:
    """Let film vertex v be, which is gone or rests: the last one of its tile takes its lane."""
    lane = planes.lane[v]
    if lane < 0:
        return
    tile = mesh.origin[v] // TILE
    planes.filled[tile] -= 1
    last = LANES * planes.first_block[tile] + planes.filled[tile]
    b, i, c, j = lane // LANES, lane % LANES, last // LANES, last % LANES
    moved = planes.vertex[c, j]
    planes.vertex[b, i] = moved
    for k in range(4):
        planes.plane[b, k, i] = planes.plane[c, k, j]
    planes.lane[moved] = lane
    planes.lane[v] = -1


@formula
def stay_above(
    x: float, y: float, z: float, nx: float, ny: float, nz: float, offset: float
) -> tuple[float, float, float]:
    """The point, put back along the normal n on the plane n . p = offset where it lies below it."""
    depth = min(nx * x + ny * y + nz * z - offset, 0.0)
    return x - depth * nx, y - depth * ny, z - depth * nz
