"""How far the paint is gone, in the figures and grades that an inspector would write down.

Areas and lengths are at rest, in units of the model; percent are of the area of what is assessed: the whole
painted surface, a material group, a named part. What counts as rusted, flaked and so on says
`output.condition`, what the grades are `grades`.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weathercoat.grades import (
    d610_distribution,
    d610_grade,
    flake_size_class,
    flaking_class,
    rusting_degree,
)
from weathercoat.mesh.surface import Indices, Surface, Vectors
from weathercoat.output.condition import Condition, assess, percent_of
from weathercoat.output.cracks import Openings, junction_angles, make_graph
from weathercoat.sim.snapshot import Snapshot

WHOLE = "whole"
# Angles within 20 degrees of the two ways in which cracks meet: a later one stopped by an older at a right
# angle (which leaves one straight angle), and three that part from one point.
_RIGHT, _THIRD, _SPAN = 90.0, 120.0, 20.0
_COLUMNS = (
    "area", "flaked_percent", "rusted_percent", "runoff_percent", "lifted_percent", "dirt_percent",
    "cracked_percent", "patches.count", "patches.median_area", "patches.largest_area",
    "patches.typical_length", "patches.largest_length", "rust_patches.count", "rust_patches.median_area",
    "rust_patches.largest_area", "rust_patches.typical_length", "rust_patches.largest_length",
    "cracks.length", "cracks.density", "cracks.mean_width", "junctions.count", "junctions.median_angle",
    "junctions.right_share", "junctions.third_share", "grades.iso_4628_3", "grades.iso_4628_5",
    "grades.iso_4628_5_size", "grades.iso_4628_5_depth", "grades.astm_d610", "grades.astm_d610_distribution",
    "millimetres.area", "millimetres.patches_median_area", "millimetres.patches_largest_area",
    "millimetres.patches_typical_length", "millimetres.patches_largest_length", "millimetres.cracks_length",
    "millimetres.cracks_density", "millimetres.cracks_mean_width",
)  # fmt: skip


def measure_severity(
    snapshot: Snapshot, openings: Openings, millimetres: float | None = None
) -> dict[str, Any]:
    """The severity of a snapshot: `whole`, and by name `groups` (material groups, where there are several)
    and `parts` (where they divide the surface in another way).

    openings: those of the snapshot; millimetres: the length of a unit of the model, where it is known. Of
    each:

    - area, and percent of it: flaked, rusted, runoff, lifted, dirt (see `condition.Condition`), and cracked,
    the area of the openings of cracks, seen along the metal's normal; - patches of flaked metal and
    rust_patches: faces that share an edge make one, within what is assessed; count, median_area,
    largest_area, typical_length (the largest dimension that patches with half of the area reach) and
    largest_length; - cracks: length, density (by area), mean_width; - junctions of cracks and outlines:
    count, median_angle between neighbouring arms [degrees], and the shares of angles near 90 and near 120; -
    grades: equivalents computed from area, the size class where millimetres are known; - millimetres: areas,
    lengths and densities in mm², mm and mm/mm², or None.
    """
    scene = _Scene(snapshot, openings)
    everything = np.zeros(len(scene.condition.area), np.int32)
    found: dict[str, Any] = {WHOLE: scene.measure(everything, 1, millimetres)[0]}
    for key, (labels, names) in divide(snapshot.surface).items():
        figures = scene.measure(labels, len(names), millimetres)
        found[key] = dict(zip(names, figures, strict=True))
    return found


def write_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """The severity of the rows of a report's snapshots as CSV: a line for each snapshot and for the whole,
    each group and each part. Columns are the keys of the figures, joined by dots.
    """
    stream = io.StringIO()
    lines = csv.writer(stream, lineterminator="\n")
    lines.writerow(["step", "age", "of", "name", *_COLUMNS])
    for row in rows:
        for kind, name, figures in entries(row["severity"]):
            lines.writerow([row["step"], repr(float(row["age"])), kind, name, *map(_cell(figures), _COLUMNS)])
    return stream.getvalue()


def entries(severity: Mapping[str, Any]) -> Iterator[tuple[str, str, Mapping[str, Any]]]:
    """What the severity of a snapshot is of: whole, group or part; its name, empty for the whole; figures."""
    yield WHOLE, "", severity[WHOLE]
    for kind in ("group", "part"):
        for name, figures in severity[f"{kind}s"].items():
            yield kind, name, figures


def _cell(figures: Mapping[str, Any]) -> Any:
    def cell(column: str) -> str:
        value: Any = figures
        for key in column.split("."):
            value = None if value is None else value[key]
        if value is None:
            return ""
        return repr(value) if isinstance(value, float) else str(value)

    return cell


def divide(surface: Surface | None) -> dict[str, tuple[Indices, tuple[str, ...]]]:
    """The ways in which a surface is divided, `groups` and `parts`: the number of each face, (t,), in the
    names that faces have, sorted. No names where the surface is one, or the parts are the groups.
    """
    none = (np.empty(0, np.int32), ())
    found: dict[str, tuple[Indices, tuple[str, ...]]] = {"groups": none, "parts": none}
    if surface is None:
        return found
    groups = _merge(surface.face_group, surface.groups)
    if len(groups[1]) > 1:
        found["groups"] = groups
    if surface.face_part is not None:
        parts = _merge(surface.face_part, tuple(part.name for part in surface.parts))
        pairs = len(np.unique(groups[0].astype(np.int64) * len(parts[1]) + parts[0]))
        if len(parts[1]) > 1 and (pairs != len(parts[1]) or pairs != len(groups[1])):
            found["parts"] = parts
    return found


def _merge(number: Indices, names: Sequence[str]) -> tuple[Indices, tuple[str, ...]]:
    """Numbers of the names that are used, sorted, the same for the same name."""
    used = sorted({names[i] for i in np.unique(number)})
    place = {name: i for i, name in enumerate(used)}
    table = np.array([place.get(name, -1) for name in names], np.int32)
    return table[number], tuple(used)


@dataclass(frozen=True)
class _Scene:
    """What figures of any part of a snapshot are made of."""

    snapshot: Snapshot
    openings: Openings

    @cached_property
    def condition(self) -> Condition:
        return assess(self.snapshot)

    @cached_property
    def neighbours(self) -> NDArray[np.int64]:
        """Pairs of faces of the metal that share an edge, (p, 2)."""
        faces = self.snapshot.substrate_faces.astype(np.int64)
        ahead = np.roll(faces, -1, axis=1)
        count = len(self.snapshot.substrate_vertices)
        key = (np.minimum(faces, ahead) * count + np.maximum(faces, ahead)).ravel()
        order = np.argsort(key, kind="stable")
        same = np.flatnonzero(np.diff(key[order]) == 0)
        return np.stack([order[same] // 3, order[same + 1] // 3], axis=1)

    @cached_property
    def cracks(self) -> tuple[Indices, Vectors, Vectors]:
        """Of each half-edge of the film at a crack its face of the metal, half its length, and half the area
        of the opening.
        """
        at = np.flatnonzero(self.openings.apart)
        snapshot, twin = self.snapshot, self.openings.twin[at]
        tail, head = snapshot.film_faces.ravel(), np.roll(snapshot.film_faces, -1, axis=1).ravel()
        place = snapshot.film_vertices
        width = np.zeros(len(at))
        for own, other, end in ((tail[at], head[twin], 0), (head[at], tail[twin], 1)):
            gap = place[own] - place[other]
            normal = snapshot.substrate_normals[self.openings.ends[at, end]]
            gap -= np.einsum("ij,ij->i", gap, normal)[:, None] * normal
            width += 0.5 * np.linalg.norm(gap, axis=1)
        half = 0.5 * self.openings.lengths(snapshot)[at]
        return snapshot.film_face[at // 3], half, half * width

    @cached_property
    def junctions(self) -> tuple[Indices, Vectors]:
        """Of each angle between neighbouring arms of the cracks a face of the metal at it, and its size."""
        snapshot = self.snapshot
        graph = make_graph(self.openings.edges(), snapshot.substrate_vertices)
        vertex, angle = junction_angles(graph, snapshot.substrate_vertices, snapshot.substrate_normals)
        face_at = np.zeros(len(snapshot.substrate_vertices), np.int32)
        face_at[snapshot.substrate_faces[::-1]] = np.arange(len(snapshot.substrate_faces), dtype=np.int32)[
            ::-1, None
        ]
        return face_at[vertex], angle

    def measure(self, labels: Indices, count: int, millimetres: float | None) -> list[dict[str, Any]]:
        """The figures of each of `count` parts; labels (t,) tell to which a face belongs."""
        if count == 0:
            return []
        condition = self.condition
        area = np.bincount(labels, condition.area, count)
        crack_face, half_length, opening = self.cracks
        crack_length = np.bincount(labels[crack_face], half_length, count)
        crack_area = np.bincount(labels[crack_face], opening, count)
        junction_face, angle = self.junctions
        angle_of = _split(labels[junction_face], count)
        patches = self._patches(condition.flaked, labels, count)
        rust_patches = self._patches(condition.rusted, labels, count)
        found = []
        for i in range(count):
            own = slice(None) if count == 1 else labels == i
            flaked = percent_of(condition.flaked[own], condition.area[own])
            rusted = percent_of(condition.rusted[own], condition.area[own])
            figures: dict[str, Any] = {
                "area": float(area[i]),
                "flaked_percent": flaked,
                "rusted_percent": rusted,
                "runoff_percent": percent_of(condition.runoff[own], condition.area[own]),
                "lifted_percent": percent_of(condition.lifted[own], condition.area[own]),
                "dirt_percent": percent_of(condition.dirty[own], condition.area[own]),
                "cracked_percent": 100.0 * float(crack_area[i] / area[i]) if area[i] > 0.0 else 0.0,
                "patches": patches[i].figures(),
                "rust_patches": rust_patches[i].figures(),
                "cracks": {
                    "length": float(crack_length[i]),
                    "density": float(crack_length[i] / area[i]) if area[i] > 0.0 else 0.0,
                    "mean_width": (float(crack_area[i] / crack_length[i]) if crack_length[i] > 0.0 else 0.0),
                },
                "junctions": _junction_figures(angle[angle_of[i]]),
            }
            figures["grades"] = _grades(flaked, rusted, patches[i], rust_patches[i], area[i], millimetres)
            figures["millimetres"] = None if millimetres is None else _in_millimetres(figures, millimetres)
            found.append(figures)
        return found

    def _patches(self, chosen: NDArray[np.bool_], labels: Indices, count: int) -> list[_Patches]:
        """The connected patches of the chosen faces (t,), within each part."""
        pairs = self.neighbours
        a, b = pairs[:, 0], pairs[:, 1]
        pairs = pairs[chosen[a] & chosen[b] & (labels[a] == labels[b])]
        faces = np.flatnonzero(chosen)
        patch = _connect(pairs, len(chosen))[faces]
        first, number = np.unique(patch, return_inverse=True)
        areas: Vectors = np.bincount(number, self.condition.area[faces], len(first)).astype(np.float64)
        lengths = _extents(self.snapshot, faces, number, len(first))
        return [_Patches(areas[of], lengths[of]) for of in _split(labels[first], count)]


@dataclass(frozen=True)
class _Patches:
    """Areas and largest dimensions (k,) of the patches of a part."""

    area: Vectors
    length: Vectors

    def figures(self) -> dict[str, Any]:
        """Their number and sizes; 0 where there are none."""
        some = len(self.area) > 0
        return {
            "count": len(self.area),
            "median_area": float(np.median(self.area)) if some else 0.0,
            "largest_area": float(self.area.max()) if some else 0.0,
            "typical_length": self.typical_length(),
            "largest_length": float(self.length.max()) if some else 0.0,
        }

    def typical_length(self) -> float:
        """The largest dimension that patches with half of the area reach; 0 where there are none."""
        if not len(self.area):
            return 0.0
        order = np.argsort(-self.length, kind="stable")
        reached = np.cumsum(self.area[order])
        return float(self.length[order][np.searchsorted(reached, 0.5 * reached[-1])])


def _grades(
    flaked: float,
    rusted: float,
    patches: _Patches,
    rust_patches: _Patches,
    area: float,
    millimetres: float | None,
) -> dict[str, Any]:
    """Equivalents of grades, computed from areas; the film goes to the metal, which is depth b."""
    grade = d610_grade(rusted)
    by_size = np.sort(rust_patches.area)[::-1].tolist()
    size = None if millimetres is None else flake_size_class(patches.typical_length() * millimetres)
    return {
        "iso_4628_3": rusting_degree(rusted),
        "iso_4628_5": flaking_class(flaked),
        "iso_4628_5_size": size,
        "iso_4628_5_depth": "b" if flaked > 0.0 else "",
        "astm_d610": grade,
        "astm_d610_distribution": d610_distribution(grade, by_size, area),
    }


def _in_millimetres(figures: Mapping[str, Any], unit: float) -> dict[str, float]:
    """The lengths and areas of figures, where a unit of the model is so many millimetres."""
    patches, cracks = figures["patches"], figures["cracks"]
    return {
        "area": figures["area"] * unit**2,
        "patches_median_area": patches["median_area"] * unit**2,
        "patches_largest_area": patches["largest_area"] * unit**2,
        "patches_typical_length": patches["typical_length"] * unit,
        "patches_largest_length": patches["largest_length"] * unit,
        "cracks_length": cracks["length"] * unit,
        "cracks_density": cracks["density"] / unit,
        "cracks_mean_width": cracks["mean_width"] * unit,
    }


def _junction_figures(angles: Vectors) -> dict[str, Any]:
    """Figures of the angles of a part's junctions."""

    def near(wanted: float) -> float:
        return float(np.mean(np.abs(angles - wanted) <= _SPAN)) if len(angles) else 0.0

    return {
        # The angles at a junction make a whole turn.
        "count": round(float(angles.sum()) / 360.0),
        "median_angle": float(np.median(angles)) if len(angles) else 0.0,
        "right_share": near(_RIGHT),
        "third_share": near(_THIRD),
    }


