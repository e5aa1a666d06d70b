"""The film over the simulated mesh as it is seen along the normals, from outside.

Film that lies where it was at the start covers its own face of the metal, and nothing is to be looked for.
Film that has moved may be seen anywhere in its reach: each face of the metal has a list of the film faces
that a ray from it, along its normals, can meet, and a texel takes the highest that its own ray does.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.mesh.closest import make_closest_tree
from weathercoat.mesh.surface import Indices, Vectors
from weathercoat.output.shell import corner_normals, open_edges, smooth_outline
from weathercoat.sim.snapshot import Snapshot

CLOSED, CRACK, END = range(3)  # what lies beyond a side of a film face: its neighbour, a crack, no film
_MOVED = 1e-7  # sizes
_UNDER = 4e-3  # sizes: so far below the metal film still counts, since it is smoothed and the metal is not
_CREASE = float(np.radians(60.0))
_OUTLINE_PASSES = 1  # as in pictures


class FilmCover(NamedTuple):
    """Film of m faces over metal of t faces and n vertices, in sizes.

    vertices (k, 3), with their outline smoothed; faces int32 (m, 3); metal_face int32 (m,), the face that
    each covered at the start; corner_normals float32 (m, 3, 3). covering int32 (t,): the film face of each
    face of the metal, -1 where it is gone. has_moved bool (m,). sides uint8 (m, 3): what is beyond the side
    from corner i to i + 1. first int32 (t + 1,), reach int32 (r,): the moved film faces that rays from a face
    of the metal may meet are reach[first[f]:first[f + 1]]. normals (n, 3): those rays. highest: a bound on
    how far above the metal film is.
    """

    vertices: Vectors
    faces: Indices
    metal_face: Indices
    corner_normals: NDArray[np.float32]
    covering: Indices
    has_moved: NDArray[np.bool_]
    sides: NDArray[np.uint8]
    first: NDArray[np.int64]
    reach: Indices
    normals: Vectors
    highest: float


def make_film_cover(snapshot: Snapshot, rest: Vectors, film: Vectors, neighbors: Indices) -> FilmCover:
    """The film of a snapshot; rest (n, 3), film (k, 3): the metal's and the film's vertices in sizes;
    neighbors int32 (t, 3): those of the metal's faces across the side from corner i to i + 1.
    """
    faces, metal = snapshot.film_faces, snapshot.substrate_faces
    covering = np.full(len(metal), -1, np.int32)
    covering[snapshot.film_face] = np.arange(len(faces), dtype=np.int32)
    sides = np.zeros((len(faces), 3), np.uint8)
    if len(faces):
        fixed = np.bincount(snapshot.film_origin, minlength=len(rest)) > 2
        fixed[open_edges(metal)[0]] = True
        film = smooth_outline(film, faces, fixed[snapshot.film_origin], _OUTLINE_PASSES)
        _find_sides(faces, snapshot.film_face, covering, neighbors, sides)
    away = np.linalg.norm(film - rest[snapshot.film_origin], axis=1)
    has_moved = (away > _MOVED)[faces].any(axis=1)
    highest = float(away.max(initial=0.0))
    normals = np.ascontiguousarray(snapshot.substrate_normals)
    first, reach = np.zeros(len(metal) + 1, np.int64), np.zeros(0, np.int32)
    moved = np.flatnonzero(has_moved).astype(np.int32)
    if len(moved):
        tree = make_closest_tree(film, faces[moved])
        _find_reach(
            rest, metal, normals, film, faces[moved], tree.box, tree.face, highest + _UNDER, first, reach
        )
        first = np.concatenate([[0], np.cumsum(first[:-1])]).astype(np.int64)
        reach = np.zeros(int(first[-1]), np.int32)
        _find_reach(
            rest, metal, normals, film, faces[moved], tree.box, tree.face, highest + _UNDER, first, reach
        )
        reach = moved[reach]
    return FilmCover(
        vertices=np.ascontiguousarray(film),
        faces=np.ascontiguousarray(faces),
        metal_face=np.ascontiguousarray(snapshot.film_face),
        corner_normals=corner_normals(film, faces, _CREASE),
        covering=covering,
        has_moved=has_moved,
        sides=sides,
        first=first,
        reach=reach,
        normals=normals,
        highest=highest,
    )


@kernel
def _find_sides(
    faces: Indices, metal_face: Indices, covering: Indices, neighbors: Indices, sides: NDArray[np.uint8]
) -> None:
    for f in range(len(faces)):
        for i in range(3):
            beyond = neighbors[metal_face[f], i]
            if beyond < 0:
                continue
            g = covering[beyond]
            if g < 0:
                sides[f, i] = END
                continue
            tail, head = faces[f, i], faces[f, (i + 1) % 3]
            sides[f, i] = CRACK
            for j in range(3):
                if faces[g, j] == head and faces[g, (j + 1) % 3] == tail:
                    sides[f, i] = CLOSED


@kernel
def _find_reach(
    rest: Vectors,
    metal: Indices,
    normals: Vectors,
    film: Vectors,
    faces: Indices,
    box: Vectors,
    leaf_face: Indices,
    highest: float,
    first: NDArray[np.int64],
    reach: Indices,
) -> None:
    """Count, or where `reach` has room list, the film faces that rays from each face of the metal may meet.

    The rays from a face fill a cone round their mean direction. What may meet it are the leaves of a tree
    whose spheres do, and of these the triangles that overlap the face as seen along that direction.
    """
    first_leaf = len(box) // 2
    is_count = len(reach) == 0
    waiting = np.empty(64, np.int64)
    centre, axis, to = np.empty(3), np.empty(3), np.empty(3)
    for t in range(len(metal)):
        length = 0.0
        for x in range(3):
            centre[x] = (rest[metal[t, 0], x] + rest[metal[t, 1], x] + rest[metal[t, 2], x]) / 3.0
            axis[x] = normals[metal[t, 0], x] + normals[metal[t, 1], x] + normals[metal[t, 2], x]
            length += axis[x] * axis[x]
        length = np.sqrt(length)
        radius, spread = 0.0, 0.0
        for x in range(3):
            axis[x] = axis[x] / length if length > 0.0 else 0.0
        for i in range(3):
            far, wide = 0.0, 0.0
            for x in range(3):
                far += (rest[metal[t, i], x] - centre[x]) ** 2
                wide += (normals[metal[t, i], x] - axis[x]) ** 2
            radius, spread = max(radius, np.sqrt(far)), max(spread, np.sqrt(wide))
        # rays are of the length of their interpolated normals, made one: near ones are shorter by this share
        stretch = 1.0 / max(0.25, 1.0 - 0.5 * spread * spread)
        count = 0
        at = first[t]
        waiting[0], top = 0, 1
        while top > 0:
            top -= 1
            node = waiting[top]
            if box[node, 0] > box[node, 3]:
                continue
            half, along, squared = 0.0, 0.0, 0.0
            for x in range(3):
                half += (0.5 * (box[node, x + 3] - box[node, x])) ** 2
                to[x] = 0.5 * (box[node, x] + box[node, x + 3]) - centre[x]
                along += to[x] * axis[x]
                squared += to[x] * to[x]
            half = np.sqrt(half)
            beside = np.sqrt(max(0.0, squared - along * along))
            deep = min(highest, abs(along) + half)
            if abs(along) > highest + radius + half:
                continue
            if beside > radius + half + deep * spread * stretch:
                continue
            if node >= first_leaf:
                f = leaf_face[node - first_leaf]
                if _is_apart(rest, metal, t, film, faces, f, axis, deep * spread * stretch):
                    continue
                if not is_count:
                    reach[at + count] = f
                count += 1
            else:
                waiting[top], waiting[top + 1] = 2 * node + 1, 2 * node + 2
                top += 2
        if is_count:
            first[t] = count


@kernel
def _is_apart(
    first: Vectors,
    first_faces: Indices,
    f: int,
    second: Vectors,
    second_faces: Indices,
    g: int,
    axis: Vectors,
    margin: float,
) -> bool:
    """Whether two triangles, seen along `axis`, are further apart than `margin` across a side of either."""
    for turn in range(2):
        for i in range(3):
            length, own, least, most = 0.0, 0.0, np.inf, -np.inf
            nx, ny, nz = 0.0, 0.0, 0.0
            for k in range(3):
                if turn == 0:
                    p, q, o = first_faces[f, i], first_faces[f, (i + 1) % 3], first_faces[f, (i + 2) % 3]
                    v = second_faces[g, k]
                    ex, ey, ez = (
                        first[q, 0] - first[p, 0],
                        first[q, 1] - first[p, 1],
                        first[q, 2] - first[p, 2],
                    )
                    ox, oy, oz = (
                        first[o, 0] - first[p, 0],
                        first[o, 1] - first[p, 1],
                        first[o, 2] - first[p, 2],
                    )
                    vx, vy, vz = (
                        second[v, 0] - first[p, 0],
                        second[v, 1] - first[p, 1],
                        second[v, 2] - first[p, 2],
                    )
                else:
                    p, q, o = second_faces[g, i], second_faces[g, (i + 1) % 3], second_faces[g, (i + 2) % 3]
                    v = first_faces[f, k]
                    ex, ey, ez = (
                        second[q, 0] - second[p, 0],
                        second[q, 1] - second[p, 1],
                        second[q, 2] - second[p, 2],
                    )
                    ox, oy, oz = (
                        second[o, 0] - second[p, 0],
                        second[o, 1] - second[p, 1],
                        second[o, 2] - second[p, 2],
                    )
                    vx, vy, vz = (
                        first[v, 0] - second[p, 0],
                        first[v, 1] - second[p, 1],
                        first[v, 2] - second[p, 2],
                    )
                nx, ny, nz = (
                    ey * axis[2] - ez * axis[1],
                    ez * axis[0] - ex * axis[2],
                    ex * axis[1] - ey * axis[0],
                )
                length = np.sqrt(nx * nx + ny * ny + nz * nz)
                own = ox * nx + oy * ny + oz * nz
                far = vx * nx + vy * ny + vz * nz
                least, most = min(least, far), max(most, far)
            if length == 0.0:
                continue
            low, high = min(0.0, own), max(0.0, own)
            if least > high + margin * length or most < low - margin * length:
                return True
    return False


@kernel
def find_seen(
    ground_face: Indices,
    where: NDArray[np.float32],
    rest: Vectors,
    metal: Indices,
    normals: Vectors,
    covering: Indices,
    has_moved: NDArray[np.bool_],
    first: NDArray[np.int64],
    reach: Indices,
    film: Vectors,
    faces: Indices,
    seen: Indices,
    seen_where: NDArray[np.float32],
    height: NDArray[np.float32],
    is_back: NDArray[np.bool_],
) -> None:
    """The film face that each texel shows, -1 for the metal, and where on it.

    ground_face (r, w), where (r, w, 2): the texel on the metal. Results of the same shape: seen, seen_where
    (weights of the second and third corner), height above the metal, and whether it shows its back.
    """
    rows, columns = ground_face.shape
    n = np.empty(3)
    for row in range(rows):
        for column in range(columns):
            g = ground_face[row, column]
            seen[row, column] = -1
            height[row, column] = 0.0
            is_back[row, column] = False
            if g < 0:
                continue
            v, w = np.float64(where[row, column, 0]), np.float64(where[row, column, 1])
            best, f = -_UNDER, covering[g]
            if f >= 0 and not has_moved[f]:
                best = 0.0
                seen[row, column] = f
                seen_where[row, column, 0], seen_where[row, column, 1] = v, w
            if first[g] == first[g + 1]:
                continue
            u = 1.0 - v - w
            a, b, c = metal[g, 0], metal[g, 1], metal[g, 2]
            px = u * rest[a, 0] + v * rest[b, 0] + w * rest[c, 0]
            py = u * rest[a, 1] + v * rest[b, 1] + w * rest[c, 1]
            pz = u * rest[a, 2] + v * rest[b, 2] + w * rest[c, 2]
            squared = 0.0
            for x in range(3):
                n[x] = u * normals[a, x] + v * normals[b, x] + w * normals[c, x]
                squared += n[x] * n[x]
            squared = np.sqrt(squared)
            if squared == 0.0:
                continue
            nx, ny, nz = n[0] / squared, n[1] / squared, n[2] / squared
            for k in range(first[g], first[g + 1]):
                f = reach[k]
                distance, p, q, facing = _meet(
                    film, faces[f, 0], faces[f, 1], faces[f, 2], px, py, pz, nx, ny, nz
                )
                if distance > best:
                    best = distance
                    seen[row, column] = f
                    seen_where[row, column, 0], seen_where[row, column, 1] = p, q
                    is_back[row, column] = facing < 0.0
            if seen[row, column] >= 0:
                height[row, column] = max(best, 0.0)


@kernel
def _meet(
    film: Vectors, a: int, b: int, c: int,
    px: float, py: float, pz: float,
    nx: float, ny: float, nz: float,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Distance along a line from p to a triangle, minus infinity where it misses, the weights of its second
    and third corner, and the sign of its normal along the line.

    Source: Moeller and Trumbore, Fast, minimum storage ray-triangle intersection, 1997.
    """
    ex, ey, ez = film[b, 0] - film[a, 0], film[b, 1] - film[a, 1], film[b, 2] - film[a, 2]
    fx, fy, fz = film[c, 0] - film[a, 0], film[c, 1] - film[a, 1], film[c, 2] - film[a, 2]
    hx, hy, hz = ny * fz - nz * fy, nz * fx - nx * fz, nx * fy - ny * fx
    determinant = ex * hx + ey * hy + ez * hz
    if determinant == 0.0:
        return -np.inf, 0.0, 0.0, 0.0
    tx, ty, tz = px - film[a, 0], py - film[a, 1], pz - film[a, 2]
    v = (tx * hx + ty * hy + tz * hz) / determinant
    if v < -1e-6 or v > 1.0 + 1e-6:
        return -np.inf, 0.0, 0.0, 0.0
    qx, qy, qz = ty * ez - tz * ey, tz * ex - tx * ez, tx * ey - ty * ex
    w = (nx * qx + ny * qy + nz * qz) / determinant
    if w < -1e-6 or v + w > 1.0 + 1e-6:
        return -np.inf, 0.0, 0.0, 0.0
    return (fx * qx + fy * qy + fz * qz) / determinant, v, w, -determinant
