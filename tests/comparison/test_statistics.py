"""Figures of runs: what the report says, in sizes, and the patterns of the snapshots."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from weathercoat.comparison.statistics import measure_run
from weathercoat.config.load import load_config
from weathercoat.errors import AccessError, CorruptError
from weathercoat.mesh.shapes import make_plate
from weathercoat.output.meshes import write_mesh
from weathercoat.run import run_asset

SMALL = ["remesh.faces=300", "ageing.steps=40", "output.preview=false", "snapshots.count=2"]


def _run(folder: Path, *changes: str, scale: float = 1.0) -> Path:
    folder.mkdir(exist_ok=True)
    write_mesh(folder / "plate.obj", make_plate(width=scale, height=scale))
    loaded = load_config("standard", [*SMALL, *changes])
    run_asset(loaded, folder / "plate.obj", folder / "run")
    return folder / "run"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return _run(tmp_path_factory.mktemp("run"))


def test_every_figure_has_a_finite_value_at_every_age(run: Path) -> None:
    measured = measure_run(run)
    assert measured.name == "run"
    assert measured.ages == (0.5, 1.0)
    for name, values in measured.figures.items():
        assert len(values) == 2, name
        assert np.isfinite(values).all(), name


def test_reported_figures_are_in_sizes(run: Path) -> None:
    report = json.loads((run / "run.json").read_bytes())
    last, area = report["snapshots"][-1], report["meshes"]["film"]["area"]
    figures = measure_run(run).figures
    assert figures["lost_share"][-1] == last["lost_share"]
    assert figures["crack_length"][-1] == pytest.approx(last["crack_length"] / area**0.5, rel=1e-12)
    assert figures["flake_largest_area"][-1] == pytest.approx(last["flakes"]["largest_area"] / area)
    assert figures["flakes"][-1] == last["flakes"]["count"] > 0


def test_a_run_without_ply_has_the_reported_figures_alone(run: Path, tmp_path: Path) -> None:
    reported = measure_run(_run(tmp_path, "output.formats=[glb]")).figures
    assert "straightness" not in reported
    both = measure_run(run).figures
    assert reported == {name: both[name] for name in reported}


def test_what_is_no_run_is_refused(run: Path, tmp_path: Path) -> None:
    with pytest.raises(AccessError, match=r"run\.json"):
        measure_run(tmp_path)
    (tmp_path / "run.json").write_text("{}")
    with pytest.raises(CorruptError, match="lacks figures"):
        measure_run(tmp_path)
    (tmp_path / "run.json").write_text("nothing")
    with pytest.raises(CorruptError, match="no JSON"):
        measure_run(tmp_path)
