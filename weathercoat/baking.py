"""Maps of a run: what bakes its snapshots, by its config."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weathercoat.config.schema import Config
from weathercoat.mesh.surface import Surface
from weathercoat.output.folder import snapshot_files, snapshot_stem
from weathercoat.output.maps.atlas import make_atlas, require_atlas
from weathercoat.output.maps.bake import Baker, MapParameters
from weathercoat.output.maps.channels import map_kinds, parse_pack
from weathercoat.output.maps.folder import write_maps
from weathercoat.output.maps.layout import make_layout
from weathercoat.output.maps.sinks import require_exr
from weathercoat.output.meshes import write_mesh
from weathercoat.output.snapshots import read_snapshot_ply
from weathercoat.recording import picture_parameters
from weathercoat.sim.snapshot import Snapshot

MAPS, ATLAS = "maps", "atlas.obj"
_SIZE_PER_GAP = 256  # charts of an atlas are this share of its size apart: 8 texels at 2048


def map_parameters(config: Config) -> MapParameters:
    """What the config wants baked. Raises UsageError for a packed map that makes no sense."""
    maps = config.maps
    return MapParameters(
        width=maps.width,
        height=maps.height,
        maps=maps.names,
        packs=tuple(parse_pack(text) for text in maps.pack),
        format=maps.format,
        bits=maps.bits,
        padding=maps.padding,
    )


def require_maps(surface: Surface, config: Config) -> None:
    """Raise before any work what would end a run as it bakes: UsageError, TextureCoordinatesError."""
    if config.maps.when == "never":
        return
    parameters = map_parameters(config)
    map_kinds(parameters.maps, parameters.packs)
    if parameters.format == "exr":
        require_exr()
    if config.maps.atlas:
        require_atlas()
    else:
        make_layout(surface)


def prepare_baker(
    surface: Surface,
    is_painted: NDArray[np.bool_],
    snapshot: Snapshot,
    config: Config,
    *,
    up: tuple[float, float, float],
    atlas_size: int | None = None,
) -> Baker:
    """What bakes the snapshots of a run onto its model, `surface`, of which the faces `is_painted` (m,) carry
    paint; snapshot: any of them. atlas_size: for texture coordinates laid out anew, the texels of a side.
    """
    if atlas_size is not None:
        surface = make_atlas(surface, size=atlas_size, padding=max(2, atlas_size // _SIZE_PER_GAP))
    return Baker(surface, is_painted, snapshot, picture_parameters(config), up=up)


def write_run_maps(
    folder: Path, surface: Surface, is_painted: NDArray[np.bool_], config: Config, *, threads: int = 1
) -> None:
    """Bake what the config wants of the snapshots in the folder of a run, into `maps` there: the last one's
    into that folder itself, of all each into a folder of its own.
    """
    files = snapshot_files(folder)
    last = max(files)
    parameters = map_parameters(config)
    size = min(parameters.width, parameters.height) if config.maps.atlas else None
    snapshot = read_snapshot_ply(files[last])
    baker = prepare_baker(surface, is_painted, snapshot, config, up=surface.up, atlas_size=size)
    target = folder / MAPS
    shutil.rmtree(target, ignore_errors=True)  # those of a run that is extended
    target.mkdir()
    if size is not None:
        write_mesh(target / ATLAS, baker.surface)
    if config.maps.when == "last":
        write_maps(baker, snapshot, parameters, target, threads=threads)
        return
    for step in sorted(files):
        place = target / snapshot_stem(step, last)
        place.mkdir()
        write_maps(baker, read_snapshot_ply(files[step]), parameters, place, threads=threads)


def summary(written: list[dict[str, Any]]) -> list[str]:
    """What is odd about the texture coordinates that maps were written on, in sentences."""
    tiles = written[0]["tiles"]
    mirrored = sum(tile["mirrored_faces"] for tile in tiles)
    overlapping = max(tile["overlapping_share"] for tile in tiles)
    said = []
    if mirrored:
        said.append(f"{mirrored:,} faces show their texture mirrored; their normals are turned to suit")
    flat = sum(tile["faces_without_area"] for tile in tiles)
    if flat:
        said.append(f"{flat:,} faces have no area in texture space, and show a single colour each")
    if overlapping > 0.0:
        said.append(
            f"{overlapping:.1%} of the texels belong to several faces, and show the first: "
            "give --atlas for a place of its own for each"
        )
    return said
