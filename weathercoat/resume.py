"""Going on from what an earlier run left: whether that is the run that is asked for, and what of it stays.

A run goes on from the checkpoint of one that was interrupted, or from the last state of one that has ended.
Its results are those of a run at once, byte for byte. So config and input have to be the same, but that more
steps of the same age, other snapshots and other checkpoints may be asked for; where a snapshot is wanted that
the earlier run has passed without recording it, the run begins again.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

from weathercoat.config.load import LoadedConfig
from weathercoat.config.schema import Config
from weathercoat.errors import ResumeError
from weathercoat.lock import LOCK
from weathercoat.output.checkpoints import SURFACE, Checkpoint, broken, read_checkpoint
from weathercoat.output.folder import (
    CHECKPOINT,
    CHECKPOINT_STATE,
    REPORT,
    SNAPSHOTS,
    RunFolder,
    snapshot_stem,
)
from weathercoat.output.report import sha256, versions
from weathercoat.target import target

_FREE = (
    "ageing.steps",
    "ageing.duration",
    "ageing.until",
    "snapshots.",
    "checkpoint.",
)  # keys that may differ


def identify(config: Config, inputs: Mapping[str, str]) -> dict[str, Any]:
    """What tells a run from others, as checkpoints keep it: config, SHA-256 of inputs by file name, and the
    target, where one is pinned.
    """
    pinned = target()
    about = {"target": pinned} if pinned else {}
    return {"config": config.as_dict(), "inputs": dict(inputs), **about}


def fingerprint(loaded: LoadedConfig, inputs: Mapping[str, str]) -> str:
    """A hash of all that the results of a run hang on: the config as it is before a quality has chosen,
    SHA-256 of the inputs by file name, and versions.
    """
    config = loaded.config
    fixed = [] if config.quality is None else sorted(loaded.fixed)  # what the quality may not change
    content = {"config": config.as_dict(), "fixed": fixed, "inputs": dict(inputs), "versions": versions()}
    return sha256(json.dumps(content, sort_keys=True).encode("utf-8", "backslashreplace"))


def read_finished(folder: Path, identity: Mapping[str, Any]) -> dict[str, Any] | None:
    """The report of a finished run in a folder, where it is the run that is asked for; else None."""
    report = _read_report(folder)
    if report is None or list(_differences(_identity_of(report), identity)):
        return None
    return None if missing_files(folder, report) else report


def missing_files(folder: Path, report: Mapping[str, Any]) -> list[str]:
    """The files that a `run.json` lists and that are not in its folder."""
    return [name for name in report.get("files", ()) if not (folder / name).is_file()]


def take_up(
    folder: RunFolder, config: Config, identity: Mapping[str, Any], say: Callable[[str], None]
) -> Checkpoint | None:
    """The checkpoint from which the run of a config and its identity goes on; the working folder then holds
    what has been recorded until there.

    None, and an empty working folder, where the run has to begin at the start. Raises ResumeError where what
    is there is of another run, and CorruptError where its checkpoint is broken.
    """
    for place in (folder.path, folder.target):
        checkpoint = read_checkpoint(place)
        report = None if checkpoint else _read_report(place)
        if checkpoint is None and report is None:
            continue
        found = checkpoint.about if checkpoint else _identity_of(report or {})
        _check_same(found, identity, str(place))
        if checkpoint is None:
            say(f"{place}: keeps no checkpoint, so the run begins again")
            break
        missing = missing_files(place, _read_report(place) or {})
        if missing:
            say(f"{place}: {missing[0]} is missing, so the run begins again")
            break
        passed = _passed_snapshots(checkpoint, config)
        if passed:
            say(
                f"{place}: has no snapshot of step {passed[0]}, so the run begins again; "
                "snapshots.steps can name others"
            )
            break
        if checkpoint.step > config.ageing.steps:
            what = f"the run has reached step {checkpoint.step}, and ageing.steps is {config.ageing.steps}"
            raise ResumeError(what, file=str(place))
        if place == folder.target:
            folder.clear()
            for name in (SNAPSHOTS, CHECKPOINT):
                if (place / name).is_dir():
                    shutil.copytree(place / name, folder.path / name)
        _keep_recorded(folder.path, checkpoint, config)
        return checkpoint
    folder.clear()
    return None


def is_past(checkpoint: Checkpoint, config: Config, reached: str | None) -> bool:
    """Whether the state of a checkpoint has `reached` a limit of `ageing.until` that its run did not stop at,
    so that the first step at which it is reached is not known.
    """
    before = checkpoint.about["config"]["ageing"].get("until", [])
    return reached is not None and list(config.ageing.until) != before


def recorded_figures(checkpoint: Checkpoint, config: Config) -> list[dict[str, Any]]:
    """The figures of the snapshots that have been recorded and still are wanted."""
    due = config.snapshots.due(config.ageing.steps)
    try:
        return [figures for figures in checkpoint.about["snapshots"] if figures["step"] in due]
    except (KeyError, TypeError) as error:
        raise broken(Path(CHECKPOINT)) from error


def _identity_of(report: Mapping[str, Any]) -> dict[str, Any]:
    """The identity of the run of a `run.json`."""
    inputs = {name: entry["sha256"] for name, entry in report.get("inputs", {}).items()}
    pinned = report.get("versions", {}).get("target")
    return {"config": report.get("config", {}), "inputs": inputs, **({"target": pinned} if pinned else {})}


def _read_report(folder: Path) -> dict[str, Any] | None:
    path = folder / REPORT
    if not path.is_file():
        return None
    try:
        report = json.loads(path.read_bytes())
        if not isinstance(report, dict):
            raise ValueError("no object")
        _identity_of(report)
    except (OSError, ValueError, AttributeError, KeyError, TypeError) as error:
        raise broken(path) from error
    return report


def _check_same(found: Mapping[str, Any], wanted: Mapping[str, Any], place: str) -> None:
    changed = [(key, old, new) for key, old, new in _differences(found, wanted) if not key.startswith(_FREE)]
    then, now = _tick(found["config"]), _tick(wanted["config"])
    if then != now:
        changed.append(("ageing.duration / ageing.steps", then, now))
    if changed:
        what = ", ".join(f"{key} is {new}, and was {old}" for key, old, new in changed[:5])
        more = f" and {len(changed) - 5} more" if len(changed) > 5 else ""
        raise ResumeError(f"it is another run: {what}{more}", file=place)


def _tick(config: Mapping[str, Any]) -> Fraction | None:
    """The age of a step, exactly."""
    try:
        return Fraction(str(config["ageing"]["duration"])) / config["ageing"]["steps"]
    except (KeyError, TypeError, ValueError, ZeroDivisionError):
        return None


def _differences(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[tuple[str, Any, Any]]:
    """What differs between two identities: a key of the config or an input, its old value and the new one."""
    old_values, new_values = dict(_flat(old["config"])), dict(_flat(new["config"]))
    for key in sorted(old_values.keys() | new_values.keys()):
        before, now = old_values.get(key, "missing"), new_values.get(key, "missing")
        if before != now:
            yield key, before, now
    if old["inputs"] != new["inputs"]:
        for name in sorted(old["inputs"].keys() | new["inputs"].keys()):
            before, now = ((side["inputs"].get(name) or "missing")[:12] for side in (old, new))
            if before != now:
                yield f"input {name}", before, now
    before, now = (side.get("target", "the processor at hand") for side in (old, new))
    if before != now:
        yield "the target", before, now


def _flat(config: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in config.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield prefix + key, value


def _passed_snapshots(checkpoint: Checkpoint, config: Config) -> list[int]:
    """The steps whose snapshots are wanted, and that were passed without one."""
    recorded = {figures["step"] for figures in recorded_figures(checkpoint, config)}
    due = config.snapshots.due(config.ageing.steps)
    return [step for step in due if step <= checkpoint.step and step not in recorded]


def _keep_recorded(folder: Path, checkpoint: Checkpoint, config: Config) -> None:
    """Of the snapshots and their pictures keep those that are wanted, under the names of this run."""
    before = checkpoint.about["config"]["ageing"]["steps"]
    steps = config.ageing.steps
    stems = {
        snapshot_stem(figures["step"], before): snapshot_stem(figures["step"], steps)
        for figures in recorded_figures(checkpoint, config)
    }
    arrays = {folder / CHECKPOINT_STATE, folder / SURFACE}
    for path in [*(folder / SNAPSHOTS).glob("*"), *(folder / CHECKPOINT).iterdir()]:
        if path.stem in stems:
            path.rename(path.with_name(stems[path.stem] + path.suffix))
        elif path not in arrays:
            path.unlink()
    for path in folder.iterdir():  # what was written after the last step
        if path.is_file() and path.name != LOCK:
            path.unlink()
