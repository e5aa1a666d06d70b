"""Releases, breaks and falls in any order, in steps of any length: the structure and the constraints stay
sound, and the log says it all.
"""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tests.deform.test_runs import check_packing
from tests.random_surfaces import Damage, brought_in, damaged, damages
from tests.zoo import fans_by_vertex, make_mesh
from weathercoat.deform.constraints import Constraints, follow_events, make_constraints, release
from weathercoat.mesh.halfedge import (
    EventLog,
    HalfEdgeMesh,
    check_half_edges,
    cut_edge,
    drop_face,
    make_event_log,
    next_of,
    prev_of,
)

Random = np.random.Generator


class PlainConstraints:
    """When each angle constraint began, by its edge, and which film vertices move."""

    def __init__(self) -> None:
        self.age: dict[int, float] = {}
        self.free: set[int] = set()

    def release(self, mesh: HalfEdgeMesh, vertices: list[int], age: float) -> None:
        """Angles on the edges opposite to the vertices, unless they have one."""
        self.free |= set(vertices)
        for h in np.flatnonzero(np.repeat(mesh.alive, 3) & (mesh.twin >= 0)).tolist():
            if int(mesh.tail[prev_of(h)]) in vertices:
                self.age.setdefault(min(h, int(mesh.twin[h])), age)

    def follow(self, mesh: HalfEdgeMesh, log: EventLog) -> None:
        """Copies move, broken edges bend no more, and what has fallen is gone."""
        self.free |= {int(new) for new, _ in log.split_entries()}
        gone = {min(pair) for pair in log.break_entries().tolist()}
        gone |= {h for f in log.fall_entries().tolist() for h in range(3 * f, 3 * f + 3)}
        self.age = {edge: age for edge, age in self.age.items() if edge not in gone}
        used = set(mesh.tail[np.repeat(mesh.alive, 3)].tolist())
        self.free &= used

    def check(self, mesh: HalfEdgeMesh, constraints: Constraints) -> None:
        """The state of the constraints is this, and what is packed follows from it."""
        live = [h for h in range(len(mesh.twin)) if mesh.alive[h // 3]]
        begun = {
            h: float(constraints.angle_age[h]) for h in live if not math.isnan(constraints.angle_start[h])
        }
        assert begun == self.age
        used = set(mesh.tail[live].tolist())
        assert {v for v in used if constraints.inverse_mass[v] > 0.0} == self.free
        check_packing(mesh, constraints)


def release_some(mesh: HalfEdgeMesh, free: set[int], random: Random) -> list[int]:
    """Up to a quarter of the attached vertices."""
    attached = sorted(set(mesh.tail[np.repeat(mesh.alive, 3)].tolist()) - free)
    return random.permutation(attached)[: 1 + len(attached) // 4].astype(int).tolist() if attached else []


def cut_some(mesh: HalfEdgeMesh, log: EventLog, free: set[int], random: Random) -> None:
    """A few of the edges whose ends have both separated, copies of this step included."""
    moving = set(free)
    for _ in range(int(random.integers(1, 6))):
        inner = np.flatnonzero(mesh.twin > np.arange(len(mesh.twin)))
        ready = [int(h) for h in inner if {int(mesh.tail[h]), int(mesh.tail[next_of(int(h))])} <= moving]
        if not ready:
            return
        cut_edge(mesh, log, ready[int(random.integers(len(ready)))])
        assert check_half_edges(mesh) == ""
        moving |= {int(new) for new, _ in log.split_entries()}


def drop_a_piece(mesh: HalfEdgeMesh, log: EventLog, free: set[int], random: Random) -> None:
    """One of the pieces that nothing holds, whole."""
    moving = free | {int(new) for new, _ in log.split_entries()}
    pieces = []
    left = set(np.flatnonzero(mesh.alive).tolist())
    while left:
        piece, stack = set(), [left.pop()]
        while stack:
            f = stack.pop()
            piece.add(f)
            around = {int(g) // 3 for g in mesh.twin[3 * f : 3 * f + 3] if g >= 0} & left
            left -= around
            stack += around
        if set(mesh.tail.reshape(-1, 3)[sorted(piece)].ravel().tolist()) <= moving:
            pieces.append(sorted(piece))
    if pieces:
        for f in pieces[int(random.integers(len(pieces)))]:
            drop_face(mesh, log, f)
        assert check_half_edges(mesh) == ""


@given(
    damage=damages,
    seed=st.integers(0, 10**6),
    steps=st.lists(st.sampled_from("rrccd"), min_size=1, max_size=20),
)
def test_any_order_of_events(damage: Damage, seed: int, steps: list[str]) -> None:
    """r releases, c cuts and d drops; every step ends with the constraints brought up to date."""
    surface = brought_in(*damaged(damage))
    mesh, log = make_mesh(surface), make_event_log(len(surface.faces))
    constraints, plain, random = make_constraints(mesh), PlainConstraints(), np.random.default_rng(seed)
    replayed, unread = make_mesh(surface), make_event_log(len(surface.faces))
    for number, step in enumerate(steps):
        log.clear()
        if step == "r":
            vertices = release_some(mesh, plain.free, random)
            release(mesh, constraints, np.array(vertices, np.int32), float(number))
            plain.release(mesh, vertices, float(number))
        else:
            cut_some(mesh, log, plain.free, random)
            if step == "d":
                drop_a_piece(mesh, log, plain.free, random)
        follow_events(mesh, constraints, log)
        plain.follow(mesh, log)
        assert check_half_edges(mesh) == ""
        assert set(fans_by_vertex(mesh).values()) <= {1}
        plain.check(mesh, constraints)
        replay(log, replayed, unread)
        for name in ("tail", "twin", "alive"):
            assert np.array_equal(getattr(mesh, name), getattr(replayed, name)), name
        used = mesh.vertex_count
        assert used == replayed.vertex_count
        assert np.array_equal(mesh.half_edge[:used], replayed.half_edge[:used])
        assert np.array_equal(mesh.origin[:used], replayed.origin[:used])


def replay(log: EventLog, mesh: HalfEdgeMesh, again: EventLog) -> None:
    """Do to another mesh what a log says; it must say the same of that."""
    again.clear()
    for h, _ in log.break_entries():
        cut_edge(mesh, again, int(h))
    for f in log.fall_entries():
        drop_face(mesh, again, int(f))
    assert np.array_equal(log.split_entries(), again.split_entries())
    assert np.array_equal(log.break_entries(), again.break_entries())
