"""Exposure by rays: what is known for simple places, shelter, instances and parts."""

from __future__ import annotations

import numpy as np
import pytest

from tests.scene.yards import at, box, closed_room, yard
from weathercoat.mesh.surface import face_normals
from weathercoat.output import rays
from weathercoat.output.tree import TreeRays
from weathercoat.scene import exposure
from weathercoat.scene.exposure import CALM_SHARE, RAIN_SLOPE, measure_exposure, sample_surface
from weathercoat.scene.graph import SceneObject

_LYING = np.array([[1.0, 0, 0, 0], [0, 0, 1.0, 5.0], [0, -1.0, 0, 0], [0, 0, 0, 1.0]])  # +z becomes +y


def test_a_level_plate_in_the_open_gets_all_sky_and_all_rain() -> None:
    plate = measure_exposure(yard(SceneObject("plate", "plate", _LYING)))["plate"]
    assert np.allclose(plate.sky, 1.0)
    assert np.allclose(plate.rain, 1.0)
    assert np.allclose(plate.height, 5.0)


def test_an_upright_plate_gets_half_the_sky_and_driven_rain_alone() -> None:
    plate = measure_exposure(yard(SceneObject("plate", "plate", at(y=5.0))))["plate"]
    # 32 directions a sample, evenly spread over 384: a few thousandths
    assert plate.sky.mean() == pytest.approx(0.5, abs=0.01)
    # the mean of max(0, cos) over all azimuths is 1 / pi
    assert plate.rain.mean() == pytest.approx((1 - CALM_SHARE) * RAIN_SLOPE / np.pi, rel=0.02)


def test_a_mirrored_plate_keeps_its_outer_side() -> None:
    mirrored = _LYING @ np.diag([-1.0, 1.0, 1.0, 1.0])
    plate = measure_exposure(yard(SceneObject("plate", "plate", mirrored)))["plate"]
    assert np.allclose(plate.sky, 1.0)


def test_a_sphere_on_high_agrees_with_its_closed_form() -> None:
    sphere = measure_exposure(yard(SceneObject("ball", "sphere", at(y=50.0))))["ball"]
    assert sphere.sky.mean() == pytest.approx(0.5, abs=0.01)
    # a sphere shows every wind a disc of a quarter of its area, in rain that is longer by the slope
    slanted = np.sqrt(1.0 + RAIN_SLOPE**2)
    assert sphere.rain.mean() == pytest.approx(0.25 * (CALM_SHARE + (1 - CALM_SHARE) * slanted), rel=0.02)


def test_a_roof_keeps_rain_and_sky_away() -> None:
    roof = box("roof", 0, 3, 0, scale=(6, 0.1, 6))
    found = measure_exposure(yard(roof, box("under", 0, 0.5, 0), box("open", 30, 0.5, 0)))
    assert found["under"].rain.max() == 0.0
    assert found["under"].ground_rain == 0.0
    assert found["open"].ground_rain > 0.8
    assert found["under"].sky.mean() < 0.7 * found["open"].sky.mean()


def test_a_wall_beside_shields_the_side_that_it_is_on() -> None:
    scene = yard(
        box("wall", 0, 2, 0, scale=(0.2, 4, 10)), box("beside", 0.8, 0.5, 0), box("free", 40, 0.5, 0)
    )
    found = measure_exposure(scene)
    _, normals = sample_surface(scene.meshes["cube"], scene.objects[1], len(found["beside"].sky))
    near, far = normals[:, 0] < -0.9, normals[:, 0] > 0.9
    assert found["beside"].sky[near].mean() < 0.1
    assert found["beside"].sky[far].mean() == pytest.approx(0.5, abs=0.03)
    assert found["beside"].rain.mean() < 0.9 * found["free"].rain.mean()


def test_nothing_reaches_into_a_closed_box() -> None:
    inside = measure_exposure(yard(*closed_room(2.5), box("inside", 0, 2, 0)), ["inside"])["inside"]
    assert inside.sky.max() == 0.0
    assert inside.rain.max() == 0.0


