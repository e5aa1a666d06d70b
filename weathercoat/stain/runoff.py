"""Runoff: rust that runs down the film from the lower ends of cracks (paper 3.2, after Ishitobi et al. 2020).

Sources pass their rust on along the film, downhill. Speeds are lengths per age and a streak fades over a
length, so that neither the mesh nor the number of steps sets how far it runs.

All geometry of it is at rest. So the vertices from which rust runs are kept in their order of height, each
with its list of the neighbours that take rust and their factors of distance. New vertices are merged in, and
a list is made anew only where the fan of its vertex has changed. The lists follow from the mesh and the rust.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.mesh.halfedge import EventLog, HalfEdgeMesh, next_of, prev_of
from weathercoat.mesh.surface import Indices, Vectors
from weathercoat.stain.rust import RustState, StainParameters

_LEVEL = 1e-9  # heights in sizes, and cosines, that differ by less are equal: last bits must not decide
_VERTEX = 0xFFFFFFFF  # the part of a key that is the vertex; above it is the rank of its height
_NEW, _STALE, _RUNNING = range(3)  # what is counted

Keys = NDArray[np.int64]
Flags = NDArray[np.bool_]


class Lists(NamedTuple):
    """The running vertices from the highest to the lowest, and what each gives to whom.

    order: int64, rank of the height * 2**32 + vertex; first: int32, one more than `order`, where the list of
    each begins. The lists, one after the other: giver, taker: int32, vertices, the same where a source grows;
    factors: (k, 3), what distance leaves of the rust, what the taker takes of the difference in a tick, and
    its share: 1 for the steepest way down, less for others.
    """

    order: Keys
    first: Indices
    giver: Indices
    taker: Indices
    factors: Vectors


class Rates(NamedTuple):
    """The tick, and the parameters that the lists depend on."""

    duration: float
    source: float
    speed: float
    length: float
    alignment: float
    side_share: float


class Changes(NamedTuple):
    """What the lists do not have yet.

    rank: int64 (n0,), 0 for the highest rest vertices, equal where level. Over film vertices: is_running,
    those that are or will be in the order; is_stale, those of them whose list must be made anew, or goes with
    the film that fell. new: int64, keys of vertices that start to run; stale: int32, vertices. counts: int64
    (3,), how many of `new`, of `stale` and of the order are in use.
    """

    rank: Keys
    is_running: Flags
    is_stale: Flags
    new: Keys
    stale: Indices
    counts: NDArray[np.int64]


@dataclass
class Runoff:
    """What follows from mesh and rust, with `up` (3,) against gravity.

    duration: of the tick that the lists are for, 0 before the first; height: (n0,) of rest vertices [sizes];
    spare: where the next lists are made.
    """

    parameters: StainParameters
    up: Vectors
    duration: float
    height: Vectors
    changes: Changes
    lists: Lists
    spare: Lists


def make_runoff(mesh: HalfEdgeMesh, rust: RustState, parameters: StainParameters, up: Vectors) -> Runoff:
    """Runoff for the state as it is; make it anew after a change of the state that no log tells."""
    capacity, count = len(mesh.twin), mesh.vertex_count
    p = mesh.rest_positions
    height = p[:, 0] * up[0] + p[:, 1] * up[1] + p[:, 2] * up[2]
    _, rank = np.unique(-np.rint(height / _LEVEL), return_inverse=True)
    is_running = np.zeros(capacity, np.bool_)
    is_running[:count] = (rust.source[:count] | (rust.film[:count] > parameters.rust_threshold)) & (
        mesh.half_edge[:count] >= 0
    )
    running = np.flatnonzero(is_running)
    new, stale = np.empty(capacity, np.int64), np.empty(capacity, np.int32)
    new[: len(running)] = np.sort((rank[mesh.origin[running]] << 32) | running)
    stale[: len(running)] = running
    counts = np.array([len(running), len(running), 0])
    changes = Changes(rank.astype(np.int64), is_running, is_running.copy(), new, stale, counts)
    return Runoff(parameters, up, 0.0, height, changes, _make_lists(256), _make_lists(256))


def _make_lists(room: int) -> Lists:
    return Lists(
        order=np.empty(room, np.int64),
        first=np.zeros(room + 1, np.int32),
        giver=np.empty(room, np.int32),
        taker=np.empty(room, np.int32),
        factors=np.empty((room, 3)),
    )


def follow_events(mesh: HalfEdgeMesh, rust: RustState, runoff: Runoff, log: EventLog) -> None:
    """Bring film rust and runoff up to date with a step's log: copies inherit, and a vertex of a new outline
    that lies lower than both its neighbours along it becomes a source.
    """
    if log.counts[0] or log.counts[1] or log.counts[2]:
        _follow_events(mesh, rust.film, rust.source, runoff.height, log, runoff.changes)


def run_off(mesh: HalfEdgeMesh, rust: RustState, runoff: Runoff, duration: float) -> None:
    """Let sources grow and rust run for a tick of `duration`, from the highest vertex to the lowest.

    The neighbour best aligned with gravity along the surface takes over the rust above it, less what fades on
    the way; the other neighbours below take a small share of that.
    """
    changes, p = runoff.changes, runoff.parameters
    if duration != runoff.duration:
        runoff.duration = duration
        _mark_all_stale(runoff)
    if changes.counts[_STALE]:
        _update_lists(mesh, rust, runoff)
    if changes.counts[_RUNNING]:
        _pass_on(runoff.lists, rust.film, mesh.origin, p.rust_threshold, p.rust_source_cap, changes)


def _mark_all_stale(runoff: Runoff) -> None:
    changes = runoff.changes
    vertices = runoff.lists.order[: changes.counts[_RUNNING]] & _VERTEX
    vertices = vertices[~changes.is_stale[vertices]]
    start = changes.counts[_STALE]
    changes.stale[start : start + len(vertices)] = vertices
    changes.is_stale[vertices] = True
    changes.counts[_STALE] += len(vertices)


def _update_lists(mesh: HalfEdgeMesh, rust: RustState, runoff: Runoff) -> None:
    """Merge in what is new, make anew what is stale, and leave out vertices whose film has fallen."""
    p = runoff.parameters
    rates = Rates(
        runoff.duration, p.rust_source_rate, p.rust_runoff_speed, p.rust_runoff_length, p.rust_alignment,
        p.rust_side_share,
    )  # fmt: skip
    while not _merge(mesh, rust.source, runoff.up, rates, runoff.lists, runoff.spare, runoff.changes):
        runoff.spare = _make_lists(2 * len(runoff.spare.order))
    runoff.lists, runoff.spare = runoff.spare, runoff.lists


@kernel
def _start_running(v: int, origin: Indices, changes: Changes) -> None:
    new, stale, counts = changes.new, changes.stale, changes.counts
    changes.is_running[v] = True
    changes.is_stale[v] = True
    new[counts[_NEW]] = (changes.rank[origin[v]] << 32) | v
    stale[counts[_STALE]] = v
    counts[_NEW] += 1
    counts[_STALE] += 1


@kernel
def _mark_stale(v: int, changes: Changes) -> None:
    if changes.is_running[v] and not changes.is_stale[v]:
        changes.is_stale[v] = True
        changes.stale[changes.counts[_STALE]] = v
        changes.counts[_STALE] += 1


@kernel
def _follow_events(
    mesh: HalfEdgeMesh, film: Vectors, source: Flags, height: Vectors, log: EventLog, changes: Changes
) -> None:
    tail, twin, half_edge, origin = mesh.tail, mesh.twin, mesh.half_edge, mesh.origin
    for i in range(log.counts[0]):
        copy, parent = log.splits[i, 0], log.splits[i, 1]
        film[copy] = film[parent]
        source[copy] = source[parent]
        if changes.is_running[parent]:
            _start_running(copy, origin, changes)
    for i in range(log.counts[1]):
        for side in range(2):
            h = log.breaks[i, side]
            if not mesh.alive[h // 3]:
                continue
            for end in range(2):
                v = tail[h] if end == 0 else tail[next_of(h)]
                if not source[v] and _is_lowest(v, tail, twin, half_edge, origin, height):
                    source[v] = True
                    if not changes.is_running[v]:
                        _start_running(v, origin, changes)
                _mark_stale(v, changes)
    # neighbours of a copy were neighbours of its parent and still name that
    for i in range(log.counts[0]):
        h = half_edge[log.splits[i, 0]]
        while h >= 0:
            _mark_stale(tail[next_of(h)], changes)
            _mark_stale(tail[prev_of(h)], changes)
            h = twin[prev_of(h)]
    for i in range(log.counts[2]):
        for h in range(3 * log.falls[i], 3 * log.falls[i] + 3):
            _mark_stale(tail[h], changes)


@kernel
def _is_lowest(
    v: int, tail: Indices, twin: Indices, half_edge: Indices, origin: Indices, height: Vectors
) -> bool:
    """Whether v, on an outline, lies lower than both its neighbours along it."""
    first = half_edge[v]
    if first < 0 or twin[first] >= 0:
        return False
    last = first
    while twin[prev_of(last)] >= 0:
        last = twin[prev_of(last)]
    level = height[origin[v]] + _LEVEL
    return level < height[origin[tail[next_of(first)]]] and level < height[origin[tail[prev_of(last)]]]


@kernel
def _sort(keys: Keys) -> None:
    """Sort in place (Shell, 1959); a few keys, as a step has them, need a few moves."""
    gap = 1
    while gap < len(keys) // 3:
        gap = 3 * gap + 1
    while gap > 0:
        for i in range(gap, len(keys)):
            key = keys[i]
            j = i
            while j >= gap and keys[j - gap] > key:
                keys[j] = keys[j - gap]
                j -= gap
            keys[j] = key
        gap //= 3


@kernel
def _merge(
    mesh: HalfEdgeMesh,
    source: Flags,
    up: Vectors,
    rates: Rates,
    lists: Lists,
    out: Lists,
    changes: Changes,
) -> bool:
    """Make the lists of all vertices in `out` from `lists` and what has changed; False for lack of room."""
    tail, twin, half_edge, origin = mesh.tail, mesh.twin, mesh.half_edge, mesh.origin
    rest_positions, rest_normals = mesh.rest_positions, mesh.rest_normals
    is_stale, counts = changes.is_stale, changes.counts
    order, first, taker, factors = lists.order, lists.first, lists.taker, lists.factors
    out_order, out_first, out_taker, out_factors = out.order, out.first, out.taker, out.factors
    giver = out.giver
    grown = -math.expm1(-rates.source * rates.duration)
    new = changes.new[: counts[_NEW]]
    _sort(new)
    merged, kept = 0, 0
    i, j = 0, 0
    while i < counts[_RUNNING] or j < len(new):
        if j == len(new) or (i < counts[_RUNNING] and order[i] < new[j]):
            key = order[i]
            i += 1
        else:
            key = new[j]
            j += 1
        v = key & _VERTEX
        if is_stale[v] and half_edge[v] < 0:
            continue
        if merged == len(out_order):
            return False
        out_order[merged] = key
        out_first[merged] = kept
        merged += 1
        if not is_stale[v]:
            if kept + first[i] - first[i - 1] > len(giver):
                return False
            for k in range(first[i - 1], first[i]):
                giver[kept] = v
                out_taker[kept] = taker[k]
                out_factors[kept, 0] = factors[k, 0]
                out_factors[kept, 1] = factors[k, 1]
                out_factors[kept, 2] = factors[k, 2]
                kept += 1
            continue
        if source[v]:
            if kept == len(giver):
                return False
            giver[kept] = out_taker[kept] = v
            out_factors[kept, 0], out_factors[kept, 1], out_factors[kept, 2] = 0.0, grown, 1.0
            kept += 1
        start = kept
        best = -1
        best_alignment = rates.alignment
        fan = half_edge[v]
        leaving = fan
        while leaving >= 0:
            # the last half-edge of an open fan is only met as the one that arrives
            arriving = prev_of(leaving)
            for end in range(1 if twin[arriving] >= 0 else 2):
                other = tail[next_of(leaving)] if end == 0 else tail[arriving]
                aligned, length = _downhill(origin[v], origin[other], rest_positions, rest_normals, up)
                if aligned <= rates.alignment:
                    continue
                if kept == len(giver):
                    return False
                if aligned > best_alignment + _LEVEL:
                    best, best_alignment = other, aligned
                giver[kept], out_taker[kept] = v, other
                out_factors[kept, 0] = math.exp(-length / rates.length)
                out_factors[kept, 1] = -math.expm1(-rates.speed / length * rates.duration)
                kept += 1
            leaving = twin[arriving]
            if leaving == fan:
                break
        for k in range(start, kept):
            out_factors[k, 2] = 1.0 if out_taker[k] == best else rates.side_share
    out_first[merged] = kept
    for i in range(counts[_STALE]):
        is_stale[changes.stale[i]] = False
    counts[_NEW], counts[_STALE], counts[_RUNNING] = 0, 0, merged
    return True


@kernel
def _downhill(
    o: int, p: int, rest_positions: Vectors, rest_normals: Vectors, up: Vectors
) -> tuple[float, float]:
    """Cosine between the edge from rest vertex o to p and gravity along the surface at o, and the edge's
    length.

    The cosine is 0 where the surface is level.
    """
    steep = up[0] * rest_normals[o, 0] + up[1] * rest_normals[o, 1] + up[2] * rest_normals[o, 2]
    dot = 0.0
    slope = 0.0
    length = 0.0
    for axis in range(3):
        down = steep * rest_normals[o, axis] - up[axis]
        step = rest_positions[p, axis] - rest_positions[o, axis]
        dot += down * step
        slope += down * down
        length += step * step
    if slope < 1e-6 or length == 0.0:
        return 0.0, math.sqrt(length)
    return dot / math.sqrt(slope * length), math.sqrt(length)


@kernel
def _pass_on(
    lists: Lists, film: Vectors, origin: Indices, threshold: float, source_cap: float, changes: Changes
) -> None:
    """Let sources grow and rust pass on, in the order of the lists."""
    giver, taker, factors = lists.giver, lists.taker, lists.factors
    is_running = changes.is_running
    # without branches but the last, since which of them are taken has no pattern
    for k in range(lists.first[changes.counts[_RUNNING]]):
        v, other = giver[k], taker[k]
        rust, held = film[v], film[other]
        grows = v == other
        wanted = (source_cap if grows else rust * factors[k, 0]) - held
        taken = wanted if (wanted > 0.0) & (grows | (rust > threshold)) else 0.0
        film[other] = held + factors[k, 2] * taken * factors[k, 1]
        if held <= threshold < film[other] and not is_running[other]:
            _start_running(other, origin, changes)
