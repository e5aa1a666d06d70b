"""Recording baselines, and running again what they hold to judge it against them."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from weathercoat.batch.batch import Listener, run_batch
from weathercoat.batch.job import Executor, Job, Task
from weathercoat.batch.names import Named, check_names, model_name
from weathercoat.comparison.baseline import (
    BASELINE,
    Baseline,
    GoldenModel,
    GoldenRun,
    changed_kind,
    describe_kind,
)
from weathercoat.comparison.judgement import Judgement, judge
from weathercoat.comparison.statistics import measure_run, read_report
from weathercoat.comparison.tolerance import Tolerance
from weathercoat.config.load import load_config
from weathercoat.config.presets import preset_names
from weathercoat.config.schema import Config
from weathercoat.errors import BatchError
from weathercoat.output.folder import SNAPSHOTS, RunFolder
from weathercoat.output.report import versions, write_json
from weathercoat.output.snapshots import read_snapshot_ply

SEEDS = 5
_PICTURE_WIDTH = 320  # pixels
_PICTURE_QUALITY = 80
_COPIED_CONFIG = "config.yaml"
# What a run of a baseline writes: data to measure, and nothing that takes longer than the run.
_LEAN = ("output.formats=[ply]", "output.preview=false", "checkpoint.keep=false")


@dataclass(frozen=True)
class Check:
    """How runs of one model compare with a baseline's.

    differing: by a run's name the files whose bytes are others, where bytes were asked for. notes: what else
    has changed, in words. is_passed: bytes where they were asked for, else the verdict.
    """

    name: str
    judgement: Judgement
    differing: dict[str, tuple[str, ...]]
    notes: tuple[str, ...]
    is_passed: bool


def record_baseline(
    out: Path | str,
    models: Sequence[str],
    executor: Executor,
    *,
    config: str = "standard",
    assignments: Sequence[str] = (),
    seeds: int = SEEDS,
    keep_snapshots: bool = False,
    overwrite: bool = False,
    begin: Callable[[Sequence[Task]], None] | None = None,
    listen: Listener | None = None,
) -> Baseline:
    """Age each model with the seeds from the config's own on, and keep what the runs came to in the folder
    `out`, which appears when it is whole.

    config: a file, which is copied into the baseline, or the name of a shipped one. keep_snapshots: the last
    snapshot of each run too. overwrite: replaces a baseline that is there. begin, listen: see
    `batch.run_batch`. Raises ConfigError, UsageError for models of one name, BatchError where a run failed,
    and what `RunFolder` raises.
    """
    names = [model_name(model) for model in models]
    check_names(Named(name, model, "MODEL") for name, model in zip(names, models, strict=True))
    first = load_config(config, assignments).config.seed
    is_file = not (config in preset_names() and not os.path.isfile(config))  # noqa: PTH113
    folder = RunFolder(out, overwrite=overwrite, marker=BASELINE)
    with folder as working, tempfile.TemporaryDirectory() as temporary:
        runs = Path(temporary)
        chosen = list(range(first, first + seeds))
        wanted = [(name, model, chosen) for name, model in zip(names, models, strict=True)]
        _run(wanted, config, assignments, runs, executor, begin, listen)
        found = []
        for name, model, _ in wanted:
            path = _relative(model, folder.target)
            found.append(_golden_model(name, path, [(seed, runs / _run_name(name, seed)) for seed in chosen]))
            _draw_last(runs / _run_name(name, first), working / f"{name}.jpg")
            if keep_snapshots:
                for seed in chosen:
                    last = _last_snapshot(runs / _run_name(name, seed))
                    (working / SNAPSHOTS).mkdir(exist_ok=True)
                    shutil.copyfile(last, working / SNAPSHOTS / f"{name}-{seed}.ply")
        if is_file:
            shutil.copyfile(config, working / _COPIED_CONFIG)
        baseline = Baseline(
            _COPIED_CONFIG if is_file else config,
            tuple(assignments),
            versions(),
            describe_kind(),
            tuple(found),
        )
        write_json(working / BASELINE, baseline.as_dict())
    return baseline


def check_baseline(
    baseline: Baseline,
    folder: Path | str,
    executor: Executor,
    *,
    seeds: int | None = None,
    exact: bool = False,
    tolerance: Tolerance | None = None,
    assignments: Sequence[str] = (),
    begin: Callable[[Sequence[Task]], None] | None = None,
    listen: Listener | None = None,
) -> list[Check]:
    """Run each model of the baseline in `folder` again with the seeds that it holds, and judge the runs
    against it.

    seeds: how many to run instead, further ones where the baseline has fewer. exact: by the bytes of the
    files, for which seeds that it does not hold do not count. assignments: come
    after the baseline's own. The tolerance's level is that of all models together. Raises BatchError where a
    run failed.
    """
    folder, tolerance = Path(folder), tolerance or Tolerance()
    source = folder / baseline.config
    config = str(source) if source.is_file() else baseline.config
    with tempfile.TemporaryDirectory() as temporary:
        runs = Path(temporary)
        wanted = [
            (model.name, str(folder / model.model), list(_seeds_to_check(model, seeds)))
            for model in baseline.models
        ]
        changes = [*baseline.assignments, *assignments]
        _run(wanted, config, changes, runs, executor, begin, listen)
        shared = replace(tolerance, level=tolerance.level / len(baseline.models))
        return [
            _check(baseline, model, _golden_model(
                name, path, [(seed, runs / _run_name(name, seed)) for seed in chosen]
            ), shared, exact=exact)
            for model, (name, path, chosen) in zip(baseline.models, wanted, strict=True)
        ]  # fmt: skip


def _check(
    baseline: Baseline, then: GoldenModel, now: GoldenModel, tolerance: Tolerance, *, exact: bool
) -> Check:
    judgement = judge(then.figures, now.figures, tolerance)
    notes = []
    if set(then.inputs.values()) != set(now.inputs.values()):
        notes.append("the model's file has changed")
    differing = {}
    if exact:
        known = {run.seed: run for run in then.runs}
        for run in now.runs:
            files = known[run.seed].files if run.seed in known else run.files
            names = sorted(files.keys() | run.files.keys())
            other = tuple(name for name in names if files.get(name) != run.files.get(name))
            if other:
                differing[run.figures.name] = other
        notes += changed_kind(baseline) if differing else ()
    is_passed = not differing if exact else judgement.verdict != "different"
    return Check(then.name, judgement, differing, tuple(notes), is_passed)


def _seeds_to_check(model: GoldenModel, count: int | None) -> Iterator[int]:
    known = [run.seed for run in model.runs]
    count = count or len(known)
    further = range(max(known) + 1, max(known) + 1 + count)
    yield from [*known, *further][:count]


def _run(
    wanted: Sequence[tuple[str, str, Sequence[int]]],
    config: str,
    assignments: Sequence[str],
    out: Path,
    executor: Executor,
    begin: Callable[[Sequence[Task]], None] | None,
    listen: Listener | None,
) -> None:
    """Run models, given by name and path, each with its seeds."""
    jobs = [
        Job(_run_name(name, seed), model, load_config(config, [*assignments, *_LEAN, f"seed={seed}"]))
        for name, model, seeds in wanted
        for seed in seeds
    ]
    record = run_batch(jobs, out, executor, begin=begin, listen=listen)
    failed = [row for row in record["jobs"] if row["status"] == "failed"]
    if failed:
        error = failed[0]["error"]
        what = f"{len(failed)} of {len(jobs)} runs failed: {error['code']}: {error['message']}"
        raise BatchError(what, file=failed[0]["asset"], remedy=error["remedy"])


def _run_name(name: str, seed: int) -> str:
    return f"{name}/seed-{seed}"


def _golden_model(name: str, path: str, runs: Sequence[tuple[int, Path]]) -> GoldenModel:
    golden = []
    inputs: dict[str, str] = {}
    for seed, folder in runs:
        report = read_report(folder)
        inputs = {file: entry["sha256"] for file, entry in report["inputs"].items()}
        figures = replace(measure_run(folder), name=f"{name}/{folder.name}")
        golden.append(GoldenRun(seed, figures, report["fingerprint"], report["files"]))
    return GoldenModel(name, path, inputs, tuple(golden))


def _relative(model: str, folder: Path) -> str:
    """The path of a model as a baseline keeps it: with slashes, and from its folder where both share a
    drive.
    """
    try:
        return Path(os.path.relpath(model, folder)).as_posix()
    except ValueError:
        return Path(model).absolute().as_posix()


def _last_snapshot(run: Path) -> Path:
    return max((run / SNAPSHOTS).glob("*.ply"))


def _draw_last(run: Path, target: Path) -> None:
    """A small picture of a run's last snapshot."""
    from PIL import Image

    from weathercoat.output.pictures import render_snapshot
    from weathercoat.recording import picture_parameters

    report: dict[str, Any] = read_report(run)
    parameters = picture_parameters(Config.model_validate(report["config"]))
    height = max(1, round(_PICTURE_WIDTH * parameters.height / parameters.width))
    x, y, z = report["meshes"]["input"]["up"]
    picture = render_snapshot(
        read_snapshot_ply(_last_snapshot(run)),
        replace(parameters, width=_PICTURE_WIDTH, height=height),
        up=(x, y, z),
    )
    target.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(picture).save(target, quality=_PICTURE_QUALITY)
