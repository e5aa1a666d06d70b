"""Rust on film and metal; how the metal rusts: slowly where the film has lifted, fast where it is gone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.mesh.halfedge import EventLog, HalfEdgeMesh
from weathercoat.mesh.surface import Indices, Vectors


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


def follow_events(mesh: HalfEdgeMesh, rust: RustState, log: EventLog, age: float) -> None:
    """Bring the metal up to date with a step's log: it is bare where the last film over it fell."""
    if log.counts[2]:
        _bare_metal(mesh.faces, log.fall_entries(), rust.film_corners, rust.bare_age, age)


@kernel
def _bare_metal(
    faces: Indices, fallen: Indices, film_corners: Indices, bare_age: Vectors, age: float
) -> None:
    for f in fallen:
        for corner in range(3):
            o = faces[f, corner]
            film_corners[o] -= 1
            if film_corners[o] == 0:
                bare_age[o] = age


def metal_rust_at(
    rust: RustState, parameters: StainParameters, age: float, worn: Callable[[Vectors], Vectors] | None = None
) -> Vectors:
    """Rust of the metal under each rest vertex at an age, 0 to 1, (n0,): slow under lifted film, fast where
    it is bare.

    worn: what an age of each vertex counts as, ages (n0,), where something protects the metal.
    """
    until = np.minimum(age, rust.bare_age)
    moments = np.minimum(rust.lifted_age, until), until, np.full(len(until), age)
    lifted_age, bare_age, now = moments if worn is None else map(worn, moments)
    lifted, bare = bare_age - lifted_age, now - bare_age
    return -np.expm1(-parameters.rust_lifted_rate * lifted - parameters.rust_bare_rate * bare)
