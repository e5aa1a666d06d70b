"""The benchmark of independence: what its figures mean, and that flakes and cracks belong to the paint."""

from __future__ import annotations

import numpy as np
import pytest

from weathercoat.bench.independence import (
    FIGURES,
    SHEAR_LAG,
    average_runs,
    bench_independence,
    fit_curl_radius,
    independence_config,
    measure_run,
)
from weathercoat.bench.independence_tables import as_csv, as_text, faces_table, shear_lag_table
from weathercoat.errors import UsageError
from weathercoat.mesh.shapes import make_random_sheet
from weathercoat.run import prepare_simulation


def test_results_hold_every_run_and_mean() -> None:
    done: list[tuple[int, int]] = []
    results = bench_independence([300, 600], seeds=2, steps=30, progress=lambda n, m: done.append((n, m)))
    assert done[-1] == (14, 14) and len(results["runs"]) == 14
    assert len(results["means"]) == 7
    assert results["slope"] is not None
    assert len(faces_table(results, "literal")) == 3
    assert shear_lag_table(results)[-1][0] == "log-log slope"
    assert len(as_csv(results).splitlines()) == 15
    assert any("log-log slope" in line for line in as_text(results))


def test_means_are_over_seeds_alone() -> None:
    run = {"kind": "faces", "rules": "standard", "faces": 3, "shear_lag": 0.1, **dict.fromkeys(FIGURES, 1.0)}
    means = average_runs([run, {**run, "spacing": 3.0}, {**run, "faces": 4}])
    assert [row["spacing"] for row in means] == [2.0, 1.0]
    assert [row["spacing_deviation"] for row in means] == [1.0, 0.0]


def test_the_radius_of_a_cylinder_is_found() -> None:
    """Film rolled to a cylinder."""
    radius = 0.2
    simulation = prepare_simulation(
        make_random_sheet(2000), independence_config("standard", SHEAR_LAG, 1, 10, "none")
    )
    assert fit_curl_radius(simulation) == 0.0
    mesh = simulation.mesh
    rest = mesh.rest_positions
    simulation.film.separated[: len(rest)] = True
    along = int(np.argmax(np.ptp(rest, axis=0)))
    normal = int(np.argmin(np.ptp(rest, axis=0)))
    mesh.positions[: len(rest), along] = radius * np.sin(rest[:, along] / radius)
    mesh.positions[: len(rest), normal] = radius * np.cos(rest[:, along] / radius)
    # a hinge bends by the extent of its span along the arc, whose mean square is half of the whole
    assert fit_curl_radius(simulation) == pytest.approx(np.sqrt(2.0) * radius, rel=0.2)


def test_too_little_is_refused() -> None:
    with pytest.raises(UsageError, match="at least 100 faces"):
        bench_independence([50])
    with pytest.raises(UsageError, match="at least 1"):
        bench_independence([300], seeds=0)


@pytest.mark.long
def test_cracks_and_flakes_belong_to_the_paint() -> None:
    """Ten times the faces, with a shear lag of 5.6 edges of the coarser mesh: spacing within a quarter, and
    flakes of at least half the area. Where cracks forget their direction at each edge, flakes shrink to a
    fifth.
    """
    shear_lag = 0.085
    means = {}
    for faces in (10_000, 100_000):
        surface = make_random_sheet(faces)
        configs = [independence_config("standard", shear_lag, seed, 300, "sweeps") for seed in range(1, 6)]
        runs = [measure_run(surface, config) for config in configs]
        means[faces] = {name: np.mean([run[name] for run in runs]) for name in ("spacing", "flake_area")}
    coarse, fine = means.values()
    assert fine["spacing"] == pytest.approx(coarse["spacing"], rel=0.25)
    assert fine["flake_area"] > 0.5 * coarse["flake_area"]
