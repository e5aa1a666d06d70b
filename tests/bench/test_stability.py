"""Stability: histories fall into the right classes, and the default never leaves finite positions."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from weathercoat.bench import stability_maps as maps
from weathercoat.bench.accuracy import METHODS
from weathercoat.bench.stability import bench_stability, fill_map
from weathercoat.bench.stability_history import CLASSES, History, classify, follow
from weathercoat.bench.stability_tables import as_csv, as_text
from weathercoat.deform.deformation import DeformParameters
from weathercoat.errors import UsageError

STEPS = 30
DEFAULT: dict[str, Any] = {}


def history(**changes: Any) -> History:
    """A film that goes to its target evenly and comes to rest there, but for the changes."""
    left = np.geomspace(1.0, 1e-4, STEPS)
    made = History(
        angle=left.tolist(), strain=(0.01 * left).tolist(), movement=left.tolist(), onward=[1.0] * STEPS
    )
    for name, value in changes.items():
        setattr(made, name, value)
    return made


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({}, "converged"),
        ({"is_finite": False}, "non-finite"),
        ({"strain": [0.01] * STEPS}, "slow"),
        ({"angle": np.linspace(1.0, 0.5, STEPS).tolist(), "movement": [0.1] * STEPS}, "slow"),
        ({"angle": [0.5] * STEPS, "movement": [1e-6] * STEPS}, "slow"),
        ({"angle": [0.5] * STEPS, "movement": [0.1] * STEPS, "onward": [-1.0] * STEPS}, "oscillating"),
        ({"angle": np.linspace(0.5, 1.0, STEPS).tolist(), "movement": [0.1] * STEPS}, "oscillating"),
        ({"angle": [0.5] * STEPS, "movement": [1e-6] * STEPS, "farthest_angle": 3.0}, "flipped"),
        ({"angle": [0.5] * STEPS, "movement": [0.005] * STEPS, "farthest_angle": 3.0}, "slow"),
        ({"angle": [0.5], "strain": [0.0], "movement": [1.0], "onward": [1.0]}, "slow"),
    ],
)
def test_a_history_falls_into_its_class(changes: dict[str, Any], name: str) -> None:
    assert classify(history(**changes)) == name


def test_what_is_followed_is_recorded() -> None:
    case = maps.make_hinge(-1.0)
    found = follow(case, DeformParameters(curl_rate=0.0), [0.5, 1.0, 1.0, 1.0])
    assert found.is_finite and len(found.angle) == 4
    assert classify(found) == "converged"
    assert found.movement[0] > found.movement[-1]
    wrong = follow(case, DeformParameters(curl_rate=0.0, deformation_sweeps=0), [1.0] * 6)
    assert wrong.angle[-1] == pytest.approx(1.0) and max(wrong.movement) == 0.0


def test_what_flies_away_is_not_finite() -> None:
    case = maps.make_hinge(-1.0)
    far = case.start.copy()
    far[0] = math.nan
    assert classify(follow(case, DeformParameters(curl_rate=0.0), [1.0], far)) == "non-finite"
    far[:] = case.start + 1e4
    assert classify(follow(case, DeformParameters(curl_rate=0.0), [1.0], far)) == "non-finite"


SMALL = [
    maps.make_curl_map(turns=(0.1, 2.5), stretches=(1e-3, 1.0, 1e4)),
    maps.make_budget_map(budgets=(1, 10), flaps=(4, 12)),
    maps.make_fold_map(folds=(0.0, 1e-6, math.pi)),
    maps.make_defect_map(ratios=(1e4, math.inf)),
    maps.make_scale_map(scales=(1e-9, 1e9), offsets=(0.0, 1e7)),
    maps.make_bound_map(("curl.radius", "curl.rate", "deformation.angle_stiffness")),
]


@pytest.mark.parametrize("made", SMALL, ids=lambda made: made.name)
def test_the_default_has_no_cell_that_is_not_finite(made: maps.StabilityMap) -> None:
    cells = fill_map(made, DEFAULT)
    assert (len(cells), len(cells[0])) == (len(made.y), len(made.x))
    names = {name for row in cells for name in row}
    assert names <= set(CLASSES)
    assert "non-finite" not in names


@pytest.mark.long
@pytest.mark.parametrize("made", list(maps.make_maps()), ids=lambda made: made.name)
def test_no_method_has_a_cell_that_is_not_finite(made: maps.StabilityMap) -> None:
    for method in METHODS:
        assert not any("non-finite" in row for row in fill_map(made, method.values)), method.label


def test_signed_forms_open_what_is_folded_up_whichever_way_it_is_to_go() -> None:
    made = maps.make_fold_map(folds=(0.0, 0.5 * math.pi, math.pi))
    for form in ("dihedral", "split"):
        assert {name for row in fill_map(made, {"deformation.angle": form}) for name in row} == {"converged"}


def test_momentum_lives_on_from_step_to_step() -> None:
    """With one sweep a step there would be none otherwise, and the flap as slow as without."""
    made = maps.make_budget_map(budgets=(1,), flaps=(4,))
    assert fill_map(made, {"deformation.solver": "momentum"}) == [["converged"]]
    assert fill_map(made, DEFAULT) == [["slow"]]


def test_unit_and_place_change_nothing_until_digits_are_gone() -> None:
    made = maps.make_scale_map(scales=(1e-9, 1e9), offsets=(1e7, 1e17))
    assert fill_map(made, DEFAULT) == [["converged", "converged"], ["refused", "refused"]]


def test_what_is_out_of_bounds_is_refused_and_the_bound_is_not() -> None:
    bounds = dict(maps.find_bounds())
    assert {"curl.radius", "curl.angle_floor", "deformation.sweeps"} < set(bounds)
    for row in fill_map(maps.make_bound_map(("curl.rate", "deformation.angle_stiffness")), DEFAULT):
        assert row[0] == row[3] == "refused"
        assert "refused" not in row[1:3]


def test_results_are_written_cell_by_cell(monkeypatch: pytest.MonkeyPatch) -> None:
    small = maps.make_fold_map(folds=(0.5 * math.pi, math.pi))
    monkeypatch.setattr("weathercoat.bench.stability.make_maps", lambda: iter([small]))
    results = bench_stability(["fold"])
    (made,) = results["maps"]
    cells = len(made["x"]) * len(made["y"]) * len(METHODS)
    assert len(as_csv(results).splitlines()) == 1 + cells
    assert any(METHODS[0].label in line for line in as_text(results))
    with pytest.raises(UsageError, match="no map 'folds'"):
        bench_stability(["folds"])
