"""Comparing runs as a user does: the verdicts, what is told, and the report."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import jsonschema
import pytest
from click.testing import CliRunner, Result

import weathercoat
from tests.verification.runs import Ply, edit_report, make_run, write_report
from weathercoat.cli.root import weathercoat as program
from weathercoat.comparison.compare import compare
from weathercoat.comparison.page import make_page
from weathercoat.comparison.page import write_report as write_comparison
from weathercoat.comparison.sides import Run, find_runs, pair_up
from weathercoat.comparison.tolerance import Tolerance
from weathercoat.config.load import load_config
from weathercoat.errors import AccessError
from weathercoat.mesh.shapes import make_sign
from weathercoat.output.meshes import write_mesh
from weathercoat.run import run_asset

SMALL = (
    *("remesh.faces=1500", "ageing.steps=100", "snapshots.count=4"),
    *("output.picture_width=130", "output.picture_height=108"),
)
SCHEMA = Path(weathercoat.__file__).parent / "schemas" / "compare.json"


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Runs of one model: two seeds, the rust of another config, and one seed with other cracks."""
    folder = tmp_path_factory.mktemp("runs")
    make_run(folder / "one", make_sign(), "standard", *SMALL, "seed=1")
    make_run(folder / "two", make_sign(), "standard", *SMALL, "seed=2")
    make_run(folder / "rusty", make_sign(), "rusting", *SMALL, "seed=1")
    return folder


@pytest.fixture
def copy(runs: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(runs / "one", tmp_path / "copy"))


def call(*arguments: object) -> Result:
    return CliRunner().invoke(program, ["compare", *map(str, arguments)])


def test_the_same_bytes_are_the_same(runs: Path, copy: Path) -> None:
    done = call(runs / "one", copy)
    assert done.exit_code == 0
    assert done.output.startswith("same: every file")


def test_another_seed_is_within_noise(runs: Path) -> None:
    done = call(runs / "one", runs / "two")
    assert done.exit_code == 0, done.output
    assert done.output.startswith("within noise: ")
    assert "other mesh: distance mean" in done.output


def test_another_config_is_different_and_the_largest_difference_comes_first(runs: Path) -> None:
    done = call(runs / "one", runs / "rusty")
    assert done.exit_code == 1
    lines = done.output.splitlines()
    assert lines[0].startswith("different: ")
    assert lines[2].endswith("beyond")


def test_a_swapped_face_index_is_corrupt(runs: Path, copy: Path) -> None:
    ply = Ply(sorted((copy / "snapshots").glob("*.ply"))[-1])
    corners = ply.face["corners"]
    corners[-1, 0], corners[-2, 0] = corners[-2, 0].copy(), corners[-1, 0].copy()
    ply.save()
    for sides in ((runs / "one", copy), (copy, runs / "one"), (copy, copy)):
        done = call(*sides)
        assert done.exit_code == 1
        assert done.output.startswith("corrupt: ")
        assert ply.path.name in done.output


@pytest.mark.parametrize("kind", ["truncated", "edited", "no JSON"])
def test_other_faults_are_corrupt(runs: Path, copy: Path, kind: str) -> None:
    if kind == "truncated":
        path = copy / "snapshots" / "step_0100.glb"
        path.write_bytes(path.read_bytes()[:-100])
    elif kind == "edited":
        report = edit_report(copy)
        report["snapshots"][-1]["lost_share"] += 0.01
        write_report(copy, report)
    else:
        (copy / "run.json").write_text("{")
    found = compare(runs / "one", copy)
    assert found.verdict == "corrupt"
    assert found.b.findings and not found.a.findings


def test_tolerances_of_positions_and_pictures_have_a_say(runs: Path) -> None:
    bounded = compare(runs / "one", runs / "two", Tolerance(distances=1e-6, pictures=1e-6))
    assert bounded.verdict == "different"
    assert len(bounded.beyond) == 2
    assert compare(runs / "one", runs / "two", Tolerance(distances=1.0, pictures=1.0)).passes


def test_without_a_preview_pictures_are_drawn_anew(runs: Path, copy: Path) -> None:
    report = edit_report(copy)
    del report["files"]["preview.png"]
    report["config"]["output"]["preview"] = False
    (copy / "preview.png").unlink()
    write_report(copy, report)
    (pair,) = compare(runs / "one", copy).groups[0].pairs
    assert [picture.flip for picture in pair.pictures] == pytest.approx([0.0] * 4, abs=0.02)


