"""The dihedral angle between two faces, its gradient, and their stencil.

            p3                 faces (p1, p2, p3) and (p2, p1, p4), counter-clockwise seen from outside
           /  \\                bend  = signed angle from the first normal to the second about p1 -> p2:
         p1 -- p2                      0 flat, positive for a ridge, negative for a valley, in (-pi, pi]
           \\  /                outer dihedral phi = pi + bend
            p4

Source of the gradient: Grinspun et al., Discrete shells, 2003; in the form of Tamstorf and Grinspun, 2013.
"""

from __future__ import annotations

import math

import numpy as np

from weathercoat.compile import kernel
from weathercoat.mesh.halfedge import next_of, prev_of
from weathercoat.mesh.surface import Indices, Vectors


@kernel
def bend_direction(positions: Vectors, p1: int, p2: int, p3: int, p4: int) -> tuple[float, float]:
    """Sine and cosine of the bend of the edge p1 p2, times the product of twice the faces' areas.

    0 and 1, those of a flat one, where a face or the edge has no extent.
    """
    ex = positions[p2, 0] - positions[p1, 0]
    ey = positions[p2, 1] - positions[p1, 1]
    ez = positions[p2, 2] - positions[p1, 2]
    ax = positions[p3, 0] - positions[p1, 0]
    ay = positions[p3, 1] - positions[p1, 1]
    az = positions[p3, 2] - positions[p1, 2]
    bx = positions[p4, 0] - positions[p1, 0]
    by = positions[p4, 1] - positions[p1, 1]
    bz = positions[p4, 2] - positions[p1, 2]
    mx, my, mz = ey * az - ez * ay, ez * ax - ex * az, ex * ay - ey * ax
    nx, ny, nz = by * ez - bz * ey, bz * ex - bx * ez, bx * ey - by * ex
    length = math.sqrt(ex * ex + ey * ey + ez * ez)
    cosine = mx * nx + my * ny + mz * nz
    if length == 0.0 or (mx * mx + my * my + mz * mz) == 0.0 or (nx * nx + ny * ny + nz * nz) == 0.0:
        return 0.0, 1.0
    triple = (my * nz - mz * ny) * ex + (mz * nx - mx * nz) * ey + (mx * ny - my * nx) * ez
    return triple / length, cosine


@kernel
def bend_angle(positions: Vectors, p1: int, p2: int, p3: int, p4: int) -> float:
    """Signed bend of the edge p1 p2 [rad]; 0 where a face or the edge has no extent."""
    sine, cosine = bend_direction(positions, p1, p2, p3, p4)
    return math.atan2(sine, cosine)


@kernel
def bend_gradient(positions: Vectors, p1: int, p2: int, p3: int, p4: int, out: Vectors) -> float:
    """Gradient of the bend over p1, p2, p3, p4 into out (4, 3) [rad per length]; returns the bend.

    All zero where a face or the edge has no extent.
    """
    e = positions[p2] - positions[p1]
    a = positions[p3] - positions[p1]
    b = positions[p4] - positions[p1]
    m = np.cross(e, a)
    n = np.cross(b, e)
    ee = np.dot(e, e)
    mm = np.dot(m, m)
    nn = np.dot(n, n)
    out[:] = 0.0
    if ee == 0.0 or mm == 0.0 or nn == 0.0:
        return 0.0
    length = math.sqrt(ee)
    s3 = np.dot(a, e) / ee
    s4 = np.dot(b, e) / ee
    for axis in range(3):
        g3 = -length / mm * m[axis]
        g4 = -length / nn * n[axis]
        out[2, axis] = g3
        out[3, axis] = g4
        out[0, axis] = -(1.0 - s3) * g3 - (1.0 - s4) * g4
        out[1, axis] = -s3 * g3 - s4 * g4
    return math.atan2(np.dot(np.cross(m, n), e) / length, np.dot(m, n))


@kernel
def half_edge_bend(h: int, positions: Vectors, tail: Indices, twin: Indices) -> float:
    """Signed bend of the edge of h [rad]; 0 where h has no twin."""
    g = twin[h]
    if g < 0:
        return 0.0
    return bend_angle(positions, tail[h], tail[next_of(h)], tail[prev_of(h)], tail[prev_of(g)])


@kernel
def all_bends(positions: Vectors, tail: Indices, twin: Indices, out: Vectors) -> None:
    """Signed bend of every half-edge into out (3 m,) [rad]."""
    for h in range(len(tail)):
        out[h] = half_edge_bend(h, positions, tail, twin)
