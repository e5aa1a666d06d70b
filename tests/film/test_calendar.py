"""The calendar against a plain dictionary of items and steps."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from weathercoat.film.calendar import HORIZON, make_calendar, put, take_due

COUNT = 12
events = st.lists(
    st.one_of(
        st.tuples(st.just("put"), st.integers(0, COUNT - 1), st.integers(1, 3 * HORIZON)),
        st.tuples(st.just("take"), st.integers(0, 40) | st.integers(0, 3 * HORIZON), st.just(0)),
    ),
    max_size=60,
)


@settings(deadline=None)
@given(events=events)
def test_items_come_when_they_are_due(events: list[tuple[str, int, int]]) -> None:
    """In any order of puts, of later and sooner ones, and of steps taken one by one or many at once."""
    calendar, due, step = make_calendar(COUNT), {}, 0
    out = np.empty(COUNT, np.int32)
    for what, first, ahead in events:
        if what == "put":
            put(calendar, first, step + ahead)
            due[first] = min(due.get(first, step + HORIZON), step + min(ahead, HORIZON))
        else:
            step += first
            found = sorted(out[: take_due(calendar, step, out)].tolist())
            assert found == sorted(item for item, when in due.items() if when <= step)
            due = {item: when for item, when in due.items() if when > step}


def test_an_overdue_step_is_no_hindrance() -> None:
    """Put for a step that lies behind what was asked for, but has not been taken yet."""
    calendar, out = make_calendar(3), np.empty(3, np.int32)
    put(calendar, 1, 5 * HORIZON)
    assert take_due(calendar, HORIZON - 1, out) == 0
    assert take_due(calendar, 9 * HORIZON, out) == 1 and out[0] == 1
    put(calendar, 1, 9 * HORIZON + 1)
    assert take_due(calendar, 9 * HORIZON, out) == 0
    assert take_due(calendar, 9 * HORIZON + 1, out) == 1
