"""Angle constraints on hinges, in three forms.

All three take hinges int32 (k, 4) of p1, p2 (the shared edge), p3, p4 as drawn in `mesh.dihedral`, and
targets (k,): the wanted bend, phi_0 - pi [rad]. Each hinge has at least one vertex with an inverse mass. They
change positions, in order.

- `project_dihedrals`: the signed dihedral with its exact gradient over the four points; valid for every fold.
  The error is taken by half angles, e = 2 tan((bend - target) / 2), which needs no trigonometry in the loop,
  equals the difference to third order, and is clamped to 1, so that no correction turns a face by more than
  about a radian.
- `project_split_angles`: the paper's form (4.3). Each face is turned about the edge until it makes half the
  outer dihedral with the neutral direction n = (n1 + n2) / |n1 + n2|, which is held constant. Degenerates
  where n1 = -n2.
- `project_arccos_angles`: C = arccos(-n1 . n2) - phi_0 (Mueller et al., 2007). It cannot tell a ridge from a
  valley, and has no gradient where the hinge is flat: such hinges stay.
"""

from __future__ import annotations

import math

import numpy as np

from weathercoat.compile import kernel
from weathercoat.mesh.dihedral import bend_gradient
from weathercoat.mesh.surface import Indices, Vectors

_LEAST_LEVERAGE = (
    0.05  # least sum of w |gradient|^2 that a correction counts with, relative to both apexes moving
)


@kernel
def project_dihedrals(
    positions: Vectors, inverse_mass: Vectors, hinges: Indices, target: Vectors, stiffness: float
) -> None:
    """Bring signed dihedrals towards their targets; `target` holds tan(target bend / 2)."""
    for i in range(len(hinges)):
        p1, p2, p3, p4 = hinges[i, 0], hinges[i, 1], hinges[i, 2], hinges[i, 3]
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
        ee = ex * ex + ey * ey + ez * ez
        mm = mx * mx + my * my + mz * mz
        nn = nx * nx + ny * ny + nz * nz
        if not (ee > 0.0 and mm > 0.0 and nn > 0.0):
            continue
        length = math.sqrt(ee)
        norm = math.sqrt(mm * nn)
        cosine = mx * nx + my * ny + mz * nz
        sine = ((my * nz - mz * ny) * ex + (mz * nx - mx * nz) * ey + (mx * ny - my * nx) * ez) / length
        # (sine, norm + cosine) is along (sin, cos) of half the bend
        over = sine - target[i] * (norm + cosine)
        under = norm + cosine + target[i] * sine
        if 2.0 * abs(over) < under:
            error = 2.0 * over / under
        else:
            error = 1.0 if over > 0.0 else -1.0
        s3 = (ax * ex + ay * ey + az * ez) / ee
        s4 = (bx * ex + by * ey + bz * ez) / ee
        c3, c4 = length / mm, length / nn  # the gradients at p3 and p4 are -c3 m and -c4 n
        w1, w2, w3, w4 = inverse_mass[p1], inverse_mass[p2], inverse_mass[p3], inverse_mass[p4]
        g1x = (1.0 - s3) * c3 * mx + (1.0 - s4) * c4 * nx
        g1y = (1.0 - s3) * c3 * my + (1.0 - s4) * c4 * ny
        g1z = (1.0 - s3) * c3 * mz + (1.0 - s4) * c4 * nz
        g2x = s3 * c3 * mx + s4 * c4 * nx
        g2y = s3 * c3 * my + s4 * c4 * ny
        g2z = s3 * c3 * mz + s4 * c4 * nz
        total = (
            w1 * (g1x * g1x + g1y * g1y + g1z * g1z)
            + w2 * (g2x * g2x + g2y * g2y + g2z * g2z)
            + w3 * ee / mm
            + w4 * ee / nn
        )
        # where only points may move that hardly turn the faces, an exact correction would throw them far
        total = max(total, _LEAST_LEVERAGE * (ee / mm + ee / nn))
        scale = stiffness * error / total
        positions[p1, 0] -= w1 * scale * g1x
        positions[p1, 1] -= w1 * scale * g1y
        positions[p1, 2] -= w1 * scale * g1z
        positions[p2, 0] -= w2 * scale * g2x
        positions[p2, 1] -= w2 * scale * g2y
        positions[p2, 2] -= w2 * scale * g2z
        positions[p3, 0] += w3 * scale * c3 * mx
        positions[p3, 1] += w3 * scale * c3 * my
        positions[p3, 2] += w3 * scale * c3 * mz
        positions[p4, 0] += w4 * scale * c4 * nx
        positions[p4, 1] += w4 * scale * c4 * ny
        positions[p4, 2] += w4 * scale * c4 * nz


@kernel
def project_split_angles(
    positions: Vectors, inverse_mass: Vectors, hinges: Indices, target: Vectors, stiffness: float
) -> None:
    """Turn each face of a hinge to half the outer dihedral; `target` holds the wanted bend [rad]."""
    for i in range(len(hinges)):
        p1, p2, p3, p4 = hinges[i, 0], hinges[i, 1], hinges[i, 2], hinges[i, 3]
        _, _, _, length = _edge(positions, p1, p2)
        mx, my, mz, m_norm = _normal(positions, p1, p2, p3)
        nx, ny, nz, n_norm = _normal(positions, p2, p1, p4)
        if not (length > 0.0 and m_norm > 0.0 and n_norm > 0.0):
            continue
        ax, ay, az = mx + nx, my + ny, mz + nz
        a_norm = math.sqrt(ax * ax + ay * ay + az * az)
        if not a_norm > 1e-9:
            continue
        ax, ay, az = ax / a_norm, ay / a_norm, az / a_norm
        half = 0.5 * (math.pi + target[i])
        reach = min(m_norm, n_norm) / length
        _turn_face(positions, inverse_mass, p1, p2, p3, ax, ay, az, half, reach, stiffness)
        _turn_face(positions, inverse_mass, p2, p1, p4, ax, ay, az, half, reach, stiffness)


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
    positions: Vectors,
    inverse_mass: Vectors,
    p1: int,
    p2: int,
    p3: int,
    ax: float,
    ay: float,
    az: float,
    half: float,
    reach: float,
    stiffness: float,
) -> None:
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
    w1, w2, w3 = inverse_mass[p1], inverse_mass[p2], inverse_mass[p3]
    total = w1 * (1.0 - share) ** 2 + w2 * share**2 + w3
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
def project_arccos_angles(
    positions: Vectors, inverse_mass: Vectors, hinges: Indices, target: Vectors, stiffness: float
) -> None:
    """Bring the unsigned angle between faces to its target; `target` holds the wanted bend [rad]."""
    gradient = np.empty((4, 3))
    for i in range(len(hinges)):
        p = hinges[i]
        bend = bend_gradient(positions, p[0], p[1], p[2], p[3], gradient)
        if bend == 0.0:
            continue
        error = (math.pi - abs(bend)) - (math.pi + target[i])
        total = 0.0
        for k in range(4):
            total += inverse_mass[p[k]] * np.dot(gradient[k], gradient[k])
        apexes = np.dot(gradient[2], gradient[2]) + np.dot(gradient[3], gradient[3])
        error = min(max(error, -1.0), 1.0)
        scale = stiffness * error / max(total, _LEAST_LEVERAGE * apexes) * (-1.0 if bend > 0.0 else 1.0)
        for k in range(4):
            for axis in range(3):
                positions[p[k], axis] -= inverse_mass[p[k]] * scale * gradient[k, axis]
