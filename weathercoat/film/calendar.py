"""A calendar: items that are due at steps, of which those of a step are found without looking at the others.

It is the timing wheel of Varghese and Lauck (1987): a ring of buckets, one a step, each a doubly linked list,
so that putting, moving and taking an item cost the same however many there are. All is in one array, int32
(n + buckets + 1, 3), of next, previous and step: the rows of the items 0 to n - 1, a row for each bucket that
closes its list to a ring, and a last row for the step up to which items were taken. An item in no bucket has
the step -1.
"""

from __future__ import annotations

import numpy as np

from weathercoat.compile import kernel
from weathercoat.mesh.surface import Indices

HORIZON = 1024  # steps ahead that an item can be put at most
_BUCKETS = HORIZON + 1
_NEXT, _PREVIOUS, _DUE = 0, 1, 2


def make_calendar(count: int) -> Indices:
    """An empty calendar at step 0 for the items 0 to `count` - 1."""
    calendar = np.full((count + _BUCKETS + 1, 3), -1, np.int32)
    closing = np.arange(count, count + _BUCKETS)
    calendar[closing, _NEXT] = calendar[closing, _PREVIOUS] = closing
    calendar[-1, _DUE] = 0
    return calendar


@kernel
def put(calendar: Indices, item: int, step: int) -> None:
    """Make the item due at a step after the last one taken, or sooner where the horizon ends before; an item
    that is due sooner anyway stays there.
    """
    last = len(calendar) - 1
    due = min(step, calendar[last, _DUE] + HORIZON)
    if calendar[item, _DUE] >= 0:
        if calendar[item, _DUE] <= due:
            return
        before, after = calendar[item, _PREVIOUS], calendar[item, _NEXT]
        calendar[before, _NEXT] = after
        calendar[after, _PREVIOUS] = before
    closing = last - _BUCKETS + due % _BUCKETS
    after = calendar[closing, _NEXT]
    calendar[item, _NEXT] = after
    calendar[item, _PREVIOUS] = closing
    calendar[item, _DUE] = due
    calendar[after, _PREVIOUS] = item
    calendar[closing, _NEXT] = item


@kernel
def take_due(calendar: Indices, step: int, out: Indices) -> int:
    """Take off all that is due up to a step, into out in any order; returns how many."""
    last = len(calendar) - 1
    taken = calendar[last, _DUE]
    found = 0
    for due in range(taken + 1, min(step, taken + HORIZON) + 1):
        closing = last - _BUCKETS + due % _BUCKETS
        item = calendar[closing, _NEXT]
        while item != closing:
            out[found] = item
            found += 1
            calendar[item, _DUE] = -1
            item = calendar[item, _NEXT]
        calendar[closing, _NEXT] = closing
        calendar[closing, _PREVIOUS] = closing
    calendar[last, _DUE] = step
    return found
