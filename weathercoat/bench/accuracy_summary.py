"""What the points of a method come to: their front, the least error, and whether more work would help."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

DONE = 1e-6  # what comes so near has not stopped but arrived
_LAST, _STALLED = 2, 0.9  # so many last rungs that leave more than this share of the error gained nothing


def summarise(curve: dict[str, Any], error: str) -> dict[str, Any]:
    """What a method comes to over its settings: the front of its points, the least error and its setting, and
    whether it stops.

    The front is the points that no other one beats in both work and error. It stops where the last rungs of
    the ladder that went lowest gained nothing any more, and it has not arrived either.
    """
    points = [
        {"setting": ladder["setting"], **point}
        for ladder in curve["ladders"]
        for point in ladder["points"]
        if point[error] is not None
    ]
    if not points:
        return {"front": [], "least": None, "setting": None, "stops": True}
    front: list[dict[str, Any]] = []
    for point in sorted(points, key=lambda point: (point["cpu_ms"], point[error])):
        if not front or point[error] < front[-1][error]:
            front.append(point)
    lowest = front[-1]
    (climbed,) = (ladder["points"] for ladder in curve["ladders"] if ladder["setting"] == lowest["setting"])
    return {
        "front": front,
        "least": lowest[error],
        "setting": lowest["setting"],
        "stops": lowest[error] > DONE and has_stopped([point[error] for point in climbed]),
    }


def has_stopped(errors: Sequence[float | None]) -> bool:
    """Whether the last of the errors along a ladder, None for not finite, improve on those before by nothing
    worth having.
    """
    known = [math.inf if error is None else error for error in errors]
    if len(known) < 2 + _LAST:
        return False
    return min(known[-_LAST:]) > _STALLED * min(known[:-_LAST])
