"""Ray queries on a mesh: by Embree where its wheel is installed, else by a tree of boxes of our own."""

from __future__ import annotations

from contextlib import suppress
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from weathercoat.mesh.surface import Indices, Vectors
from weathercoat.target import target

Floats = NDArray[np.float32]


class RayQueries(Protocol):
    """What pictures ask of a mesh; origins and directions are float32 (r, 3)."""

    def nearest(self, origins: Floats, directions: Floats) -> tuple[Indices, Floats]:
        """The first face each ray meets, int32 (r,), -1 for none; weights (r, 2) of its later corners."""

    def blocked(self, origins: Floats, directions: Floats, reach: float) -> NDArray[np.bool_]:
        """Whether each ray meets any face within `reach`, (r,)."""


class EmbreeRays:
    """Ray queries by Embree."""

    def __init__(self, vertices: Vectors, faces: Indices) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self._scene = EmbreeScene(robust=True)
        # Keep the mesh: Embree reads its buffers for as long as the scene lives.
        self._mesh = TriangleMesh(
            self._scene, np.ascontiguousarray(vertices, np.float32), np.ascontiguousarray(faces, np.int32)
        )

    def nearest(self, origins: Floats, directions: Floats) -> tuple[Indices, Floats]:
        hits = self._scene.run(origins, directions, output=1)
        return hits["primID"], np.stack([hits["u"], hits["v"]], axis=1)

    def blocked(self, origins: Floats, directions: Floats, reach: float) -> NDArray[np.bool_]:
        limits = np.full(len(origins), reach, np.float32)
        answer = self._scene.run(origins, directions, limits, query="OCCLUDED")
        return answer == 0  # type: ignore[no-any-return]


def make_rays(vertices: Vectors, faces: Indices) -> RayQueries:
    """Ray queries on a mesh of vertices (n, 3) and faces (m, 3), m > 0, with the best means at hand.

    Embree meets other faces at edges on other processors, so it has no part in results that are for all.
    """
    if target() is None:
        with suppress(ImportError):
            return EmbreeRays(vertices, faces)
    from weathercoat.output.tree import TreeRays

    return TreeRays(vertices, faces)
