"""What a page holds of a run: the metal once, and of each snapshot what differs from it.

The film's vertices are sent in the order of the metal's vertices that they stem from. The film's faces then
follow from the metal's: which are there, how many copies each vertex has, and which copy a corner uses.
Places of film and metal are on one grid of 16 bits, and the film's are sent as the difference from rest,
which is 0 where it holds.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weathercoat.errors import CorruptError, LimitError
from weathercoat.mesh.surface import Surface, Vectors
from weathercoat.output.display import Normalisation
from weathercoat.output.viewer.arrays import Chunk, pack_chunk
from weathercoat.output.viewer.occlusion import bake_occlusion
from weathercoat.sim.snapshot import Snapshot

STEPS = 65_535  # of the grid, along the longest side of its box
MOST_FACES = 4_000_000  # of metal and film in all snapshots: a page of some 20 MB
STRAIN_RANGE = 0.05  # the overlay's ends; what is strained more looks like the end


@dataclass(frozen=True)
class Grid:
    """Positions in display units as whole numbers: `low` (3,) is 0, and `spacing` lies between neighbours."""

    low: Vectors
    spacing: float

    @classmethod
    def around(cls, points: Iterable[Vectors]) -> Grid:
        """The grid whose box holds all points, each (k, 3)."""
        ends = [(each.min(axis=0), each.max(axis=0)) for each in points if len(each)]
        low, high = np.min([e[0] for e in ends], axis=0), np.max([e[1] for e in ends], axis=0)
        return cls(low, max(float((high - low).max()), 1e-9) / STEPS)

    def __call__(self, points: Vectors) -> NDArray[np.uint16]:
        """The numbers (k, 3) of points (k, 3)."""
        return np.clip(np.rint((points - self.low) / self.spacing), 0, STEPS).astype(np.uint16)

    def as_dict(self) -> dict[str, Any]:
        """For the page."""
        return {"low": _rounded(self.low), "spacing": float(f"{self.spacing:.9g}")}


@dataclass(frozen=True)
class Content:
    """The chunks of a page, the first that of the metal, and what it says about them."""

    about: dict[str, Any]
    chunks: list[Chunk]


def pack_run(
    snapshots: Sequence[Snapshot],
    *,
    untouched: Surface | None = None,
    risk: Mapping[int, Vectors] | None = None,
    base: NDArray[np.uint8] | None = None,
) -> Content:
    """What a page shows of the snapshots of one run, one at least.

    untouched: parts without paint. risk: by step, the ratio of lift to adhesion of each vertex of the film.
    base: the film's own colour over each vertex of the metal (n, 3), None where it shows its paint.
    Raises LimitError where the page would be too large for a browser, CorruptError where a film's faces are
    not those of its metal.
    """
    _require_moderate(snapshots)
    first = snapshots[0]
    normalise = Normalisation.of(first)
    rest = normalise(first.substrate_vertices)
    films = [normalise(snapshot.film_vertices) for snapshot in snapshots]
    grid = Grid.around([rest, *films])
    adhesion = max([1e-9, *(float(each.adhesion.max(initial=0.0)) for each in snapshots)])
    metal: dict[str, Any] = {
        "rest": (grid(rest), 3),
        "faces": (first.substrate_faces.astype(np.uint32), 3),
    }
    about: dict[str, Any] = {
        "grid": grid.as_dict(),
        "vertices": len(rest),
        "faces": len(first.substrate_faces),
        "ranges": {"adhesion": float(f"{adhesion:.6g}"), "strain": STRAIN_RANGE},
    }
    if base is not None:
        metal["base"] = (base, 3)
    if untouched is not None and len(untouched.faces):
        placed = normalise(untouched.vertices)
        box = Grid.around([placed])
        metal["untouched"] = (box(placed), 3)
        metal["untouched_faces"] = (untouched.faces.astype(np.uint32), 3)
        if untouched.colors is not None:
            metal["untouched_colors"] = (_bytes(untouched.colors[:, :3], 1.0), 3)
        about["untouched"] = box.as_dict()
    chunks = [pack_chunk(metal)]
    for snapshot, film in zip(snapshots, films, strict=True):
        arrays = _film_arrays(snapshot, film, rest, grid)
        arrays |= _scalar_arrays(snapshot, adhesion, (risk or {}).get(snapshot.step))
        chunks.append(pack_chunk(arrays))
    return Content(about, chunks)


def film_order(snapshot: Snapshot) -> NDArray[np.int64]:
    """The film's vertices in the order in which a page holds them, (k,)."""
    return np.argsort(snapshot.film_origin, kind="stable")


