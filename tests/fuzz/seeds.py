"""The good files that the fuzzer damages: own shapes in every format, texts by hand, real small ones."""

from __future__ import annotations

import base64
import io
import json
import os
import struct
import zipfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from weathercoat.mesh.shapes import make_box, make_plate, make_sphere
from weathercoat.output.meshes import WRITERS, write_mesh

LARGEST = 40_000
"""Bytes of the largest real file that is taken: small files are read fast and damaged where it matters."""


@dataclass(frozen=True)
class Seed:
    """A file to be damaged. extension: with no dot."""

    name: str
    extension: str
    data: bytes


def make_seeds() -> list[Seed]:
    """The seeds that every checkout has, in a fixed order."""
    seeds = []
    plate = make_plate(columns=3, rows=2)
    corner = plate.vertices[plate.faces]
    shapes = {
        "plate": replace(
            plate,
            uv=corner[..., :2].copy(),
            colors=np.linspace(0.0, 1.0, 4 * len(plate.vertices)).reshape(-1, 4),
            groups=("left", "right"),
            face_group=(np.arange(len(plate.faces)) % 2).astype(np.int32),
        ),
        "box": make_box(cells=1),
        "sphere": make_sphere(subdivisions=1),
    }
    for name, surface in shapes.items():
        for format in WRITERS:
            stream = io.BytesIO()
            write_mesh(stream, surface, format=format)
            seeds.append(Seed(f"{name}.{format}", format, stream.getvalue()))
    texts = {"obj": _OBJ_TEXTS, "off": _OFF_TEXTS, "stl": (_STL_TEXT,), "ply": (*_PLY_TEXTS, *_ply_bodies())}
    for format, contents in texts.items():
        seeds += [
            Seed(f"text{i}.{format}", format, text if isinstance(text, bytes) else text.encode())
            for i, text in enumerate(contents)
        ]
    seeds += [Seed(f"tree{i}.gltf", "gltf", json.dumps(d).encode()) for i, d in enumerate(_gltf_documents())]
    seeds.append(Seed("packed.glb", "glb", make_glb(_gltf_documents()[1])))
    seeds.append(Seed("marked.obj", "obj", _OBJ_TEXTS[0].encode("utf-16")))
    seeds.append(Seed("shift-jis.obj", "obj", ("o 表\n" + _OBJ_TEXTS[1]).encode("cp932")))
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr(zipfile.ZipInfo("cube.obj"), _OBJ_TEXTS[0])
    seeds.append(Seed("cube.zip", "zip", archive.getvalue()))
    return seeds


def real_seeds() -> list[Seed]:
    """The small files of the folder that `WEATHERCOAT_MESHES` names, sorted by name; none without it."""
    folder = os.environ.get("WEATHERCOAT_MESHES", "")
    if not folder:
        return []
    paths = sorted(p for p in Path(folder).rglob("*.*") if p.is_file() and 0 < p.stat().st_size <= LARGEST)
    return [Seed(p.name, p.suffix.lower()[1:], p.read_bytes()) for p in paths if p.suffix != ".tsv"]


def make_glb(document: dict[str, Any]) -> bytes:
    """A document with one embedded buffer as GLB."""
    body = base64.b64decode(document["buffers"][0]["uri"].partition(",")[2])
    return pack_glb(document | {"buffers": [{"byteLength": len(body)}]}, body)


def pack_glb(document: object, body: bytes) -> bytes:
    """JSON and a binary chunk as GLB."""
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    body += bytes(-len(body) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(body), b"BIN\0") + body
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


_CORNERS = ["0 0 0", "1 0 0", "1 1 0", "0 1 0", "0 0 1", "1 0 1", "1 1 1", "0 1 1"]
_QUADS = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))

