"""A first guess for far curls: turn every face by what its hinges want, then fit the vertices.

Descent along the energy creeps there, since lengths are so much stiffer than bends that a sheet can only
curl from its edge inwards. Here the faces' rotations are found first, R_g = R_f Q for each hinge with Q the
turn about its edge from rest to its target, in the least-squares sense over all nine entries and then
brought back to rotations; after them the vertices, whose edges are to be those at rest, turned (a Poisson
system). Exact for targets that can be met; where they cannot, a blend of what they want.

Source: in the spirit of Lipman et al., Linear rotation-invariant coordinates for meshes, 2005.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.deform.blocks import find_blocks, make_pattern
from weathercoat.deform.energy import Elastic
from weathercoat.deform.factor import Factors
from weathercoat.mesh.halfedge import HalfEdgeMesh
from weathercoat.mesh.surface import Indices, Vectors

_ANCHOR = 1e-12  # keeps where it is at rest what nothing holds, relative to its neighbours
_WHOLE = np.zeros(1, np.int64)


def unroll(mesh: HalfEdgeMesh, elastic: Elastic, positions: Vectors, islands: NDArray[np.bool_]) -> Vectors:
    """The positions (n, 3) with the free vertices of some islands (k,) where the rotations of their faces
    want them.
    """
    e = elastic
    rest = mesh.rest_positions[mesh.origin[: len(positions)]]
    chosen = islands[e.angle_island]
    if not chosen.any():
        return positions.copy()
    first = e.hinge_edge[chosen]
    pairs = np.stack([first // 3, mesh.twin[first] // 3], axis=1)
    corners = mesh.tail.reshape(-1, 3)
    faces = np.unique(pairs)
    moving = faces[(e.unknown[corners[faces]] >= 0).any(axis=1)]
    number = np.full(len(corners), -1, np.int32)
    number[moving] = np.arange(len(moving), dtype=np.int32)
    turn = (e.target - e.bend_at_rest)[chosen]
    turned = _rotate_faces(rest, number[pairs], e.hinges[chosen], turn, e.angle_weight[chosen], len(moving))
    at = np.flatnonzero(islands[e.island])
    unknown = np.full(len(positions), -1, np.int32)
    unknown[e.free[at]] = np.arange(len(at), dtype=np.int32)
    out = positions.copy()
    out[e.free[at]] = _fit_vertices(rest, unknown, corners[moving], turned, len(at))
    return out


def _rotate_faces(
    rest: Vectors, pairs: Indices, hinges: Indices, turn: Vectors, weight: Vectors, count: int
) -> Vectors:
    """The rotations (f, 3, 3) of `count` faces from hinges between pairs of them, -1 for one that stays."""
    pattern = make_pattern(count, (pairs,))
    blocks, right = np.zeros((len(pattern.row), 3, 3)), np.zeros((3, count, 3))
    _add_turns(rest, pairs, hinges, turn, weight, find_blocks(pattern, pairs), blocks, right)
    anchor = _ANCHOR * float(weight.mean())
    blocks[pattern.diagonal()] += anchor * np.eye(3)
    right += anchor * np.eye(3)[:, None, :]
    factors = Factors(pattern, np.array([0, count]), 3)
    factors.factor(_WHOLE, blocks)
    rows = np.stack([factors.solve(_WHOLE, right[row]) for row in range(3)], axis=1)
    u, _, v = np.linalg.svd(rows)
    u[:, :, 2] *= np.linalg.det(u @ v)[:, None]
    return u @ v  # type: ignore[no-any-return]


@kernel
def _add_turns(
    rest: Vectors, pairs: Indices, hinges: Indices, turn: Vectors, weight: Vectors, places: Indices,
    blocks: Vectors, right: Vectors,
) -> None:  # fmt: skip
    """The normal equations of |r_g - r_f Q|^2 for each row r of the rotations of faces f and g."""
    q, d = np.empty((3, 3)), np.empty(3)
    for i in range(len(pairs)):
        squared = 0.0
        for axis in range(3):
            d[axis] = rest[hinges[i, 1], axis] - rest[hinges[i, 0], axis]
            squared += d[axis] * d[axis]
        if not squared > 0.0:
            continue
        d /= math.sqrt(squared)
        sine, cosine = math.sin(turn[i]), math.cos(turn[i])
        for r in range(3):
            for c in range(3):
                q[r, c] = (1.0 - cosine) * d[r] * d[c] + (cosine if r == c else 0.0)
        q[0, 1] -= sine * d[2]
        q[1, 0] += sine * d[2]
        q[0, 2] += sine * d[1]
        q[2, 0] -= sine * d[1]
        q[1, 2] -= sine * d[0]
        q[2, 1] += sine * d[0]
        f, g = pairs[i, 0], pairs[i, 1]
        for axis in range(3):
            if f >= 0:
                blocks[places[i, 0], axis, axis] += weight[i]
            if g >= 0:
                blocks[places[i, 2], axis, axis] += weight[i]
        for r in range(3):
            for c in range(3):
                if f >= 0 and g >= 0:
                    blocks[places[i, 1], r, c] -= weight[i] * (q[r, c] if f < g else q[c, r])
                elif f >= 0:
                    right[c, f, r] += weight[i] * q[r, c]
                elif g >= 0:
                    right[c, g, r] += weight[i] * q[c, r]


def _fit_vertices(rest: Vectors, unknown: Indices, corners: Indices, turned: Vectors, count: int) -> Vectors:
    """The `count` unknown vertices, the others at rest, whose edges fit best those of faces (f, 3) at rest,
    turned by (f, 3, 3); edges count as much as the areas beside them.
    """
    corners_unknown = unknown[corners]
    pattern = make_pattern(count, (corners_unknown,))
    blocks, right = np.zeros((len(pattern.row), 1, 1)), np.zeros((count, 3))
    _add_edges(rest, corners, corners_unknown, turned, find_blocks(pattern, corners_unknown), blocks, right)
    diagonal = pattern.diagonal()
    anchor = _ANCHOR * blocks[diagonal, 0, 0] + 1e-300
    blocks[diagonal, 0, 0] += anchor
    of = np.flatnonzero(unknown >= 0)
    right[unknown[of]] += anchor[unknown[of], None] * rest[of]
    factors = Factors(pattern, np.array([0, count]), 1)
    factors.factor(_WHOLE, blocks)
    return np.concatenate([factors.solve(_WHOLE, right[:, axis : axis + 1]) for axis in range(3)], axis=1)


@kernel
def _add_edges(
    rest: Vectors, corners: Indices, unknown: Indices, turned: Vectors, places: Indices, blocks: Vectors,
    right: Vectors,
) -> None:  # fmt: skip
    """The normal equations of |x_b - x_a - R (X_b - X_a)|^2 for the edges of each face."""
    d = np.empty(3)
    for f in range(len(corners)):
        for k in range(3):
            m = k - 1 if k > 0 else 2
            a, b = unknown[f, m], unknown[f, k]
            for r in range(3):
                d[r] = 0.0
                for c in range(3):
                    d[r] += turned[f, r, c] * (rest[corners[f, k], c] - rest[corners[f, m], c])
            if a >= 0:
                blocks[places[f, _own(m)], 0, 0] += 1.0
            if b >= 0:
                blocks[places[f, _own(k)], 0, 0] += 1.0
            if a >= 0 and b >= 0:
                blocks[places[f, _own(max(k, m)) - max(k, m) + min(k, m)], 0, 0] -= 1.0
            for axis in range(3):
                if a >= 0:
                    right[a, axis] -= d[axis] - (rest[corners[f, k], axis] if b < 0 else 0.0)
                if b >= 0:
                    right[b, axis] += d[axis] + (rest[corners[f, m], axis] if a < 0 else 0.0)


@kernel
def _own(corner: int) -> int:
    """Where the pair of a corner with itself stands among the pairs of an element."""
    return corner * (corner + 3) // 2
