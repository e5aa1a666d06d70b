"""Small glTF documents for tests of scenes: a cube as each mesh, arrays, nodes as asked."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np

from tests.fuzz.seeds import pack_glb
from weathercoat.mesh.shapes import make_box

CUBE = make_box(1.0, 1.0, 1.0, cells=1)

COMPONENTS = {"|u1": 5121, "<u2": 5123, "<u4": 5125, "<f4": 5126}
WIDTHS = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}


class Document:
    """glTF JSON in the making; `mesh()` and `accessor()` give numbers to refer to."""

    def __init__(self) -> None:
        self.body = b""
        self.json: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "nodes": [],
            "meshes": [],
            "accessors": [],
            "bufferViews": [],
        }

    def accessor(self, values: np.ndarray) -> int:
        """An accessor of an array (n, width) of a stored type."""
        rows = values.reshape(len(values), -1)
        view = {"buffer": 0, "byteOffset": len(self.body), "byteLength": rows.nbytes}
        self.json["bufferViews"].append(view)
        self.body += rows.tobytes() + bytes(-rows.nbytes % 4)
        self.json["accessors"].append(
            {
                "bufferView": len(self.json["bufferViews"]) - 1,
                "componentType": COMPONENTS[values.dtype.str],
                "count": len(rows),
                "type": WIDTHS[rows.shape[1]],
            }
        )
        return len(self.json["accessors"]) - 1

    def mesh(self, name: str | None = None, **primitive: Any) -> int:
        """A cube of edge length 1 that stands on the origin."""
        attributes = {"POSITION": self.accessor(CUBE.vertices.astype("<f4"))}
        entry = {
            "attributes": attributes,
            "indices": self.accessor(CUBE.faces.astype("<u2").reshape(-1)),
            **primitive,
        }
        self.json["meshes"].append({"primitives": [entry]} | ({"name": name} if name else {}))
        return len(self.json["meshes"]) - 1

    def node(self, **entry: Any) -> int:
        """A node, of the scene or the child of one that names its number."""
        self.json["nodes"].append(entry)
        return len(self.json["nodes"]) - 1

    def write(self, path: Path, **more: Any) -> Path:
        """The document as a .gltf file with an embedded buffer, or a .glb."""
        children = {child for node in self.json["nodes"] for child in node.get("children", [])}
        tops = [i for i in range(len(self.json["nodes"])) if i not in children]
        document = {**self.json, "scene": 0, "scenes": [{"nodes": tops}], **more}
        if path.suffix == ".gltf":
            uri = "data:application/octet-stream;base64," + base64.b64encode(self.body).decode()
            document["buffers"] = [{"byteLength": len(self.body), "uri": uri}]
            path.write_text(json.dumps(document))
            return path
        document["buffers"] = [{"byteLength": len(self.body)}]
        path.write_bytes(pack_glb(document, self.body))
        return path
