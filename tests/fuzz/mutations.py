"""Ways to damage a file: bytes of any file, words and lines of text, headers of PLY, trees of glTF."""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Callable
from typing import Any

import numpy as np

from tests.fuzz.seeds import Seed, pack_glb

Random = np.random.Generator

WORDS = (
    "", "-", "0", "1", "-1", "2", "3", "255", "256", "65535", "65536", "2147483647", "2147483648",
    "-2147483649", "4294967295", "99999999999999999999", "1e308", "1e999", "-1e-320", "nan", "-inf", "1.0x",
    "1,5", "0x10",
    "1_000", "1.5", "3.0", ".", "+", "1e", "--1", "1/2", "//", "/", "#", "\\", "\\\n", "\0", "é", "\n", "\t",
    "\r", " ", "f", "v", "vt", "g", "s", "end", "solid", "facet", "endsolid", "end_header", "OFF", "ply",
)  # fmt: skip
_BYTES = (b"\0", b"\xff", b"\x7f", b"\x80", b"\n", b"\r", b" ", b"#", b"\\", b"/", b"-", b"0", b"9", b'"')
_BITS = (
    b"\0\0\0\0", b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f", b"\0\0\0\x80", b"\0\0\xc0\x7f", b"\x7f\xc0\0\0",
    b"\0\0\x80\x7f", b"\0\0\x80\xff", b"\1\0\0\0", b"\0\0\0\1", b"\0\0\1\0", b"\xff\xff\x7f\x7f",
)  # fmt: skip
_VALUES: tuple[Any, ...] = (
    None, True, False, -1, 0, 1, 2, 3, 7, 255, 65536, 2**31, 2**32, 2**63, 10**12, 10**30, 1.5, -0.0, 1e308,
    float("nan"), float("inf"), "", "1", "POSITION", "VEC3", "SCALAR", [], {}, [0], [[1]], [None], {"a": 1},
)  # fmt: skip


def mutate(seed: Seed, random: Random) -> bytes:
    """A damaged copy of a seed: one to three changes, mostly of the kinds that know its format."""
    data = seed.data
    for _ in range(int(random.choice([1, 1, 1, 2, 2, 3]))):
        ways = _WAYS[_kind(seed, data)] if random.random() < 0.75 else _OF_BYTES
        data = ways[int(random.integers(len(ways)))](data, random)
    return data


def _kind(seed: Seed, data: bytes) -> str:
    if seed.extension in ("gltf", "glb"):
        return "tree"
    if data.startswith(b"ply"):
        return "ply"
    return "text" if b"\0" not in data[:200] else "bytes"


# Bytes


def _span(data: bytes, random: Random, longest: int = 60) -> tuple[int, int]:
    begin = int(random.integers(len(data) + 1))
    return begin, min(len(data), begin + 1 + int(random.integers(longest)))


def _flip_bit(data: bytes, random: Random) -> bytes:
    at = int(random.integers(max(len(data), 1)))
    return data[:at] + bytes(b ^ 1 << int(random.integers(8)) for b in data[at : at + 1]) + data[at + 1 :]


def _set_byte(data: bytes, random: Random) -> bytes:
    at = int(random.integers(len(data) + 1))
    return data[:at] + _BYTES[int(random.integers(len(_BYTES)))] + data[at + 1 :]


def _insert_bytes(data: bytes, random: Random) -> bytes:
    at = int(random.integers(len(data) + 1))
    return data[:at] + random.bytes(1 + int(random.integers(8))) + data[at:]


def _delete_bytes(data: bytes, random: Random) -> bytes:
    begin, end = _span(data, random)
    return data[:begin] + data[end:]


def _double_block(data: bytes, random: Random) -> bytes:
    begin, end = _span(data, random)
    return data[:end] + data[begin:]


def _move_block(data: bytes, random: Random) -> bytes:
    begin, end = _span(data, random)
    block, rest = data[begin:end], data[:begin] + data[end:]
    at = int(random.integers(len(rest) + 1))
    return rest[:at] + block + rest[at:]


def _truncate(data: bytes, random: Random) -> bytes:
    return data[: int(random.integers(len(data) + 1))]


