"""Chunks: arrays of small unsigned integers in text, as compact as a browser unpacks them by itself.

A chunk is the base64 of one zlib stream. In it the arrays follow each other, each as planes of bytes: first
the lowest byte of every value, then the next. What changes little along the mesh is held as differences,
modulo the range of the type. `web/src/unpack.js` reads it.
"""

from __future__ import annotations

import base64
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Unsigned = NDArray[np.uint8] | NDArray[np.uint16] | NDArray[np.uint32]

_LEVEL = 6


@dataclass(frozen=True)
class Chunk:
    """Arrays as text: `text` is the base64, `layout` says for each array, in order, its name, the bytes of a
    value, the number of values, and how many values back the one lies that was subtracted (0: none was).
    """

    text: str
    layout: list[list[Any]]


def pack_chunk(arrays: Mapping[str, tuple[Unsigned, int]]) -> Chunk:
    """A chunk of arrays by name, each with the distance of its differences, 0 for none."""
    layout, planes = [], []
    for name, (array, distance) in arrays.items():
        values = array.ravel()
        if distance:
            values = values.copy()
            values[distance:] -= array.ravel()[:-distance]
        width = values.dtype.itemsize
        layout.append([name, width, len(values), distance])
        planes.append(values.astype(f"<u{width}").view(np.uint8).reshape(-1, width).T.tobytes())
    return Chunk(base64.b64encode(zlib.compress(b"".join(planes), _LEVEL)).decode("ascii"), layout)


def unpack_chunk(chunk: Chunk) -> dict[str, Unsigned]:
    """The arrays of a chunk, flat: what the page does, for those who check it."""
    content = np.frombuffer(zlib.decompress(base64.b64decode(chunk.text)), np.uint8)
    arrays: dict[str, Unsigned] = {}
    start = 0
    for name, width, count, distance in chunk.layout:
        planes = content[start : start + width * count].reshape(width, count)
        values = np.ascontiguousarray(planes.T).view(f"<u{width}").ravel()
        if distance:
            values = np.cumsum(values.reshape(-1, distance), axis=0, dtype=values.dtype).ravel()
        arrays[name] = values
        start += width * count
    return arrays
