"""Pictures of a run: a still of one snapshot, and the contact sheet of several.

They need no display, no GPU and no system packages. Same input, same bytes: every sample pattern is fixed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from weathercoat.errors import CorruptError
from weathercoat.mesh.surface import Surface, Vectors, vertex_normals
from weathercoat.output.camera import Camera, make_camera
from weathercoat.output.display import DisplayMesh, Normalisation, make_display_mesh
from weathercoat.output.ground import ground_shadow
from weathercoat.output.lighting import filter_light, gather_light, share_samples
from weathercoat.output.lights import BACKGROUNDS, LIGHTS, Light
from weathercoat.output.materials import apply_materials
from weathercoat.output.rays import RayQueries, make_rays
from weathercoat.output.shading import (
    DUST,
    PRIMER,
    RUST_BODY,
    RUST_CORE,
    RUST_RIM,
    STAIN,
    STAIN_DEPTH,
    STEEL,
    UNPAINTED,
    shade,
    to_linear,
    to_srgb,
)
from weathercoat.sim.snapshot import Snapshot

Image = NDArray[np.uint8]
Color = tuple[float, float, float]
Axis = tuple[float, float, float]

_Y_UP = (0.0, 1.0, 0.0)


@dataclass(frozen=True)
class PictureParameters:
    """How a picture is taken. Colours are sRGB, 0 to 1; lengths are in sizes (square roots of the substrate's
    area).

    width, height: pixels. azimuth, elevation: degrees of the view, see `camera.make_camera`; margin: share
    of half the picture that stays free on each side. samples: side of the square of samples in each pixel;
    sky_rays, key_rays: rays for each sample towards the sky and the key light; reach: distance within which
    things block the sky. Colours are those of clean materials: the stains come from the snapshot's scalars.
    light: one of `lights.LIGHTS`; background: None for none, which makes a picture with an alpha channel;
    has_ground: whether a shadow falls on a ground. look: where the film shows the materials of the input:
    auto, model or paint, see `materials.film_materials`.
    """

    width: int = 520
    height: int = 430
    azimuth: float = 32.0
    elevation: float = 24.0
    margin: float = 0.1
    samples: int = 2
    sky_rays: int = 3
    key_rays: int = 1
    reach: float = 0.6
    film_thickness: float = 0.0028
    metal_thickness: float = 0.012
    light: str = "studio"
    background: Color | None = BACKGROUNDS["grey"]
    has_ground: bool = True
    paint: Color = (0.16, 0.53, 0.60)
    primer: Color = (0.83, 0.79, 0.70)
    metal: Color = (0.47, 0.49, 0.51)
    rust_rim: Color = (0.64, 0.39, 0.20)
    rust_body: Color = (0.47, 0.21, 0.09)
    rust_core: Color = (0.20, 0.10, 0.06)
    stain: Color = (0.50, 0.25, 0.09)
    dust: Color = (0.50, 0.46, 0.40)
    unpainted: Color = (0.20, 0.20, 0.21)
    look: str = "auto"


_CURL_REACH = 0.06  # in sizes: how far curls usually stand off, for pictures that do not know them yet
_SAME_SURFACE = 0.004  # distance from a plane, in sizes, within which samples count as one surface
_RAYS_AT_ONCE = 100_000  # a fraction of a second, so that Ctrl-C is answered
_STAIN_DEPTH = np.array([0.35, 1.1, 2.2])  # a stain takes away blue first


def frame_camera(
    snapshot: Snapshot,
    parameters: PictureParameters,
    *,
    up: Axis = _Y_UP,
    untouched: Surface | None = None,
    films: Sequence[Snapshot] = (),
) -> Camera:
    """The camera, in display units, that frames the substrate and the untouched parts, the same for all of a
    run, and the films of `films`; without any it leaves room for curls.
    """
    normalise = Normalisation.of(snapshot)
    vertices, normals = framed_points(snapshot, untouched=untouched, films=films)
    return make_camera(
        normalise(vertices),
        normals,
        up,
        aspect=parameters.width / parameters.height,
        azimuth=parameters.azimuth,
        elevation=parameters.elevation,
        margin=parameters.margin,
    )


def framed_points(
    snapshot: Snapshot, *, untouched: Surface | None = None, films: Sequence[Snapshot] = ()
) -> tuple[Vectors, Vectors]:
    """The points (k, 3) in the model's units that a picture has to show, and the normals (j, 3) of those of
    the model that say which way it faces; see `frame_camera`.
    """
    vertices, normals = [snapshot.substrate_vertices], [snapshot.substrate_normals]
    if untouched is not None:
        vertices.append(untouched.vertices)
        normals.append(vertex_normals(untouched.vertices, untouched.faces))
    if films:
        vertices += [film.film_vertices for film in films]
    else:
        reach = _CURL_REACH * Normalisation.of(snapshot).size
        vertices.append(snapshot.substrate_vertices + reach * snapshot.substrate_normals)
    return np.concatenate(vertices), np.concatenate(normals)


def render_snapshot(
    snapshot: Snapshot,
    parameters: PictureParameters,
    *,
    up: Axis = _Y_UP,
    untouched: Surface | None = None,
    camera: Camera | None = None,
) -> Image:
    """A picture of a snapshot, uint8 (height, width, 3), or (height, width, 4) without a background.

    up: unit vector against gravity, in the model's axes; untouched: parts of the model that carry no paint,
    in its units; camera: one of `frame_camera`, which is also the default.
    """
    camera = camera or frame_camera(snapshot, parameters, up=up, untouched=untouched)
    mesh = display_snapshot(snapshot, parameters, untouched=untouched)
    return render_mesh(mesh, camera, parameters, up=up, ground=ground_of(snapshot, parameters, up))


def display_snapshot(
    snapshot: Snapshot, parameters: PictureParameters, *, untouched: Surface | None = None
) -> DisplayMesh:
    """What pictures of a snapshot show."""
    return make_display_mesh(
        snapshot,
        Normalisation.of(snapshot),
        film_thickness=parameters.film_thickness,
        metal_thickness=parameters.metal_thickness,
        paint=to_linear(parameters.paint),
        untouched=untouched,
        look=parameters.look,
    )


def ground_of(snapshot: Snapshot, parameters: PictureParameters, up: Axis) -> tuple[float, float]:
    """The ground under a snapshot's substrate; see `render_mesh`."""
    placed = Normalisation.of(snapshot)(snapshot.substrate_vertices)
    level = float((placed @ np.asarray(up, np.float64)).min()) - parameters.metal_thickness
    return level, 1.6 * float(np.linalg.norm(placed, axis=1).max())


