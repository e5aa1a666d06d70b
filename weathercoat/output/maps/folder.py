"""The folder of baked maps: pictures, `maps.json` that says how to read them, and the model that wears
them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from weathercoat import __version__
from weathercoat.output.maps.bake import Baker, MapParameters
from weathercoat.output.maps.channels import map_kinds
from weathercoat.output.maps.model import SHOWN, TilePictures, write_model
from weathercoat.output.maps.sinks import require_exr
from weathercoat.output.report import write_json
from weathercoat.sim.snapshot import Snapshot

MAPS_REPORT, MODEL = "maps.json", "model.glb"

_CONVENTIONS = {
    "base_color": "albedo; sRGB in PNG, linear in EXR",
    "orm": "linear; R occlusion, G roughness, B metalness, as in glTF",
    "normal": "linear, 0.5 is 0; tangent space by MikkTSpace, +X along u, +Y along v (OpenGL)",
    "height": "linear; 0 to 1 is `height.low` to `height.high` in model units, the paint as new at 0; "
    "EXR has model units",
    "bare": "1 where metal is seen and the film is gone",
    "rust": "0 to 1, on metal its rust, on film what has run over it",
    "dirt": "0 to 1, dust",
    "crack": "1 in a crack: metal between film, or the line between two pieces",
    "lift": "height of film over the metal; 1 is `lift.high` in model units; EXR has model units",
    "separated": "1 where film has separated, or is gone",
    "age": "since the film separated, as a share of the age; 1 where it is gone",
}


def write_maps(
    baker: Baker, snapshot: Snapshot, parameters: MapParameters, folder: Path, *, threads: int = 1
) -> dict[str, Any]:
    """Write the maps of a snapshot, `maps.json` and `model.glb` into a folder that is there; the content of
    `maps.json`.

    Raises UsageError for maps that there are not, OSError where a file cannot be written.
    """
    kinds = map_kinds(parameters.maps, parameters.packs)
    if parameters.format == "exr":
        require_exr()
    baked = baker.bake(snapshot, parameters, folder, threads=threads)
    packs = {name: dict(zip("RGBA", values, strict=False)) for name, values in parameters.packs}
    about = {
        "generator": f"weathercoat {__version__}",
        "width": parameters.width,
        "height_in_texels": parameters.height,
        "bits": 16 if parameters.format == "exr" else parameters.bits,
        "format": parameters.format,
        "padding": parameters.padding,
        "first_row": "top",
        "udim": baker.layout.is_udim,
        "conventions": {name: packs.get(name) or _CONVENTIONS[name] for name in kinds},
        **baked,
    }
    write_json(folder / MAPS_REPORT, about)
    with TemporaryDirectory(dir=folder) as scratch:
        write_model(
            folder / MODEL,
            baker.surface,
            baker.frames,
            _pictures(baker, snapshot, parameters, about, folder, Path(scratch), threads),
        )
    return about


def _pictures(
    baker: Baker,
    snapshot: Snapshot,
    parameters: MapParameters,
    about: dict[str, Any],
    folder: Path,
    scratch: Path,
    threads: int,
) -> Sequence[TilePictures]:
    """What the model wears: the maps that are written, or where these are not 8-bit PNG, some that are."""
    entries, place = about["tiles"], folder
    if parameters.format != "png" or parameters.bits != 8 or not set(SHOWN) <= set(parameters.maps):
        plain = replace(parameters, maps=SHOWN, packs=(), format="png", bits=8)
        entries, place = baker.bake(snapshot, plain, scratch, threads=threads)["tiles"], scratch
    return [
        TilePictures(tile, {name: (place / entry["files"][name]).read_bytes() for name in SHOWN})
        for tile, entry in zip(baker.layout.tiles, entries, strict=True)
    ]