def vertex_strain(snapshot: Snapshot) -> Vectors:
    """Strain of the film at each of its vertices, (k,): the mean over the faces' edges that end there of
    length / rest length - 1.
    """
    tails, heads = snapshot.film_faces.ravel(), np.roll(snapshot.film_faces, -1, axis=1).ravel()
    origin, rest = snapshot.film_origin, snapshot.substrate_vertices
    now = np.linalg.norm(snapshot.film_vertices[heads] - snapshot.film_vertices[tails], axis=1)
    before = np.linalg.norm(rest[origin[heads]] - rest[origin[tails]], axis=1)
    strain = np.divide(now, before, out=np.ones_like(now), where=before > 0) - 1.0
    count = len(snapshot.film_vertices)
    total = np.bincount(tails, strain, count) + np.bincount(heads, strain, count)
    ends = np.bincount(tails, minlength=count) + np.bincount(heads, minlength=count)
    return total / np.maximum(ends, 1)


def _film_arrays(snapshot: Snapshot, film: Vectors, rest: Vectors, grid: Grid) -> dict[str, Any]:
    """Where the film is: `present` (t,) faces, `copies` (n,) of each vertex, `rank` (m, 3) of the copy that
    each corner uses, `shift` (k, 3) of each vertex from rest on the grid.
    """
    order, faces = film_order(snapshot), np.argsort(snapshot.film_face, kind="stable")
    origin = snapshot.film_origin
    corners = snapshot.film_faces[faces]
    if not np.array_equal(origin[corners], snapshot.substrate_faces[snapshot.film_face[faces]]):
        raise CorruptError("the film's faces are not those of its metal", remedy="run again")
    copies = np.bincount(origin, minlength=len(rest))
    place = np.empty(len(order), np.int64)
    place[order] = np.arange(len(order))
    rank = place[corners] - (np.cumsum(copies) - copies)[origin[corners]]
    present = np.zeros(len(snapshot.substrate_faces), np.uint8)
    present[snapshot.film_face] = 1
    return {
        "present": (present, 0),
        "copies": (copies.astype(np.uint16), 0),
        "rank": (rank.astype(np.uint16), 0),
        "shift": (grid(film)[order] - grid(rest)[origin[order]], 0),
    }


def _scalar_arrays(snapshot: Snapshot, adhesion: float, risk: Vectors | None) -> dict[str, Any]:
    """Bytes for each vertex: of the metal `rust`, `dirt`, `open`; of the film the others."""
    size = Normalisation.of(snapshot).size
    order = film_order(snapshot)
    light = bake_occlusion(snapshot, size)
    arrays = {
        "rust": _bytes(snapshot.substrate_rust, 1.0),
        "dirt": _bytes(snapshot.dust, 1.0),
        "open_metal": _bytes(light.metal, 1.0),
        "open_front": _bytes(light.front[order], 1.0),
        "open_back": _bytes(light.back[order], 1.0),
        "stain": _bytes(snapshot.film_rust[order], 1.0),
        "adhesion": _bytes(snapshot.adhesion[order], adhesion),
        "strain": _bytes(vertex_strain(snapshot)[order] + STRAIN_RANGE, 2.0 * STRAIN_RANGE),
    }
    if risk is not None:
        arrays["risk"] = _bytes(risk[order], 1.0)
    return {name: (values, 0) for name, values in arrays.items()}


def _bytes(values: Vectors, most: float) -> NDArray[np.uint8]:
    """Values from 0 to `most` as bytes."""
    return np.rint(np.clip(values / most, 0.0, 1.0) * 255.0).astype(np.uint8)


def _require_moderate(snapshots: Sequence[Snapshot]) -> None:
    faces = sum(len(each.film_faces) for each in snapshots) + len(snapshots[0].substrate_faces)
    if faces > MOST_FACES:
        raise LimitError(
            f"{len(snapshots)} snapshots have {faces:,} faces, and a page holds at most {MOST_FACES:,}",
            remedy="name fewer with --steps, or run with fewer faces",
        )


def _rounded(values: Vectors) -> list[float]:
    return [float(f"{value:.9g}") for value in values]
