"""`weathercoat risk`, of a model and of a finished run."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from weathercoat.cli.root import weathercoat
from weathercoat.errors import UsageError
from weathercoat.mesh.shapes import make_random_sheet
from weathercoat.output.meshes import write_mesh

SMALL = ["--faces", "400", "--steps", "20"]


def call(*words: object) -> Result:
    return CliRunner().invoke(weathercoat, [*map(str, words)], obj=[*map(str, words)], catch_exceptions=False)


@pytest.fixture
def model(tmp_path: Path) -> Path:
    write_mesh(tmp_path / "sheet.ply", make_random_sheet(300, seed=1))
    return tmp_path / "sheet.ply"


def test_before_a_step_is_run_and_of_the_run(model: Path, tmp_path: Path) -> None:
    """The run's step 0 has the same risk to the byte as the model under its config."""
    before = call("risk", "standard", model, "-o", tmp_path / "before", *SMALL, "--json")
    about = json.loads(before.output)
    assert about["step"] == 0 and about["horizon_steps"] == 20 and about["attached_share"] == 1.0
    call("run", "standard", model, "-o", tmp_path / "run", *SMALL, "--quiet")
    call("risk", tmp_path / "run", "--step", 0, "-o", tmp_path / "again", "--quiet")
    for path in (tmp_path / "before").iterdir():
        assert path.read_bytes() == (tmp_path / "again" / path.name).read_bytes(), path.name
    last = call("risk", tmp_path / "run", "-o", tmp_path / "last", "--horizon", 5)
    assert last.output.startswith("step 20, age 1: ")


@pytest.mark.parametrize(
    "words",
    [
        ["standard", "a.ply", "b.ply"],
        ["run", "--set", "seed=2"],
        ["standard", "a.ply", "--step", "3"],
    ],
)
def test_what_does_not_go_together(words: list[str], tmp_path: Path) -> None:
    with pytest.raises(UsageError):
        call("risk", *words, "-o", tmp_path / "out")