def _split(labels: Indices, count: int) -> list[NDArray[np.intp]]:
    """The places of each of `count` labels."""
    order = np.argsort(labels, kind="stable")
    return np.split(order, np.cumsum(np.bincount(labels, minlength=count))[:-1])


def _connect(pairs: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """For each of `count` things the least of those that pairs (p, 2) connect it with."""
    root = np.arange(count)
    while True:
        a, b = root[pairs[:, 0]], root[pairs[:, 1]]
        apart = a != b
        if not apart.any():
            return root
        pairs, a, b = pairs[apart], a[apart], b[apart]
        np.minimum.at(root, np.maximum(a, b), np.minimum(a, b))
        while True:
            above = root[root]
            if np.array_equal(above, root):
                break
            root = above


def _extents(snapshot: Snapshot, faces: NDArray[np.intp], number: NDArray[np.intp], count: int) -> Vectors:
    """The largest dimension of each of `count` patches, from the vertex farthest from its middle to the one
    farthest from that; `number` is the patch of each of the `faces`.
    """
    if not count:
        return np.empty(0)
    order = np.argsort(number, kind="stable")
    corner = snapshot.substrate_vertices[snapshot.substrate_faces[faces[order]]].reshape(-1, 3)
    patch = np.repeat(number[order], 3)
    start = np.flatnonzero(np.diff(patch, prepend=-1))
    size = np.diff(np.append(start, len(patch)))
    middle = np.add.reduceat(corner, start) / size[:, None]
    for _ in range(2):
        away = np.linalg.norm(corner - middle[patch], axis=1)
        farthest = np.maximum.reduceat(away, start)
        at = np.flatnonzero(away == farthest[patch])
        first = at[np.flatnonzero(np.diff(patch[at], prepend=-1))]
        middle = corner[first]
    return np.asarray(farthest)