def render_mesh(
    mesh: DisplayMesh,
    camera: Camera,
    parameters: PictureParameters,
    *,
    up: Axis = _Y_UP,
    ground: tuple[float, float],
) -> Image:
    """A picture of a display mesh, uint8 (height, width, 3), or (height, width, 4) without a background.

    ground: height along `up` of the invisible ground that shadows fall on, and the distance from the origin
    at which they have faded; in display units, as are the mesh and the camera.
    """
    rays = make_rays(mesh.vertices, mesh.faces)
    factor = parameters.samples
    width, height = parameters.width * factor, parameters.height * factor
    face, weights = _first_hits(rays, mesh, camera, width, height)
    seen = np.flatnonzero(face >= 0)
    upward = np.asarray(up, np.float64)
    light = LIGHTS[parameters.light]
    lighting = _Lighting(light, light.direction(camera, upward), upward, parameters)
    color = _shaded(rays, mesh, face[seen], weights[seen], seen, (height, width), camera, lighting)
    picture = np.zeros((height * width, 3), np.float32)
    picture[seen] = color
    shown = _pixel_means(picture.reshape(height, width, 3), factor)
    coverage = _pixel_means((face >= 0).astype(np.float32).reshape(height, width, 1), factor)
    shadow = np.ones(coverage.shape)
    if parameters.has_ground:
        shadow[:, :, 0] = ground_shadow(
            rays,
            camera,
            coverage[:, :, 0] < 1.0,
            up=upward,
            level=ground[0],
            radius=ground[1],
            light=light,
            reach=parameters.reach,
        )
    if parameters.background is None:
        return _with_alpha(shown, coverage, shadow)
    return to_srgb(shown + (1.0 - coverage) * shadow * to_linear(parameters.background))


