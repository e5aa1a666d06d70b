"""Length constraints: met at once, shared by inverse mass, and blind to where the edge lies."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from weathercoat.deform.plain import project_lengths
from weathercoat.mesh.surface import Vectors

ONE_EDGE = np.array([(0, 1)], np.int32)


def project(
    positions: Vectors, inverse_mass: list[float], rest_length: float, ends: Vectors = ONE_EDGE
) -> Vectors:
    result = np.array(positions, float)
    project_lengths(result, np.array(inverse_mass, float), ends, np.full(len(ends), rest_length))
    return result


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6), weights=st.sampled_from([(1, 1), (1, 0), (0, 1), (0.2, 3.0)]))
def test_one_edge_is_exact_after_one_projection(seed: int, weights: tuple[float, float]) -> None:
    """Paper 4.2: C = |p1 - p2| - L is linear along the edge, so one step meets it to round-off.

    The ends move along the edge by w1 : w2, so the weighted centre stays (no external force).
    """
    random = np.random.default_rng(seed)
    before = random.uniform(-1, 1, (2, 3))
    rest = random.uniform(0.1, 3.0)
    after = project(before, list(weights), rest)
    assert np.linalg.norm(after[0] - after[1]) == pytest.approx(rest, rel=1e-14)
    moves = np.linalg.norm(after - before, axis=1)
    assert moves[0] * weights[1] == pytest.approx(moves[1] * weights[0], rel=1e-12)
    assert np.linalg.norm(np.cross(after - before, before[1] - before[0])) < 1e-14
    for moved, weight in zip(moves, weights, strict=True):
        assert (moved == 0.0) == (weight == 0)


def test_the_formula() -> None:
    """Delta p1 = -w1 / (w1 + w2) C n, Delta p2 = +w2 / (w1 + w2) C n: C = 2, n along -x, w 1 and 3."""
    after = project([(0, 0, 0), (4, 0, 0)], [1, 3], 2.0)
    np.testing.assert_allclose(after, [(0.5, 0, 0), (2.5, 0, 0)], atol=1e-15)


def test_an_edge_of_its_length_and_one_without_length_stay() -> None:
    for positions in ([(1, 2, 3), (1, 2, 5)], [(1, 2, 3), (1, 2, 3)]):
        assert (project(positions, [1, 1], 2.0) == np.array(positions, float)).all()


def test_edges_are_taken_in_order() -> None:
    """A chain 0-1-2 of two edges: the second sees what the first has done."""
    chain = [(0, 0, 0), (2, 0, 0), (4, 0, 0)]
    ends = np.array([(0, 1), (1, 2)], np.int32)
    np.testing.assert_allclose(project(chain, [0, 1, 1], 1.0, ends)[:, 0], [0, 2, 3], atol=1e-15)
    np.testing.assert_allclose(
        project(chain, [0, 1, 1], 1.0, ends[::-1].copy())[:, 0], [0, 1, 3.5], atol=1e-15
    )


def test_a_chain_converges_to_round_off() -> None:
    random = np.random.default_rng(1)
    positions = random.uniform(-1, 1, (6, 3))
    ends = np.stack([np.arange(5), np.arange(1, 6)], axis=1).astype(np.int32)
    weights = np.array([0.0, 1, 1, 1, 1, 1])
    start = positions[0].copy()
    for _ in range(300):
        project_lengths(positions, weights, ends, np.full(5, 0.4))
    np.testing.assert_allclose(np.linalg.norm(np.diff(positions, axis=0), axis=1), 0.4, rtol=1e-13)
    assert (positions[0] == start).all()