def _append(data: bytes, random: Random) -> bytes:
    tails = (b"\0", b"\n", b" ", b"0", b"x", b"1 2 3\n", bytes(70), data[-40:], random.bytes(20))
    return data + tails[int(random.integers(len(tails)))]


def _set_four(data: bytes, random: Random) -> bytes:
    at = int(random.integers(max(len(data) - 3, 1)))
    return data[:at] + _BITS[int(random.integers(len(_BITS)))] + data[at + 4 :]


_OF_BYTES: tuple[Callable[[bytes, Random], bytes], ...] = (
    _flip_bit, _set_byte, _insert_bytes, _delete_bytes, _double_block, _move_block, _truncate, _append,
    _set_four,
)  # fmt: skip


# Text

_WORD = re.compile(rb"\S+")


def _words(data: bytes, random: Random, pattern: re.Pattern[bytes] = _WORD) -> list[tuple[int, int]]:
    """Two random words of the text, or fewer."""
    spans = [match.span() for match in pattern.finditer(data)]
    return [spans[int(random.integers(len(spans)))] for _ in range(2)] if spans else []


def _any_word(random: Random) -> bytes:
    return WORDS[int(random.integers(len(WORDS)))].encode()


def _replace_number(data: bytes, random: Random) -> bytes:
    for begin, end in _words(data, random, re.compile(rb"-?\d[\d.e+-]*"))[:1]:
        return data[:begin] + _any_word(random) + data[end:]
    return data


def _nudge_number(data: bytes, random: Random) -> bytes:
    for begin, end in _words(data, random, re.compile(rb"\d+"))[:1]:
        change = int(random.choice([-1, 1, 10, -10, 1000]))
        return data[:begin] + str(int(data[begin:end][:18]) + change).encode() + data[end:]
    return data


def _replace_word(data: bytes, random: Random) -> bytes:
    for begin, end in _words(data, random)[:1]:
        return data[:begin] + _any_word(random) + data[end:]
    return data


def _add_to_word(data: bytes, random: Random) -> bytes:
    for _, end in _words(data, random)[:1]:
        return data[:end] + _any_word(random) + data[end:]
    return data


def _swap_words(data: bytes, random: Random) -> bytes:
    (a, b), (c, d) = sorted(_words(data, random) or [(0, 0), (0, 0)])
    return data if c < b else data[:a] + data[c:d] + data[b:c] + data[a:b] + data[d:]


def _of_lines(change: Callable[[list[bytes], Random], object]) -> Callable[[bytes, Random], bytes]:
    def mutator(data: bytes, random: Random) -> bytes:
        lines = data.split(b"\n")
        change(lines, random)
        return b"\n".join(lines)

    return mutator


def _one(lines: list[bytes], random: Random) -> int:
    return int(random.integers(len(lines)))


def _delete_line(lines: list[bytes], random: Random) -> None:
    del lines[_one(lines, random)]


def _double_line(lines: list[bytes], random: Random) -> None:
    lines.insert(_one(lines, random), lines[_one(lines, random)])


def _swap_lines(lines: list[bytes], random: Random) -> None:
    i, j = _one(lines, random), _one(lines, random)
    lines[i], lines[j] = lines[j], lines[i]


def _join_lines(lines: list[bytes], random: Random) -> None:
    i = _one(lines, random)
    lines[i : i + 2] = [b" ".join(lines[i : i + 2])]


_OF_TEXT = (
    _replace_number, _replace_number, _nudge_number, _replace_word, _add_to_word, _swap_words,
    _of_lines(_delete_line), _of_lines(_double_line), _of_lines(_swap_lines), _of_lines(_join_lines),
)  # fmt: skip


# PLY: its header, or a body of text


def _of_header(data: bytes, random: Random) -> bytes:
    header, end, body = data.partition(b"end_header")
    way = _OF_TEXT[int(random.integers(len(_OF_TEXT)))]
    return way(header, random) + end + body


