"""A severity that does not follow from the snapshots, or contradicts itself, is found."""

from __future__ import annotations

import copy
import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from weathercoat.config.load import load_config
from weathercoat.mesh.shapes import make_random_sheet
from weathercoat.output.meshes import write_mesh
from weathercoat.run import run_asset
from weathercoat.verification.run import verify_run


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of a sheet in two groups that has rusted and flaked."""
    folder = tmp_path_factory.mktemp("run")
    sheet = make_random_sheet(faces=300)
    left = sheet.vertices[sheet.faces][:, :, 0].mean(axis=1) < np.median(sheet.vertices[:, 0])
    write_mesh(
        folder / "sheet.obj", replace(sheet, face_group=left.astype(np.int32), groups=("right", "left"))
    )
    settings = [
        "remesh=off",
        "ageing.steps=60",
        "snapshots.count=1",
        "output.formats=ply",
        "output.preview=false",
    ]
    run_asset(load_config("standard", settings), folder / "sheet.obj", folder / "out")
    return folder / "out"


def _put(keys: str, value: Any) -> Callable[[dict[str, Any]], None]:
    def change(severity: dict[str, Any]) -> None:
        *path, last = keys.split(".")
        for key in path:
            severity = severity[key]
        severity[last] = value(severity[last]) if callable(value) else value

    return change


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (_put("whole.rusted_percent", lambda p: p * 0.99), "rusted_percent of step"),
        (_put("whole.flaked_percent", lambda p: p * 1.0001), "flaked_percent of step"),
        (_put("whole.lifted_percent", 0.0), "lifted_percent of step"),
        (_put("whole.dirt_percent", 99.0), "dirt_percent of step"),
        (_put("whole.runoff_percent", 99.0), "runoff_percent of step"),
        (_put("whole.cracked_percent", -1.0), "cracked_percent of the whole"),
        (_put("whole.grades.iso_4628_3", "Ri0"), "iso_4628_3 of the whole"),
        (_put("groups.left.grades.iso_4628_5", 1), "iso_4628_5 of left"),
        (_put("groups.right.grades.astm_d610", 9), "astm_d610 of right"),
        (_put("groups.left.area", lambda area: area * 1.001), "area of the groups"),
        (lambda severity: severity["groups"].pop("left"), "of the groups"),
        (lambda severity: severity.pop("whole"), "severity.whole"),
        (_put("groups.left", 3), "holds no figures of 'left'"),
    ],
)
def test_what_is_wrong_is_found(
    change: Callable[[dict[str, Any]], None], what: str, run: Path, tmp_path: Path
) -> None:
    shutil.copytree(run, tmp_path / "out")
    report = json.loads((run / "run.json").read_text())
    changed = copy.deepcopy(report)
    change(changed["snapshots"][0]["severity"])
    (tmp_path / "out" / "run.json").write_text(json.dumps(changed))
    assert what in " ".join(map(str, verify_run(tmp_path / "out").findings))


def test_a_whole_run_has_nothing_to_find(run: Path) -> None:
    assert verify_run(run).is_whole
    severity = json.loads((run / "run.json").read_text())["snapshots"][0]["severity"]
    assert list(severity["groups"]) == ["left", "right"]
    assert severity["whole"]["rusted_percent"] > 1.0
