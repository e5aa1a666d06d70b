"""A small, strict reader of configs and a validator of the published JSON Schema, both of the tests' own.

Of the package they take nothing but the schema that `weathercoat config schema` prints. The reader takes
nodes from PyYAML's base loader, which gives no meaning to anything, and decides itself what a scalar means.
"""

from __future__ import annotations

import math
import re
from typing import Any

import yaml

_CORE = "tag:yaml.org,2002:"
_NUMBER = re.compile(r"[-+]?(\d+(_\d+)*|(\.\d+|\d+(\.\d*)?)([eE][-+]?\d+)?)$", re.ASCII)
_WHOLE = re.compile(r"[-+]?\d+(_\d+)*$", re.ASCII)
_NOT_FINITE = re.compile(r"([-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN))$")


class BrokenError(Exception):
    """The file is no valid config; the message says why."""


class _Loader(yaml.BaseLoader):
    """Composes nodes; no scalar is anything but text, unless a tag says so."""


def read(data: bytes) -> dict[str, Any]:
    """The mapping in a file, its values as Python's. Raises BrokenError."""
    try:
        node = yaml.compose(data.decode("utf-8-sig"), Loader=_Loader)
    except (UnicodeDecodeError, yaml.YAMLError, RecursionError) as error:
        raise BrokenError(f"no YAML: {error}") from None
    if node is None:
        return {}
    value = _value(node, ())
    if value is None:
        return {}
    if not isinstance(value, dict):
        raise BrokenError("no mapping")
    return value


def _value(node: yaml.Node, above: tuple[int, ...]) -> Any:
    if id(node) in above:
        raise BrokenError("a value contains itself")
    inside = (*above, id(node))
    if isinstance(node, yaml.SequenceNode) and node.tag == _CORE + "seq":
        return [_value(child, inside) for child in node.value]
    if isinstance(node, yaml.MappingNode) and node.tag == _CORE + "map":
        result: dict[str, Any] = {}
        for key, child in node.value:
            if not isinstance(key, yaml.ScalarNode) or key.value in result:
                raise BrokenError(f"no key, or given twice: {key.value!r}")
            result[key.value] = _value(child, inside)
        return result
    if isinstance(node, yaml.ScalarNode):
        return _scalar(node)
    raise BrokenError(f"tag {node.tag}")


def _scalar(node: yaml.ScalarNode) -> Any:
    text, kind = node.value, node.tag.removeprefix(_CORE)
    if kind == "str" and node.style is not None:
        return text
    if kind == "str" and node.tag == _CORE + "str" and _is_tagged(node):
        return text
    if kind not in ("str", "int", "float", "bool", "null"):
        raise BrokenError(f"tag {node.tag}")
    value = _meaning(text)
    if kind == "str" or value is None or isinstance(value, bool | int | float):
        return value
    raise BrokenError(f"{text!r} is no {kind}")


def _is_tagged(node: yaml.ScalarNode) -> bool:
    """Whether the source has a tag in front of a plain scalar: its node then begins before its text does."""
    buffer, begin = node.start_mark.buffer, node.start_mark.pointer
    return buffer is not None and re.match(r"(&\S+\s+)?!\S", buffer[begin : begin + 200]) is not None


def _meaning(text: str) -> Any:
    """A plain scalar by the core schema of YAML 1.2."""
    if text in ("", "~", "null", "Null", "NULL"):
        return None
    if text in ("true", "True", "TRUE"):
        return True
    if text in ("false", "False", "FALSE"):
        return False
    if _WHOLE.match(text):
        return int(text) if len(text) < 4000 else math.inf
    if _NUMBER.match(text):
        return float(text)
    if _NOT_FINITE.match(text):
        return float(text.replace(".", ""))
    return text


def flaw(value: Any, schema: dict[str, Any], part: dict[str, Any] | None = None, at: str = "") -> str | None:
    """Why a value does not fit (a part of) a JSON Schema, None where it does; its sections may be empty."""
    part = schema if part is None else part
    if "$ref" in part:
        target = schema["$defs"][part["$ref"].rpartition("/")[2]]
        is_empty_section = value is None and target.get("type") == "object"
        return None if is_empty_section else flaw(value, schema, target, at)
    for word in ("anyOf", "oneOf"):
        if word in part:
            found = [flaw(value, schema, choice, at) for choice in part[word]]
            return " and ".join(str(why) for why in found) if all(found) else None
    if "const" in part and not _is_same(value, part["const"]):
        return f"{at}: {value!r} is not {part['const']!r}"
    if "enum" in part and not any(_is_same(value, choice) for choice in part["enum"]):
        return f"{at}: {value!r} is none of {part['enum']}"
    if "type" in part and not _TYPES[part["type"]](value):
        return f"{at}: {value!r} is no {part['type']}"
    return _flaw_of_contents(value, schema, part, at)


def _flaw_of_contents(value: Any, schema: dict[str, Any], part: dict[str, Any], at: str) -> str | None:
    if isinstance(value, dict):
        for key, inner in value.items():
            if key not in part["properties"]:
                return f"{at}.{key}: unknown"
            found = flaw(inner, schema, part["properties"][key], f"{at}.{key}")
            if found:
                return found
    elif isinstance(value, list):
        if not part.get("minItems", 0) <= len(value) <= part.get("maxItems", math.inf):
            return f"{at}: {len(value)} items"
        kinds = part.get("prefixItems", []) + [part.get("items", {})] * len(value)
        for number, (inner, kind) in enumerate(zip(value, kinds, strict=False)):
            found = flaw(inner, schema, kind, f"{at}[{number}]")
            if found:
                return found
    elif isinstance(value, str):
        if "pattern" in part and not re.search(part["pattern"].replace("$", r"\Z"), value):
            return f"{at}: {value!r} does not match"
    elif isinstance(value, int | float) and not isinstance(value, bool):
        bounds = (
            ("minimum", value >= part.get("minimum", -math.inf)),
            ("maximum", value <= part.get("maximum", math.inf)),
            ("exclusiveMinimum", value > part.get("exclusiveMinimum", -math.inf)),
            ("exclusiveMaximum", value < part.get("exclusiveMaximum", math.inf)),
        )
        for name, holds in bounds:
            if name in part and not holds:
                return f"{at}: {value!r} breaks {name} {part[name]}"
    return None


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _is_same(value: Any, choice: Any) -> bool:
    """Equal as JSON: true is not 1, but 1.0 is."""
    return value == choice and isinstance(value, bool) == isinstance(choice, bool)


_TYPES = {
    "object": lambda value: isinstance(value, dict),
    "array": lambda value: isinstance(value, list),
    "string": lambda value: isinstance(value, str),
    "boolean": lambda value: isinstance(value, bool),
    "null": lambda value: value is None,
    "number": _is_number,
    "integer": lambda value: _is_number(value) and value == int(value),
}
