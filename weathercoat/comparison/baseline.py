"""Baselines: what runs came to, kept without their meshes, so that later ones are judged against them.

A baseline is a folder: `baseline.json`, a small picture of each model, the config where it is a file of the
user's, and on request the last snapshots. The form of `baseline.json` is described in docs/regression.md.
"""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from weathercoat.batch.names import PARTIAL
from weathercoat.comparison.statistics import RunFigures, measure_run, read_report
from weathercoat.errors import AccessError, CorruptError, UsageError
from weathercoat.output.folder import REPORT
from weathercoat.output.report import SIGNIFICANT_DIGITS, versions

BASELINE = "baseline.json"
BASELINE_VERSION = 1
_GIVE = "give a folder that `weathercoat baseline record` wrote"
_AGAIN = "record it again"


@dataclass(frozen=True)
class GoldenRun:
    """What one run came to: its figures, and what tells its bytes: the fingerprint of `run.json` (config,
    input and versions) and SHA-256 by file name.
    """

    seed: int
    figures: RunFigures
    fingerprint: str
    files: Mapping[str, str]


@dataclass(frozen=True)
class GoldenModel:
    """The runs of one model, a seed each.

    model: its path, relative to the baseline's folder where that is possible; inputs: SHA-256 by file name.
    """

    name: str
    model: str
    inputs: Mapping[str, str]
    runs: tuple[GoldenRun, ...]

    @property
    def figures(self) -> tuple[RunFigures, ...]:
        """The figures of all runs."""
        return tuple(run.figures for run in self.runs)


@dataclass(frozen=True)
class Baseline:
    """What runs of several models with several seeds came to.

    config: the name of a shipped one, or a file in the baseline's folder; assignments: `key=value` each,
    which come after it. versions, machine: what the runs were made with and on.
    """

    config: str
    assignments: tuple[str, ...]
    versions: Mapping[str, str]
    machine: Mapping[str, str]
    models: tuple[GoldenModel, ...]

    def model_of(self, inputs: Mapping[str, str]) -> GoldenModel | None:
        """The model whose file has this content, or else this name, or else the only one; `inputs` is SHA-256
        by file name, as in `run.json`.
        """
        for model in self.models:
            if set(model.inputs.values()) == set(inputs.values()):
                return model
        for model in self.models:
            if set(model.inputs) == set(inputs):
                return model
        return self.models[0] if len(self.models) == 1 else None

    def as_dict(self) -> dict[str, Any]:
        """The content of `baseline.json`."""
        return {
            "baseline_version": BASELINE_VERSION,
            "config": {"source": self.config, "set": list(self.assignments)},
            "versions": dict(self.versions),
            "machine": dict(self.machine),
            "models": [_model_as_dict(model) for model in self.models],
        }


def is_baseline(path: Path | str) -> bool:
    """Whether a path is that of a baseline's folder, or of its `baseline.json`."""
    return os.path.isfile(_file_of(path))  # noqa: PTH113 (any text will do)


