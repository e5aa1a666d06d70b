"""Models and results by path or by URL, of any file system that fsspec reaches: `s3://`, `gs://`,
`https://`, ...

A model at a URL is fetched, with what lies beside it, and its results are the bytes of one at a path. A
folder at a URL is complete once it holds `run.json`, which is removed first and written last.
"""

from __future__ import annotations

import json
import posixpath
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO
from urllib.parse import unquote, urlsplit

from weathercoat.errors import AccessError, LimitError, ModelError, OutputError, WeathercoatError
from weathercoat.mesh.beside import files_beside, inside
from weathercoat.mesh.formats.mtl import picture_names
from weathercoat.mesh.read import MAX_BYTES
from weathercoat.output.folder import REPORT

_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*(::[A-Za-z][A-Za-z0-9+.-]*)*://")
_BLOCK = 1 << 20


def is_url(text: str) -> bool:
    """Whether a text is a URL and no path."""
    return _URL.match(text) is not None


def join(target: str, name: str) -> str:
    """The path or URL of `name`, with slashes between folders, in a folder given by path or URL."""
    return f"{target.rstrip('/')}/{name}" if is_url(target) else str(Path(target) / name)


def fetch(url: str, folder: Path, format: str | None = None) -> Path:
    """Fetch the model at a URL into a folder, with the files beside it that it refers to; returns its path.

    Raises AccessError where it cannot be read, and LimitError where it is larger than what is read.
    """
    with _errors(AccessError, url):
        files, place = _open(url)
        name = _name_in(place)
        path = folder / name
        _copy(files, place, path)
        beside = files_beside(path.read_bytes(), name, format)
        parent = place.partition("?")[0].rpartition("/")[0]
        wanted = [*beside.read, *beside.noticed]
        for other in wanted:  # which libraries of materials make longer
            if files.exists(f"{parent}/{other}"):  # reading says what is missing
                (folder / other).parent.mkdir(parents=True, exist_ok=True)
                _copy(files, f"{parent}/{other}", folder / other)
                if other.lower().endswith(".mtl"):
                    shown = inside(picture_names((folder / other).read_bytes()))
                    wanted += [name for name in shown if name not in wanted]
    return path


def publish(folder: Path, url: str) -> None:
    """Make the folder at a URL the same as a finished run's folder here.

    Raises OutputError where it cannot be written; what is there then holds no `run.json`, or the one before.
    """
    with _errors(OutputError, url):
        files, place = _open(url)
        names = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
        there = _names_at(files, place)
        if REPORT in there:
            files.rm_file(f"{place}/{REPORT}")
        for parent in sorted({posixpath.dirname(f"{place}/{name}") for name in names}):
            files.makedirs(parent, exist_ok=True)
        for name in sorted(names, key=lambda name: name == REPORT):
            files.put_file(str(folder / name), f"{place}/{name}")
        for name in sorted(there.difference(names)):
            files.rm_file(f"{place}/{name}")


def put_file(path: Path, url: str) -> None:
    """Write a file to a URL; raises OutputError where that cannot be."""
    with _errors(OutputError, url):
        files, place = _open(url)
        files.makedirs(posixpath.dirname(place), exist_ok=True)
        files.put_file(str(path), place)


def read_report(target: str) -> dict[str, Any] | None:
    """The `run.json` of a folder given by path or URL; None where there is none, or none that is whole.

    Raises AccessError where the URL cannot be reached.
    """
    if is_url(target):
        with _errors(AccessError, target):
            files, place = _open(target)
            try:
                content = files.cat_file(f"{place}/{REPORT}")
            except (FileNotFoundError, NotADirectoryError):
                return None
    else:
        try:
            content = (Path(target) / REPORT).read_bytes()
        except OSError:
            return None
    try:
        report = json.loads(content)
    except ValueError:
        return None
    return report if isinstance(report, dict) else None


def _open(url: str) -> tuple[Any, str]:
    """The file system of a URL, and the place in it."""
    from fsspec.core import url_to_fs

    files, place = url_to_fs(url)
    files.invalidate_cache()  # others write there too
    return files, place.rstrip("/")


def _name_in(place: str) -> str:
    """The name of the file at a place, the same as that of the file in a folder."""
    if place.startswith(("http://", "https://")):
        place = unquote(urlsplit(place).path)
    name = posixpath.basename(place)
    if name in ("", ".", "..") or "\0" in name:
        raise AccessError("names no file")
    return name


def _copy(files: Any, place: str, path: Path) -> None:
    with files.open(place, "rb") as source, path.open("wb") as copy:
        _copy_stream(source, copy)


def _copy_stream(source: BinaryIO, copy: BinaryIO) -> None:
    total = 0
    while block := source.read(_BLOCK):
        total += len(block)
        if total > MAX_BYTES:
            raise LimitError(f"the file is larger than the limit of {MAX_BYTES >> 20} MB")
        copy.write(block)


def _names_at(files: Any, place: str) -> set[str]:
    """The files in a folder, relative to it."""
    try:
        found = files.find(place)
    except FileNotFoundError:
        return set()
    return {name.removeprefix(place).lstrip("/") for name in found} - {""}


@contextmanager
def _errors(kind: type[ModelError] | type[OutputError], url: str) -> Iterator[None]:
    """Whatever goes wrong with a URL as one error: each file system raises what its own library does."""
    try:
        yield
    except WeathercoatError as error:
        error.file = error.file or url
        raise
    except ImportError as error:
        if error.name is not None and error.name.partition(".")[0] == "fsspec":
            raise kind("URLs need fsspec", file=url, remedy="pip install 'weathercoat[urls]'") from None
        # fsspec says which package to install
        raise kind(f"its protocol needs another package: {error}", file=url, remedy="install it") from None
    except FileNotFoundError:
        raise kind("does not exist", file=url) from None
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        verb = "read" if kind is AccessError else "written"
        raise kind(f"cannot be {verb}: {reason}", file=url) from error
