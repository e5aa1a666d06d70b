"""Welding against a plain version that compares every point with every one before it."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.checked import COMPILED
from weathercoat.mesh.weld import SINGLE, first_at_place, weld


def weld_plainly(points: np.ndarray, part: np.ndarray) -> np.ndarray:
    """The first kept point that each of the points (n, 3), which extend round the origin, is merged with."""
    first = np.arange(len(points))
    for i in range(len(points)):
        tolerance = SINGLE * np.abs(points[i])
        for j in range(i):
            near = first[j] == j and part[i] == part[j] and (np.abs(points[j] - points[i]) <= tolerance).all()
            if near:
                first[i] = j
                break
    return first


@settings(max_examples=80 if COMPILED else 8, deadline=None)
@given(seed=st.integers(0, 10**6), count=st.integers(2, 60))
def test_it_merges_what_the_plain_version_merges(seed: int, count: int) -> None:
    """Few places, some apart by about the tolerance, many points exactly alike, zeros of either sign."""
    random = np.random.default_rng(seed)
    places = random.uniform(-1, 1, (4, 3)) * random.integers(0, 2, (4, 3))
    points = places[random.integers(0, 4, count)]
    points = points * (1 + SINGLE * random.choice([0, 0, 0.4, 0.9, 1.1], (count, 1)))
    points[random.random((count, 3)) < 0.2] *= -1.0
    points = np.concatenate([points, np.ones((1, 3)), -np.ones((1, 3))])
    count = len(points)
    part = random.integers(0, 2, count)
    corners = random.permutation(count)
    vertex, kept, merged = weld(points, corners, part)
    first = weld_plainly(points, part)
    expected_kept = np.flatnonzero(first == np.arange(count))
    assert (kept == expected_kept).all()
    assert (kept[vertex] == first[corners]).all()
    assert merged == count - len(kept)


def test_places_are_equal_or_not() -> None:
    points = np.array([[0.0, 1, 2], [0, 1, 2.0000000000000004], [-0.0, 1, 2], [0, 1, 2], [0, 1, 2]])
    assert first_at_place(points, np.array([0, 0, 0, 1, 1])).tolist() == [0, 1, 0, 3, 3]
