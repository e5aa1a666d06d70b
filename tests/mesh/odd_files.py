"""Odd files with what must become of each, stated beforehand: what exporters write, what breaks readers."""

from __future__ import annotations

import base64
import gzip
import io
import json
import math
import struct
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.fuzz.seeds import pack_glb

CORNERS = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
TRIANGLES = [t for a, b, c, d in QUADS for t in ((a, b, c), (a, c, d))]


@dataclass(frozen=True)
class OddFile:
    """A file and its outcome.

    code: of the error, None where it comes in. faces, area: of what comes in, where they are certain.
    notes: the codes of all notes but W-POLYGONS, W-BOUNDARY and W-COMPONENTS. says: in the error's line.
    """

    name: str
    data: bytes
    code: str | None = None
    faces: int | None = 12
    area: float | None = 6.0
    notes: tuple[str, ...] = ()
    says: str = ""


def odd_files() -> list[OddFile]:
    """All of them; none is in the index beside the real meshes."""
    return [*_obj(), *_ply(), *_stl(), *_off(), *_gltf(), *_glb(), *_archives(), *_strangers(), *_names()]


def cube(*, scale: float = 1.0, offset: float = 0.0) -> str:
    """A cube of quads as OBJ."""
    lines = ["v " + " ".join(repr(scale * x + offset) for x in corner) for corner in CORNERS]
    return "\n".join([*lines, *("f " + " ".join(str(i + 1) for i in quad) for quad in QUADS)]) + "\n"


def ngon(points: list[tuple[float, float]]) -> str:
    """One polygon as OBJ."""
    lines = [f"v {x!r} {y!r} 0" for x, y in points]
    return "\n".join([*lines, "f " + " ".join(str(i + 1) for i in range(len(points)))]) + "\n"


def circle(count: int) -> list[tuple[float, float]]:
    """Points on the unit circle."""
    turns = [2 * math.pi * i / count for i in range(count)]
    return [(math.cos(t), math.sin(t)) for t in turns]


def comb(teeth: int) -> list[tuple[float, float]]:
    """A comb of unit teeth a unit apart, on a bar of height 1: of its corners, half are concave."""
    points = [(0.0, 0.0), (2.0 * teeth - 1, 0.0)]
    for i in reversed(range(teeth)):
        points += [(2.0 * i + 1, 2.0), (2.0 * i, 2.0)]
        if i:
            points += [(2.0 * i, 1.0), (2.0 * i - 1, 1.0)]
    return points


def _obj() -> Iterator[OddFile]:
    def odd(name: str, text: str | bytes, **more: Any) -> OddFile:
        return OddFile(f"obj_{name}.obj", text.encode() if isinstance(text, str) else text, **more)

    v, f = cube().split("f", 1)
    f = "f" + f
    square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
    own = "".join(
        "".join(f"v {CORNERS[i][0]} {CORNERS[i][1]} {CORNERS[i][2]}\n" for i in q) + "f -4 -3 -2 -1\n"
        for q in QUADS
    )
    yield odd("own_vertices_a_face", own, notes=("W-WELDED",))
    yield odd("faces_before_vertices", f + v)
    yield odd("material_with_spaces", cube().replace("f 1", "usemtl Dark Red (2)\nf 1", 1))
    for name, path in (
        ("up", "../../../../etc/passwd"),
        ("http", "http://127.0.0.1:9/a.mtl"),
        ("unc", "\\\\server\\share\\a.mtl"),
        ("root", "/etc/passwd"),
    ):
        yield odd(f"mtllib_{name}", f"mtllib {path}\n" + cube(), notes=("W-MATERIAL",))
    yield odd("call", "call other.obj 1\n" + cube(), code="E-UNSUPPORTED", says="line 1")
    yield odd("csh", cube() + "csh rm -rf .\n", code="E-SECURITY", says="command")
    curve = "cstype bezier\ndeg 3\nvp 0.1 0.2\ncurv 0.0 1.0 1 2 3 4\nparm u 0.0 1.0\nend\n"
    yield odd("curves_beside_faces", cube() + curve)
    yield odd("curves_only", v + curve, code="E-NOFACES")
    yield odd("lines_and_points_too", cube() + "l 1 2 3\np 1 2\n")
    yield odd("line_beyond", cube() + "l 1 99\n", code="E-CORRUPT", says="99")
    yield odd("repeated_corner", square + "f 1 2 2 3 4\n", faces=2, area=1.0, notes=("W-DEGENERATE",))
    yield odd("bowtie", square + "f 1 3 2 4\n", faces=2, area=None)
    yield odd("ngon_20000", ngon(circle(20_000)), faces=19_998, area=math.pi)
    yield odd("ngon_comb", ngon(comb(500)), faces=None, area=1499.0)
    yield odd("slashes_without_more", square + "f 1/ 2/ 3/\nf 1// 3// 4//\n", faces=2, area=1.0)
    yield odd("slashes_now_and_then", square + "vt 0 0\nf 1/1 2 3\n", code="E-CORRUPT", says="line 6")
    yield odd("index_of_20_digits", square + "f 1 2 99999999999999999999\n", code="E-CORRUPT")
    yield odd("index_of_0_for_uv", cube() + "vt 0 0\nf 1/0 2/1 4/1\n", notes=("W-BADINDEX", "W-DUPLICATE"))
    yield odd("normal_missing", cube() + "vn 0 0 1\nf 1//1 1//2 1//1\n", notes=("W-BADINDEX", "W-DEGENERATE"))
    yield odd("normals_all_stripped", cube().replace("f 1 2 4 3", "f 1//1 2//2 4//3 3//4"))
    yield odd("overflow", cube() + "v 1e400 0 0\nf 1 2 9\n", notes=("W-NONFINITE",))
    yield odd("ends_of_lines_mixed", cube().replace("\n", "\r\n", 3).replace("\nf", "\rf", 2))
    yield odd("bom_in_the_middle", cube() + "\ufeff" + cube(), code="E-CORRUPT", says="line 15")
    yield odd("indented", "\n".join("\t  " + line.replace(" ", "\t") for line in cube().split("\n")))
    yield odd("form_feeds", cube().replace(" ", "\f ").replace("v", "\vv"))
    yield odd("utf16be", "\ufeff".encode("utf-16-be") + cube().encode("utf-16-be"))
    yield odd("utf16_cut", cube().encode("utf-16")[:-1], code="E-CORRUPT", says="UTF-16")
    yield odd("utf32", cube().encode("utf-32"), code="E-FORMAT")
    yield odd("zero_bytes", cube().replace("v ", "\0v "), code="E-FORMAT")
    yield odd("latin1_names", "o Größe\nusemtl Weiß\n".encode("latin-1") + cube().encode())
    yield odd("emoji_names", "g 🪲 rost\n" + cube())
    yield odd("scale_1e-12", cube(scale=1e-12), area=6e-24)
    yield odd("scale_1e12", cube(scale=1e12), area=6e24)
    yield odd("offset_1e6", cube(offset=1e6))
    yield odd("offset_1e16", cube(offset=1e16), code="E-PRECISION")
    yield odd("weights", cube().replace("v 0 0 0\n", "v 0 0 0 2.0\n"))
    yield odd("uv_of_three", cube().replace("f 1 2 4 3", "vt 0 0 0\nf 1/1 2/1 4/1 3/1"))
    yield odd("uv_nan", cube().replace("f 1 2 4 3", "vt nan -nan\nf 1/1 2/1 4/1 3/1"), notes=("W-NONFINITE",))
    yield odd("uv_of_msvc", cube() + "vt -nan(ind) 0\n", code="E-CORRUPT", says="-nan(ind)")
    yield odd("commas", square + "f 1,2,3\n", code="E-CORRUPT", says="line 5")
    yield odd("semicolons", square.replace("1 1 0", "1;1;0") + "f 1 2 3\n", code="E-CORRUPT", says="line 3")
    yield odd("upper_case_keyword", cube().replace("v 1", "V 1", 1), code="E-CORRUPT", says="'V'")
    yield odd("comment_behind", cube().replace("\n", " # made by hand\n"))
    yield odd("only_one_corner", square + "f 1\nf 2\n", code="E-NOAREA")
    yield odd("comment_of_5_MB", "#" + 5_000_000 * "x" + "\n" + cube())
    yield odd("line_of_a_million_blanks", cube().replace("v 1", "v" + 1_000_000 * " " + "1", 1))
    yield odd("uv_first", "vt 0 0\n" * 20_000 + cube())
    yield odd("licence_first", "# all rights\n" * 20_000 + cube())
    yield odd("many_groups", _many_groups(20_000), faces=20_000, area=1e4, notes=("W-SOUP",))
    yield odd("twice_the_same", cube() + f, notes=("W-DUPLICATE",))
    yield odd(
        "numbers_in_all_ways", square.replace("1 1 0", "+.1E+01 1. -0e0") + "f 1 2 3 4\n", faces=2, area=1.0
    )
    yield odd(
        "hex_numbers", square.replace("1 1 0", "0x1 1 0") + "f 1 2 3 4\n", code="E-CORRUPT", says="line 3"
    )
    yield odd("cut_in_a_vertex", "v 0 0 0\nv 1 0", code="E-CORRUPT", says="line 2")
    yield odd("material_library", "newmtl red\nKd 1 0 0\n", code="E-FORMAT")


