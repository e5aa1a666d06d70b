"""Reading a PNG as far as proves that every pixel of it can be decoded.

Source: W3C, Portable Network Graphics (PNG) Specification, third edition: 5 (chunks), 7.3 and 9 (scanlines
and filters), 11.2.2 (IHDR).
"""

from __future__ import annotations

import struct
import zlib

from weathercoat.verification.findings import BrokenFileError

_MAGIC = b"\x89PNG\r\n\x1a\n"
_CHANNELS = {0: 1, 2: 3, 4: 2, 6: 4}  # by colour type; palettes are not written
_BEST_RATIO = 1032  # of deflate, which bounds what a header can truly announce
_FILTERS = 5


def check_png(content: bytes) -> tuple[int, int]:
    """Width and height of a PNG with 8 bits a channel whose chunks, sums and scanlines are all in order;
    raises BrokenFileError.
    """
    if not content.startswith(_MAGIC):
        raise BrokenFileError("no PNG")
    header, packed, place, kind = b"", [], len(_MAGIC), b""
    while kind != b"IEND":
        if place + 12 > len(content):
            raise BrokenFileError("ends within a chunk")
        length, kind = struct.unpack_from(">I4s", content, place)
        body = content[place + 8 : place + 8 + length]
        place += 12 + length
        if place > len(content):
            raise BrokenFileError("ends within a chunk")
        if zlib.crc32(kind + body) != int.from_bytes(content[place - 4 : place], "big"):
            raise BrokenFileError(f"the chunk {kind.decode('latin-1')!r} fails its check sum")
        if not header and kind != b"IHDR":
            raise BrokenFileError("does not begin with its header")
        if kind == b"IHDR":
            header = body
        elif kind == b"IDAT":
            packed.append(body)
    if place != len(content):
        raise BrokenFileError("bytes follow its end")
    return _check_lines(header, b"".join(packed))


def _check_lines(header: bytes, packed: bytes) -> tuple[int, int]:
    """Width and height of the header, if the compressed scanlines are as many and as long as it says."""
    if len(header) != 13:
        raise BrokenFileError("its header is not 13 bytes long")
    width, height, depth, kind, compression, filtering, interlace = struct.unpack(">IIBBBBB", header)
    if depth != 8 or kind not in _CHANNELS or compression or filtering or interlace:
        raise BrokenFileError("is of a kind that no run writes")
    line = 1 + width * _CHANNELS[kind]
    if not width or not height or height * line > _BEST_RATIO * len(packed):
        raise BrokenFileError(f"its header says {width:,} x {height:,} pixels, which it does not hold")
    inflater = zlib.decompressobj()
    try:
        pixels = inflater.decompress(packed, height * line + 1)
    except zlib.error as error:
        raise BrokenFileError(f"its pixels cannot be decompressed: {error}") from error
    if len(pixels) != height * line or not inflater.eof or inflater.unused_data:
        raise BrokenFileError(f"holds {len(pixels):,} bytes of pixels instead of {height * line:,}")
    if max(pixels[::line]) >= _FILTERS:
        raise BrokenFileError("a line of its pixels has an unknown filter")
    return width, height
