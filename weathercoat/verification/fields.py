"""JSON that is not trusted: reading it, and taking values of a known type out of it."""

from __future__ import annotations

import json
import math
from typing import Any

from weathercoat.verification.findings import BrokenFileError


def read_object(content: bytes) -> dict[str, Any]:
    """A JSON object of finite numbers; raises BrokenFileError."""
    try:
        found = json.loads(content.decode("utf-8"), parse_constant=_refuse)
    except (ValueError, RecursionError) as error:
        raise BrokenFileError(f"no valid JSON: {error}") from error
    if not isinstance(found, dict):
        raise BrokenFileError("no JSON object")
    return found


def take(content: object, key: str, kind: type, default: Any = None) -> Any:
    """The value at a dotted key such as `config.output.formats`; parts that are numbers index lists.

    kind: `float` takes any finite number, `int` whole ones. Raises BrokenFileError where there is none
    of that kind, unless a default is given for what is missing.
    """
    value: Any = content
    for part in key.split("."):
        if isinstance(value, dict) and part in value:
            value = value[part]
        elif isinstance(value, list) and part.isdigit() and int(part) < len(value):
            value = value[int(part)]
        elif default is not None:
            return default
        else:
            raise BrokenFileError(f"holds no {key}")
    if kind is float and is_number(value):
        return float(value)
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        raise BrokenFileError(f"{key} is {str(value)[:40]!r}, not of type {kind.__name__}")
    return value


def is_number(value: object) -> bool:
    """Whether the value is a number that a double can hold."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    return abs(value) <= 1.7e308 if isinstance(value, int) else math.isfinite(value)


def _refuse(name: str) -> float:
    raise ValueError(f"{name} is no number of JSON")