def _many_groups(count: int) -> str:
    lines = []
    for i in range(count):
        x = float(2 * i)
        lines.append(f"g part{i}\nv {x} 0 0\nv {x + 1} 0 0\nv {x} 1 0\nf -3 -2 -1")
    return "\n".join(lines)


_PLY_VERTEX = "property float x\nproperty float y\nproperty float z\n"
_PLY_FACE = "property list uchar int vertex_indices\n"
_PLY_ROWS = "".join(f"{x} {y} {z}\n" for x, y, z in CORNERS)
_PLY_FACES = "".join("4 " + " ".join(map(str, q)) + "\n" for q in QUADS)


def _ply_text(
    vertex: str = _PLY_VERTEX,
    face: str = _PLY_FACE,
    body: str = _PLY_ROWS + _PLY_FACES,
    before: str = "",
    vertices: object = 8,
    faces: object = 6,
    order: str = "ascii 1.0",
) -> str:
    return (
        f"ply\nformat {order}\n{before}element vertex {vertices}\n{vertex}element face {faces}\n{face}"
        f"end_header\n{body}"
    )


def _ply_bytes(mark: str, vertex: str = "3f", face: str = "B4i", header: str = "") -> bytes:
    order = "binary_little_endian 1.0" if mark == "<" else "binary_big_endian 1.0"
    body = b"".join(struct.pack(mark + vertex, *corner) for corner in CORNERS)
    body += b"".join(struct.pack(mark + face, 4, *quad) for quad in QUADS)
    return (header or _ply_text(body="", order=order)).encode() + body


