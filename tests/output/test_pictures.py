"""Pictures: framing, what the materials look like, shadows, and that the same input gives the same bytes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.output.scenes import make_peeled_snapshot, make_plate, make_sphere
from weathercoat.mesh.surface import make_surface
from weathercoat.output import pictures
from weathercoat.output.camera import Camera, make_camera, turntable, zoomed
from weathercoat.output.display import Normalisation
from weathercoat.output.pictures import (
    PictureParameters,
    contact_sheet,
    frame_camera,
    render_snapshot,
    write_png,
)
from weathercoat.output.rays import EmbreeRays
from weathercoat.output.shading import gradient_noise, to_linear, to_srgb
from weathercoat.output.tree import TreeRays
from weathercoat.sim.snapshot import Snapshot

SMALL = PictureParameters(width=96, height=80)


def plate(age: float, side: int = 14) -> Snapshot:
    return make_peeled_snapshot(*make_plate(side), age, pieces=40)


def middle(image: np.ndarray) -> np.ndarray:
    """Mean colour of the middle ninth."""
    h, w = image.shape[:2]
    return image[h // 3 : 2 * h // 3, w // 3 : 2 * w // 3].reshape(-1, 3).mean(axis=0)


def without_film(snapshot: Snapshot, rust: float = 0.0) -> Snapshot:
    count = len(snapshot.substrate_vertices)
    return replace(
        snapshot,
        film_faces=snapshot.film_faces[:0],
        film_face=snapshot.film_face[:0],
        substrate_rust=np.full(count, rust),
        dust=np.zeros(count),
    )


def test_a_picture_has_the_asked_size_and_the_same_bytes_every_time() -> None:
    snapshot = plate(0.5)
    first = render_snapshot(snapshot, SMALL)
    assert first.shape == (80, 96, 3) and first.dtype == np.uint8
    assert np.array_equal(first, render_snapshot(snapshot, SMALL))


def test_scale_and_place_of_the_model_do_not_show() -> None:
    snapshot = plate(0.5)
    factor, offset = 2.0**-20, np.array([3.0, -5.0, 7.0]) * 2.0**-18
    moved = replace(
        snapshot,
        film_vertices=snapshot.film_vertices * factor + offset,
        substrate_vertices=snapshot.substrate_vertices * factor + offset,
    )
    here, there = render_snapshot(snapshot, SMALL), render_snapshot(moved, SMALL)
    # Rounding may turn single samples at edges.
    assert (np.abs(here.astype(int) - there) > 8).mean() < 0.002


def test_the_tree_and_embree_give_the_same_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("embreex")
    snapshot = plate(0.5)
    monkeypatch.setattr(pictures, "make_rays", EmbreeRays)
    embree = render_snapshot(snapshot, SMALL)
    monkeypatch.setattr(pictures, "make_rays", TreeRays)
    # Embree calculates in single precision: samples within its rounding of an edge may differ.
    assert (np.abs(render_snapshot(snapshot, SMALL).astype(int) - embree) > 8).mean() < 0.002


@pytest.mark.parametrize("faces", [1, 3, 4, 5, 100])
def test_the_tree_finds_the_nearest_face_of_every_ray(faces: int) -> None:
    random = np.random.default_rng(faces)
    vertices = random.normal(size=(3 * faces, 3))
    triangles = np.arange(3 * faces, dtype=np.int32).reshape(-1, 3)
    targets = vertices[triangles].mean(axis=1)
    origins = np.tile(np.float32([8.0, 1.0, -2.0]), (faces, 1))
    directions = (targets - origins).astype(np.float32)
    tree = TreeRays(vertices, triangles)
    face, weights = tree.nearest(origins, directions)

    corner = vertices[triangles].astype(np.float64)
    e, f = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    for ray in range(faces):
        system = np.stack([-np.broadcast_to(directions[ray].astype(float), e.shape), e, f], axis=2)
        t, u, v = np.linalg.solve(system, (origins[ray].astype(float) - corner[:, 0])[:, :, None])[:, :, 0].T
        distance = np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0), t, np.inf)
        assert face[ray] == distance.argmin()
        assert np.allclose(weights[ray], [u[face[ray]], v[face[ray]]], atol=1e-5)
        just_short, just_beyond = distance.min() * (1 - 1e-6), distance.min() * (1 + 1e-6)
        one = slice(ray, ray + 1)
        assert not tree.blocked(origins[one], directions[one], just_short)[0]
        assert tree.blocked(origins[one], directions[one], just_beyond)[0]


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    azimuth=st.floats(-180, 180),
    elevation=st.floats(-80, 80),
    aspect=st.floats(0.3, 3.0),
    up=st.sampled_from([(0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)]),
)
def test_the_camera_sees_every_vertex_and_wastes_no_room(
    seed: int, azimuth: float, elevation: float, aspect: float, up: tuple[float, float, float]
) -> None:
    random = np.random.default_rng(seed)
    points = random.normal(size=(30, 3)) * random.uniform(0.1, 1.0, 3)
    normals = points / np.linalg.norm(points, axis=1, keepdims=True)
    camera = make_camera(points, normals, up, aspect=aspect, azimuth=azimuth, elevation=elevation, margin=0.1)
    frame = np.stack([camera.right, camera.up, camera.forward])
    assert np.allclose(frame @ frame.T, np.eye(3), atol=1e-9)
    x, y, depth = frame @ (points - camera.position).T
    across, down = np.abs(x / depth / camera.tangent_x), np.abs(y / depth / camera.tangent_y)
    assert depth.min() > 0
    assert across.max() <= 0.9 + 1e-9 and down.max() <= 0.9 + 1e-9
    assert max(across.max(), down.max()) > 0.9 - 1e-9 or depth.min() < 0.06 * np.ptp(points, axis=0).max()


@pytest.mark.parametrize("facing", [(0, 0, 1), (0, 0, -1), (1, 0, 0), (0, 1, 0), (0, -1, 0)])
def test_a_plate_is_seen_from_its_normal_side(facing: tuple[int, int, int]) -> None:
    normal = np.asarray(facing, float)
    frame = np.linalg.svd(normal[None])[2]
    random = np.random.default_rng(0)
    points = random.uniform(-1, 1, (50, 2)) @ frame[1:]
    camera = make_camera(
        points,
        np.tile(normal, (50, 1)),
        (0.0, 1.0, 0.0),
        aspect=1.2,
        azimuth=32.0,
        elevation=24.0,
        margin=0.06,
    )
    assert -camera.forward @ normal > 0.5
    assert (camera.position - points.mean(axis=0)) @ normal > 0


def test_a_half_pipe_is_seen_from_outside_and_a_closed_sheet_from_its_front() -> None:
    angle = np.linspace(0.0, np.pi, 41)
    normals = np.stack([np.cos(angle), 0 * angle, -np.sin(angle)], axis=1)
    view = {"aspect": 1.2, "azimuth": 32.0, "elevation": 24.0, "margin": 0.06}
    outside = make_camera(normals, normals, (0.0, 1.0, 0.0), **view)
    assert outside.forward[2] > 0.5
    plate_points = np.random.default_rng(0).uniform(-1, 1, (40, 3)) * [1.0, 1.0, 0.02]
    both_sides = np.tile([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]], (20, 1))
    assert make_camera(plate_points, both_sides, (0.0, 1.0, 0.0), **view).forward[2] < -0.5


def test_the_camera_of_a_run_does_not_depend_on_the_film() -> None:
    first, last = frame_camera(plate(0.1), SMALL), frame_camera(plate(0.9), SMALL)
    assert np.array_equal(first.position, last.position) and np.array_equal(first.forward, last.forward)


def test_the_camera_sees_the_untouched_parts_too() -> None:
    """A part far to the right of the plate moves the camera back, and its picture has that part in it."""
    snapshot = plate(0.0)
    part = make_surface(np.add(snapshot.substrate_vertices, [4.0, 0.0, 0.0]), snapshot.substrate_faces)
    near, far = frame_camera(snapshot, SMALL), frame_camera(snapshot, SMALL, untouched=part)
    assert np.linalg.norm(far.position) > 1.5 * np.linalg.norm(near.position)
    picture = render_snapshot(snapshot, replace(SMALL, unpainted=(0.9, 0.05, 0.05)), untouched=part)
    red = (picture[:, :, 0] > 2.0 * picture[:, :, 1].astype(float)).any(axis=0)
    assert red.any() and not red[:2].any() and not red[-2:].any()


def in_view(points: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Where points are seen, -1 to 1 across and up the picture."""
    x, y, depth = np.stack([camera.right, camera.up, camera.forward]) @ (points - camera.position).T
    assert depth.min() > 0
    return x / depth / camera.tangent_x, y / depth / camera.tangent_y


