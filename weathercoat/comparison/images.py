"""The pictures of runs, one for each age, and how different they look."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from weathercoat.comparison.flip import flip_map
from weathercoat.comparison.sides import Run
from weathercoat.config.schema import Config
from weathercoat.mesh.surface import Vectors
from weathercoat.output.folder import PREVIEW, UNTOUCHED, read_run
from weathercoat.output.pictures import Image, contact_sheet, frame_camera, read_png, render_snapshot

_QUALITY = 80
# Black through violet and orange to white, as pictures of FLIP have it, evenly rising in lightness.
_RAMP = np.array(
    [(0, 0, 4), (59, 15, 112), (140, 41, 129), (222, 73, 104), (254, 159, 109), (252, 253, 191)], np.float64
)


@dataclass(frozen=True)
class PictureDifference:
    """How different two pictures of one age look: `flip`, the mean over the pixels, 0 to 1.

    a, b: the pictures; difference: the map of where they differ; each encoded as WebP.
    """

    age: float
    flip: float
    a: bytes
    b: bytes
    difference: bytes


def read_pictures(run: Run) -> dict[float, Image]:
    """The pictures of a run by age: the panels of its preview, or drawn anew from its PLY snapshots where it
    has none; empty where it has neither.

    Raises CorruptError and FormatError where files cannot be read.
    """
    listed = run.report.get("files", {})
    config = Config.model_validate(run.report["config"])
    ages = [float(row["age"]) for row in run.report["snapshots"]]
    if PREVIEW in listed:
        shape = (config.output.picture_height, config.output.picture_width)
        return dict(zip(ages, split_sheet(read_png(run.folder / PREVIEW), shape, len(ages)), strict=True))
    if not any(name.endswith(".ply") and name.startswith("snapshots/") for name in listed):
        return {}
    return _draw(run.folder, config)


def split_sheet(sheet: Image, shape: tuple[int, int], count: int) -> list[Image]:
    """The `count` pictures of a contact sheet, each (height, width) = shape."""
    height, width = shape
    columns = sheet.shape[1] // width
    if sheet.shape[1] % width or sheet.shape[0] != height * -(-count // columns):
        raise ValueError(f"a sheet of {sheet.shape[:2]} does not hold {count} pictures of {shape}")
    corners = [(i // columns * height, i % columns * width) for i in range(count)]
    return [sheet[top : top + height, left : left + width] for top, left in corners]


def compare_pictures(a: Image, b: Image, age: float) -> PictureDifference:
    """How different two pictures (h, w, 3) look; ValueError where their sizes differ."""
    difference = flip_map(a, b)
    shown = color_map(difference)
    return PictureDifference(age, float(difference.mean()), *(encode(image) for image in (a, b, shown)))


def color_map(values: Vectors) -> Image:
    """Values 0 to 1 as colours, uint8 (h, w, 3)."""
    place = np.clip(values, 0.0, 1.0) * (len(_RAMP) - 1)
    stops = np.arange(len(_RAMP))
    return (
        np.stack([np.interp(place, stops, channel) for channel in _RAMP.T], axis=2).round().astype(np.uint8)
    )


def encode(image: Image) -> bytes:
    """An image as WebP."""
    from PIL import Image as Pillow

    stream = io.BytesIO()
    Pillow.fromarray(np.ascontiguousarray(image)).save(stream, format="WEBP", quality=_QUALITY)
    return stream.getvalue()


def _draw(folder: Path, config: Config) -> dict[float, Image]:
    """Pictures of the snapshots of a run, as its preview would have them."""
    from weathercoat.mesh.read import read_surface
    from weathercoat.recording import picture_parameters

    report, snapshots = read_run(folder)
    x, y, z = report["meshes"]["input"]["up"]
    parameters = picture_parameters(config)
    untouched = read_surface(folder / UNTOUCHED) if (folder / UNTOUCHED).exists() else None
    camera = frame_camera(snapshots[0], parameters, up=(x, y, z), untouched=untouched)
    pictures = {}
    for snapshot in snapshots:
        image = render_snapshot(snapshot, parameters, up=(x, y, z), untouched=untouched, camera=camera)
        pictures[snapshot.age] = contact_sheet([image], [f"age {snapshot.age:g}"])
    return pictures