def _ply() -> Iterator[OddFile]:
    def odd(name: str, data: str | bytes, **more: Any) -> OddFile:
        return OddFile(f"ply_{name}.ply", data.encode() if isinstance(data, str) else data, **more)

    text, little = _ply_text(), _ply_bytes("<")
    camera = "element camera 2\nproperty float view\nproperty list uchar float lens\n"
    yield odd("camera_first", _ply_text(before=camera, body="1.5 2 0.1 0.2\n0 0\n" + _PLY_ROWS + _PLY_FACES))
    wide = "property list ushort double weights\nproperty double x\nproperty short y\nproperty uchar z\n"
    yield odd(
        "list_in_vertex",
        _ply_text(vertex=wide, body=_PLY_ROWS.replace("\n", "\n2 .5 .5 ", 7).join(["2 .5 .5 ", _PLY_FACES])),
    )
    yield odd("comment_with_end_header", text.replace("element face", "comment end_header\nelement face"))
    yield odd(
        "obj_info_and_blank_lines", text.replace("element face", "obj_info num_cols 512\n\nelement face")
    )
    yield odd("cr_only", text.replace("\n", "\r"))
    yield odd(
        "crlf_header_binary",
        _ply_text(body="", order="binary_little_endian 1.0").replace("\n", "\r\n").encode()
        + little[little.index(b"end_header\n") + 11 :],
    )
    old = _ply_text(
        vertex="property int x\nproperty int y\nproperty int z\n", body="", order="binary_big_endian 1.0"
    ).replace("\n", "\r")
    rows = b"".join(struct.pack(">3i", x + 0x0A000000, y, z) for x, y, z in CORNERS)
    faces = b"".join(struct.pack(">B4i", 4, *quad) for quad in QUADS)
    yield odd("cr_header_then_line_feed_byte", old.encode() + rows + faces)
    turned = (
        f"ply\nformat ascii 1.0\nelement face 6\n{_PLY_FACE}element vertex 8\n{_PLY_VERTEX}end_header\n"
        f"{_PLY_FACES}{_PLY_ROWS}"
    )
    yield odd("faces_first", turned)
    yield odd(
        "format_after_an_element",
        "ply\nelement vertex 0\nproperty float x\nformat ascii 1.0\nelement face 0\nend_header\n",
        code="E-CORRUPT",
        says="line 4",
    )
    for code, type in (("b", "char"), ("H", "ushort"), ("I", "uint32")):
        for mark, order in (("<", "little"), (">", "big")):
            header = _ply_text(
                face=f"property list int {type} vertex_index\n", body="", order=f"binary_{order}_endian 1.0"
            )
            yield odd(f"indices_{type}_{order}", _ply_bytes(mark, "3f", f"i4{code}", header))
    strips = "property list int int vertex_indices\n"
    yield odd(
        "strips_binary",
        _ply_text(face=strips, body="", faces=1, order="binary_little_endian 1.0")
        .replace("element face", "element tristrips")
        .encode()
        + b"".join(struct.pack("<3f", *c) for c in CORNERS)
        + struct.pack("<10i", 9, 0, 1, 2, 3, -1, 4, 6, 5, 7),
        faces=4,
        area=2.0,
    )
    for element in ("vertex 8", "face 6"):
        lie = element.split()[0] + " 1000000000000000"
        yield odd(
            f"lies_about_{element[:4]}", text.replace(element, lie), code="E-CORRUPT", says="10000000000"
        )
        yield odd(
            f"lies_about_{element[:4]}_binary",
            little.replace(element.encode(), lie.encode()),
            code="E-CORRUPT",
            says="10000000000",
        )
    header = _ply_text(
        face="property list uint int vertex_indices\n", body="", order="binary_little_endian 1.0"
    )
    yield odd(
        "list_of_4_billion",
        _ply_bytes("<", "3f", "I4i", header)[:-20] + struct.pack("<I4i", 2**32 - 1, 0, 1, 2, 3),
        code="E-CORRUPT",
        says="holds 5",
    )
    yield odd("count_of_float", text.replace("list uchar", "list float"), code="E-CORRUPT", says="line 8")
    yield odd("count_negative", text.replace("face 6", "face -6"), code="E-CORRUPT", says="line 7")
    yield odd("type_int64", text.replace("float x", "int64 x"), code="E-CORRUPT", says="line 4")
    yield odd("version_2", text.replace("ascii 1.0", "ascii 2.0"), code="E-CORRUPT", says="line 2")
    yield odd("no_z", text.replace("float z", "float w"), code="E-CORRUPT", says="number z")
    yield odd("x_twice", text.replace("float y", "float x"), code="E-CORRUPT", says="'x' twice")
    yield odd(
        "x_is_a_list",
        _ply_text(
            vertex=_PLY_VERTEX.replace("float x", "list uchar float x"),
            body=_PLY_ROWS.replace("\n", "\n1 ", 7).join(["1 ", _PLY_FACES]),
        ),
        code="E-CORRUPT",
        says="number x",
    )
    yield odd(
        "index_is_a_number",
        _ply_text(face="property int vertex_indices\n", body=_PLY_ROWS + "0\n" * 6),
        code="E-CORRUPT",
        says="list of whole numbers",
    )
    yield odd("points_only", _ply_text(faces=0, body=_PLY_ROWS), code="E-NOFACES")
    yield odd("no_vertices", _ply_text(vertices=0, body=_PLY_FACES), code="E-CORRUPT", says="0 vertices")
    far = b"".join(struct.pack("<3f", *(x + 1e7 for x in corner)) for corner in CORNERS)
    at = little.index(b"end_header\n") + 11
    yield odd("far_in_float32", little[:at] + far + little[at + 96 :], code="E-PRECISION")
    normals = _PLY_VERTEX + "property float nx\nproperty float ny\nproperty float nz\n"
    rows_with_normals = _PLY_ROWS.replace("\n", " nan nan nan\n")
    yield odd("normals_nan", _ply_text(vertex=normals, body=rows_with_normals + _PLY_FACES))
    uv = _PLY_VERTEX + "property float s\nproperty float t\n"
    yield odd(
        "uv_nan",
        _ply_text(vertex=uv, body=_PLY_ROWS.replace("\n", " nan 0\n") + _PLY_FACES),
        notes=("W-NONFINITE",),
    )
    yield odd("two_rows_a_line", text.replace("0 0 0\n", "0 0 0 ", 1), code="E-CORRUPT", says="line 10")
    yield odd("row_over_two_lines", text.replace("0 0 1\n", "0 0\n1\n", 1), code="E-CORRUPT", says="line 11")
    yield odd("faces_on_a_line", text.replace("\n4 ", " 4 "), code="E-CORRUPT", says="line 17")
    yield odd("last_rows_joined", text.replace("\n4 1", " 4 1"), code="E-CORRUPT", says="holds 5 lines")
    yield odd("blank_lines", text.replace("\n4 ", "\n\n4 "))
    yield odd("row_swallowed", text.replace("4 0 1 3 2\n4", "5 0 1 3 2\n3"), code="E-CORRUPT")
    yield odd("faces_of_none", text.replace("face 6", "face 7") + "0\n", notes=("W-DEGENERATE",))
    yield odd("line_end_behind_binary", little + b"\n")
    yield odd("bytes_behind_binary", little + b"\n\n\n", code="E-CORRUPT", says="3 bytes follow")
    yield odd("byte_lost", little[:200] + little[201:], code="E-CORRUPT")
    yield odd(
        "index_beyond_unsigned",
        text.replace("list uchar int", "list uchar uint").replace("4 0 1 3 2", "4 0 1 3 4294967295"),
        code="E-CORRUPT",
        says="4294967295",
    )
    yield odd("count_of_300_in_a_byte", text.replace("4 0 1", "300 0 1", 1), code="E-CORRUPT")
    yield odd("header_without_end", text.partition("end_header")[0], code="E-CORRUPT", says="no end")
    yield odd("named_fp64", text.replace("float x", "float64 x").replace("uchar int", "uint8 int32"))
    yield odd("gzipped", gzip.compress(text.encode()), code="E-FORMAT", says="gzip")
    yield odd(
        "uneven_colours",
        _ply_text(
            vertex=_PLY_VERTEX + "property float red\nproperty uchar green\nproperty ushort blue\n",
            body=_PLY_ROWS.replace("\n", " inf 255 65535\n") + _PLY_FACES,
        ),
        notes=("W-NONFINITE",),
    )


