"""Block matrices and their factors against dense ones."""

from __future__ import annotations

import numpy as np
import pytest

from weathercoat.deform.blocks import find_blocks, make_pattern
from weathercoat.deform.factor import Factors


def random_matrix(size: int, seed: int = 0) -> tuple[np.ndarray, object, np.ndarray]:
    """A symmetric matrix of two islands, 0 to 3 and 4 to 8, dense and in blocks."""
    generator = np.random.default_rng(seed)
    elements = np.array([(0, 1, 2), (1, 3, -1), (4, 6, 5), (8, 7, 5), (-1, -1, 8)], np.int32)
    pattern = make_pattern(9, (elements,))
    places = find_blocks(pattern, elements)
    blocks = np.zeros((len(pattern.row), size, size))
    dense = np.zeros((9 * size, 9 * size))
    for corners, where in zip(elements, places, strict=True):
        root = generator.standard_normal((3 * size, 3 * size))
        part = root @ root.T
        pair = 0
        for k in range(3):
            for m in range(k + 1):
                a, b = corners[m], corners[k]
                if a >= 0 and b >= 0:
                    piece = part[m * size : (m + 1) * size, k * size : (k + 1) * size]
                    blocks[where[pair]] += piece if a <= b else piece.T
                    dense[a * size : (a + 1) * size, b * size : (b + 1) * size] += piece
                    if a != b:
                        dense[b * size : (b + 1) * size, a * size : (a + 1) * size] += piece.T
                else:
                    assert where[pair] == -1
                pair += 1
    return dense, pattern, blocks


@pytest.mark.parametrize("size", [1, 3])
def test_solutions_are_those_of_the_dense_matrix(size: int) -> None:
    dense, pattern, blocks = random_matrix(size)
    factors = Factors(pattern, np.array([0, 4, 9]), size)  # type: ignore[arg-type]
    right = np.random.default_rng(1).standard_normal((9, size))
    both = np.array([0, 1])
    factors.factor(both, blocks)
    expected = np.linalg.solve(dense, right.reshape(-1)).reshape(9, size)
    np.testing.assert_allclose(factors.solve(both, right), expected, rtol=1e-8)
    assert factors.is_positive(0) and factors.is_positive(1)

    factors.factor(np.array([1]), 2.0 * blocks)  # the pattern's order is used again
    expected[4:] /= 2.0
    np.testing.assert_allclose(factors.solve(both, right), expected, rtol=1e-8)
    alone = factors.solve(np.array([1]), right)
    assert not alone[:4].any()


def test_a_matrix_without_factors_says_so() -> None:
    _, pattern, blocks = random_matrix(3)
    factors = Factors(pattern, np.array([0, 4, 9]), 3)  # type: ignore[arg-type]
    blocks[pattern.start[0] : pattern.start[4]] = 0.0  # type: ignore[attr-defined]
    blocks[pattern.diagonal()[4:]] -= 100.0 * np.eye(3)  # type: ignore[attr-defined]
    factors.factor(np.array([0, 1]), blocks)
    assert not factors.is_positive(0) and not factors.is_positive(1)
    solution = factors.solve(np.array([0, 1]), np.ones((9, 3)))
    assert np.isnan(solution[:4]).all() and np.isfinite(solution[4:]).all()
