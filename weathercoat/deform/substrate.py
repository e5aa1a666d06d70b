"""The substrate: no vertex goes below the tangent plane of the metal where it began (paper 5)."""

from __future__ import annotations

from weathercoat.compile import formula


@formula
def depth_below(x: float, y: float, z: float, nx: float, ny: float, nz: float, offset: float) -> float:
    """How far the point lies below the plane n . p = offset, as a negative number; positive above it."""
    return nx * x + ny * y + nz * z - offset
