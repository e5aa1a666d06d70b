"""Dust: a veil on surfaces that look up, in hollows, low on the object (paper 3.2, after Ishitobi et al.
2020).
"""

from __future__ import annotations

import numpy as np

from weathercoat.mesh.dihedral import all_bends
from weathercoat.mesh.halfedge import HalfEdgeMesh
from weathercoat.mesh.surface import Vectors


def dust_exposure(mesh: HalfEdgeMesh, up: Vectors) -> Vectors:
    """How readily dust stays on each rest vertex, 0 to 1, (n0,).

    Height (1 at the lowest point, 0 at the highest, along `up`) times slope, (1 - g . n) / 2 with gravity g =
    -up, times concavity, 1 - phi / 2 pi with phi the mean outer dihedral of the edges there.
    """
    height = np.sum(mesh.rest_positions * up, axis=1)
    low, high = float(height.min()), float(height.max())
    height_term = 1.0 - (height - low) / (high - low) if high > low else np.ones(len(height))
    slope_term = 0.5 * (1.0 + np.sum(mesh.rest_normals * up, axis=1))
    bends = np.empty(len(mesh.twin))
    all_bends(mesh.positions, mesh.tail, mesh.twin, bends)
    ends = mesh.faces.reshape(-1)
    count = np.bincount(ends, minlength=len(height))
    mean_bend = np.bincount(ends, bends, len(height)) / np.maximum(count, 1)
    return height_term * slope_term * np.clip(0.5 - mean_bend / (2.0 * np.pi), 0.0, 1.0)


def dust_at(exposure: Vectors, rate: float, age: float) -> Vectors:
    """Dust on each rest vertex at an age, 0 to 1, (n0,)."""
    return np.minimum(rate * exposure * age, 1.0)