def _stl_text(*, name: str = "cube", normal: str = "0 0 0") -> str:
    facets = [
        f"facet normal {normal}\n outer loop\n"
        + "".join("  vertex {} {} {}\n".format(*CORNERS[i]) for i in t)
        + " endloop\nendfacet\n"
        for t in TRIANGLES
    ]
    return f"solid {name}\n" + "".join(facets) + f"endsolid {name}\n"


def _stl_bytes(header: bytes = b"", attribute: int = 0, corners: Any = CORNERS) -> bytes:
    rows = b"".join(
        struct.pack("<12fH", 0, 0, 0, *(x for i in t for x in corners[i]), attribute) for t in TRIANGLES
    )
    return header.ljust(80, b" ") + struct.pack("<I", len(TRIANGLES)) + rows


def _stl() -> Iterator[OddFile]:
    def odd(name: str, data: str | bytes, **more: Any) -> OddFile:
        return OddFile(f"stl_{name}.stl", data.encode() if isinstance(data, str) else data, **more)

    text, binary = _stl_text(), _stl_bytes()
    yield odd("solid_and_facet_in_binary", _stl_bytes(b"solid facet normal 0 0 1\nouter loop"))
    yield odd("magics_colour", _stl_bytes(b"COLOR=\xff\x80\x00\xff,MATERIAL=", 0x7FFF))
    yield odd("upper_case", text.upper())
    yield odd(
        "several_solids",
        text.replace("facet", "endsolid a\nsolid b\nfacet", 1).replace("solid cube", "solid a", 1),
    )
    yield odd("without_names", text.replace(" cube", ""))
    yield odd("name_is_number_sign", _stl_text(name="#7 endsolid"))
    yield odd("normals_of_msvc", _stl_text(normal="-nan(ind) 1.#QNAN -1.#IND00"))
    yield odd("normal_of_words", _stl_text(normal="up up up"), code="E-CORRUPT", says="line 2")
    yield odd("normal_too_short", _stl_text(normal="0 1"), code="E-CORRUPT", says="line 2")
    yield odd("no_endsolid", text.replace("endsolid cube\n", ""), code="E-CORRUPT", says="within a solid")
    yield odd("facet_outside", text + text.split("\n", 1)[1].rsplit("endsolid", 1)[0], code="E-CORRUPT")
    yield odd("solid_in_a_facet", text.replace(" endloop", " solid\nendsolid\n endloop", 1), code="E-CORRUPT")
    yield odd(
        "loop_of_four",
        text.replace(" endloop", "  vertex 0 0 0\n endloop", 1),
        code="E-CORRUPT",
        says="line 7",
    )
    yield odd("commas", text.replace("vertex 0 0 0", "vertex 0,5 0 0"), code="E-CORRUPT", says="0,5")
    yield odd("no_facets", "solid a\nendsolid a\n", code="E-NOFACES")
    yield odd("binary_of_none", binary[:80] + bytes(4), code="E-NOFACES")
    yield odd("byte_more", binary + b"\0", code="E-CORRUPT", says="says 12")
    yield odd("count_big_endian", binary[:80] + struct.pack(">I", 12) + binary[84:], code="E-CORRUPT")
    yield odd(
        "count_less", binary[:80] + struct.pack("<I", 11) + binary[84:], code="E-CORRUPT", says="holds 12"
    )
    yield odd(
        "one_nan",
        _stl_bytes(corners=[(math.nan, 0, 0), *CORNERS[1:]]),
        faces=None,
        area=None,
        notes=("W-NONFINITE",),
    )
    yield odd("flat", _stl_bytes(corners=[(x, 0, 0) for x, _, _ in CORNERS]), code="E-NOAREA")
    yield odd("crlf", text.replace("\n", "\r\n"))
    yield odd("tiny", _stl_bytes(corners=[tuple(1e-6 * x for x in c) for c in CORNERS]), area=6e-12)