_OBJ_TEXTS = (
    "# made by hand\nmtllib cube.mtl\no cube\n"
    + "".join(f"v {p}\n" for p in _CORNERS)
    + "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\nusemtl red paint\ns 1\n"
    + "".join("f " + " ".join(f"{q + 1}/{i + 1}/1" for i, q in enumerate(quad)) + "\n" for quad in _QUADS),
    "g first\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 1 1 0 0 0 1\nf -3 -2 -1\ns off\ng second\nv 0 0 2.5e-1\n"
    "v 1 0 .25\nv 1 1 +0.25\nv 0 1 25.e-2\nf -4 -3 \\\n -2 -1\nl 1 2\np 1\nvn 0 0 1\nf 1//1 2//-1 3//1\n",
    "v 0 0 0\nv 3 0 0\nv 3 1 0\nv 1 1 0\nv 1 3 0\nv 0 3 0\nf 4 5 6 1 2 3\n",
)
_OFF_TEXTS = (
    "OFF\n8 6 12\n"
    + "\n".join(_CORNERS)
    + "\n\n# faces\n"
    + "".join("4 " + " ".join(map(str, q)) + "\n" for q in _QUADS),
    "COFF # colours\n4 2 0\n0 0 0 255 0 0 255\n1 0 0 0 255 0 255\n0 1 0 0 0 255 255\n1 1 0 9 9 9 255\n"
    "3 0 1 2 0.5 0.5 0.5\n3 2 1 3 7\n",
    "STNOFF 3 1 0\n0 0 0 0 0 1 0 0\n1 0 0 0 0 1 1 0\n0 1 0 0 0 1 0 1\n3 0 1 2\n",
)
_STL_TEXT = (
    "solid two\n"
    + "".join(
        "facet normal 0 0 1\n  outer loop\n"
        + "".join(f"    vertex {p}\n" for p in points)
        + "  endloop\nendfacet\n"
        for points in (("0 0 0", "1 0 0", "0 1 0"), ("1 0 0", "1e0 1.0 0", "0 1 -0"))
    )
    + "endsolid two\nsolid\nendsolid\n"
)
_PLY_HEADER = (
    "ply\nformat {order} 1.0\ncomment by hand\nobj_info none\nelement vertex 8\nproperty double x\n"
    "property float y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
    "property float s\nproperty float t\nelement edge 1\nproperty int vertex1\nproperty int vertex2\n"
    "element face 6\nproperty ushort flags\nproperty list uchar int vertex_indices\n"
    "property list uint8 float32 texcoord\nend_header\n"
)
_PLY_TEXTS = (
    _PLY_HEADER.format(order="ascii")
    + "".join(f"{p} 255 0 51 0.5 0.5\n" for p in _CORNERS)
    + "0 1\n"
    + "".join("7 4 " + " ".join(map(str, q)) + " 8 0 0 1 0 1 1 0 1\n" for q in _QUADS),
    "ply\r\nformat ascii 1.0\r\nelement vertex 6\r\nproperty float x\r\nproperty float y\r\n"
    "property float z\r\nelement tristrips 1\r\nproperty list int int vertex_indices\r\nend_header\r\n"
    "0 0 0\r\n1 0 0\r\n0 1 0\r\n1 1 0\r\n0 2 0\r\n1 2 0\r\n8 0 1 2 3 -1 2 3 4\r\n",
)


def _ply_bodies() -> list[bytes]:
    """Binary PLY of both byte orders."""
    result = []
    for order, mark in (("binary_little_endian", "<"), ("binary_big_endian", ">")):
        body = b"".join(
            struct.pack(mark + "d2f3B2f", *map(float, p.split()), 255, 0, 51, 0.5, 0.5) for p in _CORNERS
        )
        body += struct.pack(mark + "2i", 0, 1)
        for quad in _QUADS:
            body += struct.pack(mark + "HB4iB8f", 7, 4, *quad, 8, 0, 0, 1, 0, 1, 1, 0, 1)
        result.append(_PLY_HEADER.format(order=order).encode() + body)
    return result


