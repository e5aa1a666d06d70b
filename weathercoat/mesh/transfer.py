"""What a new mesh takes over from the surface that it lies on: texture coordinates, normals, colours, parts.

A vertex of the new mesh may lie on a seam, where the input has several values. So each face of the new mesh
belongs to one chart of the input, that of the input's face under its centre, and each of its corners takes
its values from the nearest place that can be reached from there over no seam. Where the new mesh straddles a
seam, a corner lies beyond its chart and takes the nearest place at its border, since beyond the
border the texture shows something else. Normals have charts of their own, between hard edges.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.mesh.charts import find_jumps, find_seams
from weathercoat.mesh.projection import InputSurface, barycentric_of, closest_on_face
from weathercoat.mesh.surface import Indices, Place, Surface, Vectors

_SEARCHED = 96  # faces that are looked at round the one under a centre
_SMOOTH = 1e-3  # normals that differ by less are one


def transfer(
    result: Surface, given: Surface, source: InputSurface, below: Indices, place: Place, points: Vectors
) -> Surface:
    """The surface `result` of m faces and n vertices with what the surface `given`, the input, has.

    source: the input with its search tree, in the frame of the points (n, 3), which are the result's
    vertices. below: int32 (m,), a face of the input near each face, of the same group; place: of each vertex
    on the input.
    """
    uv = normals = colors = None
    group = given.face_group
    borders = np.repeat(group, 3) != np.where(source.twin >= 0, group[source.twin // 3], np.repeat(group, 3))
    if given.uv is not None:
        seams = find_seams(given.uv, source.twin) | borders
        corner = _find_corners(result.faces, source, seams, below, place, points, given.face_group)
        uv = blend(given.uv[corner.face], corner.barycentric).reshape(-1, 3, 2)
    if given.normals is not None:
        hard = find_jumps(given.normals, source.twin, _SMOOTH) | borders
        corner = _find_corners(result.faces, source, hard, below, place, points, given.face_group)
        normals = _unit(blend(given.normals[corner.face], corner.barycentric), source.normals[corner.face])
    if given.colors is not None:
        colors = blend(given.colors[given.faces[place.face]], place.barycentric)
    return replace(
        result,
        uv=uv,
        normals=None if normals is None else normals.reshape(-1, 3, 3),
        colors=colors,
        face_part=None if given.face_part is None else given.face_part[below],
    )


def _find_corners(
    faces: Indices,
    source: InputSurface,
    seams: NDArray[np.bool_],
    below: Indices,
    place: Place,
    points: Vectors,
    group: Indices,
) -> Place:
    """The place on the input from which each corner of the faces (m, 3) takes its values: 3 m of them."""
    face, barycentric = place.face[faces], place.barycentric[faces]
    touches = np.zeros(len(source.vertices), np.bool_)
    touches[source.faces.reshape(-1)[seams]] = True  # both ends, since the twin of a seam is one
    near_seam: NDArray[np.bool_] = np.any(touches[source.faces], axis=1)
    mixed = np.flatnonzero(np.any(near_seam[face], axis=1))
    if len(mixed):
        start, _ = source.closest(points[faces[mixed]].mean(axis=1), below[mixed])
        wrong = source.component[start] != source.component[below[mixed]]
        wrong |= group[start] != group[below[mixed]]
        start[wrong] = below[mixed][wrong]
        within = np.where(seams, np.int32(-1), source.twin)
        near, point = np.empty(3 * len(mixed), np.int32), np.empty((3 * len(mixed), 3))
        _search_all(
            points[faces[mixed].reshape(-1)], start, source.vertices, source.faces, within, near, point
        )
        face[mixed] = near.reshape(-1, 3)
        barycentric[mixed] = barycentric_of(point, source.vertices[source.faces[near]]).reshape(-1, 3, 3)
    return Place(face.reshape(-1), barycentric.reshape(-1, 3))


@kernel
def _search_all(
    goals: Vectors,
    start: Indices,
    vertices: Vectors,
    faces: Indices,
    twin: Indices,
    near: Indices,
    point: Vectors,
) -> None:
    """The nearest places to goals (3 k, 3), three for each face of `start` (k,), over the twins given."""
    seen = np.empty(_SEARCHED + 3, np.int32)
    distance = np.empty(_SEARCHED + 3)
    for k in range(len(goals)):
        near[k] = _search(goals[k], start[k // 3], vertices, faces, twin, seen, distance, point[k])


@kernel
def _search(
    goal: Vectors,
    start: int,
    vertices: Vectors,
    faces: Indices,
    twin: Indices,
    seen: Indices,
    distance: Vectors,
    out: Vectors,
) -> int:
    """The face nearest to a goal among those round `start`, the nearest ones first; its point goes to `out`
    (3,). Distances of faces that were passed through are marked by -1.
    """
    best, least = start, np.inf
    seen[0], count, through = start, 1, 0
    distance[0], out[0], out[1], out[2] = closest_on_face(goal, start, vertices, faces)
    least = distance[0]
    while least > 0.0:
        here = -1
        for i in range(count):
            if distance[i] >= 0.0 and (here < 0 or distance[i] < distance[here]):
                here = i
        if here < 0 or through == _SEARCHED // 3:
            break
        through += 1
        f = seen[here]
        distance[here] = -1.0
        for h in range(3 * f, 3 * f + 3):
            if twin[h] < 0:
                continue
            other, is_new = twin[h] // 3, True
            for i in range(count):
                is_new = is_new and seen[i] != other
            if is_new:
                seen[count] = other
                distance[count], x, y, z = closest_on_face(goal, other, vertices, faces)
                if distance[count] < least:
                    best, least = other, distance[count]
                    out[0], out[1], out[2] = x, y, z
                count += 1
    return best


def blend(corners: Vectors, barycentric: Vectors) -> Vectors:
    """Values (k, 3, j) at the corners of faces, blended by weights (k, 3); (k, j)."""
    weighted: Vectors = (
        corners[:, 0] * barycentric[:, :1]
        + corners[:, 1] * barycentric[:, 1:2]
        + corners[:, 2] * barycentric[:, 2:]
    )
    return weighted


def _unit(vectors: Vectors, instead: Vectors) -> Vectors:
    """Vectors (k, 3) of length 1; those of length 0 become those of `instead`."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(length > 0.0, vectors / np.where(length > 0.0, length, 1.0), instead)
