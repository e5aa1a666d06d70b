"""Signals while a run makes its steps: it ends one, keeps its state, and says how to go on."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from weathercoat.cli.signals import Interrupted, Patience, Terminated, raise_signals
from weathercoat.mesh.shapes import make_random_sheet
from weathercoat.output.meshes import write_mesh

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
COMMAND = [sys.executable, "-m", "weathercoat"]


@pytest.fixture
def handlers(monkeypatch: pytest.MonkeyPatch) -> object:
    """The handlers of a process that raises signals; what was there comes back."""
    # the watchdog would end the tests where the machine is busy
    monkeypatch.setattr("weathercoat.cli.watchdog.SECONDS_TO_BE_HEARD", 60.0)
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    hook = sys.unraisablehook
    raise_signals()
    yield before
    signal.set_wakeup_fd(-1)
    sys.unraisablehook = hook
    for number, handler in before.items():
        signal.signal(number, handler)


def test_a_signal_waits_for_the_end_of_a_step(handlers: object) -> None:
    seen, raising = [], signal.getsignal(signal.SIGTERM)
    with pytest.raises(Interrupted), Patience() as patience:
        assert not patience.is_asked
        os.kill(os.getpid(), signal.SIGINT)
        seen.append(patience.is_asked)
        patience.stop()
    assert seen == [True]
    assert signal.getsignal(signal.SIGTERM) is raising  # as before, at once


def test_a_signal_waits_only_so_long(handlers: object) -> None:
    with pytest.raises(Terminated), Patience():
        os.kill(os.getpid(), signal.SIGTERM)
        deadline = time.monotonic() + 60
        while time.monotonic() < deadline:
            pass
        raise AssertionError("it waited for ever")


def test_a_second_signal_does_not_wait(handlers: object) -> None:
    with pytest.raises(Interrupted), Patience():
        os.kill(os.getpid(), signal.SIGINT)
        os.kill(os.getpid(), signal.SIGINT)
        raise AssertionError("the second one waited")


def test_a_signal_after_the_last_step_is_not_lost(handlers: object) -> None:
    with pytest.raises(Interrupted), Patience():
        os.kill(os.getpid(), signal.SIGINT)


def test_an_error_goes_before_a_signal(handlers: object) -> None:
    with pytest.raises(ZeroDivisionError), Patience():
        os.kill(os.getpid(), signal.SIGINT)
        raise ZeroDivisionError


def test_patience_leaves_other_programs_handlers_alone() -> None:
    before = signal.getsignal(signal.SIGINT)
    with Patience():
        assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.parametrize(
    ("sent", "code", "word"), [(signal.SIGTERM, 143, "terminated"), (signal.SIGINT, 130, "interrupted")]
)
def test_an_interrupted_run_prints_the_command_that_goes_on(
    tmp_path: Path, sent: int, code: int, word: str
) -> None:
    """A run is stopped once it makes steps, goes on as it says, and is stopped again."""
    write_mesh(tmp_path / "my plate.ply", make_random_sheet(faces=200))
    settings = ["remesh=off", "ageing.steps=10000000", "snapshots.count=1", "checkpoint.steps=20"]
    command = [*COMMAND, "run", "standard", "my plate.ply", "-o", "out", "--quiet"]
    command += [word for setting in settings for word in ("--set", setting)]
    partial = tmp_path / "out.partial"
    state = partial / "checkpoint" / "state.npz"
    for _ in range(2):
        before = state.stat().st_mtime_ns if state.exists() else 0
        process = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
        deadline = time.monotonic() + 120
        while not (state.exists() and state.stat().st_mtime_ns > before) and time.monotonic() < deadline:
            time.sleep(0.02)
        process.send_signal(sent)
        _, error = process.communicate(timeout=60)
        assert process.returncode == code
        said, _, again = error.partition("; go on with: ")
        assert said == f"weathercoat: {word}; the work so far is kept in {partial}"
        words = shlex.split(again)
        assert words[:3] == ["weathercoat", "run", "--resume"]
        command = [*COMMAND, *words[1:]]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["my plate.ply", "out.partial"]
