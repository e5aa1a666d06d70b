"""Lines and numbers of text formats, fast enough for millions of lines and strict about what they hold."""

from __future__ import annotations

import re
import warnings

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.errors import CorruptError

_NUMBER = re.compile(rb"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(nan|inf|infinity)", re.IGNORECASE)


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
    return int.from_bytes(keyword.lower().encode(), "big")


class Lines:
    """Where the lines of a text begin and end, without blanks at their ends and comments.

    keyword: uint64 (l,), the first word in lower case, packed; 0 for an empty line or where `keyed` is false.
    begin, end: int64 (l,), the rest of the line in `buffer`; fields: int64 (l,), the number of words in it.
    number: int64 (l,), the line's number in the file, counted from 1.
    """

    def __init__(self, data: bytes, *, keyed: bool) -> None:
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
        _split_lines(self.buffer, starts, stops, keyed, self.keyword, self.begin, self.end, self.fields)

    def text(self, line: int) -> bytes:
        """The rest of a line after its keyword."""
        return self.data[self.begin[line] : self.end[line]]

    def numbers(self, lines: NDArray[np.int64]) -> NDArray[np.float64]:
        """All words of the given lines as numbers, one after the other.

        Errors: CorruptError with the number of the first line that holds something else.
        """
        begin, end = self.begin[lines], self.end[lines]
        joined = np.empty(int((end - begin).sum()) + len(lines), np.uint8)
        _join(self.buffer, begin, end, joined)
        values = parse_numbers(joined.tobytes(), int(self.fields[lines].sum()))
        if values is not None:
            return values
        for line in lines:
            for word in self.text(line).split():
                if not _NUMBER.fullmatch(word):
                    raise CorruptError(f"line {self.number[line]}: {_shown(word)} is no number")
        raise CorruptError(f"line {self.number[lines[0]]} ff.: something is no number")


def parse_numbers(text: bytes, count: int) -> NDArray[np.float64] | None:
    """The `count` numbers that `text` holds between blanks, or None where it holds anything else."""
    with warnings.catch_warnings():
        # NumPy 1 warns and stops at the first word that is no number, NumPy 2 raises.
        warnings.simplefilter("ignore", DeprecationWarning)
        try:
            values = np.fromstring(text, dtype=np.float64, sep=" ")
        except ValueError:
            return None
    return values if len(values) == count else None


def _shown(word: bytes) -> str:
    return repr(word[:40].decode("utf-8", "replace"))


@kernel
def count_words(buffer):  # type: ignore[no-untyped-def]
    """The number of words in `buffer`, uint8 (k,), between blanks and line ends."""
    words = 0
    inside = False
    for c in buffer:
        blank = c == 32 or (9 <= c <= 13)
        if inside and blank:
            inside = False
        elif not inside and not blank:
            inside = True
            words += 1
    return words


@kernel
def _split_lines(buffer, starts, stops, keyed, keyword, begin, end, fields):  # type: ignore[no-untyped-def]
    for line in range(len(starts)):
        i = starts[line]
        stop = stops[line]
        while i < stop and (buffer[i] == 32 or 9 <= buffer[i] <= 13):
            i += 1
        word = np.uint64(0)
        if keyed and i < stop and buffer[i] != 35:
            length = 0
            while i < stop and not (buffer[i] == 32 or 9 <= buffer[i] <= 13):
                c = buffer[i]
                if 65 <= c <= 90:
                    c += 32
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
            elif not inside and c == 35:
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
