"""What each pixel shows: class, instance, depth and normal, by one ray through its centre."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from weathercoat.errors import LimitError
from weathercoat.mesh.surface import Indices, Vectors, face_areas
from weathercoat.output.camera import Camera
from weathercoat.output.condition import BARE, CLASSES, LIFTED, RUST, film_classes, metal_classes
from weathercoat.output.display import DisplayMesh, Normalisation
from weathercoat.output.pieces import number_flakes, number_pieces
from weathercoat.output.rays import RayQueries
from weathercoat.output.shading import BACK, BARE_PART, METAL, OWN_PART
from weathercoat.sim.snapshot import Snapshot

# The number of a class in pictures and files: that of `CLASSES` and one, between the background and what has
# no paint.
BACKGROUND = 0
UNPAINTED = len(CLASSES) + 1
NAMES = ("background", *CLASSES, "unpainted")
PALETTE = (
    (0, 0, 0),
    (70, 130, 180),
    (240, 228, 66),
    (230, 25, 75),
    (170, 170, 170),
    (183, 65, 14),
    (245, 150, 60),
    (110, 95, 70),
    (60, 60, 110),
)
_MOST_INSTANCES = 65_535  # that a 16-bit picture can number
_RAYS_AT_ONCE = 100_000


@dataclass(frozen=True)
class FaceLabels:
    """What the faces of a snapshot are: class (m,) and flake (m,) of the film, class (t,) and patch (t,) of
    the metal.

    Classes are numbers of `NAMES`. Flakes are pieces of lifted film, numbered from 1; patches are stretches
    of metal whose film has fallen, numbered on from there; 0 where there is none. Numbers follow the order of
    the faces. shares: of the painted area, by class, film before metal.
    """

    film: NDArray[np.uint8]
    flake: Indices
    metal: NDArray[np.uint8]
    patch: Indices
    shares: dict[str, float]


def label_faces(snapshot: Snapshot) -> FaceLabels:
    """The labels of all faces of a snapshot. Raises LimitError for more instances than can be numbered."""
    film, metal = film_classes(snapshot), metal_classes(snapshot)
    flake = number_flakes(snapshot)
    patch = number_pieces(snapshot.substrate_faces, (metal == BARE) | (metal == RUST))
    flakes = int(flake.max(initial=0))
    if flakes + int(patch.max(initial=0)) > _MOST_INSTANCES:
        raise LimitError(f"more than {_MOST_INSTANCES:,} flakes and patches", remedy="leave out instance")
    areas = face_areas(snapshot.substrate_vertices, snapshot.substrate_faces)
    found = metal.copy()
    found[snapshot.film_face] = film
    by_class = np.bincount(found, areas, len(CLASSES)) / areas.sum()
    return FaceLabels(
        film=film + np.uint8(1),
        flake=flake,
        metal=metal + np.uint8(1),
        patch=np.where(patch > 0, patch + np.int32(flakes), 0).astype(np.int32),
        shares={name: float(share) for name, share in zip(CLASSES, by_class, strict=True)},
    )


@dataclass(frozen=True)
class Passes:
    """Labels of a picture, each (height, width, ...).

    category uint8: numbers of `NAMES`; instance uint16: flakes and patches of `FaceLabels`; depth float64:
    along the camera's axis, in the model's units, 0 on the background; normal float32 (..., 3): unit, in the
    camera's axes (x right, y down, z away), towards the camera, 0 on the background.
    """

    category: NDArray[np.uint8]
    instance: NDArray[np.uint16]
    depth: Vectors
    normal: NDArray[np.float32]


def draw_passes(
    mesh: DisplayMesh,
    rays: RayQueries,
    labels: FaceLabels,
    camera: Camera,
    normalise: Normalisation,
    width: int,
    height: int,
) -> Passes:
    """Labels of a picture of the display mesh; rays are queries on it, the camera is in display units."""
    face = np.full(height * width, -1, np.int32)
    weights = np.zeros((height * width, 2), np.float32)
    band = max(1, _RAYS_AT_ONCE // width)
    for first in range(0, height, band):
        rows = np.arange(first, min(first + band, height))
        directions = camera.directions(rows, np.arange(width), width, height)
        origins = np.tile(camera.position.astype(np.float32), (len(directions), 1))
        part = slice(first * width, (first + len(rows)) * width)
        face[part], weights[part] = rays.nearest(origins, directions)
    seen = np.flatnonzero(face >= 0)
    of_face_class, of_face_instance = _display_labels(mesh, labels)
    category, instance = np.zeros(len(face), np.uint8), np.zeros(len(face), np.uint16)
    category[seen], instance[seen] = of_face_class[face[seen]], of_face_instance[face[seen]]
    samples = mesh.at(face[seen], weights[seen])
    away = samples.position - camera.position
    depth = np.zeros(len(face))
    depth[seen] = normalise.size * (away @ camera.forward)
    axes = np.stack([camera.right, -camera.up, camera.forward], axis=1)
    facing = np.where(np.einsum("ij,ij->i", samples.normal, away) > 0.0, -1.0, 1.0)
    normal = np.zeros((len(face), 3), np.float32)
    normal[seen] = (facing[:, None] * samples.normal) @ axes
    shape = (height, width)
    return Passes(
        category.reshape(shape), instance.reshape(shape), depth.reshape(shape), normal.reshape(*shape, 3)
    )


def _display_labels(mesh: DisplayMesh, labels: FaceLabels) -> tuple[NDArray[np.uint8], NDArray[np.uint16]]:
    """Class and instance of each face of a display mesh, (t,)."""
    category = np.full(len(mesh.faces), UNPAINTED, np.uint8)
    instance = np.zeros(len(mesh.faces), np.uint16)
    metal = mesh.kind == METAL
    category[metal] = labels.metal[mesh.source[metal]]
    instance[metal] = labels.patch[mesh.source[metal]]
    film = ~metal & (mesh.kind != BARE_PART) & (mesh.kind != OWN_PART)
    category[film] = labels.film[mesh.source[film]]
    category[mesh.kind == BACK] = LIFTED + 1
    instance[film] = labels.flake[mesh.source[film]]
    return category, instance
