"""Rust: on the metal where the film has lifted or is gone, and running down the film from cracks (paper 3.2).

Runoff follows Ishitobi et al., 2020: sources pass their rust on along the film, downhill. Speeds are lengths
per age and a streak fades over a length, so that neither the mesh nor the number of steps sets how far it
runs.
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

_LEVEL = 1e-9  # heights in sizes, and cosines, that differ by less are equal: last bits must not decide


@dataclass(frozen=True)
class StainParameters:
    """How stains grow. Lengths in sizes, rates per unit of age; named as the config's sections."""

    dust_rate: float = 0.5
    rust_threshold: float = 0.1
    rust_source_rate: float = 3.0
    rust_source_cap: float = 0.9
    rust_runoff_speed: float = 1.0
    rust_runoff_length: float = 0.15
    rust_alignment: float = 0.7
    rust_side_share: float = 0.001
    rust_lifted_rate: float = 1.0
    rust_bare_rate: float = 3.0


class RustState(NamedTuple):
    """Rust on film and metal. n0 rest vertices; arrays over film vertices have the capacity 3 m.

    film: (3 m,), runoff rust, 0 to 1; source: bool (3 m,); lifted_age, bare_age: (n0,), the age at which the
    film first lifted off the metal there, and since when it is gone, infinite before; film_corners: int32
    (n0,), corners of live film faces on it.
    """

    film: Vectors
    source: NDArray[np.bool_]
    lifted_age: Vectors
    bare_age: Vectors
    film_corners: Indices


class RunoffNumbers(NamedTuple):
    """The parameters that the runoff kernel needs."""

    threshold: float
    source_rate: float
    source_cap: float
    runoff_speed: float
    runoff_length: float
    alignment: float
    side_share: float


def make_rust_state(mesh: HalfEdgeMesh) -> RustState:
    """No rust yet."""
    rest_count = len(mesh.rest_positions)
    return RustState(
        film=np.zeros(len(mesh.twin)),
        source=np.zeros(len(mesh.twin), np.bool_),
        lifted_age=np.full(rest_count, np.inf),
        bare_age=np.full(rest_count, np.inf),
        film_corners=np.bincount(mesh.faces.reshape(-1), minlength=rest_count).astype(np.int32),
    )


def expose_lifted(mesh: HalfEdgeMesh, rust: RustState, vertices: Indices, age: float) -> None:
    """Note that the film has lifted off the metal under these film vertices."""
    rust.lifted_age[mesh.origin[vertices]] = age


