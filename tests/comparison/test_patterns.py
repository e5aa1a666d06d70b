"""Figures of crack patterns against what can be counted by hand on a sheet of side 1."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.output.snapshots import CELLS, make_sheet, make_snapshot
from weathercoat.comparison.patterns import MOST_SPACING, measure_pattern
from weathercoat.mesh.shapes import make_sphere
from weathercoat.sim.snapshot import Snapshot


def test_a_film_without_cracks_has_finite_figures() -> None:
    figures = measure_pattern(make_snapshot())
    assert figures == {
        "junctions_three": 0.0,
        "junctions_four": 0.0,
        "straightness": 0.0,
        "dead_ends": 0.0,
        "crack_spacing": MOST_SPACING,
        "pieces": 1.0,
        "piece_median_area": pytest.approx(1.0),
        "piece_roundness": pytest.approx(np.pi / 4.0),
        "raised": 0.0,
    }


def test_a_closed_film_without_cracks_has_no_outline() -> None:
    sphere = make_sphere(2)
    figures = measure_pattern(make_snapshot(mesh=(sphere.vertices, sphere.faces)))
    assert figures["piece_roundness"] == 1.0
    assert figures["pieces"] == 1.0


def test_metal_without_film_has_finite_figures() -> None:
    figures = measure_pattern(make_snapshot(lost=2 * CELLS**2))
    assert all(np.isfinite(value) for value in figures.values())
    assert figures["pieces"] == figures["piece_median_area"] == figures["raised"] == 0.0


def test_a_cut_through_the_sheet_is_straight_and_makes_two_pieces() -> None:
    figures = measure_pattern(make_snapshot(split_column=2))
    assert figures["straightness"] == pytest.approx(1.0)
    assert figures["dead_ends"] == 0.0  # it ends at the rim
    assert figures["junctions_three"] == figures["junctions_four"] == 0.0
    assert figures["pieces"] == 2.0
    assert figures["piece_median_area"] == pytest.approx(0.5)
    assert figures["piece_roundness"] == pytest.approx(4.0 * np.pi * 0.5 / 3.0**2)
    assert figures["raised"] == pytest.approx(0.1 * 0.5)


def test_the_spacing_of_one_cut_is_what_parallel_cuts_as_far_apart_would_have() -> None:
    """Cuts at distance 1 through a sheet of side 1 lie a quarter from the metal in the mean."""
    figures = measure_pattern(make_snapshot(cells=32, split_column=16))
    assert figures["crack_spacing"] == pytest.approx(1.0, rel=0.02)
    assert figures["crack_spacing"] <= MOST_SPACING


def test_a_crack_within_the_film_has_two_dead_ends() -> None:
    figures = measure_pattern(_cracked_inside())
    assert figures["dead_ends"] == pytest.approx(2.0 / 0.5)
    assert figures["straightness"] == pytest.approx(1.0)
    assert figures["pieces"] == 1.0


def test_a_lost_corner_turns_the_pattern() -> None:
    """Two faces are lost at a corner: a square, whose two inner edges meet at a right angle."""
    snapshot = make_snapshot()
    kept = np.array([face for face in range(len(snapshot.film_faces)) if face not in (0, CELLS**2)])
    figures = measure_pattern(
        dataclasses.replace(
            snapshot, film_faces=snapshot.film_faces[kept], film_face=snapshot.film_face[kept]
        )
    )
    assert figures["straightness"] == pytest.approx(0.0, abs=1e-12)
    assert figures["pieces"] == 1.0
    assert figures["piece_median_area"] == pytest.approx(1.0 - 1.0 / CELLS**2)


def test_figures_know_no_scale() -> None:
    small, large = measure_pattern(_cracked_inside()), measure_pattern(_cracked_inside(scale=1e4))
    assert large == {name: pytest.approx(value, rel=1e-9, abs=1e-12) for name, value in small.items()}


def _cracked_inside(scale: float = 1.0) -> Snapshot:
    """The middle two of four edges of a grid line are broken: one vertex is split."""
    snapshot = make_snapshot()
    middle = (CELLS // 2) * (CELLS + 1) + CELLS // 2
    column = np.arange(len(snapshot.film_vertices)) // (CELLS + 1)
    faces = snapshot.film_faces.copy()
    behind = column[faces].max(axis=1) > CELLS // 2
    faces[behind] = np.where(faces[behind] == middle, len(snapshot.film_vertices), faces[behind])
    vertices, _ = make_sheet()
    return dataclasses.replace(
        snapshot,
        film_faces=faces,
        film_vertices=scale * np.concatenate([snapshot.film_vertices, snapshot.film_vertices[[middle]]]),
        film_origin=np.append(snapshot.film_origin, middle).astype(np.int32),
        substrate_vertices=scale * vertices,
    )
