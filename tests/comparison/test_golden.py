"""This version against kept results of a plate and a machine part; by noise, as bytes hang on the CPU.

After a change of results that is meant, `make golden` records them anew.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from weathercoat.batch.processes import InlineExecutor
from weathercoat.cli.handler import call
from weathercoat.comparison.baseline import read_baseline
from weathercoat.comparison.golden import Check, check_baseline

GOLDEN = Path(__file__).parents[1] / "golden"


def _check(folder: Path, *changes: str, seeds: int | None = None) -> dict[str, Check]:
    """How the models of the golden baseline compare with it, by name."""
    shutil.copytree(GOLDEN, folder / "golden")
    for name in ("plate", "bracket"):
        assert call(["sample", name, "-o", str(folder / f"{name}.obj")]) == 0
    baseline = read_baseline(folder / "golden")
    checks = check_baseline(
        baseline, folder / "golden", InlineExecutor(), seeds=seeds, assignments=list(changes)
    )
    return {check.name: check for check in checks}


@pytest.mark.compiled
def test_results_are_those_that_are_kept(tmp_path: Path) -> None:
    checks = _check(tmp_path, seeds=1)
    assert sorted(checks) == ["bracket", "plate"]
    for check in checks.values():
        assert check.is_passed, check.judgement.method


@pytest.mark.long
def test_results_of_all_seeds_are_those_that_are_kept(tmp_path: Path) -> None:
    for check in _check(tmp_path).values():
        assert check.is_passed, check.judgement.method


@pytest.mark.long
def test_other_cracks_are_noticed(tmp_path: Path) -> None:
    for check in _check(tmp_path, "fracture.direction_threshold=0.8").values():
        assert check.judgement.verdict == "different", check.judgement.method
