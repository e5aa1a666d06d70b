"""The roofline: what memory and arithmetic allow at most (Williams, Waterman and Patterson, 2009).

Counted by hand from the formulas in `deform.length`, `deform.angle` and `deform.substrate`: a square root and
a division count as one operation each, though they take many cycles. Memory is counted as if every array
came from memory once a sweep, read once and, where it changes, written once: an estimate from below.
"""

from __future__ import annotations

LENGTH_FLOPS, ANGLE_FLOPS, VERTEX_FLOPS = 27, 174, 6
LENGTH_BYTES = 2 * (4 + 1) + 8  # two indices, whether they move, and a target
ANGLE_BYTES = 4 * (4 + 1) + 8  # four of them
VERTEX_BYTES = 3 * 2 * 24 + 32  # read and written for lengths, angles, substrate; the plane for that


def sweep_work(lengths: int, angles: int, vertices: int) -> dict[str, int]:
    """The operations and the bytes of memory traffic of one sweep."""
    return {
        "flops": lengths * LENGTH_FLOPS + angles * ANGLE_FLOPS + vertices * VERTEX_FLOPS,
        "bytes": lengths * LENGTH_BYTES + angles * ANGLE_BYTES + vertices * VERTEX_BYTES,
    }


def floor_ms(flops: float, moved_bytes: float, peak_flops: float, bandwidth: float) -> float:
    """The milliseconds below which a sweep cannot come, by the slower of arithmetic and memory."""
    return 1e3 * max(flops / peak_flops, moved_bytes / bandwidth)
