"""YAML with line numbers, read as version 1.2 means it.

PyYAML follows YAML 1.1: `off` is a boolean, `1e-3` is text and `1:30` is ninety. Here only true and false
are booleans, and every usual spelling of a number is a number. Nothing is executed; neither nesting nor
aliases can make a small file large.
"""

from __future__ import annotations

import re
from typing import Any, NamedTuple

import yaml

from weathercoat.errors import ConfigError, ConfigProblem

LARGEST_FILE = 256 * 1024
MOST_NODES = 10_000
LONGEST_NUMBER = 400


class Item(NamedTuple):
    """The value of a key and the line (from 1) where the key stands; a mapping is a dict of items."""

    value: Any
    line: int


class _Loader(yaml.SafeLoader):
    """Composes nodes only; plain scalars follow the core schema of YAML 1.2, but 10_000 is a number."""

    yaml_implicit_resolvers = {}  # noqa: RUF012


_TAG = "tag:yaml.org,2002:"
_INTEGER = re.compile(r"[-+]?[0-9]+(_[0-9]+)*$")
for _name, _pattern in (
    ("null", re.compile(r"(~|null|Null|NULL|)$")),
    ("bool", re.compile(r"(true|True|TRUE|false|False|FALSE)$")),
    ("int", _INTEGER),
    (
        "float",
        re.compile(
            r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?$|[-+]?\.(inf|Inf|INF)$|\.(nan|NaN|NAN)$"
        ),
    ),
):
    _Loader.add_implicit_resolver(_TAG + _name, _pattern, None)


def read_document(data: bytes, where: str) -> dict[str, Item]:
    """The mapping that a YAML file holds, empty for comments alone; its lists are of items. Raises
    `ConfigError`.
    """
    if len(data) > LARGEST_FILE:
        raise ConfigError.at(where, f"larger than {LARGEST_FILE // 1024} KiB, this is no config")
    node = _compose(decode(data, where), where)
    reader = _Reader(where, keeps_lines=True)
    value = None if node is None else reader.read(node, "")
    if not reader.problems and value is not None and not isinstance(value, dict):
        reader.problems.append(ConfigProblem(where, 1, "", "must be a mapping of keys to values"))
    if reader.problems:
        raise ConfigError(problems=tuple(reader.problems))
    return value or {}


def read_items(data: bytes, where: str, most_nodes: int) -> Any:
    """What a YAML file holds, at most `most_nodes` values, with the lines of what is in a list as well: a
    list is one of items. Raises `ConfigError`.
    """
    node = _compose(decode(data, where), where)
    reader = _Reader(where, most_nodes, keeps_lines=True)
    value = None if node is None else reader.read(node, "")
    if reader.problems:
        raise ConfigError(problems=tuple(reader.problems))
    return value


def decode(data: bytes, where: str) -> str:
    """The text of a file in UTF-8, without a byte order mark. Raises `ConfigError` with the line."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        what = f"byte 0x{data[error.start]:02x} is not UTF-8; save the file as UTF-8"
        raise ConfigError.at(where, what, line=line) from None


def read_value(text: str, where: str, key: str) -> Any:
    """The value of a piece of YAML, such as `0.3` or `[1, 2]`; a leading # makes a colour, no comment."""
    if text.startswith("#"):
        return text
    node = _compose(text, where)
    reader = _Reader(where)
    value = None if node is None else reader.read(node, key)
    if reader.problems:
        raise ConfigError(problems=tuple(reader.problems))
    return value


def _compose(text: str, where: str) -> yaml.Node | None:
    try:
        return yaml.compose(text, Loader=_Loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        what = error.problem or error.context or "not valid YAML"
        if "'\\t'" in what:
            what = "a tab indents this line; use spaces"
        raise ConfigError.at(where, what, line=mark.line + 1 if mark else 0) from None
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        what = f"character U+{ord(text[error.position]):04X} is not allowed in YAML"
        raise ConfigError.at(where, what, line=line) from None
    except RecursionError:
        raise ConfigError.at(where, "nested too deeply") from None


class _Reader:
    """Turns nodes into values, and counts them, since an alias may repeat its anchor at will."""

    def __init__(self, where: str, most_nodes: int = MOST_NODES, *, keeps_lines: bool = False) -> None:
        self.where = where
        self.most_nodes = most_nodes
        self.keeps_lines = keeps_lines
        self.problems: list[ConfigProblem] = []
        self.nodes = 0
        self.open: set[int] = set()

    def read(self, node: yaml.Node, key: str) -> Any:
        self.nodes += 1
        if self.nodes > self.most_nodes:
            what = f"more than {self.most_nodes:,} values, aliases included"
            raise ConfigError(problems=(*self.problems, ConfigProblem(self.where, 0, "", what)))
        if isinstance(node, yaml.ScalarNode):
            return self._scalar(node, key)
        if id(node) in self.open:
            return self._refuse(node, key, "an alias contains itself")
        self.open.add(id(node))
        try:
            if isinstance(node, yaml.MappingNode) and node.tag == _TAG + "map":
                return self._mapping(node, key)
            if isinstance(node, yaml.SequenceNode) and node.tag == _TAG + "seq":
                items = (
                    Item(self.read(child, f"{key}[{i}]"), child.start_mark.line + 1)
                    for i, child in enumerate(node.value)
                )
                return [item if self.keeps_lines else without_lines(item.value) for item in items]
        finally:
            self.open.discard(id(node))
        return self._refuse(node, key, f"the tag {node.tag} is not supported")

    def _mapping(self, node: yaml.MappingNode, prefix: str) -> dict[str, Item]:
        result: dict[str, Item] = {}
        for key_node, value_node in node.value:
            line = key_node.start_mark.line + 1
            if not isinstance(key_node, yaml.ScalarNode):
                self._refuse(key_node, prefix, "a key must be a word")
                continue
            name = key_node.value
            key = f"{prefix}.{name}" if prefix else name
            if name in result:
                self._refuse(key_node, key, f"given twice, first on line {result[name].line}")
                continue
            result[name] = Item(self.read(value_node, key), line)
        return result

    def _scalar(self, node: yaml.ScalarNode, key: str) -> Any:
        kind, text = node.tag.removeprefix(_TAG), node.value
        if kind == "str":
            return text
        if kind == "null" and text.lower() in ("", "~", "null"):
            return None
        if kind == "bool" and text.lower() in ("true", "false"):
            return text.lower() == "true"
        if kind in ("int", "float") and len(text) <= LONGEST_NUMBER:
            try:
                return int(text) if _INTEGER.match(text) else float(re.sub(r"\.(?=[iInN])", "", text))
            except ValueError:
                pass
        return self._refuse(node, key, f"{text[:40]!r} cannot be read as {node.tag}")

    def _refuse(self, node: yaml.Node, key: str, what: str) -> None:
        self.problems.append(ConfigProblem(self.where, node.start_mark.line + 1, key, what))


def without_lines(value: Any) -> Any:
    """`value` without the lines of its mappings, and of its lists where they have them."""
    if isinstance(value, dict):
        return {key: without_lines(item.value) for key, item in value.items()}
    if isinstance(value, list):
        return [without_lines(item.value) if isinstance(item, Item) else item for item in value]
    return value
