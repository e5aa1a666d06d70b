"""Severity against areas that are known, patches against a count one by one, and the table against JSON."""

from __future__ import annotations

import csv
import dataclasses
import io
import math
from typing import Any

import numpy as np
import pytest

from tests.output.snapshots import make_sheet, make_snapshot
from weathercoat.grades import D610_MOST, FLAKING_FROM, RUST_FROM
from weathercoat.mesh.surface import Part, make_surface
from weathercoat.output.cracks import find_openings
from weathercoat.output.severity import entries, measure_severity, write_table
from weathercoat.sim.snapshot import Snapshot


def _measure(snapshot: Snapshot, millimetres: float | None = None) -> dict[str, Any]:
    return measure_severity(snapshot, find_openings(snapshot), millimetres)


def _whole(snapshot: Snapshot, millimetres: float | None = None) -> dict[str, Any]:
    figures: dict[str, Any] = _measure(snapshot, millimetres)["whole"]
    return figures


def make_plate(percent: float, *, rust: float = 1.0) -> Snapshot:
    """A plate of area 6 whose film has fallen from one end, `percent` of it, where the metal has `rust`."""
    border = 3.0 * percent / 100.0
    xs = [0.0, border, 3.0]
    vertices = np.array([[x, 0.0, z] for x in xs for z in (0.0, 2.0)])
    faces = np.array([[0, 1, 3], [0, 3, 2], [2, 3, 5], [2, 5, 4]], np.int32)
    plate = make_snapshot(mesh=(vertices, faces), lost=2)
    return dataclasses.replace(plate, substrate_rust=np.full(6, rust))


def _falling(count: int, mesh: tuple[np.ndarray, np.ndarray], seed: int) -> Snapshot:
    """A film from which `count` faces anywhere have fallen."""
    vertices, faces = mesh
    keep = np.sort(np.random.default_rng(seed).permutation(len(faces))[count:])
    whole = make_snapshot(mesh=mesh)
    used, renumbered = np.unique(faces[keep], return_inverse=True)
    return dataclasses.replace(
        whole,
        film_vertices=vertices[used],
        film_faces=renumbered.reshape(-1, 3).astype(np.int32),
        film_face=keep.astype(np.int32),
        film_origin=used.astype(np.int32),
        film_rust=whole.film_rust[used],
        separated=whole.separated[used],
        separation_age=whole.separation_age[used],
        adhesion=whole.adhesion[used],
        film_color=whole.film_color[used],
    )


def test_whole_paint() -> None:
    figures = _whole(dataclasses.replace(make_snapshot(), film_rust=np.zeros(25), dust=np.zeros(25)))
    assert all(figures[key] == 0.0 for key in figures if key.endswith("_percent"))
    assert figures["area"] == pytest.approx(1.0)
    assert figures["patches"]["count"] == figures["rust_patches"]["count"] == 0
    assert figures["grades"] == {
        "iso_4628_3": "Ri0", "iso_4628_5": 0, "iso_4628_5_size": None, "iso_4628_5_depth": "",
        "astm_d610": 10, "astm_d610_distribution": "",
    }  # fmt: skip
    assert figures["millimetres"] is None


@pytest.mark.parametrize("grade", [1, 2, 3, 4, 5])
def test_grades_turn_at_the_edges_of_their_areas(grade: int) -> None:
    for edges, key, name in ((RUST_FROM, "iso_4628_3", "Ri{}"), (FLAKING_FROM, "iso_4628_5", "{}")):
        for factor, expected in ((1 - 1e-9, grade - 1), (1 + 1e-9, grade)):
            found = _whole(make_plate(edges[grade - 1] * factor))["grades"][key]
            assert str(found) == name.format(expected)


@pytest.mark.parametrize("most", D610_MOST)
def test_d610_turns_at_the_edges_of_its_areas(most: float) -> None:
    below, above = (_whole(make_plate(most * f))["grades"]["astm_d610"] for f in (1 - 1e-9, 1 + 1e-9))
    assert (below, above) == (D610_MOST.index(most) + 1, D610_MOST.index(most))


