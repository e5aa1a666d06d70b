"""The energy that the converged solvers minimise: strain of the active edges, bend of the active hinges.

    E = sum over edges  3 A_e / 2 (l / L - 1)^2
      + sum over hinges 3 A_e / 4 (t^2 / 12) ((bend - target) / span)^2

in units of the film's stretching stiffness (Young's modulus times thickness) times a size squared. A_e is a
third of the rest area of the edge's faces, l its length and L its rest length, span the distance between the
centres of its two faces at rest, and t the film's thickness. On equilateral triangles an edge network
stretches like a plate whose Poisson's ratio is 1/3, and rolled into a cylinder it bends like that plate, so
that bending is to stretching as t^2 / 12; docs/accuracy.md derives both. The substrate is an inequality: no
free vertex lies below the plane of its origin.

Source of the hinge's energy: Grinspun et al., Discrete shells, 2003.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from weathercoat.compile import formula, kernel
from weathercoat.deform.constraints import Constraints
from weathercoat.deform.islands import label_islands
from weathercoat.deform.parameters import Aim, DeformParameters
from weathercoat.deform.targets import wanted_bend
from weathercoat.mesh.dihedral import bend_angle
from weathercoat.mesh.halfedge import HalfEdgeMesh, next_of, prev_of
from weathercoat.mesh.surface import Indices, Vectors

_NO_EXTENT = 1e-250  # squares of lengths and areas below this have no direction
_LEAST_BEND, _LEAST_STRAIN = 1e-3, 1e-6  # what an island's energy is measured by where nothing curls it


class Elastic(NamedTuple):
    """The active edges and hinges of film that may move, with targets and weights; k islands.

    free: int32 (v,), the vertices that may move, by island and ascending in it; unknown: int32 (n,), where
    each film vertex stands in `free`, -1 if it is held. ends: int32 (l, 2), rest_length and length_weight
    (l,); hinges: int32 (a, 4) as drawn in `mesh.dihedral`, of the half-edges hinge_edge (a,), target [rad],
    bend_at_rest [rad] and angle_weight (a,). normals (v, 3) and offsets (v,) are the planes n . p = offset
    that free vertices stay above. island int32 (v,), length_island (l,), angle_island (a,): which island of
    free film each belongs to; no element connects two. scale: (k,), the energy of each island if it lay as
    at rest, by which all that is measured on it is divided.
    """

    free: Indices
    unknown: Indices
    ends: Indices
    rest_length: Vectors
    length_weight: Vectors
    hinges: Indices
    hinge_edge: Indices
    target: Vectors
    bend_at_rest: Vectors
    angle_weight: Vectors
    normals: Vectors
    offsets: Vectors
    island: Indices
    length_island: Indices
    angle_island: Indices
    scale: Vectors


def make_elastic(
    mesh: HalfEdgeMesh, constraints: Constraints, parameters: DeformParameters, age: float
) -> Elastic:
    """What acts on the film that may move, with the targets of an age."""
    c, aim, thickness = constraints, parameters.aim_at(age), parameters.deformation_film_thickness
    count = mesh.vertex_count
    free = np.flatnonzero((c.inverse_mass[:count] > 0.0) & (mesh.half_edge[:count] >= 0)).astype(np.int32)
    unknown = _number(free, count)
    lengths, angles = _count_active(mesh, unknown, c.rest_length, c.span, c.angle_start)
    ends, hinges = np.empty((lengths, 2), np.int32), np.empty((angles, 4), np.int32)
    length, length_weight = np.empty(lengths), np.empty(lengths)
    target, bend_at_rest, angle_weight = np.empty(angles), np.empty(angles), np.empty(angles)
    hinge_edge = np.empty(angles, np.int32)
    _gather_active(
        mesh, unknown, c.rest_length, c.span, c.angle_start, c.angle_age, aim, thickness * thickness / 12.0,
        ends, length, length_weight, hinges, hinge_edge, target, bend_at_rest, angle_weight,
    )  # fmt: skip
    island, length_island, angle_island, islands = label_islands(unknown, len(free), ends, hinges)
    order = np.argsort(island, kind="stable")
    free, island = free[order], island[order]
    origin = mesh.origin[free]
    normals = mesh.rest_normals[origin]
    straightened = 0.5 * angle_weight * ((target - bend_at_rest) ** 2 + _LEAST_BEND**2)
    return Elastic(
        free=free,
        unknown=_number(free, count),
        ends=ends,
        rest_length=length,
        length_weight=length_weight,
        hinges=hinges,
        hinge_edge=hinge_edge,
        target=target,
        bend_at_rest=bend_at_rest,
        angle_weight=angle_weight,
        normals=normals,
        offsets=np.einsum("ij,ij->i", normals, mesh.rest_positions[origin]),
        island=island,
        length_island=length_island,
        angle_island=angle_island,
        scale=sum_by_island(angle_island, straightened, islands)
        + sum_by_island(length_island, 0.5 * _LEAST_STRAIN**2 * length_weight, islands),
    )


def sum_by_island(island: Indices, values: Vectors, count: int) -> Vectors:
    """The sums of values over each of `count` islands, (count,)."""
    return np.bincount(island, values, count).astype(np.float64, copy=False)


def _number(free: Indices, count: int) -> Indices:
    """Where each of `count` vertices stands in `free`, -1 where it does not."""
    unknown = np.full(count, -1, np.int32)
    unknown[free] = np.arange(len(free), dtype=np.int32)
    return unknown


def energy(elastic: Elastic, positions: Vectors) -> Vectors:
    """The energy of each island, (k,), with film vertices at positions (n, 3)."""
    e = elastic
    out = np.zeros(len(e.scale))
    _add_energy(
        positions, e.ends, e.rest_length, e.length_weight, e.length_island,
        e.hinges, e.target, e.angle_weight, e.angle_island, out,
    )  # fmt: skip
    return out


def gradient(elastic: Elastic, positions: Vectors) -> Vectors:
    """The gradient of the energy over the free vertices, (v, 3)."""
    e = elastic
    out = np.zeros((len(e.free), 3))
    _add_gradient(
        positions, e.unknown, e.ends, e.rest_length, e.length_weight, e.hinges, e.target, e.angle_weight, out
    )
    return out


def hessian_product(elastic: Elastic, positions: Vectors, direction: Vectors) -> Vectors:
    """The second derivative of the energy over the free vertices, times a direction (v, 3); (v, 3)."""
    e = elastic
    out = np.zeros((len(e.free), 3))
    moving = np.zeros_like(positions)
    moving[e.free] = direction
    _add_hessian_product(
        positions, moving, e.unknown, e.ends, e.rest_length, e.length_weight,
        e.hinges, e.target, e.angle_weight, out,
    )  # fmt: skip
    return out


def bending_away(elastic: Elastic, positions: Vectors, direction: Vectors) -> Vectors:
    """How the residuals (strains and bend errors) bend away from their first-order change along a direction
    (v, 3): their second derivative along it, brought to the free vertices by their weighted gradients, (v,
    3).
    """
    e = elastic
    out = np.zeros((len(e.free), 3))
    moving = np.zeros_like(positions)
    moving[e.free] = direction
    _add_bending_away(
        positions, moving, e.unknown, e.ends, e.rest_length, e.length_weight, e.hinges, e.angle_weight, out
    )
    return out


def sum_of_forces(elastic: Elastic, positions: Vectors) -> Vectors:
    """The magnitudes of all forces on each free vertex, (v,), whatever their directions."""
    e = elastic
    out = np.zeros(len(e.free))
    _add_magnitudes(
        positions, e.unknown, e.ends, e.rest_length, e.length_weight, e.hinges, e.target, e.angle_weight, out
    )
    return out


@kernel
def _count_active(
    mesh: HalfEdgeMesh, unknown: Indices, rest_length: Vectors, span: Vectors, start: Vectors
) -> tuple[int, int]:
    """How many edges and hinges act on something free."""
    tail, twin, alive = mesh.tail, mesh.twin, mesh.alive
    lengths, angles = 0, 0
    for h in range(len(twin)):
        g = twin[h]
        if not alive[h // 3] or 0 <= g < h:
            continue
        held = unknown[tail[h]] < 0 and unknown[tail[next_of(h)]] < 0
        if not held and rest_length[h] > 0.0:
            lengths += 1
        if g < 0 or math.isnan(start[h]) or not span[h] > 0.0:
            continue
        if not (held and unknown[tail[prev_of(h)]] < 0 and unknown[tail[prev_of(g)]] < 0):
            angles += 1
    return lengths, angles


@kernel
def _gather_active(
    mesh: HalfEdgeMesh, unknown: Indices, rest_length: Vectors, span: Vectors, start: Vectors,
    since: Vectors, aim: Aim, bending: float, ends: Indices, length: Vectors, length_weight: Vectors,
    hinges: Indices, hinge_edge: Indices, target: Vectors, bend_at_rest: Vectors, angle_weight: Vectors,
) -> None:  # fmt: skip
    """Fill the lists of active edges and hinges, in the order of their half-edges."""
    tail, twin, alive, origin = mesh.tail, mesh.twin, mesh.alive, mesh.origin
    by_curvature, radius, rate, floor, age = aim.by_curvature, aim.radius, aim.rate, aim.floor, aim.age
    rest = mesh.rest_positions
    areas = np.empty(len(alive))
    _rest_areas(rest, mesh.faces, areas)
    i, a = 0, 0
    for h in range(len(twin)):
        g = twin[h]
        if not alive[h // 3] or 0 <= g < h:
            continue
        p1, p2, p3 = tail[h], tail[next_of(h)], tail[prev_of(h)]
        held = unknown[p1] < 0 and unknown[p2] < 0
        area = areas[h // 3] + (areas[g // 3] if g >= 0 else 0.0)
        if not held and rest_length[h] > 0.0:
            ends[i, 0], ends[i, 1] = p1, p2
            length[i], length_weight[i] = rest_length[h], area
            i += 1
        if g >= 0 and not math.isnan(start[h]) and span[h] > 0.0:
            p4 = tail[prev_of(g)]
            if not (held and unknown[p3] < 0 and unknown[p4] < 0):
                hinges[a, 0], hinges[a, 1], hinges[a, 2], hinges[a, 3] = p1, p2, p3, p4
                target[a] = wanted_bend(start[h], since[h], span[h], by_curvature, radius, rate, floor, age)
                angle_weight[a] = 0.5 * area * bending / (span[h] * span[h])
                hinge_edge[a] = h
                bend_at_rest[a] = bend_angle(rest, origin[p1], origin[p2], origin[p3], origin[p4])
                a += 1


@kernel
def _rest_areas(positions: Vectors, faces: Indices, out: Vectors) -> None:
    """The areas of faces (m, 3) at rest into out (m,)."""
    for f in range(len(faces)):
        p, q, r = faces[f, 0], faces[f, 1], faces[f, 2]
        ux, uy, uz = _difference(positions, q, p)
        vx, vy, vz = _difference(positions, r, p)
        x, y, z = _cross(ux, uy, uz, vx, vy, vz)
        out[f] = 0.5 * math.sqrt(x * x + y * y + z * z)


@kernel
def _add_energy(
    positions: Vectors, ends: Indices, rest_length: Vectors, length_weight: Vectors, length_island: Indices,
    hinges: Indices, target: Vectors, angle_weight: Vectors, angle_island: Indices, out: Vectors,
) -> None:  # fmt: skip
    for i in range(len(ends)):
        x, y, z = _difference(positions, ends[i, 1], ends[i, 0])
        strain = math.sqrt(x * x + y * y + z * z) / rest_length[i] - 1.0
        out[length_island[i]] += 0.5 * length_weight[i] * strain * strain
    for i in range(len(hinges)):
        bend = bend_angle(positions, hinges[i, 0], hinges[i, 1], hinges[i, 2], hinges[i, 3])
        error = bend - target[i]
        out[angle_island[i]] += 0.5 * angle_weight[i] * error * error


@kernel
def _add_gradient(
    positions: Vectors, unknown: Indices, ends: Indices, rest_length: Vectors, length_weight: Vectors,
    hinges: Indices, target: Vectors, angle_weight: Vectors, out: Vectors,
) -> None:  # fmt: skip
    for i in range(len(ends)):
        a, b = unknown[ends[i, 0]], unknown[ends[i, 1]]
        x, y, z = _difference(positions, ends[i, 1], ends[i, 0])
        length = math.sqrt(x * x + y * y + z * z)
        if not length > 0.0:
            continue
        force = length_weight[i] * (length / rest_length[i] - 1.0) / (rest_length[i] * length)
        if a >= 0:
            _add(out, a, -force, x, y, z)
        if b >= 0:
            _add(out, b, force, x, y, z)
    for i in range(len(hinges)):
        bend, ux, uy, uz, vx, vy, vz, s, t = hinge_gradient(
            positions, hinges[i, 0], hinges[i, 1], hinges[i, 2], hinges[i, 3]
        )
        moment = angle_weight[i] * (bend - target[i])
        for k in range(4):
            j = unknown[hinges[i, k]]
            if j >= 0:
                cu, cv = _shares(k, s, t)
                _add(out, j, moment, cu * ux + cv * vx, cu * uy + cv * vy, cu * uz + cv * vz)


@kernel
def _add_magnitudes(
    positions: Vectors, unknown: Indices, ends: Indices, rest_length: Vectors, length_weight: Vectors,
    hinges: Indices, target: Vectors, angle_weight: Vectors, out: Vectors,
) -> None:  # fmt: skip
    for i in range(len(ends)):
        x, y, z = _difference(positions, ends[i, 1], ends[i, 0])
        strain = math.sqrt(x * x + y * y + z * z) / rest_length[i] - 1.0
        for k in range(2):
            if unknown[ends[i, k]] >= 0:
                out[unknown[ends[i, k]]] += abs(length_weight[i] * strain / rest_length[i])
    for i in range(len(hinges)):
        bend, ux, uy, uz, vx, vy, vz, s, t = hinge_gradient(
            positions, hinges[i, 0], hinges[i, 1], hinges[i, 2], hinges[i, 3]
        )
        moment = abs(angle_weight[i] * (bend - target[i]))
        for k in range(4):
            j = unknown[hinges[i, k]]
            if j >= 0:
                cu, cv = _shares(k, s, t)
                x, y, z = cu * ux + cv * vx, cu * uy + cv * vy, cu * uz + cv * vz
                out[j] += moment * math.sqrt(x * x + y * y + z * z)


@kernel
def _add_hessian_product(
    positions: Vectors, moving: Vectors, unknown: Indices, ends: Indices, rest_length: Vectors,
    length_weight: Vectors, hinges: Indices, target: Vectors, angle_weight: Vectors, out: Vectors,
) -> None:  # fmt: skip
    for i in range(len(ends)):
        a, b = unknown[ends[i, 0]], unknown[ends[i, 1]]
        x, y, z = _difference(positions, ends[i, 1], ends[i, 0])
        dx, dy, dz = _difference(moving, ends[i, 1], ends[i, 0])
        length = math.sqrt(x * x + y * y + z * z)
        if not length > 0.0:
            continue
        k = length_weight[i] / (rest_length[i] * rest_length[i])
        across = k * (1.0 - rest_length[i] / length)
        along = (k - across) * (x * dx + y * dy + z * dz) / (length * length)
        fx, fy, fz = across * dx + along * x, across * dy + along * y, across * dz + along * z
        if a >= 0:
            _add(out, a, -1.0, fx, fy, fz)
        if b >= 0:
            _add(out, b, 1.0, fx, fy, fz)
    g, d = np.empty((4, 3)), np.empty((4, 3))
    for i in range(len(hinges)):
        hinge = hinges[i]
        _hinge_gradient_change(positions, moving, hinge[0], hinge[1], hinge[2], hinge[3], g, d)
        turning = 0.0
        for k in range(4):
            for axis in range(3):
                turning += g[k, axis] * moving[hinge[k], axis]
        error = bend_angle(positions, hinge[0], hinge[1], hinge[2], hinge[3]) - target[i]
        for k in range(4):
            j = unknown[hinge[k]]
            if j >= 0:
                for axis in range(3):
                    out[j, axis] += angle_weight[i] * (turning * g[k, axis] + error * d[k, axis])


@kernel
def _add_bending_away(
    positions: Vectors, moving: Vectors, unknown: Indices, ends: Indices, rest_length: Vectors,
    length_weight: Vectors, hinges: Indices, angle_weight: Vectors, out: Vectors,
) -> None:  # fmt: skip
    for i in range(len(ends)):
        a, b = unknown[ends[i, 0]], unknown[ends[i, 1]]
        x, y, z = _difference(positions, ends[i, 1], ends[i, 0])
        dx, dy, dz = _difference(moving, ends[i, 1], ends[i, 0])
        squared = x * x + y * y + z * z
        if not squared > 0.0:
            continue
        along = x * dx + y * dy + z * dz
        across = dx * dx + dy * dy + dz * dz - along * along / squared
        force = length_weight[i] * across / (rest_length[i] * rest_length[i] * squared)
        if a >= 0:
            _add(out, a, -force, x, y, z)
        if b >= 0:
            _add(out, b, force, x, y, z)
    g, d = np.empty((4, 3)), np.empty((4, 3))
    for i in range(len(hinges)):
        hinge = hinges[i]
        _hinge_gradient_change(positions, moving, hinge[0], hinge[1], hinge[2], hinge[3], g, d)
        second = 0.0
        for k in range(4):
            for axis in range(3):
                second += d[k, axis] * moving[hinge[k], axis]
        for k in range(4):
            j = unknown[hinge[k]]
            if j >= 0:
                _add(out, j, angle_weight[i] * second, g[k, 0], g[k, 1], g[k, 2])


@kernel
def _hinge_gradient_change(
    positions: Vectors, moving: Vectors, p1: int, p2: int, p3: int, p4: int, g: Vectors, d: Vectors
) -> None:
    """The gradient of the bend into g (4, 3), its change with the movement into d (4, 3).

    Zeros where a face or the edge has no extent.
    """
    g[:], d[:] = 0.0, 0.0
    ex, ey, ez = _difference(positions, p2, p1)
    ax, ay, az = _difference(positions, p3, p1)
    bx, by, bz = _difference(positions, p4, p1)
    mx, my, mz = _cross(ex, ey, ez, ax, ay, az)
    nx, ny, nz = _cross(bx, by, bz, ex, ey, ez)
    ee, mm, nn = ex * ex + ey * ey + ez * ez, mx * mx + my * my + mz * mz, nx * nx + ny * ny + nz * nz
    if not (ee > _NO_EXTENT and mm > _NO_EXTENT and nn > _NO_EXTENT):
        return
    length = math.sqrt(ee)
    dex, dey, dez = _difference(moving, p2, p1)
    dax, day, daz = _difference(moving, p3, p1)
    dbx, dby, dbz = _difference(moving, p4, p1)
    d_length = (ex * dex + ey * dey + ez * dez) / length
    for face in range(2):
        if face == 0:
            px, py, pz, dpx, dpy, dpz, qx, qy, qz, qq = ax, ay, az, dax, day, daz, mx, my, mz, mm
            ux, uy, uz = _cross(dex, dey, dez, ax, ay, az)
            vx, vy, vz = _cross(ex, ey, ez, dax, day, daz)
        else:
            px, py, pz, dpx, dpy, dpz, qx, qy, qz, qq = bx, by, bz, dbx, dby, dbz, nx, ny, nz, nn
            ux, uy, uz = _cross(bx, by, bz, dex, dey, dez)
            vx, vy, vz = _cross(dbx, dby, dbz, ex, ey, ez)
        dqx, dqy, dqz = ux + vx, uy + vy, uz + vz
        scale = -length / qq
        d_scale = -(d_length - length * 2.0 * (qx * dqx + qy * dqy + qz * dqz) / qq) / qq
        s = (px * ex + py * ey + pz * ez) / ee
        d_s = (
            dpx * ex + dpy * ey + dpz * ez + px * dex + py * dey + pz * dez - 2.0 * s * length * d_length
        ) / ee
        g[2 + face, 0], g[2 + face, 1], g[2 + face, 2] = scale * qx, scale * qy, scale * qz
        d[2 + face, 0] = d_scale * qx + scale * dqx
        d[2 + face, 1] = d_scale * qy + scale * dqy
        d[2 + face, 2] = d_scale * qz + scale * dqz
        for axis in range(3):
            g[0, axis] -= (1.0 - s) * g[2 + face, axis]
            g[1, axis] -= s * g[2 + face, axis]
            d[0, axis] += d_s * g[2 + face, axis] - (1.0 - s) * d[2 + face, axis]
            d[1, axis] -= d_s * g[2 + face, axis] + s * d[2 + face, axis]


HingeGradient = tuple[float, float, float, float, float, float, float, float, float]


@formula
def hinge_gradient(positions: Vectors, p1: int, p2: int, p3: int, p4: int) -> HingeGradient:
    """The bend [rad], its gradients u over p3 and v over p4 [rad per size], and where the feet of p3 and p4
    lie along the edge, s and t: the gradient is -(1 - s) u - (1 - t) v over p1 and -s u - t v over p2.

    All zero where a face or the edge has no extent.
    """
    ex, ey, ez = _difference(positions, p2, p1)
    ax, ay, az = _difference(positions, p3, p1)
    bx, by, bz = _difference(positions, p4, p1)
    mx, my, mz = _cross(ex, ey, ez, ax, ay, az)
    nx, ny, nz = _cross(bx, by, bz, ex, ey, ez)
    tx, ty, tz = _cross(mx, my, mz, nx, ny, nz)
    ee, mm, nn = ex * ex + ey * ey + ez * ez, mx * mx + my * my + mz * mz, nx * nx + ny * ny + nz * nz
    if not (ee > _NO_EXTENT and mm > _NO_EXTENT and nn > _NO_EXTENT):
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    length = math.sqrt(ee)
    bend = math.atan2((tx * ex + ty * ey + tz * ez) / length, mx * nx + my * ny + mz * nz)
    cu, cv = -length / mm, -length / nn
    s, t = (ax * ex + ay * ey + az * ez) / ee, (bx * ex + by * ey + bz * ez) / ee
    return bend, cu * mx, cu * my, cu * mz, cv * nx, cv * ny, cv * nz, s, t


@formula
def _shares(corner: int, s: float, t: float) -> tuple[float, float]:
    """What the gradients over the apexes, u and v, count for at a corner of a hinge; see `hinge_gradient`."""
    if corner == 0:
        return -(1.0 - s), -(1.0 - t)
    if corner == 1:
        return -s, -t
    return (1.0, 0.0) if corner == 2 else (0.0, 1.0)


@formula
def _difference(points: Vectors, a: int, b: int) -> tuple[float, float, float]:
    return points[a, 0] - points[b, 0], points[a, 1] - points[b, 1], points[a, 2] - points[b, 2]


@formula
def _cross(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> tuple[float, float, float]:
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@formula
def _add(out: Vectors, i: int, scale: float, x: float, y: float, z: float) -> None:
    out[i, 0] += scale * x
    out[i, 1] += scale * y
    out[i, 2] += scale * z
