"""How near the camera comes to each object, for the detail that `quality: auto` chooses."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from weathercoat.mesh.closest import find_closest, make_closest_tree
from weathercoat.mesh.surface import Surface, Vectors, face_areas
from weathercoat.scene.exposure import sample_surface
from weathercoat.scene.graph import CameraPath, Scene, SceneObject, place

# Of an object's surface: the second number where the first leaves the distance open by more than a share.
SAMPLES = (1536, 24_576)
_OPEN_SHARE = 0.2
# How far, in mean distances between samples, a point of the surface may lie from the nearest sample.
_COVERAGE = 1.5
_LEAST = 1e-6  # sizes: a camera that touches an object is this far away
UNSEEN = 1e9  # the distance that a config of objects out of sight has, which is the largest that it takes


def nearest_distances(scene: Scene, names: Iterable[str] | None = None) -> dict[str, float | None]:
    """The least distance from the camera path to the part of each object that it shows, in units of the
    scene; None for objects that it never shows, and {} where the scene has no camera.

    names: of the objects; all by default. What is shown lies in the cone round the corners of the image, so
    that a roll of the camera does not matter; what stands before an object does not hide it. The distance is
    at most the true one, by no more than the distance between samples.
    """
    if scene.camera is None:
        return {}
    wanted = None if names is None else set(names)
    return {
        item.name: _nearest(scene.meshes[item.mesh], item, scene.camera)
        for item in scene.objects
        if wanted is None or item.name in wanted
    }


def pixels_per_unit(camera: CameraPath, distance: float) -> float:
    """Pixels for a unit of the scene at a distance."""
    return camera.image_height / (2.0 * distance * math.tan(math.radians(camera.field_of_view) / 2.0))


def _nearest(surface: Surface, item: SceneObject, camera: CameraPath) -> float | None:
    vertices = place(surface.vertices, item.transform)
    area = float(face_areas(vertices, surface.faces).sum())
    distance: float | None = None
    for samples in SAMPLES:
        spacing = _COVERAGE * math.sqrt(area / samples)
        points, _ = sample_surface(surface, item, samples)
        from_samples = np.array(
            [
                _shown_distance(points, position, direction, camera, spacing)
                for position, direction in zip(camera.positions, camera.directions, strict=True)
            ]
        )
        shown = np.flatnonzero(np.isfinite(from_samples))
        if not len(shown):
            return None
        tree = make_closest_tree(vertices, surface.faces)
        _, near = find_closest(tree, camera.positions[shown], np.zeros(len(shown), np.int32))
        exact = np.linalg.norm(near - camera.positions[shown], axis=1)
        distance = float(np.maximum(exact, from_samples[shown] - spacing).min())
        if spacing <= _OPEN_SHARE * distance:
            break
    assert distance is not None
    return max(distance, _LEAST * math.sqrt(area))


def _shown_distance(
    points: Vectors, position: Vectors, direction: Vectors, camera: CameraPath, margin: float
) -> float:
    """Distance to the nearest of points (s, 3) that is shown, give or take a margin; infinite for none."""
    away = points - position
    depth = np.einsum("ij,j->i", away, direction)
    aside = np.linalg.norm(away - depth[:, None] * direction, axis=1)
    slope = np.tan(np.radians(camera.field_of_view) / 2.0) * np.hypot(1.0, camera.aspect)
    outside: NDArray[np.float64] = (aside - depth * slope) / np.hypot(1.0, slope)
    is_shown = (outside <= margin) & (depth > -margin)
    return float(np.linalg.norm(away[is_shown], axis=1).min()) if is_shown.any() else np.inf
