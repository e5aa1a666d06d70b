"""Distances between a camera path and the parts of objects that it shows."""

from __future__ import annotations

import numpy as np
import pytest

from tests.scene.yards import box, yard
from weathercoat.config.schema import Scene as SceneSection
from weathercoat.scene.detail import nearest_distances, pixels_per_unit
from weathercoat.scene.graph import CameraPath


def looking(
    *places: tuple[float, float, float], along: tuple[float, float, float] = (0, 0, -1)
) -> CameraPath:
    positions = np.array(places, np.float64)
    return CameraPath(positions, np.tile(np.array(along, np.float64), (len(positions), 1)), 40.0)


# boxes of side 1 have a sample about every 0.06, and what is found is at most that much too near
_SPACING = 0.1


def test_the_distance_is_that_to_the_nearest_side() -> None:
    found = nearest_distances(yard(box("a"), camera=looking((0, 0, 10))))
    assert found["a"] is not None
    assert 9.5 - _SPACING <= found["a"] <= 9.5 + 1e-12


def test_the_nearest_place_of_a_path_decides() -> None:
    found = nearest_distances(yard(box("a"), camera=looking((0, 0, 10), (0, 0, 3), (0, 0, 6))))
    assert found["a"] == pytest.approx(2.5, abs=_SPACING)


def test_what_is_behind_or_beside_is_never_seen() -> None:
    scene = yard(box("behind", 0, 0, 20), box("beside", 30, 0, 0), box("shown"), camera=looking((0, 0, 10)))
    found = nearest_distances(scene)
    assert found["behind"] is None
    assert found["beside"] is None
    assert found["shown"] is not None


def test_what_lies_under_the_camera_counts_only_where_it_is_shown() -> None:
    floor = box("floor", 0, -1.5, 0, scale=(16, 1, 16))
    found = nearest_distances(yard(floor, camera=looking((0, 0, 0))))
    # the camera stands 1 above the floor; the lower corners of its image meet it further away
    slope = np.tan(np.radians(20.0)) * np.hypot(1.0, 16 / 9)
    entry = np.hypot(1.0, 1.0 / slope)
    assert found["floor"] is not None
    assert 1.0 < found["floor"] <= entry + 1e-9


def test_a_camera_that_touches_is_not_at_no_distance() -> None:
    found = nearest_distances(yard(box("a"), camera=looking((0, 0, 0.5))))
    assert found["a"] is not None
    assert 0.0 < found["a"] < 1e-5


def test_without_a_camera_there_are_no_distances() -> None:
    assert nearest_distances(yard(box("a"))) == {}


def test_pixels_are_those_of_the_config() -> None:
    section = SceneSection(nearest=7.0, field_of_view=40.0, image_height=1080)
    assert pixels_per_unit(looking((0, 0, 10)), 7.0) == section.pixels_per_unit()
