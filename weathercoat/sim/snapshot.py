"""`Snapshot`: the film and the substrate at one moment, complete, as plain arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from weathercoat.mesh.surface import Indices, Surface, Vectors


@dataclass(frozen=True)
class Snapshot:
    """Film and substrate after `step` steps, at `age`.

    Film, n vertices and m faces, without the flakes that have fallen; no vertex is shared across a crack:
    film_vertices float64 (n, 3) in model units; film_faces int32 (m, 3); film_face int32 (m,), the substrate
    face that each film face covered at the start; film_origin int32 (n,), the substrate vertex each film
    vertex stems from; film_rust (n,) runoff rust 0 to 1; separated bool (n,); separation_age (n,), age since
    the vertex separated (0 while attached); adhesion (n,), what holds it still; film_color float64 (n, 3),
    sRGB 0 to 1.

    Substrate, the mesh at the start: substrate_vertices, substrate_normals (outward, unit), substrate_faces;
    substrate_rust and dust (0 to 1), bare bool (all film gone from the vertex), substrate_color, per vertex.

    surface: the mesh at the start with all that it has from the input (groups, texture coordinates, colours,
    parts, places), in the substrate's order of vertices and faces; None where only geometry is known.
    """

    step: int
    age: float
    film_vertices: Vectors
    film_faces: Indices
    film_face: Indices
    film_origin: Indices
    film_rust: Vectors
    separated: NDArray[np.bool_]
    separation_age: Vectors
    adhesion: Vectors
    film_color: Vectors
    substrate_vertices: Vectors
    substrate_normals: Vectors
    substrate_faces: Indices
    substrate_rust: Vectors
    dust: Vectors
    bare: NDArray[np.bool_]
    substrate_color: Vectors
    surface: Surface | None = None
