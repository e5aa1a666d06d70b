"""The checks that kernels run under without the JIT do refuse what NumPy would take."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest

from tests.checked import CheckedArray, checked_kernel


class Pair(NamedTuple):
    one: np.ndarray
    other: np.ndarray


@checked_kernel
def read_first(pair: Pair, index: Any) -> Any:
    return pair.one[index]


@checked_kernel
def write_other(pair: Pair, index: Any) -> None:
    pair.other[index] = 1.0


@checked_kernel
def read_row(pair: Pair, row: int, column: int) -> Any:
    return read_first(Pair(pair.one[row], pair.other), column)


PAIR = Pair(np.arange(12.0).reshape(3, 4), np.zeros((3, 4)))
WITHIN = [0, np.int32(2), (1, 3), slice(0, 3), (slice(None), 2), ..., np.array([2, 0]), PAIR.one > 5.0]
OUTSIDE = [
    *[-1, np.int32(-1), np.int64(-2), (1, -1), (-1, 1), slice(0, 4), slice(-1, 3), (0, slice(0, 5))],
    *[np.array([0, -1]), 3, (0, 4)],
]


@pytest.mark.parametrize("index", WITHIN, ids=str)
def test_what_is_there_is_read_and_written(index: Any) -> None:
    """As without checks, and nobody who called sees them."""
    pair = Pair(PAIR.one, np.zeros((3, 4)))
    found = read_first(pair, index)
    assert not isinstance(found, CheckedArray)
    np.testing.assert_array_equal(found, PAIR.one[index])
    write_other(pair, index)
    assert pair.other.sum() == np.size(found)


@pytest.mark.parametrize("index", OUTSIDE, ids=str)
def test_what_is_not_there_is_refused(index: Any) -> None:
    for attempt in (read_first, write_other):
        with pytest.raises(IndexError):
            attempt(PAIR, index)
    assert not PAIR.other.any()


def test_parts_of_arguments_are_checked_too() -> None:
    assert read_row(PAIR, 1, 2) == 6.0
    with pytest.raises(IndexError):
        read_row(PAIR, 1, -2)
