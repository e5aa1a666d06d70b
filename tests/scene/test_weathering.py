"""The degree of weathering: its order, its bounds, and what it does to a config."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from tests.scene.yards import at, box, closed_room, yard
from weathercoat.config.load import load_config
from weathercoat.scene.exposure import Exposure, measure_exposure
from weathercoat.scene.graph import SceneObject
from weathercoat.scene.weathering import (
    INDOORS,
    LEAST_STEPS,
    SPLASH_HEIGHT,
    Weathering,
    free_standing,
    weather,
    weathered_config,
)


def weathering_of(*objects: SceneObject, name: str, metres: float = 1.0) -> Weathering:
    found = measure_exposure(yard(*objects), [name], near=SPLASH_HEIGHT / metres)
    return weather(found[name], metres)


def evenly(sky: float, rain: float, height: float = 100.0, ground_rain: float = 0.0) -> Exposure:
    return Exposure(np.full(4, sky), np.full(4, rain), np.full(4, height), ground_rain)


def test_a_roof_shelters_and_a_closed_box_more() -> None:
    roof = box("roof", 0, 3, 0, scale=(6, 0.1, 6))
    open_ = weathering_of(box("a", 0, 0.5, 0), name="a")
    under = weathering_of(roof, box("a", 0, 0.5, 0), name="a")
    inside = weathering_of(*closed_room(2.5), box("a", 0, 2, 0), name="a")
    assert open_.degree > 1.5 * under.degree > 3.0 * inside.degree
    assert inside.degree == INDOORS
    assert open_.wet > 2.0 * under.wet > inside.wet == 0.0
    # dust stays where no rain comes, and runs down no more
    assert under.dust > 2.0 * open_.dust
    assert under.runoff < 0.2 * open_.runoff


def test_a_wall_beside_shelters_less_than_a_roof() -> None:
    wall, roof = box("wall", 0.8, 2, 0, scale=(0.2, 4, 10)), box("roof", 0, 3, 0, scale=(6, 0.1, 6))
    degrees = [
        weathering_of(*others, box("a", 0, 0.5, 0), name="a").degree for others in ((), (wall,), (roof,))
    ]
    assert degrees[0] > degrees[1] > degrees[2]


def test_the_foot_is_wetter_than_what_stands_high() -> None:
    low = weathering_of(box("a", 0, 0.5, 0), name="a")
    high = weathering_of(box("a", 0, 20, 0), name="a")
    assert low.wet > 1.2 * high.wet
    assert low.degree > high.degree
    assert low.splash > 0.2
    assert high.splash < 1e-6
    # where the ground is under a roof too, nothing splashes
    dry = weathering_of(box("roof", 0, 3, 0, scale=(8, 0.1, 8)), box("a", 0, 0.5, 0), name="a")
    assert dry.splash == 0.0


def test_splash_is_in_metres() -> None:
    metres, millimetres = (
        weathering_of(SceneObject("a", "cube", at(y=0.5 * s, scale=(s, s, s))), name="a", metres=m)
        for s, m in ((1.0, 1.0), (1000.0, 0.001))
    )
    assert metres.splash == pytest.approx(millimetres.splash, abs=2e-3)


@pytest.mark.parametrize("term", ["sky", "rain", "ground_rain"])
def test_more_of_anything_weathers_more(term: str) -> None:
    given = {"sky": 0.3, "rain": 0.3, "ground_rain": 0.3, "height": 0.1}
    degrees = [weather(evenly(**{**given, term: value}), 1.0).degree for value in (0.0, 0.2, 0.5, 1.0)]
    assert all(less < more for less, more in pairwise(degrees))
    assert degrees[0] >= INDOORS
    assert degrees[-1] < 1.0


def test_a_free_standing_sphere_keeps_its_rates() -> None:
    found = weathering_of(SceneObject("ball", "sphere", at(y=50.0)), name="ball")
    assert found.degree == pytest.approx(free_standing()[0], abs=0.01)
    assert [found.rust, found.runoff, found.dust] == pytest.approx([1.0, 1.0, 1.0], abs=0.05)


def test_a_given_degree_keeps_rust_as_it_is() -> None:
    found = weather(evenly(0.0, 0.0), 1.0, given=1.0)
    assert (found.degree, found.rust, found.runoff, found.is_given) == (1.0, 1.0, 1.0, True)


def test_the_run_is_shorter_by_the_degree_with_steps_as_long() -> None:
    loaded = load_config("rusting", ["ageing.steps=400", "ageing.duration=2"])
    found = weather(evenly(0.5, 0.3), 1.0)
    aged = weathered_config(loaded, found, age=3.0, up=(0.0, 0.0, 1.0), seed=9).config
    assert aged.ageing.duration == pytest.approx(3.0 * found.degree, abs=0.005)
    assert aged.ageing.duration / aged.ageing.steps == pytest.approx(2 / 400, rel=1e-12)
    assert aged.rust.bare_rate == loaded.config.rust.bare_rate * found.rust
    assert aged.model.up == (0.0, 0.0, 1.0)
    assert aged.seed == 9


def test_rust_follows_wet_time_and_dust_real_time() -> None:
    loaded = load_config("rusting")

    def grown(exposure: Exposure) -> tuple[float, float]:
        found = weather(exposure, 1.0)
        aged = weathered_config(loaded, found, age=1.0, up=(0.0, 1.0, 0.0), seed=1).config
        return aged.rust.bare_rate * aged.ageing.duration / found.wet, aged.dust.rate * aged.ageing.duration

    one, other = grown(evenly(0.5, 0.25)), grown(evenly(0.2, 0.02, 0.1, 1.0))
    assert one[0] == pytest.approx(other[0], rel=0.01)
    assert other[1] > 1.5 * one[1]


def test_explicit_snapshots_keep_their_share_of_the_run() -> None:
    loaded = load_config("rusting", ["ageing.steps=100", "snapshots.steps=[0, 50, 100]"])
    aged = weathered_config(loaded, weather(evenly(0, 0), 1.0, 0.1), age=1.0, up=(0, 1, 0), seed=1).config
    assert aged.snapshots.steps == (0, 10, 20)
    assert not aged.conflicts()


def test_what_hardly_weathers_takes_short_steps() -> None:
    loaded = load_config("rusting", ["ageing.steps=100"])
    aged = weathered_config(loaded, weather(evenly(0, 0), 1.0, 0.0), age=0.01, up=(0, 1, 0), seed=1).config
    assert aged.ageing.steps == LEAST_STEPS
    assert aged.ageing.duration == pytest.approx(0.01)
