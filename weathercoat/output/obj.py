"""Nodes as Wavefront OBJ with a material library and its pictures.

Vertex colours stand after the position, where MeshLab, Blender and others read them; OBJ has no place for
further scalars. Programs that do not read colours show the materials, with the model's own pictures.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np

from weathercoat.output.glb import Material, Node, Sheet
from weathercoat.output.meshes import text_lines
from weathercoat.output.shading import to_srgb
from weathercoat.output.textures import PictureFolder

_OWN_COLORS = (0.8, 0.8, 0.8)  # of what shows vertex colours, for programs that do not read them


def write_obj(path: Path, nodes: Sequence[Node]) -> None:
    """Write nodes as one OBJ, an object for each, and its library and pictures beside it.

    Raises OSError where one cannot be written.
    """
    library = path.with_suffix(".mtl")
    materials: list[Material] = []
    has_uv = any(sheet.uv is not None for node in nodes for sheet in node.sheets)
    vertex = 1
    with path.open("wb") as stream:
        stream.write(f"mtllib {library.name}\n".encode())
        for node in nodes:
            stream.write(f"o {_word(node.name)}\n".encode("utf-8", "replace"))
            for sheet in node.sheets:
                if not len(sheet.faces):
                    continue
                if sheet.material not in materials:
                    materials.append(sheet.material)
                name = _names(materials)[materials.index(sheet.material)]
                stream.write(f"usemtl {name}\n".encode("utf-8", "replace"))
                _write_sheet(stream, sheet, vertex, has_uv=has_uv)
                vertex += len(sheet.vertices)
    pictures = PictureFolder(path.parent)
    with library.open("w", encoding="utf-8", errors="replace") as file:
        for name, material in zip(_names(materials), materials, strict=True):
            file.writelines(f"{line}\n" for line in _material(name, material, pictures))


def _write_sheet(stream: BinaryIO, sheet: Sheet, vertex: int, *, has_uv: bool) -> None:
    """A sheet whose first vertex has this number. Where others have texture coordinates, it has as many as
    vertices as well, since some readers ask for that.
    """
    columns = [sheet.vertices]
    if sheet.colors is not None:
        columns.append(to_srgb(sheet.colors) / 255.0)
    stream.writelines(text_lines("v" + " %r" * (3 * len(columns)) + "\n", np.hstack(columns)))
    stream.writelines(text_lines("vn %.6f %.6f %.6f\n", sheet.normals))
    row = "f" + " %d//%d" * 3 + "\n"
    if has_uv:
        uv = np.zeros((len(sheet.vertices), 2)) if sheet.uv is None else sheet.uv
        stream.writelines(text_lines("vt %r %r\n", uv))
        row = "f" + " %d/%d/%d" * 3 + "\n"
    corner = sheet.faces.astype(np.int64) + vertex
    indices = np.repeat(corner.reshape(-1, 1), 3 if has_uv else 2, axis=1)
    stream.writelines(text_lines(row, indices.reshape(len(corner), -1)))


def _names(materials: Sequence[Material]) -> list[str]:
    """Words that name the materials, each another one."""
    names: list[str] = []
    for material in materials:
        word, number = _word(material.name), 2
        while word in names:
            word, number = f"{_word(material.name)}_{number}", number + 1
        names.append(word)
    return names


def _word(name: str) -> str:
    return "_".join(name.split()) or "_"


def _material(name: str, material: Material, pictures: PictureFolder) -> Iterator[str]:
    source = material.source
    color = material.base_color if source is None else source.base_color[:3]
    picture = None if source is None else source.base_texture
    shown = np.array(_OWN_COLORS) if source is None else to_srgb(np.array(color)) / 255.0
    yield f"newmtl {name}"
    yield "Kd " + " ".join(f"{x:.4f}" for x in shown)
    yield f"Pm {material.metallic:g}"
    yield f"Pr {material.roughness:g}"
    if source is not None and source.base_color[3] < 1.0:
        yield f"d {source.base_color[3]:.4f}"
    if picture is not None:
        yield f"map_Kd {pictures.add(picture)}"
