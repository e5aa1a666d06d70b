"""PNG, written a band of rows at a time, with 8 or 16 bits a channel.

Each band is compressed on its own, in whichever thread made it, and the bands are put one after the other:
the stream is one that every reader knows. Source: PNG specification, third edition; RFC 1950 and 1951.
"""

from __future__ import annotations

import struct
import zlib
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_COLOR_TYPES = {1: 0, 2: 4, 3: 2, 4: 6}
_NONE, _UP = 0, 2  # filters: in smooth maps a row differs little from the one above
_ADLER = 65521


def pack_rows(rows: NDArray[np.uint8] | NDArray[np.uint16], *, level: int) -> tuple[bytes, int, int]:
    """Rows (r, w, c) as PNG filters and compresses them.

    Returns the compressed bytes, which end at a whole byte, and the Adler-32 checksum and the length of what
    was compressed.
    """
    raw = rows.astype(rows.dtype.newbyteorder(">"), copy=False).view(np.uint8).reshape(len(rows), -1)
    filtered = np.empty((len(rows), 1 + raw.shape[1]), np.uint8)
    # the first row is as it is, so that a band needs no other
    filtered[:, 0], filtered[0, 0] = _UP, _NONE
    filtered[0, 1:] = raw[0]
    np.subtract(raw[1:], raw[:-1], out=filtered[1:, 1:])
    packer = zlib.compressobj(level, zlib.DEFLATED, -15)
    content = packer.compress(filtered.data) + packer.flush(zlib.Z_FULL_FLUSH)
    return content, zlib.adler32(filtered.data), filtered.size


class PngWriter:
    """Writes one PNG to a binary stream: its head, bands from top to bottom, and its end."""

    def __init__(
        self, stream: BinaryIO, width: int, height: int, channels: int, bits: int, *, is_srgb: bool
    ) -> None:
        self._stream = stream
        self._adler = 1
        stream.write(_SIGNATURE)
        self._chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, bits, _COLOR_TYPES[channels], 0, 0, 0))
        if is_srgb:
            self._chunk(b"sRGB", b"\0")
        self._chunk(b"IDAT", b"\x78\x01")

    def add(self, packed: tuple[bytes, int, int]) -> None:
        """Add the next band, as `pack_rows` gave it."""
        content, adler, length = packed
        self._chunk(b"IDAT", content)
        self._adler = _joined_adler(self._adler, adler, length)

    def finish(self) -> None:
        """Write what ends the file."""
        self._chunk(b"IDAT", b"\x03\x00" + struct.pack(">I", self._adler))
        self._chunk(b"IEND", b"")

    def _chunk(self, kind: bytes, content: bytes) -> None:
        self._stream.write(struct.pack(">I", len(content)) + kind)
        self._stream.write(content)
        self._stream.write(struct.pack(">I", zlib.crc32(content, zlib.crc32(kind))))


def _joined_adler(first: int, second: int, length: int) -> int:
    """Adler-32 of two pieces one after the other, from that of each and the length of the second."""
    a1, b1, a2, b2 = first & 0xFFFF, first >> 16, second & 0xFFFF, second >> 16
    a = (a1 + a2 - 1) % _ADLER
    b = (b1 + b2 + length * (a1 - 1)) % _ADLER
    return (b << 16) | a
