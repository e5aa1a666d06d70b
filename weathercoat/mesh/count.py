"""About how many triangles a file holds, from its header or its lines, without reading it as a model."""

from __future__ import annotations

import json
import mmap
import re
import struct
from pathlib import Path

_HEADER = 65_536
_BYTES_PER_FACE = 40  # of files that do not tell: compressed, or of formats that only meshio knows
_BINARY_STL = 84, 50  # bytes of the header and of a face
_GLB_JSON = 20  # where it begins
_PLY_FACES = re.compile(rb"element\s+face\s+(\d+)")
_OFF_FACES = re.compile(rb"OFF\s+(?:#[^\n]*\s+)*\d+\s+(\d+)")


def count_faces(path: Path) -> int:
    """The number of faces that a file tells of, quickly and roughly: polygons count once.

    0 for a file that cannot be read; whoever reads it as a model reports that.
    """
    try:
        size = path.stat().st_size
        with path.open("rb") as stream:
            head = stream.read(_HEADER)
            found = _counted(head, size, path.suffix.lower())
            if found is None and path.suffix.lower() in (".obj", ".stl"):
                with mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as content:
                    found = len(re.findall(rb"(?m)^\s*(?:f|facet)\s", content))
        return size // _BYTES_PER_FACE if found is None else min(found, size)
    except (OSError, ValueError):
        return 0


def _counted(head: bytes, size: int, extension: str) -> int | None:
    """What the first bytes of a file tell; None where they tell nothing."""
    if head.startswith(b"ply"):
        match = _PLY_FACES.search(head)
        return int(match[1]) if match else None
    if head.startswith(b"glTF") and len(head) >= _GLB_JSON:
        return _count_in_gltf(head[_GLB_JSON : _GLB_JSON + struct.unpack_from("<I", head, 12)[0]])
    if extension == ".gltf":
        return _count_in_gltf(head)
    if extension == ".stl" and len(head) >= _BINARY_STL[0]:
        count = int(struct.unpack_from("<I", head, 80)[0])
        return count if _BINARY_STL[0] + _BINARY_STL[1] * count == size else None
    if extension == ".off":
        match = _OFF_FACES.search(head)
        return int(match[1]) if match else None
    return None


def _count_in_gltf(text: bytes) -> int | None:
    """A third of the indices of all primitives, each mesh once; None where the JSON goes on beyond `text`."""
    try:
        content = json.loads(text)
        accessors = content["accessors"]
        used = [
            accessors[primitive.get("indices", primitive["attributes"]["POSITION"])]["count"]
            for mesh in content["meshes"]
            for primitive in mesh["primitives"]
        ]
        return int(sum(used)) // 3
    except (ValueError, KeyError, TypeError, IndexError, AttributeError, RecursionError):
        return None