def test_bare_metal_is_flaked_and_not_rusted() -> None:
    figures = _whole(make_plate(12.0, rust=0.05))
    assert figures["flaked_percent"] == pytest.approx(12.0)
    assert figures["rusted_percent"] == 0.0
    assert (figures["grades"]["iso_4628_3"], figures["grades"]["iso_4628_5_depth"]) == ("Ri0", "b")


def test_sizes_of_one_patch() -> None:
    patches = _whole(make_plate(50.0))["patches"]
    assert patches["count"] == 1
    assert patches["largest_area"] == patches["median_area"] == pytest.approx(3.0)
    assert patches["largest_length"] == patches["typical_length"] == pytest.approx(math.hypot(1.5, 2.0))


@pytest.mark.parametrize("count", [1, 40, 150, 280])
def test_patches_are_those_that_a_search_finds(count: int) -> None:
    snapshot = _falling(count, make_sheet(12), seed=count)
    faces = [{tuple(sorted((f[i], f[i - 1]))) for i in range(3)} for f in snapshot.substrate_faces.tolist()]
    waiting = set(range(len(faces))) - set(snapshot.film_face.tolist())
    sizes = []
    while waiting:
        stack, size = [waiting.pop()], 0
        while stack:
            face = stack.pop()
            size += 1
            near = {other for other in waiting if faces[other] & faces[face]}
            waiting -= near
            stack.extend(near)
        sizes.append(size / len(faces))
    found = _whole(snapshot)["patches"]
    assert found["count"] == len(sizes)
    assert found["largest_area"] == pytest.approx(max(sizes))
    assert found["median_area"] == pytest.approx(np.median(sizes))


def test_groups_and_parts_make_the_whole() -> None:
    snapshot = _falling(60, make_sheet(12), seed=5)
    middle = snapshot.substrate_vertices[snapshot.substrate_faces].mean(axis=1)
    parts = (Part("bow"), Part("stern"), Part("bow"))
    surface = make_surface(
        snapshot.substrate_vertices,
        snapshot.substrate_faces,
        face_group=(middle[:, 0] > 0.7).astype(np.int32) * 2,
        groups=("hull", "unused", "deck"),
        face_part=np.digitize(middle[:, 2], [0.2, 0.6]).astype(np.int32),
        parts=parts,
    )
    found = _measure(dataclasses.replace(snapshot, surface=surface))
    assert list(found["groups"]) == ["deck", "hull"]
    assert list(found["parts"]) == ["bow", "stern"]
    for division in (found["groups"], found["parts"]):
        for key in ("area", "flaked_percent", "rusted_percent", "dirt_percent", "runoff_percent"):
            weights = [1.0 if key == "area" else figures["area"] for figures in division.values()]
            total = sum(w * figures[key] for w, figures in zip(weights, division.values(), strict=True))
            assert total == pytest.approx(found["whole"][key], rel=1e-12)  # of area 1
        assert (
            sum(figures["patches"]["count"] for figures in division.values())
            >= found["whole"]["patches"]["count"]
        )


def test_parts_that_are_the_groups_are_not_told_twice() -> None:
    snapshot = make_snapshot()
    group = np.arange(32, dtype=np.int32) % 2
    surface = make_surface(
        snapshot.substrate_vertices, snapshot.substrate_faces, face_group=group, groups=("a", "b"),
        face_part=1 - group, parts=(Part("right"), Part("left")),
    )  # fmt: skip
    found = _measure(dataclasses.replace(snapshot, surface=surface))
    assert list(found["groups"]) == ["a", "b"]
    assert found["parts"] == {}


