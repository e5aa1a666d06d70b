"""Figures against sums that can be done by hand on a sheet of side 1, and the files that hold them."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.output.snapshots import CELLS, make_grouped_surface, make_sheet, make_snapshot
from weathercoat.errors import AccessError, CheckError, Note
from weathercoat.mesh.surface import make_surface
from weathercoat.output.report import (
    PAPER_ROWS,
    make_report,
    make_timing,
    measure_snapshot,
    measure_surface,
    sha256,
    write_json,
)

FACE_AREA = 0.5 / CELLS**2


def test_an_intact_film_has_no_damage() -> None:
    figures = measure_snapshot(make_snapshot())
    for key in (
        "separated_share",
        "lost_area",
        "lost_share",
        "affected_share",
        "crack_length",
        "outline_length",
    ):
        assert figures[key] == 0.0, key
    assert figures["flakes"] == {
        "count": 0, "area": 0.0, "median_area": 0.0, "largest_area": 0.0, "largest_areas": [],
    }  # fmt: skip


def test_a_cut_is_as_long_as_the_edges_along_it() -> None:
    figures = measure_snapshot(make_snapshot(split_column=2))
    assert figures["crack_length"] == pytest.approx(1.0, rel=1e-12)
    assert figures["outline_length"] == 0.0


def test_separated_faces_count_by_their_corners() -> None:
    # Behind the cut all corners are separated, before it none: half of the sheet.
    assert measure_snapshot(make_snapshot(split_column=2))["separated_share"] == pytest.approx(0.5, rel=1e-12)


def test_a_crack_within_the_film_ends_at_its_tips() -> None:
    """The middle two of four edges of a grid line are broken: one vertex split, two tips shared."""
    whole = make_snapshot()
    middle = 2 * (CELLS + 1) + 2
    column = np.arange(len(whole.film_vertices)) // (CELLS + 1)
    faces = whole.film_faces.copy()
    moved = column[faces].max(axis=1) > 2
    faces[moved] = np.where(faces[moved] == middle, len(column), faces[moved])
    more = {
        name: np.concatenate([getattr(whole, name), getattr(whole, name)[[middle]]])
        for name in ("film_vertices", "film_origin", "film_rust", "separated", "separation_age", "adhesion")
    }
    cracked = dataclasses.replace(whole, film_faces=faces, **more)
    assert measure_snapshot(cracked)["crack_length"] == pytest.approx(2 / CELLS, rel=1e-12)


def test_lost_faces_have_an_area_and_an_outline() -> None:
    figures = measure_snapshot(make_snapshot(lost=1))
    assert figures["lost_area"] == figures["lost_share"] == pytest.approx(FACE_AREA, rel=1e-12)
    # One leg of the face at the corner lies on the rim of the sheet; the other leg and the diagonal border on
    # film.
    assert figures["outline_length"] == pytest.approx((1 + np.sqrt(2)) / CELLS, rel=1e-12)
    assert figures["crack_length"] == 0.0


def test_a_bare_sheet_has_lost_everything() -> None:
    figures = measure_snapshot(make_snapshot(lost=2 * CELLS**2))
    assert figures["lost_share"] == pytest.approx(1.0, rel=1e-12)
    assert figures["film_rust"] == figures["outline_length"] == figures["separated_share"] == 0.0


def test_means_are_weighted_by_area() -> None:
    snapshot = make_snapshot()
    x = snapshot.substrate_vertices[:, 0]
    stretched = snapshot.substrate_vertices * (1.0, 1.0, 1.0) + np.outer(x**2, (1.0, 0.0, 0.0))
    snapshot = dataclasses.replace(
        snapshot,
        substrate_vertices=stretched,
        substrate_rust=0.25 * stretched[:, 0],
        dust=np.full(len(x), 0.3),
    )
    figures = measure_snapshot(snapshot)
    # Rust is linear in x, which now runs from 0 to 2: the mean over the area is that at the middle.
    assert figures["substrate_rust"] == pytest.approx(0.25, rel=1e-12)
    assert figures["dust"] == pytest.approx(0.3, rel=1e-12)


def test_flakes_are_counted_and_the_largest_listed() -> None:
    areas = np.arange(1.0, 31.0)
    flakes = measure_snapshot(make_snapshot(), flake_areas=areas)["flakes"]
    assert (flakes["count"], flakes["area"], flakes["median_area"]) == (30, 465.0, 15.5)
    assert flakes["largest_areas"] == list(np.arange(30.0, 10.0, -1.0))


def test_figures_do_not_depend_on_the_numbering_of_vertices() -> None:
    snapshot = make_snapshot(lost=4, split_column=2)
    order = np.random.default_rng(3).permutation(len(snapshot.film_vertices))
    place = np.argsort(order)
    names = (
        "film_vertices",
        "film_origin",
        "film_rust",
        "separated",
        "separation_age",
        "adhesion",
        "film_color",
    )
    shuffled = dataclasses.replace(
        snapshot,
        film_faces=np.roll(place[snapshot.film_faces], 1, axis=1).astype(np.int32),
        **{name: getattr(snapshot, name)[order] for name in names},
    )
    first, second = measure_snapshot(snapshot), measure_snapshot(shuffled)
    assert first["crack_length"] > 0.5
    whole, again = (figures.pop("severity")["whole"] for figures in (first, second))
    for key in set(first) - {"flakes"}:
        assert first[key] == pytest.approx(second[key], rel=1e-12)
    for key in set(whole) - {"grades", "millimetres"}:
        assert whole[key] == pytest.approx(again[key], rel=1e-12)


def test_figures_of_a_surface() -> None:
    figures = measure_surface(make_surface(*make_sheet()))
    assert (figures["faces"], figures["vertices"], figures["edges"]["count"]) == (32, 25, 56)
    assert figures["area"] == pytest.approx(1.0)
    assert figures["edges"]["boundary_length"] == pytest.approx(4.0)
    assert figures["smallest_angle"]["worst"] == pytest.approx(45.0)
    assert measure_surface(make_grouped_surface())["groups"] == ["body", "tyre left"]


def report(**changes: Any) -> dict[str, Any]:
    content: dict[str, Any] = {
        "config": {"tension": {"rate": 0.1234567890123456}},
        "seed": 1,
        "inputs": {"a.obj": "00"},
        "meshes": {"input": measure_surface(make_surface(*make_sheet()))},
        "notes": [Note("W-DEGENERATE", 2, "2 faces without area dropped")],
        "quality": None,
        "stopped": "all steps are done",
        "solver": {"iterations": 10, "largest_gap": None, "unfinished_steps": 0},
        "snapshots": [measure_snapshot(make_snapshot(lost=2))],
        "files": {"preview.png": "00"},
    }
    return make_report(**(content | changes))


def test_the_report_is_sorted_plain_json_and_the_same_each_time(tmp_path: Path) -> None:
    write_json(tmp_path / "a.json", report())
    write_json(tmp_path / "b.json", dict(reversed(report().items())))
    text = (tmp_path / "a.json").read_bytes()
    assert text == (tmp_path / "b.json").read_bytes()
    content = json.loads(text)
    assert list(content) == sorted(content)
    assert content["config"]["tension"]["rate"] == 0.1234567890123456
    assert content["notes"] == [
        {"code": "W-DEGENERATE", "count": 2, "message": "2 faces without area dropped"}
    ]
    assert set(content["versions"]) >= {"python", "numpy", "numba", "weathercoat"}
    assert content["inputs"] == {"a.obj": {"sha256": "00"}}


def test_figures_are_rounded_so_that_round_off_does_not_show(tmp_path: Path) -> None:
    near = [report(snapshots=[{"lost_area": value}]) for value in (0.1 + 0.2, 0.3)]
    assert near[0] == near[1]


@pytest.mark.parametrize("value", [float("nan"), float("inf"), np.float32("nan"), object(), 1j])
def test_what_is_no_figure_is_refused_with_its_key(tmp_path: Path, value: object) -> None:
    with pytest.raises(CheckError, match=r"snapshots\[1\]\.rust"):
        write_json(tmp_path / "run.json", {"snapshots": [{}, {"rust": value}]})
    assert not (tmp_path / "run.json").exists()


def test_arrays_and_odd_text_are_written(tmp_path: Path) -> None:
    content = {"a": np.arange(2), "b": np.float32(0.5), "c": np.True_, "d": "é\udc80", "e": None}
    write_json(tmp_path / "a.json", content)
    back = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))
    assert back == {"a": [0, 1], "b": 0.5, "c": True, "d": "é\udc80", "e": None}


JSON_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
)


@given(st.dictionaries(st.text(), JSON_VALUES, max_size=4))
def test_every_json_value_reads_back(
    tmp_path_factory: pytest.TempPathFactory, content: dict[str, Any]
) -> None:
    path = tmp_path_factory.mktemp("json") / "a.json"
    write_json(path, content)
    assert json.loads(path.read_bytes()) == content


def test_lists_of_plain_values_take_one_line(tmp_path: Path) -> None:
    write_json(tmp_path / "a.json", {"color": [1, 2, 3], "notes": [{"count": 1}], "none": []})
    assert (
        (tmp_path / "a.json").read_text()
        == """{
  "color": [1, 2, 3],
  "none": [],
  "notes": [
    {
      "count": 1
    }
  ]
}
"""
    )


def test_timing_has_the_rows_of_the_table() -> None:
    timing = make_timing({"failure": 3.0, "deformation": 1.0}, {"reading": 2.0})
    rows = timing["simulation"]["rows"]
    assert [row["row"] for row in rows] == list(PAPER_ROWS.values())
    assert [row["percent"] for row in rows] == [75.0, 25.0, 0.0, 0.0, 0.0]
    assert timing["simulation"]["seconds"] == 4.0 and timing["seconds"] == 6.0
    with pytest.raises(KeyError):
        make_timing({"curling": 1.0}, {})


def test_hashes_are_those_of_sha256sum(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"abc")
    expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    assert sha256(tmp_path / "a") == sha256(b"abc") == expected
    with pytest.raises(AccessError):
        sha256(tmp_path / "none")
