"""Reading of generated files: every format, every way to be broken."""

from __future__ import annotations

import base64
import io
import json
import os
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest

from weathercoat.errors import (
    AccessError,
    CorruptError,
    EmptyFileError,
    FormatError,
    LimitError,
    MissingFileError,
    NoFacesError,
    PrecisionError,
    ScaleError,
    SecurityError,
    UnsupportedError,
    UsageError,
    WeathercoatError,
)
from weathercoat.mesh.read import read_stream, read_surface
from weathercoat.mesh.surface import Surface

CUBE_VERTICES = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
CUBE_QUADS = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
CUBE_TRIANGLES = np.concatenate([CUBE_QUADS[:, [0, 1, 2]], CUBE_QUADS[:, [0, 2, 3]]])


def cube_obj(*, scale: float = 1.0, offset: float = 0.0) -> str:
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in (CUBE_VERTICES * scale + offset).tolist()]
    return "\n".join([*lines, *("f " + " ".join(str(i + 1) for i in q) for q in CUBE_QUADS)]) + "\n"


def cube_off() -> str:
    lines = ["OFF", "8 6 0", *(f"{x} {y} {z}" for x, y, z in CUBE_VERTICES)]
    return "\n".join([*lines, *("4 " + " ".join(map(str, q)) for q in CUBE_QUADS)]) + "\n"


def cube_ply(order: str) -> bytes:
    header = (
        f"ply\nformat {order} 1.0\ncomment made here\nelement vertex 8\nproperty double x\n"
        "property double y\nproperty double z\nproperty uchar red\nproperty uchar green\n"
        "property uchar blue\n"
        "element face 6\nproperty uchar flag\nproperty list uchar int vertex_indices\nend_header\n"
    ).encode()
    if order == "ascii":
        rows = [f"{x} {y} {z} 255 0 51" for x, y, z in CUBE_VERTICES]
        rows += ["7 4 " + " ".join(map(str, q)) for q in CUBE_QUADS]
        return header + "\n".join(rows).encode() + b"\n"
    mark = "<" if order == "binary_little_endian" else ">"
    body = b"".join(struct.pack(mark + "3d3B", *v, 255, 0, 51) for v in CUBE_VERTICES)
    return header + body + b"".join(struct.pack(mark + "BB4i", 7, 4, *q) for q in CUBE_QUADS)


def cube_stl(*, text: bool = False, header: bytes = b"made here") -> bytes:
    corners = CUBE_VERTICES[CUBE_TRIANGLES]
    if not text:
        rows = b"".join(struct.pack("<12fH", 0, 0, 0, *c.ravel(), 0) for c in corners)
        return header.ljust(80, b"\0") + struct.pack("<I", len(corners)) + rows
    facets = []
    for c in corners:
        vertices = "".join(f"    vertex {x} {y} {z}\n" for x, y, z in c)
        facets.append(f"  facet normal 0 0 0\n   outer loop\n{vertices}   endloop\n  endfacet\n")
    return ("solid cube\n" + "".join(facets) + "endsolid cube\n").encode()


def cube_gltf(**more: object) -> dict[str, object]:
    """A glTF with one cube, whose buffer is embedded; `more` replaces top-level entries."""
    positions = CUBE_VERTICES.astype("<f4").tobytes()
    indices = CUBE_TRIANGLES.astype("<u2").tobytes()
    data = base64.b64encode(positions + indices).decode()
    document: dict[str, object] = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"name": "box", "primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 96},
            {"buffer": 0, "byteOffset": 96, "byteLength": 72},
        ],
        "buffers": [{"byteLength": 168, "uri": "data:application/octet-stream;base64," + data}],
    }
    return document | more


def read_bytes(data: bytes | str, format: str | None = None, **more: object) -> Surface:
    data = data.encode() if isinstance(data, str) else data
    return read_stream(io.BytesIO(data), format=format, **more)  # type: ignore[arg-type]


