"""What a model needs beside its own file, for who brings the files of a model together."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote

from weathercoat.errors import WeathercoatError
from weathercoat.mesh.formats import sniff
from weathercoat.mesh.formats.text import decode_names, normalise

_LIBRARY = re.compile(rb"^[ \t]*mtllib[ \t]+(.*\S)[ \t]*$", re.MULTILINE)


class Beside(NamedTuple):
    """Relative paths of files beside a model: those of `read` hold geometry; those of `noticed`, which are
    libraries of materials and pictures, may be missing.
    """

    read: list[str]
    noticed: list[str]


def files_beside(data: bytes, name: str, format: str | None = None) -> Beside:
    """The files that a model of this content and name refers to, without those that lie outside its folder.

    format: overrules content and name. A model that is broken refers to none: reading it tells what is wrong.
    """
    try:
        suffix = Path(name).suffix.lower().removeprefix(".")
        kind = format.lower().removeprefix(".") if format else sniff.identify(data, suffix)[0]
        if kind == "obj":
            return Beside([], inside(decode_names(_LIBRARY.findall(normalise(data)))))
        if kind in ("gltf", "glb"):
            text = data[20 : 20 + int.from_bytes(data[12:16], "little")] if data[:4] == b"glTF" else data
            content = json.loads(text.decode("utf-8-sig"))
            return Beside(*(inside(_uris(content.get(key, []))) for key in ("buffers", "images")))
    except (WeathercoatError, ValueError, TypeError, AttributeError, RecursionError):
        pass
    return Beside([], [])


def _uris(entries: list[dict[str, object]]) -> list[str]:
    uris = (entry.get("uri") for entry in entries)
    return [unquote(uri) for uri in uris if isinstance(uri, str) and not uri.startswith("data:")]


def inside(names: list[str]) -> list[str]:
    """The names, with `/` between folders, that stay in the folder of the model."""
    paths = [(name, Path(name.replace("\\", "/").removeprefix("./"))) for name in names]
    return [
        path.as_posix()
        for name, path in paths
        if not (path.is_absolute() or ".." in path.parts or ":" in name or "\0" in name or not path.name)
    ]
