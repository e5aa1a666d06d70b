"""Loading a config: shipped presets, then the user's file, then `--set`; where each value came from is kept.

All problems are found at once: `ConfigError.problems` has one for each, with file, line and key.
"""

from __future__ import annotations

import os
import stat
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import ValidationError

from weathercoat.config.derived import with_values
from weathercoat.config.document import LARGEST_FILE, Item, read_document, read_value, without_lines
from weathercoat.config.physical import NEEDED, physical_values
from weathercoat.config.presets import preset_names, preset_path
from weathercoat.config.quality import AUTO, point_of, with_point
from weathercoat.config.schema import Config, parameters, section_at
from weathercoat.config.wording import KeyPath, color_hint, did_you_mean, explain, shortened
from weathercoat.errors import ConfigError, ConfigProblem

DEFAULT = "default"
_ALTERNATIVES = (("snapshots", "count", "steps"),)
_OFF = (False, "off", "no")


class Override(NamedTuple):
    """A value that comes after the file's: dotted key, value, and the option that gave it, or the file and
    its line.
    """

    key: str
    value: Any
    option: str = "--set"
    line: int = 0


@dataclass(frozen=True)
class LoadedConfig:
    """A valid config, and for each of its dotted keys where the value came from.

    origins: `default`, `preset NAME`, `FILE:LINE`, `quality NAME`, or the option, such as `--set`.
    source: the path or the name that was asked for. fixed: keys that were set where `quality` was, or after
    it (presets come before the file, the file before options): the quality does not change them.
    """

    config: Config
    origins: Mapping[str, str]
    source: str
    fixed: frozenset[str] = frozenset()


class _Origin(NamedTuple):
    where: str
    line: int

    def __str__(self) -> str:
        return f"{self.where}:{self.line}" if self.line else self.where


class _Layer(NamedTuple):
    values: dict[str, Item]
    where: str
    key: str = ""  # of an override


def load_config(
    path_or_preset: str | os.PathLike[str], overrides: Sequence[str | Override] = ()
) -> LoadedConfig:
    """Load a YAML file or a shipped config by name; a regular file of that name comes first. `A+B` is the
    config B with the shipped config A before it, as if it were its preset; there may be more.

    overrides: `key.path=value` as given to `--set`, the value in YAML; later ones win. A quality has set what
    it sets, but for `auto`, which needs the model (see `weathercoat.plan`). Raises `ConfigError` with every
    problem.
    """
    return ConfigLoader().load(path_or_preset, overrides)


class ConfigLoader:
    """Loads configs as `load_config` does, many of them from a few files, each of which is read once."""

    def __init__(self) -> None:
        self._files: dict[str, _Layer | ConfigError] = {}
        self._presets: dict[str, _Layer] = {}
        self._fixed: dict[frozenset[str], frozenset[str]] = {}  # one of those that are equal is kept

    def load(
        self, path_or_preset: str | os.PathLike[str], overrides: Sequence[str | Override] = ()
    ) -> LoadedConfig:
        """The config of a file or preset with overrides; see `load_config`."""
        source = os.fspath(path_or_preset)
        merge = _Merge()
        *before, last = [source] if os.path.isfile(source) else source.split("+")  # noqa: PTH113 (any text)
        layers = [self._file(last)]
        for override in overrides:
            try:
                layers.append(_override_layer(override))
            except ConfigError as error:
                merge.problems += error.problems
        wanted = {name: _Origin(source, 0) for name in before} | _wanted_presets(layers)
        for name, origin in wanted.items():
            preset = self._preset(name)
            if preset:
                merge.add(preset)
            else:
                what = f"no shipped config {shortened(name)}; there are {', '.join(preset_names())}"
                merge.problems.append(ConfigProblem(*origin, "preset", what))
        for layer in layers:
            merge.add(layer)
        config = merge.validate()
        nowhere = _Origin(DEFAULT, 0)
        origins = {
            key: merge.origins.get(path, nowhere) for key, path in _resolved_keys(bool(config.remesh)).items()
        }
        fixed = _fixed_keys(origins, layers, ("quality",))
        loaded = LoadedConfig(
            config,
            {key: sys.intern(str(origin)) for key, origin in origins.items()},
            source,
            self._fixed.setdefault(fixed, fixed),
        )
        physical = {
            key: value
            for key, value in physical_values(config.physical).items()
            if key not in _fixed_keys(origins, layers, [f"physical.{name}" for name in NEEDED[key]])
        }
        if physical:
            loaded = with_values(loaded, physical, "physical")
        if config.quality is None or config.quality == AUTO:
            return loaded
        return with_point(loaded, point_of(config.quality), f"quality {config.quality}")

    def _file(self, source: str) -> _Layer:
        if source not in self._files:
            try:
                self._files[source] = _read_layer(source)
            except ConfigError as error:
                self._files[source] = error
        layer = self._files[source]
        if isinstance(layer, ConfigError):
            raise layer
        return layer

    def _preset(self, name: str) -> _Layer | None:
        if name not in self._presets and name in preset_names():
            self._presets[name] = _preset_layer(name)
        return self._presets.get(name)


