"""Length constraints: C = |p1 - p2| - L (paper 4.2)."""

from __future__ import annotations

import math

from weathercoat.compile import formula

Ends = tuple[float, float, float, float, float, float]


@formula
def meet_length(
    ax: float, ay: float, az: float, bx: float, by: float, bz: float,
    wa: float, wb: float, rest_length: float,
) -> Ends:  # fmt: skip
    """The ends a and b of an edge, moved to its rest length and shared by inverse mass.

    At least one of the masses is not 0. An edge of no length stays.
    """
    dx, dy, dz = ax - bx, ay - by, az - bz
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    share = length * (wa + wb)
    scale = (length - rest_length) / share if share > 0.0 else 0.0
    ua, ub = wa * scale, wb * scale
    return ax - ua * dx, ay - ua * dy, az - ua * dz, bx + ub * dx, by + ub * dy, bz + ub * dz
