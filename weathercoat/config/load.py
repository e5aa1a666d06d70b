"""Loading a config: shipped presets, then the user's file, then `--set`; where each value came from is kept.

All problems are found at once: `ConfigError.problems` has one for each, with file, line and key.
"""

from __future__ import annotations

import difflib
import math
import os
import stat
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import ValidationError

from weathercoat.config.document import LARGEST_FILE, Item, read_document, read_value, without_lines
from weathercoat.config.presets import preset_names, preset_path
from weathercoat.config.schema import Config, Section, parameters, section_of
from weathercoat.errors import ConfigError, ConfigProblem

DEFAULT = "default"
_ALTERNATIVES = (("snapshots", "count", "steps"),)
_SPELLED_SYMBOLS = {"alpha": "α", "beta": "β", "lambda": "λ", "phi0": "φ₀"}  # noqa: RUF001

KeyPath = tuple[str, ...]


class Override(NamedTuple):
    """A value from the command line: dotted key, value, and the option that gave it."""

    key: str
    value: Any
    option: str = "--set"


@dataclass(frozen=True)
class LoadedConfig:
    """A valid config, and for each of its dotted keys where the value came from.

    origins: `default`, `preset NAME`, `FILE:LINE`, or the option, such as `--set`.
    source: the path or the name that was asked for.
    """

    config: Config
    origins: Mapping[str, str]
    source: str


class _Origin(NamedTuple):
    where: str
    line: int

    def __str__(self) -> str:
        return f"{self.where}:{self.line}" if self.line else self.where


class _Layer(NamedTuple):
    values: dict[str, Item]
    where: str


def load_config(
    path_or_preset: str | os.PathLike[str], overrides: Sequence[str | Override] = ()
) -> LoadedConfig:
    """Load a YAML file or a shipped config by name; a regular file of that name comes first.

    overrides: `key.path=value` as given to `--set`, the value in YAML; later ones win.
    Raises `ConfigError` with every problem.
    """
    source = os.fspath(path_or_preset)
    layers = [_read_layer(source)]
    problems: list[ConfigProblem] = []
    for override in overrides:
        try:
            layers.append(_override_layer(override))
        except ConfigError as error:
            problems += error.problems
    merge = _Merge()
    merge.problems += problems
    for name, origin in _wanted_presets(layers):
        if name in preset_names():
            merge.add(_preset_layer(name))
        else:
            what = f"no shipped config {name!r}; there are {', '.join(preset_names())}"
            merge.problems.append(ConfigProblem(*origin, "preset", what))
    for layer in layers:
        merge.add(layer)
    config = merge.validate()
    origins = {key: merge.origin_of(tuple(key.split("."))) for key in resolved_keys(config)}
    return LoadedConfig(
        config, {key: str(origin) if origin else DEFAULT for key, origin in origins.items()}, source
    )


def resolved_keys(config: Config) -> list[str]:
    """The dotted keys that hold a value in `config`: all, but for those below `remesh` where that is off."""
    keys = [parameter.key for parameter in parameters()]
    if config.remesh:
        return keys
    first = next(i for i, key in enumerate(keys) if key.startswith("remesh."))
    return [*keys[:first], "remesh", *(key for key in keys[first:] if not key.startswith("remesh."))]


def _read_layer(source: str) -> _Layer:
    if not Path(source).is_file() and source in preset_names():
        return _preset_layer(source)
    return _Layer(read_document(_read_file(source), source), source)


def _preset_layer(name: str) -> _Layer:
    where = f"preset {name}"
    return _Layer(read_document(preset_path(name).read_bytes(), where), where)


def _read_file(source: str) -> bytes:
    try:
        if not stat.S_ISREG(Path(source).stat().st_mode):
            raise ConfigError.at(source, "not a regular file; give a YAML file")
        with Path(source).open("rb") as file:
            return file.read(LARGEST_FILE + 1)
    except FileNotFoundError:
        what = f"no such file, and no shipped config of that name; there are {', '.join(preset_names())}"
        near = _did_you_mean(source, preset_names())
        raise ConfigError.at(source, what + near) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise ConfigError.at(source, f"cannot be read: {reason}") from None


def _override_layer(override: str | Override) -> _Layer:
    if isinstance(override, str):
        key, sign, text = override.partition("=")
        if not sign or not all(key.split(".")):
            raise ConfigError.at("--set", f"{override!r} must be key.path=value")
        override = Override(key, read_value(text, "--set", key))
    item = Item(override.value, 0)
    for name in reversed(override.key.split(".")):
        item = Item({name: item}, 0)
    return _Layer(item.value, override.option)


def _wanted_presets(layers: Iterable[_Layer]) -> list[tuple[str, _Origin]]:
    """The presets that the last layer with the key `preset` names."""
    wanted: list[tuple[str, _Origin]] = []
    for layer in layers:
        if "preset" in layer.values:
            item = layer.values["preset"]
            names = item.value if isinstance(item.value, list) else [item.value]
            wanted = [(name, _Origin(layer.where, item.line)) for name in names if isinstance(name, str)]
    return wanted


