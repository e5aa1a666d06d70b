"""How far apart two runs end is found, whatever the numbering of their vertices."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from weathercoat.bench.compare import compare_ends, save_end
from weathercoat.bench.situation import load_speed_config, make_speed_simulation
from weathercoat.mesh.shapes import make_random_sheet


def test_a_film_that_has_moved_is_as_far_apart_as_it_moved(tmp_path: Path) -> None:
    simulation = make_speed_simulation(make_random_sheet(500), load_speed_config(20))
    for _ in range(10):
        simulation.step()
    save_end(simulation, tmp_path / "first.npz")
    same = compare_ends(tmp_path / "first.npz", tmp_path / "first.npz")
    assert same == {"rms": 0.0, "percentile_99": 0.0, "largest": 0.0, "faces_in_one": 0.0}
    simulation.mesh.positions[:, 1] += 0.25 * simulation.film.mean_edge
    simulation.mesh.alive[0] = False
    save_end(simulation, tmp_path / "moved.npz")
    moved = compare_ends(tmp_path / "moved.npz", tmp_path / "first.npz")
    assert moved["rms"] == pytest.approx(0.25) and moved["largest"] == pytest.approx(0.25)
    assert moved["faces_in_one"] == pytest.approx(1 / 500)


def test_numbers_of_vertices_do_not_matter(tmp_path: Path) -> None:
    simulation = make_speed_simulation(make_random_sheet(500), load_speed_config(20))
    save_end(simulation, tmp_path / "first.npz")
    mesh = simulation.mesh
    count = mesh.vertex_count
    mesh.positions[:count] = mesh.positions[:count][::-1].copy()
    mesh.tail[:] = count - 1 - mesh.tail
    save_end(simulation, tmp_path / "renumbered.npz")
    assert compare_ends(tmp_path / "renumbered.npz", tmp_path / "first.npz")["largest"] == 0.0
    assert np.isfinite(mesh.positions[:count]).all()
