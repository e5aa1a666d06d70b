"""The strict parser: it takes what the formats allow, and says why not where they do not."""

from __future__ import annotations

import json
import struct
from typing import Any

import pytest

from tests.fuzz import strict
from tests.fuzz.seeds import make_seeds

SEEDS = {seed.name: seed for seed in make_seeds()}
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
PLY = (
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
)
OFF = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
STL = SEEDS["text0.stl"].data.decode()


@pytest.mark.parametrize("seed", SEEDS.values(), ids=SEEDS)
def test_good_files_are_well_formed(seed: Any) -> None:
    content = strict.parse(seed.data, "obj" if seed.extension == "zip" else seed.extension)
    assert content is None or (content.triangles > 0 and not content.flaws)


@pytest.mark.parametrize(
    ("format", "text"),
    [
        ("obj", TRIANGLE + "f 1 2 4\n"),
        ("obj", TRIANGLE + "f 1 2 3 x\n"),
        ("obj", TRIANGLE + "f 1/1 2 3\n"),
        ("obj", TRIANGLE + "F 1 2 3\n"),
        ("obj", TRIANGLE + "vn 0 0\nf 1 2 3\n"),
        ("obj", TRIANGLE + "vt 0 1.0x\nf 1 2 3\n"),
        ("obj", TRIANGLE + "s 1 2 3\nf 1 2 3\n"),
        ("obj", TRIANGLE + "f -1 -2 -4\n"),
        ("ply", PLY.replace("3 0 1 2", "3 0 1 3")),
        ("ply", PLY.replace("3 0 1 2", "3 0 1 2 9")),
        ("ply", PLY.replace("0 1 0\n3", "0 1\n0 3")),
        ("ply", PLY + "3 0 1 2\n"),
        ("ply", PLY.replace("uchar", "float")),
        ("ply", PLY.replace("property float y", "property float x")),
        ("ply", PLY.replace("vertex 3", "vertex 4")),
        ("ply", PLY.replace("1.0", "1.1")),
        ("off", OFF.replace("3 1 0", "3 2 0")),
        ("off", OFF.replace("3 0 1 2", "3 0 1 2 9 9")),
        ("off", OFF.replace("1 0 0", "1 0 0 5")),
        ("off", OFF.replace("3 0 1 2", "3 0 1 3")),
        ("stl", STL.replace("endloop", "endlop", 1)),
        ("stl", STL.replace("normal 0 0 1", "normal 0 0", 1)),
        ("stl", STL.replace("endsolid two", "")),
        ("stl", STL.replace("vertex 0 0 0", "vertex 0 0 0 0", 1)),
    ],
)
def test_broken_texts(format: str, text: str) -> None:
    with pytest.raises(strict.BrokenError):
        strict.parse(text.encode(), format)


@pytest.mark.parametrize(
    ("format", "text", "note"),
    [
        ("obj", TRIANGLE + "f 1 2 3\nf 0 1 2\n", "W-BADINDEX"),
        ("obj", TRIANGLE + "f 1 2 3\nf 1 2\n", "W-DEGENERATE"),
        ("obj", TRIANGLE + "v nan 0 0\nf 1 2 3\n", "W-NONFINITE"),
        ("ply", PLY.replace("3 0 1 2", "3 0 1 -2"), "W-BADINDEX"),
        ("off", OFF.replace("1 0 0", "1 inf 0"), "W-NONFINITE"),
        ("stl", STL.replace("vertex 0 0 0", "vertex 0 0 nan", 1), "W-NONFINITE"),
    ],
)
def test_what_a_note_may_excuse(format: str, text: str, note: str) -> None:
    content = strict.parse(text.encode(), format)
    assert content is not None
    assert [note in flaw.notes for flaw in content.flaws] == [True]


@pytest.mark.parametrize("cut", [1, 40, 90])
def test_broken_binaries(cut: int) -> None:
    for name in ("box.stl", "text2.ply", "text3.ply", "packed.glb"):
        with pytest.raises(strict.BrokenError):
            strict.parse(SEEDS[name].data[:-cut], SEEDS[name].extension)
        with pytest.raises(strict.BrokenError):
            strict.parse(SEEDS[name].data + bytes(cut), SEEDS[name].extension)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("meshes", 0, "primitives", 0, "mode"), 7),
        (("meshes", 0, "primitives", 0, "attributes", "POSITIOM"), 0),
        (("accessors", 0, "count"), 9),
        (("accessors", 0, "count"), True),
        (("accessors", 0, "componentType"), 5125),
        (("accessors", 1, "componentType"), 5122),
        (("accessors", 0, "byteOffset"), 2),
        (("accessors", 6, "sparse", "count"), 3),
        (("bufferViews", 5, "byteStride"), 6),
        (("nodes", 0, "rotation"), [0, 0, 0, 2]),
        (("nodes", 0, "scale"), ["1", 1, 1]),
        (("nodes", 3, "children"), [0]),
        (("asset", "version"), "1.0"),
    ],
)
def test_broken_trees(path: tuple[Any, ...], value: object) -> None:
    document = json.loads(SEEDS["tree1.gltf"].data)
    entry = document
    for key in path[:-1]:
        entry = entry[key]
    entry[path[-1]] = value
    with pytest.raises(strict.BrokenError):
        strict.parse(json.dumps(document).encode(), "gltf")


def test_bytes_of_positions_are_what_the_reader_must_give() -> None:
    content = strict.parse(SEEDS["box.stl"].data, "stl")
    assert content is not None and content.points is not None
    assert struct.unpack_from("<3f", SEEDS["box.stl"].data, 96) in content.points
