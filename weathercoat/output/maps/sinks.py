"""Where the bands of a map go: PNG as they come, EXR once all are there."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from weathercoat.errors import UsageError
from weathercoat.mesh.surface import Indices
from weathercoat.output.maps.channels import MapKind, as_floats, quantised
from weathercoat.output.maps.planes import Planes
from weathercoat.output.maps.png import PngWriter, pack_rows

_COMPRESSION = 1  # of PNG: higher levels take several times as long for a tenth of the bytes


class Sink(Protocol):
    """A map that is written a band at a time: `prepare` in any order and thread, `add` in order."""

    def prepare(self, planes: Planes, source: Indices) -> Any: ...

    def add(self, band: Any) -> None: ...

    def finish(self) -> None: ...


class PngSink:
    """A PNG of 8 or 16 bits a channel. Raises OSError where it cannot be written."""

    def __init__(self, path: Path, kind: MapKind, width: int, height: int, bits: int) -> None:
        self._kind, self._bits = kind, bits
        self._stream = path.open("wb")
        self._writer = PngWriter(self._stream, width, height, len(kind.channels), bits, is_srgb=kind.is_color)

    def prepare(self, planes: Planes, source: Indices) -> tuple[bytes, int, int]:
        """The rows of texels whose values are at `source` (r, w) in the planes."""
        return pack_rows(quantised(self._kind, planes, source, self._bits), level=_COMPRESSION)

    def add(self, band: tuple[bytes, int, int]) -> None:
        """Write the next band."""
        self._writer.add(band)

    def finish(self) -> None:
        """Write the end, and close the file."""
        self._writer.finish()
        self._stream.close()


class ExrSink:
    """An OpenEXR picture of half floats, in linear light; `factors` multiply planes.

    Raises UsageError where the library is not installed, OSError where the file cannot be written.
    """

    def __init__(self, path: Path, kind: MapKind, factors: Mapping[int, float]) -> None:
        require_exr()
        self._path, self._kind, self._factors = path, kind, factors
        self._bands: list[NDArray[np.float16]] = []

    def prepare(self, planes: Planes, source: Indices) -> NDArray[np.float16]:
        """The texels of a band, (r, w, channels)."""
        return as_floats(self._kind, planes, source, self._factors)

    def add(self, band: NDArray[np.float16]) -> None:
        """Keep the next band."""
        self._bands.append(band)

    def finish(self) -> None:
        """Write the file."""
        import OpenEXR

        pixels = np.concatenate(self._bands)
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        names = "Y" if pixels.shape[2] == 1 else "RGBA"[: pixels.shape[2]]
        channels = {name: np.ascontiguousarray(pixels[..., i]) for i, name in enumerate(names)}
        try:
            OpenEXR.File(header, channels).write(str(self._path))
        except RuntimeError as error:
            raise OSError(str(error)) from error


def require_exr() -> None:
    """Raise UsageError where OpenEXR cannot be written."""
    try:
        import OpenEXR  # noqa: F401
    except ImportError as error:
        raise UsageError(
            "EXR needs the package OpenEXR", remedy="pip install 'weathercoat[exr]', or take --format png"
        ) from error