def _fixed_keys(
    origins: Mapping[str, _Origin], layers: Sequence[_Layer], by: Sequence[str]
) -> frozenset[str]:
    """The keys whose values come from where the last of the keys `by` comes from, or from what has more
    say.
    """
    say = {layers[0].where: 1, **{layer.where: 2 for layer in layers[1:]}}

    def say_of(key: str) -> int:
        where = origins[key].where
        return say.get(where, -1 if where == DEFAULT else 0)

    least = max(0, *map(say_of, by))
    return frozenset(key for key in origins if say_of(key) >= least)


@cache
def _resolved_keys(is_remeshed: bool) -> dict[str, KeyPath]:
    """The dotted keys that hold a value, with their paths: all, but none below `remesh` where that is off."""
    keys = [parameter.key for parameter in parameters()]
    if not is_remeshed:
        first = next(i for i, key in enumerate(keys) if key.startswith("remesh."))
        keys = [*keys[:first], "remesh", *(key for key in keys[first:] if not key.startswith("remesh."))]
    return {key: tuple(key.split(".")) for key in keys}


def _read_layer(source: str) -> _Layer:
    if not os.path.isfile(source) and source in preset_names():  # noqa: PTH113 (any text will do)
        return _preset_layer(source)
    return _Layer(read_document(_read_file(source), source), source)


def _preset_layer(name: str) -> _Layer:
    where = f"preset {name}"
    return _Layer(read_document(preset_path(name).read_bytes(), where), where)


def _read_file(source: str) -> bytes:
    if source == "-":
        return sys.stdin.buffer.read(LARGEST_FILE + 1)
    try:
        mode = Path(source).stat().st_mode
        if stat.S_ISFIFO(mode):
            return _read_pipe(source)
        if not stat.S_ISREG(mode):
            raise ConfigError.at(source, "not a regular file; give a YAML file")
        with Path(source).open("rb") as file:
            return file.read(LARGEST_FILE + 1)
    except FileNotFoundError:
        what = f"no such file, and no shipped config of that name; there are {', '.join(preset_names())}"
        near = did_you_mean(source, preset_names())
        raise ConfigError.at(source, what + near) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise ConfigError.at(source, f"cannot be read: {reason}") from None


def _read_pipe(source: str) -> bytes:
    """What a pipe holds, such as that of the shell's `<(...)`; refuses one that nobody writes to, which would
    block for ever.
    """
    descriptor = os.open(source, os.O_RDONLY | os.O_NONBLOCK)
    with os.fdopen(descriptor, "rb") as file:
        start = b""
        with suppress(BlockingIOError):  # somebody is about to write
            start = os.read(descriptor, 1)
            if not start:
                raise ConfigError.at(source, "nobody writes to this pipe; give a YAML file")
        os.set_blocking(descriptor, True)
        return start + file.read(LARGEST_FILE + 1)


def _override_layer(override: str | Override) -> _Layer:
    if isinstance(override, str):
        key, sign, text = override.partition("=")
        if not sign or not all(key.split(".")):
            raise ConfigError.at("--set", f"{shortened(override)} must be key.path=value")
        override = Override(key, read_value(text, "--set", key))
    item = Item(override.value, override.line)
    for name in reversed(override.key.split(".")):
        item = Item({name: item}, override.line)
    return _Layer(item.value, override.option, override.key)


def _wanted_presets(layers: Iterable[_Layer]) -> dict[str, _Origin]:
    """The presets that the last layer with the key `preset` names; one that comes again comes only then."""
    wanted: dict[str, _Origin] = {}
    for layer in layers:
        if "preset" in layer.values:
            item = layer.values["preset"]
            names = without_lines(item.value if isinstance(item.value, list) else [item.value])
            last_first = dict.fromkeys(name for name in reversed(names) if isinstance(name, str))
            wanted = dict.fromkeys(reversed(last_first), _Origin(layer.where, item.line))
    return wanted


