"""Lights and backgrounds: what they change, and transparency."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.output.scenes import make_peeled_snapshot, make_plate
from weathercoat.output.lights import BACKGROUNDS, LIGHTS
from weathercoat.output.pictures import PictureParameters, render_snapshot
from weathercoat.output.shading import to_linear, to_srgb

SMALL = PictureParameters(width=96, height=80)
SNAPSHOT = make_peeled_snapshot(*make_plate(14), 0.3, pieces=40)


def drawn(light: str, **more: object) -> np.ndarray:
    parameters = replace(SMALL, light=light, background=None, **more)
    return render_snapshot(SNAPSHOT, parameters).astype(float)


def test_no_two_lights_look_the_same() -> None:
    images = [drawn(name) for name in LIGHTS]
    model = images[0][:, :, 3] == 255
    for i, one in enumerate(images):
        for other in images[:i]:
            assert np.abs(one - other)[model].mean() > 4.0


def test_evening_is_warm_and_an_overcast_sky_is_cool() -> None:
    def warmth(light: str) -> float:
        red, _, blue, _ = drawn(light, paint=(0.5, 0.5, 0.5))[25:55, 35:60].mean(axis=(0, 1))
        return float(red / blue)

    assert warmth("evening") > 1.2 * warmth("studio") > 1.2 * warmth("overcast")


@pytest.mark.parametrize("name", [name for name, color in BACKGROUNDS.items() if color is not None])
def test_the_corner_of_a_picture_has_the_colour_of_the_background(name: str) -> None:
    image = render_snapshot(SNAPSHOT, replace(SMALL, background=BACKGROUNDS[name]))
    assert np.array_equal(image[0, 0], np.rint(255 * np.array(BACKGROUNDS[name])))


def test_a_picture_without_background_laid_over_one_is_the_picture_with_it() -> None:
    clear = render_snapshot(SNAPSHOT, replace(SMALL, background=None))
    assert clear.shape == (80, 96, 4) and clear[0, 0, 3] == 0 and clear[40, 48, 3] == 255
    alpha = clear[:, :, 3:] / 255.0
    over = to_linear(clear[:, :, :3] / 255.0) * alpha + (1.0 - alpha) * to_linear(BACKGROUNDS["grey"])
    whole = render_snapshot(SNAPSHOT, SMALL)
    assert np.abs(to_srgb(over).astype(int) - whole).max() <= 2


def test_without_a_ground_nothing_falls_beside_the_model() -> None:
    image = render_snapshot(SNAPSHOT, replace(SMALL, has_ground=False, background=None))
    with_ground = render_snapshot(SNAPSHOT, replace(SMALL, background=None))
    assert (image[:, :, 3] > 0).sum() < (with_ground[:, :, 3] > 0).sum()
