"""PNG in bands is PNG, by readers of others."""

from __future__ import annotations

import io
import struct
import zlib

import numpy as np
import pytest
from PIL import Image

from weathercoat.output.maps.png import PngWriter, pack_rows


def written(pixels: np.ndarray, bands: int) -> bytes:
    stream = io.BytesIO()
    height, width, channels = pixels.shape
    writer = PngWriter(stream, width, height, channels, 8 * pixels.dtype.itemsize, is_srgb=channels == 3)
    for rows in np.array_split(np.arange(height), bands):
        writer.add(pack_rows(pixels[rows], level=1))
    writer.finish()
    return stream.getvalue()


def decoded(content: bytes, shape: tuple[int, int, int]) -> np.ndarray:
    """16-bit pixels of a PNG whose rows have the filters None and Up; checksums are checked by zlib."""
    at, data = 8, b""
    while at < len(content):
        length, kind = struct.unpack(">I4s", content[at : at + 8])
        body = content[at + 8 : at + 8 + length]
        assert zlib.crc32(kind + body) == struct.unpack(">I", content[at + 8 + length : at + 12 + length])[0]
        data += body if kind == b"IDAT" else b""
        at += 12 + length
    height, width, channels = shape
    rows = np.frombuffer(zlib.decompress(data), np.uint8).reshape(height, -1)
    plain = rows[:, 1:].copy()
    for row in np.flatnonzero(rows[:, 0] == 2):
        plain[row] += plain[row - 1]
    return plain.view(">u2").reshape(height, width, channels)


@pytest.mark.parametrize("channels", [1, 3, 4])
@pytest.mark.parametrize("bands", [1, 4])
def test_eight_bits_read_back_by_pillow(channels: int, bands: int) -> None:
    pixels = np.random.default_rng(channels).integers(0, 256, (13, 7, channels), np.uint8)
    with Image.open(io.BytesIO(written(pixels, bands))) as image:
        image.verify()
    with Image.open(io.BytesIO(written(pixels, bands))) as image:
        assert image.mode == {1: "L", 3: "RGB", 4: "RGBA"}[channels]
        assert (np.asarray(image).reshape(pixels.shape) == pixels).all()


def test_sixteen_bits_of_one_channel_read_back_by_pillow() -> None:
    pixels = np.random.default_rng(1).integers(0, 65536, (9, 5, 1), np.uint16)
    with Image.open(io.BytesIO(written(pixels, 2))) as image:
        assert (np.asarray(image) == pixels[..., 0]).all()


def test_sixteen_bits_of_three_channels_are_whole() -> None:
    pixels = np.random.default_rng(2).integers(0, 65536, (9, 5, 3), np.uint16)
    assert (decoded(written(pixels, 3), pixels.shape) == pixels).all()
