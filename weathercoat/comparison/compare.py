"""Two runs, or two groups of runs, held against each other: whether they are the same, and how far apart."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from weathercoat.comparison.baseline import is_baseline, pair_with_baseline
from weathercoat.comparison.geometry import GeometryDifference, compare_snapshots
from weathercoat.comparison.images import PictureDifference, compare_pictures, read_pictures
from weathercoat.comparison.judgement import Judgement, judge
from weathercoat.comparison.sides import Run, are_identical, config_differences, find_runs, pair_up
from weathercoat.comparison.statistics import RunFigures, measure_run
from weathercoat.comparison.tolerance import Tolerance
from weathercoat.errors import WeathercoatError
from weathercoat.output.folder import SNAPSHOTS, snapshot_stem
from weathercoat.output.snapshots import read_snapshot_ply
from weathercoat.verification.findings import Finding
from weathercoat.verification.run import verify_run

Verdict = Literal["same", "within noise", "different", "corrupt"]
VERDICTS: tuple[Verdict, ...] = ("same", "within noise", "different", "corrupt")  # from good to bad
_SAME_AGE = 1e-9  # relative


@dataclass(frozen=True)
class Pair:
    """How the geometry and the pictures of one run of each side differ, by age; and in words what could not
    be compared.
    """

    a: Run
    b: Run
    geometry: tuple[GeometryDifference, ...]
    pictures: tuple[PictureDifference, ...]
    missing: tuple[str, ...]

    def beyond(self, tolerance: Tolerance) -> Iterator[str]:
        """What differs by more than is let pass, a sentence each."""
        positions = max((g.positions_mean or 0.0 for g in self.geometry), default=0.0)
        distances = max((g.distance_mean or 0.0 for g in self.geometry), default=0.0)
        pictures = max((p.flip for p in self.pictures), default=0.0)
        for name, found, allowed in (
            ("mean distance of positions", positions, tolerance.positions),
            ("mean distance of films", distances, tolerance.distances),
            ("mean difference of pictures", pictures, tolerance.pictures),
        ):
            if found > allowed:
                yield f"{self.a.name}: {name} {found:.4g}, allowed {allowed:.4g}"


@dataclass(frozen=True)
class Group:
    """Runs of both sides that were judged together."""

    title: str
    a: tuple[RunFigures, ...]
    b: tuple[RunFigures, ...]
    judgement: Judgement
    pairs: tuple[Pair, ...]


@dataclass(frozen=True)
class Side:
    """One side of a comparison: what was given, the runs in it, and what is wrong with each, by its name."""

    path: Path
    runs: tuple[Run, ...]
    findings: Mapping[str, tuple[Finding, ...]] = field(default_factory=dict)

    def findings_by_prefix(self) -> Iterator[tuple[str, tuple[Finding, ...]]]:
        """The findings of each run, and what is before the names of its files in what was given."""
        for name, findings in self.findings.items():
            yield (f"{name}/" if len(self.runs) > 1 else ""), findings


@dataclass(frozen=True)
class Comparison:
    """A verdict and all that it rests on.

    method: how it was reached, in a sentence; configs: keys whose values differ, with the values as JSON,
    which have no say; groups: none where the sides are the same bytes, or one is corrupt; beyond: geometry
    and pictures that differ by more than the tolerance.
    """

    verdict: Verdict
    method: str
    a: Side
    b: Side
    tolerance: Tolerance
    configs: Mapping[str, tuple[str, str]]
    groups: tuple[Group, ...] = ()
    beyond: tuple[str, ...] = ()

    @property
    def passes(self) -> bool:
        """Whether the verdict is one that lets a change through."""
        return self.verdict in ("same", "within noise")


def compare(a: Path | str, b: Path | str, tolerance: Tolerance | None = None) -> Comparison:
    """Compare two runs, two folders of runs, or either of them with a baseline.

    Runs whose files are the same bytes are the same. A run that `verify` finds fault with makes its side
    corrupt. Else the figures decide, as `judgement.judge` does, and geometry and pictures where the tolerance
    bounds them. Of several runs on each side those with the same seed are paired, or else in their order;
    their pictures are compared at the last age alone.

    Raises AccessError where a folder holds no run, and what reading its files raises.
    """
    tolerance = tolerance or Tolerance()
    if is_baseline(a) or is_baseline(b):
        return _compare_with_baseline(a, b, tolerance)
    sides = Side(Path(a), find_runs(a)), Side(Path(b), find_runs(b))
    runs = sides[0].runs, sides[1].runs
    if are_identical(*runs):
        return Comparison("same", "every file of both sides has the same bytes.", *sides, tolerance, {})
    configs = config_differences(*runs)
    sides = _verified(sides[0]), _verified(sides[1])
    count = sum(len(found) for side in sides for found in side.findings.values())
    if count:
        method = f"verification finds {count:,} fault{'s' * (count > 1)}, and nothing else was compared."
        return Comparison("corrupt", method, *sides, tolerance, configs)
    is_single = len(runs[0]) == len(runs[1]) == 1
    groups = tuple(
        _compare_group(title, *found, tolerance, is_single) for title, found in pair_up(*runs).items()
    )
    beyond = tuple(message for group in groups for pair in group.pairs for message in pair.beyond(tolerance))
    verdict = max((_verdict(group) for group in groups), key=VERDICTS.index)
    worst = next(group for group in groups if _verdict(group) == verdict)
    method = worst.judgement.method
    if beyond:
        verdict = "different"
        method += f" Beyond the tolerance: {'; '.join(beyond)}."
    return Comparison(verdict, method, *sides, tolerance, configs, groups, beyond)


def _compare_with_baseline(a: Path | str, b: Path | str, tolerance: Tolerance) -> Comparison:
    """Judge figures alone, model by model: a baseline keeps no meshes."""
    groups = tuple(
        Group(title, *figures, judge(*figures, tolerance), ())
        for title, figures in pair_with_baseline(a, b).items()
    )
    worst = max(groups, key=lambda group: VERDICTS.index(group.judgement.verdict)).judgement
    sides = Side(Path(a), ()), Side(Path(b), ())
    return Comparison(worst.verdict, worst.method, *sides, tolerance, {}, groups)


def _verified(side: Side) -> Side:
    found = {run.name: verify_run(run.folder).findings for run in side.runs}
    return Side(side.path, side.runs, {name: findings for name, findings in found.items() if findings})


def _verdict(group: Group) -> Verdict:
    """What the figures say; runs whose films differ are never the same."""
    is_same = all(difference.is_none for pair in group.pairs for difference in pair.geometry)
    return "within noise" if group.judgement.verdict == "same" and not is_same else group.judgement.verdict


def _compare_group(
    title: str, a: Sequence[Run], b: Sequence[Run], tolerance: Tolerance, every_picture: bool
) -> Group:
    first, second = (tuple(measure_run(run.folder) for run in runs) for runs in (a, b))
    pairs = tuple(_compare_pair(*pair, every_picture) for pair in _by_seed(a, b))
    return Group(title, first, second, judge(first, second, tolerance), pairs)


def _by_seed(a: Sequence[Run], b: Sequence[Run]) -> list[tuple[Run, Run]]:
    """Runs of the same seed together, where both sides have the same seeds; else those in the same place."""
    sides = [sorted(runs, key=lambda run: (run.seed or 0, run.name)) for runs in (a, b)]
    if [run.seed for run in sides[0]] != [run.seed for run in sides[1]]:
        sides = [list(a), list(b)]
    return list(zip(*sides, strict=False))


def _compare_pair(a: Run, b: Run, every_picture: bool) -> Pair:
    missing: list[str] = []
    geometry = tuple(_compare_geometry(a, b))
    if not geometry:
        missing.append("geometry: there are no PLY snapshots of the same age on both sides")
    try:
        pictures = tuple(_compare_pictures(a, b, every_picture))
        if not pictures:
            missing.append("pictures: there are none of the same age on both sides")
    except (ValueError, WeathercoatError) as error:
        pictures = ()
        missing.append(f"pictures: {error}")
    return Pair(a, b, geometry, pictures, tuple(missing))


def _compare_geometry(a: Run, b: Run) -> Iterator[GeometryDifference]:
    files = [_snapshot_files(run) for run in (a, b)]
    for first, second in _same_ages(*files):
        pair = files[0][first], files[1][second]
        yield compare_snapshots(*(read_snapshot_ply(file) for file in pair))


def _snapshot_files(run: Run) -> dict[float, Path]:
    """The PLY snapshots of a run by age."""
    steps = run.report["config"]["ageing"]["steps"]
    found = {}
    for row in run.report["snapshots"]:
        name = f"{SNAPSHOTS}/{snapshot_stem(row['step'], steps)}.ply"
        if name in run.report["files"]:
            found[float(row["age"])] = run.folder / name
    return found


def _compare_pictures(a: Run, b: Run, every_picture: bool) -> Iterator[PictureDifference]:
    images = [read_pictures(run) for run in (a, b)]
    ages = list(_same_ages(*images))
    for first, second in ages if every_picture else ages[-1:]:
        yield compare_pictures(images[0][first], images[1][second], first)


def _same_ages(a: Mapping[float, Any], b: Mapping[float, Any]) -> Iterator[tuple[float, float]]:
    for age in a:
        other = next((found for found in b if abs(found - age) <= _SAME_AGE * abs(age)), None)
        if other is not None:
            yield age, other