def test_more_samples_change_little() -> None:
    scene = yard(box("roof", 0, 3, 0, scale=(6, 0.1, 6)), box("edge", 2.8, 0.5, 0))
    means = {}
    for samples in (96, 384, 6144):
        found = measure_exposure(scene, ["edge"], samples=samples)["edge"]
        means[samples] = np.array([found.sky.mean(), found.rain.mean()])
    assert np.abs(means[384] - means[6144]).max() < 0.01
    assert np.abs(means[96] - means[6144]).max() < 0.03


def test_the_place_in_the_world_does_not_matter() -> None:
    def means(shift: float) -> list[float]:
        roof = box("roof", shift, 3, 0, scale=(6, 0.1, 6))
        found = measure_exposure(yard(roof, box("edge", shift + 2.8, 0.5, 0)), ["edge"])["edge"]
        return [found.sky.mean(), found.rain.mean(), found.ground_rain]

    # far from the origin rays are cast from the middle of the scene; single rays that graze may change
    assert means(1e6) == pytest.approx(means(0.0), abs=2e-3)


def test_objects_that_are_added_far_away_change_nothing() -> None:
    alone = measure_exposure(yard(box("a", 0, 0.5, 0), box("b", 1.5, 0.5, 0)))
    more = measure_exposure(
        yard(box("a", 0, 0.5, 0), box("b", 1.5, 0.5, 0), box("c", 0, 0.5, -90)), ["a", "b"]
    )
    assert list(more) == ["a", "b"]
    for name in alone:
        assert more[name].sky.mean() == pytest.approx(alone[name].sky.mean(), abs=0.003)


def test_a_scene_in_parts_gives_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = yard(*closed_room(5.0)[:4], box("inside", 0, 2, 0), SceneObject("ball", "sphere", at(1, 2, 0)))
    whole = measure_exposure(scene)
    monkeypatch.setattr(exposure, "FACES_AT_ONCE", 60)
    assert len(list(exposure._parts(scene))) > 2
    for name, found in measure_exposure(scene).items():
        assert found.sky.tobytes() == whole[name].sky.tobytes()
        assert found.rain.tobytes() == whole[name].rain.tobytes()


def test_without_embree_the_answers_are_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = yard(box("roof", 0, 3, 0, scale=(6, 0.1, 6)), box("edge", 2.8, 0.5, 0))
    embree = measure_exposure(scene, samples=64)
    monkeypatch.setattr(exposure, "make_rays", TreeRays)
    assert rays.EmbreeRays is not TreeRays
    for name, found in measure_exposure(scene, samples=64).items():
        assert found.sky.mean() == pytest.approx(embree[name].sky.mean(), abs=2e-3)


def test_samples_lie_on_the_surface_evenly() -> None:
    scene = yard(box("slab", 0, 0, 0, scale=(2, 1, 0.5)))
    points, normals = sample_surface(scene.meshes["cube"], scene.objects[0], 3500)
    assert np.allclose(np.linalg.norm(normals, axis=1), 1.0)
    distance = np.abs(points) - [1.0, 0.5, 0.25]
    assert np.abs(distance.max(axis=1)).max() < 1e-12
    # sides of 2 x 1, 2 x 0.5 and 1 x 0.5, twice each, of 7 in all
    shares = [(np.abs(normals[:, axis]) > 0.9).mean() for axis in range(3)]
    assert shares == pytest.approx([1 / 7, 2 / 7, 4 / 7], abs=0.002)
    mesh = scene.meshes["cube"]
    outward = np.einsum("ij,ij->i", face_normals(mesh.vertices, mesh.faces), mesh.vertices[mesh.faces[:, 0]])
    assert (outward > 0).all()


def test_ground_is_the_lowest_point_where_the_scene_does_not_tell() -> None:
    found = measure_exposure(yard(box("low", 0, -7, 0), box("high", 0, 3, 0), ground=None))
    assert found["low"].height.min() == pytest.approx(0.0, abs=0.05)
    assert found["high"].height.min() == pytest.approx(10.0, abs=0.05)
