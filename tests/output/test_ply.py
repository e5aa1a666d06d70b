"""The PLY writer against other readers, and its own reader against broken files."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from tests.output.snapshots import make_sheet, make_snapshot
from weathercoat.errors import AccessError, CorruptError, FormatError
from weathercoat.output.ply import color_bytes, read_ply_arrays, write_ply
from weathercoat.output.snapshots import hair, read_snapshot_ply, write_snapshot_ply


def write_example(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    vertices, faces = make_sheet()
    colors = np.arange(3 * len(vertices), dtype=np.uint8).reshape(-1, 3)
    write_ply(path, vertices, faces, colors=colors, scalars={"rust": np.linspace(0, 1, len(vertices))})
    return vertices, faces, colors


def test_trimesh_reads_positions_faces_colors_and_scalars(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    vertices, faces, colors = write_example(path)
    mesh = trimesh.load(path, process=False)
    np.testing.assert_array_equal(mesh.vertices, vertices)
    np.testing.assert_array_equal(mesh.faces, faces)
    np.testing.assert_array_equal(mesh.visual.vertex_colors[:, :3], colors)
    np.testing.assert_array_equal(mesh.metadata["_ply_raw"]["vertex"]["data"]["rust"].ravel()[-1], 1.0)


def test_meshio_reads_scalars(tmp_path: Path) -> None:
    import meshio

    path = tmp_path / "a.ply"
    vertices, faces, _ = write_example(path)
    mesh = meshio.read(path)
    np.testing.assert_array_equal(mesh.points, vertices)
    np.testing.assert_array_equal(mesh.cells_dict["triangle"], faces)
    np.testing.assert_array_equal(mesh.point_data["rust"], np.linspace(0, 1, len(vertices)))


@given(
    vertices=st.lists(st.tuples(*[st.floats(allow_nan=False, width=64)] * 3), min_size=3, max_size=20),
    seed=st.integers(0, 100),
)
def test_everything_reads_back_exactly(
    tmp_path_factory: pytest.TempPathFactory, vertices: list[tuple[float, float, float]], seed: int
) -> None:
    random = np.random.default_rng(seed)
    count = len(vertices)
    faces = random.integers(0, count, (random.integers(0, 9), 3))
    scalars = {
        "flag": random.random(count) < 0.5,
        "single": random.random(count).astype(np.float32),
        "double": random.random(count),
        "number": random.integers(-9, 9, count).astype(np.int32),
    }
    path = tmp_path_factory.mktemp("ply") / "a.ply"
    write_ply(path, vertices, faces, scalars=scalars, comments=("two\nlines", "ünïcode"))
    ply = read_ply_arrays(path)
    np.testing.assert_array_equal(ply.vectors("x", "y", "z"), np.array(vertices))
    np.testing.assert_array_equal(ply.faces, faces)
    for name, values in scalars.items():
        np.testing.assert_array_equal(ply.vertex[name], values)
    assert ply.comments == ("two lines", "\\xfcn\\xefcode")


def test_a_stream_gets_the_bytes_of_the_file(tmp_path: Path) -> None:
    vertices, faces = make_sheet()
    stream = io.BytesIO()
    write_ply(stream, vertices, faces)
    write_ply(tmp_path / "a.ply", vertices, faces)
    assert stream.getvalue() == (tmp_path / "a.ply").read_bytes()


@pytest.mark.parametrize(
    "wrong",
    [
        {"colors": np.zeros((25, 3))},
        {"scalars": {"a": np.zeros(24)}},
        {"scalars": {"a": np.zeros(25, np.int64)}},
    ],
)
def test_wrong_arrays_are_refused(wrong: dict[str, object]) -> None:
    vertices, faces = make_sheet()
    with pytest.raises(ValueError):
        write_ply(io.BytesIO(), vertices, faces, **wrong)  # type: ignore[arg-type]


def test_every_truncation_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    write_example(path)
    content = path.read_bytes()
    for length in [*range(0, len(content), 37), len(content) - 1]:
        path.write_bytes(content[:length])
        with pytest.raises((CorruptError, FormatError)):
            read_ply_arrays(path)


@pytest.mark.parametrize(
    ("old", "new", "error"),
    [
        (b"element vertex 25", b"element vertex 99", CorruptError),
        (b"element face 32", b"element face 999999999999", CorruptError),
        (b"property double rust", b"property double x", CorruptError),
        (b"property double rust", b"property half rust", FormatError),
        (b"element face", b"element tristrips", FormatError),
        (b"binary_little_endian", b"ascii", FormatError),
    ],
)
def test_broken_headers_are_refused(tmp_path: Path, old: bytes, new: bytes, error: type[Exception]) -> None:
    path = tmp_path / "a.ply"
    write_example(path)
    content = path.read_bytes()
    assert content.count(old) == 1
    path.write_bytes(content.replace(old, new))
    with pytest.raises(error):
        read_ply_arrays(path)


def test_corners_out_of_range_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    write_ply(path, np.zeros((3, 3)), [[0, 1, 3]])
    with pytest.raises(CorruptError):
        read_ply_arrays(path)


def test_a_missing_file_is_an_access_error(tmp_path: Path) -> None:
    with pytest.raises(AccessError):
        read_ply_arrays(tmp_path / "none.ply")


@pytest.mark.parametrize("offset", [0.0, 1e7])
def test_snapshot_reads_back(tmp_path: Path, offset: float) -> None:
    snapshot = make_snapshot(lost=3, split_column=2, offset=offset)
    back = read_snapshot_ply(write_snapshot_ply(tmp_path, snapshot, "a"))
    exact = ["step", "age", "film_vertices", "film_faces", "film_face", "film_origin", "separated"]
    for name in [*exact, "substrate_faces", "bare"]:
        np.testing.assert_array_equal(getattr(back, name), getattr(snapshot, name), err_msg=name)
    for name in ["film_rust", "separation_age", "adhesion", "substrate_normals", "substrate_rust", "dust"]:
        values = getattr(snapshot, name)
        np.testing.assert_array_equal(getattr(back, name), values.astype(np.float32), err_msg=name)
    for name in ["film_color", "substrate_color"]:
        assert np.abs(getattr(back, name) - getattr(snapshot, name)).max() <= 0.5 / 255 + 1e-12
    # Two roundings of positions, and a 32-bit normal times a hair of 5e-4.
    bound = 2 * np.spacing(max(1.0, offset)) + 5e-4 * 2.0**-24
    assert np.abs(back.substrate_vertices - snapshot.substrate_vertices).max() <= bound


def test_a_snapshot_without_film_reads_back(tmp_path: Path) -> None:
    snapshot = make_snapshot(lost=2 * 4 * 4)
    back = read_snapshot_ply(write_snapshot_ply(tmp_path, snapshot, "a"))
    assert len(back.film_vertices) == len(back.film_faces) == 0
    assert back.bare.all()


def test_writing_what_was_read_gives_the_same_film_and_scalars(tmp_path: Path) -> None:
    first = write_snapshot_ply(tmp_path, make_snapshot(split_column=1), "first")
    second = write_snapshot_ply(tmp_path, read_snapshot_ply(first), "second")
    a, b = read_ply_arrays(first), read_ply_arrays(second)
    for name in a.vertex:
        if name not in ("x", "y", "z", "nx", "ny", "nz"):
            np.testing.assert_array_equal(a.vertex[name], b.vertex[name], err_msg=name)


def test_metal_lies_under_the_film_everywhere(tmp_path: Path) -> None:
    snapshot = make_snapshot()
    ply = read_ply_arrays(write_snapshot_ply(tmp_path, snapshot, "a"))
    metal = ply.vertex["part"] == 0
    np.testing.assert_allclose(ply.vertex["y"][metal], -hair(snapshot))
    np.testing.assert_array_equal(ply.vertex["y"][~metal], 0.0)
    assert hair(snapshot) == 5e-4


def test_no_metal_shows_through_an_intact_film(tmp_path: Path) -> None:
    """From every side of a box with sharp edges, a ray towards the film meets the film first."""
    pytest.importorskip("embreex")
    box = trimesh.creation.box().subdivide().subdivide()
    snapshot = make_snapshot(mesh=(np.asarray(box.vertices), np.asarray(box.faces, np.int32)))
    ply = read_ply_arrays(write_snapshot_ply(tmp_path, snapshot, "a"))
    mesh = trimesh.Trimesh(ply.vectors("x", "y", "z"), ply.faces, process=False)
    random = np.random.default_rng(1)
    film = random.choice(np.flatnonzero(ply.face["part"] == 1), 5000)
    targets = np.einsum("ni,nij->nj", random.dirichlet([1, 1, 1], len(film)), mesh.triangles[film])
    directions = random.normal(size=targets.shape)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    first = mesh.ray.intersects_first(targets + 5 * directions, -directions)
    assert first.min() >= 0 and (ply.face["part"][first] == 1).all()


def test_a_mesh_that_is_no_snapshot_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    write_example(path)
    with pytest.raises(FormatError):
        read_snapshot_ply(path)


def test_colors_round_to_the_nearest_byte() -> None:
    values = np.array([-1.0, 0.0, 0.5 / 255 - 1e-9, 0.5 / 255 + 1e-9, 1.0, 2.0])
    np.testing.assert_array_equal(color_bytes(values), [0, 0, 0, 1, 255, 255])