def read_json(document: dict[str, object]) -> Surface:
    return read_bytes(json.dumps(document))


def notes_of(surface: Surface) -> dict[str, int]:
    return {note.code: note.count for note in surface.notes}


def assert_is_cube(surface: Surface) -> None:
    assert len(surface.vertices) == 8
    assert len(surface.faces) == 12
    assert surface.area() == pytest.approx(6.0)
    corner = surface.vertices[surface.faces]
    volume = np.einsum("ij,ij->i", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])).sum() / 6
    assert volume == pytest.approx(1.0)


@pytest.mark.parametrize(
    "data",
    [
        cube_obj().encode(),
        cube_off().encode(),
        cube_ply("ascii"),
        cube_ply("binary_little_endian"),
        cube_ply("binary_big_endian"),
        cube_stl(),
        cube_stl(header=b"solid but binary facet"),
        cube_stl(text=True),
        json.dumps(cube_gltf()).encode(),
    ],
)
def test_content_alone_tells_the_format(data: bytes) -> None:
    assert_is_cube(read_bytes(data))


@pytest.mark.parametrize(
    "change",
    [
        lambda text: b"\xef\xbb\xbf" + text.encode(),
        lambda text: text.encode("utf-16"),
        lambda text: text.replace("\n", "\r\n").encode(),
        lambda text: text.replace("\n", "\r").encode(),
        lambda text: text.replace(" ", " \t ").encode(),
        lambda text: text.replace(" 1.0 ", " \\\n 1.0 ").encode(),
        lambda text: text.rstrip().encode(),
        lambda text: text.replace("\n", "  # Größe\n").encode("latin-1"),
    ],
    ids=["bom", "utf-16", "crlf", "cr", "tabs", "continuation", "no last newline", "latin-1 comments"],
)
def test_obj_text_variants_give_the_same_cube(change) -> None:  # type: ignore[no-untyped-def]
    surface = read_bytes(change(cube_obj()))
    assert np.array_equal(surface.vertices, read_bytes(cube_obj()).vertices)
    assert_is_cube(surface)


@pytest.mark.parametrize("encoding", ["utf-8", "cp932", "latin-1"])
def test_names_of_groups_in_their_encoding(encoding: str) -> None:
    name = "größe" if encoding == "latin-1" else "表"
    surface = read_bytes(f"o {name}\n".encode(encoding) + cube_obj().encode())
    assert surface.groups == (name,)
    assert_is_cube(surface)


def test_obj_groups_are_materials_where_named_else_groups() -> None:
    head = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\n"
    faces = "g left\nusemtl red\nf 1 2 3\ng right\nusemtl blue\nf 2 4 3\n"
    assert read_bytes(head + faces).groups == ("red", "blue")
    without = "\n".join(line for line in faces.split("\n") if "usemtl" not in line)
    surface = read_bytes(head + without)
    assert surface.groups == ("left", "right")
    assert surface.face_group.tolist() == [0, 1]


def test_uv_stays_with_its_corner_across_a_seam() -> None:
    text = (
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 0.5 0\nvt 0.5 1\nvt 0.7 0\nvt 1 0\nvt 1 1\n"
        "f 1/1 2/2 3/3\nf 1/4 3/5 4/6\n"
    )
    surface = read_bytes(text)
    assert len(surface.vertices) == 4
    assert surface.uv is not None
    assert surface.uv.tolist() == [[[0, 0], [0.5, 0], [0.5, 1]], [[0.7, 0], [1, 0], [1, 1]]]


def test_uv_follows_a_face_that_is_turned() -> None:
    text = cube_obj() + "".join(f"vt 0.{i} 0.5\n" for i in range(1, 9))
    lines = text.split("\n")
    faces = [i for i, line in enumerate(lines) if line.startswith("f ")]
    for i in faces:
        lines[i] = "f " + " ".join(f"{n}/{n}" for n in lines[i].split()[1:])
    turned = lines.copy()
    turned[faces[0]] = "f " + " ".join(reversed(lines[faces[0]].split()[1:]))
    surface = read_bytes("\n".join(turned))
    assert notes_of(surface)["W-FLIPPED"] == 2
    assert surface.uv is not None
    assert np.allclose(surface.uv[..., 0], 0.1 * (surface.faces + 1))


