"""What is seen of film and metal: classes of condition, for labels, maps, figures and the viewer alike.

An amount counts for a face as the mean of its corners. Thresholds are where the colours of a run begin to
show what they count: from there on an inspector could point at it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from weathercoat.mesh.surface import Indices, Vectors, face_areas
from weathercoat.sim.snapshot import Snapshot

CLASSES = ("paint", "lifted", "crack", "bare", "rust", "runoff", "dirt")
PAINT, LIFTED, CRACK, BARE, RUST, RUNOFF, DIRT = range(len(CLASSES))

# `stain.color` blends towards rust above 0.1, and the pictures lay their first patches there.
RUST_SEEN = 0.1  # of the metal
RUNOFF_SEEN = 0.1  # on the film
# Dust dims a colour by exp(-dust): here by a tenth, some two and a half units of CIE lightness on a paint of
# medium tone, about the least that is told from a wiped spot beside it without an instrument.
DIRT_SEEN = 0.1
# Film counts as lifted with two of its three corners: with one it is the hinge of a flap that still holds.
_LIFTED_CORNERS = 2


@dataclass(frozen=True)
class Condition:
    """What is to be seen over each of the t faces of the metal, whose rest areas are `area` (t,).

    Bool (t,): flaked, the film is gone; rusted, it is gone and the metal's rust shows; lifted, runoff, dirty:
    film is left and it has let go, bears runoff rust, bears dirt. The last three do not exclude each other.
    Rust under film is not seen, and runoff is a stain and no rusting: neither counts as rusted.
    """

    area: Vectors
    flaked: NDArray[np.bool_]
    rusted: NDArray[np.bool_]
    lifted: NDArray[np.bool_]
    runoff: NDArray[np.bool_]
    dirty: NDArray[np.bool_]


def film_classes(snapshot: Snapshot) -> NDArray[np.uint8]:
    """The class of each face of the film, uint8 (m,): paint, lifted, runoff or dirt; where several apply the
    first of lifted, runoff, dirt.
    """
    lifted, runoff, dirty = _film_masks(snapshot)
    return np.select([lifted, runoff, dirty], [LIFTED, RUNOFF, DIRT], PAINT).astype(np.uint8)


def metal_classes(snapshot: Snapshot) -> NDArray[np.uint8]:
    """The class of each face of the metal where it is seen, uint8 (t,): crack where its own film still
    exists, so that it is seen through an opening; else rust or bare, by the amount of rust.
    """
    flaked = ~has_film(snapshot)
    rusted = is_rusted(flaked, snapshot.substrate_faces, snapshot.substrate_rust)
    return np.select([rusted, flaked], [RUST, BARE], CRACK).astype(np.uint8)


def assess(snapshot: Snapshot) -> Condition:
    """The condition over each face of the metal."""
    flaked = ~has_film(snapshot)
    lifted, runoff, dirty = (np.zeros(len(flaked), np.bool_) for _ in range(3))
    for mask, of_film in zip((lifted, runoff, dirty), _film_masks(snapshot), strict=True):
        mask[snapshot.film_face] = of_film
    return Condition(
        area=face_areas(snapshot.substrate_vertices, snapshot.substrate_faces),
        flaked=flaked,
        rusted=is_rusted(flaked, snapshot.substrate_faces, snapshot.substrate_rust),
        lifted=lifted,
        runoff=runoff,
        dirty=dirty,
    )


def has_film(snapshot: Snapshot) -> NDArray[np.bool_]:
    """Whether each face of the metal still has its own film, be it attached or lifted, bool (t,)."""
    found = np.zeros(len(snapshot.substrate_faces), np.bool_)
    found[snapshot.film_face] = True
    return found


def is_rusted(flaked: NDArray[np.bool_], faces: Indices, rust: Vectors) -> NDArray[np.bool_]:
    """Whether each face (t, 3) of the metal is without film, `flaked` (t,), and its rust shows; `rust` is
    that of the vertices (n,).
    """
    rusted = np.zeros(len(flaked), np.bool_)
    rusted[flaked] = corner_mean(rust, faces[flaked]) >= RUST_SEEN
    return rusted


def is_lifted(separated: NDArray[np.bool_], faces: Indices) -> NDArray[np.bool_]:
    """Whether each face (m, 3) of the film has let go; `separated` is that of its vertices."""
    a, b, c = (separated[faces[:, i]].view(np.uint8) for i in range(3))
    return (a + b + c) >= _LIFTED_CORNERS


def percent_of(chosen: NDArray[np.bool_], area: Vectors) -> float:
    """The share of the chosen faces (t,) in their area, in percent; 0 where there is no area."""
    total = float(area.sum())
    return 100.0 * float(area[chosen].sum()) / total if total > 0.0 else 0.0


def corner_mean(values: Vectors, faces: Indices) -> Vectors:
    """The mean of the corners' values for each face, (m,)."""
    return (values[faces[:, 0]] + values[faces[:, 1]] + values[faces[:, 2]]) / 3.0


def _film_masks(snapshot: Snapshot) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.bool_]]:
    """Of each face of the film whether it is lifted, has runoff, is dirty, (m,) each."""
    faces = snapshot.film_faces
    origin_faces = snapshot.substrate_faces[snapshot.film_face]
    return (
        is_lifted(snapshot.separated, faces),
        corner_mean(snapshot.film_rust, faces) >= RUNOFF_SEEN,
        corner_mean(snapshot.dust, origin_faces) >= DIRT_SEEN,
    )
