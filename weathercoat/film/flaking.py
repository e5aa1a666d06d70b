"""Flaking: faces that nothing holds are gone (paper 5.3). It is the only operation that deletes geometry."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.film.fracture import break_edge
from weathercoat.film.state import FilmParameters, FilmRules, FilmState, make_film_rules
from weathercoat.mesh.halfedge import EventLog, HalfEdgeMesh, drop_face
from weathercoat.mesh.surface import Indices, Vectors


def flake(
    mesh: HalfEdgeMesh, state: FilmState, parameters: FilmParameters, age: float, released: int, log: EventLog
) -> Vectors:
    """Let fall what nothing holds; appends to the log and returns the rest area of each flake, (k,), in
    square sizes.

    Literally only a face whose three edges are broken falls. By default a connected piece that no attached
    vertex holds falls as a whole, and so does one that hangs by less than a share of its girth: it tears off.
    Nothing can fall in a step in which nothing broke and no vertex was released.
    """
    face_count = len(mesh.alive)
    areas = np.empty(face_count)
    if released == 0 and log.counts[1] == 0:
        return areas[:0]
    if parameters.flaking_rule == "faces":
        return areas[: drop_loose_faces(mesh, log, areas)].copy()
    free, seen = np.empty(face_count, np.bool_), np.empty(face_count, np.bool_)
    queue = np.empty(face_count, np.int32)
    find_free_faces(mesh, state, free)
    if parameters.flaking_hanging_share > 0.0:
        rules = make_film_rules(parameters)
        tear_hanging_pieces(mesh, state, rules, parameters.flaking_hanging_share, age, log, free, seen, queue)
    return areas[: drop_islands(mesh, log, free, seen, queue, areas)].copy()


@kernel
def rest_edge_length(mesh: HalfEdgeMesh, h: int) -> float:
    """Length of the edge of half-edge h at rest."""
    a, b = mesh.faces[h // 3, h % 3], mesh.faces[h // 3, (h + 1) % 3]
    squared = 0.0
    for axis in range(3):
        squared += (mesh.rest_positions[a, axis] - mesh.rest_positions[b, axis]) ** 2
    return math.sqrt(squared)


@kernel
def rest_face_area(mesh: HalfEdgeMesh, f: int) -> float:
    """Area of face f at rest."""
    a, b, c = mesh.faces[f, 0], mesh.faces[f, 1], mesh.faces[f, 2]
    squared = 0.0
    for axis in range(3):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        ui, uj = (
            mesh.rest_positions[b, i] - mesh.rest_positions[a, i],
            mesh.rest_positions[b, j] - mesh.rest_positions[a, j],
        )
        vi, vj = (
            mesh.rest_positions[c, i] - mesh.rest_positions[a, i],
            mesh.rest_positions[c, j] - mesh.rest_positions[a, j],
        )
        squared += (ui * vj - uj * vi) ** 2
    return 0.5 * math.sqrt(squared)


@kernel
def drop_loose_faces(mesh: HalfEdgeMesh, log: EventLog, areas: Vectors) -> int:
    """Delete each face whose three half-edges have no twin; their areas go to `areas`, their number is
    returned.
    """
    found = 0
    for f in range(len(mesh.alive)):
        h = 3 * f
        if mesh.alive[f] and mesh.twin[h] < 0 and mesh.twin[h + 1] < 0 and mesh.twin[h + 2] < 0:
            areas[found] = rest_face_area(mesh, f)
            found += 1
            drop_face(mesh, log, f)
    return found


@kernel
def find_free_faces(mesh: HalfEdgeMesh, state: FilmState, free: NDArray[np.bool_]) -> None:
    """Mark in free (m,) the live faces whose three corners have separated."""
    tail, alive, separated = mesh.tail, mesh.alive, state.separated
    for f in range(len(free)):
        h = 3 * f
        free[f] = alive[f] and separated[tail[h]] and separated[tail[h + 1]] and separated[tail[h + 2]]


@kernel
def collect_piece(
    seed: int, twin: Indices, free: NDArray[np.bool_], seen: NDArray[np.bool_], queue: Indices
) -> tuple[int, bool]:
    """Collect the connected free faces round `seed` in queue and mark them seen.

    Returns their number, and whether they touch a face that is not free: one with an attached corner.
    """
    held = False
    queue[0] = seed
    seen[seed] = True
    first, last = 0, 1
    while first < last:
        f = queue[first]
        first += 1
        for h in range(3 * f, 3 * f + 3):
            g = twin[h]
            if g < 0:
                continue
            if not free[g // 3]:
                held = True
            elif not seen[g // 3]:
                seen[g // 3] = True
                queue[last] = g // 3
                last += 1
    return last, held


@kernel
def drop_islands(
    mesh: HalfEdgeMesh,
    log: EventLog,
    free: NDArray[np.bool_],
    seen: NDArray[np.bool_],
    queue: Indices,
    areas: Vectors,
) -> int:
    """Delete each connected piece that has no attached vertex; returns their number, and their areas in
    `areas`.

    free: (m,) of `find_free_faces`; seen, queue: scratch (m,).
    """
    twin = mesh.twin
    seen[:] = False
    found = 0
    for seed in range(len(free)):
        if seen[seed] or not free[seed]:
            continue
        count, held = collect_piece(seed, twin, free, seen, queue)
        if held:
            continue
        areas[found] = 0.0
        for i in range(count):
            areas[found] += rest_face_area(mesh, queue[i])
            drop_face(mesh, log, queue[i])
        found += 1
    return found


@kernel
def tear_hanging_pieces(
    mesh: HalfEdgeMesh,
    state: FilmState,
    rules: FilmRules,
    share: float,
    age: float,
    log: EventLog,
    free: NDArray[np.bool_],
    seen: NDArray[np.bool_],
    queue: Indices,
) -> None:
    """Break the last edges of each free piece that hangs by less than `share` of the girth of its area.

    A piece hangs by the edges that it shares with faces that still have an attached corner. Its girth is the
    outline of a disc of its area: its own outline would count all cracks within it, and a wide web of film
    that many points hold would fall at once. free: (m,) of `find_free_faces`; seen, queue: scratch (m,).
    """
    twin = mesh.twin
    stack = np.empty(len(twin), np.int32)
    seen[:] = False
    for seed in range(len(free)):
        if seen[seed] or not free[seed]:
            continue
        count, held = collect_piece(seed, twin, free, seen, queue)
        if not held:
            continue
        area = 0.0
        hanging = 0.0
        for i in range(count):
            area += rest_face_area(mesh, queue[i])
            for h in range(3 * queue[i], 3 * queue[i] + 3):
                if twin[h] >= 0 and not free[twin[h] // 3]:
                    hanging += rest_edge_length(mesh, h)
        if hanging >= share * 2.0 * math.sqrt(math.pi * area):
            continue
        for i in range(count):
            for h in range(3 * queue[i], 3 * queue[i] + 3):
                if twin[h] >= 0 and not free[twin[h] // 3]:
                    break_edge(mesh, state, rules, age, h, log, stack)
