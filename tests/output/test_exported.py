"""OBJ, VTU, USD and coarser levels of snapshots, as independent readers see them."""

from dataclasses import replace

import meshio
import numpy as np
import pytest
import trimesh

from tests.output.snapshots import make_snapshot
from weathercoat.mesh.surface import face_areas, make_surface
from weathercoat.output.condition import LIFTED, film_classes
from weathercoat.output.glb import Node
from weathercoat.output.obj import write_obj
from weathercoat.output.pieces import number_flakes
from weathercoat.output.ply import color_bytes
from weathercoat.output.sheets import srgb_to_linear
from weathercoat.output.snapshots import film_sheets, metal_sheets
from weathercoat.output.vtu import write_pvd, write_snapshot_vtu


def textured_snapshot(cells=4):
    """A snapshot with a crack, and a seam between the two halves of its faces."""
    snapshot = make_snapshot(cells=cells, split_column=cells // 2)
    surface = make_surface(snapshot.substrate_vertices, snapshot.substrate_faces)
    uv = snapshot.substrate_vertices[snapshot.substrate_faces][:, :, [0, 2]].copy()
    uv[len(uv) // 2 :] += 2.0
    return replace(snapshot, surface=replace(surface, uv=uv))


def test_obj_read_by_trimesh_and_meshio(tmp_path):
    snapshot = textured_snapshot()
    write_obj(tmp_path / "a.obj", [Node("film", film_sheets(snapshot, 0.0, None))])
    mesh = trimesh.load(tmp_path / "a.obj", process=False, maintain_order=True, force="mesh")
    film = snapshot.film_vertices[snapshot.film_faces]
    np.testing.assert_allclose(mesh.vertices[mesh.faces], film, atol=1e-8)
    read = meshio.read(tmp_path / "a.obj")
    faces = read.cells_dict["triangle"]
    np.testing.assert_allclose(
        read.point_data["obj:vt"][faces], snapshot.surface.uv[snapshot.film_face], atol=1e-8
    )
    rows = [line.split()[4:] for line in (tmp_path / "a.obj").read_text().splitlines() if line[:2] == "v "]
    colors = np.array(rows, np.float64)[faces]
    np.testing.assert_allclose(colors, snapshot.film_color[snapshot.film_faces], atol=0.5 / 255 + 1e-6)


def test_obj_numbers_texture_coordinates_after_sheets_without_them(tmp_path):
    """Backs and rims have none, so that the numbers of v and vt differ in what follows."""
    snapshot = textured_snapshot()
    film = film_sheets(snapshot, 0.01, (0.1, 0.2, 0.3))
    write_obj(tmp_path / "a.obj", [Node("film", film), Node("metal", metal_sheets(snapshot))])
    name, texts, corners = "", [], []
    for line in (tmp_path / "a.obj").read_text().splitlines():
        key, *words = line.split()
        name = words[0] if key == "o" else name
        if key == "vt":
            texts.append([float(word) for word in words])
        elif key == "f" and name == "metal":
            corners.append([int(word.split("/")[1]) for word in words])
    np.testing.assert_allclose(np.array(texts)[np.array(corners) - 1], snapshot.surface.uv, atol=1e-8)


def test_vtu_read_by_vtk(tmp_path):
    pytest.importorskip("vtk")
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

    snapshot = textured_snapshot()
    names = write_snapshot_vtu(tmp_path, snapshot, "a")
    write_pvd(tmp_path / "a.pvd", [(snapshot.age, names)])
    assert f'timestep="{snapshot.age!r}"' in (tmp_path / "a.pvd").read_text()
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(tmp_path / "a_film.vtu"))
    reader.Update()
    grid = reader.GetOutput()
    faces = vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(-1, 3)
    points = vtk_to_numpy(grid.GetPoints().GetData())
    assert np.array_equal(points[faces], snapshot.film_vertices[snapshot.film_faces])
    origin = snapshot.film_origin
    for name, values in {
        "rust": snapshot.film_rust,
        "dirt": snapshot.dust[origin],
        "separated": snapshot.separated,
        "adhesion": snapshot.adhesion,
        "separation_age": snapshot.separation_age,
        "color": color_bytes(snapshot.film_color),
        "rest": snapshot.substrate_vertices[origin],
    }.items():
        read = vtk_to_numpy(grid.GetPointData().GetArray(name))[faces]
        np.testing.assert_allclose(read, values[snapshot.film_faces], rtol=1e-6, err_msg=name)
    uv = vtk_to_numpy(grid.GetPointData().GetTCoords())[faces]
    np.testing.assert_allclose(uv, snapshot.surface.uv[snapshot.film_face], atol=1e-6)
    assert np.array_equal(vtk_to_numpy(grid.GetCellData().GetArray("origin")), snapshot.film_face)


def test_usd_read_back_and_checked_by_usd(tmp_path):
    pytest.importorskip("pxr.UsdValidation")
    from pxr import Usd, UsdGeom, UsdValidation

    from weathercoat.output.usd import Frame, write_usd

    early, late = textured_snapshot(), make_snapshot(lost=5)
    frames = [Frame(s, [Node("film", film_sheets(x, 0.0, None))]) for s, x in ((0.0, early), (0.5, late))]
    path = tmp_path / "a.usdc"
    write_usd(path, frames, up=(0.0, 1.0, 0.0))
    stage = Usd.Stage.Open(str(path))
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) > 0
    errors = UsdValidation.ValidationContext(validators).Validate(stage)
    assert [error.GetMessage() for error in errors] == []
    meshes = [UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
    assert meshes
    for code, snapshot in ((0.0, early), (12.0, late)):
        shown = [m for m in meshes if m.ComputeVisibility(code) != "invisible"]
        assert sum(len(m.GetFaceVertexCountsAttr().Get(code)) for m in shown) == len(snapshot.film_faces)
        (mesh,) = shown
        faces = np.array(mesh.GetFaceVertexIndicesAttr().Get(code)).reshape(-1, 3)
        points = np.array(mesh.GetPointsAttr().Get(code))[faces]
        np.testing.assert_allclose(points, snapshot.film_vertices[snapshot.film_faces], atol=1e-6)
        colors = np.array(mesh.GetDisplayColorPrimvar().Get(code))[faces]
        expected = srgb_to_linear(snapshot.film_color)[snapshot.film_faces]
        np.testing.assert_allclose(colors, expected, atol=1e-5)


def test_coarser_levels_keep_the_share_of_separated_film():
    pytest.importorskip("pyfqmr")
    from weathercoat.output.lods import coarser

    snapshot = textured_snapshot(cells=16)
    film, _ = coarser(snapshot, 1)
    assert len(film.film_faces) < 0.5 * len(snapshot.film_faces)
    area = face_areas(snapshot.film_vertices, snapshot.film_faces)
    coarse = face_areas(film.film_vertices, film.film_faces)
    share = (coarse * film.separated[film.film_faces].mean(axis=1)).sum() / coarse.sum()
    fine = (area * snapshot.separated[snapshot.film_faces].mean(axis=1)).sum() / area.sum()
    assert share == pytest.approx(fine, abs=0.05)


@pytest.mark.parametrize("level", [1, 2])
def test_coarser_levels_keep_area_outline_and_mean_rust(level: int):
    """Open edges stay, so no film is lost where the surface is flat, and means by area stay with it."""
    pytest.importorskip("pyfqmr")
    from weathercoat.output.lods import coarser

    snapshot = textured_snapshot(cells=24)
    film, metal = coarser(snapshot, level)
    area = face_areas(snapshot.film_vertices, snapshot.film_faces)
    coarse = face_areas(film.film_vertices, film.film_faces)
    assert coarse.sum() == pytest.approx(area.sum(), rel=0.01)
    mean = np.average(snapshot.film_rust[snapshot.film_faces].mean(axis=1), weights=area)
    kept = np.average(film.film_rust[film.film_faces].mean(axis=1), weights=coarse)
    assert kept == pytest.approx(mean, abs=0.02)
    metal_area = face_areas(metal.substrate_vertices, metal.substrate_faces).sum()
    before = face_areas(snapshot.substrate_vertices, snapshot.substrate_faces).sum()
    assert metal_area == pytest.approx(before, rel=0.01)
    assert len(metal.substrate_faces) < 0.5 * len(snapshot.substrate_faces)


def test_film_behind_a_crack_is_one_piece():
    snapshot = make_snapshot(split_column=2)
    flakes = number_flakes(snapshot)
    assert np.array_equal(flakes > 0, film_classes(snapshot) == LIFTED)
    assert flakes.max() == 1
