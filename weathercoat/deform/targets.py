"""The bend that a hinge is to have at an age (paper 5; the shrinking target).

The exponential and the tangent are built from a short series and doublings, of multiplications and a few
divisions only, so that a loop over hinges can be vectorised. Both are right to a few units in the last place.
"""

from __future__ import annotations

import math

from weathercoat.compile import formula

_LARGEST_BEND = 0.9 * math.pi  # a target beyond this would fold a hinge through itself
_GROWN = 40.0  # exp(-40) is nothing beside 1


@formula
def share_grown(x: float) -> float:
    """1 - exp(-x) for x >= 0: by its series at x / 256, and 1 - exp(-2 y) = s (2 - s) with s that of y."""
    y = min(x, _GROWN) / 256.0
    s = y * (
        1.0 - y / 2.0 * (1.0 - y / 3.0 * (1.0 - y / 4.0 * (1.0 - y / 5.0 * (1.0 - y / 6.0 * (
            1.0 - y / 7.0 * (1.0 - y / 8.0 * (1.0 - y / 9.0 * (1.0 - y / 10.0))))))))
    )  # fmt: skip
    s = s * (2.0 - s)
    s = s * (2.0 - s)
    s = s * (2.0 - s)
    s = s * (2.0 - s)
    s = s * (2.0 - s)
    s = s * (2.0 - s)
    s = s * (2.0 - s)
    return s * (2.0 - s)


@formula
def half_tangent(angle: float) -> float:
    """tan(angle / 2) for an angle in [-pi, pi]: its continued fraction at angle / 16, doubled three times."""
    x = angle / 16.0
    xx = x * x
    t = x * (945.0 - 105.0 * xx + xx * xx) / (945.0 - 420.0 * xx + 15.0 * xx * xx)
    t = 2.0 * t / (1.0 - t * t)
    t = 2.0 * t / (1.0 - t * t)
    return 2.0 * t / (1.0 - t * t)


@formula
def curved_bend(start: float, span: float, radius: float, grown: float) -> float:
    """The bend of a film whose curvature has reached the share `grown` of 1 / radius, across the span between
    the centres of two faces; by default.
    """
    return max(start - span / radius * grown, min(start, -_LARGEST_BEND))


@formula
def shrunk_bend(start: float, turned: float, floor: float) -> float:
    """The bend of an outer dihedral that has shrunk by the angle `turned` down to a floor; literally."""
    return max(start - turned, min(start, floor - math.pi))


@formula
def wanted_bend(
    start: float, since: float, span: float, by_curvature: bool, radius: float, rate: float, floor: float,
    age: float,
) -> float:  # fmt: skip
    """The bend at an age of a hinge that began with `start` at the age `since`, by either rule."""
    if by_curvature:
        return curved_bend(start, span, radius, share_grown(rate * (age - since)))
    return shrunk_bend(start, rate * (age - since), floor)
