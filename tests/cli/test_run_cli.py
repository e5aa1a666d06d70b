"""Whole runs through the command line as scripts use it: pipes, signals, a full disk, determinism."""

from __future__ import annotations

import gc
import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import weathercoat
from weathercoat.cli import signals
from weathercoat.cli.handler import call
from weathercoat.cli.signals import Interrupted, Stopped, Terminated

COMMAND = [sys.executable, "-m", "weathercoat"]
SOURCES = str(Path(weathercoat.__file__).parents[1])
SMALL = ["--faces", "300", "--steps", "20", "--set", "snapshots.count=2"]
SMALL += ["--set", "output.picture_width=32", "--set", "output.picture_height=24"]


def command(*arguments: str, cwd: Path | None = None, **environment: str) -> subprocess.CompletedProcess[str]:
    """A command line in a process of its own."""
    return subprocess.run(
        [*COMMAND, *arguments],
        capture_output=True,
        text=True,
        cwd=cwd,
        env={**os.environ, "PYTHONPATH": SOURCES, **environment},
    )


def digests(folder: Path) -> dict[str, str]:
    """SHA-256 of every file of a run that is promised to be the same every time."""
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != "timing.json"
    }


@pytest.fixture
def sign(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    assert call(["sample", "sign", "-o", "sign.obj"]) == 0
    return tmp_path / "sign.obj"


@pytest.mark.long
def test_same_input_and_seed_give_the_same_bytes(sign: Path, tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    assert call(["run", "crackle", "sign.obj", "-o", "a", "-q", *SMALL]) == 0
    arguments = ["run", "crackle", str(sign), "-o", str(tmp_path / "b"), "-q", *SMALL]
    other = {"PYTHONHASHSEED": "77", "NUMBA_NUM_THREADS": "2", "TZ": "Asia/Tokyo", "LC_ALL": "C"}
    assert command(*arguments, cwd=elsewhere, **other).returncode == 0
    assert digests(tmp_path / "a") == digests(tmp_path / "b")
    assert call(["run", "crackle", "sign.obj", "-o", "c", "-q", "--seed", "2", *SMALL]) == 0
    assert (
        digests(tmp_path / "a")["snapshots/step_0020.ply"]
        != digests(tmp_path / "c")["snapshots/step_0020.ply"]
    )


@pytest.mark.long
def test_a_model_from_a_pipe_gives_the_same_snapshots(sign: Path, tmp_path: Path) -> None:
    sampled = subprocess.Popen(
        [*COMMAND, "sample", "sign", "-o", "-"],
        stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": SOURCES},
    )
    run = subprocess.run(
        [*COMMAND, "run", "crackle", "-", "--format", "obj", "-o", "piped", "--quiet", *SMALL],
        stdin=sampled.stdout,
        capture_output=True,
        env={**os.environ, "PYTHONPATH": SOURCES},
    )
    assert (sampled.wait(), run.returncode, run.stdout, run.stderr) == (0, 0, b"", b"")
    assert call(["run", "crackle", "sign.obj", "-o", "direct", "-q", *SMALL]) == 0
    piped, direct = digests(tmp_path / "piped"), digests(tmp_path / "direct")
    for name in ("run.json", "checkpoint/state.npz", "checkpoint/surface.npz"):
        assert piped.pop(name) != direct.pop(name)  # they name their inputs
    assert piped == direct


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="limits of the file size are those of Linux")
def test_a_full_disk_leaves_nothing(sign: Path, tmp_path: Path) -> None:
    import resource

    # so that the limit does not meet the files of compiled kernels
    assert call(["run", "crackle", "sign.obj", "-o", "first", "-q", *SMALL]) == 0
    done = subprocess.run(
        [*COMMAND, "run", "crackle", "sign.obj", "-o", "out", "-q", *SMALL],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": SOURCES},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (8192, 8192)),
    )
    assert done.returncode == 7, done.stderr
    assert done.stderr.startswith(f"weathercoat: {tmp_path / 'out'}: E-OUTPUT: ")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["first", "sign.obj"]


@pytest.mark.long
def test_json_is_all_of_standard_output(sign: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert call(["run", "crackle", "sign.obj", "-o", "out", "--json", *SMALL]) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    assert [row["step"] for row in json.loads(captured.out)["snapshots"]] == [10, 20]


def test_quiet_prints_nothing_and_the_log_file_has_the_notes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert call(["sample", "plate"]) == 0
    capsys.readouterr()
    arguments = ["run", "standard", "plate.obj", "-o", "out", "--quiet", "--log-file", "log", "--steps", "1"]
    assert call([*arguments, "--set", "remesh=off", "--set", "output.preview=false"]) == 0
    captured = capsys.readouterr()
    assert (captured.out, captured.err) == ("", "")
    assert "plate.obj: W-BOUNDARY(4): " in Path("log").read_text()


def test_strict_names_the_first_note_and_writes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert call(["sample", "plate"]) == 0
    assert call(["run", "standard", "plate.obj", "-o", "out", "--strict", "--quiet"]) == 4
    assert capsys.readouterr().err.startswith("weathercoat: plate.obj: E-STRICT: W-BOUNDARY(4): ")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["plate.obj"]


def test_errors_of_remeshing_name_the_model(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Long thin faces side by side would need more faces than the limit."""
    monkeypatch.chdir(tmp_path)
    rows = [f"v 0 {i} 0\nv 1e6 {i} 0\n" for i in range(41)]
    rows += [f"f {i} {i + 1} {i + 3} {i + 2}\n" for i in range(1, 81, 2)]
    Path("strip.obj").write_text("".join(rows))
    for arguments in (["run", "standard", "strip.obj"], ["remesh", "strip.obj", "-o", "fine.obj"]):
        assert call([*arguments, "--faces", "2000", "-q"]) == 5
        assert capsys.readouterr().err.startswith("weathercoat: strip.obj: E-LIMIT: edges of ")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["strip.obj"]


@pytest.mark.long
@pytest.mark.parametrize("suffix", ["obj", "ply", "stl", "off", "glb"])
def test_remeshed_files_stand_upright(
    suffix: str, sign: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The sign is 0.7 high in every format, and as thick as before across, also on the way back to OBJ."""
    there = f"there.{suffix}"
    assert call(["remesh", "sign.obj", "-o", there, "--faces", "300", "--quiet"]) == 0
    assert call(["remesh", there, "-o", "back.obj", "--faces", "300", "--quiet"]) == 0
    for file in (there, "back.obj"):
        capsys.readouterr()
        assert call(["inspect", file, "--json"]) == 0
        found = json.loads(capsys.readouterr().out)
        low, high = found["bounding_box"]
        extent = [b - a for a, b in zip(low, high, strict=True)]
        upwards = found["up"].index(1.0)
        assert upwards == (1 if file.endswith(("obj", "glb")) else 2)
        assert extent[0] == pytest.approx(1.0) and extent[upwards] == pytest.approx(0.7)
        assert extent[3 - upwards] == pytest.approx(0.02, abs=1e-6)
        assert low[upwards] == pytest.approx(0.0, abs=1e-6)  # turned, not mirrored


def test_signals_raise_and_ignored_ones_stay_ignored(restored_signals: None) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signals.raise_signals()
    assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    with pytest.raises(Terminated):
        signal.raise_signal(signal.SIGTERM)


def test_a_second_signal_does_not_disturb_what_the_first_has_begun(restored_signals: None) -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    signals.raise_signals()
    try:
        signal.raise_signal(signal.SIGINT)
    except Interrupted:
        signal.raise_signal(signal.SIGINT)
    else:
        pytest.fail("the first one did not raise")


@pytest.mark.parametrize(("number", "kind"), [(signal.SIGINT, Interrupted), (signal.SIGTERM, Terminated)])
def test_a_signal_that_is_lost_in_a_callback_comes_again(
    restored_signals: None, number: int, kind: type[Stopped]
) -> None:
    """Finalisers are like the compiler's callbacks: what is raised in them goes nowhere."""

    class Finalised:
        def __del__(self) -> None:
            signal.raise_signal(number)

    signal.signal(number, signal.SIG_DFL)
    signals.raise_signals()
    with pytest.raises(kind):
        Finalised()
        gc.collect()
        deadline = time.monotonic() + 30
        while time.monotonic() < deadline:
            time.sleep(0.01)


def test_other_lost_exceptions_are_shown(restored_signals: None, capsys: pytest.CaptureFixture[str]) -> None:
    class Finalised:
        def __del__(self) -> None:
            raise ValueError("in a finaliser")

    signals.raise_signals()
    Finalised()
    gc.collect()
    assert "ValueError: in a finaliser" in capsys.readouterr().err


@pytest.fixture
def restored_signals(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    # the watchdog would end the tests where the machine is busy
    monkeypatch.setattr("weathercoat.cli.watchdog.SECONDS_TO_BE_HEARD", 60.0)
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    hook = sys.unraisablehook
    yield
    signal.set_wakeup_fd(-1)
    sys.unraisablehook = hook
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_an_interrupt_while_modules_load_is_one_line() -> None:
    program = (
        "import os, signal, sys\n"
        "class Finder:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'click': os.kill(os.getpid(), signal.SIGINT)\n"
        "sys.meta_path.insert(0, Finder())\n"
        "from weathercoat.cli import main\n"
        "main()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": SOURCES},
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "weathercoat: interrupted\n")
