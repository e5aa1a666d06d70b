"""`weathercoat bench speed`: its figures, its files, and what it refuses."""

from __future__ import annotations

import csv
import json
import sys
from pathlib import Path
from typing import Any

import pytest

from weathercoat.bench.cases import STAGES, Case
from weathercoat.bench.speed import bench_speed
from weathercoat.bench.tables import as_csv, as_markdown, as_text, stage_table, variant_table
from weathercoat.cli.handler import call
from weathercoat.mesh.shapes import make_random_sheet
from weathercoat.output.meshes import write_mesh

QUICK = ["--faces", "500", "--steps", "20", "--repeats", "1"]


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Of a mesh from a file and two plates, as they are after JSON."""
    path = tmp_path_factory.mktemp("bench") / "sheet.ply"
    write_mesh(path, make_random_sheet(300))
    done: list[tuple[int, int]] = []
    found = bench_speed([path], [400, 800], steps=20, repeats=2, progress=lambda n, m: done.append((n, m)))
    assert done[-1] == (3 * 2 * 20, 3 * 2 * 20)
    assert [n for n, _ in done] == sorted(n for n, _ in done)
    parsed: dict[str, Any] = json.loads(json.dumps(found, allow_nan=False))
    return parsed


def test_results_hold_every_figure(results: dict[str, Any]) -> None:
    assert set(results) == {"schema", "machine", "paper_machine", "config", "cases", "growth"}
    machine = results["machine"]
    assert {"cpu", "cores", "system", "date", "versions", "warm_up"} <= set(machine)
    assert {"python", "numpy", "numba", "weathercoat"} <= set(machine["versions"])
    assert machine["copy_bandwidth"] > 0 and machine["arithmetic_peak"] > 0
    assert [case["faces"] for case in results["cases"]] == [300, 400, 800]
    for case in results["cases"]:
        assert set(case["seconds"]) == {*STAGES, "total"}
        assert case["seconds"]["total"] == pytest.approx(sum(case["seconds"][s] for s in STAGES), rel=0.2)
        assert case["cpu_seconds"] > 0 and case["step_ms_at_end"] > 0
        assert len(case["steps_per_second"]) == 10 and min(case["steps_per_second"]) > 0
        assert case["sweep"]["lengths"] > case["sweep"]["angles"] > 0
        assert case["sweep"]["plain_ms"] > case["sweep"]["floor_ms"] > 0
        assert case["load"]["separated_share"] == pytest.approx(0.6, abs=0.05)
        assert case["paper"] is None and case["peer"] is None
    assert results["growth"]["faces"] == [400, 800]
    assert set(results["growth"]["exponents"]) == {
        "failure", "deformation", "mesh", "stains", "total", "sweep",
    }  # fmt: skip


def test_tables_show_them(results: dict[str, Any]) -> None:
    lines = list(as_text(results))
    assert machine_is_named(lines, results)
    for title in ("Seconds for 1,000 steps", "Steps, and one sweep at the end", "The situation at the end"):
        at = lines.index(title)
        assert lines[at + 2].startswith("sheet ")
    rows = list(csv.DictReader(as_csv(results).splitlines()))
    assert [row["faces"] for row in rows] == ["300", "400", "800"]
    assert float(rows[0]["total_s"]) == results["cases"][0]["seconds"]["total"]
    markdown = as_markdown(stage_table(results)).splitlines()
    assert len({line.count("|") for line in markdown}) == 1
    assert markdown[1].startswith("| --- | ---: |")


def machine_is_named(lines: list[str], results: dict[str, Any]) -> bool:
    return lines[0].startswith(results["machine"]["cpu"])


def test_a_variant_is_measured_against_its_base(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fewer sweeps are faster and end elsewhere."""
    base = Case("plate 400", 400, 20)
    variant = Case("fewer", 400, 20, overrides=("deformation.sweeps=2",), variant_of=base.label)
    monkeypatch.setattr("weathercoat.bench.speed.make_cases", lambda *asked: [base, variant])
    found = bench_speed([], [400], steps=20, repeats=1)
    assert [case["variant_of"] for case in found["cases"]] == ["", "plate 400"]
    assert found["cases"][0]["apart"] is None and 0.0 < found["cases"][1]["apart"]["rms"] < 1.0
    assert found["growth"]["faces"] == [400]
    heading, row = variant_table(found)
    assert len(row) == len(heading) and row[0] == "fewer"
    assert float(row[3]) == pytest.approx(
        found["cases"][0]["step_ms"] / found["cases"][1]["step_ms"], abs=0.01
    )


def test_the_papers_figures_stand_below_ours(results: dict[str, Any]) -> None:
    paper = {"name": "flat plate", "faces": 3005, "seconds": results["cases"][0]["seconds"]}
    case = {**results["cases"][0], "paper": {**paper, "times_faster": 12.34}}
    ours, theirs = stage_table({**results, "cases": [case]})[1:3]
    assert ours[-1] == "12.3" and theirs[0] == "paper: flat plate"
    assert ours[2:7] == theirs[2:7]


def test_files_are_written_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    assert call(["bench", "speed", *QUICK, "-o", "out"]) == 0
    assert "written to out" in capsys.readouterr().out
    assert {path.name for path in Path("out").iterdir()} == {"speed.json", "speed.csv", "speed.png"}
    assert Path("out/speed.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads(Path("out/speed.json").read_text(encoding="utf-8"))["schema"] == 1
    assert call(["bench", "speed", *QUICK, "-o", "out"]) == 7
    assert "E-EXISTS" in capsys.readouterr().err


def test_without_matplotlib_there_is_a_note_and_no_chart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, results: dict[str, Any]
) -> None:
    from weathercoat.bench.chart import draw_chart
    from weathercoat.bench.files import read_results, write_results

    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    missing = write_results(tmp_path, "speed", results, as_csv(results), {"speed": draw_chart})
    assert missing is not None and "matplotlib" in missing
    assert {path.name for path in tmp_path.iterdir()} == {"speed.json", "speed.csv"}
    assert read_results(tmp_path, "speed") == results


@pytest.mark.parametrize(
    ("arguments", "code", "what"),
    [
        (["--faces", "many"], 2, "no list of whole numbers"),
        (["--faces", "20"], 2, "at least 100 faces"),
        (["--faces", "none"], 2, "nothing to measure"),
        (["--steps", "3"], 2, "at least 10 steps"),
        (["--repeats", "0"], 2, "at least 1"),
        (["--threads", "0"], 2, "at least 1"),
        (["missing.obj"], 3, "missing.obj"),
        (["-o", "no/where"], 7, "no folder"),
    ],
)
def test_what_cannot_be_measured_is_refused_at_once(
    arguments: list[str],
    code: int,
    what: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("weathercoat.bench.speed.measure_machine_apart", lambda: pytest.fail("work began"))
    assert call(["bench", "speed", *arguments]) == code
    assert what in capsys.readouterr().err


def test_a_case_that_dies_is_named(tmp_path: Path) -> None:
    from weathercoat.bench.apart import measure_apart
    from weathercoat.bench.cases import Case
    from weathercoat.errors import CheckError

    with pytest.raises(CheckError, match="no result") as caught:
        measure_apart(Case("gone", 500, 20), tmp_path / "none.npz", tmp_path / "end.npz", 1)
    assert caught.value.file == "gone"
