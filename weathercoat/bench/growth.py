"""How times grow with the number of faces."""

from __future__ import annotations

import math
from collections.abc import Sequence


def fit_exponent(faces: Sequence[float], seconds: Sequence[float]) -> float | None:
    """The exponent b of the power law a * faces ** b that fits best, by least squares of the logarithms.

    None where there are fewer than two numbers of faces with a time above 0.
    """
    points = [(math.log(m), math.log(t)) for m, t in zip(faces, seconds, strict=True) if m > 0 and t > 0]
    if len({x for x, _ in points}) < 2:
        return None
    mean_x, mean_y = (sum(values) / len(points) for values in zip(*points, strict=True))
    over = sum((x - mean_x) * (y - mean_y) for x, y in points)
    return over / sum((x - mean_x) ** 2 for x, _ in points)
