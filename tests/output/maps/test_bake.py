"""Maps of plates whose state is known to the texel."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from tests.output.snapshots import make_sheet, make_snapshot
from weathercoat.errors import TextureCoordinatesError, UsageError
from weathercoat.mesh.surface import Surface, make_surface
from weathercoat.output.maps import bake
from weathercoat.output.maps.bake import Baker, MapParameters
from weathercoat.output.maps.channels import MAPS, parse_pack
from weathercoat.output.maps.folder import write_maps
from weathercoat.output.pictures import PictureParameters
from weathercoat.sim.snapshot import Snapshot

LOOK = PictureParameters()


def sorted_sheet(cells: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """The sheet with its faces in the order of x."""
    vertices, faces = make_sheet(cells)
    return vertices, faces[np.argsort(vertices[faces][:, :, 0].mean(axis=1), kind="stable")]


def plate(*, uv: np.ndarray | None = None) -> Surface:
    """The sheet with u along z and v along x, so that nothing is mirrored."""
    vertices, faces = sorted_sheet()
    return make_surface(vertices, faces, uv=vertices[faces][:, :, [2, 0]] if uv is None else uv)


def baked(
    folder: Path, surface: Surface, snapshot: Snapshot, *, threads: int = 1, **more: Any
) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """What `maps.json` says, and the pictures by name."""
    folder.mkdir()
    parameters = MapParameters(**{"width": 64, "height": 64, **more})
    baker = Baker(surface, np.ones(len(surface.faces), np.bool_), snapshot, LOOK, up=(0.0, 1.0, 0.0))
    about = write_maps(baker, snapshot, parameters, folder, threads=threads)
    assert json.loads((folder / "maps.json").read_text()) == about
    return about, {path.stem: np.asarray(Image.open(path)) for path in folder.glob("*.png")}


def half_bare(**more: Any) -> Snapshot:
    mesh = sorted_sheet()
    return make_snapshot(mesh=mesh, lost=len(mesh[1]) // 2, **more)


def make_lifted() -> Snapshot:
    """A plate half bare, whose film rises towards the bare half and hangs over it."""
    snapshot = half_bare()
    rise = 0.4 * (1.0 - snapshot.film_vertices[:, [0]]) * np.array([-0.2, 1.0, 0.0])
    return replace(snapshot, film_vertices=snapshot.film_vertices + rise)


def test_a_plate_half_bare_has_a_mask_of_half_its_texels(tmp_path: Path) -> None:
    snapshot = half_bare()
    clean = replace(snapshot, substrate_rust=0.0 * snapshot.dust, dust=0.0 * snapshot.dust)
    about, maps = baked(tmp_path / "m", plate(), clean)
    assert about["tiles"][0]["texels"] == 64 * 64
    assert about["tiles"][0]["mirrored_faces"] == about["tiles"][0]["overlapping_share"] == 0
    expected = np.zeros((64, 64), np.uint8)
    expected[32:] = 255  # v grows upwards with x, and what has a small x is lost
    assert (maps["bare"] == expected).all()
    assert (maps["separated"] == expected).all()
    metal, film = maps["orm"][40:], maps["orm"][:24]
    assert metal[..., 2].mean() > 20 and (film[..., 2] == 0).all()


def test_what_belongs_to_vertices_is_interpolated(tmp_path: Path) -> None:
    snapshot = half_bare()
    rust = snapshot.substrate_vertices[:, 2].copy()  # along u
    dust = 0.5 * snapshot.substrate_vertices[:, 0]
    _, maps = baked(tmp_path / "m", plate(), replace(snapshot, substrate_rust=rust, dust=dust))
    u = (np.arange(64) + 0.5) / 64
    assert np.abs(maps["rust"][40] / 255 - u).max() < 1 / 255
    assert np.abs(maps["dirt"][:, 5] / 255 - 0.5 * u[::-1]).max() < 1 / 255


def test_lifted_film_is_as_high_as_it_is(tmp_path: Path) -> None:
    vertices, faces = make_sheet()
    surface = make_surface(vertices, faces, uv=vertices[faces][:, :, [2, 0]])
    about, maps = baked(tmp_path / "m", surface, make_snapshot(split_column=2), bits=16)
    low, high = about["height"]["low"], about["height"]["high"]
    height = low + maps["height"] / 65535 * (high - low)
    # the grid line at x = 1/2 has copies that are lifted, so the upper half of the picture is at 0.1
    assert height[10, 20] == pytest.approx(0.1, abs=2e-5)
    assert height[50, 20] == pytest.approx(0.0, abs=2e-5)
    assert maps["lift"][10, 20] / 65535 * about["lift"]["high"] == pytest.approx(0.1, abs=2e-5)
    assert (maps["crack"][32] > 0).mean() > 0.9  # the line along which it was cut
    flat = maps["normal"].reshape(64, 64, 3)[50, 20].astype(float)
    assert flat[2] > 250


def test_film_that_hangs_over_covers_what_lies_under_it(tmp_path: Path) -> None:
    snapshot = half_bare()
    moved = snapshot.film_vertices + np.array([-0.25, 0.05, 0.0])
    _, maps = baked(tmp_path / "m", plate(), replace(snapshot, film_vertices=moved))
    bare = maps["bare"] + maps["crack"]
    assert (bare[48 + 2 :] == 255).all()  # x < 1/4
    assert (maps["lift"][18:46] > 0).all() and (maps["bare"][18:46] == 0).all()  # 1/4 < x < 3/4
    assert (bare[:14] == 255).all()  # where the film has gone from


def test_one_row_of_pixels_or_any_other_size(tmp_path: Path) -> None:
    _, maps = baked(tmp_path / "m", plate(), half_bare(), width=100, height=37)
    assert all(picture.shape[:2] == (37, 100) for picture in maps.values())
    assert abs((maps["bare"] == 255).mean() - 0.5) < 1 / 37


def test_threads_and_repetition_change_no_byte(tmp_path: Path) -> None:
    # more bands than threads
    for name, threads in (("a", 1), ("b", 3), ("c", 1)):
        baked(tmp_path / name, plate(), half_bare(), threads=threads, height=200)
    for path in (tmp_path / "a").iterdir():
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes()
        assert path.read_bytes() == (tmp_path / "c" / path.name).read_bytes()


def test_bands_leave_no_trace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    surface = plate()
    assert surface.uv is not None
    # the chart begins in row 79, so that row 63, the last of a band, shows the first texel of the next's
    apart = plate(uv=np.array([0.0, 0.2]) + np.array([1.0, 0.8 - 79 / 300]) * surface.uv)
    _, whole = baked(tmp_path / "a", apart, make_lifted(), height=300)
    monkeypatch.setattr(bake, "_BAND", 1)
    _, banded = baked(tmp_path / "b", apart, make_lifted(), height=300)
    assert (whole["orm"][63, :, 0] < 255).any()
    assert all((whole[name] == banded[name]).all() for name in whole)


def test_packing_puts_maps_into_channels(tmp_path: Path) -> None:
    packs = (parse_pack("R=rust,G=dirt,B=bare,A=crack"), parse_pack("two:r=height, g=roughness"))
    _, maps = baked(tmp_path / "m", plate(), half_bare(), packs=packs)
    for channel, name in enumerate(("rust", "dirt", "bare", "crack")):
        assert (maps["packed"][..., channel] == maps[name]).all()
    assert (maps["two"][..., 0] == maps["height"]).all()
    assert (maps["two"][..., 1] == maps["orm"][..., 1]).all()


@pytest.mark.parametrize("text", ["X=rust", "R=paint", "G=rust", "R=rust,R=dirt", "rust", "orm:R=rust"])
def test_packs_that_make_no_sense_are_refused(text: str) -> None:
    with pytest.raises(UsageError):
        parse_pack(text)


def test_udim_tiles_have_a_picture_each(tmp_path: Path) -> None:
    surface = plate()
    assert surface.uv is not None
    uv = surface.uv * (2.0, 1.0)
    uv[uv.mean(axis=1)[:, 0] > 1.0, :, 1] += 1.0  # squares (0, 0) and (1, 1)
    about, maps = baked(tmp_path / "m", plate(uv=uv), half_bare(), maps=("bare", "rust"))
    assert about["udim"] and [tile["tile"] for tile in about["tiles"]] == [1001, 1012]
    assert set(maps) == {"bare.1001", "bare.1012", "rust.1001", "rust.1012"}
    assert (maps["bare.1012"] == 255).mean() == pytest.approx(0.5)


def test_overlapping_and_mirrored_faces_are_told(tmp_path: Path) -> None:
    surface = plate()
    assert surface.uv is not None
    uv = surface.uv.copy()
    far = uv[:, :, 0].mean(axis=1) > 0.5
    uv[far, :, 0] = 1.0 - uv[far, :, 0]
    about, _ = baked(tmp_path / "m", plate(uv=uv), half_bare())
    (tile,) = about["tiles"]
    assert tile["mirrored_faces"] == far.sum()
    assert tile["texels"] == 32 * 64 and tile["overlapping_share"] == 1.0


def test_padding_goes_on_beyond_the_chart(tmp_path: Path) -> None:
    surface = plate()
    assert surface.uv is not None
    about, maps = baked(tmp_path / "m", plate(uv=0.25 + 0.5 * surface.uv), half_bare(), padding=5)
    covered = maps["separated"] == 255
    # the texels that the outline of the chart goes through are its own
    assert about["tiles"][0]["texels"] == 32 * 32
    assert covered[32:53, 16:48].all() and not covered[54:].any() and not covered[:, :10].any()


def test_texture_coordinates_that_no_map_can_have_are_refused(tmp_path: Path) -> None:
    surface = plate()
    assert surface.uv is not None
    for uv in (None, 3.0 * surface.uv, surface.uv - 1.0, surface.uv + np.array([10.0, 0.0])):
        with pytest.raises(TextureCoordinatesError):
            baked(tmp_path / str(id(uv)), replace(surface, uv=uv), half_bare())


def test_exr_holds_lengths_in_model_units(tmp_path: Path) -> None:
    exr = pytest.importorskip("OpenEXR")
    vertices, faces = make_sheet()
    surface = make_surface(vertices, faces, uv=vertices[faces][:, :, [2, 0]])
    baked(tmp_path / "m", surface, make_snapshot(split_column=2), format="exr")
    with exr.File(str(tmp_path / "m" / "height.exr")) as opened:
        (channel,) = opened.channels().values()
        assert channel.pixels[10, 20] == pytest.approx(0.1, rel=1e-3)
    with exr.File(str(tmp_path / "m" / "orm.exr")) as opened:
        assert opened.channels()["RGB"].pixels.shape == (64, 64, 3)
    assert (tmp_path / "m" / "model.glb").exists()


def test_the_model_wears_the_maps(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    surface = plate()
    _, maps = baked(tmp_path / "m", surface, half_bare())
    scene = trimesh.load(tmp_path / "m" / "model.glb", process=False)
    (mesh,) = scene.geometry.values()
    assert len(mesh.faces) == len(surface.faces)
    assert (np.asarray(mesh.visual.material.baseColorTexture) == maps["base_color"]).all()
    assert (np.asarray(mesh.visual.material.normalTexture) == maps["normal"]).all()
    assert np.abs(mesh.visual.uv[mesh.faces] - surface.uv).max() < 1e-6
    assert set(MAPS) <= set(maps)
