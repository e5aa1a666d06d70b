"""The config in words: commented example, resolved values, reference in Markdown, JSON Schema."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterator
from typing import Any

from weathercoat.config.document import read_value
from weathercoat.config.load import LoadedConfig
from weathercoat.config.schema import Config, Parameter, entry_of, parameters, section_of
from weathercoat.config.section import Section

_WIDEST = 80  # characters; comments stand beside values that are no longer
_EXAMPLE_HEADER = """\
# The defaults, spelled out: a file to start from. Every key may be left out.
# Lengths are in sizes (the square root of the area), times in ages: one config fits a model of any scale.
"""
_MARKDOWN_HEADER = """\
# Configuration

Written by `weathercoat config schema --markdown`. Every key may be left out. Lengths are in *sizes* (the
square root of the painted area), rates are per *age*, and forces are in units of the drying tension that an
intact film tends to. What follows the paper literally is marked so; the config `literal` chooses all of it.
"""


def example_yaml(config: Config | None = None, header: str = _EXAMPLE_HEADER) -> str:
    """A config file with every key, its value in `config` (the defaults), and its meaning as a comment."""
    lines = [*header.splitlines(), ""]
    for section, about, members in _sections():
        values = (config or Config()).as_dict()
        indent = "  " if section else ""
        if section:
            values = values[section]
            off = section == "remesh" and values is False
            lines += ["", f"# {about}", f"{section}: off" if off else f"{section}:"]
            if off:
                continue
        for parameter in members:
            value = values[parameter.key.rpartition(".")[2]]
            unset = value is None or (parameter.key in ("snapshots.steps", "preset") and not value)
            lines += textwrap.wrap(
                _comment(parameter), 100, initial_indent=f"{indent}# ", subsequent_indent=f"{indent}# "
            )
            lines += [f"{indent}{'# ' if unset else ''}{parameter.key.rpartition('.')[2]}: {_value(value)}"]
    return "\n".join(lines) + "\n"


def resolved_yaml(loaded: LoadedConfig) -> str:
    """All values, each with a comment that says where it came from; loads back to the same config."""
    rows: list[tuple[str, str]] = []
    values = loaded.config.as_dict()
    shown = ""
    for key, origin in loaded.origins.items():
        section, _, name = key.rpartition(".")
        if section and section != shown:
            rows.append((f"{section}:", ""))
        shown = section
        value = values[section][name] if section else values[name]
        if value is not None:
            rows.append((f"{'  ' if section else ''}{name}: {_value(value)}", origin))
    width = min(max(len(text) for text, _ in rows), _WIDEST)
    return "".join(f"{text:{width}}  # {origin}\n" if origin else f"{text}\n" for text, origin in rows)


def reference_markdown() -> str:
    """Every parameter in tables, and the keys of the paper's symbols."""
    lines = [_MARKDOWN_HEADER]
    for section, about, members in (*_sections(), *_entries()):
        lines += [f"## `{section}`" if section else "## Top level", "", about, ""]
        lines += ["| key | default | accepts | unit | meaning |", "|---|---|---|---|---|"]
        for parameter in members:
            cells = (f"`{parameter.key}`", f"`{_value(parameter.default)}`", parameter.kind, parameter.unit)
            lines.append("| " + " | ".join((*cells, parameter.description)) + " |")
        lines.append("")
    lines += ["## The paper's symbols", "", "| symbol | key | meaning |", "|---|---|---|"]
    named = (parameter for parameter in parameters() if parameter.symbol)
    lines += [f"| {p.symbol} | `{p.key}` | {p.description} |" for p in named]
    return "\n".join(lines) + "\n"


def json_schema() -> dict[str, Any]:
    """The JSON Schema (2020-12) of a config file, for editors."""
    schema = Config.model_json_schema(by_alias=True)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **schema,
        "title": "weathercoat config",
    }


def _sections() -> Iterator[tuple[str, str, list[Parameter]]]:
    """Name, description and parameters of each section; the top level comes first, without a name."""
    top = [parameter for parameter in parameters() if "." not in parameter.key]
    yield "", _first_paragraph(Config), top
    for name, field in Config.model_fields.items():
        section = section_of(field)
        if section is not None:
            yield name, _first_paragraph(section), list(parameters(section, f"{name}."))


def _entries(section: type[Section] = Config, prefix: str = "") -> Iterator[tuple[str, str, list[Parameter]]]:
    """As `_sections`, of what lists hold and of the sections in that: `steering[]`, `steering[].by[]`."""
    for name, field in section.model_fields.items():
        entry = entry_of(field)
        inner = entry or (section_of(field) if prefix else None)
        if inner is None:
            continue
        key = f"{prefix}{field.alias or name}{'[]' if entry else ''}"
        direct = [member for member in parameters(inner, f"{key}.") if member.key.rpartition(".")[0] == key]
        yield key, _first_paragraph(inner), direct
        yield from _entries(inner, f"{key}.")


def _first_paragraph(section: type[Section]) -> str:
    return " ".join((section.__doc__ or "").partition("\n\n")[0].split())


def _comment(parameter: Parameter) -> str:
    unit = f" [{parameter.unit}]" if parameter.unit else ""
    return f"{parameter.description}{unit} ({parameter.kind})"


def _value(value: Any) -> str:
    """The value as YAML that reads back the same."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_value(inner)}" for key, inner in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
    if value is False or value is True or value is None:
        return json.dumps(value)
    if isinstance(value, str) and not (
        value.replace("_", "").isalpha() and read_value(value, "", "") == value
    ):
        return json.dumps(value, ensure_ascii=False)
    return str(value)
