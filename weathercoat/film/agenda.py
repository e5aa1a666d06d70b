"""The agenda of failure: which vertices and edges are to be tested in which step, so that the others cost
nothing.

Between events all that decides ages by closed forms which are monotone: tension goes to its cap, adhesion and
bonds fall. Whoever has just been tested can therefore be asked how far ahead it surely holds, with the
largest load and the least resistance between now and then, and need not be looked at before. Then the exact
test decides. It may come too early, which costs a little, and never too late, which would change the result:

    due:   test exactly -> fails:  separates or breaks
                        -> holds:  looks ahead by 1,024, 512, 256, ... steps; due again where it may fail
    event: whatever could make a vertex or an edge fail sooner than foreseen makes it due at once

The events are few and known: an edge may break from when both its ends have separated; sooner than foreseen
where one of its faces frays, where an end becomes a tip, and at a tip where a face is relieved in another
direction. Relaxation lowers tension below what was foreseen, so it can wait. Vertices round which something
has moved follow no closed form: they are the fringe, and all of them are tested in every step.

The agenda is no part of the state: `make_agenda` makes it from the state at any time, with everything due,
and the results are the same.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.film.calendar import make_calendar, put
from weathercoat.film.state import FilmRules, FilmState
from weathercoat.mesh.halfedge import HalfEdgeMesh
from weathercoat.mesh.surface import Indices, Vectors

# What a bound is wide of the mark, relative and, for tensions of order 1, absolute: far more than the
# round-off of the closed forms, far less than what would cost a needless test.
SLACK = 1e-9

_EVEN = 1e-6  # of a tick by which steps may come earlier or later than evenly: ages are rounded


STEP, FRINGE, MARK = 0, 1, 2  # in `Agenda.counts`
OUTSIDE, TO_PACK, PACKED = 0, 1, 2  # in `Agenda.membership`
PACKED_HINGES = 8  # of a vertex of the fringe; more are rare, and then bounded by the most that a hinge lifts


class Agenda(NamedTuple):
    """What the failure of the film has to look at, and how far it is. n0 rest vertices, m faces.

    vertices: calendar of the attached ones round which nothing has moved; edges: calendar of those with both
    ends separated, by their smaller half-edge. ages: (2,), age of the step and age between two steps. counts:
    int64 (3,), the step, the length of the fringe, and the last mark.

    fringe: int32 (n0,), of which counts[1] are in use, the attached vertices that are tested in every step.
    membership: int8 (n0,), OUTSIDE of it, TO_PACK, or PACKED, when the same rows of these, made by
    `pack_hinges`, are up to date: hinges, int32 (n0, 8, 4), and sums, (n0, 4).

    attached_corners: int8 (m,), corners that have not separated. face_centre: (m, 3), at rest.
    relief_distance: (m,), a crack at this distance or farther cannot lower the face's cap. marks: int64 (m,),
    the last flood of flaking that met the face. all_faces: bool (1,), whether flaking has to look at all
    faces. area: of the film. found: int32 (6 m,), stack: int32 (3 m,) and values: (3 m,) are scratch.
    """

    vertices: Indices
    edges: Indices
    ages: Vectors
    counts: NDArray[np.int64]
    fringe: Indices
    membership: NDArray[np.int8]
    hinges: Indices
    sums: Vectors
    attached_corners: NDArray[np.int8]
    face_centre: Vectors
    relief_distance: Vectors
    marks: NDArray[np.int64]
    all_faces: NDArray[np.bool_]
    area: float
    found: Indices
    stack: Indices
    values: Vectors


def make_agenda(mesh: HalfEdgeMesh, state: FilmState, rules: FilmRules) -> Agenda:
    """The agenda for a state of the film, with everything due at the next step.

    To be made anew after any change of the state other than by `separate`, `fracture` and `flake`.
    """
    face_count, rest_count = len(mesh.alive), len(mesh.rest_positions)
    corner = mesh.rest_positions[mesh.faces]
    across = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    return Agenda(
        vertices=make_calendar(rest_count),
        edges=make_calendar(3 * face_count),
        ages=np.full(2, np.nan),
        counts=np.zeros(3, np.int64),
        fringe=np.empty(rest_count, np.int32),
        membership=np.zeros(rest_count, np.int8),
        hinges=np.empty((rest_count, PACKED_HINGES, 4), np.int32),
        sums=np.empty((rest_count, 4)),
        attached_corners=np.sum(~state.separated[mesh.tail.reshape(-1, 3)], axis=1, dtype=np.int8),
        face_centre=(corner[:, 0] + corner[:, 1] + corner[:, 2]) / 3.0,
        relief_distance=_relief_distances(state, rules),
        marks=np.zeros(face_count, np.int64),
        all_faces=np.ones(1, np.bool_),
        area=0.5 * float(np.sum(np.linalg.norm(across, axis=1))),
        found=np.empty(6 * face_count, np.int32),
        stack=np.empty(3 * face_count, np.int32),
        values=np.empty(3 * face_count),
    )


def _relief_distances(state: FilmState, rules: FilmRules) -> Vectors:
    """The distance of the crack that left each face its cap, infinite where none did."""
    left = 1.0 - state.tension_cap
    distance = np.full(len(left), np.inf)
    relieved = left > 0.0
    distance[relieved] = -rules.shear_lag * np.log(left[relieved])
    return distance


def forget_forecasts(agenda: Agenda) -> None:
    """Have all tested at the next step, as after a change of what the film holds with."""
    agenda.ages[:] = np.nan


@kernel
def _put_all(mesh: HalfEdgeMesh, state: FilmState, rules: FilmRules, agenda: Agenda) -> None:
    step = agenda.counts[STEP] + 1
    agenda.counts[FRINGE] = 0
    agenda.membership[:] = OUTSIDE
    for v in range(len(agenda.fringe)):
        if state.separated[v] or mesh.half_edge[v] < 0:
            continue
        if rules.lifts_by_face or state.disturbed[v]:
            join_fringe(v, agenda.fringe, agenda.membership, agenda.counts)
        else:
            put(agenda.vertices, v, step)
    for h in range(len(mesh.twin)):
        g = mesh.twin[h]
        if g > h and state.separated[mesh.tail[h]] and state.separated[mesh.tail[g]]:
            put(agenda.edges, h, step)


@kernel
def begin_step(
    mesh: HalfEdgeMesh, state: FilmState, rules: FilmRules, agenda: Agenda, age: float, tick: float
) -> None:
    """Go on to the next step; all is due in it unless it comes one tick after the last one, as foreseen."""
    was_foreseen = tick == agenda.ages[1] and abs(age - agenda.ages[0] - tick) < _EVEN * tick
    if not was_foreseen:
        _put_all(mesh, state, rules, agenda)
    agenda.ages[0], agenda.ages[1] = age, tick
    agenda.counts[STEP] += 1


@kernel
def join_fringe(v: int, fringe: Indices, membership: NDArray[np.int8], counts: NDArray[np.int64]) -> None:
    """Take the attached vertex v to the fringe; one that is there already is packed anew."""
    if membership[v] == OUTSIDE:
        fringe[counts[FRINGE]] = v
        counts[FRINGE] += 1
    membership[v] = TO_PACK


@kernel
def call_edge(edges: Indices, twin: Indices, h: int, step: int) -> None:
    """Have the edge of h, if it is whole, tested at a step: it may break sooner than foreseen."""
    g = twin[h]
    if g >= 0:
        put(edges, min(h, g), step)