@pytest.mark.parametrize("order", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_ply_colours(order: str) -> None:
    surface = read_bytes(cube_ply(order))
    assert surface.colors is not None
    assert np.allclose(surface.colors, [1.0, 0.0, 0.2, 1.0])


def test_ply_triangle_strip() -> None:
    text = (
        "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n"
        "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
        "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n1 2 0\n8 0 1 2 3 -1 2 3 4\n"
    )
    surface = read_bytes(text)
    assert len(surface.faces) == 3
    assert surface.area() == pytest.approx(1.5)
    normals = np.cross(
        *(surface.vertices[surface.faces[:, i]] - surface.vertices[surface.faces[:, 0]] for i in (1, 2))
    )
    assert (normals[:, 2] > 0).all()


def test_off_with_colours_and_comments() -> None:
    text = (
        "COFF # colours\n\n3 1 0\n0 0 0 255 0 0 255 # red\n1 0 0 0 255 0 255\n0 1 0 0 0 255 255\n"
        "3 0 1 2 0.5 0.5 0.5\n"
    )
    surface = read_bytes(text)
    assert surface.colors is not None
    assert surface.colors.tolist() == [[1, 0, 0, 1], [0, 1, 0, 1], [0, 0, 1, 1]]


@pytest.mark.parametrize("header", ["OFF BINARY\n", "4OFF\n", "nOFF\n"])
def test_other_kinds_of_off_are_refused_by_name(header: str) -> None:
    with pytest.raises(UnsupportedError, match="OFF"):
        read_bytes(header + "3 1 0\n", "off")


@pytest.mark.parametrize(
    ("format", "direction"),
    [("obj", (0, 1, 0)), ("off", (0, 0, 1))],
)
def test_up_follows_the_format(format: str, direction: tuple[float, ...]) -> None:
    assert read_bytes(cube_obj() if format == "obj" else cube_off()).up == direction


def test_up_can_be_given() -> None:
    assert read_bytes(cube_obj(), up="-x").up == (-1.0, 0.0, 0.0)
    assert read_bytes(cube_obj(), up=(0.0, 3.0, 4.0)).up == (0.0, 0.6, 0.8)
    for wrong in ("w", (0.0, 0.0, 0.0)):
        with pytest.raises(UsageError):
            read_bytes(cube_obj(), up=wrong)


@pytest.mark.parametrize("scale", [1e-9, 1e-3, 1.0, 1e9])
def test_scale_changes_no_topology(scale: float) -> None:
    surface = read_bytes(cube_obj(scale=scale))
    assert np.array_equal(surface.faces, read_bytes(cube_obj()).faces)
    assert surface.area() == pytest.approx(6 * scale**2)


def test_far_offsets() -> None:
    surface = read_bytes(cube_obj(offset=1e7))
    assert np.array_equal(surface.faces, read_bytes(cube_obj()).faces)
    with pytest.raises(PrecisionError):
        read_bytes(cube_obj(offset=1e15))
    far = cube_stl()[:84] + b"".join(
        struct.pack("<12fH", 0, 0, 0, *(c + 1e7).ravel(), 0) for c in CUBE_VERTICES[CUBE_TRIANGLES]
    )
    with pytest.raises(PrecisionError):
        read_bytes(far)


@pytest.mark.parametrize("scale", [1e-30, 1e30, 1e200])
def test_extreme_scales_are_refused(scale: float) -> None:
    with pytest.raises(ScaleError):
        read_bytes(cube_obj(scale=scale))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("v 0 0 0\nv 1 0\nf 1 2 1\n", "line 2"),
        ("v 0 0 0\nv 1 0 x\nv 0 1 0\nf 1 2 3\n", "line 2: 'x' is no number"),
        ("v 0 0 0\nv 1 0 0\nv 0 1-2 0\nf 1 2 3\n", "line 3"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 x\n", "line 4"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "face 0 (counted from 0), line 4: index 4, but there are 3"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -1 -2 -4\n", "relative index"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/2 3/1\n", "1 texture coordinates"),
        ("v 0 0 0\nv 1 0 0\nw 0 1 0\nf 1 2 1\n", "line 3: 'w' is no keyword"),
    ],
)
def test_broken_obj_names_the_line(text: str, says: str) -> None:
    with pytest.raises(CorruptError) as caught:
        read_bytes(text, "obj")
    assert says in caught.value.line()


