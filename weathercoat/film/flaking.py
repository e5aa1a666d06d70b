"""Flaking: faces that nothing holds are gone (paper 5.3). It is the only operation that deletes geometry."""

from __future__ import annotations

import numpy as np

from weathercoat.compile import kernel
from weathercoat.film.fracture import break_edge
from weathercoat.film.state import FilmParameters, FilmRules, FilmState, make_film_rules
from weathercoat.mesh.halfedge import EventLog, HalfEdgeMesh, drop_face
from weathercoat.mesh.surface import Indices, Vectors


def flake(mesh: HalfEdgeMesh, state: FilmState, parameters: FilmParameters, age: float, log: EventLog) -> Vectors:
    """Let fall what nothing holds; appends to the log and returns the rest area of each flake, (k,), in square sizes.

    Literally only a face whose three edges are broken falls. By default a connected piece that no attached vertex holds
    falls as a whole, and so does one that hangs by less than a share of its outline: it tears off.
    """
    if parameters.flaking_rule == "faces":
        areas = np.empty(len(mesh.alive))
        return areas[: drop_loose_faces(mesh, log, areas)].copy()
    scratch = np.full(len(mesh.alive), -1, np.int32), np.empty(len(mesh.alive), np.int32), np.empty(len(mesh.alive))
    rules = make_film_rules(parameters)
    if parameters.flaking_hanging_share > 0.0:
        tear_hanging_pieces(mesh, state, rules, parameters.flaking_hanging_share, age, log, scratch[0], scratch[1])
        scratch[0][:] = -1
    return scratch[2][: drop_islands(mesh, state, log, *scratch)].copy()


@kernel
def rest_face_area(mesh: HalfEdgeMesh, f: int) -> float:
    """Area of face f at rest."""
    a = mesh.rest_positions[mesh.faces[f, 0]]
    b = mesh.rest_positions[mesh.faces[f, 1]]
    c = mesh.rest_positions[mesh.faces[f, 2]]
    normal = np.cross(b - a, c - a)
    return 0.5 * np.sqrt(np.dot(normal, normal))


@kernel
def rest_edge_length(mesh: HalfEdgeMesh, h: int) -> float:
    """Length of the edge of h at rest."""
    d = mesh.rest_positions[mesh.faces[h // 3, h % 3]] - mesh.rest_positions[mesh.faces[h // 3, (h + 1) % 3]]
    return np.sqrt(np.dot(d, d))


@kernel
def drop_loose_faces(mesh: HalfEdgeMesh, log: EventLog, areas: Vectors) -> int:
    """Delete each face whose three half-edges have no twin; their areas go to `areas`, their number is returned."""
    found = 0
    for f in range(len(mesh.alive)):
        h = 3 * f
        if mesh.alive[f] and mesh.twin[h] < 0 and mesh.twin[h + 1] < 0 and mesh.twin[h + 2] < 0:
            areas[found] = rest_face_area(mesh, f)
            found += 1
            drop_face(mesh, log, f)
    return found


@kernel
def is_free(mesh: HalfEdgeMesh, state: FilmState, f: int) -> bool:
    """Whether all three corners of face f have separated."""
    h = 3 * f
    separated = state.separated
    return separated[mesh.tail[h]] and separated[mesh.tail[h + 1]] and separated[mesh.tail[h + 2]]


@kernel
def drop_islands(
    mesh: HalfEdgeMesh, state: FilmState, log: EventLog, piece: Indices, queue: Indices, areas: Vectors
) -> int:
    """Delete each connected piece that has no attached vertex; returns their number, and their areas in `areas`.

    piece: scratch (m,) of -1; queue: scratch (m,).
    """
    found = 0
    for seed in range(len(mesh.alive)):
        if not mesh.alive[seed] or piece[seed] >= 0 or not is_free(mesh, state, seed):
            continue
        held = False
        area = 0.0
        queue[0] = seed
        piece[seed] = seed
        head, tail = 0, 1
        while head < tail:
            f = queue[head]
            head += 1
            area += rest_face_area(mesh, f)
            for h in range(3 * f, 3 * f + 3):
                g = mesh.twin[h]
                if g >= 0 and piece[g // 3] != seed:
                    if is_free(mesh, state, g // 3):
                        piece[g // 3] = seed
                        queue[tail] = g // 3
                        tail += 1
                    else:
                        held = True
        if not held:
            areas[found] = area
            found += 1
            for i in range(tail):
                drop_face(mesh, log, queue[i])
    return found


@kernel
def tear_hanging_pieces(
    mesh: HalfEdgeMesh,
    state: FilmState,
    rules: FilmRules,
    share: float,
    age: float,
    log: EventLog,
    piece: Indices,
    queue: Indices,
) -> None:
    """Break the last edges of each free piece that hangs by less than `share` of its outline.

    A piece is a connected set of faces whose corners have all separated; it hangs by the edges that it shares with faces
    that still have an attached corner. piece: scratch (m,) of -1; queue: scratch (m,).
    """
    stack = np.empty(len(mesh.twin), np.int32)
    for seed in range(len(mesh.alive)):
        if not mesh.alive[seed] or piece[seed] >= 0 or not is_free(mesh, state, seed):
            continue
        outline = 0.0
        hanging = 0.0
        queue[0] = seed
        piece[seed] = seed
        head, tail = 0, 1
        while head < tail:
            f = queue[head]
            head += 1
            for h in range(3 * f, 3 * f + 3):
                g = mesh.twin[h]
                if g < 0:
                    outline += rest_edge_length(mesh, h)
                elif not is_free(mesh, state, g // 3):
                    outline += rest_edge_length(mesh, h)
                    hanging += rest_edge_length(mesh, h)
                elif piece[g // 3] != seed:
                    piece[g // 3] = seed
                    queue[tail] = g // 3
                    tail += 1
        if 0.0 < hanging < share * outline:
            for i in range(tail):
                for h in range(3 * queue[i], 3 * queue[i] + 3):
                    g = mesh.twin[h]
                    if g >= 0 and not is_free(mesh, state, g // 3):
                        break_edge(mesh, state, rules, age, h, log, stack)