def _off() -> Iterator[OddFile]:
    def odd(name: str, text: str, **more: Any) -> OddFile:
        return OddFile(f"off_{name}.off", text.encode(), **more)

    rows, faces = _PLY_ROWS, _PLY_FACES
    plain = "OFF\n8 6 12\n" + rows + faces
    yield odd("counts_behind", "OFF 8 6 12\n" + rows + faces)
    yield odd("without_edges", "OFF\n8 6\n" + rows + faces)
    yield odd("crlf_and_comments", ("# first\n" + plain.replace("\n4", " # v\n\n4")).replace("\n", "\r\n"))
    yield odd("colours", "COFF\n8 6 12\n" + rows.replace("\n", " 255 128 0 255\n") + faces)
    yield odd("normals", "NOFF\n8 6 12\n" + rows.replace("\n", " 0 0 1\n") + faces)
    yield odd("textures", "STOFF\n8 6 12\n" + rows.replace("\n", " 0.5 0.5\n") + faces)
    yield odd(
        "texture_nan", "STOFF\n8 6 12\n" + rows.replace("\n", " nan 0.5\n") + faces, notes=("W-NONFINITE",)
    )
    yield odd("colours_of_faces", "OFF\n8 6 12\n" + rows + faces.replace("\n", " 0.5 0.5 0.5 1\n"))
    yield odd(
        "colours_now_and_then", plain.replace("1 0 0\n", "1 0 0 9 9 9\n", 1), code="E-CORRUPT", says="line 7"
    )
    yield odd("binary", "OFF BINARY\n8 6 12\n", code="E-UNSUPPORTED", says="binary OFF")
    yield odd("four_dimensions", "4OFF\n8 6 12\n", code="E-UNSUPPORTED", says="dimensions")
    yield odd(
        "negative_index",
        plain.replace("face 6", "face 7").replace("8 6 12", "8 7 12") + "3 0 1 -1\n",
        notes=("W-BADINDEX",),
    )
    yield odd("counts_of_float", plain.replace("8 6 12", "8.0 6 12"), code="E-CORRUPT", says="line 2")
    yield odd("word_on_a_face", plain.replace("4 0 1 3 2", "4 0 1 3 2 red"), code="E-CORRUPT", says="'red'")
    yield odd("two_faces_a_line", plain.replace("3 2\n4 4", "3 2 4 4"), code="E-CORRUPT")
    yield odd(
        "face_too_long", plain.replace("4 0 1 3 2", "1000000000 0 1 3 2"), code="E-CORRUPT", says="line 11"
    )
    yield odd("lower_case", plain.replace("OFF", "off"), code="E-FORMAT")
    yield odd("lies", plain.replace("8 6 12", "8 99999999999 12"), code="E-CORRUPT", says="99999999999")
    yield odd("point_face", plain.replace("8 6 12", "8 7 12") + "1 0\n", notes=("W-DEGENERATE",))


def gltf_cube(**more: object) -> dict[str, Any]:
    """A cube with an embedded buffer; `more` replaces entries of the top level."""
    body = np.array(CORNERS, "<f4").tobytes() + np.array(TRIANGLES, "<u2").tobytes()
    document: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 96},
            {"buffer": 0, "byteOffset": 96, "byteLength": 72},
        ],
        "buffers": [{"byteLength": 168, "uri": _data_uri(body)}],
    }
    return document | more


def _data_uri(body: bytes, head: str = "data:application/octet-stream") -> str:
    return f"{head};base64,{base64.b64encode(body).decode()}"


def _with(path: str, value: object, document: dict[str, Any] | None = None) -> dict[str, Any]:
    """A cube with one value changed; the path is keys and indices with slashes between."""
    document = json.loads(json.dumps(document or gltf_cube()))
    *way, last = [int(key) if key.isdigit() else key for key in path.split("/")]
    entry: Any = document
    for key in way:
        entry = entry[key]
    entry[last] = value
    return document


def _gltf_of(arrays: list[np.ndarray], types: list[str], primitive: dict[str, Any]) -> dict[str, Any]:
    """One primitive over arrays, each with a view and an accessor of its own, and 4 bytes between them."""
    components = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
    body, views, accessors = b"", [], []
    for array, type in zip(arrays, types, strict=True):
        views.append({"buffer": 0, "byteOffset": len(body), "byteLength": array.nbytes})
        accessors.append(
            {
                "bufferView": len(accessors),
                "componentType": components[array.dtype.str[1:]],
                "count": len(array),
                "type": type,
            }
        )
        body += array.tobytes() + bytes(-array.nbytes % 4 + 4)
    return gltf_cube(
        meshes=[{"primitives": [primitive]}],
        accessors=accessors,
        bufferViews=views,
        buffers=[{"byteLength": len(body), "uri": _data_uri(body)}],
    )


