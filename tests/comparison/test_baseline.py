"""Baselines: what is kept, and that what is unchanged, noise and change are told apart."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from weathercoat.batch.processes import InlineExecutor
from weathercoat.cli.handler import call
from weathercoat.comparison.baseline import BASELINE, Baseline, is_baseline, pair_with_baseline, read_baseline
from weathercoat.comparison.compare import compare
from weathercoat.comparison.golden import check_baseline, record_baseline
from weathercoat.comparison.judgement import judge
from weathercoat.config.load import load_config
from weathercoat.errors import AccessError, BatchError, CorruptError, OutputExistsError, UsageError
from weathercoat.mesh.shapes import make_random_sheet
from weathercoat.output.meshes import write_mesh
from weathercoat.run import run_asset

SMALL = ("remesh=off", "ageing.steps=30", "snapshots.count=2")
SEEDS = 4


def _sheet(path: Path, faces: int = 150) -> str:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    write_mesh(path, make_random_sheet(faces))
    return str(path)


@pytest.fixture(scope="module")
def golden(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A baseline of two sheets; they lie beside it."""
    folder = tmp_path_factory.mktemp("golden")
    models = [_sheet(folder / "models" / "a.obj"), _sheet(folder / "models" / "b.obj", 200)]
    record_baseline(folder / "golden", models, InlineExecutor(), assignments=SMALL, seeds=SEEDS)
    return folder / "golden"


def test_a_baseline_is_small_and_holds_no_meshes(golden: Path) -> None:
    assert sorted(file.name for file in golden.iterdir()) == ["a.jpg", "b.jpg", BASELINE]
    assert sum(file.stat().st_size for file in golden.iterdir()) < 60_000
    content = json.loads((golden / BASELINE).read_bytes())
    assert [model["model"] for model in content["models"]] == ["../models/a.obj", "../models/b.obj"]
    model = content["models"][0]
    values = [run["figures"]["separated_share"][-1] for run in model["runs"]]
    assert model["mean"]["separated_share"][-1] == pytest.approx(sum(values) / SEEDS, rel=1e-11)
    assert model["spread"]["separated_share"][-1] > 0.0


def test_it_reads_back(golden: Path) -> None:
    baseline = read_baseline(golden)
    assert is_baseline(golden)
    assert read_baseline(golden / BASELINE) == baseline
    assert baseline.config == "standard"
    assert baseline.assignments == SMALL
    assert [run.seed for run in baseline.models[0].runs] == [1, 2, 3, 4]
    assert judge(baseline.models[0].figures, baseline.models[0].figures).verdict == "same"
    assert judge(baseline.models[0].figures, baseline.models[1].figures[:1]).verdict != "same"


def test_a_model_is_known_by_its_content_and_then_by_its_name(golden: Path) -> None:
    baseline = read_baseline(golden)
    a, b = baseline.models
    assert baseline.model_of({"renamed.obj": b.inputs["b.obj"]}) == b
    assert baseline.model_of({"a.obj": "changed"}) == a
    assert baseline.model_of({"c.obj": "other"}) is None
    alone = Baseline("standard", (), {}, {}, (b,))
    assert alone.model_of({"c.obj": "other"}) == b


def test_unchanged_runs_are_the_same_to_the_byte(golden: Path) -> None:
    checks = check_baseline(read_baseline(golden), golden, InlineExecutor(), seeds=1, exact=True)
    assert [(check.name, check.is_passed, check.judgement.verdict) for check in checks] == [
        ("a", True, "same"),
        ("b", True, "same"),
    ]


def test_other_seeds_are_within_noise_and_have_no_bytes_to_compare(golden: Path) -> None:
    checks = check_baseline(read_baseline(golden), golden, InlineExecutor(), seeds=1, assignments=["seed=9"])
    assert all(check.judgement.verdict == "same" for check in checks), "the seeds are the baseline's own"
    checks = check_baseline(read_baseline(golden), golden, InlineExecutor(), seeds=SEEDS + 1, exact=True)
    assert all(check.judgement.verdict == "same" for check in checks)


def test_a_small_change_has_other_bytes_and_a_large_one_other_figures(golden: Path) -> None:
    baseline = read_baseline(golden)
    small = ["lift.coefficient=0.301"]
    checks = check_baseline(baseline, golden, InlineExecutor(), seeds=1, assignments=small)
    assert all(check.is_passed and check.judgement.verdict == "within noise" for check in checks)
    checks = check_baseline(baseline, golden, InlineExecutor(), seeds=1, assignments=small, exact=True)
    assert not any(check.is_passed for check in checks)
    assert list(checks[0].differing) == ["a/seed-1"]
    checks = check_baseline(baseline, golden, InlineExecutor(), assignments=["dust.rate=2"])
    assert [check.judgement.verdict for check in checks] == ["different", "different"]
    assert {row.figure for row in checks[0].judgement.differences if row.is_beyond} >= {"dust"}


