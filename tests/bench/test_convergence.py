"""The convergence benchmark on a small plate: what it finds of solvers that converge and that do not."""

from __future__ import annotations

import json

import pytest

from weathercoat.bench.convergence import bench_convergence
from weathercoat.bench.convergence_tables import as_csv, as_text, run_table
from weathercoat.errors import UsageError


def test_newton_stays_near_its_minimum_and_sweeps_do_not() -> None:
    told = []
    results = bench_convergence(
        ("sweeps", "newton"), faces=600, steps=40, progress=lambda done, total: told.append((done, total))
    )
    assert told[1] == (2, 6) and told[-1] == (6, 6)
    sweeps, newton = results["runs"]
    strip, uniform, flat_clamp, rolled_clamp = results["sheets"]
    assert strip["position"] < 5e-3 and uniform["gap"] < 1e-2
    assert rolled_clamp["angle"] < 0.02 < flat_clamp["angle"] < 0.05
    assert max(flat_clamp["length"], rolled_clamp["length"]) < 5e-4
    assert newton["largest_gap"] < 0.05 < sweeps["largest_gap"]
    assert newton["largest_strain"] < sweeps["largest_strain"]
    assert newton["iterations"] >= 40 and newton["unfinished_steps"] == 0
    assert [len(run["looks"]) for run in results["runs"]] == [10, 10]
    assert newton["looks"][-1]["age"] == 1.0 and newton["looks"][-1]["alive"] < 1.0
    assert len(run_table(results)) == 3
    assert len(as_csv(results).splitlines()) == 21
    assert any("newton" in line for line in as_text(results))
    json.dumps(results)


def test_an_unknown_solver_is_refused() -> None:
    with pytest.raises(UsageError, match="no solver 'magic'"):
        bench_convergence(("magic",), faces=600, steps=40, progress=lambda done, total: None)