def _gltf() -> Iterator[OddFile]:
    def odd(name: str, document: object, **more: Any) -> OddFile:
        data = document if isinstance(document, bytes) else json.dumps(document).encode()
        return OddFile(f"gltf_{name}.gltf", data, **more)

    positions, faces = np.array(CORNERS, "<f4"), np.array(TRIANGLES)
    flat = faces.ravel()
    simple = {"attributes": {"POSITION": 0}, "indices": 1}
    yield odd("indices_u1", _gltf_of([positions, flat.astype("<u1")], ["VEC3", "SCALAR"], simple))
    yield odd("indices_u4", _gltf_of([positions, flat.astype("<u4")], ["VEC3", "SCALAR"], simple))
    yield odd(
        "indices_of_floats",
        _gltf_of([positions, flat.astype("<f4")], ["VEC3", "SCALAR"], simple),
        code="E-CORRUPT",
        says="5126",
    )
    yield odd(
        "indices_signed",
        _gltf_of([positions, flat.astype("<i2")], ["VEC3", "SCALAR"], simple),
        code="E-CORRUPT",
    )
    restart = flat.astype("<u2")
    restart[5] = 65535
    yield odd(
        "index_restart",
        _gltf_of([positions, restart], ["VEC3", "SCALAR"], simple),
        code="E-CORRUPT",
        says="65535",
    )
    strip = np.array([0, 1, 2, 3, 3, 4, 4, 5, 6, 7], "<u2")
    yield odd(
        "strip", _gltf_of([positions, strip], ["VEC3", "SCALAR"], simple | {"mode": 5}), faces=4, area=2.0
    )
    fan = np.array([0, 4, 6, 2], "<u2")
    yield odd("fan", _gltf_of([positions, fan], ["VEC3", "SCALAR"], simple | {"mode": 6}), faces=2, area=1.0)
    yield odd(
        "fan_of_two",
        _gltf_of([positions, fan[:2]], ["VEC3", "SCALAR"], simple | {"mode": 6}),
        code="E-CORRUPT",
    )
    yield odd("mode_7", _with("meshes/0/primitives/0/mode", 7), code="E-CORRUPT", says="mode 7")
    small = np.zeros((8, 4), "<i2")
    small[:, :3] = 32767 * np.array(CORNERS)
    quantized = _with(
        "accessors/0/normalized", True, _gltf_of([small, flat.astype("<u2")], ["VEC3", "SCALAR"], simple)
    )
    quantized["bufferViews"][0]["byteStride"] = 8
    yield odd("quantized", quantized | {"extensionsRequired": ["KHR_mesh_quantization"]})
    yield odd("quantized_unasked", quantized, code="E-CORRUPT", says="5122")
    yield odd("normalized_one", _with("accessors/0/normalized", 1), code="E-CORRUPT", says="neither true")
    endless = np.ones((8, 3), "<f4")
    endless[5, 1] = -np.inf
    tinted = {"mode": 4, "attributes": {"POSITION": 0, "COLOR_0": 2}, "indices": 1}
    yield odd(
        "colour_infinite",
        _gltf_of([positions, flat.astype("<u2"), endless], ["VEC3", "SCALAR", "VEC3"], tinted),
        notes=("W-COLORS", "W-NONFINITE"),
    )
    interleaved = np.zeros((8, 8), "<f4")
    interleaved[:, 3:6] = positions
    document = _gltf_of([interleaved, flat.astype("<u2")], ["VEC3", "SCALAR"], simple)
    document["bufferViews"][0]["byteStride"] = 32
    document["accessors"][0]["byteOffset"] = 12
    yield odd("interleaved", document)
    yield odd(
        "interleaved_too_far", _with("accessors/0/byteOffset", 24, document), code="E-CORRUPT", says="bytes"
    )
    yield odd("stride_of_6", _with("bufferViews/0/byteStride", 6), code="E-CORRUPT", says="byteStride")
    yield odd("stride_of_0", _with("bufferViews/0/byteStride", 0), code="E-CORRUPT", says="byteStride")
    yield odd("offset_odd", _with("bufferViews/1/byteOffset", 95), code="E-CORRUPT", says="multiple")
    yield odd("view_beyond", _with("bufferViews/1/byteLength", 10**12), code="E-CORRUPT", says="1000000000")
    yield odd("count_beyond", _with("accessors/0/count", 10**15), code="E-CORRUPT", says="bytes")
    yield odd("count_0", _with("accessors/0/count", 0), code="E-CORRUPT", says="count")
    yield odd("count_a_novel", _with("accessors/0/count", "x" * 100_000), code="E-CORRUPT", says="xxx...;")
    yield odd("count_float", _with("accessors/0/count", 8.0), code="E-CORRUPT", says="8.0")
    moved = np.array([[0.0, 0.0, 0.0]], "<f4")
    lifted = np.array(CORNERS, "<f4")
    lifted[0] = 5.0
    document = _gltf_of(
        [lifted, flat.astype("<u2"), np.array([0], "<u2"), moved], ["VEC3", "SCALAR"] * 2, simple
    )
    sparse = {"count": 1, "indices": {"bufferView": 2, "componentType": 5123}, "values": {"bufferView": 3}}
    yield odd("sparse", _with("accessors/0/sparse", sparse, document))
    yield odd("sparse_beyond", _with("accessors/0/sparse", sparse | {"count": 2}, document), code="E-CORRUPT")
    zero = {key: value for key, value in document["accessors"][0].items() if key != "bufferView"}
    yield odd("sparse_of_zeros", _with("accessors/0", zero | {"sparse": sparse}, document), code="E-NOAREA")
    yield odd("no_view_no_sparse", _with("accessors/0", zero, document), code="E-CORRUPT", says="no data")
    yield odd(
        "huge_sparse",
        _with("accessors/0", zero | {"count": 10**11, "sparse": sparse}, document),
        code="E-CORRUPT",
    )
    yield odd("morph_targets", _with("meshes/0/primitives/0/targets", [{"POSITION": 0}]), notes=("W-MORPH",))
    yield odd("skin", gltf_cube(skins=[{"joints": [0]}]), notes=("W-SKIN",))
    for name in ("EXT_meshopt_compression", "KHR_draco_mesh_compression", "EXT_mesh_gpu_instancing"):
        yield odd(f"requires_{name}", gltf_cube(extensionsRequired=[name]), code="E-UNSUPPORTED", says=name)
    draco = {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}}
    yield odd("draco_with_fallback", _with("meshes/0/primitives/0/extensions", draco))
    yield odd(
        "data_uri_octets",
        _with("buffers/0/uri", _data_uri(b"", "data:").replace(";base64", "")),
        code="E-UNSUPPORTED",
        says="base64",
    )
    body = base64.b64decode(gltf_cube()["buffers"][0]["uri"].partition(",")[2])
    yield odd(
        "data_uri_with_charset",
        _with("buffers/0/uri", _data_uri(body, "data:application/gltf-buffer;charset=x")),
    )
    yield odd("data_uri_cut", _with("buffers/0/uri", _data_uri(body)[:-3]), code="E-CORRUPT")
    for name, uri in (
        ("encoded", "%2e%2e%2fx.bin"),
        ("encoded_twice", "%252e%252e/x.bin"),
        ("file", "file:///etc/hostname"),
        ("unc", "\\\\server\\share\\x.bin"),
        ("network", "//server/x.bin"),
        ("drive", "C:\\x.bin"),
        ("zero", "x%00.bin"),
        ("root", "/etc/hostname"),
        ("ftp", "ftp://server/x.bin"),
    ):
        # Decoded once, the second is a folder called %2e%2e, which is inside and not there.
        code = "E-MISSING" if name == "encoded_twice" else "E-SECURITY"
        yield odd(f"uri_{name}", _with("buffers/0/uri", uri), code=code)
    yield odd(
        "cycle",
        gltf_cube(nodes=[{"mesh": 0, "children": [1]}, {"children": [0]}]),
        code="E-CORRUPT",
        says="tree",
    )
    yield odd(
        "two_parents",
        gltf_cube(nodes=[{"children": [1, 2]}, {"children": [2]}, {"mesh": 0}]),
        code="E-CORRUPT",
    )
    yield odd("mirrored", gltf_cube(nodes=[{"mesh": 0, "scale": [-1, 1, 1]}]))
    yield odd("flattened", gltf_cube(nodes=[{"mesh": 0, "scale": [0, 0, 1]}]), code="E-NOAREA")
    yield odd(
        "matrix_of_words",
        gltf_cube(nodes=[{"mesh": 0, "matrix": ["1"] * 16}]),
        code="E-CORRUPT",
        says="matrix",
    )
    yield odd(
        "matrix_and_scale",
        gltf_cube(nodes=[{"mesh": 0, "matrix": [1.0] * 16, "scale": [1, 1, 1]}]),
        code="E-CORRUPT",
    )
    yield odd(
        "rotation_long",
        gltf_cube(nodes=[{"mesh": 0, "rotation": [0, 0, 2, 0]}]),
        code="E-CORRUPT",
        says="quaternion",
    )
    broken = positions.copy()
    broken[7] = math.nan
    yield odd(
        "one_nan",
        _gltf_of([broken, flat.astype("<u2")], ["VEC3", "SCALAR"], simple),
        faces=None,
        area=None,
        notes=("W-NONFINITE",),
    )
    yield odd("version_1", gltf_cube(asset={"version": "1.0"}), code="E-UNSUPPORTED", says="1.0")
    yield odd("no_asset", b'{"asset": {}}', code="E-CORRUPT")
    yield odd(
        "misspelt_key",
        _with("meshes/0/primitives/0", {"attributes": {"POSITION": 0}, "indexes": 1, "mode": 6}),
        faces=6,
        area=None,
        notes=("W-UNKNOWN",),
    )
    yield odd(
        "misspelt_attribute", _with("meshes/0/primitives/0/attributes", {"POSITIONS": 0}), code="E-CORRUPT"
    )
    yield odd(
        "key_twice",
        json.dumps(gltf_cube()).replace('"nodes"', '"nodes": [], "nodes"', 1).encode(),
        code="E-CORRUPT",
        says="twice",
    )
    yield odd(
        "deep_json",
        json.dumps(gltf_cube()).encode()[:-1] + b', "extras": ' + b"[" * 200_000,
        code="E-CORRUPT",
    )
    yield odd("long_integer", json.dumps(gltf_cube()).replace("168", "9" * 5000).encode(), code="E-CORRUPT")
    yield odd("json_in_utf16", json.dumps(gltf_cube()).encode("utf-16"), code="E-FORMAT")
    yield odd("json_with_bom", b"\xef\xbb\xbf" + json.dumps(gltf_cube()).encode())
    yield odd("garbage_behind", json.dumps(gltf_cube()).encode() + b"}", code="E-CORRUPT")
    yield odd("empty_scene", gltf_cube(scenes=[{}]), code="E-NOFACES")
    yield odd("no_scene", {k: v for k, v in gltf_cube().items() if k not in ("scene", "scenes")})
    yield odd("picture_missing", gltf_cube(images=[{"uri": "rust.png"}]), notes=("W-MATERIAL",))
    yield odd(
        "picture_elsewhere", gltf_cube(images=[{"uri": "http://127.0.0.1:9/rust.png"}]), notes=("W-MATERIAL",)
    )
    lines_too = gltf_cube()
    lines_too["meshes"][0]["primitives"].append({"attributes": {"POSITION": 0}, "mode": 1})
    yield odd("lines_too", lines_too)
    chain = [{"children": [i + 1]} for i in range(20_000)] + [{"mesh": 0}]
    yield odd("chain_of_20000_nodes", gltf_cube(nodes=chain))


