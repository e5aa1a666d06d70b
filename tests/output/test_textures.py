"""Textured pictures: the input's own textures on film and parts, how they are filtered, maps on a plain
mesh.
"""

from __future__ import annotations

from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from tests.output.scenes import make_peeled_snapshot, make_plate
from weathercoat.errors import CorruptError
from weathercoat.mesh.materials import SourceMaterial, Texture
from weathercoat.mesh.surface import Part, Surface, make_surface
from weathercoat.output.camera import make_camera
from weathercoat.output.display import make_bare_mesh, make_part_mesh, make_textured_mesh
from weathercoat.output.materials import make_material
from weathercoat.output.pictures import PictureParameters, render_mesh, render_snapshot
from weathercoat.output.shading import to_linear
from weathercoat.output.texels import CLAMP, MIRROR, REPEAT, Footprint, make_texels, read_texels
from weathercoat.sim.snapshot import Snapshot

SMALL = PictureParameters(width=96, height=80)
RED, GREEN, BLUE = (200, 20, 20), (20, 180, 20), (20, 20, 200)


def png(pixels: np.ndarray) -> bytes:
    stream = BytesIO()
    Image.fromarray(pixels.astype(np.uint8)).save(stream, format="PNG")
    return stream.getvalue()


def textured(pixels: np.ndarray, **sampler: int) -> SourceMaterial:
    entry = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0.0}}
    return SourceMaterial("painted", entry, (Texture(png(pixels), "image/png", "p", sampler),))


def halves() -> np.ndarray:
    """Red on the left, green on the right; the lowest quarter is blue."""
    pixels = np.empty((64, 64, 3), np.uint8)
    pixels[:, :32], pixels[:, 32:] = RED, GREEN
    pixels[48:] = BLUE
    return pixels


def dressed(vertices: np.ndarray, faces: np.ndarray, *materials: SourceMaterial, **more: object) -> Surface:
    """A plate with texture coordinates from corner to corner, in one part of the first material."""
    uv = (vertices[:, :2] - vertices[:, :2].min(axis=0)) / np.ptp(vertices[:, :2], axis=0)
    return make_surface(
        vertices,
        faces,
        **{
            "uv": uv[faces],
            "face_part": np.zeros(len(faces), np.int32),
            "parts": (Part("plate", 0),),
            "materials": materials,
            **more,
        },
    )


def whole(*materials: SourceMaterial, **more: object) -> Snapshot:
    vertices, faces = make_plate(14)
    snapshot = make_peeled_snapshot(vertices, faces, 0.0, pieces=40)
    return replace(snapshot, surface=dressed(vertices, faces, *materials, **more))


def straight(parameters: PictureParameters = SMALL, **changes: object) -> PictureParameters:
    return replace(parameters, azimuth=0.0, elevation=0.0, **changes)


def strongest(image: np.ndarray, y: float, x: float) -> int:
    h, w = image.shape[:2]
    part = image[int((y - 0.05) * h) : int((y + 0.05) * h), int((x - 0.05) * w) : int((x + 0.05) * w)]
    return int(part.reshape(-1, 3).mean(axis=0).argmax())


def test_the_film_shows_the_texture_of_the_input_the_right_way_up() -> None:
    image = render_snapshot(whole(textured(halves())), straight())
    assert strongest(image, 0.3, 0.35) == 0
    assert strongest(image, 0.3, 0.65) == 1
    assert strongest(image, 0.8, 0.5) == 2


def test_the_look_paint_and_parts_without_texture_show_the_paint() -> None:
    plain = SourceMaterial("plain", {"pbrMetallicRoughness": {"baseColorFactor": [0.6, 0.01, 0.01, 1.0]}})
    snapshot = whole(textured(halves()))
    bare = render_snapshot(replace(snapshot, surface=None), straight())
    assert np.array_equal(render_snapshot(snapshot, straight(look="paint")), bare)
    assert np.array_equal(render_snapshot(whole(plain), straight()), bare)
    assert strongest(render_snapshot(whole(plain), straight(look="model")), 0.5, 0.5) == 0


