"""What fails from outside: full and broken disks, closed streams, clocks that jump, memory that ends.

After each fault: the documented exit code, one line, and at the target the old result, the new one, or none.
"""

from __future__ import annotations

import builtins
import errno
import hashlib
import io
import itertools
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from weathercoat.cli.handler import call
from weathercoat.mesh.shapes import make_plate
from weathercoat.output.folder import CHECKPOINT_STATE
from weathercoat.output.meshes import write_mesh

ROOT = str(Path(__file__).parents[1])
COMMAND = [sys.executable, "-m", "weathercoat"]
SETTINGS = (
    "remesh=off",
    "ageing.steps=3",
    "snapshots.count=2",
    "checkpoint.steps=1",
    "output.picture_width=16",
    "output.picture_height=16",
)
SMALL = ("-q", "--threads", "1", *(f"--set={setting}" for setting in SETTINGS))
ERRORS = (errno.ENOSPC, errno.EIO, errno.EDQUOT, errno.EROFS)


@pytest.fixture
def model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A plate, in an empty working directory."""
    monkeypatch.chdir(tmp_path)
    write_mesh(tmp_path / "plate.obj", make_plate())
    return tmp_path / "plate.obj"


def digests(folder: Path) -> dict[str, str]:
    """SHA-256 of every file of a run that is the same each time, by name; none where there is no folder."""
    files = sorted(path for path in folder.rglob("*") if path.is_file() and path.name != "timing.json")
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


class Faults:
    """Makes the operation of a number, of all that write below a folder, fail."""

    def __init__(self, folder: Path) -> None:
        self.folder = str(folder)
        self.count = 0
        self.fails = 0
        self.code = errno.ENOSPC

    def begin(self, number: int, code: int) -> None:
        self.count, self.fails, self.code = 0, number, code

    def meet(self, path: object) -> None:
        if str(path).startswith(self.folder):
            self.count += 1
            if self.count == self.fails:
                raise OSError(self.code, os.strerror(self.code), str(path))

    def before(self, function: Callable[..., Any], place: int) -> Callable[..., Any]:
        """The function with a fault before it; the argument at `place` is the path."""

        def faulty(*arguments: Any, **keywords: Any) -> Any:
            self.meet(os.fspath(arguments[place]))
            return function(*arguments, **keywords)

        return faulty

    def open(self, path: Any, mode: str = "r", *rest: Any, **keywords: Any) -> Any:
        """`open`, which meets faults where it opens to write, and at each write."""
        if isinstance(path, int) or not set(mode) & set("wxa+"):
            return OPEN(path, mode, *rest, **keywords)
        self.meet(os.fspath(path))
        return _Stream(OPEN(path, mode, *rest, **keywords), path, self)


OPEN = io.open


class _Stream:
    def __init__(self, stream: Any, path: object, faults: Faults) -> None:
        self._stream, self._path, self._faults = stream, path, faults

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def __enter__(self) -> _Stream:
        return self

    def __exit__(self, *error: object) -> None:
        self._stream.close()

    def write(self, data: Any) -> Any:
        self._faults.meet(self._path)
        return self._stream.write(data)


@pytest.fixture
def faults(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Faults:
    """Faults of all that is done to `out` and what lies beside it with a longer name."""
    made = Faults(tmp_path / "out")
    for name, place in (("mkdir", 0), ("rename", 0), ("replace", 0)):
        monkeypatch.setattr(os, name, made.before(getattr(os, name), place))
    monkeypatch.setattr(io, "open", made.open)
    monkeypatch.setattr(builtins, "open", made.open)
    return made


def check_faults(faults: Faults, every: int, capsys: pytest.CaptureFixture[str], *, has_old: bool) -> None:
    """Run with a fault at each of the operations, or `every` so many of them, by each error in turn."""
    here, run = Path.cwd(), ["run", "standard", "plate.obj", "-o", "out", *SMALL]
    assert call([*run, "--seed", "2"]) == 0
    old = digests(here / "out")
    faults.begin(0, 0)
    assert call([*run, "--overwrite"]) == 0
    new, operations = digests(here / "out"), faults.count
    assert operations > 20 and old != new
    met = 0
    for number, code in zip(range(1, operations, every), itertools.cycle(ERRORS), strict=False):
        faults.begin(0, 0)
        subprocess.run(["rm", "-rf", "out", "out.partial"], check=True)
        if has_old:
            assert call([*run, "--seed", "2"]) == 0
        capsys.readouterr()
        faults.begin(number, code)
        ended = call([*run, "--overwrite"])
        faults.begin(0, 0)
        said = capsys.readouterr().err
        there = digests(here / "out")
        if ended == 0:
            assert there == new and said == "", number
        else:
            met += 1
            assert ended == 7, (number, said)
            assert said.startswith(f"weathercoat: {here / 'out'}: E-OUTPUT: {os.strerror(code)}; "), number
            assert there in (old if has_old else {}, new), number
        rest = {path.name for path in here.iterdir()} - {"plate.obj", "out"}
        assert not rest or (rest == {"out.partial"} and (here / "out.partial" / CHECKPOINT_STATE).is_file())
    assert met > 0


def test_a_failing_disk_leaves_the_old_result(
    model: Path, faults: Faults, capsys: pytest.CaptureFixture[str]
) -> None:
    check_faults(faults, 41, capsys, has_old=True)


@pytest.mark.long
@pytest.mark.parametrize("has_old", [False, True])
def test_a_disk_that_fails_at_any_moment(
    model: Path, faults: Faults, capsys: pytest.CaptureFixture[str], has_old: bool
) -> None:
    check_faults(faults, 3, capsys, has_old=has_old)


def test_a_target_that_becomes_a_file_meanwhile(model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import weathercoat.run

    prepare = weathercoat.run.prepare_simulation

    def disturb(*arguments: Any, **keywords: Any) -> Any:
        Path("out").write_text("mine")
        return prepare(*arguments, **keywords)

    monkeypatch.setattr(weathercoat.run, "prepare_simulation", disturb)
    assert call(["run", "standard", "plate.obj", "-o", "out", *SMALL]) == 7
    assert Path("out").read_text() == "mine"


def jumping(clock: Callable[[], float]) -> Callable[[], float]:
    """A clock that is years ahead, behind, and right, by turns."""
    jumps = itertools.cycle((0.0, 1e9, -1e9, 3.0, -3.0))
    return lambda: clock() + next(jumps)


def test_clocks_that_jump_change_nothing(model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = ["run", "standard", "plate.obj", *SMALL, "--set=checkpoint.minutes=0.001"]
    assert call([*run, "-o", "right"]) == 0
    for name in ("time", "perf_counter", "monotonic", "process_time"):
        monkeypatch.setattr(time, name, jumping(getattr(time, name)))
    assert call([*run, "-o", "jumped", "--log-file", "log"]) == 0
    assert digests(Path("jumped")) == digests(Path("right"))


def run_limited(arguments: list[str], *limits: tuple[str, int], **streams: Any) -> tuple[int, str]:
    """Exit code and standard error of a command under limits of resources."""

    def limit() -> None:
        import resource

        for name, value in limits:
            resource.setrlimit(getattr(resource, name), (value, value))

    done = subprocess.run(
        [*COMMAND, *arguments],
        preexec_fn=limit,
        env={**os.environ, "PYTHONPATH": ROOT},
        **{"stderr": subprocess.PIPE, "stdout": subprocess.DEVNULL, **streams},
        timeout=300,
    )
    return done.returncode, (done.stderr or b"").decode()


needs_linux = pytest.mark.skipif(sys.platform != "linux", reason="limits and devices of Linux")


@needs_linux
def test_a_log_that_cannot_be_written(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The plate has rims, which is a line of the log."""
    run = ["run", "standard", "plate.obj", "-o", "out", *SMALL, "--log-file", "/dev/full"]
    assert call(run) == 7
    line = "/dev/full: E-OUTPUT: the log cannot be written: No space left on device; choose another file"
    assert capsys.readouterr().err == f"weathercoat: {line}\n"
    assert [path.name for path in model.parent.iterdir()] == ["plate.obj"]
    assert call([*run[:2], "missing.obj", *run[3:]]) == 3
    assert "missing.obj: E-ACCESS" in capsys.readouterr().err


