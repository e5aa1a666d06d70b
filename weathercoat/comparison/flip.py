"""How different two pictures look to a person who flips between them: the measure FLIP, 0 to 1 a pixel.

Colours are compared as the eye resolves them at a distance: each image is blurred by the contrast sensitivity
of the luminance and of the two opponent colours, and differences are taken in an almost uniform colour space.
Where edges or points differ the difference counts for more. Source: Andersson, Nilsson, Akenine-Möller,
Oskarsson, Åström and Fairchild, FLIP: A difference evaluator for alternating images, 2020, whose constants
these are; the section numbers are theirs.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from weathercoat.mesh.surface import Vectors

PIXELS_PER_DEGREE = 67.0  # a screen 0.7 m wide with 3,840 pixels, seen from 0.7 m

_FROM_LINEAR = np.array(
    [
        [10135552.0 / 24577794.0, 8788810.0 / 24577794.0, 4435075.0 / 24577794.0],
        [2613072.0 / 12288897.0, 8788810.0 / 12288897.0, 887015.0 / 12288897.0],
        [1425448.0 / 73733382.0, 8788810.0 / 73733382.0, 70074185.0 / 73733382.0],
    ]
)  # linear sRGB to CIE XYZ, D65
_WHITE = _FROM_LINEAR.sum(axis=1)

# Sums of two Gaussians a sqrt(pi / b) exp(-pi^2 x^2 / b), x in degrees: (a, b) of luminance, red to green and
# blue to yellow (section 4.1.1).
_SENSITIVITY = (
    ((1.0, 0.0047), (0.0, 1e-5)),
    ((1.0, 0.0053), (0.0, 1e-5)),
    ((34.1, 0.04), (13.5, 0.025)),
)
_WIDEST = 0.04
_COLOR_EXPONENT, _FEATURE_EXPONENT = 0.7, 0.5
_KNEE, _AT_KNEE = 0.4, 0.95  # up to this share of the largest colour difference most of the scale is used
_FEATURE_WIDTH = 0.082  # degrees


def flip_map(
    first: NDArray[np.uint8], second: NDArray[np.uint8], pixels_per_degree: float = PIXELS_PER_DEGREE
) -> Vectors:
    """The difference at each pixel, 0 to 1, (h, w), of two sRGB pictures uint8 (h, w, 3).

    Raises ValueError where their shapes differ.
    """
    if first.shape != second.shape or first.ndim != 3 or first.shape[2] != 3:
        raise ValueError(f"pictures of the shapes {first.shape} and {second.shape} cannot be compared")
    opponent = [_to_opponent(_to_linear(picture)) for picture in (first, second)]
    seen = [_as_lab(_from_opponent(_blurred(picture, pixels_per_degree))) for picture in opponent]
    color = _spread(_color_distance(*seen) ** _COLOR_EXPONENT)
    luminance = [(picture[:, :, 0] + 16.0) / 116.0 for picture in opponent]
    feature = _feature_difference(luminance[0], luminance[1], pixels_per_degree)
    return color ** (1.0 - feature)  # type: ignore[no-any-return]


def mean_flip(
    first: NDArray[np.uint8], second: NDArray[np.uint8], pixels_per_degree: float = PIXELS_PER_DEGREE
) -> float:
    """The mean of `flip_map`."""
    return float(flip_map(first, second, pixels_per_degree).mean())


def _to_linear(picture: NDArray[np.uint8]) -> Vectors:
    value = picture / 255.0
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def _to_opponent(linear: Vectors) -> Vectors:
    """Linear sRGB to YCxCz, the linear form of L*a*b*, in which blurring keeps means."""
    x, y, z = np.moveaxis(linear @ _FROM_LINEAR.T / _WHITE, 2, 0)
    return np.stack([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)], axis=2)


def _from_opponent(opponent: Vectors) -> Vectors:
    """The inverse of `_to_opponent`, kept to colours that a screen shows; relative XYZ."""
    y = (opponent[:, :, 0] + 16.0) / 116.0
    x, z = y + opponent[:, :, 1] / 500.0, y - opponent[:, :, 2] / 200.0
    linear = np.stack([x, y, z], axis=2) * _WHITE @ np.linalg.inv(_FROM_LINEAR).T
    return np.clip(linear, 0.0, 1.0) @ _FROM_LINEAR.T / _WHITE  # type: ignore[no-any-return]


def _blurred(opponent: Vectors, pixels_per_degree: float) -> Vectors:
    """As the eye resolves it, by the contrast sensitivity of each channel."""
    radius = math.ceil(3.0 * math.sqrt(_WIDEST / (2.0 * math.pi**2)) * pixels_per_degree)
    degrees = np.arange(-radius, radius + 1) / pixels_per_degree
    seen = np.zeros(opponent.shape)
    for channel, terms in enumerate(_SENSITIVITY):
        bells = [np.exp(-(math.pi**2) * degrees**2 / b) for _, b in terms]
        weights = [
            a * math.sqrt(math.pi / b) * bell.sum() ** 2 for (a, b), bell in zip(terms, bells, strict=True)
        ]
        for weight, bell in zip(weights, bells, strict=True):
            if weight > 0.0:
                share = weight / sum(weights)
                seen[:, :, channel] += share * _filtered(
                    opponent[:, :, channel], bell / bell.sum(), bell / bell.sum()
                )
    return seen


def _as_lab(relative: Vectors) -> Vectors:
    """L*a*b* of XYZ relative to white, with chroma that fades with lightness, as the eye has it (Hunt)."""
    delta = 6.0 / 29.0
    f = np.where(relative > delta**3, np.cbrt(relative), relative / (3.0 * delta**2) + 4.0 / 29.0)
    lightness = 116.0 * f[..., 1] - 16.0
    a, b = 500.0 * (f[..., 0] - f[..., 1]), 200.0 * (f[..., 1] - f[..., 2])
    return np.stack([lightness, 0.01 * lightness * a, 0.01 * lightness * b], axis=-1)


def _color_distance(first: Vectors, second: Vectors) -> Vectors:
    """HyAB: the difference in lightness and the distance in chroma add up."""
    gap = first - second
    return np.abs(gap[..., 0]) + np.hypot(gap[..., 1], gap[..., 2])  # type: ignore[no-any-return]


def _spread(distance: Vectors) -> Vectors:
    """Distances on the scale from 0 to 1: the largest is that of green and blue, and those above the knee,
    which all look large, share a small part (section 4.1.3).
    """
    green, blue = (
        _as_lab(np.array(color) @ _FROM_LINEAR.T / _WHITE) for color in ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    )
    largest = float(_color_distance(green, blue)) ** _COLOR_EXPONENT
    knee = _KNEE * largest
    above = _AT_KNEE + (distance - knee) / (largest - knee) * (1.0 - _AT_KNEE)
    return np.where(distance < knee, distance * _AT_KNEE / knee, above)


def _feature_difference(first: Vectors, second: Vectors, pixels_per_degree: float) -> Vectors:
    """How much more of an edge or of a point one luminance has than the other, 0 to 1 (section 4.2)."""
    deviation = 0.5 * _FEATURE_WIDTH * pixels_per_degree
    radius = math.ceil(3.0 * deviation)
    x = np.arange(-radius, radius + 1, dtype=np.float64)
    bell = np.exp(-(x**2) / (2.0 * deviation**2))
    edge, point = _balanced(-x * bell), _balanced((x**2 / deviation**2 - 1.0) * bell)
    bell /= bell.sum()
    gap = np.zeros(first.shape)
    for detector in (edge, point):
        strength = [
            np.hypot(_filtered(picture, bell, detector), _filtered(picture, detector, bell))
            for picture in (first, second)
        ]
        np.maximum(gap, np.abs(strength[0] - strength[1]), out=gap)
    return (gap / math.sqrt(2.0)) ** _FEATURE_EXPONENT  # type: ignore[no-any-return]


def _balanced(weights: Vectors) -> Vectors:
    """Weights whose positive ones sum to 1 and whose negative ones to -1."""
    positive, negative = weights[weights > 0.0].sum(), -weights[weights < 0.0].sum()
    return np.where(weights > 0.0, weights / positive, weights / negative)


def _filtered(values: Vectors, down: Vectors, across: Vectors) -> Vectors:
    """The correlation with weights down the columns and across the rows, the rim repeated outwards."""
    from scipy.ndimage import correlate1d

    return correlate1d(correlate1d(values, down, axis=0, mode="nearest"), across, axis=1, mode="nearest")  # type: ignore[no-any-return]