def test_faces_beside_a_textured_part_keep_the_colour_of_the_paint_to_the_seam() -> None:
    vertices, faces = make_plate(14)
    left = vertices[faces].mean(axis=1)[:, 0] < 0.0
    snapshot = whole(
        textured(np.full((4, 4, 3), 255)),
        SourceMaterial("plain"),
        face_part=np.where(left, 0, 1).astype(np.int32),
        parts=(Part("left", 0), Part("right", 1)),
    )
    parameters = straight(paint=(0.02, 0.02, 0.02))
    image = render_snapshot(snapshot, parameters)
    row = image[35:45].mean(axis=(0, 2))
    middle = row[20:76]
    # faces of a random triangulation: the seam is a zigzag of one face's width, and nothing lies between
    assert (middle[:20] > 150).all() and (middle[-20:] < 70).all()


def test_stains_and_dust_lie_on_the_texture() -> None:
    clean = whole(textured(np.full((8, 8, 3), (40, 90, 200))))
    dirty = replace(clean, dust=np.ones(len(clean.dust)), film_rust=np.ones(len(clean.film_rust)))
    before, after = (
        render_snapshot(each, straight())[30:50, 38:58].mean(axis=(0, 1)) for each in (clean, dirty)
    )
    assert before[2] > 1.5 * before[0] and after[0] > after[2]


def test_a_part_without_paint_shows_its_material_and_its_vertex_colours() -> None:
    vertices, faces = make_plate(6)
    colors = np.ones((len(vertices), 4))
    colors[:, 1:3] = 0.1
    view = {"aspect": 1.2, "azimuth": 0.0, "elevation": 0.0, "margin": 0.1}
    camera = make_camera(vertices, np.tile([0.0, 0.0, 1.0], (len(vertices), 1)), (0.0, 1.0, 0.0), **view)

    def drawn(surface: Surface) -> np.ndarray:
        return render_mesh(make_part_mesh(surface.vertices, surface), camera, SMALL, ground=(-9.0, 1.0))

    assert strongest(drawn(dressed(vertices, faces, textured(halves()))), 0.8, 0.5) == 2
    assert strongest(drawn(make_surface(vertices, faces, colors=colors)), 0.5, 0.5) == 0
    plain = make_surface(vertices, faces)
    bare = render_mesh(make_bare_mesh(vertices, faces), camera, SMALL, ground=(-9.0, 1.0))
    assert np.array_equal(drawn(plain), bare)


@pytest.mark.parametrize(
    ("wrap", "expected"), [(REPEAT, [0, 1, 0, 1]), (CLAMP, [0, 0, 0, 1]), (MIRROR, [1, 0, 0, 1])]
)
def test_what_lies_beyond_the_edges(wrap: int, expected: list[int]) -> None:
    """Two texels, black and white, seen at -0.75, -0.25, 0.25 and 0.75."""
    texels = make_texels(np.array([[[0], [255]]], np.uint8), is_color=False, wrap=(wrap, CLAMP))
    uv = np.array([[-0.75, 0.5], [-0.25, 0.5], [0.25, 0.5], [0.75, 0.5]])
    nothing = np.zeros_like(uv)
    assert texels.at(Footprint(uv, nothing, nothing))[:, 0] == pytest.approx(expected)


@pytest.mark.parametrize("shape", [(8, 8), (7, 5), (1, 9), (100, 33)])
def test_the_last_reduction_is_the_mean(shape: tuple[int, int]) -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (*shape, 3)).astype(np.uint8)
    texels = make_texels(pixels, is_color=True)
    mean = to_linear(pixels / 255.0).mean(axis=(0, 1))
    assert texels.values[-1] / 65535 == pytest.approx(mean, abs=len(texels.levels) / 65535)


