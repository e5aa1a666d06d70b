"""Manifests: the jobs of a batch in a YAML or CSV file, with a config, a seed and other values for each.

A row says which `model` (or `asset`) it is about, and may say `config`, `seed`, `name` and `format`. Values
of the config are below `set` in YAML and in columns headed by their keys in CSV. Paths are relative to the
manifest's folder. All problems are found at once, each with file, line and key.
"""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import NamedTuple

from weathercoat.batch.names import model_name, safe_path
from weathercoat.batch.storage import is_url
from weathercoat.config.document import Item, decode, read_items, read_value, without_lines
from weathercoat.config.load import Override
from weathercoat.config.presets import preset_names
from weathercoat.config.schema import parameters
from weathercoat.config.wording import did_you_mean, nearest_key
from weathercoat.errors import ConfigError, ConfigProblem

EXTENSIONS = (".yaml", ".yml", ".csv")
LARGEST = 32 << 20
MOST_VALUES = 1_000_000

_MODEL = ("model", "asset")
_TEXTS = (*_MODEL, "config", "name", "format")
_ROW = (*_TEXTS, "seed", "set")
_OF_ONE_JOB = (*_MODEL, "name")


@dataclass(frozen=True)
class Row:
    """What a batch is asked to do with one model, be it by a row of a manifest or by its path alone.

    config: None for that of the batch. place: where it was asked for, for messages.
    """

    name: str
    asset: str
    place: str
    config: str | None = None
    overrides: tuple[Override, ...] = ()
    format: str | None = None


class _Entry(NamedTuple):
    """The values of a row that are no part of a config, and the overrides of one."""

    line: int
    texts: Mapping[str, str]
    overrides: tuple[Override, ...]


def is_manifest(path: str) -> bool:
    """Whether a path is named as manifests are."""
    return os.path.splitext(path)[1].lower() in EXTENSIONS  # noqa: PTH122 (any text will do)


def read_manifest(path: str, style: str = "stem") -> tuple[list[Row], list[ConfigProblem]]:
    """The rows of a manifest, named as they say, or else by their models; and all that is wrong with it, but
    for what is wrong with the configs themselves, which is found when these are loaded.
    """
    rows: list[Row] = []
    problems: list[ConfigProblem] = []

    def refuse(line: int, key: str, what: str) -> None:
        problems.append(ConfigProblem(path, line, key, what))

    read = _read_csv if path.lower().endswith(".csv") else _read_yaml
    try:
        for entry in read(_read(path), path, refuse):
            row = _make_row(entry, path, style, refuse)
            if row is not None:
                rows.append(row)
    except ConfigError as error:
        problems += error.problems
    if not rows and not problems:
        refuse(0, "", "holds no jobs")
    return rows, problems


_Refuse = Callable[[int, str, str], None]


