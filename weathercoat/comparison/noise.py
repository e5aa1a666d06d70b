"""How far runs that differ in nothing but their seed are apart, as measured by `weathercoat bench noise`.

What was measured follows simple laws: numbers and areas of patches spread by their square root, and means
over what lies along cracks the less, the longer these are. So one coefficient for each figure serves for
models and ages that were not measured, roughly. Films of fewer faces than those vary more, as a mean over so
many fewer does.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from weathercoat.mesh.surface import Vectors


class Law(NamedTuple):
    """The spread of a figure of the value v where cracks and outlines are L sizes long: a coefficient times
    v^value (1 - v)^rest L^-length.
    """

    value: float
    rest: float = 0.0
    length: float = 0.0


_SHARE = Law(0.5, rest=0.5)
_COUNT = Law(0.5)
_RELATIVE = Law(1.0)
_MEAN = Law(0.0, length=0.5)
_RELATIVE_MEAN = Law(1.0, length=0.5)

LAWS: Mapping[str, Law] = {
    "separated_share": _SHARE,
    "lost_share": _SHARE,
    "affected_share": _SHARE,
    "crack_length": _COUNT,
    "outline_length": _COUNT,
    "flakes": _COUNT,
    "flake_median_area": _RELATIVE_MEAN,
    "flake_largest_area": _RELATIVE_MEAN,
    "film_rust": _SHARE,
    "substrate_rust": _SHARE,
    "dust": _RELATIVE,
    "junctions_three": _MEAN,
    "junctions_four": _MEAN,
    "straightness": _MEAN,
    "dead_ends": Law(0.5, length=0.5),
    "crack_spacing": _RELATIVE,
    "pieces": _COUNT,
    "piece_median_area": _RELATIVE,
    "piece_roundness": _RELATIVE,
    "raised": _RELATIVE_MEAN,
}
_LEAST_LENGTH = 0.1  # sizes: shorter cracks are a few edges
SHIPPED = Path(__file__).with_name("noise.json")


def unit_spread(figure: str, values: Vectors, length: Vectors) -> Vectors:
    """The spread of a figure with the coefficient 1, of its values at several ages, of the same shape.

    length: of cracks and outlines there, in sizes.
    """
    law = LAWS[figure]
    rest = np.clip(1.0 - values, 0.0, None) ** law.rest
    return np.abs(values) ** law.value * rest * np.maximum(length, _LEAST_LENGTH) ** -law.length


def expected_spread(figure: str, values: Vectors, length: Vectors, faces: int | None = None) -> Vectors:
    """The standard deviation between seeds to be expected of a figure at each of several ages; see
    `unit_spread`. faces: of the films; None for as many as were measured.
    """
    coarse = 1.0 if faces is None else math.sqrt(max(_shipped()["faces"] / faces, 1.0))
    return _coefficients(figure)["at_an_age"] * coarse * unit_spread(figure, values, length)


def expected_spread_of_mean(figure: str) -> float:
    """The standard deviation to be expected of a figure's mean over the ages, each in units of
    `expected_spread`: the less, the less its ages have to do with each other.
    """
    return _coefficients(figure)["of_the_mean"] / _coefficients(figure)["at_an_age"]


def _coefficients(figure: str) -> Mapping[str, float]:
    """The measured coefficients of a figure, below which 9 in 10 cases lie."""
    coefficients: Mapping[str, float] = _shipped()["figures"][figure]
    return coefficients


@cache
def _shipped() -> Mapping[str, Any]:
    """What was measured: the coefficients of the `figures`, on films of so many `faces`."""
    content: Mapping[str, Any] = json.loads(SHIPPED.read_bytes())
    return content