def test_a_footprint_that_covers_the_whole_picture_sees_its_mean() -> None:
    pixels = np.random.default_rng(1).integers(0, 256, (64, 64, 1)).astype(np.uint8)
    texels = make_texels(pixels, is_color=False)
    place = np.array([[0.3, 0.7]])
    across, down = np.array([[1.0, 0.0]]), np.array([[0.0, 1.0]])
    assert texels.at(Footprint(place, across, down))[0, 0] == pytest.approx(pixels.mean() / 255, abs=1e-4)
    # eight texels of one column: probes along it see nothing of its neighbours
    stripes = make_texels(np.tile(pixels[:1], (64, 1, 1)), is_color=False)
    narrow = stripes.at(Footprint(np.array([[10.5 / 64, 0.5]]), across / 64, down / 8))[0, 0]
    assert narrow == pytest.approx(pixels[0, 10, 0] / 255, abs=1e-4)


def test_a_fine_checkerboard_is_an_even_grey_from_afar() -> None:
    vertices, faces = make_plate(6)
    checks = (255 * (np.add.outer(np.arange(512), np.arange(512)) % 2)).astype(np.uint8)
    surface = dressed(vertices, faces)
    view = {"aspect": 1.2, "azimuth": 0.0, "elevation": 0.0, "margin": 0.1}
    camera = make_camera(vertices, np.tile([0.0, 0.0, 1.0], (len(vertices), 1)), (0.0, 1.0, 0.0), **view)

    def drawn(value: np.ndarray) -> np.ndarray:
        mesh = make_textured_mesh(vertices, surface, make_material(np.repeat(value[:, :, None], 3, axis=2)))
        return render_mesh(mesh, camera, SMALL, ground=(-9.0, 1.0)).astype(int)

    grey = np.full((4, 4), 188, np.uint8)  # half of the light
    assert np.abs(drawn(checks) - drawn(grey)).max() <= 2


def test_normals_of_a_map_turn_the_light() -> None:
    vertices, faces = make_plate(6)
    surface = dressed(vertices, faces)
    view = {"aspect": 1.2, "azimuth": 0.0, "elevation": 0.0, "margin": 0.1}
    camera = make_camera(vertices, np.tile([0.0, 0.0, 1.0], (len(vertices), 1)), (0.0, 1.0, 0.0), **view)
    grey = np.full((2, 2, 3), 128, np.uint8)

    def light(x: int, y: int, mirrored: bool = False) -> float:
        uv = surface.uv * [-1.0, 1.0] if mirrored else surface.uv
        normal = np.full((2, 2, 3), (x, y, 220), np.uint8)
        mesh = make_textured_mesh(vertices, replace(surface, uv=uv), make_material(grey, normal=normal))
        return float(render_mesh(mesh, camera, SMALL, ground=(-9.0, 1.0))[30:50, 40:56].mean())

    # the key light comes from the upper left
    assert light(60, 128) > light(128, 128) > light(200, 128)
    assert light(128, 200) > light(128, 128) > light(128, 60)
    assert light(200, 128, mirrored=True) == pytest.approx(light(56, 128), abs=1.0)
    flat = make_textured_mesh(vertices, surface, make_material(grey))
    plain = float(render_mesh(flat, camera, SMALL, ground=(-9.0, 1.0))[30:50, 40:56].mean())
    assert light(128, 128) == pytest.approx(plain, abs=1.0)


def test_the_transform_of_a_texture_is_applied() -> None:
    place = {"extensions": {"KHR_texture_transform": {"offset": [0.5, 0.0], "scale": [0.5, 1.0]}}}
    texels = read_texels(Texture(png(halves()), "image/png"), place, is_color=True)
    nothing = np.zeros((1, 2))
    red, green, _ = texels.at(Footprint(np.array([[0.25, 0.3]]), nothing, nothing))[0]
    assert green > red  # u 0.25 becomes 0.625, in the right half


def test_a_broken_texture_is_named() -> None:
    with pytest.raises(CorruptError, match="'wood'"):
        read_texels(Texture(b"no picture", "image/png", "wood"), {}, is_color=True)
