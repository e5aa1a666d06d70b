"""Linear orders against NumPy's sorts, which compare."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from weathercoat.mesh.buckets import compact_indices, order_codes, order_rows


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6), count=st.integers(0, 200), bound=st.integers(1, 50))
def test_rows_come_in_lexicographic_order(seed: int, count: int, bound: int) -> None:
    rows = np.random.default_rng(seed).integers(0, bound, (count, 3)).astype(np.int32)
    assert (order_rows(rows, bound) == np.lexsort(rows.T[::-1])).all()


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6), count=st.integers(0, 200), bits=st.integers(0, 64))
def test_codes_come_in_stable_ascending_order(seed: int, count: int, bits: int) -> None:
    codes = np.random.default_rng(seed).integers(0, 2**bits, count, np.uint64)
    assert (order_codes(codes) == np.argsort(codes, kind="stable")).all()


@pytest.mark.parametrize("shape", [(0, 3), (7,), (40, 3)])
def test_compact_indices_are_those_of_unique(shape: tuple[int, ...]) -> None:
    indices = np.random.default_rng(3).integers(0, 30, shape)
    used, place = compact_indices(indices, 30)
    expected_used, expected = np.unique(indices, return_inverse=True)
    assert (used == expected_used).all()
    assert place.shape == shape
    assert (place == expected.reshape(shape)).all()
