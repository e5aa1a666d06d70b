"""Steered runs from file to folder: same bytes however they are run, and only from the same masks."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from weathercoat.api import verify
from weathercoat.config.load import load_config
from weathercoat.errors import ConfigError, ResumeError, UsageError
from weathercoat.finished import open_run
from weathercoat.mesh.shapes import make_random_sheet
from weathercoat.output.meshes import write_mesh
from weathercoat.output.risk import GLB, PICTURE, PLY, SUMMARY, draw_risk, risk_colors, write_risk
from weathercoat.restore import restore_simulation
from weathercoat.run import run_asset
from weathercoat.sim.checkpoint import state_arrays
from weathercoat.sim.risk import assess_risk

CONFIG = """
remesh: {faces: 600}
ageing: {steps: 30}
snapshots: {count: 2}
output: {preview: false}
steering:
  - guide: way.csv
  - change: tension
    multiply: {keys: [[0.2, 1], [0.7, 2]]}
    by: {height: {to: 0.6, soft: 0.2}}
  - change: adhesion
    multiply: 0.5
    by: {direction: {towards: z}, edges: {within: 0.1, soft: 0.2}}
"""


@pytest.fixture
def model(tmp_path: Path) -> Path:
    write_mesh(tmp_path / "sheet.ply", make_random_sheet(300, seed=1))
    (tmp_path / "own.yaml").write_text(CONFIG)
    (tmp_path / "way.csv").write_text("-0.5,0,0\n0.5,0.2,0\n")
    return tmp_path / "sheet.ply"


def snapshots_of(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted((folder / "snapshots").iterdir())}


class _StopError(Exception):
    pass


def test_threads_and_a_stop_change_no_byte_and_masks_are_inputs(model: Path, tmp_path: Path) -> None:
    loaded = load_config(tmp_path / "own.yaml")
    report = run_asset(loaded, model, tmp_path / "whole")
    assert list(report["inputs"]) == ["sheet.ply", "steering/way.csv"]
    assert verify(tmp_path / "whole").is_whole
    run_asset(loaded, model, tmp_path / "many", threads=2)

    def stop(done: int, total: int) -> None:
        if done >= 17:
            raise _StopError

    kept = load_config(tmp_path / "own.yaml", ["checkpoint.steps=5"])
    with pytest.raises(_StopError):
        run_asset(kept, model, tmp_path / "stopped", progress=stop)
    run_asset(kept, model, tmp_path / "stopped", resume=True)
    expected = snapshots_of(tmp_path / "whole")
    assert snapshots_of(tmp_path / "many") == expected == snapshots_of(tmp_path / "stopped")

    (tmp_path / "way.csv").write_text("-0.5,0,0\n0.5,0.3,0\n")
    with pytest.raises(ResumeError, match=r"input steering/way\.csv"):
        run_asset(loaded, model, tmp_path / "whole", resume=True)


def test_a_missing_mask_ends_the_run_before_any_work(model: Path, tmp_path: Path) -> None:
    (tmp_path / "way.csv").unlink()
    with pytest.raises(ConfigError, match=r"steering\[0\].*way\.csv cannot be read"):
        run_asset(load_config(tmp_path / "own.yaml"), model, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_finished_run_is_restored_at_any_step(model: Path, tmp_path: Path) -> None:
    run_asset(load_config(tmp_path / "own.yaml"), model, tmp_path / "whole")
    finished = open_run(tmp_path / "whole")
    last, again = restore_simulation(finished), restore_simulation(finished, 0)
    for _ in range(30):
        again.step()
    ours, others = state_arrays(last), state_arrays(again)
    assert all(np.array_equal(ours[k], others[k], equal_nan=ours[k].dtype.kind == "f") for k in ours)
    assert restore_simulation(finished, 12).step_count == 12
    with pytest.raises(UsageError, match="no step 31"):
        restore_simulation(finished, 31)
    (tmp_path / "way.csv").write_text("-0.5,0,0\n0.5,0.3,0\n")
    with pytest.raises(UsageError, match=r"the masks of the run, way\.csv"):
        restore_simulation(finished)


def test_risk_is_written_whole(model: Path, tmp_path: Path) -> None:
    import trimesh

    run_asset(load_config(tmp_path / "own.yaml"), model, tmp_path / "whole")
    simulation = restore_simulation(open_run(tmp_path / "whole"), 10)
    risk = assess_risk(simulation)
    about = write_risk(tmp_path, simulation.surface, risk)
    assert json.loads((tmp_path / SUMMARY).read_text()) == about
    shares = about["attached_share"], about["separated_share"], about["bare_share"]
    assert sum(shares) == pytest.approx(1.0, abs=2e-6)
    separation = about["separation"]
    assert separation["within_steps"]["30"] + separation["never"] == pytest.approx(shares[0], abs=2e-6)

    ply = trimesh.load(tmp_path / PLY, process=False)
    data = ply.metadata["_ply_raw"]["vertex"]["data"]
    assert np.array_equal(data["steps_to_separation"], risk.separation_steps)
    expected = np.round(risk_colors(risk, "separation") * 255.0)
    np.testing.assert_allclose(ply.visual.vertex_colors[:, :3], expected, atol=1)
    (mesh,) = trimesh.load(tmp_path / GLB, process=False).geometry.values()
    assert {"_RISK_SEPARATION", "_STEPS_TO_FRACTURE"} <= set(mesh.vertex_attributes)
    assert (tmp_path / PICTURE).read_bytes()[:4] == b"\x89PNG"


def test_the_picture_has_the_colours_of_its_legend(model: Path, tmp_path: Path) -> None:
    simulation = restore_simulation(open_run_of(model, tmp_path), 0)
    image = draw_risk(simulation.surface, assess_risk(simulation), width=320, height=300)
    assert image.shape == (300, 640, 3)
    assert np.array_equal(
        image, draw_risk(simulation.surface, assess_risk(simulation), width=320, height=300)
    )
    yellow = np.abs(image.astype(int) - (253, 231, 37)).max(axis=2) < 3
    assert yellow[216 + 30 : 216 + 44, 30].all()  # where the bar begins


def open_run_of(model: Path, tmp_path: Path):  # type: ignore[no-untyped-def]
    run_asset(load_config(tmp_path / "own.yaml"), model, tmp_path / "whole")
    return open_run(tmp_path / "whole")
