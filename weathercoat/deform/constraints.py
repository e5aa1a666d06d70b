"""What holds the separated film in shape: which lengths and angles are active, and what they aim at."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.deform.runs import LANES, Runs, activate, deactivate, end_constraint, make_runs
from weathercoat.deform.seats import Seats, let_be, let_move, make_seats, take_seat
from weathercoat.mesh.dihedral import half_edge_bend
from weathercoat.mesh.halfedge import EventLog, HalfEdgeMesh, next_of, prev_of
from weathercoat.mesh.surface import Indices, Vectors


class Constraints(NamedTuple):
    """The state of the constraints and, derived from it and from the mesh, the packed active ones.

    Half-edges, by the smaller one of a pair: rest_length (3 m,) [sizes]; span (3 m,), the distance between
    the centres of the two faces at rest; angle_start (3 m,), the bend when the angle constraint was made, NaN
    without one; angle_age (3 m,). Vertices: inverse_mass (3 m,), 1 once separated, 0 again while it sleeps;
    asleep bool (3 m,).
    """

    rest_length: Vectors
    span: Vectors
    angle_start: Vectors
    angle_age: Vectors
    inverse_mass: Vectors
    asleep: NDArray[np.bool_]
    lengths: Runs
    angles: Runs
    seats: Seats


def make_constraints(mesh: HalfEdgeMesh) -> Constraints:
    """No constraint yet, with all that they will need from the rest surface; of an unbroken mesh."""
    corner = mesh.rest_positions[mesh.faces]
    rest_length = np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2).reshape(-1)
    centre = np.repeat(corner.mean(axis=1), 3, axis=0)
    twin = mesh.twin
    paired = twin >= 0
    span = np.zeros(len(twin))
    span[paired] = np.linalg.norm(centre[paired] - centre[twin[paired]], axis=1)
    half_edges = np.arange(len(twin), dtype=np.int32)
    tail = mesh.faces.reshape(-1)
    head = np.roll(mesh.faces, -1, axis=1).reshape(-1)
    apex = np.roll(mesh.faces, -2, axis=1).reshape(-1)
    hinges = np.flatnonzero(paired & (half_edges < twin)).astype(np.int32)
    hinge_of = np.full(len(twin), -1, np.int32)
    hinge_of[hinges] = hinge_of[twin[hinges]] = np.arange(len(hinges), dtype=np.int32)
    corners = np.stack([tail[hinges], head[hinges], apex[hinges], apex[twin[hinges]]], axis=1)
    rest_count = len(mesh.rest_positions)
    return Constraints(
        rest_length=rest_length,
        span=span,
        angle_start=np.full(len(twin), np.nan),
        angle_age=np.zeros(len(twin)),
        inverse_mass=np.zeros(len(twin)),
        asleep=np.zeros(len(twin), np.bool_),
        lengths=make_runs(half_edges, np.stack([tail, head], axis=1), half_edges, rest_count, 0),
        angles=make_runs(hinges, corners, hinge_of, rest_count, 3),
        seats=make_seats(mesh),
    )


def release(mesh: HalfEdgeMesh, constraints: Constraints, vertices: Indices, age: float) -> None:
    """Let vertices move that have separated: angle constraints on the edges opposite to them, from their
    present bend.

    The lengths of their edges are held from now on; no end of such an edge had moved before, so that is the
    rest length. A constraint that exists already keeps its start.
    """
    if len(vertices) > 0:
        _release(mesh, constraints, vertices, age)


def follow_events(mesh: HalfEdgeMesh, constraints: Constraints, log: EventLog) -> None:
    """Bring the constraints up to date with a step's log.

    A broken edge loses its angle constraint, and each half-edge keeps a length constraint of its own. Parents
    of copies may be copies of the same step, but all of them have separated.
    """
    if log.counts.any():
        _follow_events(mesh, constraints, log)


@kernel
def _release(mesh: HalfEdgeMesh, constraints: Constraints, vertices: Indices, age: float) -> None:
    angle_start = constraints.angle_start
    for v in vertices:
        constraints.inverse_mass[v] = 1.0
        let_move(mesh, constraints.seats, v)
        first = mesh.half_edge[v]
        leaving = first
        while leaving >= 0:
            h = next_of(leaving)
            g = mesh.twin[h]
            edge = min(h, g)
            if g >= 0 and math.isnan(angle_start[edge]):
                angle_start[edge] = half_edge_bend(h, mesh.positions, mesh.tail, mesh.twin)
                constraints.angle_age[edge] = age
            leaving = mesh.twin[prev_of(leaving)]
            if leaving == first:
                break
    rouse(mesh, constraints, vertices)
    refresh_round(mesh, constraints, vertices)


@kernel
def _follow_events(mesh: HalfEdgeMesh, constraints: Constraints, log: EventLog) -> None:
    lengths, angles, seats = constraints.lengths, constraints.angles, constraints.seats
    touched = np.empty(4 * log.counts[1] + log.counts[0], np.int32)
    count = 0
    for i in range(log.counts[1]):
        h, g = log.breaks[i, 0], log.breaks[i, 1]
        constraints.angle_start[min(h, g)] = np.nan
        end_constraint(angles, angles.slot[h])
        for v in (mesh.tail[h], mesh.tail[next_of(h)], mesh.tail[g], mesh.tail[next_of(g)]):
            touched[count] = v
            count += 1
    for i in range(log.counts[0]):
        touched[count] = log.splits[i, 0]
        count += 1
    # film falls alone or with all that it hangs together with, so what falls has no live neighbour
    for i in range(log.counts[2]):
        for h in range(3 * log.falls[i], 3 * log.falls[i] + 3):
            end_constraint(lengths, lengths.slot[h])
            if angles.slot[h] >= 0:
                end_constraint(angles, angles.slot[h])
            let_be(seats, mesh.tail[h])
    wake(mesh, constraints, touched)
    rouse(mesh, constraints, touched)
    refresh_round(mesh, constraints, touched)


@kernel
def repack(mesh: HalfEdgeMesh, constraints: Constraints) -> None:
    """Fill the lanes of all active constraints, and the planes of what moves, from the state; they keep their
    lanes and seats.
    """
    used = mesh.used[0]
    moving = np.flatnonzero((constraints.inverse_mass[:used] > 0.0) & (mesh.half_edge[:used] >= 0))
    for v in moving:
        let_move(mesh, constraints.seats, v)
    refresh_round(mesh, constraints, moving.astype(np.int32))


@kernel
def wake(mesh: HalfEdgeMesh, constraints: Constraints, vertices: Indices) -> None:
    """Let film vertices move that have separated, sleepers and new copies among them; not yet packed."""
    for v in vertices:
        if mesh.half_edge[v] >= 0:
            constraints.asleep[v] = False
            constraints.inverse_mass[v] = 1.0
            let_move(mesh, constraints.seats, v)


@kernel
def rouse(mesh: HalfEdgeMesh, constraints: Constraints, vertices: Indices) -> None:
    """Wake the sleepers that constraints connect with one of the vertices, and pack what they are part of."""
    tail, twin, half_edge, asleep = mesh.tail, mesh.twin, mesh.half_edge, constraints.asleep
    if not asleep[: mesh.used[0]].any():
        return
    reached = np.empty(len(vertices) + mesh.used[0], np.int32)
    reached[: len(vertices)] = vertices
    count = len(vertices)
    following = 0
    while following < count:
        v = reached[following]
        following += 1
        leaving = half_edge[v]
        while leaving >= 0:
            h = next_of(leaving)
            across = tail[prev_of(twin[h])] if twin[h] >= 0 else v
            for other in (tail[h], tail[next_of(h)], across):
                if asleep[other]:
                    asleep[other] = False
                    reached[count] = other
                    count += 1
            leaving = twin[prev_of(leaving)]
            if leaving == half_edge[v]:
                break
    woken = reached[len(vertices) : count]
    wake(mesh, constraints, woken)
    refresh_round(mesh, constraints, woken)


@kernel
def refresh_round(mesh: HalfEdgeMesh, constraints: Constraints, centres: Indices) -> None:
    """Pack anew every constraint that one of the vertices takes part in."""
    tail, twin, half_edge = mesh.tail, mesh.twin, mesh.half_edge
    mass, rest_length, span = constraints.inverse_mass, constraints.rest_length, constraints.span
    start, since = constraints.angle_start, constraints.angle_age
    lengths, angles = constraints.lengths, constraints.angles
    l_slot, l_run, l_first, l_filled = lengths.slot, lengths.run, lengths.first_block, lengths.filled
    l_lane, l_slot_at, l_seats, l_moves = lengths.lane, lengths.slot_at, lengths.seats, lengths.moves
    l_data, l_target = lengths.data, lengths.target
    a_slot, a_run, a_first, a_filled = angles.slot, angles.run, angles.first_block, angles.filled
    a_lane, a_slot_at, a_seats, a_moves = angles.lane, angles.slot_at, angles.seats, angles.moves
    a_data, a_target = angles.data, angles.target
    origin, seat, vertex = mesh.origin, constraints.seats.seat, constraints.seats.vertex
    s_first, s_filled = constraints.seats.first, constraints.seats.filled
    corners = np.empty(4, np.int32)
    for v in centres:
        leaving = half_edge[v]
        while leaving >= 0:
            arriving = prev_of(leaving)
            # of a fan that is open, the last half-edge has no leaving one beside it
            for side in range(3 if twin[arriving] < 0 else 2):
                h = leaving if side == 0 else (next_of(leaving) if side == 1 else arriving)
                g = twin[h]
                if 0 <= g < h:
                    h, g = g, h
                corners[0], corners[1], corners[2] = tail[h], tail[next_of(h)], tail[prev_of(h)]
                if mass[corners[0]] + mass[corners[1]] > 0.0:
                    lane = activate(l_slot[h], l_run, l_first, l_filled, l_lane, l_slot_at)
                    for k in range(2):
                        l_seats[lane // LANES, k, lane % LANES] = take_seat(
                            corners[k], origin, seat, vertex, s_first, s_filled
                        )
                        l_moves[lane // LANES, k, lane % LANES] = mass[corners[k]] > 0.0
                    l_target[lane // LANES, lane % LANES] = rest_length[h]
                else:
                    deactivate(
                        l_slot[h], l_run, l_first, l_filled, l_lane, l_slot_at,
                        l_seats, l_moves, l_data, l_target,
                    )  # fmt: skip
                if g < 0 or math.isnan(start[h]):
                    continue
                corners[3] = tail[prev_of(g)]
                if mass[corners[0]] + mass[corners[1]] + mass[corners[2]] + mass[corners[3]] > 0.0:
                    lane = activate(a_slot[h], a_run, a_first, a_filled, a_lane, a_slot_at)
                    for k in range(4):
                        a_seats[lane // LANES, k, lane % LANES] = take_seat(
                            corners[k], origin, seat, vertex, s_first, s_filled
                        )
                        a_moves[lane // LANES, k, lane % LANES] = mass[corners[k]] > 0.0
                    a_data[lane // LANES, 0, lane % LANES] = start[h]
                    a_data[lane // LANES, 1, lane % LANES] = since[h]
                    a_data[lane // LANES, 2, lane % LANES] = span[h]
                else:
                    deactivate(
                        a_slot[h], a_run, a_first, a_filled, a_lane, a_slot_at,
                        a_seats, a_moves, a_data, a_target,
                    )  # fmt: skip
            leaving = twin[arriving]
            if leaving == half_edge[v]:
                break
