"""Pictures of scenes: objects are where they stand, whatever their transform, and look painted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.scene.test_detail import looking
from tests.scene.yards import at, box, yard
from weathercoat.scene import picture
from weathercoat.scene.graph import Rule, SceneObject
from weathercoat.scene.picture import draw_scene, write_preview
from weathercoat.scene.plan import Choices, plan_scene

_RED = Choices(overrides=['appearance.paint="#c02020"'])


def redness(image: np.ndarray) -> np.ndarray:
    """How much redder than blue each pixel is, (height, width)."""
    return image[:, :, 0].astype(int) - image[:, :, 2].astype(int)


@pytest.fixture(autouse=True)
def _small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(picture, "HEIGHT", 54)


def test_an_object_is_where_the_camera_sees_it() -> None:
    scene = yard(box("a", 2, 0.5, 0), camera=looking((0, 0.5, 8)))
    image = draw_scene(plan_scene(scene, _RED), {}, {})
    assert image.shape == (54, 96, 3)
    _, columns = np.nonzero(redness(image) > 60)
    # its front side is at a distance of 7.5 and reaches from 1.5 to 2.5 to the right
    middle, per_unit = 48.0, 54 / (2 * 7.5 * np.tan(np.radians(20.0)))
    assert columns.min() == pytest.approx(middle + 1.5 * per_unit, abs=3.0)
    assert columns.max() + 1 == pytest.approx(middle + 2.5 * per_unit, abs=1.0)


def test_a_mirrored_object_looks_like_itself() -> None:
    def drawn(sign: float) -> np.ndarray:
        item = SceneObject("a", "sphere", at(y=0.5, scale=(sign, 1.0, 1.0)))
        return draw_scene(plan_scene(yard(item, camera=looking((0, 0.5, 3))), _RED), {}, {})

    plain, mirrored = drawn(1.0), drawn(-1.0)
    # the pattern of the paint is mirrored and nothing else; an inside out ball would be in the shade
    assert np.abs(plain.astype(int) - mirrored.astype(int)).mean() < 4.0


def test_an_uneven_scale_shows() -> None:
    scene = yard(box("a", 0, 0.5, 0, scale=(3.0, 0.4, 1.0)), camera=looking((0, 0.5, 8)))
    rows, columns = np.nonzero(redness(draw_scene(plan_scene(scene, _RED), {}, {})) > 60)
    assert np.ptp(columns) > 4 * np.ptp(rows)


def test_without_a_camera_everything_is_framed() -> None:
    image = draw_scene(plan_scene(yard(box("a"), box("b", 6, 0, 0)), _RED), {}, {})
    red = redness(image) > 60
    assert red.any()
    assert not red[:, [0, -1]].any()
    assert not red[[0, -1]].any()


def test_what_is_not_weathered_is_drawn_without_paint() -> None:
    scene = yard(box("a", 0, 0.5, 0), camera=looking((0, 0.5, 4)), rules=(Rule("*", weathered=False),))
    image = draw_scene(plan_scene(scene, _RED), {}, {})
    assert redness(image).max() < 60
    assert image[27, 48].max() < 0.8 * image[0, 0].max()


def test_a_scene_that_is_too_large_is_passed_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(picture, "MOST_FACES", 100)
    said: list[str] = []
    write_preview(tmp_path / "p.png", plan_scene(yard(box("a"))), {}, {}, said.append)
    assert said[0].startswith("no picture: some 40,000 faces")
    assert not list(tmp_path.iterdir())
