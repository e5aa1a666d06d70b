"""The second derivative of the energy: its pattern, which only the topology changes, and its blocks.

Blocks of 3 x 3 for pairs of free vertices that share an edge or a hinge, the upper triangle by columns. Of
each island either the Gauss-Newton part, which is never negative (of an edge k along its direction and k
max(0, 1 - L / l) across it, of a hinge w g g' with g the gradient of its bend), or all of it.

Source of the hinge's second derivative: Tamstorf and Grinspun, Discrete bending forces and their Jacobians,
2013; derived here by moving the foot of each apex and turning the edge.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.deform.blocks import Pattern, find_blocks, make_pattern
from weathercoat.deform.energy import Elastic, hinge_gradient
from weathercoat.mesh.surface import Indices, Vectors

_HELD = 1e6  # stiffness that holds a vertex on its plane, relative to its own


class Places(NamedTuple):
    """The pattern of an elastic's matrix, and where its edges (l, 3) and hinges (a, 10) add to."""

    pattern: Pattern
    lengths: Indices
    angles: Indices


def find_places(elastic: Elastic) -> Places:
    """The pattern of the active edges and hinges."""
    ends, hinges = elastic.unknown[elastic.ends], elastic.unknown[elastic.hinges]
    pattern = make_pattern(len(elastic.free), (ends, hinges))
    return Places(pattern, find_blocks(pattern, ends), find_blocks(pattern, hinges))


def fill_blocks(elastic: Elastic, places: Places, positions: Vectors, whole: NDArray[np.bool_]) -> Vectors:
    """The blocks (b, 3, 3) with film vertices at positions (n, 3); `whole` (k,) are the islands of which
    all is wanted, not the Gauss-Newton part.
    """
    e = elastic
    blocks = np.zeros((len(places.pattern.row), 3, 3))
    _add_lengths(
        positions, e.ends, e.rest_length, e.length_weight, whole[e.length_island], places.lengths, blocks
    )
    _add_angles(
        positions, e.unknown, e.hinges, e.target, e.angle_weight, whole[e.angle_island], places.angles,
        blocks,
    )  # fmt: skip
    return blocks


def hold_and_damp(
    blocks: Vectors, diagonal: Indices, normals: Vectors, held: NDArray[np.bool_], damping: Vectors
) -> None:
    """Stiffen unknowns (v,) by shares of their own stiffness (Levenberg's damping), and those held on their
    planes along their normals (v, 3), so that they only slide; changes blocks.
    """
    stiffness = np.abs(np.trace(blocks[diagonal], axis1=1, axis2=2)) / 3.0
    blocks[diagonal] += (damping * stiffness)[:, None, None] * np.eye(3)
    normal = normals[held]
    pressed = _HELD * stiffness[held][:, None, None]
    blocks[diagonal[held]] += pressed * normal[:, :, None] * normal[:, None, :]


@kernel
def _add_lengths(
    positions: Vectors, ends: Indices, rest_length: Vectors, length_weight: Vectors,
    whole: NDArray[np.bool_], length_block: Indices, blocks: Vectors,
) -> None:  # fmt: skip
    d = np.empty(3)
    for i in range(len(ends)):
        a, b = ends[i, 0], ends[i, 1]
        squared = 0.0
        for axis in range(3):
            d[axis] = positions[b, axis] - positions[a, axis]
            squared += d[axis] * d[axis]
        if not squared > 0.0:
            continue
        stiffness = length_weight[i] / (rest_length[i] * rest_length[i])
        across = stiffness * (1.0 - rest_length[i] / math.sqrt(squared))
        if not whole[i]:
            across = max(0.0, across)
        along = (stiffness - across) / squared
        for pair in range(3):
            at = length_block[i, pair]
            if at >= 0:
                sign = -1.0 if pair == 1 else 1.0
                for r in range(3):
                    for c in range(3):
                        blocks[at, r, c] += sign * along * d[r] * d[c]
                    blocks[at, r, r] += sign * across