def _glb() -> Iterator[OddFile]:
    def odd(name: str, data: bytes, **more: Any) -> OddFile:
        return OddFile(f"glb_{name}.glb", data, **more)

    document = gltf_cube(buffers=[{"byteLength": 168}])
    body = base64.b64decode(gltf_cube()["buffers"][0]["uri"].partition(",")[2])
    good = pack_glb(document, body)
    yield odd("plain", good)
    yield odd(
        "json_only",
        pack_glb(gltf_cube(), b"")[:-8].replace(
            struct.pack("<I", len(pack_glb(gltf_cube(), b""))),
            struct.pack("<I", len(pack_glb(gltf_cube(), b"")) - 8),
            1,
        ),
    )
    yield odd(
        "no_buffer",
        pack_glb(gltf_cube(buffers=[{"byteLength": 168}, {"byteLength": 4}]), body[:100]),
        code="E-CORRUPT",
        says="168",
    )
    extra = struct.pack("<I4s", 4, b"XTRA") + b"abcd"
    longer = good[:8] + struct.pack("<I", len(good) + 12) + good[12:] + extra
    yield odd("chunk_more", longer)
    yield odd("length_lies", good + b"\0\0\0\0", code="E-CORRUPT", says="header says")
    size = struct.unpack_from("<I", good, 12)[0]
    yield odd(
        "chunk_lies",
        good[:12] + struct.pack("<I", 2**32 - 4) + good[16:],
        code="E-CORRUPT",
        says="4294967292",
    )
    yield odd(
        "chunk_odd",
        good[:12] + struct.pack("<I", size - 1) + good[16:],
        code="E-CORRUPT",
        says="multiple of 4",
    )
    yield odd("version_1", good[:4] + struct.pack("<I", 1) + good[8:], code="E-UNSUPPORTED", says="version 1")
    yield odd("header_only", good[:12], code="E-CORRUPT")
    yield odd(
        "named_elsewhere",
        pack_glb(gltf_cube(buffers=[{"byteLength": 168, "uri": "../x.bin"}]), body),
        code="E-SECURITY",
    )
    yield odd("cut", good[:-30], code="E-CORRUPT", says="header says")


