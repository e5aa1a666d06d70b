"""How far apart two runs are, in what a viewer sees of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import fmean

import numpy as np

from weathercoat.bench.fidelity_run import View
from weathercoat.comparison.flip import mean_flip
from weathercoat.mesh.closest import find_closest, make_closest_tree
from weathercoat.mesh.projection import barycentric_of
from weathercoat.mesh.surface import Vectors, face_areas
from weathercoat.output.pictures import Image
from weathercoat.sim.snapshot import Snapshot

AREAS = ("separated", "lost", "rusted")
Curves = Mapping[str, Sequence[float]]


def mean_curves(runs: Sequence[Curves]) -> dict[str, list[float]]:
    """The mean over runs, at each age."""
    return {name: np.mean([run[name] for run in runs], axis=0).tolist() for name in runs[0]}


def curve_errors(curves: Curves, reference: Curves) -> dict[str, float]:
    """For each quantity the RMS difference over the ages, relative to the RMS of the reference; `areas` is
    the largest of the areas' and `spacing` that of the distance between cracks, twice the area by their
    length; `rims` that of the length of rims.
    """
    found = {name: _relative(curves[name], reference[name]) for name in reference}
    return {
        **found,
        "areas": max(found[name] for name in AREAS),
        "spacing": found["crack_length"],
        "rims": found["rim_length"],
    }


def _relative(values: Sequence[float], reference: Sequence[float]) -> float:
    ours, theirs = np.asarray(values), np.asarray(reference)
    return float(np.sqrt(np.mean((ours - theirs) ** 2) / np.mean(theirs**2)))


def picture_difference(first: Sequence[Image], second: Sequence[Image]) -> float:
    """The mean of FLIP over pairs of pictures."""
    return fmean(mean_flip(*pair) for pair in zip(first, second, strict=True))


def film_distance(first: Snapshot, second: Snapshot) -> float:
    """Mean distance between the places of the same points of film in two runs, by area at rest, in sizes.

    The points are those of either film, found in the other by where they were at rest; of those that have
    fallen in one run nothing is known here. 0 where there is no film in common.
    """
    size = float(np.sqrt(face_areas(first.substrate_vertices, first.substrate_faces).sum()))
    gaps, areas = zip(_gaps_to(first, second), _gaps_to(second, first), strict=True)
    weight = np.concatenate(areas)
    return float(np.average(np.concatenate(gaps), weights=weight)) / size if weight.any() else 0.0


def _gaps_to(film: Snapshot, other: Snapshot) -> tuple[Vectors, Vectors]:
    """How far the centres of faces of a film are from where the other film has them, and the faces' areas at
    rest.
    """
    faces = film.substrate_faces[film.film_face]
    rest = film.substrate_vertices[faces].mean(axis=1)
    tree = make_closest_tree(other.substrate_vertices, other.substrate_faces)
    face, near = find_closest(tree, rest, np.zeros(len(rest), np.int32))
    film_of = np.full(len(other.substrate_faces), -1, np.int32)
    film_of[other.film_face] = np.arange(len(other.film_face), dtype=np.int32)
    common = film_of[face] >= 0
    share = barycentric_of(near[common], other.substrate_vertices[other.substrate_faces[face[common]]])
    corners = other.film_vertices[other.film_faces[film_of[face[common]]]]
    there = np.sum(share[:, :, None] * corners, axis=1)
    here = film.film_vertices[film.film_faces[common]].mean(axis=1)
    areas = face_areas(film.substrate_vertices, faces)
    return np.linalg.norm(there - here, axis=1), areas[common]


def outline_difference(view: View, first: Snapshot, second: Snapshot) -> float:
    """Pixels that show film in one view only, relative to those that do in either."""
    ours, theirs = view.outline(first), view.outline(second)
    either = int(np.count_nonzero(ours | theirs))
    return float(np.count_nonzero(ours ^ theirs) / either) if either else 0.0
