"""Flaking: faces that nothing holds are gone (paper 5.3). It is the only operation that deletes geometry.

Film can only fall where a vertex separated or an edge broke in the same step, so only the pieces there are
looked at, and of a piece only as much as it takes to see that it hangs by enough. What may fall is then
weighed whole, in the order of its faces from the smallest one.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.film.agenda import MARK, SLACK, Agenda
from weathercoat.film.fracture import break_edge
from weathercoat.film.state import FilmParameters, FilmRules, FilmState, make_film_rules
from weathercoat.mesh.halfedge import EventLog, HalfEdgeMesh, drop_face, prev_of
from weathercoat.mesh.surface import Indices, Vectors


def flake(
    mesh: HalfEdgeMesh,
    state: FilmState,
    agenda: Agenda,
    parameters: FilmParameters,
    age: float,
    separating: Indices,
    log: EventLog,
) -> Vectors:
    """Let fall what nothing holds; appends to the log and returns the rest area of each flake, (k,), in
    square sizes.

    Literally only a face whose three edges are broken falls. By default a connected piece that no attached
    vertex holds falls as a whole, and so does one that hangs by less than a share of its girth: it tears off.
    separating: the vertices that separated in this step; log: all that broke in it. Nothing can fall in a
    step in which nothing broke and no vertex separated. Ends the step.
    """
    if len(separating) == 0 and log.counts[1] == 0:
        return agenda.values[:0].copy()
    found = _flake(mesh, state, make_film_rules(parameters), agenda, age, separating, log)
    return agenda.values[:found].copy()


@kernel
def _flake(
    mesh: HalfEdgeMesh,
    state: FilmState,
    rules: FilmRules,
    agenda: Agenda,
    age: float,
    separating: Indices,
    log: EventLog,
) -> int:
    """As `flake`; the areas are in agenda.values, their number is returned."""
    if not rules.drops_islands:
        found = drop_loose_faces(mesh, agenda, log)
    else:
        count = find_doubtful_pieces(mesh, state, rules, agenda, separating, log)
        if rules.hanging_share > 0.0:
            tear_hanging_pieces(mesh, state, rules, agenda, count, age, log)
        found = drop_islands(mesh, agenda, count, log)
    agenda.all_faces[0] = False
    return found


@kernel
def rest_edge_length(rest_positions: Vectors, faces: Indices, h: int) -> float:
    """Length of the edge of half-edge h at rest."""
    a, b = faces[h // 3, h % 3], faces[h // 3, (h + 1) % 3]
    squared = 0.0
    for axis in range(3):
        side = rest_positions[a, axis] - rest_positions[b, axis]
        squared += side * side
    return math.sqrt(squared)


@kernel
def rest_face_area(rest_positions: Vectors, faces: Indices, f: int) -> float:
    """Area of face f at rest."""
    a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
    squared = 0.0
    for axis in range(3):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        ui, uj = rest_positions[b, i] - rest_positions[a, i], rest_positions[b, j] - rest_positions[a, j]
        vi, vj = rest_positions[c, i] - rest_positions[a, i], rest_positions[c, j] - rest_positions[a, j]
        across = ui * vj - uj * vi
        squared += across * across
    return 0.5 * math.sqrt(squared)


@kernel
def girth(area: float) -> float:
    """Outline of a disc of an area."""
    return 2.0 * math.sqrt(math.pi * area)


@kernel
def drop_loose_faces(mesh: HalfEdgeMesh, agenda: Agenda, log: EventLog) -> int:
    """Delete each face whose three half-edges have no twin; their areas go to agenda.values, their number is
    returned.
    """
    faces = agenda.found
    count = 0
    if agenda.all_faces[0]:
        count = len(mesh.alive)
        for f in range(count):
            faces[f] = f
    else:
        for i in range(log.counts[1]):
            for side in range(2):
                faces[count] = log.breaks[i, side] // 3
                count += 1
        faces[:count].sort()
    found = 0
    for f in faces[:count]:
        h = 3 * f
        if mesh.alive[f] and mesh.twin[h] < 0 and mesh.twin[h + 1] < 0 and mesh.twin[h + 2] < 0:
            agenda.values[found] = rest_face_area(mesh.rest_positions, mesh.faces, f)
            found += 1
            drop_face(mesh, log, f)
    return found


@kernel
def find_doubtful_pieces(
    mesh: HalfEdgeMesh,
    state: FilmState,
    rules: FilmRules,
    agenda: Agenda,
    separating: Indices,
    log: EventLog,
) -> int:
    """Collect in agenda.found, ascending, the smallest face of each piece of free film that may fall, of all
    that the events of this step have touched; returns how many.

    A face is free when its three corners have separated.
    """
    twin, attached_corners, marks, queue = mesh.twin, agenda.attached_corners, agenda.marks, agenda.stack
    rest_positions, faces, pieces = mesh.rest_positions, mesh.faces, agenda.found
    share = rules.hanging_share
    first_mark = mark = agenda.counts[MARK] + 1
    count = 0
    for f in pieces[: find_touched_faces(mesh, state, agenda, separating, log)]:
        if attached_corners[f] > 0 or marks[f] >= first_mark or not mesh.alive[f]:
            continue
        smallest = judge_piece(
            f,
            twin,
            attached_corners,
            rest_positions,
            faces,
            share,
            agenda.area,
            marks,
            mark,
            first_mark,
            queue,
        )
        mark += 1
        if smallest >= 0:
            pieces[count] = smallest
            count += 1
    agenda.counts[MARK] = mark
    pieces[:count].sort()
    return count


@kernel
def find_touched_faces(
    mesh: HalfEdgeMesh, state: FilmState, agenda: Agenda, separating: Indices, log: EventLog
) -> int:
    """Collect in agenda.found faces of all pieces of free film that this step may have changed; returns how
    many.

    A new free face is round a vertex that separated, or round a copy that was split off one since. A piece
    that came apart, or lost an edge that it hung by, has a face at a broken edge.
    """
    twin, half_edge, out = mesh.twin, mesh.half_edge, agenda.found
    count = 0
    if agenda.all_faces[0]:
        for f in range(len(mesh.alive)):
            out[f] = f
        return len(mesh.alive)
    for v in separating:
        count = append_faces_round(half_edge[v], twin, out, count)
    for i in range(log.counts[0]):
        count = append_faces_round(half_edge[log.splits[i, 0]], twin, out, count)
    for i in range(log.counts[1]):
        h, g = log.breaks[i, 0], log.breaks[i, 1]
        if not (
            is_bridged(mesh, state, agenda, mesh.tail[h]) or is_bridged(mesh, state, agenda, mesh.tail[g])
        ):
            out[count] = h // 3
            out[count + 1] = g // 3
            count += 2
    return count


@kernel
def append_faces_round(first: int, twin: Indices, out: Indices, count: int) -> int:
    """Append the faces of the fan that begins with half-edge `first` to the `count` in out; returns how many
    there are then.
    """
    leaving = first
    while leaving >= 0:
        out[count] = leaving // 3
        count += 1
        leaving = twin[prev_of(leaving)]
        if leaving == first:
            break
    return count


@kernel
def is_bridged(mesh: HalfEdgeMesh, state: FilmState, agenda: Agenda, v: int) -> bool:
    """Whether v is the tip of a crack and all faces round it are free: they hang together round the tip."""
    if not state.is_tip[v]:
        return False
    leaving = mesh.half_edge[v]
    while leaving >= 0:
        if agenda.attached_corners[leaving // 3] > 0:
            return False
        leaving = mesh.twin[prev_of(leaving)]
    return True


@kernel
def judge_piece(
    start: int,
    twin: Indices,
    attached_corners: NDArray[np.int8],
    rest_positions: Vectors,
    faces: Indices,
    share: float,
    film_area: float,
    marks: NDArray[np.int64],
    mark: int,
    first_mark: int,
    queue: Indices,
) -> int:
    """The smallest face of the piece of free film that holds face `start`, or -1 where it holds for certain.

    Marks from `first_mark` on are those of this step. A flood that meets another one of the step has run into
    a piece that was left early, so that holds. No piece is larger than the whole film.
    """
    enough = share * girth(film_area) * (1.0 + SLACK) if share > 0.0 else -1.0
    marks[start] = mark
    queue[0] = start
    first, last = 0, 1
    smallest = start
    hanging = 0.0
    is_held = False
    while first < last:
        f = queue[first]
        first += 1
        smallest = min(smallest, f)
        for h in range(3 * f, 3 * f + 3):
            if twin[h] < 0:
                continue
            g = twin[h] // 3
            if attached_corners[g] > 0:
                is_held = True
                hanging += rest_edge_length(rest_positions, faces, h)
                if hanging > enough:
                    return -1
            elif marks[g] < first_mark:
                marks[g] = mark
                queue[last] = g
                last += 1
            elif marks[g] != mark:
                return -1
    if is_held:
        area = 0.0
        for f in queue[:last]:
            area += rest_face_area(rest_positions, faces, f)
        if hanging > share * girth(area) * (1.0 + SLACK):
            return -1
    return smallest


@kernel
def collect_piece(mesh: HalfEdgeMesh, agenda: Agenda, smallest: int) -> tuple[int, bool]:
    """Collect a piece of free film in agenda.stack, breadth first from its smallest face.

    Returns the number of its faces, and whether it touches one with an attached corner.
    """
    twin, attached_corners, marks, queue = mesh.twin, agenda.attached_corners, agenda.marks, agenda.stack
    agenda.counts[MARK] += 1
    mark = agenda.counts[MARK]
    is_held = False
    queue[0] = smallest
    marks[smallest] = mark
    first, last = 0, 1
    while first < last:
        f = queue[first]
        first += 1
        for h in range(3 * f, 3 * f + 3):
            if twin[h] < 0:
                continue
            g = twin[h] // 3
            if attached_corners[g] > 0:
                is_held = True
            elif marks[g] != mark:
                marks[g] = mark
                queue[last] = g
                last += 1
    return last, is_held


@kernel
def tear_hanging_pieces(
    mesh: HalfEdgeMesh,
    state: FilmState,
    rules: FilmRules,
    agenda: Agenda,
    count: int,
    age: float,
    log: EventLog,
) -> None:
    """Break the last edges of those of the `count` pieces in agenda.found that hang by less than the share of
    the girth of their area.

    A piece hangs by the edges that it shares with faces that still have an attached corner. Its girth is the
    outline of a disc of its area: its own outline would count all cracks within it, and a wide web of film
    that many points hold would fall at once.
    """
    twin, attached_corners = mesh.twin, agenda.attached_corners
    for smallest in agenda.found[:count]:
        size, is_held = collect_piece(mesh, agenda, smallest)
        if not is_held:
            continue
        area = 0.0
        hanging = 0.0
        for f in agenda.stack[:size]:
            area += rest_face_area(mesh.rest_positions, mesh.faces, f)
            for h in range(3 * f, 3 * f + 3):
                if twin[h] >= 0 and attached_corners[twin[h] // 3] > 0:
                    hanging += rest_edge_length(mesh.rest_positions, mesh.faces, h)
        if hanging >= rules.hanging_share * girth(area):
            continue
        for f in agenda.stack[:size].copy():  # breaks use the stack
            for h in range(3 * f, 3 * f + 3):
                if twin[h] >= 0 and attached_corners[twin[h] // 3] > 0:
                    break_edge(mesh, state, rules, agenda, age, h, log)


@kernel
def drop_islands(mesh: HalfEdgeMesh, agenda: Agenda, count: int, log: EventLog) -> int:
    """Delete those of the `count` pieces in agenda.found that have no attached vertex; their areas go to
    agenda.values, their number is returned.
    """
    found = 0
    for smallest in agenda.found[:count]:
        size, is_held = collect_piece(mesh, agenda, smallest)
        if is_held:
            continue
        area = 0.0
        for f in agenda.stack[:size]:
            area += rest_face_area(mesh.rest_positions, mesh.faces, f)
            drop_face(mesh, log, f)
        agenda.values[found] = area
        found += 1
    return found