@kernel
def follow_events(mesh: HalfEdgeMesh, rust: RustState, log: EventLog, up: Vectors, age: float) -> None:
    """Bring rust up to date with a step's log: copies inherit, new outlines get sources, fallen film bares
    the metal.
    """
    for i in range(log.counts[0]):
        rust.film[log.splits[i, 0]] = rust.film[log.splits[i, 1]]
        rust.source[log.splits[i, 0]] = rust.source[log.splits[i, 1]]
    for i in range(log.counts[1]):
        for side in range(2):
            h = log.breaks[i, side]
            if mesh.alive[h // 3]:
                mark_source(mesh, rust, mesh.tail[h], up)
                mark_source(mesh, rust, mesh.tail[next_of(h)], up)
    for i in range(log.counts[2]):
        for corner in range(3):
            o = mesh.faces[log.falls[i], corner]
            rust.film_corners[o] -= 1
            if rust.film_corners[o] == 0:
                rust.bare_age[o] = age


@kernel
def rest_height(mesh: HalfEdgeMesh, v: int, up: Vectors) -> float:
    """Height of film vertex v at rest."""
    o = mesh.origin[v]
    return (
        mesh.rest_positions[o, 0] * up[0]
        + mesh.rest_positions[o, 1] * up[1]
        + mesh.rest_positions[o, 2] * up[2]
    )


@kernel
def mark_source(mesh: HalfEdgeMesh, rust: RustState, v: int, up: Vectors) -> None:
    """Make v a source if it lies lower than both its neighbours along the outline of the crack."""
    first = mesh.half_edge[v]
    if first < 0 or mesh.twin[first] >= 0:
        return
    last = first
    while mesh.twin[prev_of(last)] >= 0:
        last = mesh.twin[prev_of(last)]
    height = rest_height(mesh, v, up) + _LEVEL
    after, before = mesh.tail[next_of(first)], mesh.tail[prev_of(last)]
    if height < rest_height(mesh, after, up) and height < rest_height(mesh, before, up):
        rust.source[v] = True


@kernel
def run_off(
    mesh: HalfEdgeMesh,
    rust: RustState,
    numbers: RunoffNumbers,
    up: Vectors,
    duration: float,
    vertices: Indices,
) -> None:
    """Let sources grow and rust run for `duration` down from each of the vertices, which come from the
    highest to the lowest.

    The neighbour best aligned with gravity along the surface takes over the rust above it, less what fades on
    the way; the other neighbours below take a small share of that.
    """
    grown = -math.expm1(-numbers.source_rate * duration)
    for v in vertices:
        if rust.source[v]:
            rust.film[v] += max(numbers.source_cap - rust.film[v], 0.0) * grown
        if rust.film[v] <= numbers.threshold:
            continue
        best = -1
        best_alignment = numbers.alignment
        for turn in range(2):
            first = mesh.half_edge[v]
            leaving = first
            while leaving >= 0:
                # the last half-edge of an open fan is only met as the one that arrives
                arriving = prev_of(leaving)
                for end in range(1 if mesh.twin[arriving] >= 0 else 2):
                    other = mesh.tail[next_of(leaving)] if end == 0 else mesh.tail[arriving]
                    alignment, length = downhill(mesh, v, other, up)
                    if alignment <= numbers.alignment:
                        continue
                    if turn == 0:
                        if alignment > best_alignment + _LEVEL:
                            best, best_alignment = other, alignment
                    else:
                        share = 1.0 if other == best else numbers.side_share
                        wanted = rust.film[v] * math.exp(-length / numbers.runoff_length) - rust.film[other]
                        if wanted > 0.0:
                            rust.film[other] += (
                                share * wanted * -math.expm1(-numbers.runoff_speed / length * duration)
                            )
                leaving = mesh.twin[arriving]
                if leaving == first:
                    break


@kernel
def downhill(mesh: HalfEdgeMesh, v: int, other: int, up: Vectors) -> tuple[float, float]:
    """Cosine between the rest edge from v to another vertex and gravity along the surface at v, and the
    edge's length.

    The cosine is 0 where the surface is level.
    """
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


def stain(
    mesh: HalfEdgeMesh, rust: RustState, parameters: StainParameters, up: Vectors, duration: float
) -> None:
    """Let rust run down the film for `duration`, from the highest vertex to the lowest."""
    p = parameters
    count = mesh.vertex_count
    running = np.flatnonzero(
        (rust.source[:count] | (rust.film[:count] > p.rust_threshold)) & (mesh.half_edge[:count] >= 0)
    )
    if len(running) == 0:
        return
    height = np.sum(mesh.rest_positions[mesh.origin[running]] * up, axis=1)
    numbers = RunoffNumbers(
        p.rust_threshold,
        p.rust_source_rate,
        p.rust_source_cap,
        p.rust_runoff_speed,
        p.rust_runoff_length,
        p.rust_alignment,
        p.rust_side_share,
    )
    run_off(mesh, rust, numbers, up, duration, running[np.argsort(-np.rint(height / _LEVEL), kind="stable")])


def metal_rust_at(rust: RustState, parameters: StainParameters, age: float) -> Vectors:
    """Rust of the metal under each rest vertex at an age, 0 to 1, (n0,): slow under lifted film, fast where
    it is bare.
    """
    lifted = np.clip(np.minimum(age, rust.bare_age) - rust.lifted_age, 0.0, None)
    bare = np.clip(age - rust.bare_age, 0.0, None)
    return -np.expm1(-parameters.rust_lifted_rate * lifted - parameters.rust_bare_rate * bare)
