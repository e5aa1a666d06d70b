"""Whether runs differ by more than chance: the verdict on two groups of runs, from their figures alone.

Configs are not looked at. The verdict comes from one number for each figure of a run, its mean over the
ages in units of its spread, so that nothing hangs on which ages were recorded:

- groups that are large enough: an exact permutation test, which takes nothing for granted but that runs that
  differ by chance alone could as well be in the other group;
- smaller ones, such as one run against several: t-tests of the figures, each at the level divided by their
  number (Bonferroni), so that the level is that of all together;
- one run against one: the same with the spread that was measured on other models, which is rough.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from weathercoat.comparison.noise import LAWS, expected_spread, expected_spread_of_mean
from weathercoat.comparison.statistics import RunFigures
from weathercoat.comparison.tolerance import Rule, Tolerance
from weathercoat.errors import UsageError

Verdict = Literal["same", "within noise", "different"]

# Of the larger value: round-off that differs from CPU to CPU, and no more.
ROUND_OFF = 1e-9
MOST_SPLITS = 20_000
# Of the runs' variance: a figure that the groups share no value of counts a thousand times one that varies
# as much within them as between them, and not infinitely.
_LEAST_WITHIN = 1e-3


@dataclass(frozen=True)
class Difference:
    """One figure of two groups of runs at one age.

    a, b: means over the runs of each group; difference: b - a. spread: its standard deviation by chance.
    allowed: how large the difference may be, by a rule of the tolerance or else what it is beyond in so many
    cases by chance alone as the tolerance's level says. is_beyond: it is larger, and either a rule forbids
    that or the groups as a whole differ: of a hundred figures, one is beyond what is allowed by chance.
    """

    figure: str
    age: float
    a: float
    b: float
    difference: float
    spread: float
    allowed: float
    is_beyond: bool

    @property
    def sigmas(self) -> float:
        """The difference in standard deviations of chance; 0 where there is none of either."""
        if self.spread > 0.0:
            return self.difference / self.spread
        return 0.0 if self.difference == 0.0 else math.copysign(math.inf, self.difference)


@dataclass(frozen=True)
class Judgement:
    """The verdict on two groups of runs, every figure that was compared, and how they were judged: a sentence
    that begins small and ends without a stop, to be put after the verdict.
    """

    verdict: Verdict
    differences: tuple[Difference, ...]
    method: str


def judge(a: Sequence[RunFigures], b: Sequence[RunFigures], tolerance: Tolerance | None = None) -> Judgement:
    """Judge whether two groups of runs differ by more than the noise between seeds.

    Runs are compared by the figures and at the ages that all of them have. `same`: each run of the smaller
    group has its equal in the other, to round-off. Otherwise figures that the tolerance has a rule for are
    judged by it, and the others together by the level. Raises UsageError where a group is empty or the runs
    have no figure or no age in common.
    """
    tolerance = tolerance or Tolerance()
    table = _align(a, b, tolerance)
    if _are_same(table):
        return Judgement("same", tuple(_rows_of_equals(table)), "every figure is equal, but for round-off")
    spreads, freedom, source = _spreads(table)
    rules = [tolerance.rule_of(figure) for figure in table.figures]
    free = np.array([rule is None for rule in rules])
    test = _test(table, spreads, free, freedom, source, tolerance.level)
    plain = _quantile(tolerance.level, freedom)
    rows = list(_rows(table, spreads, rules, plain, is_different=test.is_different))
    ruled = [row.is_beyond for row in rows if tolerance.rule_of(row.figure)]
    method = test.method
    if ruled:
        by_rules = f"of {len(ruled)} values with rules of the tolerance, {sum(ruled)} are beyond them"
        method = f"{method}; {by_rules}" if method else by_rules
    is_different = test.is_different or any(ruled)
    return Judgement("different" if is_different else "within noise", tuple(rows), method)


class _Table(NamedTuple):
    """Runs side by side: values (runs, figures, ages), those of the first group and then of the second."""

    figures: tuple[str, ...]
    ages: tuple[float, ...]
    values: NDArray[np.float64]
    length: NDArray[np.float64]  # (runs, ages), of cracks and outlines
    first: int  # runs of the first group
    faces: int | None  # of the coarsest film, where that is known

    @property
    def a(self) -> NDArray[np.float64]:
        return self.values[: self.first]

    @property
    def b(self) -> NDArray[np.float64]:
        return self.values[self.first :]


class _Test(NamedTuple):
    is_different: bool
    method: str


def _align(a: Sequence[RunFigures], b: Sequence[RunFigures], tolerance: Tolerance) -> _Table:
    if not a or not b:
        raise UsageError("there is no run to compare")
    runs = [*a, *b]
    figures = tuple(
        figure
        for figure in LAWS
        if all(figure in run.figures for run in runs) and not tolerance.is_omitted(figure)
    )
    ages = tuple(age for age in runs[0].ages if all(_place(age, run) is not None for run in runs[1:]))
    if not figures or not ages:
        what = "ages" if figures else "figures"
        remedy = (
            "record snapshots at the same ages" if figures else "omit fewer figures in the tolerance file"
        )
        raise UsageError(f"the runs have no {what} in common", remedy=remedy)
    places = [[_place(age, run) for age in ages] for run in runs]

    def take(figure: str) -> NDArray[np.float64]:
        return np.array(
            [[run.figures[figure][i or 0] for i in at] for run, at in zip(runs, places, strict=True)]
        )

    length = take("crack_length") + take("outline_length")
    values = np.stack([take(figure) for figure in figures], axis=1)
    faces = min((run.faces for run in runs if run.faces is not None), default=None)
    return _Table(figures, ages, values, length, len(a), faces)


def _place(age: float, run: RunFigures) -> int | None:
    """The number of the snapshot of a run at an age."""
    near = (i for i, other in enumerate(run.ages) if math.isclose(age, other, rel_tol=1e-9, abs_tol=1e-12))
    return next(near, None)


def _are_same(table: _Table) -> bool:
    """Whether each run of the smaller group has an equal of its own in the other."""
    few, many = sorted((table.a, table.b), key=len)
    left = list(many)
    for run in few:
        equal = next((i for i, other in enumerate(left) if _are_equal(run, other)), None)
        if equal is None:
            return False
        left.pop(equal)
    return True


def _are_equal(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    return bool(np.all(np.abs(one - other) <= _round_off(one, other)))


def _round_off(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """What values may differ by and be the same: figures of one kind are measured on one scale."""
    scale = np.maximum(np.abs(one), np.abs(other))
    return np.asarray(ROUND_OFF * scale)


def _spreads(table: _Table) -> tuple[NDArray[np.float64], float, str]:
    """The standard deviation between seeds of each figure at each age (figures, ages), its degrees of
    freedom, and in words where it is from.

    Within the groups where one has several runs; what is the same in all of them, and everything where
    each group is one run, has the spread that was measured elsewhere.
    """
    mean, length = table.values.mean(axis=0), table.length.mean(axis=0)
    shipped = np.stack(
        [
            expected_spread(figure, values, length, table.faces)
            for figure, values in zip(table.figures, mean, strict=True)
        ]
    )
    shipped = np.maximum(shipped, ROUND_OFF * np.abs(mean))
    freedom = len(table.values) - 2
    if freedom == 0:
        return shipped, math.inf, "the noise measured on other models, a rough judgement"
    own = np.sqrt(_squares_within(table.a, table.b) / freedom)
    return np.where(own > ROUND_OFF * np.abs(mean), own, shipped), freedom, "the noise within the groups"


def _squares_within(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """The sum over the runs of two groups of the squared distance to the mean of their group."""
    return ((a - a.mean(axis=0)) ** 2).sum(axis=0) + ((b - b.mean(axis=0)) ** 2).sum(axis=0)


def _test(
    table: _Table,
    spreads: NDArray[np.float64],
    free: NDArray[np.bool_],
    freedom: float,
    source: str,
    level: float,
) -> _Test:
    """Whether the figures that no rule is for differ by more than chance, all together."""
    if not free.any():
        return _Test(False, "")
    runs, first = len(table.values), table.first
    splits = math.comb(runs, first) // (2 if 2 * first == runs else 1)
    if splits * level >= 1.0:
        return _test_by_permutation(_scores(table)[:, free], first, splits, level)
    return _test_by_figures(table, spreads, free, freedom, source, level)


def _scores(table: _Table) -> NDArray[np.float64]:
    """One number for each figure of each run (runs, figures): the mean over the ages, each in units of the
    standard deviation over all runs; 0 for what is the same in all of them.
    """
    centered = table.values - table.values.mean(axis=0)
    deviation = centered.std(axis=0)
    varies = deviation > ROUND_OFF * np.abs(table.values).max(axis=0)
    return np.divide(centered, deviation, out=np.zeros_like(centered), where=varies).mean(axis=2)  # type: ignore[no-any-return]


def _test_by_permutation(scores: NDArray[np.float64], first: int, splits: int, level: float) -> _Test:
    """The sum over the figures of their variance between the groups by that within them, of the actual split
    of the runs among all.
    """
    runs = len(scores)
    total = (scores**2).sum(axis=0)
    scores = scores[:, total > 0.0] / np.sqrt(total[total > 0.0])
    groups = _all_splits(runs, first) if splits <= MOST_SPLITS else _some_splits(runs, first)
    between = (groups @ scores) ** 2 * (runs / (first * (runs - first)))
    statistic = (between / (1.0 - np.minimum(between, 1.0) + _LEAST_WITHIN)).sum(axis=1)
    p = float(np.mean(statistic >= statistic[0] * (1.0 - ROUND_OFF)))
    kind = "exact permutation test" if splits <= MOST_SPLITS else "permutation test"
    groups_of = f"{first} and {runs - first} runs"
    method = f"{kind} over {len(groups):,} splits of {groups_of}: p = {p:.2g}, level {level:g}"
    return _Test(p <= level, method)


def _all_splits(runs: int, first: int) -> NDArray[np.float64]:
    """Every way to choose the runs of the first group (splits, runs), 1 for those that are in it; the actual
    one is the first. Where the groups are of one size, one of each pair that exchanges them.
    """
    halves = 2 * first == runs
    chosen = itertools.combinations(range(1, runs), first - 1) if halves else itertools.combinations(
        range(runs), first
    )  # fmt: skip
    members = np.array([(0, *rest) if halves else rest for rest in chosen], np.intp).reshape(-1, first)
    groups = np.zeros((len(members), runs))
    groups[np.arange(len(members))[:, None], members] = 1.0
    return groups


def _some_splits(runs: int, first: int) -> NDArray[np.float64]:
    """The actual split, and others by chance, the same each time."""
    order = np.random.Generator(np.random.PCG64(runs)).random((MOST_SPLITS, runs)).argsort(axis=1)
    order[0] = np.arange(runs)
    return np.asarray(order < first, np.float64)


def _test_by_figures(
    table: _Table,
    spreads: NDArray[np.float64],
    free: NDArray[np.bool_],
    freedom: float,
    source: str,
    level: float,
) -> _Test:
    """The figure whose mean over the ages is farthest from that of the other group."""
    units = np.where(spreads > 0.0, spreads, np.inf)
    scores = (table.values / units).mean(axis=2)
    deviation = np.array([expected_spread_of_mean(figure) for figure in table.figures])
    if not math.isinf(freedom):
        own = _scores(table)
        squares = _squares_within(own[: table.first], own[table.first :])
        varies = squares > ROUND_OFF  # in units of the spread over all runs
        scores, deviation = (
            np.where(varies, own, scores),
            np.where(varies, np.sqrt(squares / freedom), deviation),
        )
    a, b = scores[: table.first], scores[table.first :]
    distance = np.abs(b.mean(axis=0) - a.mean(axis=0)) / (deviation * math.sqrt(1 / len(a) + 1 / len(b)))
    distance = np.where(free, distance, 0.0)
    limit = _quantile(level / int(free.sum()), freedom)
    worst = int(distance.argmax())
    kind = (
        "normal distribution"
        if math.isinf(freedom)
        else f"t distribution with {freedom:g} degrees of freedom"
    )
    method = (
        f"{int(free.sum())} figures by {source}, {kind}: {table.figures[worst]} is farthest apart,"
        f" {distance[worst]:.1f} standard deviations where {limit:.1f} are allowed at level {level:g}"
    )
    return _Test(bool(distance[worst] > limit), method)


def _quantile(level: float, freedom: float) -> float:
    """How many standard deviations lie between a value and its mean in no more cases than `level`."""
    from scipy.stats import norm, t

    return float(norm.isf(level / 2) if math.isinf(freedom) else t.isf(level / 2, freedom))


def _rows_of_equals(table: _Table) -> list[Difference]:
    a, b = table.a.mean(axis=0), table.b.mean(axis=0)
    if len(table.a) != len(table.b):  # one group is a part of the other
        a = b = (table.a if len(table.a) < len(table.b) else table.b).mean(axis=0)
    return [
        Difference(
            figure, age, float(a[i, j]), float(b[i, j]), float(b[i, j] - a[i, j]), 0.0,
            ROUND_OFF * float(max(abs(a[i, j]), abs(b[i, j]))), False,
        )
        for i, figure in enumerate(table.figures)
        for j, age in enumerate(table.ages)
    ]  # fmt: skip


def _rows(
    table: _Table,
    spreads: NDArray[np.float64],
    rules: Sequence[Rule | None],
    plain: float,
    *,
    is_different: bool,
) -> list[Difference]:
    a, b = table.a.mean(axis=0), table.b.mean(axis=0)
    of_means = spreads * math.sqrt(1 / len(table.a) + 1 / len(table.b))
    rows = []
    for i, (figure, rule) in enumerate(zip(table.figures, rules, strict=True)):
        for j, age in enumerate(table.ages):
            ours, theirs, spread = float(a[i, j]), float(b[i, j]), float(of_means[i, j])
            allowed = plain * spread if rule is None else rule.allowed(ours, theirs, spread)
            has_say = is_different or rule is not None
            is_beyond = has_say and abs(theirs - ours) > allowed
            rows.append(Difference(figure, age, ours, theirs, theirs - ours, spread, allowed, is_beyond))
    return rows
