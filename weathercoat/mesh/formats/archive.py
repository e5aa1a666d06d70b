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


def unpack_model(data: bytes, max_bytes: int) -> tuple[bytes, str]:
    """The bytes and the name of the only model in a zip archive.

    Errors: FormatError where there is none or more than one, LimitError where it unpacks to more than
    `max_bytes` or to more than `MAX_RATIO` times its size, CorruptError, UnsupportedError.
    """
    try:
        archive = zipfile.ZipFile(io.BytesIO(data))
        models = [
            entry
            for entry in archive.infolist()
            if PurePosixPath(entry.filename).suffix.lower().removeprefix(".")
            in {*OWN, *FOREIGN} - {"zip", "dat", "xml"}
        ]
        if len(models) != 1:
            raise FormatError(f"a zip archive with {len(models)} models; one is expected")
        entry = models[0]
        limit = min(max_bytes, MAX_RATIO * max(entry.compress_size, 1000))
        # The announced size may lie, so the stream is counted as well.
        if entry.file_size <= limit:
            with archive.open(entry) as stream:
                content = stream.read(limit + 1)
            if len(content) <= limit:
                return content, PurePosixPath(entry.filename).name
        raise LimitError(f"{entry.filename!r} unpacks to more than {limit / 1e6:.0f} MB")
    except (zipfile.BadZipFile, zlib.error, EOFError, OSError, ValueError) as error:
        raise CorruptError(f"the zip archive is broken: {error}") from None
    except (NotImplementedError, RuntimeError) as error:
        raise UnsupportedError(f"the zip archive: {error}") from None