def _with_alpha(shown: NDArray[np.float32], coverage: NDArray[np.float32], shadow: Vectors) -> Image:
    """The picture as (height, width, 4): colours as they are, and the shadow as black that lets through."""
    alpha = coverage + (1.0 - coverage) * (1.0 - shadow)
    color = np.divide(shown, alpha, out=np.zeros(shown.shape), where=alpha > 0.0)
    return np.concatenate([to_srgb(color), np.rint(255.0 * alpha).astype(np.uint8)], axis=2)


def _pixel_means(samples: NDArray[np.float32], factor: int) -> NDArray[np.float32]:
    """Means of the squares of `factor` x `factor` samples, (height, width, channels)."""
    total = samples[::factor, ::factor].copy()
    for place in range(1, factor * factor):
        total += samples[place // factor :: factor, place % factor :: factor]
    return total / np.float32(factor * factor)


def _first_hits(
    rays: RayQueries, mesh: DisplayMesh, camera: Camera, width: int, height: int
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """The face that each sample shows, and where on it; bands of rows bound the memory."""
    face = np.full((height, width), -1, np.int32)
    weights = np.empty((height, width, 2), np.float32)
    rows, columns = camera.window(mesh.vertices, width, height)
    across = np.arange(columns.start, columns.stop)
    band = max(1, _RAYS_AT_ONCE // max(1, len(across)))
    for first in range(rows.start, rows.stop, band):
        down = np.arange(first, min(first + band, rows.stop))
        directions = camera.directions(down, across, width, height)
        origins = np.tile(camera.position.astype(np.float32), (len(directions), 1))
        hit, where = rays.nearest(origins, directions)
        part = (slice(first, first + len(down)), columns)
        face[part] = hit.reshape(len(down), -1)
        weights[part] = where.reshape(len(down), -1, 2)
    return face.ravel(), weights.reshape(-1, 2)


@dataclass(frozen=True)
class _Lighting:
    """The light, the directions towards its key light and up, and the parameters of the picture."""

    light: Light
    key: Vectors
    up: Vectors
    parameters: PictureParameters


def _shaded(
    rays: RayQueries,
    mesh: DisplayMesh,
    face: NDArray[np.int32],
    weights: NDArray[np.float32],
    seen: NDArray[np.int64],
    shape: tuple[int, int],
    camera: Camera,
    lighting: _Lighting,
) -> NDArray[np.float32]:
    """Tone-mapped linear colours (s, 3) of the points on `face`, at `seen` in a picture of `shape`."""
    parameters, light, width = lighting.parameters, lighting.light, shape[1]
    factor = parameters.samples
    number = np.full(shape, -1, np.int32)
    number.ravel()[seen] = np.arange(len(seen), dtype=np.int32)
    leader = np.empty(len(seen), np.int32)
    share_samples(number, face, weights, mesh.vertices, mesh.faces, mesh.kind, factor, _SAME_SURFACE, leader)
    is_leader = leader == np.arange(len(leader))
    leaders, follows = np.flatnonzero(is_leader), (np.cumsum(is_leader) - 1)[leader]
    number.ravel()[seen] = follows
    s = mesh.at(face[leaders], weights[leaders])
    apply_materials(mesh, face, weights, follows, camera, shape, s)
    row, column = (seen[leaders] // width).astype(np.int32), (seen[leaders] % width).astype(np.int32)
    lit, sky = gather_light(
        rays,
        row // factor,
        column // factor,
        s.position,
        s.facet,
        s.normal,
        key=lighting.key,
        up=lighting.up,
        light=light,
        sky_rays=parameters.sky_rays,
        key_rays=parameters.key_rays,
        reach=parameters.reach,
    )
    smooth_lit, smooth_sky = np.empty_like(lit), np.empty_like(sky)
    filter_light(
        number, factor, row, column, s.position, s.facet, _SAME_SURFACE, lit, sky, smooth_lit, smooth_sky
    )
    color = np.empty((len(leaders), 3), np.float32)
    shade(
        s.kind, s.position, s.normal, s.rest, s.stain, s.dust, s.rust, s.layer, s.color, s.is_own,
        s.roughness, s.metallic, s.occlusion, camera.position, lighting.key, np.array(light.key_color),
        light.sky(), light.box, lighting.up, make_palette(parameters), smooth_lit, smooth_sky, color,
    )  # fmt: skip
    return color[follows]


def make_palette(parameters: PictureParameters) -> Vectors:
    """The colours that `shade` reads, (9, 3), linear."""
    palette = np.empty((9, 3))
    palette[PRIMER], palette[STEEL] = to_linear(parameters.primer), to_linear(parameters.metal)
    palette[RUST_RIM], palette[RUST_BODY] = to_linear(parameters.rust_rim), to_linear(parameters.rust_body)
    palette[RUST_CORE], palette[STAIN] = to_linear(parameters.rust_core), to_linear(parameters.stain)
    palette[DUST], palette[UNPAINTED] = to_linear(parameters.dust), to_linear(parameters.unpainted)
    palette[STAIN_DEPTH] = _STAIN_DEPTH
    return palette


def contact_sheet(images: Sequence[Image], labels: Sequence[str], columns: int | None = None) -> Image:
    """Pictures of one size in rows of `columns`, each with a small label in its lower left corner; uint8 (h,
    w, 3 or 4). By default up to three are in a row, and more in a square.
    """
    from PIL import Image as Pillow
    from PIL import ImageDraw, ImageFont

    height, width = images[0].shape[:2]
    if columns is None:
        columns = len(images) if len(images) <= 3 else math.ceil(math.sqrt(len(images)))
    rows = -(-len(images) // columns)
    mode = "RGBA" if images[0].shape[2] == 4 else "RGB"
    sheet = Pillow.new(mode, (columns * width, rows * height), tuple(int(c) for c in images[0][0, 0]))
    draw = ImageDraw.Draw(sheet)
    small = max(11, height // 28)
    ink = (88, 88, 86) if images[0][0, 0, 1] > 60 or mode == "RGBA" else (190, 190, 188)
    font = ImageFont.load_default(small)
    for index, (image, label) in enumerate(zip(images, labels, strict=True)):
        left, top = index % columns * width, index // columns * height
        sheet.paste(Pillow.fromarray(image), (left, top))
        draw.text((left + small, top + height - 2 * small), label, fill=ink, font=font)
    return np.asarray(sheet)


def write_png(target: Path | BinaryIO, image: Image, *, compression: int = 6) -> None:
    """Write an image (h, w, 3 or 4) uint8 as PNG, compressed from 0 to 9; OSError if the target cannot be
    written.
    """
    from PIL import Image as Pillow

    Pillow.fromarray(image).save(target, format="PNG", compress_level=compression)


def read_png(path: Path) -> Image:
    """An image (h, w, 3) uint8 that `write_png` wrote; CorruptError if it cannot be read."""
    from PIL import Image as Pillow

    try:
        with Pillow.open(path) as image:
            return np.asarray(image.convert("RGB"))
    except (OSError, ValueError) as error:
        raise CorruptError("no picture", file=str(path), remedy="begin anew with --overwrite") from error