def _read(path: str) -> bytes:
    try:
        with Path(path).open("rb") as file:
            data = file.read(LARGEST + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise ConfigError.at(path, f"the manifest cannot be read: {reason}") from None
    if len(data) > LARGEST:
        raise ConfigError.at(path, f"larger than {LARGEST >> 20} MiB, this is no manifest")
    return data


def _make_row(entry: _Entry, path: str, style: str, refuse: _Refuse) -> Row | None:
    """The row of an entry; None where its model or its config is not there."""
    texts = entry.texts
    models = [texts[key] for key in _MODEL if key in texts]
    if len(models) != 1:
        refuse(entry.line, "model", "is given as asset too" if models else "is missing")
        return None
    (model,) = models
    folder = os.path.dirname(path)  # noqa: PTH120 (keeps a path as short as it was given)
    config = texts.get("config")
    if config is not None:
        file = os.path.join(folder, config)  # noqa: PTH118
        if os.path.isfile(file) or config not in _presets():  # noqa: PTH113
            config = file
            if not os.path.lexists(file):
                what = f"there is no file {file}, and no shipped config of that name"
                refuse(entry.line, "config", what + did_you_mean(texts["config"], _presets()))
                return None
    return Row(
        safe_path(texts["name"].split("/")) if "name" in texts else model_name(model, style),
        model if is_url(model) else os.path.join(folder, model),  # noqa: PTH118
        f"{path}:{entry.line}",
        config,
        entry.overrides,
        texts.get("format"),
    )


@cache
def _presets() -> tuple[str, ...]:
    return tuple(preset_names())


def _read_yaml(data: bytes, path: str, refuse: _Refuse) -> Iterator[_Entry]:
    """The entries of a list of rows, or of a mapping with such a list under `jobs` and `defaults`."""
    document = read_items(data, path, MOST_VALUES)
    defaults = _Entry(0, {}, ())
    if isinstance(document, dict):
        if "jobs" not in document:
            refuse(1, "", "has no jobs; where this is a config, give it with -c")
            return
        for key in document.keys() - {"defaults", "jobs"}:
            known = did_you_mean(key, ["defaults", "jobs"])
            refuse(document[key].line, key, f"unknown key; a manifest has defaults and jobs{known}")
        if "defaults" in document:
            defaults = _yaml_entry(document["defaults"], path, refuse) or defaults
            for key in defaults.texts.keys() & set(_OF_ONE_JOB):
                refuse(defaults.line, f"defaults.{key}", "is a matter of each job")
        document = document["jobs"].value
    if not isinstance(document, list):
        refuse(1, "", "must be a list of jobs, or a mapping with such a list under jobs")
        return
    for item in document:
        row = Item({"model": item}, item.line) if isinstance(item.value, str) else item
        entry = _yaml_entry(row, path, refuse)
        if entry is not None:
            overrides = (*defaults.overrides, *entry.overrides)
            yield _Entry(entry.line, {**defaults.texts, **entry.texts}, overrides)


def _yaml_entry(row: Item, path: str, refuse: _Refuse) -> _Entry | None:
    """The entry of a row or of the defaults; None where it cannot be one."""
    texts: dict[str, str] = {}
    overrides: list[Override] = []
    if not isinstance(row.value, dict):
        refuse(row.line, "", "must be a mapping with the key model, or the path of a model")
        return None
    for key, item in row.value.items():
        if key == "seed" and item.value is not None:
            overrides += _flattened({key: item}, "", path, refuse)
        elif key == "set":
            if isinstance(item.value, dict):
                overrides += _flattened(item.value, "", path, refuse)
            elif item.value is not None:
                refuse(item.line, key, "must be a mapping of the config's keys to values")
        elif key not in _ROW:
            hint = did_you_mean(key, _ROW) or "; values of the config go below set"
            refuse(item.line, key, f"unknown key{hint}")
        elif isinstance(item.value, str) and item.value:
            texts[key] = item.value
        elif item.value is not None:
            refuse(item.line, key, "must be text, put it in quotes")
    return _Entry(row.line, texts, tuple(overrides))


def _flattened(values: Mapping[str, Item], above: str, path: str, refuse: _Refuse) -> Iterator[Override]:
    """The overrides of a mapping: dotted keys, and sections within each other as in a config."""
    for name, item in values.items():
        key = f"{above}{name}"
        if not all(key.split(".")):
            refuse(item.line, key, "is no key of a config")
        elif isinstance(item.value, dict) and item.value:
            yield from _flattened(item.value, f"{key}.", path, refuse)
        else:
            yield Override(key, without_lines(item.value), path, item.line)


def _read_csv(data: bytes, path: str, refuse: _Refuse) -> Iterator[_Entry]:
    """The entries of a table with a head; an empty cell says nothing."""
    lines = csv.reader(io.StringIO(decode(data, path), newline=""), skipinitialspace=True, strict=True)
    value_of = cache(lambda cell: read_value(cell, path, ""))
    head: list[str] = []
    while True:
        line = lines.line_num + 1
        try:
            cells = [cell.strip() for cell in next(lines)]
        except StopIteration:
            return
        except csv.Error as error:
            refuse(line, "", f"is no valid CSV: {error}")
            return
        if not any(cells):
            continue
        if not head:
            head = cells
            if not _is_head(head, line, refuse):
                return
            continue
        if any(cells[len(head) :]):
            refuse(line, "", f"has {len(cells)} cells, and the first line {len(head)}")
            continue
        texts: dict[str, str] = {}
        overrides: list[Override] = []
        for key, cell in zip(head, cells, strict=False):
            if cell and key in _TEXTS:
                texts[key] = cell
            elif cell:
                try:
                    value = value_of(cell)
                except ConfigError as error:
                    refuse(line, key, error.problems[0].what)
                    continue
                if isinstance(value, dict):
                    refuse(line, key, "is a mapping; give each of its keys a column")
                else:
                    overrides.append(Override(key, value, path, line))
        yield _Entry(line, texts, tuple(overrides))


def _is_head(head: Sequence[str], line: int, refuse: _Refuse) -> bool:
    """Whether all columns are known, no two are the same, and one is that of the models."""
    is_good = True
    for i, key in enumerate(head):
        what = ""
        if not key:
            what = f"column {i + 1} has no name"
        elif key in head[:i]:
            what = "is a column twice"
        elif key not in _TEXTS and key not in _config_keys():
            near = did_you_mean(key, _TEXTS)
            what = f"unknown key{near or nearest_key(tuple(key.split('.')))}"
        if what:
            refuse(line, key, what)
            is_good = False
    if is_good and not any(key in head for key in _MODEL):
        refuse(line, "", f"the first line must name the columns, one of them model, not {', '.join(head)}")
        is_good = False
    return is_good


@cache
def _config_keys() -> frozenset[str]:
    """The dotted keys of the config, those of whole sections included."""
    keys = [parameter.key for parameter in parameters()]
    return frozenset(keys) | {key.rpartition(".")[0] for key in keys if "." in key}
