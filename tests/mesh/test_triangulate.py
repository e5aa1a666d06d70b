"""Ear clipping against the plain method, over polygons of many kinds; and how its time grows."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.mesh.odd_files import circle, comb
from weathercoat.errors import LimitError
from weathercoat.mesh.triangulate import triangulate

Outline = list[tuple[float, float]]


def plain_ears(p: Outline) -> list[tuple[int, int, int]]:
    """Ears of a polygon, each looked for from behind the last one; where there is none, the next corner."""

    def turn(a: int, b: int, c: int) -> float:
        return (p[b][0] - p[a][0]) * (p[c][1] - p[a][1]) - (p[b][1] - p[a][1]) * (p[c][0] - p[a][0])

    def is_ear(k: int) -> bool:
        a, b, c = ring[k - 1], ring[k], ring[(k + 1) % len(ring)]
        if turn(a, b, c) <= 0:
            return False
        for j, i in enumerate(ring):
            is_reflex = turn(ring[j - 1], i, ring[(j + 1) % len(ring)]) <= 0
            if i in (a, b, c) or not is_reflex or p[i] in (p[a], p[b], p[c]):
                continue
            if turn(a, b, i) >= 0 and turn(b, c, i) >= 0 and turn(c, a, i) >= 0:
                return False
        return True

    ring, k, found = list(range(len(p))), 1, []
    while len(ring) > 2:
        k = next((j % len(ring) for j in range(k, k + len(ring)) if is_ear(j % len(ring))), k % len(ring))
        found.append((ring[k - 1], ring[k], ring[(k + 1) % len(ring)]))
        following = ring[(k + 2) % len(ring)]
        del ring[k]
        k = ring.index(following)
    return found


def spiral(count: int) -> Outline:
    """A thin band wound up, whose ears are soon at its two ends only."""
    turns = [0.05 * i for i in range(count // 2)]
    outer = [((1.1 + t) * math.cos(t), (1.1 + t) * math.sin(t)) for t in turns]
    inner = [((1.0 + t) * math.cos(t), (1.0 + t) * math.sin(t)) for t in reversed(turns)]
    return outer + inner


def star(count: int) -> Outline:
    """Two radii in turn."""
    return [((1 + i % 2) * x, (1 + i % 2) * y) for i, (x, y) in enumerate(circle(count))]


def crossing(count: int) -> Outline:
    """Random points."""
    values: Outline = np.random.default_rng(count).uniform(size=(count, 2)).tolist()
    return values


def rough_circle(count: int) -> Outline:
    """A circle with random radii: simple, with many concave corners."""
    radius = np.random.default_rng(count).uniform(0.5, 1.0, count)
    return [(r * x, r * y) for r, (x, y) in zip(radius.tolist(), circle(count), strict=True)]


def area(p: Outline) -> float:
    """Signed, by the shoelace formula."""
    return 0.5 * sum(x * q[1] - q[0] * y for (x, y), q in zip(p, p[1:] + p[:1], strict=True))


def clipped(outline: Outline) -> NDArray[np.int64]:
    """Triangles (n - 2, 3) of the package."""
    positions = np.column_stack([np.array(outline, float), np.zeros(len(outline))])
    return triangulate(positions, np.arange(len(outline)), np.array([len(outline)]))[0]


@pytest.mark.parametrize("count", [10, 20, 61, 128, 300])
@pytest.mark.parametrize("make", [lambda n: comb(n // 4 + 1), spiral, star, rough_circle, circle])
def test_simple_polygons_are_clipped_as_by_the_plain_method(
    make: Callable[[int], Outline], count: int
) -> None:
    outline = make(count)
    triangles = clipped(outline)
    assert triangles.tolist() == [list(t) for t in plain_ears(outline)]
    corner = np.array(outline)[triangles]
    one, other = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    assert 0.5 * np.abs(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]).sum() == pytest.approx(
        area(outline)
    )


@pytest.mark.parametrize("make", [crossing, lambda n: [(x, y) for x, y in 2 * circle(n // 2)]])
def test_every_corner_of_a_polygon_that_crosses_or_repeats_itself_is_used(
    make: Callable[[int], Outline],
) -> None:
    for count in (10, 12, 30, 300):
        triangles = clipped(make(count))
        assert len(triangles) == count - 2
        assert np.array_equal(np.unique(triangles), np.arange(count))
        # Each side of the outline is the side of one triangle, as in every triangulation.
        sides = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
        found, times = np.unique(sides, axis=0, return_counts=True)
        outline = {(i, i + 1) for i in range(count - 1)} | {(0, count - 1)}
        assert {tuple(side) for side in found[times == 1].tolist()} == outline


@pytest.mark.parametrize("scale", [(1e-321, 1.0), (1.0, 1e-321), (1e-321, 1e-321), (1e150, 1e-150), (0, 1)])
def test_no_proportion_leads_out_of_the_grid(scale: tuple[float, float]) -> None:
    for make in (star, crossing, rough_circle):
        triangles = clipped([(scale[0] * x, scale[1] * y) for x, y in make(50)])
        assert np.array_equal(np.unique(triangles), np.arange(50))


def test_what_would_take_too_long_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("weathercoat.mesh.triangulate.MAX_WORK", 100_000)
    clipped(spiral(1000))
    with pytest.raises(LimitError, match="4000 corners"):
        clipped(comb(1000))


@pytest.mark.parametrize("make", [spiral, star, rough_circle, crossing])
def test_time_grows_hardly_faster_than_the_polygon(make: Callable[[int], Outline]) -> None:
    """Sixteen times the corners in less than a hundred times the time; the plain method takes thousands."""

    def seconds(outline: Outline) -> float:
        start = time.process_time()
        clipped(outline)
        return time.process_time() - start

    clipped(make(100))
    small = min(seconds(make(1000)) for _ in range(3))
    assert seconds(make(16_000)) < 100 * max(small, 2e-3)
