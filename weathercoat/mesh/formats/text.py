"""Lines and numbers of text formats, fast enough for millions of lines and strict about what they hold."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.errors import CorruptError

_NAN, _INFINITY = (np.frombuffer(word, np.uint8) for word in (b"nan", b"infinity"))


def normalise(data: bytes) -> bytes:
    """`data` without byte order mark, as UTF-8 where it was UTF-16, with line feeds as the only line ends."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        try:
            data = data.decode("utf-16").encode()
        except UnicodeError as error:
            raise CorruptError(f"the text is marked as UTF-16 but is not: {error}") from None
    data = data.removeprefix(b"\xef\xbb\xbf")
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return data


def join_continued(data: bytes) -> bytes:
    """`data` with the lines that end in a backslash joined to the next; blanks keep the count of lines.

    A backslash after a byte of 128 or more is the second half of a Shift-JIS character, no continuation.
    """
    if b"\\\n" not in data:
        return data
    return re.sub(rb"(?<![\x80-\xff])\\\n", b"  ", data)


def decode_names(names: list[bytes]) -> list[str]:
    """The names of a file in the encoding that fits all of them: UTF-8, Shift-JIS or Latin-1."""
    text = b"\n".join(names)
    encodings = ["utf-8"]
    # Latin-1 has only control characters from 0x80 to 0x9f, which lead almost every Shift-JIS character.
    if any(0x80 <= byte <= 0x9F for byte in text):
        encodings.append("cp932")
    for encoding in encodings:
        try:
            return [name.decode(encoding) for name in names]
        except UnicodeDecodeError:
            continue
    return [name.decode("latin-1") for name in names]


def pack(keyword: str) -> int:
    """A keyword of at most eight characters as the number that `Lines.keyword` holds for it."""
    return int.from_bytes(keyword.encode(), "big")


class Lines:
    """Where the lines of a text begin and end, without blanks at their ends and comments.

    keyed: the first word is a keyword; any_case: upper case is as good as lower; comments: a word that begins
    with # makes the rest of its line a comment.
    keyword: uint64 (l,), the first word, packed; 0 for an empty line or where `keyed` is false.
    begin, end: int64 (l,), the rest of the line in `buffer`; fields: int64 (l,), the number of words in it.
    number: int64 (l,), the line's number in the file, counted from 1.
    """

    def __init__(self, data: bytes, *, keyed: bool, any_case: bool = False, comments: bool = True) -> None:
        self.data = data
        self.buffer = np.frombuffer(data, np.uint8)
        breaks = np.flatnonzero(self.buffer == ord("\n"))
        starts = np.concatenate([[0], breaks + 1])
        stops = np.concatenate([breaks, [len(self.buffer)]])
        self.number = np.arange(1, len(starts) + 1)
        self.keyword = np.zeros(len(starts), np.uint64)
        self.begin = np.zeros(len(starts), np.int64)
        self.end = np.zeros(len(starts), np.int64)
        self.fields = np.zeros(len(starts), np.int64)
        case, mark = (32 if any_case else 0), (ord("#") if comments else -1)
        table = (self.keyword, self.begin, self.end, self.fields)
        _split_lines(self.buffer, starts, stops, keyed, case, mark, *table)

    def text(self, line: int) -> bytes:
        """The rest of a line after its keyword."""
        return self.data[self.begin[line] : self.end[line]]

    def numbers(self, lines: NDArray[np.int64]) -> NDArray[np.float64]:
        """All words of the given lines as numbers, one after the other.

        Errors: CorruptError with the number of the first line that holds something else.
        """
        self.check_numbers(lines, self.begin[lines])
        begin, end = self.begin[lines], self.end[lines]
        joined = np.empty(int((end - begin).sum()) + len(lines), np.uint8)
        _join(self.buffer, begin, end, joined)
        return np.fromstring(joined.tobytes(), np.float64, sep=" ")  # type: ignore[no-any-return]

    def check_numbers(self, lines: NDArray[np.int64], begin: NDArray[np.int64]) -> None:
        """Whether all words of the given lines, each from `begin` in `buffer` on, are numbers.

        Errors: CorruptError with the number of the first line that holds something else.
        """
        good = self.are_numbers(lines, begin)
        if not good.all():
            first = int(np.argmin(good))
            words = self.data[begin[first] : self.end[lines[first]]].split()
            word = next(word for word in words if not is_number(word))
            raise CorruptError(f"line {self.number[lines[first]]}: {_shown(word)} is no number")

    def are_numbers(self, lines: NDArray[np.int64], begin: NDArray[np.int64]) -> NDArray[np.bool_]:
        """For each of the lines, whether all words from `begin` in `buffer` on are numbers."""
        good = np.empty(len(lines), np.bool_)
        _find_numbers(self.buffer, begin, self.end[lines], good)
        return good

    def begins_with(self, lines: NDArray[np.int64], word: bytes) -> NDArray[np.bool_]:
        """For each of the lines, whether the rest begins with `word`, in whatever case and with any blank."""
        place = np.minimum(self.begin[lines, None] + np.arange(len(word)), len(self.buffer) - 1)
        found = self.buffer[place]
        letters = np.where((found >= 65) & (found <= 90), found + 32, found)
        letters[(found >= 9) & (found <= 13)] = 32
        fits = self.end[lines] - self.begin[lines] >= len(word)
        return fits & (letters == np.frombuffer(word, np.uint8)).all(axis=1)  # type: ignore[no-any-return]


