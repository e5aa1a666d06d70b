"""Every ending of a command: one line on standard error, the right exit code, nothing half-written."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import click
import pytest

from weathercoat.cli.handler import call
from weathercoat.cli.root import weathercoat
from weathercoat.cli.signals import Terminated
from weathercoat.errors import CheckError, FormatError, WeathercoatError

COMMAND = [sys.executable, "-m", "weathercoat"]


@pytest.fixture
def failing(monkeypatch: pytest.MonkeyPatch) -> Callable[[BaseException], None]:
    """Make `weathercoat fail` raise what is given."""

    def arrange(error: BaseException) -> None:
        @click.command()
        @click.option("--json", is_flag=True)
        @click.option("--debug", is_flag=True)
        def fail(json: bool, debug: bool) -> None:
            raise error

        monkeypatch.setattr(weathercoat, "get_command", lambda ctx, name: fail)

    return arrange


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (
            FormatError("looks like HTML", file="a.obj", remedy="supported: OBJ"),
            3,
            "a.obj: E-FORMAT: looks like HTML; supported: OBJ",
        ),
        (CheckError("flipped", remedy="none"), 6, "E-CHECK: flipped; none"),
        (click.UsageError("no such thing."), 2, "E-USAGE: no such thing; see `weathercoat fail --help`"),
        *(
            (error, 5, "E-LIMIT: out of memory; ask for fewer faces, or use a machine with more memory")
            for error in (
                MemoryError(),
                OSError(errno.ENOMEM, "Cannot allocate memory"),
                RuntimeError("can't start new thread"),
                ImportError("libgfortran.so.5: failed to map segment from shared object"),
            )
        ),
        (
            OSError(errno.ENOSPC, "No space left on device", "x.ply"),
            7,
            "x.ply: E-OUTPUT: No space left on device; choose another folder with -o",
        ),
        (
            KeyError("a\nb"),
            70,
            "E-INTERNAL: internal error, KeyError: 'a\\nb'; report it with the traceback that --debug prints",
        ),
        (KeyboardInterrupt(), 130, "interrupted"),
        (click.Abort(), 130, "interrupted"),
        (Terminated(), 143, "terminated"),
    ],
)
def test_one_line_and_a_code(
    failing: Callable[[BaseException], None],
    capsys: pytest.CaptureFixture[str],
    error: BaseException,
    code: int,
    line: str,
) -> None:
    failing(error)
    assert call(["fail"]) == code
    captured = capsys.readouterr()
    assert captured.err == f"weathercoat: {line}\n"
    assert captured.out == ""


def test_json_errors_are_one_object_on_standard_error(
    failing: Callable[[BaseException], None], capsys: pytest.CaptureFixture[str]
) -> None:
    failing(FormatError("looks like HTML", file="a.obj", remedy="supported: OBJ"))
    assert call(["fail", "--json"]) == 3
    captured = capsys.readouterr()
    assert captured.out == ""
    assert json.loads(captured.err)["error"] == {
        "code": "E-FORMAT",
        "exit_code": 3,
        "file": "a.obj",
        "message": "looks like HTML",
        "remedy": "supported: OBJ",
    }


def test_config_problems_are_lines_and_json_rows(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "c.yaml"
    file.write_text("seed: -1\nlift: {sum: x}\n")
    assert call(["config", "check", str(file)]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert lines == [
        f"weathercoat: {file}:1: E-CONFIG: seed: must be at least 0, not -1",
        f"weathercoat: {file}:2: E-CONFIG: lift.sum: must be per_valence or plain, not 'x'",
    ]
    assert call(["config", "check", "--json", str(file)]) == 2
    problems = json.loads(capsys.readouterr().err)["error"]["problems"]
    assert problems[0] == {
        "where": str(file),
        "line": 1,
        "key": "seed",
        "what": "must be at least 0, not -1",
    }


def test_traceback_only_with_debug(
    failing: Callable[[BaseException], None], capsys: pytest.CaptureFixture[str]
) -> None:
    failing(ZeroDivisionError("x"))
    assert call(["fail"]) == 70
    assert "Traceback" not in capsys.readouterr().err
    assert call(["fail", "--debug"]) == 70
    assert "Traceback" in capsys.readouterr().err


def test_every_error_has_a_code_and_an_exit_code_of_the_table() -> None:
    def family(kind: type[WeathercoatError]) -> list[type[WeathercoatError]]:
        return [kind, *(member for child in kind.__subclasses__() for member in family(child))]

    for kind in family(WeathercoatError):
        assert kind.exit_code in (2, 3, 4, 5, 6, 7, 8, 70), kind
        assert kind.code.startswith("E-"), kind


@pytest.mark.parametrize(
    "arguments", [["frob"], ["run", "--frob"], ["run"], ["config", "frob"], ["sample", "frob"], ["--frob"]]
)
def test_usage_errors(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert call(arguments) == 2
    error = capsys.readouterr().err
    assert error.startswith("weathercoat: E-USAGE: ") and error.count("\n") == 1
    assert "--help`" in error


@pytest.mark.parametrize("arguments", [[], ["config"], ["sample"]])
def test_nothing_asked_shows_the_help(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert call(arguments) == 2
    assert "Usage: weathercoat" in capsys.readouterr().err


def test_a_broken_pipe_is_quiet() -> None:
    process = subprocess.Popen(
        [*COMMAND, "config", "schema"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None and process.stderr is not None
    process.stdout.close()
    assert process.stderr.read() == ""
    assert process.wait() == 141
    process.stderr.close()


def test_signs_that_standard_output_lacks_are_escaped() -> None:
    done = subprocess.run(
        [*COMMAND, "config", "schema"],
        capture_output=True,
        check=True,
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
    )
    assert json.loads(done.stdout)["title"] == "weathercoat config"


@pytest.mark.skipif(sys.platform != "linux", reason="file names that are no text")
def test_a_path_that_is_no_text(tmp_path: Path) -> None:
    path = os.fsencode(tmp_path) + b"/\xff.obj"
    done = subprocess.run([*COMMAND, "sample", "plate", "-o", path], capture_output=True, check=True)
    assert Path(os.fsdecode(path)).exists()
    assert done.stdout.endswith(b"\\udcff.obj\n")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
def test_a_full_standard_output_is_an_output_error() -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run([*COMMAND, "config", "schema"], stdout=full, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 7
    assert done.stderr.startswith("weathercoat: standard output: E-OUTPUT: No space left")
    assert done.stderr.count("\n") == 1


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
@pytest.mark.parametrize(
    ("sent", "code", "word"), [(signal.SIGTERM, 143, "terminated"), (signal.SIGINT, 130, "interrupted")]
)
def test_signals_end_a_run_cleanly(tmp_path: Path, sent: int, code: int, word: str) -> None:
    """The run waits for a model on standard input, with its temporary folder already there."""
    process = subprocess.Popen(
        [*COMMAND, "run", "standard", "-", "--format", "obj", "-o", str(tmp_path / "out")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + 120
    while not list(tmp_path.iterdir()) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert list(tmp_path.iterdir()), "the run did not begin"
    process.send_signal(sent)
    output, error = process.communicate(timeout=60)
    assert (process.returncode, output, error) == (code, "", f"weathercoat: {word}\n")
    assert list(tmp_path.iterdir()) == []
