"""Every texel has the owner that the rule gives it, and no other."""

from __future__ import annotations

import numpy as np
import pytest

from weathercoat.output.maps.padding import find_padding
from weathercoat.output.maps.raster import rasterise, rasterise_slivers, texel_corners


def owners(uv: np.ndarray, width: int, height: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    face = np.full((height, width), -1, np.int32)
    weights = np.zeros((height, width, 2), np.float32)
    again = np.zeros((height, width), np.uint8)
    rasterise(texel_corners(uv, width, height), 0, face, weights, again)
    return face, weights, again


def jittered_square(cells: int, seed: int) -> np.ndarray:
    """Triangles (m, 3, 2) that tile the unit square, with corners on texel centres among others."""
    line = np.linspace(0.0, 1.0, cells + 1)
    grid = np.stack(np.meshgrid(line, line, indexing="ij"), axis=2)
    grid[1:-1, 1:-1] += np.random.default_rng(seed).uniform(-0.3, 0.3, (cells - 1, cells - 1, 2)) / cells
    grid[2, 2] = np.array([8.5, 9.5]) / 40
    a, b, c, d = (
        part.reshape(-1, 2) for part in (grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:])
    )
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


@pytest.mark.parametrize("is_mirrored", [False, True])
def test_faces_that_tile_the_square_own_each_texel_once(is_mirrored: bool) -> None:
    uv = jittered_square(7, 3)
    if is_mirrored:
        uv[::2] = uv[::2, ::-1]
    face, weights, again = owners(uv, 40, 31)
    assert (face >= 0).all() and not again.any()
    row, column = np.indices(face.shape)
    centre = np.stack([(column + 0.5) / 40, 1.0 - (row + 0.5) / 31], axis=2)
    full = np.concatenate([1.0 - weights.sum(axis=2, keepdims=True), weights], axis=2)
    placed = np.einsum("rci,rcij->rcj", full, uv[face])
    # corners are rounded to 1/4096 of a texel
    assert np.abs(placed - centre).max() < 1 / 4096 / 31


def test_texels_claimed_twice_are_counted_and_show_the_first() -> None:
    uv = np.array([[[0, 0], [1, 0], [0, 1]], [[0, 0], [1, 0], [0, 1]], [[1, 0], [1, 1], [0, 1]]], float)
    face, _, again = owners(uv, 16, 16)
    assert set(np.unique(face)) == {0, 2}
    assert (again == (face == 0)).all()


def test_bands_give_what_the_whole_does() -> None:
    uv = jittered_square(5, 1)
    face, _, _ = owners(uv, 32, 32)
    part = np.full((10, 32), -1, np.int32)
    rasterise(
        texel_corners(uv, 32, 32), 11, part, np.zeros((10, 32, 2), np.float32), np.zeros((10, 32), np.uint8)
    )
    assert (part == face[11:21]).all()


def test_a_face_too_thin_for_any_centre_has_texels_where_it_lies() -> None:
    uv = np.array([[[0.1, 0.51], [0.9, 0.51], [0.9, 0.515]]])
    face, weights, _ = owners(uv, 16, 16)
    assert (face < 0).all()
    rasterise_slivers(texel_corners(uv, 16, 16), 0, face, weights)
    found = np.argwhere(face == 0)
    assert 7 in found[:, 0] and set(found[:, 0]) <= {7, 8} and set(range(2, 14)) <= set(found[:, 1])
    assert (weights >= 0).all() and (weights.sum(axis=2) <= 1).all()


def test_padding_is_the_nearest_texel_within_reach() -> None:
    random = np.random.default_rng(5)
    face = np.where(random.random((23, 31)) < 0.03, 1, -1).astype(np.int32)
    source = np.empty_like(face)
    find_padding(face, 6, source)
    valid = np.argwhere(face >= 0)
    for row, column in np.ndindex(face.shape):
        squared = ((valid - (row, column)) ** 2).sum(axis=1)
        found = source[row, column]
        if squared.min() > 36:
            assert found == -1
        else:
            r, c = divmod(int(found), face.shape[1])
            assert face[r, c] >= 0 and (r - row) ** 2 + (c - column) ** 2 == squared.min()