def is_number(word: bytes) -> bool:
    """Whether a word is a number: sign, digits, point, digits, exponent; or nan, inf, infinity."""
    good = np.empty(1, np.bool_)
    _find_numbers(np.frombuffer(word, np.uint8), np.zeros(1, np.int64), np.array([len(word)]), good)
    return bool(good[0])


def _shown(word: bytes) -> str:
    return repr(word[:40].decode("utf-8", "replace"))


@kernel
def _find_numbers(buffer, begin, end, good):  # type: ignore[no-untyped-def]
    for row in range(len(begin)):
        i = begin[row]
        stop = end[row]
        good[row] = True
        while i < stop and good[row]:
            if buffer[i] == 32 or 9 <= buffer[i] <= 13:
                i += 1
                continue
            if buffer[i] == 43 or buffer[i] == 45:
                i += 1
            digits = 0
            begins = i
            while i < stop and 48 <= buffer[i] <= 57:
                i += 1
                digits += 1
            if i < stop and buffer[i] == 46:
                i += 1
                while i < stop and 48 <= buffer[i] <= 57:
                    i += 1
                    digits += 1
            if i == begins:
                digits = max(_matching(buffer, i, stop, _NAN, 3), _matching(buffer, i, stop, _INFINITY, 3))
                i += digits
            elif digits > 0 and i < stop and (buffer[i] == 69 or buffer[i] == 101):
                i += 1
                if i < stop and (buffer[i] == 43 or buffer[i] == 45):
                    i += 1
                digits = 0
                while i < stop and 48 <= buffer[i] <= 57:
                    i += 1
                    digits += 1
            good[row] = digits > 0 and (i >= stop or buffer[i] == 32 or 9 <= buffer[i] <= 13)


@kernel
def _matching(buffer, i, stop, word, least):  # type: ignore[no-untyped-def]
    """`least` or all letters of `word`, if so many stand at `i` in whatever case, else 0."""
    n = 0
    while n < len(word) and i + n < stop and buffer[i + n] | 32 == word[n]:
        n += 1
    if n == len(word):
        return n
    return least if n >= least else 0


@kernel
def _split_lines(buffer, starts, stops, keyed, case, mark, keyword, begin, end, fields):  # type: ignore[no-untyped-def]
    """`case` is added to capital letters of keywords; `mark` at the begin of a word begins a comment."""
    for line in range(len(starts)):
        i = starts[line]
        stop = stops[line]
        while i < stop and (buffer[i] == 32 or 9 <= buffer[i] <= 13):
            i += 1
        word = np.uint64(0)
        if keyed and i < stop and buffer[i] != mark:
            length = 0
            while i < stop and not (buffer[i] == 32 or 9 <= buffer[i] <= 13):
                c = buffer[i]
                if 65 <= c <= 90:
                    c += case
                # A zero byte would vanish from the packed word.
                if c == 0:
                    length = 8
                word = (word << np.uint64(8)) | np.uint64(c)
                length += 1
                i += 1
            if length > 8:
                word = np.uint64(0xFFFFFFFFFFFFFFFF)
            while i < stop and (buffer[i] == 32 or 9 <= buffer[i] <= 13):
                i += 1
        begin[line] = i
        last = i
        words = 0
        inside = False
        while i < stop:
            c = buffer[i]
            if c == 32 or 9 <= c <= 13:
                inside = False
            elif not inside and c == mark:
                break
            else:
                if not inside:
                    words += 1
                inside = True
                last = i + 1
            i += 1
        keyword[line] = word
        end[line] = last
        fields[line] = words


@kernel
def _join(buffer, begin, end, out):  # type: ignore[no-untyped-def]
    k = 0
    for line in range(len(begin)):
        for i in range(begin[line], end[line]):
            out[k] = buffer[i]
            k += 1
        out[k] = 32
        k += 1
