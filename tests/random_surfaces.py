"""Random surfaces for property tests: shapes of several topologies, shaken, torn and turned."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from hypothesis import strategies as st

from tests import zoo
from weathercoat.mesh import shapes
from weathercoat.mesh.formats.polygons import Polygons
from weathercoat.mesh.repair import repair
from weathercoat.mesh.surface import Surface, Vectors, face_areas

_BASES = {
    **zoo.ZOO,
    "sheet": lambda: shapes.make_random_sheet(120),
    "plate": lambda: shapes.make_plate(columns=7, rows=5),
    "curved plate": lambda: shapes.make_curved_plate(columns=8, rows=6),
    "sphere": lambda: shapes.make_sphere(subdivisions=1),
    "torus": lambda: shapes.make_torus(segments=9, sides=5),
    "box": lambda: shapes.make_box(cells=2),
}


class Damage(NamedTuple):
    """What happens to a shape: every vertex is moved by up to `jitter` of the shortest edge; of the faces,
    the share `holes` is missing, and of the others `flips` are the wrong way round.
    """

    base: str
    seed: int
    jitter: float
    holes: float
    flips: float


damages = st.builds(
    Damage,
    base=st.sampled_from(sorted(_BASES)),
    seed=st.integers(0, 10**6),
    jitter=st.sampled_from([0.0, 0.0, 0.1, 0.2]),
    holes=st.sampled_from([0.0, 0.0, 0.1, 0.4]),
    flips=st.sampled_from([0.0, 0.0, 0.1, 0.4]),
)


def damaged(damage: Damage) -> tuple[Vectors, list[list[int]]]:
    """Positions and faces of a shape after its damage; at least one face is left."""
    surface = _BASES[damage.base]()
    random = np.random.default_rng(damage.seed)
    corner = surface.vertices[surface.faces]
    shortest = np.linalg.norm(np.roll(corner, 1, axis=1) - corner, axis=2).min()
    shift = random.uniform(-1, 1, surface.vertices.shape) * damage.jitter * shortest
    keep = random.random(len(surface.faces)) >= damage.holes
    keep[int(random.integers(len(keep)))] = True
    faces = surface.faces[keep]
    turn = random.random(len(faces)) < damage.flips
    faces[turn] = faces[turn, ::-1]
    return surface.vertices + shift, faces[random.permutation(len(faces))].tolist()


def brought_in(positions: Vectors, faces: list[list[int]]) -> Surface:
    """The surface that reading makes of these."""
    polygons = Polygons(
        positions=np.asarray(positions, np.float64),
        corners=np.array([i for face in faces for i in face], np.int64),
        sizes=np.array([len(face) for face in faces], np.int64),
    )
    return repair(polygons, up=(0.0, 0.0, 1.0), name="random", format="obj", max_faces=10**6)


def area_of(positions: Vectors, faces: list[list[int]]) -> float:
    """Area of all triangles."""
    return float(face_areas(np.asarray(positions), np.array(faces, np.int32)).sum())
