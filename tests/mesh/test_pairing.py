"""Pairs of half-edges against all half-edges of each edge, gathered in a dictionary."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests import zoo
from weathercoat.mesh.halfedge import make_twins
from weathercoat.mesh.pairing import pair_half_edges


def half_edges_by_edge(faces: np.ndarray) -> dict[tuple[int, int], list[int]]:
    found: dict[tuple[int, int], list[int]] = {}
    for h in range(faces.size):
        a, b = sorted((int(faces[h // 3, h % 3]), int(faces[h // 3, (h + 1) % 3])))
        found.setdefault((a, b), []).append(h)
    return found


@settings(max_examples=80, deadline=None)
@given(seed=st.integers(0, 10**6), count=st.integers(0, 40), vertices=st.integers(3, 12))
def test_every_edge_of_any_faces(seed: int, count: int, vertices: int) -> None:
    """Edges of one, two and more faces, whichever way these run."""
    random = np.random.default_rng(seed)
    faces = np.array([random.permutation(vertices)[:3] for _ in range(count)], np.int32).reshape(-1, 3)
    twin, beyond, alike = pair_half_edges(faces, vertices)
    expected = np.full(faces.size, -1)
    more, same = set(), 0
    for around in half_edges_by_edge(faces).values():
        if len(around) > 1:
            expected[around[0]], expected[around[1]] = around[1], around[0]
            same += int(faces[around[0] // 3, around[0] % 3] == faces[around[1] // 3, around[1] % 3])
        more |= {(around[0], h) for h in around[2:]}
    assert (twin == expected).all()
    assert {tuple(pair) for pair in beyond.tolist()} == more
    assert alike == same


@pytest.mark.parametrize("name", zoo.ZOO)
@pytest.mark.parametrize("seed", range(3))
def test_twins_of_the_zoo(name: str, seed: int) -> None:
    faces = zoo.renumber(zoo.ZOO[name](), seed).faces
    expected = np.full(faces.size, -1)
    for around in half_edges_by_edge(faces).values():
        if len(around) == 2:
            expected[around] = around[::-1]
    assert (make_twins(faces) == expected).all()


def test_a_vertex_of_many_faces_takes_linear_time() -> None:
    """All edges of a fan are in one bucket: pairs are found without going through it for each."""
    count = 300_000
    rim = np.arange(1, count + 1, dtype=np.int32)
    faces = np.stack([np.zeros(count, np.int32), rim, np.roll(rim, -1)], axis=1)
    twin = make_twins(faces)
    assert (twin.reshape(-1, 3)[:, 0] == 3 * np.roll(np.arange(count), 1) + 2).all()
    assert (twin.reshape(-1, 3)[:, 1] == -1).all()
