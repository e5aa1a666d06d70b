"""Every row of the index files beside the real meshes, with its own explicit expectation."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from weathercoat.errors import WeathercoatError
from weathercoat.mesh.inspect import inspect_surface
from weathercoat.mesh.read import read_surface

SPHERE_AREA = 12.3298


@dataclass(frozen=True)
class Expected:
    """What reading a file must give.

    code: of the error, else None. notes: codes with counts, and no others. positions: distinct ones.
    says: what the message must hold.
    """

    code: str | None = None
    faces: int | None = None
    positions: int | None = None
    area: float | None = None
    notes: tuple[tuple[str, int], ...] = ()
    components: int | None = None
    euler: int | None = None
    self_intersections: int | None = None
    says: str = ""


def good(faces: int, positions: int, notes: str = "", **more: object) -> Expected:
    """Notes as in "W-BOUNDARY(4) W-COMPONENTS(2)"."""
    pairs = tuple((code, int(count)) for code, count in re.findall(r"(W-[A-Z-]+)\((\d+)\)", notes))
    return Expected(faces=faces, positions=positions, notes=pairs, **more)  # type: ignore[arg-type]


def sphere(notes: str = "", **more: object) -> Expected:
    return good(320, 162, notes, area=SPHERE_AREA, euler=2, **more)


def fails(code: str, says: str = "") -> Expected:
    return Expected(code=code, says=says)


REAL = {
    "aki_Plane.obj": good(3011, 1533, "W-DEGENERATE(1) W-BOUNDARY(53)", euler=1, area=99.9361),
    "aki_bunny2.obj": good(10000, 5004, "W-MATERIAL(1) W-COMPONENTS(2)", euler=4, components=2),
    "os_spot.obj": good(23062, 11533, euler=2),
    # The index counts 30 with concave quads cut along the outer diagonal.
    "os_spot_control_mesh.obj": good(372, 188, "W-POLYGONS(176)", euler=2, self_intersections=20),
    "os_bunny.obj": good(6598, 3301, euler=2),
    "aj_stanford-bunny.obj": good(69451, 34834, "W-UNREFERENCED(1113) W-BOUNDARY(223)", euler=-3),
    "aj_teapot.obj": good(
        6320,
        3241,
        "W-WELDED(403) W-NONMANIFOLD-VERTEX(1) W-BOUNDARY(160) W-COMPONENTS(4)",
        components=4,
        self_intersections=157,
    ),
    "pmp_fandisk_quads.off": good(1528, 766, "W-POLYGONS(764)", euler=2),
    "os_wingnut.obj": good(6090, 3047, euler=2, self_intersections=4),
    "os_hammer.obj": good(60160, 30082, euler=2),
    "os_torus.obj": good(4608, 2304, euler=0),
    "os_mountain.obj": good(50562, 25600, "W-BOUNDARY(636)", euler=1),
    "os_cube.obj": good(48, 26, euler=2, area=24.0),
    "os_cube_no_bottom.obj": good(40, 25, "W-BOUNDARY(8)", euler=1, area=20.0),
    "cad_barrel.stl": good(2012, 1008, euler=2),
    "cad_gear.stl": good(1094, 547, euler=0),
    "cad_signplate.stl": good(1292, 640, euler=-6),
    "cad_hexbolt_simple.stl": good(512, 258, euler=2),
    "tm_plate_holes.STL": good(1252, 618, euler=-8),
    "tm_1002_tray_bottom.STL": good(4520, 2216, euler=-44),
    "tm_featuretype.STL": good(3476, 2010, "W-BOUNDARY(576)", euler=-16),
    "tm_CesiumMilkTruck.glb": good(
        3624,
        1840,
        "W-ANIMATION(1) W-NONMANIFOLD-VERTEX(2) W-BOUNDARY(8) W-COMPONENTS(14)",
        components=14,
        self_intersections=356,
    ),
    "vtk_gears.stl": good(19426, 9723, "W-COMPONENTS(7)", components=7, euler=10, self_intersections=24),
    "tm_octagonal_pocket.stl": good(
        3262,
        1658,
        "W-NONMANIFOLD-VERTEX(3) W-BOUNDARY(54) W-COMPONENTS(5)",
        components=5,
        self_intersections=8,
    ),
    "tm_soup.stl": good(
        100, 300, "W-BOUNDARY(300) W-COMPONENTS(100) W-SOUP(100)", components=100, self_intersections=99
    ),
    "mp_chair.off": good(
        1016,
        504,
        "W-WELDED(2056) W-UNREFERENCED(4) W-DEGENERATE(226) W-DUPLICATE(564) W-NONMANIFOLD(64) "
        "W-NONMANIFOLD-VERTEX(5) W-NONORIENTABLE(2) W-FLIPPED(135) W-BOUNDARY(210) W-COMPONENTS(27)",
        area=4519.21,
    ),
    "gc_moebius.obj": good(
        448, 280, "W-POLYGONS(224) W-NONORIENTABLE(1) W-FLIPPED(206) W-BOUNDARY(120)", euler=1
    ),
    "thingi_472042.stl": good(3632, 1814, euler=-2),
    # The area of its polygons. The 11 faces without area of the index come from fanning concave polygons.
    "tm_wallhole.obj": good(66, 35, "W-MATERIAL(1) W-POLYGONS(13) W-WELDED(57)", area=721.4213562),
    "mf_openscad-nonmanifold-crash.obj": good(
        1439,
        657,
        "W-WELDED(60) W-DEGENERATE(2) W-DUPLICATE(3) W-NONMANIFOLD(18) W-NONMANIFOLD-VERTEX(31) "
        "W-BOUNDARY(9) W-COMPONENTS(4)",
    ),
    "ml_non_manif_hole.ply": good(755, 432, "W-NONMANIFOLD-VERTEX(5) W-BOUNDARY(119)"),
    "assimp_IndexOutOfRange_dir/assimp_IndexOutOfRange.gltf": fails(
        "E-CORRUPT", "face 0 (counted from 0) of mesh 'Mesh' has index 255, but there are 24 vertices"
    ),
    "tm_emptyIO_obj_points.obj": fails("E-NOFACES"),
    "aj_igea.ply": good(268686, 134345, euler=2),
    "aki_Curve2.obj": good(3005, 1528, "W-BOUNDARY(49)", euler=1),
}

SYNTHETIC = {
    "-dash-first.obj": sphere(),
    "UPPER.OBJ": sphere(),
    "double.ext.tar.obj": sphere(),
    "file with spaces.obj": sphere(),
    "quote'and\"semi;colon&.obj": sphere(),
    "empty_0byte.obj": fails("E-EMPTY"),
    "empty_0byte.ply": fails("E-EMPTY"),
    "empty_0byte.stl": fails("E-EMPTY"),
    # Two of the 25 boxes coincide.
    "glb_instanced_mirrored_textured.glb": good(300, 192, "W-COMPONENTS(25)", area=1850.16, components=25),
    "glb_random_bytes.glb": fails("E-FORMAT", "binary data"),
    "gltf_3000_deep_nodes.gltf": good(1, 3, "W-BOUNDARY(3)", area=0.5),
    "gltf_lines_mode.gltf": fails("E-NOFACES"),
    "gltf_nan_matrix.gltf": fails("E-NONFINITE"),
    "gltf_required_draco_ext.gltf": fails("E-UNSUPPORTED", "KHR_draco_mesh_compression"),
    "gltf_uri_http.gltf": fails("E-SECURITY"),
    "gltf_uri_traversal.gltf": fails("E-SECURITY"),
    "mismatch_obj_named.stl": sphere("W-FORMAT(1)"),
    "mismatch_ply_named.off": sphere("W-FORMAT(1)"),
    "obj_anisotropic_1e6.obj": good(320, 162, euler=2, area=9685620.0),
    "obj_bowtie_vertex.obj": good(
        640, 323, "W-UNREFERENCED(1) W-NONMANIFOLD-VERTEX(1) W-COMPONENTS(2)", area=24.6597
    ),
    "obj_comma_decimal.obj": fails("E-CORRUPT", "line 1:"),
    "obj_comments_only.obj": fails("E-NOFACES"),
    "obj_concave_L_start4.obj": good(4, 6, "W-POLYGONS(1) W-BOUNDARY(6)", area=5.0),
    "obj_cr_only.obj": sphere(),
    "obj_exponent_fortran_D.obj": fails("E-CORRUPT", "line 1:"),
    "obj_far_1e15.obj": fails("E-PRECISION"),
    # Of four flat faces, two pairs share their long edge and close like a beak.
    "obj_flattened_slivers.obj": good(312, 158, "W-DEGENERATE(4)", area=6.15729, euler=2),
    "obj_git_lfs_pointer.obj": fails("E-FORMAT", "git-LFS"),
    "obj_inside_out.obj": sphere("W-INVERTED(320)"),
    "obj_line_continuation.obj": sphere(),
    "obj_moebius.obj": good(
        600, 360, "W-NONORIENTABLE(1) W-FLIPPED(290) W-BOUNDARY(130)", area=3.78129, euler=1
    ),
    "obj_needle_1e4.obj": good(320, 162, euler=2, area=96856.2),
    "obj_negative_indices.obj": good(2, 6, "W-BOUNDARY(6) W-COMPONENTS(2)", area=1.0, components=2),
    # Concentric, and nowhere cutting each other.
    "obj_nested_spheres.obj": good(640, 324, "W-COMPONENTS(2)", area=15.4123, self_intersections=0),
    # The index files it under the non-manifold ones, but it is the plain sphere.
    "obj_no_final_newline.obj": sphere(),
    "obj_nonmanifold_edge_fin.obj": good(
        576, 325, "W-NONMANIFOLD(12) W-BOUNDARY(96) W-COMPONENTS(2)", area=2.0, components=2
    ),
    "obj_one_5000gon.obj": good(4998, 5000, "W-POLYGONS(1) W-BOUNDARY(5000)", area=3.14159),
    "obj_one_triangle_point.obj": fails("E-NOAREA"),
    "obj_points_only.obj": fails("E-NOFACES"),
    "obj_quads_cube.obj": good(12, 8, "W-POLYGONS(6)", area=6.0, euler=2),
    "obj_random_bytes.obj": fails("E-FORMAT", "binary data"),
    "obj_random_flips.obj": sphere("W-FLIPPED(153)"),
    "obj_scale_1e+09.obj": good(320, 162, euler=2, area=1.23298e19),
    "obj_scale_1e-30.obj": fails("E-SCALE"),
    "obj_shiftjis_names.obj": sphere(),
    "obj_tabs_and_spaces.obj": sphere(),
    "obj_tjunction_cap.obj": good(289, 170, "W-DEGENERATE(1) W-BOUNDARY(49)", area=1.0),
    "obj_triangle_soup.obj": sphere("W-WELDED(798)"),
    "obj_two_triangles_disconnected.obj": good(2, 6, "W-BOUNDARY(6) W-COMPONENTS(2)", area=1.0),
    "obj_utf16be_nobom.obj": fails("E-FORMAT", "UTF-16"),
    "obj_utf16le.obj": sphere(),
    "obj_utf8_bom.obj": sphere(),
    "obj_vertex_w_rgb.obj": sphere(),
    "off_concave_arrow_quad.off": good(2, 4, "W-POLYGONS(1) W-BOUNDARY(4)", area=1.0),
    "off_face_count_short.off": fails("E-CORRUPT", "3 vertices and 2 faces, the file 4 lines"),
    "off_header_1e12.off": fails("E-CORRUPT", "1000000000000"),
    "off_index_oob.off": fails("E-CORRUPT", "face 5 (counted from 0) has index 99999"),
    "off_no_counts.off": fails("E-CORRUPT", "counts"),
    "ply_all_nan.ply": fails("E-NONFINITE"),
    "ply_header_1e12_ascii.ply": fails("E-CORRUPT", "1000000000000"),
    "ply_icosphere_327k_faces.ply": good(327680, 163842, euler=2, area=12.5661),
    "ply_index_negative.ply": good(319, 162, "W-BADINDEX(1) W-BOUNDARY(3)", area=12.2938),
    "ply_index_oob.ply": fails("E-CORRUPT", "face 5 (counted from 0) has index 99999"),
    "ply_inf_vertex.ply": good(315, 161, "W-NONFINITE(1) W-BOUNDARY(5)", area=12.1497),
    "ply_nan_unreferenced.ply": sphere("W-UNREFERENCED(1)"),
    "ply_random_bytes.ply": fails("E-FORMAT", "binary data"),
    "ply_truncated_body.ply": fails(
        "E-CORRUPT", "the header says 320 rows of element face, the file holds 78"
    ),
    "stl_ascii_truncated.stl": fails("E-CORRUPT", "line 6"),
    "stl_binary_says_solid.stl": sphere(),
    "stl_count_too_big.stl": fails("E-CORRUPT", "the header says 4000000000 faces, the file holds 320"),
    "unknown_ext.xyzzy": fails("E-FORMAT", "supported: OBJ, PLY"),
    "zip_bomb_240MB.zip": fails("E-LIMIT"),
}
# Made by test_read.py, since they are no regular files.
NO_REGULAR_FILES = {"directory.obj", "symlink_loop.obj"}
CASES = [*REAL.items(), *((f"synth/{name}", expected) for name, expected in SYNTHETIC.items())]


def rows(index: Path) -> list[dict[str, str]]:
    with index.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream, delimiter="\t"))


def test_every_row_has_an_expectation(meshes_folder: Path) -> None:
    assert {row["file"] for row in rows(meshes_folder / "index.tsv")} == set(REAL)
    synthetic = {row["file"] for row in rows(meshes_folder / "synth" / "index.tsv")}
    assert synthetic == set(SYNTHETIC) | NO_REGULAR_FILES


def test_exit_codes_are_those_of_the_index(meshes_folder: Path) -> None:
    """Whatever this file expects, one of the exit codes that the index allows comes out."""
    for folder in (meshes_folder, meshes_folder / "synth"):
        for row in rows(folder / "index.tsv"):
            if row["file"] in NO_REGULAR_FILES:
                continue
            allowed = {int(code) for code in re.findall(r"exit (\d+)", row["expected"])}
            try:
                read_surface(folder / row["file"])
                code = 0
            except WeathercoatError as error:
                code = error.exit_code
            assert code in allowed, row["file"]


@pytest.mark.parametrize(("name", "expected"), CASES, ids=[name for name, _ in CASES])
def test_file_ends_as_expected(meshes_folder: Path, name: str, expected: Expected) -> None:
    if expected.code is not None:
        with pytest.raises(WeathercoatError) as caught:
            read_surface(meshes_folder / name)
        assert caught.value.code == expected.code
        assert expected.says in caught.value.line()
        return
    surface = read_surface(meshes_folder / name)
    assert {note.code: note.count for note in surface.notes} == dict(expected.notes)
    assert len(surface.faces) == expected.faces
    assert len(np.unique(surface.vertices, axis=0)) == expected.positions
    if expected.area is not None:
        assert surface.area() == pytest.approx(expected.area, rel=1e-5)
    facts = inspect_surface(surface, self_intersections=expected.self_intersections is not None)
    assert facts["manifold"]
    if expected.components is not None:
        assert facts["components"] == expected.components
    if expected.euler is not None:
        assert facts["euler_number"] == expected.euler
    if expected.self_intersections is not None:
        found = {note["code"]: note["count"] for note in facts["notes"]}
        assert found.get("W-SELFINT", 0) == expected.self_intersections


def test_clean_files_have_the_counts_of_the_index(meshes_folder: Path) -> None:
    """Where nothing had to be repaired, all counts are the index's own figures."""
    checked = 0
    for row in rows(meshes_folder / "index.tsv"):
        expected = REAL[row["file"]]
        if expected.code is not None or {code for code, _ in expected.notes} - {"W-POLYGONS", "W-COMPONENTS"}:
            continue
        facts = inspect_surface(read_surface(meshes_folder / row["file"]))
        figures = [facts[key] for key in ("faces", "vertices", "components", "euler_number")]
        if row["file"] != "aj_igea.ply":
            assert figures == [int(row[key]) for key in ("faces", "verts_welded", "components", "euler")]
            assert facts["watertight"], row["file"]
            checked += 1
    assert checked >= 15
