"""The Python interface, as the README shows it."""

from __future__ import annotations

from pathlib import Path

import pytest

import weathercoat
from weathercoat.config.load import load_config
from weathercoat.errors import AccessError, OutputError
from weathercoat.mesh.shapes import make_box
from weathercoat.run import run_asset


def test_read_remesh_simulate_write(tmp_path: Path) -> None:
    weathercoat.write(tmp_path / "box.obj", make_box())
    surface = weathercoat.remesh(weathercoat.read(tmp_path / "box.obj"), faces=600)
    assert 588 <= len(surface.faces) <= 612
    simulation = weathercoat.simulate(surface, "rusting", ["ageing.steps=40"], until=0.5)
    assert simulation.step_count == 20
    simulation.step()
    snapshot = simulation.snapshot()
    assert snapshot.age == pytest.approx(21 / 40)
    for name in ("aged.ply", "aged.glb", "aged.png"):
        weathercoat.write(tmp_path / name, snapshot)
        assert (tmp_path / name).stat().st_size > 1000


def test_verify(tmp_path: Path) -> None:
    weathercoat.write(tmp_path / "box.obj", make_box())
    run_asset(
        load_config("standard", ["ageing.steps=1", "remesh=off"]), tmp_path / "box.obj", tmp_path / "box"
    )
    assert weathercoat.verify(tmp_path / "box").is_whole
    (tmp_path / "box" / "preview.png").unlink()
    (finding,) = weathercoat.verify(tmp_path / "box").findings
    assert (finding.check, finding.file) == ("files-there", "preview.png")


def test_errors_are_the_package_s_own(tmp_path: Path) -> None:
    with pytest.raises(AccessError):
        weathercoat.read(tmp_path / "missing.obj")
    snapshot = weathercoat.simulate(make_box(), "standard", ["ageing.steps=1"]).snapshot()
    with pytest.raises(OutputError, match=r"\.txt"):
        weathercoat.write(tmp_path / "aged.txt", snapshot)
    with pytest.raises(AttributeError):
        _ = weathercoat.missing


@pytest.mark.parametrize("name", ["aged.ply", "aged.glb", "aged.png"])
def test_a_folder_that_is_missing(tmp_path: Path, name: str) -> None:
    snapshot = weathercoat.simulate(make_box(), "standard", ["ageing.steps=1"]).snapshot()
    with pytest.raises(OutputError, match="No such file"):
        weathercoat.write(tmp_path / "none" / name, snapshot)
