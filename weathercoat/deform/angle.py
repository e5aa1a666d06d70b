"""Angle constraints on hinges, in three forms.

A hinge is p1, p2 (the shared edge), p3, p4 as drawn in `mesh.dihedral`; its target is the wanted bend,
phi_0 - pi [rad]. At least one of its vertices has an inverse mass.

- `meet_dihedral`: the signed dihedral with its exact gradient over the four points; valid for every fold.
  The error is taken by half angles, e = 2 tan((bend - target) / 2), which needs no trigonometry, equals the
  difference to third order, and is clamped to 1, so that no correction turns a face by more than about a
  radian.
- `meet_split_angle`: the paper's form (4.3). Each face is turned about the edge until it makes half the
  outer dihedral with the neutral direction n = (n1 + n2) / |n1 + n2|, which is held constant. Where
  n1 = -n2 that has no direction; such a hinge is taken for a valley or a ridge as its target is.
- `meet_arccos_angle`: C = arccos(-n1 . n2) - phi_0 (Mueller et al., 2007). It cannot tell a ridge from a
  valley, and has no gradient where the hinge is flat: such hinges stay.
"""

from __future__ import annotations

import math

import numpy as np

from weathercoat.compile import formula, kernel
from weathercoat.mesh.dihedral import bend_gradient
from weathercoat.mesh.surface import Vectors

DIHEDRAL, SPLIT, ARCCOS = 0, 1, 2
FORMS = {"dihedral": DIHEDRAL, "split": SPLIT, "arccos": ARCCOS}

_LEAST_LEVERAGE = (
    0.05  # least sum of w |gradient|^2 that a correction counts with, relative to both apexes moving
)
_NO_EXTENT = 1e-250  # squares of lengths and areas below this have no direction, and their inverse no use

Hinge = tuple[
    float, float, float, float, float, float, float, float, float, float, float, float
]  # fmt: skip


@formula
def meet_dihedral(
    p1x: float, p1y: float, p1z: float, p2x: float, p2y: float, p2z: float,
    p3x: float, p3y: float, p3z: float, p4x: float, p4y: float, p4z: float,
    w1: float, w2: float, w3: float, w4: float, target: float, stiffness: float,
) -> Hinge:  # fmt: skip
    """The hinge's points brought towards its target, which is given as tan(wanted bend / 2).

    Without branches, so that a loop over independent hinges can be vectorised; a hinge of no extent stays.
    """
    ex, ey, ez = p2x - p1x, p2y - p1y, p2z - p1z
    ax, ay, az = p3x - p1x, p3y - p1y, p3z - p1z
    bx, by, bz = p4x - p1x, p4y - p1y, p4z - p1z
    mx, my, mz = ey * az - ez * ay, ez * ax - ex * az, ex * ay - ey * ax
    nx, ny, nz = by * ez - bz * ey, bz * ex - bx * ez, bx * ey - by * ex
    ee = ex * ex + ey * ey + ez * ez
    mm = mx * mx + my * my + mz * mz
    nn = nx * nx + ny * ny + nz * nz
    has_extent = (ee > _NO_EXTENT) & (mm > _NO_EXTENT) & (nn > _NO_EXTENT)
    over_ee = 1.0 / ee if has_extent else 0.0
    over_mm = 1.0 / mm if has_extent else 0.0
    over_nn = 1.0 / nn if has_extent else 0.0
    length = math.sqrt(ee)
    # (sine, norm + cosine) is along (sin, cos) of half the bend
    norm = math.sqrt(mm * nn)
    cosine = mx * nx + my * ny + mz * nz
    triple = (my * nz - mz * ny) * ex + (mz * nx - mx * nz) * ey + (mx * ny - my * nx) * ez
    sine = triple * (length * over_ee)
    over = sine - target * (norm + cosine)
    under = norm + cosine + target * sine
    most = 1.0 if over > 0.0 else -1.0
    error = 2.0 * over / under if 2.0 * abs(over) < under else most
    s3 = (ax * ex + ay * ey + az * ez) * over_ee
    s4 = (bx * ex + by * ey + bz * ez) * over_ee
    c3, c4 = length * over_mm, length * over_nn
    g3x, g3y, g3z = c3 * mx, c3 * my, c3 * mz  # the gradients at p3 and p4, less their sign
    g4x, g4y, g4z = c4 * nx, c4 * ny, c4 * nz
    g1x = (1.0 - s3) * g3x + (1.0 - s4) * g4x
    g1y = (1.0 - s3) * g3y + (1.0 - s4) * g4y
    g1z = (1.0 - s3) * g3z + (1.0 - s4) * g4z
    g2x = s3 * g3x + s4 * g4x
    g2y = s3 * g3y + s4 * g4y
    g2z = s3 * g3z + s4 * g4z
    k3, k4 = ee * over_mm, ee * over_nn
    total = (
        w1 * (g1x * g1x + g1y * g1y + g1z * g1z)
        + w2 * (g2x * g2x + g2y * g2y + g2z * g2z)
        + w3 * k3
        + w4 * k4
    )
    # where only points may move that hardly turn the faces, an exact correction would throw them far
    total = max(total, _LEAST_LEVERAGE * (k3 + k4))
    scale = stiffness * error / total if has_extent else 0.0
    u1, u2, u3, u4 = w1 * scale, w2 * scale, w3 * scale, w4 * scale
    return (
        p1x - u1 * g1x, p1y - u1 * g1y, p1z - u1 * g1z,
        p2x - u2 * g2x, p2y - u2 * g2y, p2z - u2 * g2z,
        p3x + u3 * g3x, p3y + u3 * g3y, p3z + u3 * g3z,
        p4x + u4 * g4x, p4y + u4 * g4y, p4z + u4 * g4z,
    )  # fmt: skip


