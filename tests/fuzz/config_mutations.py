"""Configs to damage, and ways to damage them: values, keys, lines, bytes, and what YAML can hide."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np

from weathercoat.config.describe import json_schema
from weathercoat.config.presets import preset_names, preset_path
from weathercoat.config.schema import Parameter, parameters

Random = np.random.Generator

VALUES = (
    "", "~", "null", "true", "false", "on", "off", "yes", "no", "y", "0", "1", "-1", "2", "3", "4", "1.0",
    "0.5", "-0.0", "100.0", "1e3", "1E-3", ".5", "5.", "+1", "010", "0x10", "0o17", "10_000", "1__0",
    "1:30", "1,5", "1e308", "1e309", "-1e999", "5e-324", ".inf", "-.inf", ".nan", "nan", "inf",
    "9223372036854775807", "9223372036854775808", "1" * 30, "9" * 399, "9" * 5000, "1e" + "9" * 300, "'1'",
    '"0.3"', "x", "auto", "z", "[0, 0, 1]", "[0, 0, 0]", "[1e200, 0, 0]", "[.nan, 0, 1]", "[0, 0]", "[]",
    "{}", "[[]]", "[1, 2, 3]", "[2, 1]", "[0, 1000]", "{a: 1}", "[ply]", "ply", "[glb, glb]", "[ply, fbx]",
    "#ff0000", "'#ff0000'", "'#ff000'", "'#FF00ff\\n'", "[255, 0, 0]", "[256, 0, 0]", "[1.0, 0, 0]",
    "[true, 0, 0]", "standard", "literal", "[standard, crackle]", "nowhere", "!!str 1", "!!int 1",
    "!!int '1'", "!!float 1", "!!bool yes", "!!null x", "!!binary aGk=", "!!timestamp 2026-01-01",
    "2026-01-01", "!!set {x}", "!!omap [a: 1]", "! 1", "!local 1",
    "!!python/object/apply:os.system [exit 9]", "!!python/name:os.system", "!!python/tuple [1, 2]",
    "!!python/object/new:type [x, [], {}]", "&a 1", "*a", "*nowhere", "&x [*x]", "<<", "|\n    text",
    ">-\n    folded", "'it''s'", '"\\x41\\u263a"', '"\\q"', '"open', "'open", "- 1", "? a", "a: b",
    "%TAG ! x", "@a", "`b", "\u263a", "\u00e9", "\u202e", "\ufeff", "\u0085", "\u2028", "\x00", "\x07",
    "\ud7ff", "\U0001f600", "\t1", "1 # note", "1#no", "x" * 3000,
)  # fmt: skip

KEYS = (
    "", "seed", "version", "preset", "remesh", "lift", "curl.radius", "radius", "rate", "alpha", "<<",
    "null", "true", "1", "1.5", "'seed'", '"seed"', "SEED", "seed ", "? seed", "[a]", "{a: 1}", "é",
    "__class__", "model_config", "mapping", "off", "-", "*a", "&a seed", "!!str seed", "constructor",
    "steps", "count", "x" * 200,
)  # fmt: skip

LINES = (
    "---", "...", "%YAML 1.1", "%YAML 9.9", "%TAG !e! tag:x,2026:", "# note", "\t", "  ", "- a", "<<: *a",
    "<<: {seed: 7}", "defaults: &a {seed: 7}", "seed: 7", "seed: 8", "lift:", "lift: {coefficient: 0.2}",
    "  coefficient: 0.2", "preset: literal", "preset: [curling, crackle]", "preset: [[a]]", "remesh: off",
    "remesh: {faces: 100}", "quality: draft", "quality: auto", "snapshots: {steps: [1, 2]}",
    "snapshots: {count: 2}", "snapshots: {steps: [1], count: 2}", "tension: {initial: 2}",
    "scene: {distance: 3}", "scene: {distance: 3, pixels_per_metre: 10}", "ageing: {steps: 1}",
    "output: {preview: off}", "output: {formats: [ply, ply]}", "paint: {only: '*', except: [a, b]}",
    "paint: {except: }", "model: {up: [0, 0, 2]}",
)  # fmt: skip

BOMB = "\n".join(
    ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    + [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 9)]
)
_DEEP = (
    "a: " + "[" * 200, "a: " + "[" * 20_000, "a: " + "{a: " * 300, "a: " + "[" * 80 + "]" * 80,
    "\n".join(" " * i + "a:" for i in range(400)), "- " * 2000, "? " * 2000, "a: " + "&x " * 50,
    "a: " + "!" * 500, "\n".join(f"k{i}: 1" for i in range(3000)),
    "lift: {" + ", ".join(f"k{i}: 1" for i in range(2000)) + "}",
    "preset: [" + ", ".join(["literal"] * 3000) + "]", "paint: {only: [" + "a, " * 9000 + "a]}",
    "snapshots: {steps: [" + ", ".join(map(str, range(900))) + "]}", BOMB, BOMB + "\nlift: *a8",
    "seed: " + "1" * 100_000, "seed: '" + "\\n" * 50_000 + "'", "#" * 200_000, "seed: 1" + " " * 100_000,
)  # fmt: skip


def make_seeds() -> list[bytes]:
    """Valid configs: those that are shipped, and small ones that a mutation is likelier to hit."""
    shipped = [preset_path(name).read_bytes() for name in preset_names()]
    small = [
        "seed: 5\nlift:\n  coefficient: 0.4\n  sum: plain\ncurl:\n  radius: 0.1\n",
        "version: 1\npreset: [literal, crackle]\nremesh: {faces: 500, crease_angle: 40}\n",
        "model:\n  up: [0, 0, 1]\npaint:\n  only: [body, 'door*']\n  except: glass\nremesh: off\n",
        "appearance:\n  paint: '#3a7886'\n  rust: [132, 51, 0]\n  thickness: 1e-3\n"
        "output: {formats: ply, preview: no}\n",
        "ageing: {steps: 200, duration: 2}\nsnapshots:\n  steps: [0, 50, 200]\n",
        "quality: draft\nscene: {distance: 2.5, field_of_view: 60}\nseed: 9223372036854775807\n",
        "",
    ]
    return [*shipped, *(text.encode() for text in small)]


def valid_value(parameter: Parameter, random: Random) -> Any:
    """A value that the schema allows for a parameter: a bound (or just inside an open one), the default, or
    one between; of words any.
    """
    part = schema_of(parameter.key)
    choices = part.get("anyOf", [part])
    numbers = [choice for choice in choices if choice.get("type") in ("number", "integer")]
    if "const" in part:
        return part["const"]
    if "enum" in part:
        return part["enum"][int(random.integers(len(part["enum"])))]
    if part.get("type") == "boolean":
        return bool(random.integers(2))
    if not numbers:
        return parameter.default
    return _number(numbers[0], parameter.default, random)


def _number(part: dict[str, Any], default: Any, random: Random) -> int | float:
    is_whole = part["type"] == "integer"
    low = part.get("minimum", part.get("exclusiveMinimum"))
    high = part.get("maximum", part.get("exclusiveMaximum"))
    if "exclusiveMinimum" in part:
        low = float(np.nextafter(low, np.inf)) if random.integers(2) else low + 1e-9
    if "exclusiveMaximum" in part:
        high = float(np.nextafter(high, -np.inf))
    way = int(random.integers(4))
    if way == 0:
        return low
    if way == 1:
        return high
    if way == 2 and default is not None:
        return default
    # numbers of every magnitude where there is room for them
    share = float(random.random())
    value = low + (high - low) * share ** float(random.choice([1, 3, 10]))
    return int(value) if is_whole else float(value)


def schema_of(key: str) -> dict[str, Any]:
    """The part of the published schema that describes a dotted key."""
    part: dict[str, Any] = _SCHEMA
    for name in key.split("."):
        part = part["properties"][name]
        reference = part.get("$ref") or next((c["$ref"] for c in part.get("oneOf", ()) if "$ref" in c), None)
        part = _SCHEMA["$defs"][reference.rpartition("/")[2]] if reference else part
    return part


_SCHEMA = json_schema()
_PARAMETERS = list(parameters())


def mutate(seeds: list[bytes], random: Random) -> bytes:
    """A damaged copy of one of the seeds: one to three changes."""
    data = seeds[int(random.integers(len(seeds)))]
    for _ in range(int(random.choice([1, 1, 1, 2, 2, 3]))):
        data = _WAYS[int(random.integers(len(_WAYS)))](data, random)
    return data


def assignment(random: Random) -> str:
    """What may be given to `--set`: mostly a key of the schema and a value, right or wrong."""
    way = int(random.integers(8))
    parameter = _PARAMETERS[int(random.integers(len(_PARAMETERS)))]
    key = parameter.key if way else _one(KEYS, random)
    if way < 3:
        value = str(valid_value(parameter, random))
    else:
        value = _one(VALUES, random)
    if way == 7:
        return _one(
            (key, f"{key}:{value}", f"={value}", f"{key}.x={value}", f".{key}={value}", f"{key}=={value}"),
            random,
        )
    return f"{key}={value}"


def _one(choices: tuple[str, ...], random: Random) -> str:
    return choices[int(random.integers(len(choices)))]


def _of_lines(change: Callable[[list[str], Random], None]) -> Callable[[bytes, Random], bytes]:
    def mutator(data: bytes, random: Random) -> bytes:
        lines = data.decode("utf-8", "surrogateescape").split("\n")
        change(lines, random)
        return "\n".join(lines).encode("utf-8", "surrogateescape")

    return mutator


def _place(lines: list[str], random: Random) -> int:
    """A line, rather one with a key than a comment."""
    keyed = [i for i, line in enumerate(lines) if ":" in line and not line.lstrip().startswith("#")]
    return int(random.choice(keyed)) if keyed else int(random.integers(len(lines)))


def _set_value(lines: list[str], random: Random) -> None:
    i = _place(lines, random)
    lines[i] = f"{lines[i].partition(':')[0]}: {_one(VALUES, random)}"


def _set_bound(lines: list[str], random: Random) -> None:
    """A key with a value at or near a bound, as a section of its own at the end or in the place of a line."""
    parameter = _PARAMETERS[int(random.integers(len(_PARAMETERS)))]
    section, _, name = parameter.key.rpartition(".")
    value = valid_value(parameter, random)
    shown = json.dumps(value)
    lines += [f"{section}:", f"  {name}: {shown}"] if section else [f"{name}: {shown}"]


def _set_key(lines: list[str], random: Random) -> None:
    i = _place(lines, random)
    indent = len(lines[i]) - len(lines[i].lstrip())
    lines[i] = f"{' ' * indent}{_one(KEYS, random)}:{lines[i].partition(':')[2]}"


def _insert_line(lines: list[str], random: Random) -> None:
    lines.insert(int(random.integers(len(lines) + 1)), _one(LINES, random))


def _double_line(lines: list[str], random: Random) -> None:
    lines.insert(int(random.integers(len(lines) + 1)), lines[_place(lines, random)])


def _delete_line(lines: list[str], random: Random) -> None:
    del lines[_place(lines, random)]


def _indent(lines: list[str], random: Random) -> None:
    i = _place(lines, random)
    lines[i] = _one((" ", "  ", "\t", "    ", "- ", "", "\u00a0"), random) + lines[i].lstrip(
        _one((" ", ""), random)
    )


def _swap_lines(lines: list[str], random: Random) -> None:
    i, j = _place(lines, random), _place(lines, random)
    lines[i], lines[j] = lines[j], lines[i]


def _anchor(lines: list[str], random: Random) -> None:
    """Two values of the file: one gets an anchor, the other becomes its alias."""
    i, j = _place(lines, random), _place(lines, random)
    key, _, value = lines[i].partition(":")
    lines[i] = f"{key}: &a{value}"
    lines[j] = f"{lines[j].partition(':')[0]}: *a"


def _append_deep(data: bytes, random: Random) -> bytes:
    return data + b"\n" + _one(_DEEP, random).encode()


def _bytes(data: bytes, random: Random) -> bytes:
    at = int(random.integers(len(data) + 1))
    pieces = (
        b"\xff",
        b"\x00",
        b"\xc3",
        b"\xef\xbb\xbf",
        b"\r\n",
        b"\r",
        b"\t",
        b":",
        b"{",
        b"]",
        b"'",
        b'"',
        b"#",
        b"\\",
    )
    piece = (
        pieces[int(random.integers(len(pieces)))]
        if random.integers(2)
        else random.bytes(1 + int(random.integers(4)))
    )
    return data[:at] + piece + data[at + int(random.integers(3)) :]


def _cut(data: bytes, random: Random) -> bytes:
    begin, end = sorted(int(at) for at in random.integers(0, len(data) + 1, 2))
    return data[:begin] + data[end:] if random.integers(2) else data[begin:end]


def _encode(data: bytes, random: Random) -> bytes:
    text = data.decode("utf-8", "replace")
    return text.encode(_one(("utf-16", "utf-16-le", "utf-32", "utf-8-sig", "latin-1"), random), "replace")


_WAYS: tuple[Callable[[bytes, Random], bytes], ...] = (
    *(_of_lines(_set_value),) * 5, *(_of_lines(_set_bound),) * 5, _of_lines(_set_key),
    *(_of_lines(_insert_line),) * 2, _of_lines(_double_line), _of_lines(_delete_line), _of_lines(_indent),
    _of_lines(_swap_lines), _of_lines(_anchor), _append_deep, _bytes, _bytes, _cut, _encode,
)  # fmt: skip
