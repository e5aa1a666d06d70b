"""The accuracy benchmark: ladders, what they come to, and their charts."""

from __future__ import annotations

import io
from itertools import pairwise
from typing import Any

import pytest

from weathercoat.bench.accuracy import METHODS, Setting, bench_accuracy, climb
from weathercoat.bench.accuracy_chart import STYLES, case_charts
from weathercoat.bench.accuracy_summary import has_stopped, summarise
from weathercoat.bench.accuracy_tables import as_csv, as_text, least_table, reach_table
from weathercoat.bench.reference import measure_errors
from weathercoat.bench.reference_cases import make_flap
from weathercoat.deform.deformation import deform
from weathercoat.errors import UsageError


def test_a_ladder_of_sweeps_ends_where_as_many_sweeps_at_once_do() -> None:
    case = make_flap(4)
    sweeps = METHODS[0]
    points = list(climb(case, sweeps, Setting()))
    assert [point["budget"] for point in points] == list(sweeps.budgets)
    assert all(a["cpu_ms"] <= b["cpu_ms"] for a, b in pairwise(points))
    at_once = case.mesh_at(case.start)
    deform(at_once, case.constraints, case.parameters_with({"deformation.sweeps": 200}), 0.0)
    errors = measure_errors(case, at_once.positions[: at_once.vertex_count])
    assert points[sweeps.budgets.index(200)]["angle"] == pytest.approx(errors.angle, rel=1e-3)


def test_sweeps_reach_a_short_curl_and_not_a_long_one() -> None:
    short = summarise({"ladders": [_ladder(make_flap(4))]}, "angle")
    long = summarise({"ladders": [_ladder(make_flap(24))]}, "angle")
    assert short["least"] < 1e-3 < 0.1 < long["least"]


def _ladder(case: Any) -> dict[str, Any]:
    return {"setting": "only", "points": list(climb(case, METHODS[0], Setting()))}


@pytest.mark.parametrize(
    ("errors", "stopped"),
    [
        ([1.0, 0.5, 0.2, 0.1], False),
        ([1.0, 0.5, 0.49, 0.48], True),
        ([1.0, 0.1, 0.5, None], True),
        ([1.0, 0.5], False),
        ([1.0, 1.0, 1.0, 0.5], False),
    ],
)
def test_a_ladder_has_stopped_when_its_last_rungs_gain_nothing(errors: list[Any], stopped: bool) -> None:
    assert has_stopped(errors) is stopped


def test_the_front_drops_what_another_beats_in_work_and_error() -> None:
    def point(cpu_ms: float, error: float | None) -> dict[str, Any]:
        return {"budget": 1, "cpu_ms": cpu_ms, "angle": error}

    ladders = [
        {"setting": "a", "points": [point(1.0, 0.5), point(2.0, 0.6), point(4.0, 0.1)]},
        {"setting": "b", "points": [point(3.0, 0.05), point(8.0, None)]},
    ]
    found = summarise({"ladders": ladders}, "angle")
    assert [(p["cpu_ms"], p["angle"]) for p in found["front"]] == [(1.0, 0.5), (3.0, 0.05)]
    assert found["least"] == 0.05 and found["setting"] == "b"


@pytest.fixture(scope="module")
def results() -> dict[str, Any]:
    """One small case, with all methods."""
    return bench_accuracy(["flap-4"])


def test_every_method_is_measured_and_tabled(results: dict[str, Any]) -> None:
    (case,) = results["cases"]
    labels = [curve["method"] for curve in case["curves"]]
    assert labels == [method.label for method in METHODS]
    assert set(labels) <= set(STYLES)
    points = sum(len(ladder["points"]) for curve in case["curves"] for ladder in curve["ladders"])
    assert len(as_csv(results).splitlines()) == 1 + points
    assert reach_table(results, "angle", 0.1)[1][0] == "flap-4"
    assert reach_table(results, "angle", 0.0)[1][1:] == ["-"] * len(METHODS)
    assert " ms" in least_table(results, "angle")[1][1]
    assert any("flap-4" in line for line in as_text(results))


def test_charts_are_pictures(results: dict[str, Any]) -> None:
    pytest.importorskip("matplotlib")
    charts = case_charts(results)
    assert list(charts) == ["accuracy", "accuracy-flap-4"]
    for draw in charts.values():
        stream = io.BytesIO()
        draw(results, stream)
        assert stream.getvalue().startswith(b"\x89PNG")


def test_an_unknown_case_is_refused() -> None:
    with pytest.raises(UsageError, match="no case 'flap'"):
        bench_accuracy(["flap"])
