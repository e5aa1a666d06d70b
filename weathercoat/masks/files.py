"""What masks read: pictures, and lines from OBJ and CSV."""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from weathercoat.config.load import LoadedConfig
from weathercoat.config.presets import presets_folder
from weathercoat.config.schema import Config
from weathercoat.errors import ConfigError, ConfigProblem
from weathercoat.mesh.surface import Vectors
from weathercoat.output.report import sha256

_LUMA = (0.2126, 0.7152, 0.0722)  # Rec. ITU-R BT.709
_CHANNELS = {"r": 0, "g": 1, "b": 2, "a": 3}
_MOST_BYTES = 256 * 1024 * 1024


def problem(origin: str, key: str, what: str) -> ConfigError:
    """The error of a key below `steering`, whose value came from an origin, `FILE:LINE` or an option."""
    where, line = _split(origin)
    return ConfigError(problems=(ConfigProblem(where, line, key, what),))


class MaskSource(NamedTuple):
    """Where `steering` came from, `FILE:LINE` or an option, and the folder in which its files lie."""

    origin: str
    folder: Path


NO_MASKS = MaskSource("", Path())


def mask_source(loaded: LoadedConfig) -> MaskSource:
    """The source of a config: names of files are relative to the file that holds `steering`."""
    origin = loaded.origins["steering"]
    where, _ = _split(origin)
    if where.startswith("preset "):
        return MaskSource(origin, presets_folder())
    is_file = os.path.isfile(where)  # noqa: PTH113 (any text will do)
    return MaskSource(origin, Path(where).parent if is_file else Path())


def _split(origin: str) -> tuple[str, int]:
    found = re.fullmatch(r"(.*):(\d+)", origin, re.DOTALL)
    return (found[1], int(found[2])) if found else (origin, 0)


def _named_files(config: Config) -> Iterator[tuple[str, str]]:
    """The number of the entry, as a key, and the name of each file that `steering` needs."""
    for number, entry in enumerate(config.steering):
        for name in entry.files():
            yield f"steering[{number}]", name


def hash_masks(loaded: LoadedConfig) -> dict[str, str]:
    """SHA-256 of the files that `steering` needs, by `steering/NAME`; ConfigError where one is missing."""
    return hash_files(loaded.config, mask_source(loaded))


def hash_files(config: Config, source: MaskSource) -> dict[str, str]:
    """As `hash_masks`, of a config whose files lie in the folder of a source."""
    origin, found = source.origin, {}
    for key, name in _named_files(config):
        path = source.folder / name
        try:
            if path.stat().st_size > _MOST_BYTES:
                raise problem(origin, key, f"{path} is larger than {_MOST_BYTES // 2**20} MB")
            found[f"steering/{name}"] = sha256(path)
        except OSError as error:
            raise problem(origin, key, f"{path} cannot be read: {error.strerror or error}") from None
        except ValueError as error:
            raise problem(origin, key, f"{name!r} is no name of a file") from error
    return found


def read_picture(path: Path, channel: str) -> Vectors:
    """A channel of a picture, (height, width), 0 to 1, the top row first; ValueError where it is none."""
    from PIL import Image

    try:
        with Image.open(path) as picture:
            if picture.mode.startswith("I"):
                values = np.asarray(picture, np.float64) / 65535.0
                return np.clip(values, 0.0, 1.0) if channel != "a" else np.ones_like(values)
            pixels = np.asarray(picture.convert("RGBA"), np.float64) / 255.0
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise ValueError(f"{path} is no picture that can be read: {error}") from error
    if channel == "grey":
        return _LUMA[0] * pixels[:, :, 0] + _LUMA[1] * pixels[:, :, 1] + _LUMA[2] * pixels[:, :, 2]
    return pixels[:, :, _CHANNELS[channel]]


def read_lines(path: Path) -> list[Vectors]:
    """Polylines (k, 3) of an OBJ file (its `l` elements) or a CSV file (x, y, z; an empty row ends a line).

    Raises ValueError where there are none, or where they are broken.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} cannot be read: {error}") from error
    lines = list(_obj_lines(text, path) if path.suffix.lower() == ".obj" else _csv_lines(text, path))
    if not any(len(line) > 1 for line in lines):
        raise ValueError(f"{path} holds no lines")
    return [np.array(line, np.float64) for line in lines if len(line) > 1]


def segments(lines: list[Vectors]) -> Vectors:
    """All the segments of polylines, (s, 2, 3)."""
    return np.array([ends for line in lines for ends in pairwise(line)], np.float64)


def _obj_lines(text: str, path: Path) -> Iterator[list[list[float]]]:
    points: list[list[float]] = []
    for number, row in enumerate(text.splitlines(), 1):
        words = row.split()
        try:
            if words[:1] == ["v"]:
                points.append(_point(words[1:4]))
            elif words[:1] == ["l"]:
                wanted = [int(word.partition("/")[0]) for word in words[1:]]
                if any(i == 0 or i > len(points) or -i > len(points) for i in wanted):
                    raise ValueError("no such vertex")
                yield [points[i - 1 if i > 0 else i] for i in wanted]
        except ValueError as error:
            raise ValueError(f"{path}, line {number}: {error}") from error


def _csv_lines(text: str, path: Path) -> Iterator[list[list[float]]]:
    line: list[list[float]] = []
    for number, row in enumerate(csv.reader(text.splitlines()), 1):
        if not any(map(str.strip, row)):
            yield line
            line = []
            continue
        try:
            line.append(_point(row))
        except ValueError as error:
            if number > 1:  # the first row may name the columns
                raise ValueError(f"{path}, line {number}: {error}") from error
    yield line


def _point(words: list[str]) -> list[float]:
    point = [float(word) for word in words]
    if len(point) != 3 or not np.isfinite(point).all():
        raise ValueError("a point has three finite coordinates")
    return point
