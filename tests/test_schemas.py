"""The published JSON Schemas hold for what the program writes, and for nothing else."""

from __future__ import annotations

import json
from copy import deepcopy
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from click.testing import CliRunner

import weathercoat
from tests.batch.jobs import make_job
from weathercoat.batch.batch import run_batch
from weathercoat.batch.processes import InlineExecutor
from weathercoat.cli.root import weathercoat as command

SCHEMAS = Path(weathercoat.__file__).parent / "schemas"


def validator(name: str) -> jsonschema.Draft202012Validator:
    schema = json.loads((SCHEMAS / f"{name}.json").read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


@pytest.fixture(scope="module")
def batch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a batch in which jobs were done, unchanged, failed and dropped."""
    folder = tmp_path_factory.mktemp("batch")
    done = make_job(folder, "done", "ageing.steps=60")
    run_batch([done], folder / "out", InlineExecutor())
    auto = make_job(folder, "auto", "remesh=on", "quality=auto", "scene.distance=200")
    failing = make_job(folder, "failing", "ageing.steps=50", "paint.only=[wood]")
    jobs = [done, auto, failing, make_job(folder, "dropped")]
    run_batch(jobs, folder / "out", InlineExecutor(), fail_fast=True)
    return folder / "out"


def test_records_of_batches(batch: Path) -> None:
    record = json.loads((batch / "batch.json").read_text())
    validator("batch").validate(record)
    assert [row["status"] for row in record["jobs"]] == ["unchanged", "done", "failed", "dropped"]


def test_reports_of_runs(batch: Path) -> None:
    for name in ("done", "auto"):
        report = json.loads((batch / name / "run.json").read_text())
        validator("run").validate(report)


def test_a_record_while_the_batch_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("weathercoat.batch.record._SECONDS_BETWEEN_WRITES", 0.0)
    monkeypatch.setattr("weathercoat.batch.record._SHARE_OF_TIME", 1e9)
    from weathercoat.batch.processes import ProcessExecutor

    seen: list[dict[str, Any]] = []

    def listen(event: object) -> None:
        seen.append(json.loads((tmp_path / "out" / "batch.json").read_text()))

    jobs = [make_job(tmp_path, "a", "ageing.steps=3000"), make_job(tmp_path, "b")]
    run_batch(jobs, tmp_path / "out", ProcessExecutor(1), listen=listen)
    for record in seen:
        validator("batch").validate(record)
    assert any(row["status"] == "running" for record in seen for row in record["jobs"])
    assert not list((tmp_path / "out").glob("*.partial"))


@pytest.mark.parametrize("name", ["run", "batch"])
def test_every_key_is_known_and_needed(name: str, batch: Path) -> None:
    path = batch / "batch.json" if name == "batch" else batch / "done" / "run.json"
    content = json.loads(path.read_text())
    check = validator(name)
    for key in content:
        without = deepcopy(content)
        del without[key]
        assert not check.is_valid(without), key
    assert not check.is_valid({**content, "more": 1})


def test_the_command_prints_them() -> None:
    runner = CliRunner()
    listed = runner.invoke(command, ["schema"]).output.split()
    assert {"config", "run", "batch"} <= set(listed)
    for name in listed:
        schema = json.loads(runner.invoke(command, ["schema", name]).output)
        jsonschema.Draft202012Validator.check_schema(schema)
    refused = runner.invoke(command, ["schema", "nothing"])
    assert "no schema 'nothing'" in str(refused.exception)
