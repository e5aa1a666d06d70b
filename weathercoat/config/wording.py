"""Problems of a config in words, with the key or the word that was probably meant."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable
from functools import cache
from typing import Any

from weathercoat.config.schema import Parameter, parameters, section_at

KeyPath = tuple[str, ...]

_SPELLED_SYMBOLS = {"alpha": "α", "beta": "β", "lambda": "λ", "phi0": "φ₀"}  # noqa: RUF001


def explain(detail: Any) -> tuple[KeyPath, str]:
    """Key and words for one of pydantic's errors."""
    location = list(detail["loc"])
    if location[:1] == ["remesh"] and location[1:2] in (["mapping"], ["off"]):
        del location[1]
    path = tuple(f"[{part}]" if isinstance(part, int) else str(part) for part in location)
    kind, value, limits = detail["type"], detail["input"], detail.get("ctx", {})
    shown = _shown(value)
    if kind == "extra_forbidden":
        return path, "unknown key" + nearest_key(path)
    if kind == "value_error":
        return path, f"{limits['error']}" + ("" if isinstance(value, dict) else f", not {shown}")
    if kind == "literal_error":
        words = limits["expected"].replace("'", "")
        return path, f"must be {words}, not {shown}" + did_you_mean(
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
    return shortened(value)


def shortened(value: Any) -> str:
    """The value as Python spells it, the first 40 characters."""
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."


def nearest_key(path: KeyPath) -> str:
    """The key that was meant: a sibling, the paper's symbol, or a key of that name in another section."""
    section = section_at(path[:-1])
    name, prefix = path[-1], ".".join((*path[:-1], "")).replace(".[", "[")
    if section is not None:
        siblings = [prefix + (field.alias or key) for key, field in section.model_fields.items()]
        match = difflib.get_close_matches(prefix + name, siblings, 1, cutoff=0.0)
        if match and difflib.SequenceMatcher(None, name, match[0].removeprefix(prefix)).ratio() >= 0.6:
            return f"; did you mean {match[0]}?"
    symbol = _SPELLED_SYMBOLS.get(name, name)
    known = _known()
    by_symbol = [parameter.key for parameter in known if parameter.symbol == symbol]
    if by_symbol:
        return f"; did you mean {by_symbol[0]}?"
    by_name = {parameter.key.rpartition(".")[2]: parameter.key for parameter in reversed(known)}
    near = difflib.get_close_matches(name, by_name, 1)
    return f"; did you mean {by_name[near[0]]}?" if near else ""


@cache
def _known() -> tuple[Parameter, ...]:
    """Every parameter of the schema."""
    return tuple(parameters())


def did_you_mean(word: Any, candidates: Iterable[str]) -> str:
    near = difflib.get_close_matches(str(word), list(candidates), 1)
    return f"; did you mean {near[0]}?" if near else ""


def color_hint(path: KeyPath) -> str:
    return '; put a colour in quotes: "#rrggbb"' if path[0] == "appearance" else ""
