"""A signal ends the process also while the main thread computes and hears of nothing."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

SOURCES = str(Path(__file__).parents[2])
# Two minutes in one call of a library that lets other threads run, while a file is half-written.
PROGRAM = """
import hashlib, sys
from weathercoat.cli.signals import raise_signals
from weathercoat.output.folder import RunFolder, whole_file

raise_signals()
with whole_file("mesh.ply") as stream, RunFolder("run") as folder:
    stream.write(b"half")
    if "checkpoint" in sys.argv:
        (folder / "checkpoint").mkdir()
        (folder / "checkpoint" / "state.npz").write_bytes(b"whole")
    print("ready", flush=True)
    hashlib.pbkdf2_hmac("sha256", b"", b"", 200_000_000)
"""

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")


@pytest.mark.parametrize(
    ("sent", "code", "word"), [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "terminated")]
)
@pytest.mark.parametrize("kept", [False, True])
def test_who_does_not_hear_is_ended(tmp_path: Path, sent: int, code: int, word: str, kept: bool) -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, *(["checkpoint"] if kept else [])],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": SOURCES},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None and process.stdout.readline() == "ready\n"
    time.sleep(0.5)  # until it computes
    process.send_signal(sent)
    process.send_signal(sent)
    _, said = process.communicate(timeout=60)
    assert process.returncode == code
    where = f"; the work so far is kept in {tmp_path}/run.partial" if kept else ""
    assert said == f"weathercoat: {word}{where}\n"
    assert [path.name for path in tmp_path.iterdir()] == (["run.partial"] if kept else [])