def test_index_zero_drops_the_face() -> None:
    surface = read_bytes(cube_obj() + "f 0 1 2\n")
    assert notes_of(surface)["W-BADINDEX"] == 1
    assert_is_cube(surface)


def test_every_truncation_is_refused() -> None:
    for data in (cube_ply("binary_little_endian"), cube_ply("ascii"), cube_stl(), cube_off().encode()):
        for length in range(100, len(data) - 4, 37):
            with pytest.raises((CorruptError, FormatError)):
                read_bytes(data[:length])


def test_appended_bytes_are_refused() -> None:
    for data in (cube_ply("binary_little_endian"), cube_stl(), cube_off().encode(), cube_ply("ascii")):
        with pytest.raises((CorruptError, FormatError)):
            read_bytes(data + b"1 2 3\n")


@pytest.mark.parametrize("count", [10**12, 2**63, 10**30])
def test_huge_counts_are_refused_at_once(count: int) -> None:
    for data in (cube_ply("ascii"), cube_ply("binary_big_endian")):
        for element in (b"element vertex 8", b"element face 6"):
            with pytest.raises(CorruptError, match="the header says"):
                read_bytes(data.replace(element, element.rsplit(b" ", 1)[0] + b" %d" % count))
    with pytest.raises(CorruptError):
        read_bytes(cube_off().replace("8 6 0", f"{count} 6 0"))


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"<!DOCTYPE html><html></html>", "HTML"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n", "git-LFS"),
        (b"\x1f\x8b\x08\0\0\0\0", "gzip"),
        (b"\x89PNG\r\n\x1a\n", "picture"),
        (bytes(range(256)) * 8, "binary"),
        (b"hello, this is a letter\n", "text"),
        ("v 0 0 0\n".encode("utf-16-be"), "UTF-16"),
    ],
)
def test_strangers_are_named(data: bytes, says: str) -> None:
    with pytest.raises(FormatError, match=says):
        read_bytes(data)


def test_random_bytes_with_any_extension(tmp_path: Path) -> None:
    data = np.random.default_rng(3).integers(0, 256, 20000, dtype=np.uint8).tobytes()
    for extension in ("obj", "ply", "stl", "off", "glb", "gltf", "xyzzy"):
        path = tmp_path / f"noise.{extension}"
        path.write_bytes(data)
        with pytest.raises(FormatError) as caught:
            read_surface(path)
        assert caught.value.file == str(path)


def test_wrong_extension_is_noted_and_no_extension_is_not(tmp_path: Path) -> None:
    (tmp_path / "cube.stl").write_text(cube_obj())
    (tmp_path / "cube").write_text(cube_obj())
    assert notes_of(read_surface(tmp_path / "cube.stl"))["W-FORMAT"] == 1
    assert "W-FORMAT" not in notes_of(read_surface(tmp_path / "cube"))


def test_what_is_no_regular_file_is_refused_at_once(tmp_path: Path) -> None:
    (tmp_path / "folder.obj").mkdir()
    (tmp_path / "loop.obj").symlink_to(tmp_path / "loop.obj")
    os.mkfifo(tmp_path / "pipe.obj")
    for name in ("folder.obj", "loop.obj", "pipe.obj", "missing.obj", "nul\0.obj", "x" * 5000):
        with pytest.raises(AccessError):
            read_surface(tmp_path / name)


