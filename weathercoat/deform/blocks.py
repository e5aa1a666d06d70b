"""Symmetric sparse matrices of small blocks: which blocks are there, and where elements add to them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from weathercoat.compile import kernel
from weathercoat.mesh.surface import Indices


class Pattern(NamedTuple):
    """The blocks of the upper triangle, by columns, for v unknowns.

    start: int32 (v + 1,), the blocks of a column; row: int32 (b,), ascending in a column and ending on the
    diagonal.
    """

    start: Indices
    row: Indices

    def diagonal(self) -> Indices:
        """The blocks on the diagonal, (v,)."""
        return self.start[1:] - 1


def make_pattern(count: int, elements: tuple[Indices, ...]) -> Pattern:
    """The pattern of `count` unknowns, each pair of which is coupled that an element has; elements are arrays
    (l, corners) of unknowns, -1 for what is held.
    """
    room = np.ones(count + 1, np.int64)  # for the diagonal
    room[-1] = 0
    for corners in elements:
        _count_pairs(corners, room)
    first = np.concatenate([[0], np.cumsum(room[:-1])]).astype(np.int32)
    listed, filled = np.empty(first[-1], np.int32), first[:-1].copy()
    for corners in elements:
        _list_pairs(corners, listed, filled)
    start, row = np.empty(count + 1, np.int32), np.empty(len(listed), np.int32)
    used = _sort_columns(first, filled, listed, start, row)
    return Pattern(start, row[:used].copy())


def find_blocks(pattern: Pattern, corners: Indices) -> Indices:
    """Where the pairs of corners of each element (l, c) add to, (l, c (c + 1) / 2), -1 where one is held;
    in the order (0, 0), (0, 1), (1, 1), (0, 2), ...
    """
    count = corners.shape[1]
    out = np.empty((len(corners), count * (count + 1) // 2), np.int32)
    _find_blocks(corners, pattern.start, pattern.row, out)
    return out


@kernel
def _count_pairs(corners: Indices, room: Indices) -> None:
    """Count each pair of unknowns at the later one."""
    for i in range(len(corners)):
        for k in range(corners.shape[1]):
            for m in range(k):
                a, b = corners[i, m], corners[i, k]
                if a >= 0 and b >= 0:
                    room[max(a, b)] += 1


@kernel
def _list_pairs(corners: Indices, listed: Indices, filled: Indices) -> None:
    for i in range(len(corners)):
        for k in range(corners.shape[1]):
            for m in range(k):
                a, b = corners[i, m], corners[i, k]
                if a >= 0 and b >= 0:
                    listed[filled[max(a, b)]] = min(a, b)
                    filled[max(a, b)] += 1


@kernel
def _sort_columns(first: Indices, filled: Indices, listed: Indices, start: Indices, row: Indices) -> int:
    """Each column's rows once, ascending, with the diagonal last; returns how many blocks."""
    count = 0
    for j in range(len(filled)):
        start[j] = count
        begin = first[j]
        for i in range(begin, filled[j]):  # few: insertion
            k = i
            while k > begin and listed[k - 1] > listed[k]:
                listed[k - 1], listed[k] = listed[k], listed[k - 1]
                k -= 1
        for i in range(begin, filled[j]):
            if i == begin or listed[i] != listed[i - 1]:
                row[count] = listed[i]
                count += 1
        row[count] = j
        count += 1
    start[len(filled)] = count
    return count


@kernel
def _find_blocks(corners: Indices, start: Indices, row: Indices, out: Indices) -> None:
    for i in range(len(corners)):
        pair = 0
        for k in range(corners.shape[1]):
            for m in range(k + 1):
                a, b = corners[i, m], corners[i, k]
                out[i, pair] = -1
                if a >= 0 and b >= 0:
                    at = start[max(a, b)]
                    while row[at] != min(a, b):
                        at += 1
                    out[i, pair] = at
                pair += 1
