"""From exposure to degree of weathering, and from there to a config.

This is a look, not a measurement: a few terms whose order is right, with round numbers. What is taken from
the field: light and rain wear a coating where they reach it; steel rusts for as long as it is wet (time of
wetness, ISO 9223), which is long where water reaches and sun and wind do not; the foot of a thing that stands
in the rain is splashed (DIN 18533 counts 0.3 m of a wall as the splash zone); rust indoors is about a
twentieth of that outdoors (ISO 9223: up to 1.3 micrometres of steel a year in the class C1, 25 to 50 in C3);
dust settles everywhere and is washed off by rain. Salt, which rain also washes off, is not modelled.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from weathercoat.config.derived import with_values
from weathercoat.config.load import LoadedConfig
from weathercoat.mesh.surface import Vectors
from weathercoat.scene.exposure import CALM_SHARE, RAIN_SLOPE, Exposure

SPLASH_HEIGHT = 0.3  # metres over which splash fades to 1 / e
# What wets a surface, as shares of the time: rain on it, dew by night under an open sky, splash at its foot.
WET_BY_RAIN, WET_BY_DEW, WET_BY_SPLASH = 0.4, 0.3, 0.3
DRYING_IN_SHELTER = 0.5  # speed of drying without sun and wind, relative to that under an open sky
# What wears the coating: light, which makes it brittle; rain, which washes it out; wet time, which lifts it.
WEAR_BY_LIGHT, WEAR_BY_RAIN, WEAR_BY_WET = 0.35, 0.30, 0.35
# The degree is 1 - exp(-STEEPNESS * wear), so that it keeps the order of wear and stays below 1.
STEEPNESS = 2.5
INDOORS = 0.05  # degree of what nothing reaches
WASHED = 0.6  # share of the dust that rain keeps off what is exposed like a free-standing thing
LEAST_STEPS = 20  # of a run: a shorter one takes shorter steps
LEAST_FACTOR, MOST_FACTOR = 0.1, 3.0
MOST_DUST = 25.0  # as a factor on dust.rate, where a run is short because nothing but dust reaches the object
_DIGITS = 3
_SHORTEST = 1e-9  # ages that a config takes

_Values = Mapping[str, Any]


@dataclass(frozen=True)
class Weathering:
    """How an object weathers; means over its surface.

    degree: speed of ageing, 0 to 1. sky, rain: see `Exposure`. wet: share of the time, 0 to 1. height [m]:
    above the ground. splash: share of what a foot in open rain gets. rust, runoff, dust: factors on the rates
    of rust, on the length of streaks and on the rate of dust, per age of the shortened run. is_given: whether
    a rule gave the degree.
    """

    degree: float
    sky: float
    rain: float
    wet: float
    height: float
    splash: float
    rust: float
    runoff: float
    dust: float
    is_given: bool = False


def weather(exposure: Exposure, metres_per_unit: float, given: float | None = None) -> Weathering:
    """How an object with an exposure weathers.

    given: degree that counts instead of the derived one; rust and streaks then keep their rates.
    """
    height = exposure.height * metres_per_unit
    splash = exposure.ground_rain * np.exp(-height / SPLASH_HEIGHT)
    wear, wet = respond(exposure.sky, exposure.rain, splash)
    usual_degree, usual_rain, usual_wet = free_standing()
    degree = _degree(wear) if given is None else given
    rain = float(exposure.rain.mean())
    # Rates are per age of a run that is `degree` long. Rust is to follow wet time, and dust real time.
    speed = max(degree, INDOORS)
    rust = wet / usual_wet / (speed / usual_degree) if given is None else 1.0
    runoff = rain / usual_rain if given is None else 1.0
    dust = (1.0 - WASHED * min(rain / usual_rain, 1.0)) / (1.0 - WASHED) / (speed / usual_degree)
    return Weathering(
        degree=round(degree, _DIGITS),
        sky=round(float(exposure.sky.mean()), _DIGITS),
        rain=round(rain, _DIGITS),
        wet=round(wet, _DIGITS),
        height=round(float(height.mean()), _DIGITS),
        splash=round(float(splash.mean()), _DIGITS),
        rust=_factor(rust, MOST_FACTOR),
        runoff=_factor(runoff, 1.0),
        dust=_factor(dust, MOST_DUST),
        is_given=given is not None,
    )


def respond(sky: Vectors, rain: Vectors, splash: Vectors) -> tuple[float, float]:
    """Mean wear and mean share of wet time at samples (s,), each from what reaches it."""
    water = WET_BY_RAIN * rain + WET_BY_DEW * sky + WET_BY_SPLASH * splash
    drying = DRYING_IN_SHELTER + (1.0 - DRYING_IN_SHELTER) * sky
    wet = np.minimum(water / drying, 1.0)
    wear = WEAR_BY_LIGHT * sky + WEAR_BY_RAIN * rain + WEAR_BY_WET * wet
    return float(wear.mean()), float(wet.mean())


@cache
def free_standing() -> tuple[float, float, float]:
    """Degree, rain and share of wet time of a sphere high above open ground: what factors are relative to."""
    number = np.arange(1024)
    z = 1.0 - (2.0 * number + 1.0) / len(number)
    turn = 2.0 * np.pi * np.arange(64) / 64
    # a level ring of normals looks alike from all sides of the wind, so the azimuth of a normal is 0
    slanted = np.maximum(z[:, None] + RAIN_SLOPE * np.sqrt(1.0 - z**2)[:, None] * np.cos(turn), 0.0)
    rain = CALM_SHARE * np.maximum(z, 0.0) + (1.0 - CALM_SHARE) * slanted.mean(axis=1)
    wear, wet = respond(0.5 * (1.0 + z), rain, np.zeros(len(z)))
    return _degree(wear), float(rain.mean()), wet


def weathered_config(
    loaded: LoadedConfig, weathering: Weathering, *, age: float, up: tuple[float, float, float], seed: int
) -> LoadedConfig:
    """The config of an object that has been exposed for `age`: run for age times degree, with its own rates.

    The steps keep the length that they have in `loaded`, but for a run of fewer than `LEAST_STEPS`, and
    snapshots their share of the run. up: unit vector against gravity in the object's axes. The factors apply
    to what the config says, whoever said it.
    """
    config = loaded.config
    tick = config.ageing.duration / config.ageing.steps
    duration = max(1, round(age * weathering.degree / tick)) * tick
    steps = max(round(duration / tick), min(LEAST_STEPS, config.ageing.steps))
    rust, dust = config.rust, config.dust
    values = {
        "seed": seed,
        "model.up": list(up),
        "ageing.steps": steps,
        "ageing.duration": max(duration, _SHORTEST),
        "dust.rate": dust.rate * weathering.dust,
        "rust.source_rate": rust.source_rate * weathering.rust,
        "rust.lifted_rate": rust.lifted_rate * weathering.rust,
        "rust.bare_rate": rust.bare_rate * weathering.rust,
        "rust.runoff_length": rust.runoff_length * weathering.runoff,
    }
    if config.snapshots.steps:
        values["snapshots.steps"] = _scaled(config.snapshots.steps, steps / config.ageing.steps)
    return with_values(loaded, values, "the scene")


def _degree(wear: float) -> float:
    return INDOORS + (1.0 - INDOORS) * -math.expm1(-STEEPNESS * wear)


def _factor(value: float, most: float) -> float:
    return round(min(max(value, LEAST_FACTOR), most), _DIGITS)


def _scaled(steps: tuple[int, ...], share: float) -> list[int]:
    return sorted({round(step * share) for step in steps})