class _Merge:
    """Values of all layers so far, each with its origin; a later layer wins key by key."""

    def __init__(self) -> None:
        self.values: dict[str, Any] = {}
        self.origins: dict[KeyPath, _Origin] = {}
        self.problems: list[ConfigProblem] = []

    def add(self, layer: _Layer) -> None:
        for section, *keys in _ALTERNATIVES:
            item = layer.values.get(section)
            if item is not None and isinstance(item.value, dict) and any(key in item.value for key in keys):
                for key in keys:
                    self.values.get(section, {}).pop(key, None)
                    self.origins.pop((section, key), None)
        self._add(self.values, layer.values, (), layer.where)

    def _add(self, target: dict[str, Any], items: dict[str, Item], above: KeyPath, where: str) -> None:
        for name, item in items.items():
            path = (*above, name)
            section = _section_at(path)
            if section is not None and item.value is None:
                continue
            for known in [known for known in self.origins if known[: len(path)] == path and known != path]:
                if not isinstance(item.value, dict):
                    del self.origins[known]
            self.origins[path] = _Origin(where, item.line)
            if isinstance(item.value, dict) and section is not None:
                if not isinstance(target.get(name), dict):
                    target[name] = {}
                self._add(target[name], item.value, path, where)
                continue
            if item.value is None and path != ("snapshots", "count"):
                self._report(path, "has no value" + _color_hint(path))
                continue
            target[name] = without_lines(item.value)

    def origin_of(self, path: KeyPath) -> _Origin | None:
        """Where the value at `path` was given, or the thing that it is a part of; None for a default."""
        if path in self.origins or _section_at(path[:-1]) is None:
            while path and path not in self.origins:
                path = path[:-1]
            return self.origins.get(path)
        return None

    def validate(self) -> Config:
        try:
            config = Config.model_validate(self.values)
        except ValidationError as error:
            for detail in error.errors(include_url=False):
                self._report(*_explain(detail))
        else:
            for key, what in config.conflicts():
                self._report(tuple(key.split(".")), what)
        if self.problems:
            raise ConfigError(problems=tuple(sorted(self.problems, key=lambda p: (p.where, p.line))))
        return config

    def _report(self, path: KeyPath, what: str) -> None:
        given = path
        while given and given not in self.origins:
            given = given[:-1]
        where, line = self.origins.get(given, _Origin(DEFAULT, 0))
        key = ".".join(path).replace(".[", "[")
        self.problems.append(ConfigProblem(where, line, key, what))


def _section_at(path: KeyPath) -> type[Section] | None:
    section: type[Section] | None = Config
    for name in path:
        if section is None:
            return None
        fields = ((field.alias or key, field) for key, field in section.model_fields.items())
        section = next((section_of(field) for key, field in fields if key == name), None)
    return section


def _explain(detail: Any) -> tuple[KeyPath, str]:
    """Key and words for one of pydantic's errors."""
    location = list(detail["loc"])
    if location[:1] == ["remesh"] and location[1:2] in (["mapping"], ["off"]):
        del location[1]
    path = tuple(f"[{part}]" if isinstance(part, int) else str(part) for part in location)
    kind, value, limits = detail["type"], detail["input"], detail.get("ctx", {})
    shown = _shown(value)
    if kind == "extra_forbidden":
        return path, "unknown key" + _nearest_key(path)
    if kind == "value_error":
        return path, f"{limits['error']}" + ("" if isinstance(value, dict) else f", not {shown}")
    if kind == "literal_error":
        words = limits["expected"].replace("'", "")
        return path, f"must be {words}, not {shown}" + _did_you_mean(
            value, words.replace(" or ", ", ").split(", ")
        )
    for name, word in (("gt", "above"), ("ge", "at least"), ("lt", "below"), ("le", "at most")):
        if name in limits:
            limit = limits[name]
            return path, f"must be {word} {limit:{',' if isinstance(limit, int) else ',.15g'}}, not {shown}"
    words = {
        "model_type": "must be off or a mapping" if path == ("remesh",) else "must be a mapping",
        "bool_parsing": "must be true or false",
        "bool_type": "must be true or false",
        "int_from_float": "must be a whole number",
        "int_type": "must be a whole number",
        "int_parsing_size": "is too large",
        "float_type": "must be a number",
        "string_type": "must be text, put it in quotes",
        "tuple_type": "must be a list",
        "too_short": "must not be empty",
    }.get(kind, detail["msg"])
    return path, f"{words}, not {shown}"


def _shown(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, int) and abs(value) > 10**30:
        return "a number of over 30 digits"
    if isinstance(value, float) and not math.isfinite(value):
        return "infinite or not a number"
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."


def _nearest_key(path: KeyPath) -> str:
    """The key that was meant: a sibling, the paper's symbol, or a key of that name in another section."""
    section = _section_at(path[:-1])
    name, prefix = path[-1], ".".join((*path[:-1], ""))
    if section is not None:
        siblings = [prefix + (field.alias or key) for key, field in section.model_fields.items()]
        match = difflib.get_close_matches(prefix + name, siblings, 1, cutoff=0.0)
        if match and difflib.SequenceMatcher(None, name, match[0].removeprefix(prefix)).ratio() >= 0.6:
            return f"; did you mean {match[0]}?"
    symbol = _SPELLED_SYMBOLS.get(name, name)
    known = list(parameters())
    by_symbol = [parameter.key for parameter in known if parameter.symbol == symbol]
    if by_symbol:
        return f"; did you mean {by_symbol[0]}?"
    by_name = {parameter.key.rpartition(".")[2]: parameter.key for parameter in reversed(known)}
    near = difflib.get_close_matches(name, by_name, 1)
    return f"; did you mean {by_name[near[0]]}?" if near else ""


def _did_you_mean(word: Any, candidates: Iterable[str]) -> str:
    near = difflib.get_close_matches(str(word), list(candidates), 1)
    return f"; did you mean {near[0]}?" if near else ""


def _color_hint(path: KeyPath) -> str:
    return '; put a colour in quotes: "#rrggbb"' if path[0] == "appearance" else ""
