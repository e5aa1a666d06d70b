"""A textured GLB: a hierarchy with transforms, two materials with pictures, mirrored texture coordinates."""

from __future__ import annotations

import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

TURN = [0.0, 0.38268343, 0.0, 0.92387953]  # 45 degrees about y
NODES: list[dict[str, Any]] = [
    {"name": "gate", "children": [1, 2], "translation": [3.0, 0.0, -2.0], "extras": {"id": 7}},
    {"name": "left wing", "mesh": 0, "rotation": TURN},
    {"name": "right wing", "mesh": 0, "scale": [-1.5, 1.0, 1.0], "translation": [0.5, 0.0, 0.0]},
]


def picture(color: tuple[int, int, int]) -> bytes:
    """A PNG whose left half is of a colour, and whose right half is darker."""
    pixels = np.full((16, 16, 3), color, np.uint8)
    pixels[:, 8:] //= 2
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "PNG")
    return stream.getvalue()


def write_gate(path: Path) -> Path:
    """A wing of 2 by 1.2, of a panel and a frame, that two nodes show; the upper half of the panel mirrors
    the texture of the lower one.
    """
    panel = _grid(1.0, 1.2, 0.0, lambda u, v: (0.1 + 0.4 * u, 1.0 - 0.8 * abs(v - 0.6) / 0.6))
    frame = _grid(1.0, 1.2, 1.0, lambda u, v: (0.5 + 0.4 * u, 0.1 + 0.8 * v / 1.2))
    pictures = [picture((170, 110, 60)), picture((60, 90, 150))]
    views: list[dict[str, Any]] = []
    accessors: list[dict[str, Any]] = []
    blob = bytearray()

    def view(content: bytes) -> int:
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": len(content)})
        blob.extend(content + bytes(-len(content) % 4))
        return len(views) - 1

    def accessor(values: np.ndarray, kind: str, component: int) -> int:
        entry = {"bufferView": view(values.tobytes()), "componentType": component, "type": kind}
        entry["count"] = values.size if kind == "SCALAR" else len(values)
        if kind == "VEC3":
            entry |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        accessors.append(entry)
        return len(accessors) - 1

    primitives = []
    for material, (points, uv, faces) in enumerate((panel, frame)):
        normals = np.tile(np.array([0.0, 0.0, 1.0], "<f4"), (len(points), 1))
        attributes = {
            "POSITION": accessor(points, "VEC3", 5126),
            "NORMAL": accessor(normals, "VEC3", 5126),
            "TEXCOORD_0": accessor(uv, "VEC2", 5126),
        }
        indices = accessor(faces.ravel(), "SCALAR", 5125)
        primitives.append({"attributes": attributes, "indices": indices, "material": material})
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": NODES,
        "meshes": [{"name": "wing", "primitives": primitives}],
        "materials": [
            {
                "name": name,
                "pbrMetallicRoughness": {
                    "baseColorTexture": {"index": number},
                    "metallicFactor": 0.1 * number,
                    "roughnessFactor": 0.6,
                },
            }
            for number, name in enumerate(("oak panel", "blue frame"))
        ],
        "textures": [{"source": 0, "sampler": 0}, {"source": 1, "sampler": 0}],
        "samplers": [{"wrapS": 33071, "wrapT": 33648}],
        "images": [{"bufferView": view(content), "mimeType": "image/png"} for content in pictures],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(blob)}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    header = struct.pack("<4sIII4s", b"glTF", 2, 28 + len(text) + len(blob), len(text), b"JSON")
    path.write_bytes(header + text + struct.pack("<I4s", len(blob), b"BIN\0") + bytes(blob))
    return path


def _grid(
    width: float, height: float, left: float, texture: Any
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    across, up = np.meshgrid(np.linspace(0.0, width, 5), np.linspace(0.0, height, 7))
    points = np.stack([left + across.ravel(), up.ravel(), np.zeros(across.size)], axis=1).astype("<f4")
    uv = np.array([texture(u, v) for u, v in zip(across.ravel(), up.ravel(), strict=True)], "<f4")
    uv[:, 1] = 1.0 - uv[:, 1]
    faces = []
    for row in range(6):
        for column in range(4):
            a = 5 * row + column
            faces += [[a, a + 1, a + 6], [a, a + 6, a + 5]]
    return points, uv, np.array(faces, "<u4")