def _gltf_documents() -> list[dict[str, Any]]:
    """A cube with texture coordinates and colours; and a small scene with much of what glTF can say."""
    positions = np.array([p.split() for p in _CORNERS], "<f4")
    quads = np.array(_QUADS)
    indices = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype("<u2")
    fine = np.array([[0, 0], [65535, 0], [65535, 65535], [0, 65535]] * 2, "<u2")
    colors = np.full((8, 4), 200, np.uint8)
    strip = np.array([0, 1, 3, 2, 0, 0, 0, 0], np.uint8)
    interleaved = np.zeros((4, 4), "<f4")
    interleaved[:, :3] = positions[:4] + 3
    parts = [positions, indices, fine, colors, strip, interleaved, np.array([1, 2], "<u2"), positions[:2] + 1]
    views, at = [], 0
    for part in parts:
        views.append({"buffer": 0, "byteOffset": at, "byteLength": part.nbytes})
        at += part.nbytes
    views[5]["byteStride"] = 16
    body = b"".join(part.tobytes() for part in parts)
    buffer = {
        "byteLength": len(body),
        "uri": "data:application/octet-stream;base64," + base64.b64encode(body).decode(),
    }
    low, high = {"min": [0, 0, 0]}, {"max": [1, 1, 1]}
    accessors: list[dict[str, Any]] = [
        {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3", **low, **high},
        {"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"},
        {"bufferView": 2, "componentType": 5123, "count": 8, "type": "VEC2", "normalized": True},
        {"bufferView": 3, "componentType": 5121, "count": 8, "type": "VEC4", "normalized": True},
        {"bufferView": 4, "byteOffset": 0, "componentType": 5121, "count": 4, "type": "SCALAR"},
        {"bufferView": 5, "componentType": 5126, "count": 4, "type": "VEC3"},
        {
            "componentType": 5126,
            "count": 4,
            "type": "VEC3",
            "sparse": {
                "count": 2,
                "indices": {"bufferView": 6, "componentType": 5123},
                "values": {"bufferView": 7, "byteOffset": 0},
            },
        },
    ]
    cube = {
        "name": "cube",
        "primitives": [
            {
                "attributes": {"POSITION": 0, "TEXCOORD_0": 2, "COLOR_0": 3},
                "indices": 1,
                "material": 0,
                "mode": 4,
            }
        ],
    }
    plain = {
        "asset": {"version": "2.0", "generator": "tests"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "root"}],
        "meshes": [cube],
        "materials": [{"name": "red", "pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1]}}],
        "accessors": accessors[:4],
        "bufferViews": views[:4],
        "buffers": [buffer],
    }
    scene = plain | {
        "scenes": [{"nodes": [0, 2]}],
        "nodes": [
            {"children": [1], "translation": [10, 0, 0], "rotation": [0, 0, 0.6, 0.8], "scale": [-2, 1, 1]},
            {"mesh": 0, "children": [3]},
            {"mesh": 1, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 5, 5, 1]},
            {"name": "empty"},
        ],
        "meshes": [
            cube,
            {
                "primitives": [
                    {"attributes": {"POSITION": 5}, "indices": 4, "mode": 5},
                    {"attributes": {"POSITION": 5, "_WEAR": 5}, "mode": 6},
                    {"attributes": {"POSITION": 6}, "mode": 6},
                    {"attributes": {"POSITION": 5}, "mode": 1},
                ]
            },
        ],
        "accessors": accessors,
        "bufferViews": views,
    }
    return [plain, scene]


def foreign_seeds() -> list[Seed]:
    """Formats that meshio reads, by hand: a square of two triangles each."""
    vtk = (
        "# vtk DataFile Version 3.0\nplate\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 double\n"
        "0 0 0\n1 0 0\n1 1 0\n0 1 0\nCELLS 2 8\n3 0 1 2\n3 0 2 3\nCELL_TYPES 2\n5\n5\n"
    )
    medit = (
        "MeshVersionFormatted 1\nDimension 3\nVertices\n4\n0 0 0 0\n1 0 0 0\n1 1 0 0\n0 1 0 0\n"
        "Triangles\n2\n1 2 3 0\n1 3 4 0\nEnd\n"
    )
    gmsh = (
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n$EndNodes\n"
        "$Elements\n2\n1 2 2 0 1 1 2 3\n2 2 2 0 1 1 3 4\n$EndElements\n"
    )
    texts = {"vtk": vtk, "mesh": medit, "msh": gmsh}
    return [Seed(f"other.{extension}", extension, text.encode()) for extension, text in texts.items()]
