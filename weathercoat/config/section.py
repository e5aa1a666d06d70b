"""What sections of the config are made of: their base, their fields, and kinds of values that many have."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, WithJsonSchema


def require_number(value: object) -> object:
    """Pydantic would read true as 1 and "3" as 3; a config that says so is a mistake."""
    if isinstance(value, bool | str):
        raise ValueError("must be a number")
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError("must be a finite number")
    return value


def at_least_one_word(value: object) -> object:
    """A word alone as a list of one."""
    return (value,) if isinstance(value, str) else value


def parse_switch(value: object) -> object:
    """Off and on as YAML 1.1 reads them (booleans) and as YAML 1.2 does (words)."""
    if isinstance(value, bool):
        return value
    if isinstance(value, str) and value in SWITCH:
        return SWITCH[value]
    raise ValueError("must be true or false")


SWITCH = {"on": True, "yes": True, "off": False, "no": False}
SWITCH_SCHEMA = {"enum": [True, False, *SWITCH]}

Real = Annotated[float, BeforeValidator(require_number)]
Whole = Annotated[int, BeforeValidator(require_number)]
Switch = Annotated[bool, BeforeValidator(parse_switch), WithJsonSchema(SWITCH_SCHEMA)]
Names = Annotated[
    tuple[str, ...],
    BeforeValidator(at_least_one_word),
    WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}]}),
]


@dataclass(frozen=True)
class Words:
    """What a parameter accepts, in words, where its type does not tell."""

    text: str


class Section(BaseModel):
    """A part of the config: immutable, and without unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True)


def parameter(
    default: Any,
    description: str,
    *,
    unit: str = "",
    symbol: str = "",
    alias: str | None = None,
    **bounds: Any,
) -> Any:
    """A field with its unit, the paper's symbol where it has one, and bounds (`gt`, `ge`, `lt`, `le`)."""
    extra: Any = {name: text for name, text in (("unit", unit), ("symbol", symbol)) if text}
    return Field(default, description=description, alias=alias, json_schema_extra=extra or None, **bounds)
