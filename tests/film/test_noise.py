"""Noise against the 2002 reference definition, and the named random streams."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from weathercoat.film.noise import (
    PERMUTATION,
    fractal_noise,
    hash_bits,
    hash_uniform,
    perlin,
    stream_key,
)

coordinates = st.floats(-300, 300, allow_nan=False)

# The twelve directions from the centre of a cube to its edges, in the order in which the reference's bit
# tricks pick them for hash & 15; the last four repeat.
DIRECTIONS = [
    (1, 1, 0), (-1, 1, 0), (1, -1, 0), (-1, -1, 0),
    (1, 0, 1), (-1, 0, 1), (1, 0, -1), (-1, 0, -1),
    (0, 1, 1), (0, -1, 1), (0, 1, -1), (0, -1, -1),
    (1, 1, 0), (0, -1, 1), (-1, 1, 0), (0, -1, -1),
]  # fmt: skip


def reference_noise(x: float, y: float, z: float) -> float:
    """Improved noise in plain words: the dot products at the eight corners, faded axis by axis."""
    p = [int(value) for value in PERMUTATION] * 2
    floor = [math.floor(c) for c in (x, y, z)]
    cell = [f % 256 for f in floor]
    inside = [c - f for c, f in zip((x, y, z), floor, strict=True)]
    corner = {}
    for i in (0, 1):
        for j in (0, 1):
            for k in (0, 1):
                chosen = p[(p[(p[(cell[0] + i) % 256] + cell[1] + j) % 256] + cell[2] + k) % 256]
                direction = DIRECTIONS[chosen % 16]
                offset = (inside[0] - i, inside[1] - j, inside[2] - k)
                corner[i, j, k] = sum(d * o for d, o in zip(direction, offset, strict=True))
    fade = [6 * t**5 - 15 * t**4 + 10 * t**3 for t in inside]
    along_x = {
        (j, k): corner[0, j, k] + fade[0] * (corner[1, j, k] - corner[0, j, k])
        for j in (0, 1)
        for k in (0, 1)
    }
    along_y = {k: along_x[0, k] + fade[1] * (along_x[1, k] - along_x[0, k]) for k in (0, 1)}
    return along_y[0] + fade[2] * (along_y[1] - along_y[0])


def noise(x: float, y: float, z: float) -> float:
    return float(perlin(x, y, z, PERMUTATION))


def test_permutation_is_one() -> None:
    assert sorted(PERMUTATION.tolist()) == list(range(256))
    assert PERMUTATION[[0, 1, 2, 255]].tolist() == [151, 160, 137, 180]


def test_published_value() -> None:
    """The value that the reference implementation prints here; sums of eight terms round at 1e-16."""
    assert noise(3.14, 42, 7) == pytest.approx(0.13691995878400012, abs=1e-15)


@settings(max_examples=300, deadline=None)
@given(x=coordinates, y=coordinates, z=coordinates)
def test_is_the_reference_at_any_point(x: float, y: float, z: float) -> None:
    value = noise(x, y, z)
    assert value == pytest.approx(reference_noise(x, y, z), abs=1e-13)
    assert abs(value) <= 1.04, "improved noise stays within sqrt(1.08)"


def test_is_zero_on_the_lattice_and_repeats_after_256() -> None:
    for point in [(0, 0, 0), (5, -7, 300), (-1, -1, -1), (255, 256, 257)]:
        assert noise(*map(float, point)) == 0.0
    assert noise(0.25, 0.5, 0.75) == noise(256.25, -255.5, 512.75)


def test_is_smooth_across_cells() -> None:
    """The fade has no first and second derivative at the lattice, so values 1e-4 away lie on a line."""
    for y in (0.3, 7.6):
        left, middle, right = (noise(12 + d, y, 0.4) for d in (-1e-4, 0.0, 1e-4))
        assert left + right - 2 * middle == pytest.approx(0.0, abs=1e-9)


def points_of(count: int, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1, 1, (count, 3))


def test_fractal_noise_is_the_sum_of_its_octaves() -> None:
    points, key = points_of(50), stream_key(3, "adhesion")
    shift = hash_uniform(np.eye(3), key) * 256.0
    expected = np.zeros(50)
    for i, (x, y, z) in enumerate(points / 0.3 + shift):
        for octave in range(3):
            expected[i] += 0.4**octave * reference_noise(x, y, z)
            x, y, z = 2 * x + 17.31, 2 * y + 5.77, 2 * z + 29.13
    found = fractal_noise(points, wavelength=0.3, octaves=3, gain=0.4, key=key)
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_fractal_noise_has_the_wavelength_it_is_given() -> None:
    """Noise over points twice as far apart, at twice the wavelength, is the same noise."""
    points, key = points_of(50), stream_key(1, "adhesion")
    one = fractal_noise(points, wavelength=0.25, octaves=2, gain=0.5, key=key)
    two = fractal_noise(2 * points, wavelength=0.5, octaves=2, gain=0.5, key=key)
    np.testing.assert_allclose(one, two, atol=1e-12)


def test_hash_is_uniform() -> None:
    """20,000 numbers: the mean errs by 0.002 (one sigma), a bin of 1,000 by 31; bounds at 4.5 sigma."""
    numbers = hash_uniform(points_of(20_000), stream_key(1, "cohesion"))
    assert numbers.min() >= 0.0 and numbers.max() < 1.0
    assert abs(numbers.mean() - 0.5) < 4.5 * np.sqrt(1 / 12 / 20_000)
    counts = np.histogram(numbers, bins=20, range=(0, 1))[0]
    assert np.abs(counts - 1000).max() < 4.5 * np.sqrt(950)


@pytest.mark.compiled
def test_hash_of_neighbours_is_unrelated() -> None:
    """Points one quantum apart: correlation of 20,000 pairs within 4.5 / sqrt(20,000)."""
    points = points_of(20_000)
    key = stream_key(1, "cohesion")
    for axis in range(3):
        step = np.zeros(3)
        step[axis] = 1e-6
        pair = np.corrcoef(hash_uniform(points, key), hash_uniform(points + step, key))
        assert abs(pair[0, 1]) < 4.5 / np.sqrt(20_000)


def test_streams_are_named_and_seeded() -> None:
    points = points_of(1000)
    streams = [(1, "cohesion"), (1, "defects"), (2, "cohesion"), (0, "cohesion"), (2**63, "cohesion")]
    drawn = [hash_uniform(points, stream_key(seed, name)) for seed, name in streams]
    for i, first in enumerate(drawn):
        assert (first == hash_uniform(points, stream_key(*streams[i]))).all()
        for second in drawn[:i]:
            assert (first != second).all()
            assert abs(np.corrcoef(first, second)[0, 1]) < 4.5 / np.sqrt(1000)


def test_a_number_belongs_to_its_place() -> None:
    """Neither the numbering nor what else is drawn matters, nor errors far below the quantum of 1e-6."""
    points, key = points_of(500), stream_key(5, "defects")
    order = np.random.default_rng(2).permutation(500)
    numbers = hash_uniform(points, key)
    assert (hash_uniform(points[order], key) == numbers[order]).all()
    assert (hash_uniform(points[:7], key) == numbers[:7]).all()
    assert (hash_uniform(points + 1e-14, key) == numbers).all()


@pytest.mark.parametrize("cells", [3, 10, 64, 128, 1000])
def test_last_bits_on_a_grid_do_not_matter(cells: int) -> None:
    """Midpoints of a grid lie at multiples of half a quantum of 64 cells: rounding would decide."""
    line = np.arange(2 * cells + 1) / (2 * cells) - 0.5
    points = np.stack([line, line[::-1], np.zeros_like(line)], axis=1)
    key = stream_key(1, "cohesion")
    for error in (1e-15, -1e-15):
        assert (hash_uniform(points + error, key) == hash_uniform(points, key)).all()


def test_tie_breakers_are_53_bits_in_the_order_of_the_numbers() -> None:
    points, key = points_of(200), stream_key(1, "ties")
    bits = hash_bits(points, key)
    assert bits.dtype == np.uint64 and bits.max() < 2**53
    assert (bits / 2.0**53 == hash_uniform(points, key)).all()