@needs_linux
@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", "<&- >&- 2>&-"])
def test_closed_streams_are_no_reason_to_fail(model: Path, closed: str) -> None:
    """Nor may a file that is opened later be taken for one of them."""
    for arguments, code in (("config new made.yaml", 0), ("inspect missing.obj", 3), ("inspect -", 3)):
        if arguments == "inspect -" and "<&-" not in closed:
            continue
        line = f'"{sys.executable}" -m weathercoat {arguments} {closed}'
        done = subprocess.run(["bash", "-c", line], env={**os.environ, "PYTHONPATH": ROOT}, timeout=60)
        assert done.returncode == code, line
    assert "weathercoat:" not in Path("made.yaml").read_text()


@pytest.mark.long
@needs_linux
@pytest.mark.parametrize("size", [0, 100, 2_000, 20_000, 60_000])
def test_files_that_may_not_grow(model: Path, size: int) -> None:
    assert call(["run", "standard", "plate.obj", "-o", "warm", *SMALL]) == 0  # compiles, without limits
    code, said = run_limited(
        ["run", "standard", "plate.obj", "-o", "out", *SMALL], ("RLIMIT_FSIZE", size), stderr=subprocess.PIPE
    )
    assert code in (0, 7), said
    assert (code == 0) == Path("out").is_dir()
    if code == 7:
        assert said.splitlines()[0].startswith(f"weathercoat: {model.parent / 'out'}: E-OUTPUT: ")
    rest = {path.name for path in model.parent.iterdir()} - {"plate.obj", "warm", "out"}
    assert rest <= {"out.partial"}


@pytest.mark.long
@needs_linux
@pytest.mark.parametrize("kind", ["RLIMIT_AS", "RLIMIT_DATA"])
def test_memory_that_ends_is_one_line(model: Path, kind: str) -> None:
    """No signal, traceback or hang, however little there is; and with enough it works."""
    assert call(["run", "standard", "plate.obj", "-o", "warm", *SMALL]) == 0
    codes = []
    for megabytes in (60, 150, 400, 700, 800, 900, 1000, 1200, 1600, 3000):
        run = ["run", "standard", "plate.obj", "-o", f"out{megabytes}", *SMALL]
        code, said = run_limited(run, (kind, megabytes << 20), ("RLIMIT_CORE", 0))
        codes.append(code)
        if code == 0:
            assert Path(f"out{megabytes}", "run.json").is_file()
        else:
            assert (code, said.count("\n")) == (5, 1) and "E-LIMIT" in said, (megabytes, code, said)
    assert codes[0] == 5 and codes[-1] == 0
    left = {path.name for path in Path.cwd().iterdir() if path.name.endswith(".partial")}
    assert not left