def _change_ply_word(data: bytes, random: Random) -> bytes:
    words = (
        b"char", b"uchar", b"short", b"ushort", b"int", b"uint", b"float", b"double", b"int8", b"x", b"y",
        b"vertex_indices", b"list", b"vertex", b"face", b"ascii", b"binary_little_endian", b"property",
        b"binary_big_endian", b"element", b"comment", b"red",
    )  # fmt: skip
    header, end, body = data.partition(b"end_header")
    for begin, stop in _words(header, random)[:1]:
        header = header[:begin] + words[int(random.integers(len(words)))] + header[stop:]
    return header + end + body


def _of_body(data: bytes, random: Random) -> bytes:
    header, end, body = data.partition(b"end_header")
    ways = _OF_TEXT if b"ascii" in header else _OF_BYTES
    return header + end + ways[int(random.integers(len(ways)))](body, random)


# glTF: its tree


def _of_tree(change: Callable[[Any, Random], None]) -> Callable[[bytes, Random], bytes]:
    def mutator(data: bytes, random: Random) -> bytes:
        is_packed = data.startswith(b"glTF")
        size = int.from_bytes(data[12:16], "little")
        try:
            document = json.loads(data[20 : 20 + size] if is_packed else data)
        except (ValueError, RecursionError):
            return _OF_BYTES[int(random.integers(len(_OF_BYTES)))](data, random)
        change(document, random)
        return pack_glb(document, data[28 + size :]) if is_packed else json.dumps(document).encode()

    return mutator


def _place(document: Any, random: Random) -> tuple[Any, Any]:
    """A container of the tree and a key or index in it; any place as likely as another."""
    places: list[tuple[Any, Any]] = []
    stack = [document]
    while stack:
        node = stack.pop()
        items = node.items() if isinstance(node, dict) else enumerate(node)
        for key, value in items:
            places.append((node, key))
            if isinstance(value, (dict, list)):
                stack.append(value)
    return places[int(random.integers(len(places)))] if places else ({}, "a")


def _set_value(document: Any, random: Random) -> None:
    node, key = _place(document, random)
    node[key] = _VALUES[int(random.integers(len(_VALUES)))]


def _nudge_value(document: Any, random: Random) -> None:
    for _ in range(30):
        node, key = _place(document, random)
        if node and isinstance(node[key], (int, float)):
            node[key] += int(random.choice([-3, -1, 1, 2, 4, 100, 2**31]))
            return


def _delete_value(document: Any, random: Random) -> None:
    node, key = _place(document, random)
    if node:
        del node[key]


def _rename_key(document: Any, random: Random) -> None:
    for _ in range(30):
        node, key = _place(document, random)
        if isinstance(node, dict) and node:
            value = node.pop(key)
            node[(key[:-1], key + "s", key.upper(), "matrix", "sparse", "")[int(random.integers(6))]] = value
            return


def _copy_value(document: Any, random: Random) -> None:
    source, key = _place(document, random)
    target, place = _place(document, random)
    if source and target:
        target[place] = json.loads(json.dumps(source[key]))


def _double_item(document: Any, random: Random) -> None:
    for _ in range(30):
        node, key = _place(document, random)
        if isinstance(node, list) and node:
            node.insert(key, json.loads(json.dumps(node[key])))
            return


def _of_buffer(data: bytes, random: Random) -> bytes:
    """The numbers of a GLB, where there are any."""
    if not data.startswith(b"glTF"):
        return _OF_BYTES[int(random.integers(len(_OF_BYTES)))](data, random)
    at = 28 + struct.unpack_from("<I", data.ljust(16, b"\0"), 12)[0]
    return data[:at] + (_flip_bit, _set_four)[int(random.integers(2))](data[at:], random)


_WAYS: dict[str, tuple[Callable[[bytes, Random], bytes], ...]] = {
    "bytes": _OF_BYTES,
    "text": _OF_TEXT,
    "ply": (_of_header, _change_ply_word, _of_body, _of_body),
    "tree": (
        *map(
            _of_tree,
            (_set_value, _set_value, _nudge_value, _nudge_value, _delete_value, _rename_key, _copy_value),
        ),
        _of_tree(_double_item),
        _of_buffer,
    ),
}
