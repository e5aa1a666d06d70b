"""Film and metal of snapshots for ParaView and others that read VTK: a VTU each, and a PVD of all.

Source: VTK File Formats, version 1.0 of unstructured grids with raw appended data.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from weathercoat.mesh.surface import Indices, Surface, Vectors, vertex_normals
from weathercoat.output.ply import color_bytes
from weathercoat.output.sheets import split_corners
from weathercoat.output.snapshots import hair, set_in
from weathercoat.sim.snapshot import Snapshot

_TRIANGLE = 5
_TYPES = {"f8": "Float64", "f4": "Float32", "i4": "Int32", "i8": "Int64", "u1": "UInt8"}
PARTS = ("metal", "film")


class _Grid(NamedTuple):
    """Triangles (m, 3) of vertices (n, 3), with arrays over vertices and faces."""

    vertices: Vectors
    faces: Indices
    point_data: dict[str, NDArray[Any]]
    cell_data: dict[str, NDArray[Any]]


def write_snapshot_vtu(folder: Path, snapshot: Snapshot, stem: str) -> list[str]:
    """Write `STEM_metal.vtu` and `STEM_film.vtu` into a folder; their names.

    Points have rust, dirt, separated, adhesion, separation_age, bare, color (sRGB bytes), normals, the
    position at rest, the place on the input, and texture coordinates; cells the number of the metal's face,
    the group and the part. Raises OSError where one cannot be written.
    """
    names = [f"{stem}_{part}.vtu" for part in PARTS]
    for name, grid in zip(names, (_metal(snapshot), _film(snapshot)), strict=True):
        _write(folder / name, grid)
    return names


def write_pvd(path: Path, series: Sequence[tuple[float, Sequence[str]]]) -> None:
    """Write the list of the files of each time, metal and then film; raises OSError."""
    lines = ['<?xml version="1.0"?>', '<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">']
    lines.append("  <Collection>")
    for time, names in series:
        for part, name in enumerate(names):
            lines.append(f'    <DataSet timestep="{time!r}" part="{part}" file={quoteattr(name)}/>')
    lines += ["  </Collection>", "</VTKFile>", ""]
    path.write_text("\n".join(lines), encoding="utf-8")


def _metal(snapshot: Snapshot) -> _Grid:
    data: dict[str, NDArray[Any]] = {
        "rust": snapshot.substrate_rust,
        "dirt": snapshot.dust,
        "bare": snapshot.bare.astype(np.uint8),
        "color": color_bytes(snapshot.substrate_color),
        "Normals": snapshot.substrate_normals,
    }
    count, faces = len(snapshot.substrate_vertices), snapshot.substrate_faces
    vertices = set_in(snapshot, hair(snapshot))
    return _with_model(snapshot, vertices, faces, data, np.arange(count), np.arange(len(faces)))


def _film(snapshot: Snapshot) -> _Grid:
    origin = snapshot.film_origin
    data: dict[str, NDArray[Any]] = {
        "rust": snapshot.film_rust,
        "dirt": snapshot.dust[origin],
        "separated": snapshot.separated.astype(np.uint8),
        "adhesion": snapshot.adhesion,
        "separation_age": snapshot.separation_age,
        "color": color_bytes(snapshot.film_color),
        "Normals": vertex_normals(snapshot.film_vertices, snapshot.film_faces),
    }
    return _with_model(
        snapshot, snapshot.film_vertices, snapshot.film_faces, data, origin, snapshot.film_face
    )


def _with_model(
    snapshot: Snapshot,
    vertices: Vectors,
    faces: Indices,
    data: dict[str, NDArray[Any]],
    origin: NDArray[np.integer],
    face_origin: NDArray[np.integer],
) -> _Grid:
    """A grid with what it has from the model; vertices part where texture coordinates do."""
    data["rest"] = snapshot.substrate_vertices[origin]
    cells: dict[str, NDArray[Any]] = {"origin": face_origin.astype(np.int32)}
    surface: Surface | None = snapshot.surface
    if surface is None:
        return _Grid(vertices, faces, data, cells)
    if surface.place is not None:
        data["input_face"] = surface.place.face[origin]
        data["input_barycentric"] = surface.place.barycentric[origin]
    cells["group"] = surface.face_group[face_origin]
    if surface.face_part is not None:
        cells["part"] = surface.face_part[face_origin]
    if surface.uv is not None and len(faces):
        faces, source, uv = split_corners(faces, surface.uv[face_origin], len(vertices))
        data = {name: values[source] for name, values in data.items()}
        data["TCoords"] = uv
        vertices = vertices[source]
    return _Grid(vertices, faces, data, cells)


def _write(path: Path, grid: _Grid) -> None:
    count, cells = len(grid.vertices), len(grid.faces)
    blocks: list[bytes] = []
    offset = 0

    def array(name: str, values: NDArray[Any]) -> str:
        nonlocal offset
        stored = np.ascontiguousarray(values, _stored(values))
        content = np.uint64(stored.nbytes).tobytes() + stored.tobytes()
        place, offset = offset, offset + len(content)
        blocks.append(content)
        components = f' NumberOfComponents="{stored.shape[1]}"' if stored.ndim == 2 else ""
        kind = _TYPES[stored.dtype.str.lstrip("<|")]
        about = f'type="{kind}" Name={quoteattr(name)}{components}'
        return f'<DataArray {about} format="appended" offset="{place}"/>'

    def section(name: str, arrays: Mapping[str, NDArray[Any]], attributes: str = "") -> list[str]:
        return [f"<{name}{attributes}>", *(array(*item) for item in arrays.items()), f"</{name}>"]

    ends = np.arange(3, 3 * cells + 1, 3, dtype=np.int64)
    active = ' Scalars="rust" Normals="Normals"' + (
        ' TCoords="TCoords"' if "TCoords" in grid.point_data else ""
    )
    lines = [
        '<?xml version="1.0"?>',
        '<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64">',
        "<UnstructuredGrid>",
        f'<Piece NumberOfPoints="{count}" NumberOfCells="{cells}">',
        *section("Points", {"Points": grid.vertices.astype(np.float64)}),
        *section(
            "Cells",
            {
                "connectivity": grid.faces.astype(np.int64).ravel(),
                "offsets": ends,
                "types": np.full(cells, _TRIANGLE, np.uint8),
            },
        ),
        *section("PointData", grid.point_data, active),
        *section("CellData", grid.cell_data),
        "</Piece>",
        "</UnstructuredGrid>",
        '<AppendedData encoding="raw">',
        "_",
    ]
    with path.open("wb") as stream:
        stream.write("\n".join(lines).encode())
        stream.writelines(blocks)
        stream.write(b"\n</AppendedData>\n</VTKFile>\n")


def _stored(values: NDArray[Any]) -> str:
    """The type that an array is stored in: single precision, but for positions; whole numbers as they are."""
    if values.dtype.kind == "f":
        return "<f8" if values.ndim == 2 and values.shape[1] == 3 else "<f4"
    return {1: "|u1", 8: "<i8"}.get(values.dtype.itemsize, "<i4")
