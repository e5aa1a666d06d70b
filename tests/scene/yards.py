"""Small scenes of boxes, for tests of what depends on where things stand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from weathercoat.mesh.shapes import make_box, make_plate, make_sphere
from weathercoat.scene.graph import Scene, SceneObject


def at(
    x: float = 0.0, y: float = 0.0, z: float = 0.0, scale: Sequence[float] = (1.0, 1.0, 1.0)
) -> np.ndarray:
    """A transform (4, 4) that scales and moves."""
    matrix = np.diag([*scale, 1.0])
    matrix[:3, 3] = x, y, z
    return matrix


def box(name: str, *place: float, scale: Sequence[float] = (1.0, 1.0, 1.0)) -> SceneObject:
    """A box whose centre lies at a place."""
    return SceneObject(name, "cube", at(*place, scale=scale))


def yard(*objects: SceneObject, ground: float | None = 0.0, **more: object) -> Scene:
    """A scene of objects that place `cube`, `sphere` of radius 0.5, or `plate`, which faces +z."""
    cube = make_box(1.0, 1.0, 1.0, 2)
    centred = replace(cube, vertices=cube.vertices - 0.5 * (cube.vertices.min(0) + cube.vertices.max(0)))
    meshes = {"cube": centred, "sphere": make_sphere(0.5, 3), "plate": make_plate(1.0, 1.0, 4, 4)}
    return Scene("yard", meshes, objects, ground=ground, **more)  # type: ignore[arg-type]


def closed_room(width: float) -> list[SceneObject]:
    """Six walls round the place (0, 2, 0), each `width` wide."""
    half, thin = 0.5 * width, 0.05
    wide = width + thin
    walls = [((0, 2 - half, 0), (wide, thin, wide)), ((0, 2 + half, 0), (wide, thin, wide))]
    for sign in (-1, 1):
        walls.append(((sign * half, 2, 0), (thin, wide, wide)))
        walls.append(((0, 2, sign * half), (wide, wide, thin)))
    return [box(f"wall-{i}", *place, scale=scale) for i, (place, scale) in enumerate(walls)]