def test_folders_of_several_runs_are_groups(runs: Path, tmp_path: Path) -> None:
    model = tmp_path / "sign.obj"
    write_mesh(model, make_sign())
    for side, seeds in (("a", (1, 2)), ("b", (2, 1))):
        (tmp_path / side).mkdir()
        for number, seed in enumerate(seeds):
            overrides = [*SMALL, f"seed={seed}", "output.formats=[ply]", "output.preview=false"]
            run_asset(
                load_config("standard", overrides), model, tmp_path / side / f"run{number}", check=False
            )
    found = compare(tmp_path / "a", tmp_path / "b")
    assert found.verdict == "same"
    assert [(pair.a.seed, pair.b.seed) for pair in found.groups[0].pairs] == [(1, 1), (2, 2)]


def test_runs_are_grouped_by_model_and_config_where_both_sides_have_them(tmp_path: Path) -> None:
    def run(name: str, model: str, radius: float, seed: int) -> Run:
        (tmp_path / name).mkdir()
        config = {"seed": seed, "curl": {"radius": radius}}
        write_report(tmp_path / name, {"inputs": {model: ""}, "config": config, "seed": seed})
        return Run(tmp_path / name, name)

    thin = [run("a", "pipe.obj", 0.1, 1), run("b", "pipe.obj", 0.1, 2)]
    wide, other = run("c", "pipe.obj", 0.2, 1), run("d", "gear.obj", 0.1, 1)
    assert len(pair_up([*thin, wide], [wide, *thin])) == 2
    assert list(pair_up([*thin, other], [wide, other])) == ["gear.obj, d", "pipe.obj, a"]
    assert list(pair_up(thin, [other])) == ["all runs"]


def test_folders_without_runs_are_refused(tmp_path: Path) -> None:
    with pytest.raises(AccessError, match="no such folder"):
        find_runs(tmp_path / "none")
    with pytest.raises(AccessError, match=r"no run\.json"):
        find_runs(tmp_path)


def test_the_report_is_valid_self_contained_and_the_same_each_time(runs: Path, tmp_path: Path) -> None:
    check = jsonschema.Draft202012Validator(json.loads(SCHEMA.read_text()))
    for name in ("two", "rusty"):
        done = call(runs / "one", runs / name, "-o", tmp_path / name)
        assert done.exit_code == (name == "rusty")
        assert "compare.html" in done.output
        record = json.loads((tmp_path / name / "compare.json").read_text())
        check.validate(record)
        for key in record:
            assert not check.is_valid({other: record[other] for other in record if other != key}), key
        page = (tmp_path / name / "compare.html").read_text()
        assert not re.search(r"""(src|href)=["'](?!data:)|https?://|@import""", page)
        assert page.count("data:image/webp") == 12
        assert page.count("<figure") == len({row["figure"] for row in record["groups"][0]["differences"]})
    again = tmp_path / "again"
    again.mkdir()
    write_comparison(again, compare(runs / "one", runs / "rusty"))
    for file in ("compare.html", "compare.json"):
        assert (again / file).read_bytes() == (tmp_path / "rusty" / file).read_bytes()


def test_an_existing_report_is_replaced_only_if_asked(runs: Path, copy: Path, tmp_path: Path) -> None:
    sides = runs / "one", copy, "-o", tmp_path / "report"
    assert call(*sides).exit_code == 0
    assert "the folder exists" in str(call(*sides).exception)
    assert call(*sides, "--overwrite").exit_code == 0


def test_json_goes_to_standard_output(runs: Path, copy: Path) -> None:
    record = json.loads(call(runs / "one", copy, "--json").output)
    jsonschema.validate(record, json.loads(SCHEMA.read_text()))
    assert record["verdict"] == "same"


def test_names_are_escaped(runs: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(runs / "one", tmp_path / "<script>alert(1)<&"))
    report = edit_report(folder)
    report["inputs"] = {"<img src=x>.obj": "0" * 64}
    write_report(folder, report)
    page = make_page(compare(folder, runs / "two"))
    assert "<script>alert" not in page and "<img src=x>" not in page
    assert "&lt;img src=x&gt;.obj" in page
