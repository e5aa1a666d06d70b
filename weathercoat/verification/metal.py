"""The metal of a run: the same in every snapshot, so that what follows from it is worked out once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weathercoat.verification.fields import take
from weathercoat.verification.findings import Ledger
from weathercoat.verification.ply import PlySnapshot
from weathercoat.verification.precision import DOUBLE, REPORTED, ROUNDINGS, SINGLE

_HAIR = 5e-4  # depth of the metal under the film, in sizes, as docs/formats.md promises


@dataclass(frozen=True)
class Metal:
    """Metal of n vertices and m faces, as its first file gives it, and what follows from it.

    stored: positions (n, 3) in the file, a hair beneath the surface; vertices (n, 3), on it, each coordinate
    within `reach`; normals (n, 3); faces (m, 3); areas (m,) and their sum `area`, within `area_error`;
    twin: int64 (3 m,), the opposite of half-edge 3 f + i, -1 at a rim; lengths (3 m,) of half-edges;
    extent: largest coordinate.
    """

    stored: NDArray[np.float64]
    stored_normals: NDArray[np.float32]
    vertices: NDArray[np.float64]
    normals: NDArray[np.float64]
    faces: NDArray[np.int32]
    twin: NDArray[np.int64]
    lengths: NDArray[np.float64]
    areas: NDArray[np.float64]
    area: float
    area_error: float
    length_error: float
    reach: float
    extent: float
    hair: float

    def area_error_of(self, faces: NDArray[np.int32]) -> float:
        """How far the summed area of some faces can be from the true one."""
        halves = 0.5 * float(self.lengths.reshape(-1, 3)[faces].sum())
        return self.length_error * halves + ROUNDINGS * DOUBLE * self.area


def make_metal(ledger: Ledger, file: str, snapshot: PlySnapshot, report: dict[str, Any]) -> Metal | None:
    """The metal of a snapshot whose arrays are finite and whose indices are in range, checked against the
    report; None where it is no manifold.
    """
    count = int(np.count_nonzero(snapshot.part == 0))
    faces = np.ascontiguousarray(snapshot.faces[snapshot.face_part == 0])
    stored, stored_normals = snapshot.positions[:count], snapshot.normals[:count]
    twin = _pair(ledger, file, faces, count)
    if twin is None or not _check_fans(ledger, file, faces, twin, count):
        return None

    normals = stored_normals.astype(np.float64)
    vertices = stored + snapshot.hair * normals
    extent = float(np.abs(snapshot.positions).max(initial=0.0))
    # Stored is v - hair n; what comes back differs by the rounding of n, and by that of two sums.
    reach = snapshot.hair * SINGLE + 2 * DOUBLE * (extent + snapshot.hair)
    corner = vertices[faces]
    sides = np.roll(corner, -1, axis=1) - corner
    lengths = np.sqrt(np.einsum("fij,fij->fi", sides, sides)).ravel()
    areas = triangle_areas(corner)
    area = float(areas.sum())
    # An area changes by at most half of the opposite side as a corner moves by one.
    length_error = 2.0 * np.sqrt(3.0) * (reach + ROUNDINGS * DOUBLE * extent)
    metal = Metal(
        stored=stored,
        stored_normals=stored_normals,
        vertices=vertices,
        normals=normals,
        faces=faces,
        twin=twin,
        lengths=lengths,
        areas=areas,
        area=area,
        area_error=length_error * 0.5 * float(lengths.sum()) + ROUNDINGS * DOUBLE * area,
        length_error=length_error,
        reach=reach,
        extent=extent,
        hair=snapshot.hair,
    )
    _compare(ledger, file, metal, report)
    return metal


def triangle_areas(corner: NDArray[np.float64]) -> NDArray[np.float64]:
    """Areas (m,) of triangles (m, 3, 3)."""
    a, b = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    x = a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1]
    y = a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2]
    z = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return 0.5 * np.sqrt(x * x + y * y + z * z)


def check_same(ledger: Ledger, file: str, snapshot: PlySnapshot, metal: Metal) -> bool:
    """Whether a snapshot has the metal of the ones before."""
    count, face_count = len(metal.stored), len(metal.faces)
    counts = int(np.count_nonzero(snapshot.part == 0)), int(np.count_nonzero(snapshot.face_part == 0))
    same = ledger.expect(
        "metal-unchanged",
        file,
        counts == (count, face_count),
        f"the metal has {counts[0]:,} vertices and {counts[1]:,} faces,"
        f" in the snapshot before it had {count:,} and {face_count:,}",
    )
    if not same:
        return False
    if snapshot.hair != metal.hair:
        ledger.expect(
            "metal-unchanged", file, False, f"the hair is {snapshot.hair}, before it was {metal.hair}"
        )
    stays = (snapshot.positions[:count] == metal.stored) & (snapshot.normals[:count] == metal.stored_normals)
    same = ledger.expect_all(
        "metal-unchanged",
        file,
        stays,
        lambda i: f"metal vertex {i} is not where it was in the snapshot before",
    )
    same &= ledger.expect_all(
        "metal-unchanged",
        file,
        snapshot.faces[:face_count] == metal.faces,
        lambda i: f"metal face {i} has other corners than in the snapshot before",
    )
    return same


def _pair(ledger: Ledger, file: str, faces: NDArray[np.int32], count: int) -> NDArray[np.int64] | None:
    """The twin of each half-edge (3 m,), -1 without one; None where two run the same way."""
    tail = faces.ravel().astype(np.int64)
    head = faces[:, [1, 2, 0]].ravel().astype(np.int64)
    forward, backward = tail * count + head, head * count + tail
    order = np.argsort(forward, kind="stable")
    keys = forward[order]
    single = np.ones(len(keys), np.bool_)
    single[1:] = (keys[1:] != keys[:-1]) & (tail[order[1:]] != head[order[1:]])
    if not ledger.expect_all(
        "metal-manifold",
        file,
        single,
        lambda i: (
            f"metal face {order[i] // 3} runs from vertex {tail[order[i]]} to {head[order[i]]}"
            f" as face {order[max(i - 1, 0)] // 3} does"
        ),
    ):
        return None
    place = np.minimum(np.searchsorted(keys, backward), len(keys) - 1)
    found = order[place] if len(keys) else place
    return np.where(keys[place] == backward, found, -1) if len(keys) else found


def _check_fans(
    ledger: Ledger, file: str, faces: NDArray[np.int32], twin: NDArray[np.int64], count: int
) -> bool:
    """Whether the faces round each vertex are one fan: a walk from its first corner meets them all."""
    tail = faces.ravel()
    start = np.full(count, -1, np.int64)
    start[tail[::-1]] = np.arange(len(tail))[::-1]
    rim = np.flatnonzero(twin < 0)
    start[tail[rim]] = rim
    met = (start >= 0).astype(np.int64)
    begun = np.flatnonzero(start >= 0)
    here = start[begun]
    while len(begun):
        here = twin[here - here % 3 + (here + 2) % 3]
        goes_on = (here >= 0) & (here != start[begun])
        begun, here = begun[goes_on], here[goes_on]
        met[begun] += 1
    return ledger.expect_all(
        "metal-manifold",
        file,
        met == np.bincount(tail, minlength=count),
        lambda i: f"the faces round metal vertex {i} are more than one fan",
    )


def _compare(ledger: Ledger, file: str, metal: Metal, report: dict[str, Any]) -> None:
    """Hold the metal against `meshes.film` of the report."""
    found = take(report, "meshes.film", dict)
    inner = metal.twin >= 0
    edges = int(np.count_nonzero(~inner)) + int(np.count_nonzero(inner)) // 2
    used = np.zeros(len(metal.vertices), np.bool_)
    used[metal.faces] = True
    box = metal.vertices[used]
    diagonal = float(np.linalg.norm(box.max(axis=0) - box.min(axis=0)))
    rim = float(metal.lengths[~inner].sum())
    total = rim + 0.5 * float(metal.lengths[inner].sum())
    error = metal.length_error
    figures: list[tuple[str, float, float]] = [
        ("faces", len(metal.faces), 0.0),
        ("vertices", int(np.count_nonzero(used)), 0.0),
        ("area", metal.area, metal.area_error),
        ("diagonal", diagonal, error),
        ("edges.count", edges, 0.0),
        ("edges.mean_length", total / edges, error),
        ("edges.boundary_length", rim, error * int(np.count_nonzero(~inner))),
    ]
    for key, own, tolerance in figures:
        told = take(found, key, float)
        ledger.expect(
            "metal-figures",
            "run.json",
            abs(own - told) <= tolerance + REPORTED * abs(told),
            f"meshes.film.{key} is {told:.12g}, but {file} gives {own:.12g}",
        )
    depth = _HAIR * np.sqrt(metal.area)
    ledger.expect(
        "hair",
        file,
        abs(metal.hair - depth) <= depth * (metal.area_error / metal.area + ROUNDINGS * DOUBLE),
        f"the metal is {metal.hair:.12g} beneath the surface, not {_HAIR:g} sizes, which are {depth:.12g}",
    )
