"""Finished runs to verify, and what tests do to them: editing their files, with or without a new hash."""

from __future__ import annotations

import hashlib
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weathercoat.config.load import load_config
from weathercoat.mesh.surface import Surface
from weathercoat.output.meshes import write_mesh
from weathercoat.run import run_asset

QUICK = ("output.picture_width=32", "output.picture_height=24")
TYPES = {"uchar": "u1", "int": "<i4", "float": "<f4", "double": "<f8"}
END = b"end_header\n"


def make_run(folder: Path, surface: Surface, config: str, *overrides: str) -> Path:
    """The folder of a run of a surface, not checked."""
    model = folder.with_suffix(".obj")
    write_mesh(model, surface)
    run_asset(load_config(config, [*QUICK, *overrides]), model, folder, check=False)
    model.unlink()
    return folder


def edit_report(folder: Path) -> dict[str, Any]:
    """The report, to be changed and written back with `write_report`."""
    content: dict[str, Any] = json.loads((folder / "run.json").read_bytes())
    return content


def write_report(folder: Path, content: Any) -> None:
    """Write a report as it is."""
    (folder / "run.json").write_text(json.dumps(content))


def seal(folder: Path) -> None:
    """Give the report the hashes of the files that are there, so that only their content can be found out."""
    content = edit_report(folder)
    content["files"] = {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in ("run.json", "timing.json")
    }
    write_report(folder, content)


class Ply:
    """A PLY file whose tables can be changed: `vertex` and `face` are records by the names of properties."""

    def __init__(self, path: Path) -> None:
        self.path = path
        content = path.read_bytes()
        end = content.index(END) + len(END)
        self.header = content[:end]
        tables: list[tuple[int, list[Any]]] = []
        for line in self.header.decode().splitlines():
            match line.split():
                case ["element", _, count]:
                    tables.append((int(count), []))
                case ["property", "list", *_]:
                    tables[-1][1].extend([("count", "u1"), ("corners", "<i4", (3,))])
                case ["property", kind, name]:
                    tables[-1][1].append((name, TYPES[kind]))
        (count, fields), (face_count, face_fields) = tables
        self.vertex = np.frombuffer(content, fields, count, end).copy()
        self.face = np.frombuffer(content, face_fields, face_count, end + self.vertex.nbytes).copy()
        self.metal = int(np.count_nonzero(self.vertex["part"] == 0)) if "part" in self.header.decode() else 0
        self.metal_faces = int(np.count_nonzero(self.face["part"] == 0)) if self.metal else 0

    def save(self) -> None:
        """Write the file back, with the counts of its tables."""
        lines = self.header.split(b"\n")
        for i, line in enumerate(lines):
            for name, table in ((b"vertex", self.vertex), (b"face", self.face)):
                if line.startswith(b"element " + name):
                    lines[i] = b"element %s %d" % (name, len(table))
        self.path.write_bytes(b"\n".join(lines) + self.vertex.tobytes() + self.face.tobytes())


class Glb:
    """A GLB file whose JSON and arrays can be changed in place."""

    def __init__(self, path: Path) -> None:
        self.path = path
        content = path.read_bytes()
        (length,) = struct.unpack_from("<I", content, 12)
        self.document: dict[str, Any] = json.loads(content[20 : 20 + length])
        self.binary = bytearray(content[28 + length :])

    def primitive(self, node: str, number: int = 0) -> dict[str, Any]:
        """A primitive of the film or the substrate."""
        roles = ("film", "back", "rim") if node == "film" else (node,)
        every = (primitive for mesh in self.document["meshes"] for primitive in mesh["primitives"])
        found: dict[str, Any] = [p for p in every if p["extras"]["role"] in roles][number]
        return found

    def array(self, accessor: int) -> NDArray[Any]:
        """The numbers of an accessor, flat, to be changed."""
        entry = self.document["accessors"][accessor]
        view = self.document["bufferViews"][entry["bufferView"]]
        kind = "<u4" if entry["componentType"] == 5125 else "<f4"
        return np.frombuffer(self.binary, kind, view["byteLength"] // 4, view["byteOffset"])

    def save(self) -> None:
        """Write the file back."""
        text = json.dumps(self.document).encode()
        text += b" " * (-len(text) % 4)
        total = 28 + len(text) + len(self.binary)
        head = struct.pack("<4sIII4s", b"glTF", 2, total, len(text), b"JSON")
        self.path.write_bytes(
            head + text + struct.pack("<I4s", len(self.binary), b"BIN\0") + bytes(self.binary)
        )
