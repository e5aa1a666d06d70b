"""`weathercoat severity` on a run, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from weathercoat.cli.root import weathercoat
from weathercoat.config.load import load_config
from weathercoat.mesh.shapes import make_random_sheet
from weathercoat.output.meshes import write_mesh
from weathercoat.run import run_asset


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    write_mesh(folder / "sheet.ply", make_random_sheet(faces=150))
    settings = [
        "remesh=off",
        "ageing.steps=20",
        "snapshots.count=2",
        "output.preview=false",
        "model.units=cm",
    ]
    run_asset(load_config("standard", settings), folder / "sheet.ply", folder / "out")
    return folder / "out"


def call(*arguments: str | Path) -> Result:
    return CliRunner().invoke(weathercoat, ["severity", *map(str, arguments)])


def test_the_table_has_a_line_for_each_snapshot(run: Path) -> None:
    lines = call(run).output.splitlines()
    assert [line.split()[:2] for line in lines[1:3]] == [["10", "whole"], ["20", "whole"]]
    assert "no assessments" in lines[-1]
    assert len(call(run, "--step", "20").output.splitlines()) == 3


def test_csv_and_json_are_those_of_the_run(run: Path) -> None:
    assert call(run, "--csv").output == (run / "severity.csv").read_text()
    rows = json.loads((run / "run.json").read_text())["snapshots"]
    assert json.loads(call(run, "--json", "--step", "10").output)[0]["severity"] == rows[0]["severity"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [(("--step", "7"), "no snapshot of step 7"), (("--csv", "--json"), "both write to standard output")],
)
def test_what_is_refused(arguments: tuple[str, ...], message: str, run: Path) -> None:
    result = call(run, *arguments)
    assert message in str(result.exception)
