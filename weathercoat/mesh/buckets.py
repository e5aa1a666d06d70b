"""Whole numbers in order, in linear time: stable counting and radix passes instead of comparisons."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel

_DIGIT_BITS = 11


def order_rows(rows: NDArray[np.integer], bound: int) -> NDArray[np.int32]:
    """The stable order (m,) of rows (m, k) of whole numbers from 0 to `bound` - 1, by the first column first.

    Linear in m + bound.
    """
    order = np.arange(len(rows), dtype=np.int32)
    for column in rows.T[::-1]:
        _counting_pass(column, bound, order)
    return order


def order_codes(codes: NDArray[np.uint64]) -> NDArray[np.int32]:
    """The stable ascending order of uint64 `codes` (n,), (n,): passes over digits of 11 bits."""
    order = np.arange(len(codes), dtype=np.int32)
    _radix_passes(codes, order)
    return order


def compact_indices(indices: NDArray[np.integer], bound: int) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """The distinct `indices`, from 0 to `bound` - 1, in ascending order, and for each index its place there.

    The places have the shape of `indices`.
    """
    is_used = np.zeros(bound, np.bool_)
    is_used[indices] = True
    used = np.flatnonzero(is_used)
    place = np.empty(bound, np.int32)
    place[used] = np.arange(len(used), dtype=np.int32)
    return used, place[indices]


@kernel
def _counting_pass(key, bound, order):  # type: ignore[no-untyped-def]
    """Bring `order` (n,) into the stable order of key[order]."""
    begin = np.zeros(bound + 1, np.int32)
    for i in range(len(key)):
        begin[key[i] + 1] += 1
    for k in range(bound):
        begin[k + 1] += begin[k]
    before = order.copy()
    for i in range(len(before)):
        k = key[before[i]]
        order[begin[k]] = before[i]
        begin[k] += 1


@kernel
def _radix_passes(codes, order):  # type: ignore[no-untyped-def]
    """Bring `order` (n,), at first 0 to n - 1, into the stable order of the codes."""
    n = len(codes)
    digits = (64 + _DIGIT_BITS - 1) // _DIGIT_BITS
    mask = np.uint64((1 << _DIGIT_BITS) - 1)
    begin = np.zeros((digits, 1 << _DIGIT_BITS), np.int64)
    for i in range(n):
        for d in range(digits):
            begin[d, (codes[i] >> np.uint64(d * _DIGIT_BITS)) & mask] += 1
    before = np.empty_like(order)
    for d in range(digits):
        if begin[d].max() == n:
            continue
        total = 0
        for k in range(1 << _DIGIT_BITS):
            count = begin[d, k]
            begin[d, k] = total
            total += count
        before[:] = order
        for i in range(n):
            k = (codes[before[i]] >> np.uint64(d * _DIGIT_BITS)) & mask
            order[begin[d, k]] = before[i]
            begin[d, k] += 1
