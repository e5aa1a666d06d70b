"""What a file is, by its content first and its extension second."""

from __future__ import annotations

import re

from weathercoat.errors import FormatError, Note
from weathercoat.mesh.formats.obj import KEYWORDS
from weathercoat.mesh.formats.off import HEADER as OFF_HEADER
from weathercoat.mesh.formats.stl import is_binary_stl, is_text_stl, looks_like_coordinates
from weathercoat.mesh.formats.text import normalise

OWN = ("obj", "ply", "stl", "off", "glb", "gltf", "zip")
# What meshio reads beyond those, by extension.
FOREIGN = (
    "vtk", "vtu", "msh", "inp", "mesh", "meshb", "med", "nas", "bdf", "fem", "tec", "dat", "xml",
    "xdmf", "xmf", "cgns", "e", "exo", "ex2", "h5m", "avs", "su2", "ugrid", "wkt", "mdpa",
    "f3grid", "node", "ele", "post", "dato",
)  # fmt: skip

_STRANGERS = (
    (re.compile(rb"\s*(<!doctype html|<html|<head|<body)", re.IGNORECASE), "an HTML page"),
    (
        re.compile(rb"version https://git-lfs"),
        "a git-LFS pointer (fetch the file itself with `git lfs pull`)",
    ),
    (re.compile(rb"\x1f\x8b"), "gzip-compressed data"),
    (re.compile(rb"BZh|\xfd7zXZ\0|7z\xbc\xaf|Rar!|\x28\xb5\x2f\xfd"), "a compressed archive"),
    (re.compile(rb"\x89PNG|\xff\xd8\xff|GIF8|BM....\0\0\0\0|RIFF....WEBP", re.DOTALL), "a picture"),
    (re.compile(rb"%PDF"), "a PDF document"),
    (re.compile(rb"Kaydara FBX Binary|; FBX"), "FBX"),
    (re.compile(rb"BLENDER"), "a Blender file"),
    (re.compile(rb"ISO-10303-21"), "STEP"),
    (re.compile(rb"#USDA|PXR-USDC"), "USD"),
    (re.compile(rb"PK\x03\x04.*3D/3dmodel\.model", re.DOTALL), "3MF"),
    (re.compile(rb"PK\x03\x04.{26}[^\0]*\.usd[ac]?", re.DOTALL), "USD"),
    (re.compile(rb"\x7fELF|MZ"), "a program"),
    (re.compile(rb"(?s)\s*<\?xml.{0,400}<COLLADA"), "COLLADA"),
)


# Programs write whole licences before the first line that tells.
_COMMENTS = re.compile(rb"(?:\xef\xbb\xbf)?+\s*+(?:#[^\r\n]*+\s*+)*+")


def identify(data: bytes, extension: str) -> tuple[str, Note | None]:
    """The format of `data` named with `extension` (no dot, lower case), and W-FORMAT where the two disagree.

    Errors: FormatError, which says what the content looks like.
    """
    known = extension in OWN or extension in FOREIGN
    for pattern, name in _STRANGERS:
        if pattern.match(data[:2048]):
            raise FormatError(f"looks like {name}")
    content = _content(data)
    if extension and not known:
        seems = (
            f"; the content looks like {content.upper()}, which --format {content} would read"
            if content
            else ""
        )
        raise FormatError(f"the extension .{extension} is unknown{seems}")
    if content is None:
        return _by_extension(data, extension), None
    if extension and content != extension and {content, extension} != {"glb", "gltf"}:
        if extension in FOREIGN and content == "obj":
            return extension, None
        return content, Note("W-FORMAT", 1, f"the content is {content.upper()}, the extension .{extension}")
    return content, None


def _content(data: bytes) -> str | None:
    """The format that the content alone tells, or None."""
    if data.startswith(b"glTF"):
        return "glb"
    if data.startswith((b"PK\x03\x04", b"PK\x05\x06")):
        return "zip"
    if re.match(rb"ply\s", data):
        return "ply"
    if is_binary_stl(data) or is_text_stl(data):
        return "stl"
    start = _text_start(data)
    if start is None:
        return None
    if start.lstrip().startswith(b"{") and b'"asset"' in data:
        return "gltf"
    if OFF_HEADER.match(start):
        return "off"
    return "obj" if _looks_like_obj(start) else None


def _text_start(data: bytes) -> bytes | None:
    """The first 64 kB behind comments as normalised text, or None for binary data."""
    comments = _COMMENTS.match(data)
    begin = comments.end() if comments else 0
    start = data[begin : begin + 65536]
    if start.startswith((b"\xff\xfe", b"\xfe\xff")):
        start = start[: len(start) // 2 * 2].decode("utf-16", "replace").encode()
    start = normalise(start)
    control = sum(start.count(byte) for byte in (b"\0", b"\1", b"\2", b"\3", b"\x7f", b"\x1b"))
    return None if control else start


def _looks_like_obj(start: bytes) -> bool:
    """Whether the first words of nearly all lines are keywords of OBJ, and one of them makes geometry."""
    lines = [line.split() for line in start.split(b"\n")[:2000]]
    words = [line[0].decode("latin-1") for line in lines if line and not line[0].startswith(b"#")]
    known = sum(word in KEYWORDS for word in words)
    return any(word in ("v", "vt", "vn", "f") for word in words) and known > 0.5 * len(words)


def _by_extension(data: bytes, extension: str) -> str:
    start = _text_start(data)
    if extension in FOREIGN:
        return extension
    if extension == "stl" and (
        looks_like_coordinates(data) or data[:80].lstrip().lower().startswith(b"solid")
    ):
        return "stl"
    if start is None:
        seems = "UTF-16 text without a byte order mark" if _is_unmarked_utf16(data) else "binary data"
        raise FormatError(f"looks like {seems}")
    if extension == "obj" and _only_comments(start):
        return "obj"
    if extension == "off" and start.split()[:1] == [b"OFF"]:
        return "off"
    raise FormatError(
        "looks like text" + (f", but not like {extension.upper()}" if extension else " of no known format")
    )


def _is_unmarked_utf16(data: bytes) -> bool:
    """Whether nearly every second byte is zero, and hardly any of the others."""
    even, odd = (data[i:1024:2].count(0) / max(len(data[i:1024:2]), 1) for i in (0, 1))
    return max(even, odd) > 0.9 and min(even, odd) < 0.1


def _only_comments(start: bytes) -> bool:
    return all(not line.strip() or line.lstrip().startswith(b"#") for line in start.split(b"\n"))