def test_a_camera_that_knows_the_films_has_all_of_them_in_view() -> None:
    base = plate(0.5)
    far = replace(base, film_vertices=np.add(base.film_vertices, [0.0, 0.4, 0.5]))
    points = Normalisation.of(base)(far.film_vertices)
    seen = frame_camera(base, SMALL, films=[base, far])
    assert max(np.abs(axis).max() for axis in in_view(points, seen)) <= 0.9 + 1e-9
    assert max(np.abs(axis).max() for axis in in_view(points, frame_camera(base, SMALL))) > 1.0


def test_a_turntable_goes_round_with_everything_in_view_and_wastes_no_room() -> None:
    points = np.random.default_rng(2).uniform(-1, 1, (60, 3)) * [1.0, 0.4, 0.2]
    up = np.array([0.0, 1.0, 0.0])
    first = make_camera(points, points, (0.0, 1.0, 0.0), aspect=1.3, azimuth=20.0, elevation=15.0, margin=0.1)
    cameras = turntable(first, points, up, 12, margin=0.1)
    extents = [max(np.abs(axis).max() for axis in in_view(points, camera)) for camera in cameras]
    assert max(extents) == pytest.approx(0.9, abs=1e-9)
    assert np.allclose(cameras[0].forward, first.forward)
    azimuths = np.unwrap([np.arctan2(camera.forward[0], camera.forward[2]) for camera in cameras])
    assert np.allclose(np.abs(np.diff(azimuths)), np.pi / 6)
    assert np.allclose([camera.forward @ up for camera in cameras], first.forward @ up)


