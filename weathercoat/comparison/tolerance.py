"""How far results may differ: by figure, in themselves or in the noise between seeds; and the file that
says so.

A tolerance file is YAML and is read as configs are, all its problems with file, line and key at once.
"""

from __future__ import annotations

import fnmatch
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from weathercoat.comparison.statistics import FIGURES
from weathercoat.config.document import LARGEST_FILE, Item, read_document
from weathercoat.config.wording import did_you_mean, shortened
from weathercoat.errors import ConfigError, ConfigProblem

LEVEL = 0.01
LEAST_LEVEL, MOST_LEVEL = 1e-6, 0.5

_LIMITS = ("absolute", "relative", "sigmas")
_DISTANCES = ("positions", "distances", "pictures")
_KEYS = ("level", "omit", "figures", *_DISTANCES)
_REMEDY = "see docs/regression.md for an example"


@dataclass(frozen=True)
class Rule:
    """What the figures whose names match `pattern` may differ by: the largest of what is given.

    absolute: in the figure's unit; relative: to the larger of the two values; sigmas: standard deviations
    between seeds of the difference of the two groups' means.
    """

    pattern: str
    absolute: float | None = None
    relative: float | None = None
    sigmas: float | None = None

    def allowed(self, a: float, b: float, spread: float) -> float:
        """The largest difference between the values a and b; spread: standard deviation of the difference."""
        limits = (
            (self.absolute, 1.0),
            (self.relative, max(abs(a), abs(b))),
            (self.sigmas, spread),
        )
        return max(limit * unit for limit, unit in limits if limit is not None)


@dataclass(frozen=True)
class Tolerance:
    """What is let pass.

    level: how often runs that differ by chance alone may be called different. omitted: patterns of figures
    that are not judged. rules: for figures that are judged by a rule instead of by the level; the first one
    that matches counts. positions, distances: mean distances, in sizes; pictures: mean perceptual difference,
    0 to 1. Infinite ones are reported, and not judged: other seeds have other cracks.
    """

    level: float = LEVEL
    omitted: tuple[str, ...] = ()
    rules: tuple[Rule, ...] = ()
    positions: float = math.inf
    distances: float = math.inf
    pictures: float = math.inf

    def is_omitted(self, figure: str) -> bool:
        """Whether a figure is left out."""
        return any(fnmatch.fnmatchcase(figure, pattern) for pattern in self.omitted)

    def rule_of(self, figure: str) -> Rule | None:
        """The rule that a figure is judged by, if there is one."""
        return next((rule for rule in self.rules if fnmatch.fnmatchcase(figure, rule.pattern)), None)


def read_tolerance(path: Path | str) -> Tolerance:
    """The tolerance that a YAML file holds. Raises ConfigError with all problems."""
    where = str(path)
    try:
        with Path(path).open("rb") as file:
            data = file.read(LARGEST_FILE + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise ConfigError.at(where, f"the tolerance file cannot be read: {reason}") from None
    problems: list[ConfigProblem] = []

    def refuse(line: int, key: str, what: str) -> None:
        problems.append(ConfigProblem(where, line, key, what))

    content = read_document(data, where)
    for key in content.keys() - set(_KEYS):
        near = did_you_mean(key, _KEYS) or (
            "; figures go below figures" if key in FIGURES else f"; there are {', '.join(_KEYS)}"
        )
        refuse(content[key].line, key, f"unknown key{near}")
    values: dict[str, Any] = {}
    if "level" in content:
        values["level"] = _number("level", content["level"], refuse, LEAST_LEVEL, MOST_LEVEL)
    for key in _DISTANCES:
        if key in content:
            values[key] = _number(key, content[key], refuse)
    tolerance = Tolerance(
        **values,
        omitted=tuple(_omitted(content.get("omit"), refuse)),
        rules=tuple(_rules(content.get("figures"), refuse)),
    )
    if problems:
        raise ConfigError(problems=tuple(sorted(problems, key=lambda p: p.line)), remedy=_REMEDY)
    return tolerance


_Refuse = Callable[[int, str, str], None]


def _number(key: str, item: Item, refuse: _Refuse, least: float = 0.0, most: float = math.inf) -> float:
    value = item.value
    if isinstance(value, (int, float)) and not isinstance(value, bool) and least <= value <= most:
        return float(value)
    limits = f"from {least:g} to {most:g}" if most < math.inf else f"of at least {least:g}"
    refuse(item.line, key, f"must be a number {limits}, not {shortened(value)}")
    return least


def _omitted(item: Item | None, refuse: _Refuse) -> Iterator[str]:
    if item is None or item.value is None:
        return
    for pattern, line in item.value if isinstance(item.value, list) else [item]:
        if isinstance(pattern, str):
            _require_figure("omit", pattern, line, refuse)
            yield pattern
        else:
            refuse(line, "omit", f"must be a list of names or patterns, not {shortened(pattern)}")


def _rules(item: Item | None, refuse: _Refuse) -> Iterator[Rule]:
    if item is None or item.value is None:
        return
    if not isinstance(item.value, dict):
        refuse(item.line, "figures", "must be a mapping of names or patterns of figures to their limits")
        return
    for pattern, limits in item.value.items():
        key = f"figures.{pattern}"
        _require_figure(key, pattern, limits.line, refuse)
        if not isinstance(limits.value, dict) or not limits.value:
            refuse(limits.line, key, f"must be a mapping with {', '.join(_LIMITS[:-1])} or {_LIMITS[-1]}")
            continue
        yield Rule(pattern, **_limits(key, limits.value, refuse))


def _limits(key: str, limits: Mapping[str, Item], refuse: _Refuse) -> dict[str, float]:
    found = {}
    for name, item in limits.items():
        if name in _LIMITS:
            found[name] = _number(f"{key}.{name}", item, refuse)
        else:
            near = did_you_mean(name, _LIMITS) or f"; there are {', '.join(_LIMITS)}"
            refuse(item.line, f"{key}.{name}", f"unknown key{near}")
    return found


def _require_figure(key: str, pattern: str, line: int, refuse: _Refuse) -> None:
    if not fnmatch.filter(FIGURES, pattern):
        near = did_you_mean(pattern, FIGURES) or f"; there are {', '.join(FIGURES)}"
        refuse(line, key, f"{shortened(pattern)} fits no figure{near}")
