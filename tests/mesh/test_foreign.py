"""Formats that meshio reads: in a process of its own, which can neither hang nor open other files."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.fuzz.seeds import foreign_seeds
from weathercoat.errors import CorruptError, LimitError, SecurityError, UnsupportedError, WeathercoatError
from weathercoat.mesh.formats import foreign
from weathercoat.mesh.read import read_surface

VTK = next(seed.data.decode() for seed in foreign_seeds() if seed.extension == "vtk")
XDMF = (
    '<?xml version="1.0"?><Xdmf Version="3.0"><Domain><Grid Name="g"><Geometry GeometryType="XYZ">'
    '<DataItem DataType="Float" Dimensions="3 3" Format="{format}" Precision="8">{points}</DataItem>'
    '</Geometry><Topology TopologyType="Triangle" NumberOfElements="1"><DataItem DataType="Int" '
    'Dimensions="1 3" Format="XML" Precision="8">0 1 2</DataItem></Topology></Grid></Domain></Xdmf>'
)


def read_text(folder: Path, name: str, text: str) -> int:
    """Read a file of this name and content: the number of faces."""
    (folder / name).write_text(text)
    return len(read_surface(folder / name).faces)


def test_good_files_come_in(tmp_path: Path) -> None:
    for seed in foreign_seeds():
        assert read_text(tmp_path, seed.name, seed.data.decode()) == 2
    points = "0 0 0 1 0 0 0 1 0"
    assert read_text(tmp_path, "a.xdmf", XDMF.format(format="XML", points=points)) == 1


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.inp", "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n*INCLUDE, INPUT={path}\n"),
        ("a.xdmf", XDMF.format(format="Binary", points="{path}")),
        ("a.xdmf", XDMF.format(format="HDF", points="{path}:/points")),
    ],
)
def test_no_other_file_is_opened(tmp_path: Path, name: str, text: str) -> None:
    secret = tmp_path / "secret.inp"
    secret.write_text("*NODE\n1,0,0,0\n")
    with pytest.raises(SecurityError, match=r"secret\.inp"):
        read_text(tmp_path, name, text.format(path=secret))


def test_a_lower_limit_of_memory_stays(tmp_path: Path) -> None:
    path = tmp_path / "a.vtk"
    path.write_text(VTK)
    child = Path(foreign.__file__).with_name("foreign_child.py")
    limited = "import resource as r, runpy; r.setrlimit(r.RLIMIT_AS, (1 << 31, 1 << 31)); "
    limited += f"import sys; sys.argv = ['', {str(path)!r}, {str(tmp_path / 'result.npz')!r}]; "
    limited += f"runpy.run_path({str(child)!r}, run_name='__main__')"
    assert subprocess.run([sys.executable, "-c", limited], check=False).returncode == 0


@pytest.mark.parametrize("count", [5 * 10**8, 10**12])
def test_counts_that_lie_are_refused(tmp_path: Path, count: int) -> None:
    start = time.process_time()
    with pytest.raises(CorruptError, match="MemoryError"):
        read_text(tmp_path, "a.vtk", VTK.replace("POINTS 4", f"POINTS {count}"))
    assert time.process_time() - start < 2.0


def test_what_never_ends_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(foreign, "_MAX_SECONDS", 1.5)
    with pytest.raises(LimitError, match="within"):
        read_text(tmp_path, "a.mdpa", "Begin Nodes\n1 0 0 0\n")


def test_a_process_that_dies_is_an_error_of_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    died = subprocess.CompletedProcess([], -11, b"", b"")
    monkeypatch.setattr(subprocess, "run", lambda *arguments, **options: died)
    with pytest.raises(CorruptError, match="its process ended"):
        read_text(tmp_path, "a.vtk", VTK)


@pytest.mark.parametrize(
    ("name", "text", "error"),
    [
        ("a.vtu", '<?xml version="1.0"?><VTKFile>', CorruptError),
        ("a.nas", "GRID,1,,0.,0.\n", CorruptError),
        ("a.h5m", "\x89HDF\r\n\x1a\n", (UnsupportedError, CorruptError)),
    ],
)
def test_what_meshio_cannot_read(tmp_path: Path, name: str, text: str, error: type[WeathercoatError]) -> None:
    with pytest.raises(error, match="meshio cannot read"):
        read_text(tmp_path, name, text)