def test_zoom_makes_larger_and_a_centre_is_in_the_middle() -> None:
    camera = frame_camera(plate(0.0), SMALL)
    point = np.array([[0.2, 0.1, 0.0]])
    near = zoomed(camera, 4.0, point[0])
    assert np.allclose(in_view(point, near), 0.0)
    assert np.ptp(in_view(np.array([[0.2, 0.1, 0.0], [0.21, 0.1, 0.0]]), near)[0]) == pytest.approx(
        4.0 * np.ptp(in_view(np.array([[0.2, 0.1, 0.0], [0.21, 0.1, 0.0]]), zoomed(camera, 1.0, point[0]))[0])
    )


def test_intact_paint_has_the_hue_of_the_paint() -> None:
    green = middle(render_snapshot(plate(0.0), replace(SMALL, paint=(0.2, 0.6, 0.25))))
    red = middle(render_snapshot(plate(0.0), replace(SMALL, paint=(0.7, 0.15, 0.1))))
    assert green[1] > 1.5 * green[0] and green[1] > 1.5 * green[2]
    assert red[0] > 2.0 * red[1] and red[0] > 2.0 * red[2]


def test_a_film_without_thickness_still_covers_metal_and_back() -> None:
    red = replace(SMALL, paint=(0.7, 0.1, 0.1))
    thin = render_snapshot(plate(0.0), replace(red, film_thickness=0.0))
    h, w = thin.shape[:2]
    part = thin[h // 3 : 2 * h // 3, w // 3 : 2 * w // 3].astype(float)
    assert (part[..., 0] > 2.0 * part[..., 1]).all()


def test_rust_grows_from_nothing_over_patches_to_a_cover() -> None:
    def orange(amount: float) -> np.ndarray:
        image = render_snapshot(without_film(plate(0.5), amount), replace(SMALL, width=240, height=200))
        part = image[67:133, 80:160].astype(float)
        return part[..., 0] > 1.5 * part[..., 2]

    shares = [orange(amount).mean() for amount in (0.0, 0.3, 0.45, 1.0)]
    assert shares[0] == 0.0 and shares[3] > 0.97
    assert 0.02 < shares[1] < shares[2] < 0.9


def test_runoff_and_dust_change_paint_towards_rust_and_grey() -> None:
    clean = plate(0.0)
    stained = middle(render_snapshot(replace(clean, film_rust=np.ones(len(clean.film_rust))), SMALL))
    dusty = middle(render_snapshot(replace(clean, dust=np.ones(len(clean.dust))), SMALL))
    plain = middle(render_snapshot(clean, SMALL))
    assert stained[0] > plain[0] + 20 and stained[2] < plain[2] - 20
    assert np.ptp(dusty) < 0.6 * np.ptp(plain)


def test_lifted_film_casts_a_shadow_on_the_metal_and_attached_film_hides_it() -> None:
    base = without_film(plate(0.0, side=20))
    faces = base.substrate_faces
    centre = base.substrate_vertices[faces].mean(axis=1)
    strip = faces[np.abs(centre[:, 0]) < 0.1]

    def with_strip(height: float) -> np.ndarray:
        lifted = replace(
            base,
            film_vertices=base.substrate_vertices + np.array([0.0, 0.0, height]),
            film_origin=np.arange(441, dtype=np.int32),
            film_faces=strip,
            film_rust=np.zeros(441),
        )
        return render_snapshot(lifted, parameters, camera=camera).astype(float)

    parameters = replace(SMALL, width=200, height=160, paint=(0.9, 0.1, 0.1))
    camera = frame_camera(base, parameters, films=[base])
    bare = render_snapshot(base, parameters, camera=camera).astype(float)

    def darkened(image: np.ndarray) -> float:
        """Share of the picture that shows metal, not half as bright as without the film."""
        metal = np.ptp(image, axis=2) < 30
        return float((metal & (image.mean(axis=2) < 0.6 * bare.mean(axis=2))).mean())

    assert darkened(with_strip(0.08)) > 0.02
    assert darkened(with_strip(0.0)) < 0.005


def test_the_back_of_the_film_is_primer() -> None:
    flat = plate(0.0)
    vertices = flat.film_vertices * [1.0, 1.0, -1.0] + [0.0, 0.0, 0.3]
    turned = replace(flat, film_vertices=vertices, film_faces=flat.film_faces[:, ::-1])
    seen = middle(render_snapshot(turned, replace(SMALL, paint=(0.1, 0.1, 0.9))))
    assert seen[0] > seen[2]


def test_parts_without_paint_are_shown_in_their_place() -> None:
    points, faces = make_sphere(100, radius=0.2)
    ball = make_surface(points + np.array([0.0, 0.0, 0.3]), faces)
    parameters = replace(SMALL, unpainted=(0.8, 0.1, 0.1))

    def red(image: np.ndarray) -> np.ndarray:
        return image[..., 0] > 2.0 * image[..., 1]

    assert not red(render_snapshot(plate(0.0), parameters)).any()
    seen = red(render_snapshot(plate(0.0), parameters, untouched=ball))
    # A disc of diameter 0.4 on a plate of side 1 that fills most of the picture's height.
    assert 0.03 < seen.mean() < 0.15
    assert not seen[:5].any() and not seen[-5:].any()


def test_a_contact_sheet_places_pictures_in_rows_and_labels_them() -> None:
    images = [np.full((60, 80, 3), value, np.uint8) for value in (250, 200, 150, 100)]
    sheet = contact_sheet(images, ["a", "b", "c", "d"], 3)
    assert sheet.shape == (120, 240, 3)
    assert (sheet[:30, 80:160] == 200).all() and (sheet[60:90, :80] == 100).all()
    assert (sheet[30:60, :40] != 250).any()
    shapes = [contact_sheet(images[:1] * n, ["a"] * n).shape[:2] for n in (1, 3, 4, 5, 10)]
    assert shapes == [(60, 80), (60, 240), (120, 160), (120, 240), (180, 320)]


def test_png_is_written(tmp_path: Path) -> None:
    from PIL import Image

    picture = np.arange(60, dtype=np.uint8).reshape(4, 5, 3)
    write_png(tmp_path / "a.png", picture)
    assert np.array_equal(np.asarray(Image.open(tmp_path / "a.png")), picture)


def test_srgb_and_linear_light_are_inverse() -> None:
    values = np.arange(256)
    assert np.array_equal(to_srgb(to_linear(values / 255.0)), values)


@given(point=st.tuples(*[st.floats(-50, 50)] * 3))
def test_noise_stays_in_range_and_its_gradient_is_that_of_finite_differences(
    point: tuple[float, float, float],
) -> None:
    slope, unused = np.empty(3), np.empty(3)
    value = gradient_noise(*point, slope)
    assert -0.5 < value < 1.5
    step = 1e-5
    for axis in range(3):
        ahead, behind = list(point), list(point)
        ahead[axis] += step
        behind[axis] -= step
        difference = (gradient_noise(*ahead, unused) - gradient_noise(*behind, unused)) / (2 * step)
        # The second derivative is bounded and continuous: central differences err by the square of the step.
        assert slope[axis] == pytest.approx(difference, abs=1e-6)
