"""A zip archive that holds one model."""

from __future__ import annotations

import io
import zipfile
import zlib
from pathlib import PurePosixPath

from weathercoat.errors import CorruptError, FormatError, LimitError, UnsupportedError
from weathercoat.mesh.formats.sniff import FOREIGN, OWN

# Text models shrink about fivefold, regular ones fiftyfold; a bomb a thousandfold.
MAX_RATIO = 200


_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_ENCRYPTED = 0x1


def unpack_model(data: bytes, max_bytes: int) -> tuple[bytes, str]:
    """The bytes and the name of the only model in a zip archive.

    Errors: FormatError where there is none or more than one, LimitError where it unpacks to more than
    `max_bytes` or to more than `MAX_RATIO` times its size, CorruptError, UnsupportedError.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            return _unpack(archive, max_bytes)
    except NotImplementedError as error:  # a version or a flag that the archive's header asks for
        raise UnsupportedError(f"the zip archive: {error}", remedy="pack it anew") from None
    except (zipfile.BadZipFile, zlib.error, EOFError, OSError, ValueError) as error:
        raise CorruptError(f"the zip archive is broken: {str(error)[:120]}", remedy="pack it anew") from None


def _unpack(archive: zipfile.ZipFile, max_bytes: int) -> tuple[bytes, str]:
    known = {*OWN, *FOREIGN} - {"zip", "dat", "xml"}
    models = [
        entry
        for entry in archive.infolist()
        if PurePosixPath(entry.filename).suffix.lower().removeprefix(".") in known
        # macOS puts the attributes of each file beside it, under its name.
        and not entry.filename.startswith("__MACOSX/")
    ]
    if len(models) != 1:
        raise FormatError(f"a zip archive with {len(models)} models; one is expected")
    entry = models[0]
    name = PurePosixPath(entry.filename).name
    if entry.flag_bits & _ENCRYPTED:
        raise UnsupportedError(f"{name!r} in the zip archive is encrypted", remedy="unpack it first")
    if entry.compress_type not in _METHODS:
        raise UnsupportedError(
            f"{name!r} in the zip archive is packed by method {entry.compress_type}", remedy="unpack it first"
        )
    limit = min(max_bytes, MAX_RATIO * max(entry.compress_size, 1000))
    # The announced size may lie, so the stream is counted as well.
    if entry.file_size <= limit:
        with archive.open(entry) as stream:
            content = stream.read(limit + 1)
        if len(content) <= limit:
            return content, name
    raise LimitError(f"{name!r} in the zip archive unpacks to more than {limit / 1e6:.0f} MB")
