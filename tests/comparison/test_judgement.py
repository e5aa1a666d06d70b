"""Verdicts on made-up runs, whose noise is known."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.comparison.made import make_group, make_run
from weathercoat.comparison.judgement import ROUND_OFF, judge
from weathercoat.comparison.statistics import FIGURES, RunFigures
from weathercoat.comparison.tolerance import Rule, Tolerance
from weathercoat.errors import UsageError


def test_a_run_is_the_same_as_itself() -> None:
    judgement = judge([make_run(1)], [make_run(1)])
    assert judgement.verdict == "same"
    assert {row.difference for row in judgement.differences} == {0.0}
    assert len(judgement.differences) == 2 * len(FIGURES)


def test_round_off_is_no_difference_and_more_is() -> None:
    def nudged(by: float) -> RunFigures:
        run = make_run(1)
        return dataclasses.replace(
            run, figures={name: tuple(v * (1 + by) for v in values) for name, values in run.figures.items()}
        )

    assert judge([make_run(1)], [nudged(0.5 * ROUND_OFF)]).verdict == "same"
    assert judge([make_run(1)], [nudged(3.0 * ROUND_OFF)]).verdict == "within noise"


def test_groups_are_the_same_in_any_order_and_as_parts_of_each_other() -> None:
    runs = make_group(1, 5)
    assert judge(runs, runs[::-1]).verdict == "same"
    assert judge(runs, runs[3:4]).verdict == "same"
    assert judge(runs[1:3], runs).verdict == "same"
    assert judge([runs[0], runs[0]], [runs[0], runs[1]]).verdict == "within noise"


def test_one_other_run_is_within_noise() -> None:
    judgement = judge([make_run(1, noise=0.003)], [make_run(2, noise=0.003)])
    assert judgement.verdict == "within noise"
    assert "rough judgement" in judgement.method
    assert not any(row.is_beyond for row in judgement.differences)


def test_one_run_that_is_far_off_is_different() -> None:
    judgement = judge([make_run(1, noise=0.003)], [make_run(2, noise=0.003, dust=0.05)])
    assert judgement.verdict == "different"
    assert {row.figure for row in judgement.differences if row.is_beyond} == {"dust"}


def test_coarser_films_vary_more() -> None:
    def allowed(faces: int | None) -> float:
        runs = [dataclasses.replace(make_run(seed), faces=faces) for seed in (1, 2)]
        return judge(runs[:1], runs[1:]).differences[0].allowed

    assert allowed(30_000) == allowed(3_000) == allowed(None)
    assert allowed(750) == pytest.approx(2.0 * allowed(3_000))


def test_five_against_five_is_an_exact_test() -> None:
    judgement = judge(make_group(1, 5), make_group(11, 5))
    assert judgement.verdict == "within noise"
    assert "exact permutation test over 126 splits" in judgement.method
    judgement = judge(make_group(1, 5), make_group(11, 5, straightness=0.3))
    assert judgement.verdict == "different"
    assert "p = 0.0079" in judgement.method
    farthest = max(judgement.differences, key=lambda row: abs(row.sigmas))
    assert farthest.figure == "straightness"
    assert farthest.is_beyond


def test_many_runs_are_split_by_chance_and_always_the_same() -> None:
    one = judge(make_group(1, 12), make_group(21, 12))
    assert "permutation test over 20,000 splits" in one.method
    assert one == judge(make_group(1, 12), make_group(21, 12))
    assert judge(make_group(1, 12), make_group(21, 12, raised=0.2)).verdict == "different"


def test_chance_alone_is_called_different_no_more_often_than_the_level() -> None:
    """Of 400 comparisons of runs of one kind 1 in 20 at most is wrong: 20, give or take 4.4 (binomial)."""
    tolerance = Tolerance(level=0.05)
    for first, second in ((4, 4), (1, 6)):
        seeds = iter(range(10_000))
        wrong = 0
        for _ in range(400):
            a = [make_run(next(seeds)) for _ in range(first)]
            b = [make_run(next(seeds)) for _ in range(second)]
            wrong += judge(a, b, tolerance).verdict == "different"
        assert wrong <= 20 + 3 * 4.4, (first, second)


def test_a_run_is_judged_by_the_noise_of_a_group() -> None:
    group = make_group(1, 8)
    assert judge([make_run(20)], group).verdict == "within noise"
    judgement = judge([make_run(20, dead_ends=1.0)], group)
    assert judgement.verdict == "different"
    assert "7 degrees of freedom: dead_ends is farthest" in judgement.method


def test_what_is_alike_in_all_runs_of_a_group_has_the_noise_of_others() -> None:
    """No run of the group lost a flake: one flake is no proof that a run is of another kind, thirty are."""

    def with_flakes(run: RunFigures, count: float) -> RunFigures:
        return dataclasses.replace(run, figures={**run.figures, "flakes": (0.0, count)})

    group = [with_flakes(run, 0.0) for run in make_group(31, 6)]
    assert judge([with_flakes(make_run(20), 1.0)], group).verdict == "within noise"
    assert judge([with_flakes(make_run(20), 300.0)], group).verdict == "different"


def test_rules_take_the_place_of_the_level() -> None:
    a, b = make_group(1, 5), make_group(11, 5, straightness=0.3)
    lenient = Tolerance(rules=(Rule("straightness", absolute=1.0),))
    assert judge(a, b, lenient).verdict == "within noise"
    assert judge(a, b, Tolerance(omitted=("straight*",))).verdict == "within noise"
    strict = Tolerance(rules=(Rule("*", relative=0.01),))
    judgement = judge([make_run(1)], [make_run(2)], strict)
    assert judgement.verdict == "different"
    assert "with rules of the tolerance" in judgement.method


def test_a_rule_in_sigmas_is_of_the_difference_of_means() -> None:
    judgement = judge(make_group(1, 5), make_group(11, 5), Tolerance(rules=(Rule("raised", sigmas=3.0),)))
    rows = [row for row in judgement.differences if row.figure == "raised"]
    assert all(row.allowed == pytest.approx(3.0 * row.spread) for row in rows)
    assert rows[1].spread == pytest.approx(0.05 * np.sqrt(2 / 5), rel=0.5)


def test_runs_are_compared_at_the_ages_that_they_share() -> None:
    judgement = judge([make_run(1)], [make_run(1, ages=(0.25, 0.5, 0.75, 1.0))])
    assert judgement.verdict == "same"
    assert {row.age for row in judgement.differences} == {0.5, 1.0}
    with pytest.raises(UsageError, match="no ages in common"):
        judge([make_run(1)], [make_run(1, ages=(0.3,))])
    with pytest.raises(UsageError, match="no figures in common"):
        judge([make_run(1)], [make_run(1)], Tolerance(omitted=("*",)))
    with pytest.raises(UsageError, match="no run"):
        judge([], [make_run(1)])
