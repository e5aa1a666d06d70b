"""The fidelity benchmark: its errors on runs whose difference is known, its front, its tables."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.output.snapshots import make_snapshot
from weathercoat.bench import fidelity
from weathercoat.bench.fidelity import bench_fidelity, config_of, mark_front
from weathercoat.bench.fidelity_errors import curve_errors, film_distance, mean_curves, outline_difference
from weathercoat.bench.fidelity_run import QUANTITIES, make_view, observe
from weathercoat.bench.fidelity_tables import as_csv, as_text, make_front, ways_table
from weathercoat.bench.fidelity_ways import Way
from weathercoat.bench.files import write_results
from weathercoat.bench.scenes import as_csv as scenes_as_csv
from weathercoat.bench.scenes import bench_scenes, scenes_table
from weathercoat.config.quality import LEVELS
from weathercoat.errors import UsageError
from weathercoat.mesh.shapes import make_plate

CURVES = {
    "separated": [0.3, 0.4],
    "lost": [0.0, 0.3],
    "rusted": [0.0, 0.2],
    "crack_length": [2.0, 2.0],
    "rim_length": [1.0, 1.0],
}


def test_errors_of_curves_are_relative_to_the_reference() -> None:
    ours = {**CURVES, "lost": [0.0, 0.33], "crack_length": [2.0, 2.4]}
    found = curve_errors(ours, CURVES)
    assert found["lost"] == found["areas"] == pytest.approx(0.1)
    assert found["spacing"] == pytest.approx(0.2 / np.sqrt(2.0))
    assert mean_curves([CURVES, ours])["lost"] == pytest.approx([0.0, 0.315])


def test_film_that_is_lifted_by_a_height_is_that_far_away() -> None:
    """Of flat film, every point of either is as far from the other as it was lifted."""
    snapshot = make_snapshot()  # a square with sides of 1 that faces +y
    at_rest = snapshot.substrate_vertices[snapshot.film_origin]
    flat = replace(snapshot, film_vertices=at_rest)
    lifted = replace(snapshot, film_vertices=at_rest + np.array([0.0, 0.125, 0.0]))
    assert film_distance(flat, lifted) == pytest.approx(0.125)
    assert film_distance(flat, flat) == pytest.approx(0.0, abs=1e-12)
    part = replace(lifted, film_faces=flat.film_faces[:5], film_face=flat.film_face[:5])
    assert film_distance(flat, part) == pytest.approx(0.125)
    none = replace(flat, film_faces=flat.film_faces[:0], film_face=flat.film_face[:0])
    assert film_distance(flat, none) == film_distance(none, none) == 0.0


def test_a_run_is_seen_as_it_is() -> None:
    part, way = make_plate(), Way(300, 20, "none")
    run = observe(part, config_of(way, 1), (0.5, 1.0), (0.05, 1.0))
    assert set(run.curves) == set(QUANTITIES)
    assert all(len(values) == 2 for values in run.curves.values())
    intact, aged = run.snapshots
    assert (intact.step, aged.step) == (1, 20) and run.seconds["steps"] > 0.0
    view = make_view(part, config_of(way, 1))
    assert outline_difference(view, intact, intact) == 0.0
    assert outline_difference(view, intact, aged) > 0.2
    seen = view.outline(intact).mean()
    assert 0.4 < seen < 1.0  # the part fills the picture
    assert view.draw(intact, 12).shape == (12, 16, 3)


def row(label: str, seconds: float, error: float, **more: Any) -> dict[str, Any]:
    """A way with the same error in every measure."""
    names = ("areas", "spacing", "rims", "distance", "outline", *QUANTITIES)
    image = {str(height): error for height in fidelity.HEIGHTS}
    return {
        "label": label, "faces": 100, "steps": 10, "solver": "descent", "sweeps": 0, "threads": 1,
        "seconds": {"remesh": 0.0, "steps": seconds, "total": seconds}, "curves": CURVES,
        "errors": {**dict.fromkeys(names, error), "picture": image, "image": image},
    } | more  # fmt: skip


def some_results() -> dict[str, Any]:
    """Three ways on the front, one that is beaten, one on two threads, and the reference."""
    ways = [
        row("reference", 100.0, 0.0, solver="newton"),
        row("cheap", 1.0, 0.3, solver="none"),
        row("beaten", 2.0, 0.4),
        row("middle", 3.0, 0.09),
        row("good", 9.0, 0.01),
        row("threads", 5.0, 0.001, threads=2),
    ]
    noise = {**dict.fromkeys(("areas", "spacing", "rims", "distance", "outline"), 0.2), "picture": {}}
    pixels = {str(height): height / 10.0 for height in fidelity.HEIGHTS}
    machine = {"cpu": "a CPU", "cores": 1, "system": "a system", "date": "a day", "versions": {"python": "3"}}
    results = {
        "machine": machine, "shear_lag": 0.04, "seeds": [1, 2], "noise": noise,
        "pixels_per_shear_lag": pixels, "ways": ways,
    }  # fmt: skip
    mark_front(results)
    return results


def test_the_front_is_what_nothing_cheaper_beats() -> None:
    ways = {way["label"]: way for way in some_results()["ways"]}
    assert [name for name, way in ways.items() if way["front"]] == ["reference", "cheap", "middle", "good"]
    assert "areas" in ways["good"]["best_in"] and not ways["beaten"]["best_in"]
    levels = {level: name for name, way in ways.items() for level in way["levels"]}
    assert levels == {"draft": "good", "standard": "good", "fine": "good", "reference": "reference"}


def test_what_is_stored_can_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from weathercoat.config import quality

    stored = tmp_path / "quality.json"
    stored.write_text(json.dumps(make_front(some_results())), encoding="utf-8")
    monkeypatch.setattr(quality, "FRONT", stored)
    front = quality.read_front.__wrapped__()
    assert [point.values["deformation.solver"] for point in front.points] == [
        "none",
        "descent",
        "descent",
        "newton",
    ]
    assert front.points[0].errors is not None and front.points[-1].errors is None
    assert front.points[0].errors.image_at(1.2) == 0.3
    assert front.points[0].errors.distance == pytest.approx(0.3 / 0.04)
    assert front.levels["reference"] is front.points[-1]
    assert front.points[0].faces(0.04) == pytest.approx(300)  # not fewer


def test_tables_go_from_cheap_to_dear() -> None:
    results = some_results()
    table = ways_table(results)
    assert [line[0] for line in table[1:]] == [
        "cheap", "beaten", "middle", "threads", "good", "reference", "two seeds at the reference",
    ]  # fmt: skip
    assert len({len(line) for line in table}) == 1
    assert "a CPU" in next(as_text(results))
    lines = list(csv.DictReader(as_csv(results).splitlines()))
    assert float(lines[1]["areas"]) == 0.3 and lines[1]["front"] == "True"


def test_the_chart_is_drawn(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    from weathercoat.bench.fidelity_chart import draw_chart

    results = some_results()
    assert write_results(tmp_path, "fidelity", results, as_csv(results), {"fidelity": draw_chart}) is None
    assert (tmp_path / "fidelity.png").read_bytes().startswith(b"\x89PNG")


def test_one_seed_is_no_noise() -> None:
    with pytest.raises(UsageError, match="at least 2"):
        bench_fidelity(seeds=[1])


@pytest.mark.long
def test_small_ways_beside_a_small_reference(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fidelity, "HEIGHTS", (48, 24, 16, 12))
    done: list[tuple[int, int]] = []
    reference, ways = Way(600, 30, "newton"), [Way(300, 15, "none"), Way(300, 15, "sweeps", 10)]
    found = bench_fidelity(ways=ways, reference=reference, progress=lambda n, total: done.append((n, total)))
    assert done[-1] == (6, 6)
    truth, other, curled = found["ways"]
    assert not other["levels"] and curled["levels"], "only film that curls makes a level"
    assert truth["errors"]["areas"] == truth["errors"]["image"]["48"] == 0.0
    assert truth["errors"]["distance"] == pytest.approx(0.0, abs=1e-12)
    assert 0.0 < other["errors"]["image"]["48"] < 1.5 and other["errors"]["distance"] > 0.0
    assert other["front"] and curled["front"] and found["noise"]["distance"] > 0.0
    assert {level for way in found["ways"] for level in way["levels"]} == set(LEVELS)
    json.dumps(found, allow_nan=False)


@pytest.mark.long
def test_scenes_are_compared_with_the_reference() -> None:
    small = ["remesh.faces=400", "ageing.steps=15"]
    found = bench_scenes(scenes={"hero": 48, "far": 12}, overrides=small)
    assert [(entry["part"], entry["scene"]) for entry in found["rows"]] == [
        ("plate", "hero"), ("plate", "far"), ("barrel", "hero"), ("barrel", "far"),
    ]  # fmt: skip
    assert all(entry["chosen"]["steps"] == 15 for entry in found["rows"])
    assert all(entry["seconds"] > 0.0 and entry["image"] < 1.5 for entry in found["rows"])
    assert len({len(line) for line in scenes_table(found)}) == 1
    assert len(scenes_as_csv(found).splitlines()) == 5