def read_baseline(path: Path | str) -> Baseline:
    """The baseline in a folder. Raises AccessError where there is none, CorruptError where it is broken."""
    file = _file_of(path)
    try:
        content = json.loads(file.read_bytes())
    except OSError as error:
        reason = f"{BASELINE}: {error.strerror or error}"
        raise AccessError(reason, file=str(path), remedy=_GIVE) from error
    except ValueError as error:
        raise CorruptError("is no JSON", file=str(file), remedy=_AGAIN) from error
    try:
        version = content["baseline_version"]
        if version != BASELINE_VERSION:
            what = f"is of version {version}, and {BASELINE_VERSION} is known"
            raise CorruptError(what, file=str(file), remedy=_AGAIN)
        baseline = Baseline(
            str(content["config"]["source"]),
            tuple(map(str, content["config"]["set"])),
            dict(content["versions"]),
            dict(content["machine"]),
            tuple(_read_model(model) for model in content["models"]),
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        what = f"is no baseline: {type(error).__name__} {error}"
        raise CorruptError(what, file=str(file), remedy=_AGAIN) from error
    if not baseline.models or not all(model.runs for model in baseline.models):
        raise CorruptError("holds no runs", file=str(file), remedy=_AGAIN)
    return baseline


def pair_with_baseline(
    a: Path | str, b: Path | str
) -> dict[str, tuple[tuple[RunFigures, ...], tuple[RunFigures, ...]]]:
    """The runs of two sides, of which one at least is a baseline, by the models of that one.

    The other is a baseline too, the folder of a run, or one with several of them at any depth. Raises
    UsageError for runs of models that the baseline does not hold, AccessError where there are none, and what
    `measure_run` raises.
    """
    is_second = is_baseline(b)
    golden, other = (read_baseline(b), a) if is_second else (read_baseline(a), b)
    found: dict[str, list[RunFigures]] = {}
    for name, inputs, figures in _runs_in(other):
        model = golden.model_of(inputs)
        if model is None:
            known = ", ".join(model.name for model in golden.models)
            what = f"{name} is a run of {', '.join(inputs)}, and the baseline has {known}"
            raise UsageError(what, remedy="compare runs of the same models")
        found.setdefault(model.name, []).append(figures)
    pairs = {
        model.name: (tuple(found[model.name]), model.figures)
        for model in golden.models
        if model.name in found
    }
    return pairs if is_second else {name: (theirs, ours) for name, (ours, theirs) in pairs.items()}


def _runs_in(path: Path | str) -> Iterator[tuple[str, dict[str, str], RunFigures]]:
    """Each run of a side: its name, SHA-256 of its inputs by file name, and its figures."""
    if is_baseline(path):
        for model in read_baseline(path).models:
            yield from ((run.figures.name, dict(model.inputs), run.figures) for run in model.runs)
        return
    folder = Path(path)
    folders = sorted(file.parent for file in folder.rglob(REPORT) if not file.parent.name.endswith(PARTIAL))
    if not folders:
        reason = f"there is no {REPORT} in it or in its folders"
        raise AccessError(reason, file=str(path), remedy="give the folder of a finished run, or of several")
    for run in folders:
        inputs = {name: str(entry["sha256"]) for name, entry in read_report(run)["inputs"].items()}
        yield run.name, inputs, measure_run(run)


def describe_kind() -> dict[str, str]:
    """What results hang on to the last bit, beside versions: system, architecture, and kind of processor."""
    from llvmlite.binding import get_host_cpu_name

    return {
        "system": platform.system(),
        "architecture": platform.machine(),
        "processor": get_host_cpu_name(),
    }


def changed_kind(baseline: Baseline) -> Iterator[str]:
    """In words, each reason for which this machine may not give the bytes of a baseline."""
    for then, now in ((baseline.machine, describe_kind()), (baseline.versions, versions())):
        for name in sorted(then.keys() | now.keys()):
            if then.get(name) != now.get(name):
                yield f"{name} {then.get(name)} then, {now.get(name)} now"


def _file_of(path: Path | str) -> Path:
    path = Path(path)
    return path if path.name == BASELINE else path / BASELINE


def _model_as_dict(model: GoldenModel) -> dict[str, Any]:
    ages = model.runs[0].figures.ages
    values = {
        figure: np.array([run.figures.figures[figure] for run in model.runs])
        for figure in model.runs[0].figures.figures
    }
    freedom = 1 if len(model.runs) > 1 else 0
    return {
        "name": model.name,
        "model": model.model,
        "inputs": dict(model.inputs),
        "ages": list(ages),
        "mean": {figure: _rounded(found.mean(axis=0)) for figure, found in values.items()},
        "spread": {figure: _rounded(found.std(axis=0, ddof=freedom)) for figure, found in values.items()},
        "runs": [
            {
                "seed": run.seed,
                "fingerprint": run.fingerprint,
                "files": dict(run.files),
                "figures": {figure: _rounded(found) for figure, found in run.figures.figures.items()},
            }
            for run in model.runs
        ],
    }


def _read_model(content: Mapping[str, Any]) -> GoldenModel:
    name, ages = str(content["name"]), tuple(map(float, content["ages"]))
    runs = []
    for run in content["runs"]:
        figures = {figure: tuple(map(float, values)) for figure, values in run["figures"].items()}
        if not all(len(values) == len(ages) for values in figures.values()):
            raise ValueError(f"{name} has figures without an age")
        seed = int(run["seed"])
        found = RunFigures(f"{name}/seed-{seed}", ages, figures)
        runs.append(GoldenRun(seed, found, str(run["fingerprint"]), dict(run["files"])))
    return GoldenModel(name, str(content["model"]), dict(content["inputs"]), tuple(runs))


def _rounded(values: Any) -> list[float]:
    """Numbers to as many digits as other figures of reports have."""
    return [float(f"{value:.{SIGNIFICANT_DIGITS}g}") for value in values]