@kernel
def meet_split_angle(
    positions: Vectors, p1: int, p2: int, p3: int, p4: int,
    w1: float, w2: float, w3: float, w4: float, target: float, stiffness: float,
) -> None:  # fmt: skip
    """Turn each face of a hinge to half the outer dihedral of the wanted bend [rad]; changes positions."""
    _, _, _, length = _edge(positions, p1, p2)
    mx, my, mz, m_norm = _normal(positions, p1, p2, p3)
    nx, ny, nz, n_norm = _normal(positions, p2, p1, p4)
    if not (length > 0.0 and m_norm > 0.0 and n_norm > 0.0):
        return
    ax, ay, az = mx + nx, my + ny, mz + nz
    a_norm = math.sqrt(ax * ax + ay * ay + az * az)
    if a_norm > 1e-9:
        ax, ay, az = ax / a_norm, ay / a_norm, az / a_norm
    else:
        # the faces lie on each other, as a valley or as a ridge: whichever is wanted
        ex, ey, ez, _ = _edge(positions, p1, p2)
        side = 1.0 if target < 0.0 else -1.0
        ax, ay, az = side * (my * ez - mz * ey), side * (mz * ex - mx * ez), side * (mx * ey - my * ex)
    half = 0.5 * (math.pi + target)
    reach = min(m_norm, n_norm) / length
    _turn_face(positions, p1, p2, p3, w1, w2, w3, ax, ay, az, half, reach, stiffness)
    _turn_face(positions, p2, p1, p4, w2, w1, w4, ax, ay, az, half, reach, stiffness)


@kernel
def _edge(positions: Vectors, a: int, b: int) -> tuple[float, float, float, float]:
    """Unit vector from a to b, and their distance; the zero vector where that is zero."""
    x = positions[b, 0] - positions[a, 0]
    y = positions[b, 1] - positions[a, 1]
    z = positions[b, 2] - positions[a, 2]
    length = math.sqrt(x * x + y * y + z * z)
    if length > 0.0:
        return x / length, y / length, z / length, length
    return 0.0, 0.0, 0.0, 0.0


