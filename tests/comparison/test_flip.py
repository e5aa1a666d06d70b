"""FLIP: the figures of its authors' own program, and what any such measure must be."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from weathercoat.comparison.flip import flip_map, mean_flip

ROW, COLUMN = np.mgrid[0:60, 0:80]


def picture(red: object, green: object, blue: object) -> NDArray[np.uint8]:
    return np.stack(np.broadcast_arrays(red, green, blue), axis=2).astype(np.uint8)


HARSH = picture(COLUMN * 3, ROW * 4, (COLUMN * 7 + ROW * 5) % 256)
OTHER = picture(COLUMN * 3, 255 - ROW * 4, (COLUMN * 5 + ROW * 9) % 256)
SOFT = picture(COLUMN * 2 + 40, ROW * 3 + 20, COLUMN + ROW)
SPOT = SOFT.copy()
SPOT[25:30, 30:40] = (200, 60, 30)


@pytest.mark.parametrize(("first", "second", "mean"), [(HARSH, OTHER, 0.868405), (SOFT, SPOT, 0.011757)])
def test_the_mean_is_that_of_the_authors_program(
    first: NDArray[np.uint8], second: NDArray[np.uint8], mean: float
) -> None:
    """Against flip-evaluator 1.7 at 67 pixels a degree, which reckons in single precision."""
    assert mean_flip(first, second) == pytest.approx(mean, abs=2e-5)


def test_a_map_is_where_the_difference_is() -> None:
    found = flip_map(SOFT, SPOT)
    assert found.shape == (60, 80)
    assert found.min() >= 0.0 and found.max() <= 1.0
    assert found[27, 35] > 0.5 > 0.1 > found[27, 70]


def test_pictures_are_no_different_from_themselves_nor_by_their_order() -> None:
    assert mean_flip(HARSH, HARSH) == 0.0
    assert mean_flip(HARSH, OTHER) == pytest.approx(mean_flip(OTHER, HARSH), rel=1e-12)


def test_what_the_eye_blurs_counts_less_from_farther_away() -> None:
    checks = picture(*3 * [255 * ((ROW + COLUMN) % 2)])
    inverse = 255 - checks
    assert mean_flip(checks, inverse, 67.0) < 0.25 * mean_flip(checks, inverse, 8.0)


def test_pictures_of_other_sizes_are_refused() -> None:
    with pytest.raises(ValueError, match="cannot be compared"):
        mean_flip(SOFT, SOFT[1:])
