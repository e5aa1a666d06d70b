"""What a comparison is given: a run, or a folder of several, and what their reports say."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from weathercoat.errors import AccessError
from weathercoat.output.folder import REPORT

_GIVE = "give the folder of a finished run, or of several"


@dataclass(frozen=True)
class Run:
    """A finished run: its folder, its name within what was given, and its report as far as it can be read."""

    folder: Path
    name: str

    @cached_property
    def report(self) -> Mapping[str, Any]:
        """The content of `run.json`; empty where that is no JSON object, which verification tells."""
        try:
            content = json.loads((self.folder / REPORT).read_bytes())
        except ValueError:
            return {}
        except OSError as error:
            reason = f"{REPORT}: {error.strerror or error}"
            raise AccessError(reason, file=str(self.folder), remedy=_GIVE) from error
        return content if isinstance(content, dict) else {}

    @property
    def seed(self) -> int | None:
        """The seed of the run."""
        return _of_kind(self.report.get("seed"), int)

    @property
    def models(self) -> tuple[str, ...]:
        """The names of the files that it read."""
        return tuple(sorted(_of_kind(self.report.get("inputs"), dict) or {}))

    @property
    def config(self) -> dict[str, Any]:
        """The values of the config by their dotted keys."""
        return dict(_flat(_of_kind(self.report.get("config"), dict) or {}))

    @property
    def versions(self) -> dict[str, str]:
        """Versions of what it was made with."""
        return _of_kind(self.report.get("versions"), dict) or {}


def find_runs(path: Path | str) -> tuple[Run, ...]:
    """The run in a folder, or those in its folders at any depth, sorted by name.

    Raises AccessError where there is none.
    """
    path = Path(path)
    if not os.path.isdir(path):  # noqa: PTH112 (any text will do)
        raise AccessError("there is no such folder", file=str(path), remedy=_GIVE)
    if os.path.lexists(path / REPORT):
        return (Run(path, path.resolve().name),)
    found = []
    for place, folders, files in os.walk(path):
        if REPORT in files:
            folders.clear()
            found.append(Path(place))
        folders[:] = [name for name in folders if not name.endswith(".partial")]
    if not found:
        raise AccessError(f"there is no {REPORT} in it or in its folders", file=str(path), remedy=_GIVE)
    return tuple(Run(folder, folder.relative_to(path).as_posix()) for folder in sorted(found))


def are_identical(a: Sequence[Run], b: Sequence[Run]) -> bool:
    """Whether the runs of both sides, in their order, have the same bytes in every file of their reports,
    and these are the bytes that the reports tell of.
    """
    return len(a) == len(b) and all(_is_identical(*pair) for pair in zip(a, b, strict=True))


def pair_up(a: Sequence[Run], b: Sequence[Run]) -> dict[str, tuple[list[Run], list[Run]]]:
    """Runs of both sides that are to be compared as groups, by what their runs have in common.

    Where both sides have the same combinations of model and config, seeds aside, each of those is a group.
    Else where both have the same models, each model is. Else all runs of a side are one group.
    """
    for key in (_model_and_config, _model):
        sides = [_by(key, runs) for runs in (a, b)]
        if sides[0].keys() == sides[1].keys():
            groups = {found: (sides[0][found], sides[1][found]) for found in sorted(sides[0])}
            return {_title(runs, len(groups)): runs for runs in groups.values()}
    return {"all runs": (list(a), list(b))}


def config_differences(a: Sequence[Run], b: Sequence[Run]) -> dict[str, tuple[str, str]]:
    """The keys of configs whose values differ between the sides, with the values as JSON."""
    found = {}
    sides = [[run.config for run in runs] for runs in (a, b)]
    for key in sorted({key for configs in sides for config in configs for key in config}):
        values = [_values(configs, key) for configs in sides]
        if values[0] != values[1]:
            found[key] = (values[0], values[1])
    return found


def _is_identical(a: Run, b: Run) -> bool:
    if (a.folder / REPORT).read_bytes() != (b.folder / REPORT).read_bytes():
        return False
    digests = _of_kind(a.report.get("files"), dict)
    return bool(digests) and all(
        _digest(run.folder / str(name)) == digest for run in (a, b) for name, digest in digests.items()
    )


def _digest(path: Path) -> str | None:
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError:
        return None


def _by(key: Any, runs: Sequence[Run]) -> dict[str, list[Run]]:
    found: dict[str, list[Run]] = {}
    for run in runs:
        found.setdefault(key(run), []).append(run)
    return found


def _model(run: Run) -> str:
    return ", ".join(run.models)


def _model_and_config(run: Run) -> str:
    config = {key: value for key, value in run.config.items() if key != "seed"}
    return json.dumps([run.models, config], sort_keys=True)


def _title(runs: tuple[list[Run], list[Run]], group_count: int) -> str:
    """What a group is called: by its model, and where there are more groups than models by its first run."""
    model = _model(runs[0][0]) or "all runs"
    return model if group_count == 1 else f"{model}, {runs[0][0].name}"


def _values(configs: Sequence[Mapping[str, Any]], key: str) -> str:
    """The value of a key, or those of several runs."""
    texts = sorted({json.dumps(config[key], ensure_ascii=False) for config in configs if key in config})
    return ", ".join(texts)


def _flat(values: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in values.items():
        if isinstance(value, dict) and value:
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _of_kind(value: Any, kind: type) -> Any:
    return value if isinstance(value, kind) else None