@kernel
def _add_angles(
    positions: Vectors, unknown: Indices, hinges: Indices, target: Vectors, angle_weight: Vectors,
    whole: NDArray[np.bool_], angle_block: Indices, blocks: Vectors,
) -> None:  # fmt: skip
    g, second = np.empty((4, 3)), np.empty((4, 4, 3, 3))
    for i in range(len(hinges)):
        bend, g[2, 0], g[2, 1], g[2, 2], g[3, 0], g[3, 1], g[3, 2], s, t = hinge_gradient(
            positions, hinges[i, 0], hinges[i, 1], hinges[i, 2], hinges[i, 3]
        )
        for axis in range(3):
            g[0, axis] = -(1.0 - s) * g[2, axis] - (1.0 - t) * g[3, axis]
            g[1, axis] = -s * g[2, axis] - t * g[3, axis]
        weight = angle_weight[i]
        moment = 0.0
        if whole[i]:
            moment = weight * (bend - target[i])
            hinge_second_derivative(positions, hinges[i], g, s, t, second)
        pair = 0
        for k in range(4):
            for m in range(k + 1):
                at = angle_block[i, pair]
                pair += 1
                if at < 0:
                    continue
                low, high = (m, k) if unknown[hinges[i, m]] <= unknown[hinges[i, k]] else (k, m)
                for r in range(3):
                    for c in range(3):
                        blocks[at, r, c] += weight * g[low, r] * g[high, c]
                        if moment != 0.0:
                            blocks[at, r, c] += moment * second[low, high, r, c]


@kernel
def hinge_second_derivative(
    positions: Vectors, hinge: Indices, g: Vectors, s: float, t: float, out: Vectors
) -> None:
    """The second derivative of a hinge's bend over its corners into out (4, 4, 3, 3), given the gradient g
    (4, 3) and where the feet of the apexes lie along the edge; zeros where it has no extent.

    With a unit normal m, a unit edge d, the unit vector c from the edge to the apex at the height h:
    moving the apex changes its gradient -m / h by U = (m c' + c m') / h^2; moving an end of the edge moves
    the foot, the other way, and turns the edge, which adds W = d m' / (length h) with either sign.
    """
    out[:] = 0.0
    d, c = np.empty(3), np.empty(3)
    squared = 0.0
    for axis in range(3):
        d[axis] = positions[hinge[1], axis] - positions[hinge[0], axis]
        squared += d[axis] * d[axis]
    if not squared > 0.0 or (g[2, 0] == 0.0 and g[2, 1] == 0.0 and g[2, 2] == 0.0):
        return
    length = math.sqrt(squared)
    for axis in range(3):
        d[axis] /= length
    for face in range(2):
        apex, foot = 2 + face, s if face == 0 else t
        slope = math.sqrt(g[apex, 0] * g[apex, 0] + g[apex, 1] * g[apex, 1] + g[apex, 2] * g[apex, 2])
        height = 1.0 / slope
        for axis in range(3):
            away = positions[hinge[apex], axis] - positions[hinge[0], axis] - foot * length * d[axis]
            c[axis] = away * slope
        for i in range(3):
            for j in range(3):
                mi, mj = -g[apex, i] * height, -g[apex, j] * height
                u = (mi * c[j] + c[i] * mj) * slope * slope
                w = d[i] * mj * slope / length
                w_turned = d[j] * mi * slope / length
                out[apex, apex, i, j] = u
                out[apex, 0, i, j] = -(1.0 - foot) * u - w
                out[apex, 1, i, j] = -foot * u + w
                # of the two faces together this is symmetric, of each alone it is but for a rotation
                out[1, 0, i, j] += (
                    foot * (1.0 - foot) * u + foot * w - (1.0 - foot) * w_turned - mi * c[j] / squared
                )
    for i in range(3):
        for j in range(3):
            out[0, 1, j, i] = out[1, 0, i, j]
            for apex in range(2, 4):
                for end in range(2):
                    out[end, apex, j, i] = out[apex, end, i, j]
    for i in range(3):
        for j in range(3):
            out[0, 0, i, j] = -out[0, 1, i, j] - out[0, 2, i, j] - out[0, 3, i, j]
            out[1, 1, i, j] = -out[1, 0, i, j] - out[1, 2, i, j] - out[1, 3, i, j]