def test_cracks_have_length_density_and_width() -> None:
    cut = make_snapshot(split_column=2)
    apart = cut.film_vertices.copy()
    behind = apart[:, 1] > 0.05
    apart[behind] += [0.02, 0.3, 0.0]  # rising from the metal does not widen the opening
    figures = _whole(dataclasses.replace(cut, film_vertices=apart))
    assert figures["cracks"]["length"] == pytest.approx(1.0)
    assert figures["cracks"]["density"] == pytest.approx(1.0)
    assert figures["cracks"]["mean_width"] == pytest.approx(0.02)
    assert figures["cracked_percent"] == pytest.approx(2.0)
    assert figures["junctions"]["count"] == 0


def test_cracks_that_cross_have_right_angles() -> None:
    """Film cut along both middle lines of the sheet into four squares meets in four right angles."""
    vertices, faces = make_sheet(4)
    middle = vertices[faces].mean(axis=1)
    quarter = (middle[:, 0] > 0.5) * 2 + (middle[:, 2] > 0.5)
    key = quarter[:, None] * len(vertices) + faces
    used, renumbered = np.unique(key, return_inverse=True)
    origin = (used % len(vertices)).astype(np.int32)
    whole = make_snapshot()
    more = {
        name: getattr(whole, name)[origin]
        for name in ("film_rust", "separated", "separation_age", "adhesion", "film_color")
    }
    cut = dataclasses.replace(
        whole,
        film_vertices=vertices[origin],
        film_faces=renumbered.reshape(-1, 3).astype(np.int32),
        film_origin=origin,
        **more,  # type: ignore[arg-type]
    )
    assert _whole(cut)["junctions"] == {
        "count": 1, "median_angle": pytest.approx(90.0), "right_share": 1.0, "third_share": 0.0,
    }  # fmt: skip


def test_scale_changes_lengths_and_areas_and_no_grade() -> None:
    small = _falling(60, make_sheet(12), seed=5)
    large = dataclasses.replace(
        small, film_vertices=1e3 * small.film_vertices, substrate_vertices=1e3 * small.substrate_vertices
    )
    one, two = _whole(small, 1000.0), _whole(large, 1.0)
    assert one["grades"] == two["grades"]
    assert one["millimetres"] == pytest.approx(two["millimetres"])
    assert one["patches"]["largest_area"] * 1e6 == pytest.approx(two["patches"]["largest_area"])
    for key in one:
        if key.endswith("_percent"):
            assert one[key] == pytest.approx(two[key])


@pytest.mark.parametrize(("unit", "size"), [(0.01, 1), (1.0, 2), (5.0, 4), (1000.0, 5)])
def test_size_class_needs_the_unit(unit: float, size: int) -> None:
    assert _whole(make_plate(50.0))["grades"]["iso_4628_5_size"] is None  # 2.5 units long
    assert _whole(make_plate(50.0), unit)["grades"]["iso_4628_5_size"] == size


def test_the_table_holds_what_the_report_holds() -> None:
    snapshot = _falling(60, make_sheet(12), seed=5)
    group = np.arange(288, dtype=np.int32) // 100
    surface = make_surface(
        snapshot.substrate_vertices, snapshot.substrate_faces, face_group=group, groups=("a", 'b, "c"', "d")
    )
    severity = _measure(dataclasses.replace(snapshot, surface=surface), 10.0)
    lines = list(csv.DictReader(io.StringIO(write_table([{"step": 7, "age": 0.5, "severity": severity}]))))
    assert [(line["of"], line["name"]) for line in lines] == [
        ("whole", ""), ("group", "a"), ("group", 'b, "c"'), ("group", "d"),
    ]  # fmt: skip
    for line, (_, _, figures) in zip(lines, entries(severity), strict=True):
        flat = {
            f"{key}.{inner}" if inner else key: item
            for key, value in figures.items()
            for inner, item in (value.items() if isinstance(value, dict) else [("", value)])
        }
        assert list(line)[4:] == list(flat)
        for key, value in flat.items():
            assert line[key] == (repr(value) if isinstance(value, float) else str(value)), key
