"""A camera as a node of glTF, which an animation moves along its path."""

from __future__ import annotations

from typing import Any

import numpy as np

from weathercoat.output.glb import GlbBuffer
from weathercoat.scene.graph import CameraPath

# A camera that looks nearly straight up or down has another axis for its upper side.
_STEEP = 0.999


def add_camera(
    document: dict[str, Any],
    buffer: GlbBuffer,
    camera: CameraPath,
    up: tuple[float, float, float],
    seconds: float,
) -> None:
    """Add a node `camera` to the document's nodes, and where the camera has a path an animation, with so many
    seconds from one view to the next.
    """
    from scipy.spatial.transform import Rotation

    backward = -camera.directions
    level = np.where((np.abs(backward @ up) > _STEEP)[:, None], np.roll(up, 1), up)
    right = np.cross(level, backward)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    axes = np.stack([right, np.cross(backward, right), backward], axis=2)
    turns = Rotation.from_matrix(axes).as_quat()
    # the shorter way from view to view
    turns[1:] *= np.cumprod(np.where(np.sum(turns[1:] * turns[:-1], axis=1) < 0, -1.0, 1.0))[:, None]
    lens = {
        "yfov": float(np.radians(camera.field_of_view)),
        "aspectRatio": camera.aspect,
        "znear": 0.01,
    }
    document["cameras"] = [{"type": "perspective", "perspective": lens}]
    node = {
        "name": "camera",
        "camera": 0,
        "translation": camera.positions[0].tolist(),
        "rotation": turns[0].tolist(),
    }
    document["nodes"].append(node)
    if len(turns) == 1:
        return
    times = seconds * np.arange(len(turns))
    key = buffer.add(times[:, None], "SCALAR", bounds=True, target=None)
    target = len(document["nodes"]) - 1
    paths = (("translation", camera.positions, "VEC3"), ("rotation", turns, "VEC4"))
    document["animations"] = [
        {
            "name": "camera",
            "channels": [
                {"sampler": i, "target": {"node": target, "path": path}}
                for i, (path, _, _) in enumerate(paths)
            ],
            "samplers": [
                {"input": key, "output": buffer.add(values, kind, target=None)} for _, values, kind in paths
            ],
        }
    ]