def test_empty_input() -> None:
    with pytest.raises(EmptyFileError):
        read_bytes(b"")


def test_limit_of_faces() -> None:
    with pytest.raises(LimitError, match="12 triangles, the limit is 11"):
        read_bytes(cube_obj(), max_faces=11)


def test_missing_material_library_is_noted_and_none_outside_is_looked_for(tmp_path: Path) -> None:
    (tmp_path / "there.mtl").write_text("newmtl a\n")
    (tmp_path / "inner").mkdir()
    for name, missing in (("there.mtl", 0), ("./there.mtl", 0), ("gone.mtl", 1), ("inner/../there.mtl", 1)):
        (tmp_path / "cube.obj").write_text(f"mtllib {name}\n" + cube_obj())
        assert notes_of(read_surface(tmp_path / "cube.obj")).get("W-MATERIAL", 0) == missing


def zipped(entries: dict[str, bytes]) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in entries.items():
            archive.writestr(name, data)
    return stream.getvalue()


def test_zip_with_one_model() -> None:
    surface = read_bytes(zipped({"readme.txt": b"hello", "part/cube.obj": cube_obj().encode()}))
    assert surface.name == "cube"
    assert_is_cube(surface)
    with pytest.raises(FormatError, match="2 models"):
        read_bytes(zipped({"a.obj": b"", "b.obj": b""}))
    with pytest.raises(LimitError):
        read_bytes(zipped({"a.obj": bytes(10_000_000)}))
    with pytest.raises(CorruptError):
        read_bytes(zipped({"a.obj": cube_obj().encode()})[:150])


def test_gltf_transforms_mirrors_and_instances() -> None:
    nodes = [
        {"children": [1, 2], "translation": [10, 0, 0]},
        {"mesh": 0, "scale": [-2, 1, 1]},
        {"mesh": 0, "rotation": [0, 0, 0.70710678, 0.70710678], "translation": [0, 5, 0]},
    ]
    surface = read_json(cube_gltf(nodes=nodes))
    assert notes_of(surface) == {"W-COMPONENTS": 2}
    assert surface.area() == pytest.approx(10 + 6)
    assert np.allclose(surface.vertices.min(axis=0), [8, 0, 0], atol=1e-6)
    assert np.allclose(surface.vertices.max(axis=0), [10, 6, 1], atol=1e-6)
    assert surface.groups == ("box",)


def test_gltf_coincident_instances_stay_apart() -> None:
    surface = read_json(cube_gltf(nodes=[{"mesh": 0}, {"mesh": 0}], scenes=[{"nodes": [0, 1]}]))
    assert notes_of(surface) == {"W-COMPONENTS": 2}
    assert len(surface.faces) == 24


def test_gltf_notes_what_is_lost() -> None:
    surface = read_json(cube_gltf(skins=[{"joints": [0]}], animations=[{}, {}]))
    assert notes_of(surface) == {"W-SKIN": 1, "W-ANIMATION": 2}


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"nodes": [{"mesh": 0, "children": [0]}]}, CorruptError),
        ({"nodes": [{"mesh": 3}]}, CorruptError),
        ({"nodes": [{"mesh": True}]}, CorruptError),
        ({"nodes": [{"mesh": 0, "matrix": [1, 2, 3]}]}, CorruptError),
        ({"nodes": 5}, CorruptError),
        ({"scenes": [{"nodes": []}]}, NoFacesError),
        ({"asset": {"version": "1.0"}}, UnsupportedError),
        ({"extensionsRequired": ["EXT_meshopt_compression"]}, UnsupportedError),
        ({"buffers": [{"byteLength": 168, "uri": "cube.bin"}]}, MissingFileError),
        ({"buffers": [{"byteLength": 168, "uri": "../cube.bin"}]}, SecurityError),
        ({"buffers": [{"byteLength": 168, "uri": "%2e%2e/cube.bin"}]}, SecurityError),
        ({"buffers": [{"byteLength": 168, "uri": "/etc/hostname"}]}, SecurityError),
        ({"buffers": [{"byteLength": 168, "uri": "file:///etc/hostname"}]}, SecurityError),
        ({"buffers": [{"byteLength": 168, "uri": "data:;base64,AAAA"}]}, CorruptError),
        ({"bufferViews": [{"buffer": 0, "byteLength": 95}, {"buffer": 0, "byteLength": 72}]}, CorruptError),
        ({"bufferViews": [{"buffer": 0, "byteLength": 96}, {"buffer": 0, "byteLength": 999}]}, CorruptError),
    ],
)
def test_broken_gltf_is_refused(change: dict[str, object], error: type[WeathercoatError]) -> None:
    with pytest.raises(error):
        read_json(cube_gltf(**change))


