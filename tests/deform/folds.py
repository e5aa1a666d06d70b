"""Strips that are to fold into polygons: targets that can be met exactly."""

from __future__ import annotations

import numpy as np

from tests import zoo
from tests.zoo import make_mesh
from weathercoat.deform.constraints import Constraints, make_constraints, refresh_round, release
from weathercoat.deform.parameters import DeformParameters
from weathercoat.mesh.halfedge import HalfEdgeMesh
from weathercoat.mesh.surface import Vectors

STILL = DeformParameters(curl_rate=0.0, deformation_film_thickness=0.05, deformation_solver="newton")
"""Targets are what constraints start from."""


def clamped(rungs: int, wanted: float) -> tuple[HalfEdgeMesh, Constraints]:
    """A flat ladder whose first two rungs are held and whose other rungs are to bend by `wanted` [rad]; no
    substrate.
    """
    mesh = make_mesh(zoo.make_ladder(rungs, length=0.1, width=0.1))
    mesh.rest_normals[:] = 0.0
    constraints = make_constraints(mesh)
    vertices = np.arange(4, 2 * rungs, dtype=np.int32)
    release(mesh, constraints, vertices, 0.0)
    aim_at(mesh, constraints, wanted)
    return mesh, constraints


def aim_at(mesh: HalfEdgeMesh, constraints: Constraints, wanted: float) -> None:
    """Let every rung want a bend, and every diagonal none."""
    for h in np.flatnonzero(~np.isnan(constraints.angle_start)):
        along = abs(mesh.tail[h] // 2 - mesh.tail[3 * (h // 3) + (h + 1) % 3] // 2)
        constraints.angle_start[h] = wanted if along == 0 else 0.0
    refresh_round(mesh, constraints, np.arange(mesh.vertex_count, dtype=np.int32))


def polygon(rungs: int, wanted: float) -> Vectors:
    """Where the vertices of `clamped` are to be."""
    turn = -wanted * np.maximum(np.arange(rungs - 1), 0)
    steps = 0.1 * np.stack([np.cos(turn), np.zeros(rungs - 1), np.sin(turn)], axis=1)
    rung = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    return np.repeat(rung, 2, axis=0) + np.tile([(0, 0, 0), (0, 0.1, 0)], (rungs, 1))
