"""The plain version of runoff: a step looks at all vertices, sorts those that run, evaluates all geometry."""

from __future__ import annotations

import math

import numpy as np

from weathercoat.compile import kernel
from weathercoat.mesh.halfedge import EventLog, HalfEdgeMesh, next_of, prev_of
from weathercoat.mesh.surface import Indices, Vectors
from weathercoat.stain.rust import RustState, StainParameters

LEVEL = 1e-9


def rest_height(mesh: HalfEdgeMesh, v: int, up: Vectors) -> float:
    """Height of film vertex v at rest."""
    x, y, z = mesh.rest_positions[mesh.origin[v]]
    return float(x * up[0] + y * up[1] + z * up[2])


def follow_events(mesh: HalfEdgeMesh, film: Vectors, source: Indices, log: EventLog, up: Vectors) -> None:
    """Copies inherit, and a vertex that is lower than both its neighbours on a new outline is a source."""
    for copy, parent in log.split_entries():
        film[copy], source[copy] = film[parent], source[parent]
    for h in log.break_entries().reshape(-1):
        if mesh.alive[h // 3]:
            for v in (mesh.tail[h], mesh.tail[next_of(h)]):
                mark_source(mesh, source, v, up)


def mark_source(mesh: HalfEdgeMesh, source: Indices, v: int, up: Vectors) -> None:
    """Make v a source if it is lower than both its neighbours on the outline."""
    first = mesh.half_edge[v]
    if first < 0 or mesh.twin[first] >= 0:
        return
    last = first
    while mesh.twin[prev_of(last)] >= 0:
        last = mesh.twin[prev_of(last)]
    height = rest_height(mesh, v, up) + LEVEL
    ends = mesh.tail[next_of(first)], mesh.tail[prev_of(last)]
    if all(height < rest_height(mesh, end, up) for end in ends):
        source[v] = True


def stain(
    mesh: HalfEdgeMesh, rust: RustState, parameters: StainParameters, up: Vectors, duration: float
) -> int:
    """Let rust run down the film for `duration`; returns from how many vertices."""
    p = parameters
    count = mesh.vertex_count
    running = np.flatnonzero(
        (rust.source[:count] | (rust.film[:count] > p.rust_threshold)) & (mesh.half_edge[:count] >= 0)
    )
    height = np.array([rest_height(mesh, v, up) for v in running])
    vertices = running[np.argsort(-np.rint(height / LEVEL), kind="stable")]
    _run_off(
        mesh, rust.film, rust.source, vertices, up, duration, p.rust_threshold, p.rust_source_rate,
        p.rust_source_cap, p.rust_runoff_speed, p.rust_runoff_length, p.rust_alignment, p.rust_side_share,
    )  # fmt: skip
    return len(running)


@kernel
def _run_off(
    mesh: HalfEdgeMesh,
    film: Vectors,
    source: Indices,
    vertices: Indices,
    up: Vectors,
    duration: float,
    threshold: float,
    source_rate: float,
    source_cap: float,
    runoff_speed: float,
    runoff_length: float,
    least_alignment: float,
    side_share: float,
) -> None:
    for v in vertices:
        if source[v]:
            film[v] += max(source_cap - film[v], 0.0) * -math.expm1(-source_rate * duration)
        if film[v] <= threshold:
            continue
        best = -1
        best_alignment = least_alignment
        for turn in range(2):
            first = mesh.half_edge[v]
            leaving = first
            while leaving >= 0:
                arriving = prev_of(leaving)
                for end in range(1 if mesh.twin[arriving] >= 0 else 2):
                    other = mesh.tail[next_of(leaving)] if end == 0 else mesh.tail[arriving]
                    alignment, length = _downhill(mesh, v, other, up)
                    if alignment <= least_alignment:
                        continue
                    if turn == 0:
                        if alignment > best_alignment + LEVEL:
                            best, best_alignment = other, alignment
                    else:
                        share = 1.0 if other == best else side_share
                        wanted = film[v] * math.exp(-length / runoff_length) - film[other]
                        if wanted > 0.0:
                            film[other] += share * wanted * -math.expm1(-runoff_speed / length * duration)
                leaving = mesh.twin[arriving]
                if leaving == first:
                    break


@kernel
def _downhill(mesh: HalfEdgeMesh, v: int, other: int, up: Vectors) -> tuple[float, float]:
    o, p = mesh.origin[v], mesh.origin[other]
    normal = mesh.rest_normals[o]
    steep = up[0] * normal[0] + up[1] * normal[1] + up[2] * normal[2]
    dot = 0.0
    slope = 0.0
    length = 0.0
    for axis in range(3):
        down = steep * normal[axis] - up[axis]
        step = mesh.rest_positions[p, axis] - mesh.rest_positions[o, axis]
        dot += down * step
        slope += down * down
        length += step * step
    if slope < 1e-6 or length == 0.0:
        return 0.0, math.sqrt(length)
    return dot / math.sqrt(slope * length), math.sqrt(length)