@kernel
def _normal(positions: Vectors, a: int, b: int, c: int) -> tuple[float, float, float, float]:
    """Unit normal of the face a, b, c, and twice its area; the zero vector where that is zero."""
    ux = positions[b, 0] - positions[a, 0]
    uy = positions[b, 1] - positions[a, 1]
    uz = positions[b, 2] - positions[a, 2]
    vx = positions[c, 0] - positions[a, 0]
    vy = positions[c, 1] - positions[a, 1]
    vz = positions[c, 2] - positions[a, 2]
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    norm = math.sqrt(x * x + y * y + z * z)
    if norm > 0.0:
        return x / norm, y / norm, z / norm, norm
    return 0.0, 0.0, 0.0, 0.0


@kernel
def _turn_face(
    positions: Vectors, p1: int, p2: int, p3: int, w1: float, w2: float, w3: float,
    ax: float, ay: float, az: float, half: float, reach: float, stiffness: float,
) -> None:  # fmt: skip
    """Bring the angle between the constant direction a, normal to the edge, and the face p1, p2, p3 to
    `half`.

    The apex is moved as if its height over the edge were at most `reach`, that of the lower of the two faces:
    the full step of a high face moves the edge so far that a low one beside it turns by more than was gained,
    which diverges.
    """
    ex, ey, ez, length = _edge(positions, p1, p2)
    mx, my, mz, norm = _normal(positions, p1, p2, p3)
    if not norm > 0.0:
        return
    ux, uy, uz = my * ez - mz * ey, mz * ex - mx * ez, mx * ey - my * ex
    cx, cy, cz = ay * uz - az * uy, az * ux - ax * uz, ax * uy - ay * ux
    angle = math.atan2(math.sqrt(cx * cx + cy * cy + cz * cz), ax * ux + ay * uy + az * uz)
    px = positions[p3, 0] - positions[p1, 0]
    py = positions[p3, 1] - positions[p1, 1]
    pz = positions[p3, 2] - positions[p1, 2]
    share = (px * ex + py * ey + pz * ez) / length
    total = w1 * ((1.0 - share) * (1.0 - share)) + w2 * (share * share) + w3
    # the angle's gradient is -m / height at p3, and its reaction at the edge
    scale = (
        stiffness
        * min(max(angle - half, -1.0), 1.0)
        * min(norm / length, reach)
        / max(total, _LEAST_LEVERAGE)
    )
    for axis, m in ((0, mx), (1, my), (2, mz)):
        positions[p3, axis] += w3 * scale * m
        positions[p1, axis] -= w1 * scale * (1.0 - share) * m
        positions[p2, axis] -= w2 * scale * share * m


@kernel
def meet_arccos_angle(
    positions: Vectors, p1: int, p2: int, p3: int, p4: int,
    w1: float, w2: float, w3: float, w4: float, target: float, stiffness: float, gradient: Vectors,
) -> None:  # fmt: skip
    """Bring the unsigned angle between two faces to that of the wanted bend [rad]; changes positions.

    gradient: scratch (4, 3).
    """
    bend = bend_gradient(positions, p1, p2, p3, p4, gradient)
    if bend == 0.0:
        return
    error = (math.pi - abs(bend)) - (math.pi + target)
    total = (
        w1 * np.dot(gradient[0], gradient[0])
        + w2 * np.dot(gradient[1], gradient[1])
        + w3 * np.dot(gradient[2], gradient[2])
        + w4 * np.dot(gradient[3], gradient[3])
    )
    apexes = np.dot(gradient[2], gradient[2]) + np.dot(gradient[3], gradient[3])
    error = min(max(error, -1.0), 1.0)
    scale = stiffness * error / max(total, _LEAST_LEVERAGE * apexes) * (-1.0 if bend > 0.0 else 1.0)
    for axis in range(3):
        positions[p1, axis] -= w1 * scale * gradient[0, axis]
        positions[p2, axis] -= w2 * scale * gradient[1, axis]
        positions[p3, axis] -= w3 * scale * gradient[2, axis]
        positions[p4, axis] -= w4 * scale * gradient[3, axis]
