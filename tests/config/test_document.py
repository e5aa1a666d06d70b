"""YAML as it is read: numbers, words, lines, and everything that must be refused."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weathercoat.config.document import LARGEST_FILE, Item, read_document, read_value
from weathercoat.errors import ConfigError


def problem(data: bytes) -> tuple[int, str]:
    with pytest.raises(ConfigError) as caught:
        read_document(data, "f.yaml")
    assert caught.value.problems[0].where == "f.yaml"
    return caught.value.problems[0].line, caught.value.problems[0].what


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1", 1),
        ("-7", -7),
        ("010", 10),
        ("10_000", 10_000),
        ("1e-3", 0.001),
        ("1E3", 1000.0),
        (".5", 0.5),
        ("5.", 5.0),
        ("+1.5", 1.5),
        ("1:30", "1:30"),
        ("off", "off"),
        ("on", "on"),
        ("no", "no"),
        ("y", "y"),
        ("true", True),
        ("False", False),
        ("null", None),
        ("~", None),
        ("", None),
        ("'1'", "1"),
        ("[1, 2.5, x]", [1, 2.5, "x"]),
        ("2026-01-01", "2026-01-01"),
        ("#ff0000", "#ff0000"),
    ],
)
def test_scalars_mean_what_they_look_like(text: str, expected: Any) -> None:
    value = read_value(text, "--set", "key")
    assert value == expected and type(value) is type(expected)


def test_not_finite_numbers_are_numbers() -> None:
    assert read_value(".inf", "", "") == float("inf")
    assert read_value("-.Inf", "", "") == -float("inf")
    assert read_value(".NaN", "", "") != read_value(".NaN", "", "")


def test_lines_of_keys() -> None:
    document = read_document(b"# head\nseed: 3\nlift:\n  sum: plain\n", "f")
    assert document == {"seed": Item(3, 2), "lift": Item({"sum": Item("plain", 4)}, 3)}


@pytest.mark.parametrize("data", [b"", b"# only a comment\n", b"---\n", b"\xef\xbb\xbf# a mark\n"])
def test_nothing_given_is_an_empty_mapping(data: bytes) -> None:
    assert read_document(data, "f") == {}


@pytest.mark.parametrize(
    ("data", "line", "words"),
    [
        (b"seed: 1\nseed: 2\n", 2, "given twice, first on line 1"),
        (b"lift:\n\tsum: plain\n", 2, "a tab indents this line"),
        (b"seed: 1\nname: caf\xe9\n", 2, "byte 0xe9 is not UTF-8"),
        (b"\xff\xfes\x00e\x00", 1, "not UTF-8"),
        (b"seed: \x01\n", 1, "U+0001"),
        (b"- 1\n- 2\n", 1, "must be a mapping"),
        (b"just words\n", 1, "must be a mapping"),
        (b"a: [1, 2\nb: 3\n", 2, "expected"),
        (b"a: 1\n---\nb: 2\n", 2, "document"),
        (b"a: !!python/object/apply:os.system [ls]\n", 1, "not supported"),
        (b"a: !!python/name:os.system x\n", 1, "cannot be read"),
        (b"a: !!null x\n", 1, "cannot be read"),
        (b"a: &x [*x]\n", 1, "contains itself"),
        (b"a: *nowhere\n", 1, "undefined alias"),
        (b"? [1, 2]\n: 3\n", 1, "a key must be a word"),
        (b"a: " + b"9" * 5000 + b"\n", 1, "cannot be read"),
        (b"a: " + b"[" * 5000 + b"\n", 0, "nested too deeply"),
        (b"#" * (LARGEST_FILE + 1), 0, "larger than"),
    ],
)
def test_refused_with_line_and_reason(data: bytes, line: int, words: str) -> None:
    found_line, what = problem(data)
    assert found_line == line
    assert words in what


def test_an_alias_bomb_is_refused_before_it_unfolds() -> None:
    levels = [b"a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    levels += [b"a%d: &a%d [%s]" % (i, i, b", ".join([b"*a%d" % (i - 1)] * 10)) for i in range(1, 12)]
    assert "aliases included" in problem(b"\n".join(levels))[1]


def test_all_problems_of_a_file_are_reported() -> None:
    with pytest.raises(ConfigError) as caught:
        read_document(b"a: 1\na: 2\nb: !!set {x}\nb: 3\n", "f")
    assert [p.line for p in caught.value.problems] == [2, 3, 4]


@given(st.binary(max_size=200))
def test_no_bytes_do_anything_but_read_or_refuse(data: bytes) -> None:
    try:
        assert isinstance(read_document(data, "f"), dict)
    except ConfigError as error:
        assert error.problems


@given(st.text(alphabet="ab:-[]{}&*!|>'\"# \n0.", max_size=60))
def test_no_text_does_anything_but_read_or_refuse(text: str) -> None:
    try:
        assert isinstance(read_document(text.encode(), "f"), dict)
    except ConfigError as error:
        assert error.problems
