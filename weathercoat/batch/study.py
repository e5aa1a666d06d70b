"""Parameter studies: the members that `--matrix`, `--vary` and `--variants` make of one job.

A drawn value is a hash of the seed of the config, the name of the job without its variant, the key, and the
number of the variant. It hangs on nothing else, so that more models, keys or variants change none.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any, NamedTuple

from weathercoat.batch.names import safe_path
from weathercoat.config.document import read_value
from weathercoat.config.load import Override
from weathercoat.config.wording import did_you_mean, shortened
from weathercoat.errors import LimitError, UsageError

MOST_JOBS = 100_000

_DIGITS = 9  # of a drawn number: where logarithms of two C libraries part, they part far behind
_SEED_BITS = 53  # so that every reader of JSON keeps a seed whole
_HASH_BITS = 128
_CONFIG, _SEED = "config", "seed"
_AROUND = "[]{}()\"'#"
_PAIRS = {"(": ")", "[": "]", "{": "}"}


class Member(NamedTuple):
    """What a study makes of a job: the end of its name, `""` for the job itself, and what it changes.

    config: another file or preset, None for the job's own.
    """

    suffix: str
    config: str | None
    overrides: tuple[Override, ...]


class _Value(NamedTuple):
    text: str
    value: Any


@dataclass(frozen=True)
class _Draw:
    """A key whose value is drawn: `pick` turns a hash, a whole number of 128 bits, into a value."""

    key: str
    pick: Callable[[int], _Value]


@dataclass(frozen=True)
class Study:
    """What the options of a study ask for; see `parse_study`.

    combinations: all of the matrix, a single one that changes nothing where there is none. variants: how many
    of each, None where jobs keep their seeds.
    """

    combinations: tuple[Member, ...]
    draws: tuple[_Draw, ...]
    variants: int | None

    @property
    def changes(self) -> bool:
        """Whether jobs become others by it."""
        return self.variants is not None or any(member.suffix for member in self.combinations)

    @property
    def size(self) -> int:
        """How many jobs become of one."""
        return len(self.combinations) * (1 if self.variants is None else self.variants)

    def drawn(self, seed: int, job: str) -> Iterator[Member]:
        """The variants of a job; seed: that of its config."""
        for number in range(self.variants or 0):
            own = Override(_SEED, hashed(seed, job, _SEED, number) >> (_HASH_BITS - _SEED_BITS), "--variants")
            values = [(draw.key, draw.pick(hashed(seed, job, draw.key, number))) for draw in self.draws]
            member = _member(f"v{number:04d}", values, "--vary")
            yield member._replace(overrides=(own, *member.overrides))


def hashed(seed: int, job: str, key: str, number: int) -> int:
    """A whole number of 128 bits, uniform over all: the beginning of SHA-256 of the JSON list of the four."""
    content = json.dumps([seed, job, key, number]).encode()
    return int.from_bytes(hashlib.sha256(content).digest()[: _HASH_BITS // 8], "big")


def parse_study(matrix: Sequence[str] = (), vary: Sequence[str] = (), variants: int | None = None) -> Study:
    """The study that options ask for.

    matrix: `key=value,value`, values in YAML. vary: `key=uniform(a,b)`, `log(a,b)`, `normal(mean,deviation)`,
    `integer(a,b)` or `choice(value,value)`. Keys are those of the config, and `config` itself. Raises
    UsageError, also ConfigError for a value that is no YAML, and LimitError for more than MOST_JOBS jobs.
    """
    if variants is not None and variants < 1:
        raise UsageError(f"--variants {variants}: there must be one at least", remedy="give a larger number")
    if vary and variants is None:
        raise UsageError("--vary draws values for variants", remedy="say how many with --variants N")
    keys: set[str] = set()
    axes = [_parse_axis(text, keys) for text in matrix]
    draws = [_parse_draw(text, keys) for text in vary]
    check_count(math.prod(len(axis) for _, axis in axes) * (variants or 1))
    combinations = []
    for values in itertools.product(*(axis for _, axis in axes)):
        pairs = [(key, value) for (key, _), value in zip(axes, values, strict=True)]
        suffix = _folder(pairs) if pairs else ""
        combinations.append(_member(suffix, pairs, "--matrix"))
    return Study(tuple(combinations), tuple(draws), variants)


def check_count(jobs: int) -> None:
    """Raise LimitError for more than MOST_JOBS jobs."""
    if jobs > MOST_JOBS:
        raise LimitError(f"asks for {jobs:,} jobs, the most is {MOST_JOBS:,}", remedy="make several batches")


def _member(suffix: str, values: Sequence[tuple[str, _Value]], option: str) -> Member:
    config = next((value.text for key, value in values if key == _CONFIG), None)
    overrides = (Override(key, value.value, option) for key, value in values if key != _CONFIG)
    return Member(suffix, config, tuple(overrides))


def _folder(values: Sequence[tuple[str, _Value]]) -> str:
    """The name of a combination: `curl.radius_0.1+config_rusting`; a list without its brackets."""
    shown = (f"{key}_{''.join(value.text.split()).strip(_AROUND)}" for key, value in values)
    return safe_path(["+".join(shown)])


def _parse_axis(text: str, keys: set[str]) -> tuple[str, list[_Value]]:
    key, _, values = text.partition("=")
    _check_key(key, values, keys, f"--matrix {shortened(text)}", "key=value,value")
    axis = _values(values, key, f"--matrix {key}", "--matrix")
    names = [_folder([(key, value)]).casefold() for value in axis]
    for i, name in enumerate(names):
        if name in names[:i]:
            one, other = axis[names.index(name)].text, axis[i].text
            what = f"--matrix {key}: {one} and {other} would have one folder"
            raise UsageError(what, remedy="give each value once, or use a manifest")
    return key, axis


def _parse_draw(text: str, keys: set[str]) -> _Draw:
    key, _, call = text.partition("=")
    usage = "key=uniform(a,b), log, normal, integer or choice"
    _check_key(key, call, keys, f"--vary {shortened(text)}", usage)
    match = re.fullmatch(r"\s*(\w+)\s*\((.*)\)\s*", call, re.DOTALL)
    if match is None:
        raise UsageError(f"--vary {shortened(text)} must be {usage}")
    name, inside = match.groups()
    if name not in _LAWS:
        near = did_you_mean(name, _LAWS)
        raise UsageError(f"--vary {key}: there is no {name}{near}", remedy=f"one of {', '.join(_LAWS)}")
    values = _values(inside, key, f"--vary {key}", "--vary")
    try:
        return _Draw(key, _LAWS[name](values))
    except ValueError as error:
        raise UsageError(f"--vary {key}={name}: {error}", remedy=f"say {usage}") from None


def _check_key(key: str, rest: str, keys: set[str], where: str, usage: str) -> None:
    if not all(part.strip() for part in key.split(".")) or not rest.strip():
        raise UsageError(f"{where} must be {usage}")
    if key in keys:
        raise UsageError(f"{where}: {key} is given twice", remedy="give it once")
    keys.add(key)


def _values(text: str, key: str, where: str, option: str) -> list[_Value]:
    """The values between the commas that are neither in brackets nor in quotes."""
    pieces = _split(text)
    if pieces is None:
        raise UsageError(f"{where}: a bracket or a quote has no partner in {shortened(text)}")
    if not all(pieces):
        raise UsageError(f"{where}: a value is missing in {shortened(text)}")
    return [_Value(piece, read_value(piece, option, key)) for piece in pieces]


def _split(text: str) -> list[str] | None:
    """The pieces between commas outside brackets and quotes; None where one of these is open at the end."""
    pieces = [""]
    closing: list[str] = []
    for sign in text:
        is_quoted = bool(closing) and closing[-1] in "\"'"
        if closing and sign == closing[-1]:
            closing.pop()
        elif not is_quoted and sign in "\"'" and (closing or not pieces[-1].strip()):
            closing.append(sign)  # within a word it is an apostrophe
        elif not is_quoted and sign in _PAIRS:
            closing.append(_PAIRS[sign])
        elif not is_quoted and sign in _PAIRS.values():
            return None
        elif sign == "," and not closing:
            pieces.append("")
            continue
        pieces[-1] += sign
    return None if closing else [piece.strip() for piece in pieces]


def _share(bits: int) -> float:
    """A number within (0, 1) of a hash."""
    return ((bits >> (_HASH_BITS - 52)) + 0.5) / 2.0**52


def _number(value: float, low: float = -math.inf, high: float = math.inf) -> _Value:
    rounded = min(max(float(f"{value:.{_DIGITS}g}"), low), high)
    return _Value(repr(rounded), rounded)


def _two_numbers(values: Sequence[_Value]) -> tuple[float, float]:
    numbers = [value.value for value in values]
    if len(numbers) != 2 or not all(type(x) in (int, float) and math.isfinite(x) for x in numbers):
        raise ValueError(f"needs two numbers, not {', '.join(value.text for value in values)}")
    return float(numbers[0]), float(numbers[1])


def _range(values: Sequence[_Value]) -> tuple[float, float]:
    low, high = _two_numbers(values)
    if low > high:
        raise ValueError(f"{values[0].text} is above {values[1].text}")
    return low, high


def _uniform(values: Sequence[_Value]) -> Callable[[int], _Value]:
    low, high = _range(values)
    return lambda bits: _number(low + (high - low) * _share(bits), low, high)


def _log(values: Sequence[_Value]) -> Callable[[int], _Value]:
    low, high = _range(values)
    if low <= 0:
        raise ValueError(f"a logarithm needs numbers above 0, not {values[0].text}")
    return lambda bits: _number(low * math.exp(_share(bits) * math.log(high / low)), low, high)


def _normal(values: Sequence[_Value]) -> Callable[[int], _Value]:
    mean, deviation = _two_numbers(values)
    if deviation < 0:
        raise ValueError(f"the deviation {values[1].text} is below 0")
    standard = NormalDist()
    return lambda bits: _number(mean + deviation * standard.inv_cdf(_share(bits)))


def _integer(values: Sequence[_Value]) -> Callable[[int], _Value]:
    _range(values)
    low, high = values[0].value, values[1].value
    if not (isinstance(low, int) and isinstance(high, int)):
        raise ValueError(f"needs whole numbers, not {values[0].text}, {values[1].text}")

    def pick(bits: int) -> _Value:
        number = low + (bits * (high - low + 1) >> _HASH_BITS)
        return _Value(str(number), number)

    return pick


def _choice(values: Sequence[_Value]) -> Callable[[int], _Value]:
    return lambda bits: values[bits * len(values) >> _HASH_BITS]


_LAWS = {"uniform": _uniform, "log": _log, "normal": _normal, "integer": _integer, "choice": _choice}