def test_gltf_buffer_beside_the_model_but_not_through_a_link(tmp_path: Path) -> None:
    folder = tmp_path / "model"
    folder.mkdir()
    document = cube_gltf()
    uri = document["buffers"][0]["uri"]  # type: ignore[index]
    (tmp_path / "outside.bin").write_bytes(base64.b64decode(uri.split(",")[1]))
    document["buffers"] = [{"byteLength": 168, "uri": "cube%20data.bin"}]
    (folder / "cube.gltf").write_text(json.dumps(document))
    with pytest.raises(MissingFileError):
        read_surface(folder / "cube.gltf")
    (folder / "cube data.bin").symlink_to(tmp_path / "outside.bin")
    with pytest.raises(SecurityError):
        read_surface(folder / "cube.gltf")
    (folder / "cube data.bin").unlink()
    (folder / "cube data.bin").write_bytes((tmp_path / "outside.bin").read_bytes())
    assert_is_cube(read_surface(folder / "cube.gltf"))


def test_what_meshio_adds(tmp_path: Path) -> None:
    import meshio

    path = tmp_path / "cube.vtk"
    meshio.Mesh(CUBE_VERTICES, [("quad", CUBE_QUADS)]).write(path)
    assert_is_cube(read_surface(path))
    path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(CorruptError, match="meshio"):
        read_surface(path)


def test_mutated_files_give_a_valid_surface_or_one_clear_line() -> None:
    """A bounded mutation test: bytes changed, cut out, doubled, numbers replaced."""
    seeds = [
        cube_obj().encode(),
        cube_off().encode(),
        cube_ply("ascii"),
        cube_ply("binary_little_endian"),
        cube_stl(),
        cube_stl(text=True),
        json.dumps(cube_gltf()).encode(),
    ]
    random = np.random.default_rng(20)
    read = 0
    for turn in range(700):
        data = bytearray(seeds[turn % len(seeds)])
        for _ in range(int(random.integers(1, 3))):
            at = int(random.integers(0, len(data)))
            match int(random.integers(0, 5)):
                case 0:
                    data[at] = int(random.integers(0, 256))
                case 1:
                    del data[at : at + int(random.integers(1, 30))]
                case 2:
                    data[at:at] = data[at : at + 40]
                case 3:
                    data[at : at + 1] = (b"-", b"999999", b"0", b"nan", b"1e308", b"\n")[
                        int(random.integers(0, 6))
                    ]
                case 4:
                    digits = [i for i, c in enumerate(data) if 48 <= c <= 57] or [at]
                    data[digits[int(random.integers(0, len(digits)))]] = int(random.integers(48, 58))
        try:
            surface = read_bytes(bytes(data))
        except WeathercoatError as error:
            assert "\n" not in error.line()
            assert error.exit_code in (3, 4, 5)
            continue
        read += 1
        assert np.array_equal(np.unique(surface.faces), np.arange(len(surface.vertices)))
        assert np.isfinite(surface.vertices).all()
        assert (surface.face_areas() > 0).all()
    assert read > 70