class _Merge:
    """Values of all layers so far, each with its origin; a later layer wins key by key."""

    def __init__(self) -> None:
        self.values: dict[str, Any] = {}
        self.origins: dict[KeyPath, _Origin] = {}
        self.problems: list[ConfigProblem] = []

    def add(self, layer: _Layer) -> None:
        """Add a layer. An option that sets a part of what is switched off does not switch it on."""
        whole, _, part = layer.key.partition(".")
        if part and self.values.get(whole) in _OFF:
            origin = self.origins[(whole,)]
            what = f"{whole} is off by {origin}; add --set {whole}=on, or leave this out"
            self.problems.append(ConfigProblem(layer.where, 0, layer.key, what))
            return
        for section, *keys in _ALTERNATIVES:
            item, before = layer.values.get(section), self.values.get(section)
            if item is None or not isinstance(item.value, dict) or not isinstance(before, dict):
                continue
            if any(key in item.value for key in keys):
                for key in keys:
                    before.pop(key, None)
                    self.origins.pop((section, key), None)
        self._add(self.values, layer.values, (), layer.where)

    def _add(self, target: dict[str, Any], items: dict[str, Item], above: KeyPath, where: str) -> None:
        for name, item in items.items():
            path = (*above, name)
            is_section = section_at(path) is not None
            if is_section and item.value is None:
                continue
            self.origins[path] = _Origin(where, item.line)
            if is_section and isinstance(item.value, dict):
                if not isinstance(target.get(name), dict):
                    target[name] = {}
                self._add(target[name], item.value, path, where)
            elif item.value is None and path != ("snapshots", "count"):
                self.report(path, "has no value" + color_hint(path))
            else:
                if is_section or isinstance(item.value, list):
                    self._forget_below(path)
                if isinstance(item.value, dict) and isinstance(target.get(name), list):
                    self._change_entries(target[name], item.value, path, where)
                else:
                    self._note_lines(item.value, path, where)
                    target[name] = without_lines(item.value)

    def _change_entries(self, entries: list[Any], items: dict[str, Item], above: KeyPath, where: str) -> None:
        """Change entries of a list that are given by their numbers from 0, as `steering.0.multiply`."""
        for number, item in items.items():
            path = (*above, f"[{number}]")
            self.origins[path] = _Origin(where, item.line)
            if not number.isdecimal() or int(number) >= len(entries):
                self.report(path, f"there is no such entry, of {len(entries)} from 0")
                continue
            entry = entries[int(number)]
            if isinstance(item.value, dict) and isinstance(entry, dict):
                for name, inner in item.value.items():
                    self.origins[(*path, name)] = _Origin(where, inner.line)
                    entry[name] = without_lines(inner.value)
            else:
                entries[int(number)] = without_lines(item.value)

    def _note_lines(self, value: Any, path: KeyPath, where: str) -> None:
        """Note where the parts of a list stand."""
        if isinstance(value, list):
            parts = [(f"[{i}]", part) for i, part in enumerate(value) if isinstance(part, Item)]
        else:
            parts = list(value.items()) if isinstance(value, dict) else []
        for name, part in parts:
            self.origins[(*path, name)] = _Origin(where, part.line)
            self._note_lines(part.value, (*path, name), where)

    def _forget_below(self, path: KeyPath) -> None:
        """Drop the origins of what a value at `path` replaces as a whole."""
        depth = len(path)
        self.origins = {
            key: at for key, at in self.origins.items() if len(key) <= depth or key[:depth] != path
        }

    def report(self, path: KeyPath, what: str) -> None:
        """Note a problem, at the line of its key or of what the key is a part of."""
        given = path
        while given and given not in self.origins:
            given = given[:-1]
        where, line = self.origins.get(given, _Origin(DEFAULT, 0))
        self.problems.append(ConfigProblem(where, line, ".".join(path).replace(".[", "["), what))

    def validate(self) -> Config:
        """The config of all layers; raises `ConfigError` with all problems, those of a file in its order."""
        try:
            config = Config.model_validate(self.values)
        except ValidationError as error:
            for detail in error.errors(include_url=False):
                self.report(*explain(detail))
        else:
            for key, what in config.conflicts():
                self.report(tuple(key.split(".")), what)
        if self.problems:
            raise ConfigError(problems=tuple(sorted(self.problems, key=lambda p: (p.where, p.line))))
        return config