def zipped(entries: dict[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    """An archive of these entries."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", method) as archive:
        for name, data in entries.items():
            archive.writestr(zipfile.ZipInfo(name), data, method)
    return stream.getvalue()


def _archives() -> Iterator[OddFile]:
    def odd(name: str, data: bytes, **more: Any) -> OddFile:
        return OddFile(f"zip_{name}.zip", data, **more)

    model = cube().encode()
    good = zipped({"cube.obj": model})
    yield odd("plain", good)
    yield odd("of_a_mac", zipped({"cube.obj": model, "__MACOSX/._cube.obj": b"\0\5\x16\7" + bytes(100)}))
    yield odd("name_leads_out", zipped({"../../cube.obj": model}))
    yield odd("in_a_zip", zipped({"cube.zip": good}), code="E-FORMAT", says="0 models")
    yield odd("in_a_zip_as_obj", zipped({"cube.obj": good}), code="E-FORMAT", says="within")
    yield odd("two_models", zipped({"a.obj": model, "b.ply": b""}), code="E-FORMAT", says="2 models")
    yield odd(
        "gltf_with_bin",
        zipped({"a.gltf": json.dumps(_with("buffers/0/uri", "a.bin")).encode(), "a.bin": bytes(168)}),
        code="E-MISSING",
    )
    yield odd("lzma", zipped({"cube.obj": model}, zipfile.ZIP_LZMA), code="E-UNSUPPORTED", says="method 14")
    yield odd("bzip2_bomb", zipped({"cube.obj": bytes(3_000_000)}, zipfile.ZIP_BZIP2), code="E-UNSUPPORTED")
    yield odd(
        "encrypted",
        good.replace(b"PK\1\2\x14\0\x14\0\0\0", b"PK\1\2\x14\0\x14\0\1\0").replace(
            b"PK\1\2\x14\3\x14\0\0\0", b"PK\1\2\x14\3\x14\0\1\0"
        ),
        code="E-UNSUPPORTED",
        says="encrypted",
    )
    yield odd("bomb", zipped({"cube.obj": b"v 0 0 0\n" * 2_000_000}), code="E-LIMIT")
    lying = good.replace(struct.pack("<I", len(model)), struct.pack("<I", 10))
    yield odd("size_lies", lying, code="E-CORRUPT")
    yield odd("cut", good[:-40], code="E-CORRUPT", says="zip")
    yield odd("damaged", good[:60] + bytes([good[60] ^ 255]) + good[61:], code="E-CORRUPT", says="zip")
    yield odd("empty", zipped({}), code="E-FORMAT", says="0 models")
    yield odd("empty_model", zipped({"cube.obj": b""}), code="E-EMPTY")
    parts = {"[Content_Types].xml": b"<Types/>", "3D/3dmodel.model": b"<model/>"}
    yield OddFile("part.3mf", zipped(parts), code="E-FORMAT", says="3MF")
    yield OddFile(
        "part.usdz", zipped({"part.usdc": b"PXR-USDC"}, zipfile.ZIP_STORED), code="E-FORMAT", says="USD"
    )


def _strangers() -> Iterator[OddFile]:
    text = cube().encode()
    for name, data, says in (
        ("part.dae", b'<?xml version="1.0"?>\n<COLLADA version="1.4.1"></COLLADA>', "COLLADA"),
        ("part.fbx", b"Kaydara FBX Binary  \0\x1a\0" + bytes(100), "FBX"),
        ("part.step", b"ISO-10303-21;\nHEADER;\n", "STEP"),
        ("part.blend", b"BLENDER-v300" + bytes(100), "Blender"),
        ("part.obj", b"\n\n<!DOCTYPE html>\n<html><body>404</body></html>", "HTML"),
        ("part.obj.gz", gzip.compress(text), "gzip"),
        ("part.tar", b"part.obj".ljust(512, b"\0") + text, "unknown"),
        ("part.json", b'{"vertices": [0, 0, 0]}', "unknown"),
        ("part.png.obj", b"\x89PNG\r\n\x1a\n" + bytes(50), "picture"),
        ("part.ply.txt", _ply_text().encode(), "--format ply"),
        ("part.md", b"# comments only\n", "unknown"),
        ("part", b"hello", "text"),
    ):
        yield OddFile(name, data, code="E-FORMAT", says=says)
    yield OddFile("licence_without_extension", b"# all rights\n" * 20_000 + text)
    yield OddFile("off_named.ply", ("OFF\n8 6 12\n" + _PLY_ROWS + _PLY_FACES).encode(), notes=("W-FORMAT",))
    yield OddFile("glb_named.gltf", pack_glb(gltf_cube(), b""))
    yield OddFile("zip_named.obj", zipped({"cube.ply": _ply_text().encode()}), notes=("W-FORMAT",))
    yield OddFile("stl_named.ply", _stl_bytes(), notes=("W-FORMAT",))


def _names() -> Iterator[OddFile]:
    for name in (
        "line\nbreak.obj",
        "\x1b[31mred.obj",
        "🪲 rost.obj",
        "-o.obj",
        "trailing.",
        "..obj",
        "tab\tand space .obj",
        "%2e%2e.obj",
        "a" * 251 + ".obj",
        "C:\\model.obj",
        "*?.obj",
        "CUBE.Obj",
        "'; rm -rf .obj",
        "naïve\u202e.obj",
    ):
        yield OddFile(name, cube().encode())
    yield OddFile("blank behind.obj ", cube().encode(), code="E-FORMAT", says="--format obj")
