"""Made-up snapshots of peeling paint, as test data for pictures: holes, curled borders, split pieces, rust
and streaks.
"""

from __future__ import annotations

import numpy as np

from weathercoat.mesh.surface import face_areas, vertex_normals
from weathercoat.sim.snapshot import Snapshot


def make_plate(side: int = 40, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """An upright square in the x-y plane that faces +z, of `side` x `side` jittered cells with random
    diagonals.
    """
    random = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, side + 1), np.linspace(-0.5, 0.5, side + 1))
    inner = (np.abs(x) < 0.499) & (np.abs(y) < 0.499)
    x = x + inner * random.uniform(-0.3, 0.3, x.shape) / side
    y = y + inner * random.uniform(-0.3, 0.3, y.shape) / side
    vertices = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    corner = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (
        part.ravel() for part in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1])
    )
    swap = random.random(len(a)) < 0.5
    first = np.where(swap[:, None], np.stack([a, b, c], 1), np.stack([a, b, d], 1))
    second = np.where(swap[:, None], np.stack([a, c, d], 1), np.stack([b, c, d], 1))
    return vertices, np.concatenate([first, second]).astype(np.int32)


def make_sphere(count: int = 1500, radius: float = 0.5) -> tuple[np.ndarray, np.ndarray]:
    """A sphere of about `count` evenly spread vertices (Fibonacci lattice, convex hull)."""
    from scipy.spatial import ConvexHull

    index = np.arange(count) + 0.5
    polar, azimuth = np.arccos(1.0 - 2.0 * index / count), np.pi * (1.0 + 5.0**0.5) * index
    points = np.stack(
        [np.sin(polar) * np.cos(azimuth), np.cos(polar), np.sin(polar) * np.sin(azimuth)], axis=1
    )
    hull = ConvexHull(points)
    faces = hull.simplices.astype(np.int32)
    normal = np.cross(points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]])
    inside_out = np.einsum("ij,ij->i", normal, hull.equations[:, :3]) < 0
    faces[inside_out] = faces[inside_out][:, ::-1]
    return radius * points, faces


def _smooth_field(
    points: np.ndarray, random: np.random.Generator, waves: int, frequency: float
) -> np.ndarray:
    """A smooth random field, rescaled to the quantiles 0 to 1 of its values."""
    direction = random.normal(size=(waves, 3)) * frequency
    field = np.sin(points @ direction.T + random.uniform(0, 2 * np.pi, waves)).sum(axis=1)
    return np.argsort(np.argsort(field, kind="stable"), kind="stable") / len(field)


def make_peeled_snapshot(
    vertices: np.ndarray,
    faces: np.ndarray,
    age: float,
    *,
    pieces: int = 250,
    curl: float = 1.0,
    seed: int = 3,
) -> Snapshot:
    """A snapshot of a peeling film at `age` (0 intact, 1 almost bare), gravity along -y."""
    random = np.random.default_rng(seed)
    size = float(np.sqrt(face_areas(vertices, faces).sum()))
    normals = vertex_normals(vertices, faces)
    points = (vertices - vertices.mean(axis=0)) / size
    field = 0.8 * _smooth_field(points, random, 24, 7.0) + 0.2 * _smooth_field(points, random, 40, 30.0)
    lost, band = 0.75 * age**1.5, 0.22 * min(1.0, 4.0 * age)

    centres = points[faces].mean(axis=1)
    seeds = centres[random.choice(len(centres), min(pieces, len(centres)), replace=False)]
    cell = np.argmin(((centres[:, None] - seeds) ** 2).sum(axis=2), axis=1)
    cell_field = np.bincount(cell, field[faces].mean(axis=1), len(seeds)) / np.maximum(
        np.bincount(cell, minlength=len(seeds)), 1
    )
    gone = cell_field[cell] < lost
    piece = np.where(cell_field[cell] < lost + band, cell + 1, 0)

    kept = np.flatnonzero(~gone)
    keys = faces[kept].astype(np.int64) * (len(seeds) + 1) + piece[kept][:, None]
    unique, film_faces = np.unique(keys, return_inverse=True)
    origin, owner = (unique // (len(seeds) + 1)).astype(np.int32), unique % (len(seeds) + 1)
    near = (
        np.clip((lost + band - field[origin]) / max(band, 1e-9), 0.0, 2.0) * (owner > 0)
        if band > 0
        else np.zeros(len(origin))
    )
    bend = curl * near**2
    anchor = np.where((owner > 0)[:, None], seeds[owner - 1], points[origin])
    toward = anchor - points[origin]
    film = vertices[origin] + size * (0.018 * bend[:, None] * normals[origin] + 0.10 * bend[:, None] * toward)

    bare = ~np.isin(np.arange(len(vertices)), origin)
    exposed = np.clip((lost - field) / 0.25, 0.0, 1.0)
    rust = np.clip(
        np.where(bare, 0.15 + 1.1 * exposed, 0.3 * np.clip((lost + band - field) / 0.2, 0, 1) * (age > 0)),
        0,
        1,
    )
    sources = np.flatnonzero(bare)[:: max(1, int(bare.sum()) // 120)]
    stain = np.zeros(len(origin))
    for source in sources:
        drop = points[source] - points[origin]
        across = np.hypot(drop[:, 0], drop[:, 2])
        stain = np.maximum(
            stain, np.where(drop[:, 1] > 0, np.exp(-((across / 0.012) ** 2) - drop[:, 1] / 0.12), 0.0)
        )
    height = (vertices[:, 1] - vertices[:, 1].min()) / np.ptp(vertices[:, 1])
    return Snapshot(
        step=int(1000 * age),
        age=age,
        film_vertices=film,
        film_faces=film_faces.reshape(-1, 3).astype(np.int32),
        film_face=kept.astype(np.int32),
        film_origin=origin,
        film_rust=stain * min(1.0, 2 * age),
        separated=near > 0,
        separation_age=near * 0.1,
        adhesion=1.0 - near,
        film_color=np.full((len(origin), 3), 0.5),
        substrate_vertices=vertices,
        substrate_normals=normals,
        substrate_faces=faces,
        substrate_rust=rust,
        dust=0.5 * age * (1.0 - height),
        bare=bare,
        substrate_color=np.full((len(vertices), 3), 0.4),
    )