def test_runs_are_held_against_the_model_that_they_are_of(golden: Path, tmp_path: Path) -> None:
    models = golden.parent / "models"
    for name, seed in (("a", 1), ("b", 2), ("a", 3)):
        loaded = load_config("standard", [*SMALL, "output.preview=false", f"seed={seed}"])
        run_asset(loaded, models / f"{name}.obj", tmp_path / f"{name}{seed}")
    pairs = pair_with_baseline(tmp_path, golden)
    assert {name: [len(side) for side in sides] for name, sides in pairs.items()} == {
        "a": [2, 4],
        "b": [1, 4],
    }
    assert judge(*pairs["a"]).verdict == judge(*pairs["b"]).verdict == "same"
    alone = pair_with_baseline(golden, tmp_path / "b2")
    assert list(alone) == ["b"]
    assert [len(side) for side in alone["b"]] == [4, 1]
    both = pair_with_baseline(golden, golden / BASELINE)
    assert [judge(*sides).verdict for sides in both.values()] == ["same", "same"]
    found = compare(tmp_path, golden)
    assert found.verdict == "same"
    assert [group.title for group in found.groups] == ["a", "b"]
    with pytest.raises(AccessError, match=r"no run\.json"):
        pair_with_baseline(models, golden)
    run_asset(loaded, _sheet(tmp_path / "c.obj", 60), tmp_path / "c")
    with pytest.raises(UsageError, match=r"a run of c.obj, and the baseline has a, b"):
        pair_with_baseline(tmp_path / "c", golden)


def test_a_config_file_and_the_last_snapshots_are_kept(tmp_path: Path) -> None:
    config = tmp_path / "paint.yaml"
    config.write_text("remesh: off\nageing: {steps: 10}\nsnapshots: {count: 1}\n")
    out = tmp_path / "out"
    model = _sheet(tmp_path / "sheet.obj", 60)
    record_baseline(out, [model], InlineExecutor(), config=str(config), seeds=2, keep_snapshots=True)
    config.unlink()
    files = sorted(file.relative_to(out).as_posix() for file in out.rglob("*") if file.is_file())
    assert files == [
        BASELINE, "config.yaml", "sheet.jpg", "snapshots/sheet-1.ply", "snapshots/sheet-2.ply",
    ]  # fmt: skip
    (check,) = check_baseline(read_baseline(out), out, InlineExecutor(), seeds=1)
    assert check.judgement.verdict == "same"
    _sheet(tmp_path / "sheet.obj", 80)
    (check,) = check_baseline(read_baseline(out), out, InlineExecutor(), seeds=1)
    assert check.notes == ("the model's file has changed",)


def test_what_cannot_be_recorded(golden: Path, tmp_path: Path) -> None:
    with pytest.raises(OutputExistsError):
        record_baseline(golden, [_sheet(tmp_path / "x.obj")], InlineExecutor())
    with pytest.raises(UsageError, match="one folder"):
        twins = [_sheet(tmp_path / "x.obj"), _sheet(tmp_path / "y" / "x.obj")]
        record_baseline(tmp_path / "out", twins, InlineExecutor())
    with pytest.raises(BatchError, match="5 of 5 runs failed: E-ACCESS"):
        record_baseline(tmp_path / "out", [str(tmp_path / "none.obj")], InlineExecutor())
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("content", "what"),
    [
        ("nothing", "is no JSON"),
        ("[]", "is no baseline"),
        ("{}", "is no baseline: KeyError 'baseline_version'"),
        ('{"baseline_version": 99}', "is of version 99, and 1 is known"),
        (
            '{"baseline_version": 1, "config": {"source": "standard", "set": []}, "models": [],'
            ' "versions": {}, "machine": {}}',
            "holds no runs",
        ),
    ],
)
def test_broken_baselines_are_refused(tmp_path: Path, content: str, what: str) -> None:
    (tmp_path / BASELINE).write_text(content)
    with pytest.raises(CorruptError, match=what):
        read_baseline(tmp_path)


def test_a_folder_without_a_baseline_is_refused(tmp_path: Path) -> None:
    assert not is_baseline(tmp_path)
    with pytest.raises(AccessError, match=BASELINE):
        read_baseline(tmp_path)


def test_the_command_records_and_checks(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model, out = _sheet(tmp_path / "sheet.obj"), str(tmp_path / "golden")
    small = [word for value in SMALL for word in ("--set", value)]
    assert call(["baseline", "record", out, model, *small, "--seeds", "3", "-j", "1"]) == 0
    assert "1 models with 3 seeds each" in capsys.readouterr().out
    assert call(["baseline", "check", out, "-j", "1", "--seeds", "1"]) == 0
    assert "sheet: passes: same" in capsys.readouterr().out
    changed = ["--set", "dust.rate=2"]
    assert call(["baseline", "check", out, "-j", "1", *changed, "--json"]) == 1
    content = json.loads(capsys.readouterr().out)
    assert content["passed"] is False
    assert content["models"][0]["verdict"] == "different"
    tolerance = tmp_path / "tolerance.yaml"
    tolerance.write_text("figures:\n  dust: {relative: 0.9}\n")
    given = [out, "-j", "1", *changed, "--tolerance", str(tolerance)]
    assert call(["baseline", "check", *given]) == 0
    assert call(["baseline", "check", *given, "--exact"]) == 1
    assert (
        "sheet/seed-3: other bytes in severity.csv, snapshots/step_0015.ply, snapshots/step_0030.ply"
        in capsys.readouterr().out
    )
