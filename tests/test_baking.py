"""Maps in a run, and by `bake` from the finished one."""

from __future__ import annotations

import json
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from PIL import Image

from weathercoat.baking import require_maps
from weathercoat.cli.handler import call
from weathercoat.config.load import load_config
from weathercoat.config.schema import Config, MapName
from weathercoat.errors import ConfigError, TextureCoordinatesError, UsageError
from weathercoat.finished import open_run
from weathercoat.mesh.shapes import make_plate
from weathercoat.mesh.surface import make_surface
from weathercoat.output.condition import assess
from weathercoat.output.maps.channels import MAPS
from weathercoat.output.meshes import write_mesh

SMALL = [
    "--faces",
    "400",
    "--steps",
    "30",
    "--set",
    "snapshots.count=2",
    "--set",
    "output.preview=false",
    "-q",
]


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a model with texture coordinates and its run, in which maps were baked."""
    folder = tmp_path_factory.mktemp("baking")
    plate = make_plate()
    position = plate.vertices[plate.faces][:, :, :2]
    low, high = position.min(axis=(0, 1)), position.max(axis=(0, 1))
    surface = make_surface(plate.vertices, plate.faces, uv=(position - low) / (high - low))
    write_mesh(folder / "plate.obj", surface)
    maps = ["--set", "maps.when=snapshots", "--set", "maps.width=96", "--set", "maps.height=64"]
    assert call(["run", "rusting", str(folder / "plate.obj"), "-o", str(folder / "run"), *SMALL, *maps]) == 0
    return folder


def test_the_config_knows_the_maps() -> None:
    assert get_args(MapName) == tuple(MAPS)
    assert Config().maps.when == "never"


def test_a_run_bakes_its_snapshots_and_is_whole(finished: Path) -> None:
    report = json.loads((finished / "run" / "run.json").read_text())
    steps = [row["step"] for row in report["snapshots"]]
    folders = sorted(path.name for path in (finished / "run" / "maps").iterdir())
    assert folders == [f"step_{step:04}" for step in steps]
    assert f"maps/{folders[-1]}/base_color.png" in report["files"]
    assert call(["verify", str(finished / "run")]) == 0


def test_bake_gives_what_the_run_wrote(finished: Path) -> None:
    out = finished / "again"
    assert call(["bake", str(finished / "run"), "-o", str(out), "--size", "96x64", "-q"]) == 0
    last = sorted((finished / "run" / "maps").iterdir())[-1]
    for path in last.iterdir():
        assert path.read_bytes() == (out / path.name).read_bytes()


def test_masks_have_the_areas_of_the_condition(finished: Path) -> None:
    run = open_run(finished / "run")
    for step, folder in zip(run.steps, sorted((finished / "run" / "maps").iterdir()), strict=True):
        condition = assess(run.read_snapshot(step))
        share = condition.area[condition.flaked].sum() / condition.area.sum()
        bare = np.asarray(Image.open(folder / "bare.png")) / 255.0
        # film that hangs over bare metal covers it; the texels of outlines are a tenth at this size
        assert bare.mean() == pytest.approx(share, abs=0.05)


def test_all_steps_go_into_folders_and_packs_into_maps(finished: Path) -> None:
    out = finished / "all"
    wanted = ["--step", "all", "--size", "32", "--maps", "bare,rust", "--pack", "R=rust,G=bare", "--quiet"]
    assert call(["bake", str(finished / "run"), "-o", str(out), *wanted]) == 0
    about = json.loads((out / "maps.json").read_text())
    assert len(about["steps"]) == 2
    for folder in (path for path in out.iterdir() if path.is_dir()):
        packed = np.asarray(Image.open(folder / "packed.png"))
        assert (packed[..., 1] == np.asarray(Image.open(folder / "bare.png"))).all()
        assert not (folder / "base_color.png").exists() and (folder / "model.glb").exists()


def test_an_atlas_serves_a_model_without_texture_coordinates(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("xatlas")
    write_mesh(tmp_path / "plate.obj", make_plate())
    assert call(["run", "rusting", str(tmp_path / "plate.obj"), "-o", str(tmp_path / "run"), *SMALL]) == 0
    capsys.readouterr()
    asked = ["bake", str(tmp_path / "run"), "-o", str(tmp_path / "maps"), "--size", "64", "-q"]
    assert call(asked) == 4
    assert "--atlas" in capsys.readouterr().err and not (tmp_path / "maps").exists()
    assert call([*asked, "--atlas"]) == 0
    (tile,) = json.loads((tmp_path / "maps" / "maps.json").read_text())["tiles"]
    assert tile["overlapping_share"] < 0.01 and tile["texels"] > 0.2 * 64 * 64
    assert (tmp_path / "maps" / "atlas.obj").read_text().count("\nvt ") > 3


def test_what_would_end_a_run_as_it_bakes_ends_it_before() -> None:
    plain = make_plate()
    wanted = load_config("standard", ["maps.when=last"]).config
    with pytest.raises(TextureCoordinatesError):
        require_maps(plain, wanted)
    require_maps(plain, Config())
    packed = load_config("standard", ["maps.when=last", "maps.pack=X=rust"]).config
    with pytest.raises(UsageError):
        require_maps(plain, packed)
    with pytest.raises(ConfigError, match="PLY"):
        load_config("standard", ["maps.when=last", "output.formats=glb"])
