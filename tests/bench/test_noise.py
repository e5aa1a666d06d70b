"""The benchmark of noise: its tables, and that the laws of the spread take out what they are for."""

from __future__ import annotations

import numpy as np
import pytest

from weathercoat.bench import noise
from weathercoat.bench.noise import bench_noise, make_shipped
from weathercoat.bench.noise_tables import as_csv, as_text, rates_table, spread_table
from weathercoat.comparison.noise import LAWS, expected_spread, expected_spread_of_mean, unit_spread
from weathercoat.comparison.statistics import FIGURES
from weathercoat.errors import UsageError


def test_results_hold_the_spread_of_every_figure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(noise, "PARTS", {name: noise.PARTS[name] for name in ("plate", "bracket")})
    monkeypatch.setattr(noise, "CONFIGS", ("standard",))
    done: list[tuple[int, int]] = []
    results = bench_noise(
        faces=100, steps=10, seeds=3, judged=11, trials=2, progress=lambda n, m: done.append((n, m))
    )
    assert done[-1] == (50, 50)
    assert set(make_shipped(results)["figures"]) == set(FIGURES)
    table = spread_table(results)
    assert len(table) == 1 + len(FIGURES)
    assert len(table[1]) == 5
    assert len(rates_table(results)) == 1 + 2 * len(noise.GROUPS)
    assert len(as_csv(results).splitlines()) == 1 + 2 * len(FIGURES) * 5
    assert any("5 against 5" in line for line in as_text(results))


def test_too_little_is_refused() -> None:
    for changes in ({"seeds": 2}, {"judged": 10}, {"trials": 0}):
        with pytest.raises(UsageError):
            bench_noise(**changes)


def test_every_figure_has_a_law_and_a_measured_spread() -> None:
    values, length = np.array([0.2, 0.5]), np.array([4.0, 9.0])
    assert tuple(LAWS) == FIGURES
    for figure in FIGURES:
        assert np.all(expected_spread(figure, values, length) > 0.0), figure
        assert 0.0 < expected_spread_of_mean(figure) < 1.5, figure


def test_laws() -> None:
    values, length = np.array([0.0, 0.25, 1.0]), np.array([0.0, 4.0, 9.0])
    assert unit_spread("flakes", 16.0 * values, length).tolist() == [0.0, 2.0, 4.0]
    assert unit_spread("lost_share", values, length) == pytest.approx([0.0, np.sqrt(0.1875), 0.0])
    assert unit_spread("dust", values, length).tolist() == values.tolist()
    assert unit_spread("straightness", values, length) == pytest.approx([np.sqrt(10.0), 1 / 2, 1 / 3])
    assert unit_spread("raised", values, length) == pytest.approx([0.0, 1 / 8, 1 / 3])
