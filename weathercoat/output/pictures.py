"""Pictures of a run: a still of one snapshot, and the contact sheet of several.

They need no display, no GPU and no system packages. Same input, same bytes: every sample pattern is fixed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from weathercoat.errors import OutputError
from weathercoat.mesh.surface import Surface, Vectors
from weathercoat.output.camera import Camera, make_camera
from weathercoat.output.display import Normalisation, Samples, make_display_mesh
from weathercoat.output.lighting import filter_light, gather_light
from weathercoat.output.rays import RayQueries, make_rays
from weathercoat.output.shading import shade, to_linear, to_srgb
from weathercoat.sim.snapshot import Snapshot

Image = NDArray[np.uint8]
Color = tuple[float, float, float]
Axis = tuple[float, float, float]

_Y_UP = (0.0, 1.0, 0.0)


@dataclass(frozen=True)
class PictureParameters:
    """How a picture is taken. Colours are sRGB, 0 to 1; lengths are in sizes (square roots of the substrate's area).

    width, height: pixels. azimuth, elevation: degrees of the view, see `camera.make_camera`; margin: share of half the
    picture that stays free on each side. samples: side of the square of samples in each pixel; sky_rays, key_rays: rays
    for each sample towards the sky and the key light; reach: distance within which things block the sky.
    paint: colour of the film's front, or None for the snapshot's own film colours, taken as they are (stains included).
    """

    width: int = 560
    height: int = 430
    azimuth: float = 32.0
    elevation: float = 24.0
    margin: float = 0.06
    samples: int = 2
    sky_rays: int = 2
    key_rays: int = 1
    reach: float = 0.6
    film_thickness: float = 0.0035
    metal_thickness: float = 0.012
    background: Color = (0.845, 0.845, 0.835)
    paint: Color | None = (0.16, 0.53, 0.60)
    primer: Color = (0.83, 0.79, 0.70)
    metal: Color = (0.46, 0.47, 0.49)
    rust_rim: Color = (0.76, 0.42, 0.16)
    rust_body: Color = (0.52, 0.20, 0.05)
    rust_core: Color = (0.20, 0.10, 0.06)
    stain: Color = (0.50, 0.25, 0.09)
    dust: Color = (0.50, 0.46, 0.40)
    unpainted: Color = (0.20, 0.20, 0.21)


_KEY = 2.75 * np.array([1.0, 0.95, 0.87])
_STAIN_ABSORPTION = np.array([0.35, 1.1, 2.2])  # optical depth of a full stain in red, green and blue


def frame_camera(snapshot: Snapshot, parameters: PictureParameters, *, up: Axis = _Y_UP) -> Camera:
    """The camera that frames a snapshot's substrate, and so the same for every snapshot of a run, in display units."""
    vertices = Normalisation.of(snapshot)(snapshot.substrate_vertices)
    return make_camera(
        vertices,
        snapshot.substrate_normals,
        up,
        aspect=parameters.width / parameters.height,
        azimuth=parameters.azimuth,
        elevation=parameters.elevation,
        margin=parameters.margin,
    )


def render_snapshot(
    snapshot: Snapshot,
    parameters: PictureParameters,
    *,
    up: Axis = _Y_UP,
    untouched: Surface | None = None,
    camera: Camera | None = None,
) -> Image:
    """A picture of a snapshot, uint8 (height, width, 3).

    up: unit vector against gravity, in the model's axes; untouched: parts of the model that carry no paint, in its units;
    camera: one of `frame_camera`, which is also the default.
    """
    camera = camera or frame_camera(snapshot, parameters, up=up)
    painted = parameters.paint is not None
    mesh = make_display_mesh(
        snapshot,
        Normalisation.of(snapshot),
        film_thickness=parameters.film_thickness,
        metal_thickness=parameters.metal_thickness,
        paint=to_linear(parameters.paint if painted else snapshot.film_color),
        untouched=untouched,
    )
    rays = make_rays(mesh.vertices, mesh.faces)
    factor = parameters.samples
    width, height = parameters.width * factor, parameters.height * factor
    face, weights = _first_hits(rays, camera, width, height)
    seen = np.flatnonzero(face >= 0)
    samples = mesh.at(face[seen], weights[seen])
    if not painted:
        samples.stain[:] = 0.0
    color = _shaded(rays, samples, seen, camera, np.asarray(up, np.float64), parameters, width, height)
    picture = np.empty((height * width, 3), np.float32)
    picture[:] = to_linear(parameters.background)
    picture[seen] = color
    blocks = picture.reshape(parameters.height, factor, parameters.width, factor, 3)
    return to_srgb(blocks.mean(axis=(1, 3)))


def _first_hits(rays: RayQueries, camera: Camera, width: int, height: int) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """The face that each sample of the picture shows, and where on it; a band of rows at a time, to bound the memory."""
    face = np.empty(width * height, np.int32)
    weights = np.empty((width * height, 2), np.float32)
    band = max(1, 500_000 // width)
    for first in range(0, height, band):
        rows = np.arange(first, min(first + band, height))
        directions = camera.directions(rows, width, height)
        origins = np.broadcast_to(camera.position.astype(np.float32), directions.shape)
        part = slice(first * width, first * width + len(directions))
        face[part], weights[part] = rays.nearest(np.ascontiguousarray(origins), directions)
    return face, weights


def _shaded(
    rays: RayQueries,
    samples: Samples,
    seen: NDArray[np.int64],
    camera: Camera,
    up: Vectors,
    parameters: PictureParameters,
    width: int,
    height: int,
) -> NDArray[np.float32]:
    """Tone-mapped linear colours of the samples, (s, 3), at the places `seen` of the picture."""
    row, column = (seen // width).astype(np.int32), (seen % width).astype(np.int32)
    key = key_direction(camera, up)
    lit, sky = gather_light(
        rays, row, column, samples.position, samples.facet, samples.normal,
        key=key, up=up, sky_rays=parameters.sky_rays, key_rays=parameters.key_rays, reach=parameters.reach,
    )  # fmt: skip
    number = np.full((height, width), -1, np.int32)
    number[row, column] = np.arange(len(seen), dtype=np.int32)
    smooth_lit, smooth_sky = np.empty_like(lit), np.empty_like(sky)
    filter_light(number, row, column, samples.position, samples.facet, 0.004, lit, sky, smooth_lit, smooth_sky)
    color = np.empty((len(seen), 3), np.float32)
    shade(
        samples.kind, samples.position, samples.normal, samples.rest, samples.stain, samples.dust, samples.rust,
        samples.layer, samples.color, camera.position, key, _KEY, up, _palette(parameters), smooth_lit, smooth_sky, color,
    )  # fmt: skip
    return color


def key_direction(camera: Camera, up: Vectors) -> Vectors:
    """Towards the key light: from the upper left, low over the surface that faces the camera, so that relief shows."""
    direction = -0.62 * camera.right + 0.62 * up - 0.45 * camera.forward
    return direction / np.linalg.norm(direction)  # type: ignore[no-any-return]


def _palette(parameters: PictureParameters) -> Vectors:
    """The colours that `shade` reads, (9, 3), linear."""
    p = parameters
    palette = to_linear([p.primer, p.metal, p.rust_rim, p.rust_body, p.rust_core, p.stain, p.stain, p.dust, p.unpainted])
    palette[6] = _STAIN_ABSORPTION
    return palette


def contact_sheet(images: Sequence[Image], labels: Sequence[str], columns: int) -> Image:
    """Pictures of one size in rows of `columns`, each with a small label in its lower left corner; uint8 (h, w, 3)."""
    from PIL import Image as Pillow
    from PIL import ImageDraw, ImageFont

    height, width = images[0].shape[:2]
    rows = -(-len(images) // columns)
    sheet = Pillow.new("RGB", (columns * width, rows * height), tuple(int(c) for c in images[0][0, 0]))
    draw = ImageDraw.Draw(sheet)
    font = ImageFont.load_default(max(11, height // 28))
    for index, (image, label) in enumerate(zip(images, labels, strict=True)):
        left, top = index % columns * width, index // columns * height
        sheet.paste(Pillow.fromarray(image), (left, top))
        draw.text((left + height // 28, top + height - height // 14), label, fill=(88, 88, 86), font=font)
    return np.asarray(sheet)


def write_png(path: Path, image: Image) -> None:
    """Write an image (h, w, 3) uint8 as PNG; `OutputError` if the file cannot be written."""
    from PIL import Image as Pillow

    try:
        Pillow.fromarray(image).save(path, format="PNG", optimize=False, compress_level=6)
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror or error}") from error
