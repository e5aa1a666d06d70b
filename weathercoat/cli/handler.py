"""The one place where an error becomes a line on standard error and an exit code.

0 done, 2 usage or config, 3 to 8 as each error says, 70 internal, 130 interrupted, 141 the reader of standard
output went away, 143 terminated.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import signal
import sys
import traceback
from collections.abc import Sequence
from io import TextIOWrapper
from types import FrameType
from typing import Any, NoReturn

import click

from weathercoat.cli.root import weathercoat
from weathercoat.errors import ConfigError, LimitError, OutputError, UsageError, WeathercoatError

PROGRAM = "weathercoat"
COMPLETION_VARIABLE = "_WEATHERCOAT_COMPLETE"
_INTERRUPTED, _BROKEN_PIPE, _TERMINATED = 130, 141, 143
_DEVICE_ERRORS = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)


class Terminated(BaseException):
    """SIGTERM, as an exception so that whatever is half-written is cleaned up."""


def main() -> NoReturn:
    """The entry point: run the command line of this process and exit."""
    if isinstance(sys.stdout, TextIOWrapper):
        # A path that is no valid text, or a sign that the terminal lacks, is no reason to fail.
        sys.stdout.reconfigure(errors="backslashreplace")
    instruction = os.environ.get(COMPLETION_VARIABLE)
    if instruction:
        from click.shell_completion import shell_complete

        sys.exit(shell_complete(weathercoat, {}, PROGRAM, COMPLETION_VARIABLE, instruction))
    signal.signal(signal.SIGTERM, _raise_terminated)
    sys.exit(call(sys.argv[1:]))


def call(arguments: Sequence[str]) -> int:
    """Run one command line and return its exit code; every error is reported on standard error."""
    try:
        with weathercoat.make_context(PROGRAM, list(arguments)) as context:
            weathercoat.invoke(context)
        sys.stdout.flush()
        return 0
    except click.exceptions.Exit as end:
        return end.exit_code
    except BrokenPipeError:
        # Python flushes standard output once more at exit, which must not fail again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        return _BROKEN_PIPE
    except (KeyboardInterrupt, click.Abort):
        return _stop("interrupted", _INTERRUPTED)
    except Terminated:
        return _stop("terminated", _TERMINATED)
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message(), err=True)
        return error.exit_code
    except Exception as error:
        return _report(error, arguments)


def _as_weathercoat_error(error: Exception) -> WeathercoatError:
    if isinstance(error, WeathercoatError):
        return error
    if isinstance(error, click.ClickException):
        context = getattr(error, "ctx", None)
        path = context.command_path if context else PROGRAM
        message = error.format_message().rstrip(".").replace(". Did", "; did")
        return UsageError(message, remedy=f"see `{path} --help`")
    if isinstance(error, MemoryError):
        return LimitError("out of memory", remedy="ask for fewer faces, or use a machine with more memory")
    if isinstance(error, OSError) and error.errno in _DEVICE_ERRORS:
        return OutputError(str(error.strerror), file=str(error.filename or "standard output"))
    summary = " ".join(f"{type(error).__name__}: {error}".split())
    return WeathercoatError(
        f"internal error, {summary}", remedy="report it with the traceback that --debug prints"
    )


def _report(raised: Exception, arguments: Sequence[str]) -> int:
    options = arguments[: arguments.index("--")] if "--" in arguments else arguments
    if "--debug" in options:
        traceback.print_exception(raised)
    error = _as_weathercoat_error(raised)
    if "--json" in options:
        _say(json.dumps({"error": _as_dict(error)}, ensure_ascii=False))
    else:
        _say("\n".join(f"{PROGRAM}: {line}" for line in error.lines()))
    return error.exit_code


def _as_dict(error: WeathercoatError) -> dict[str, Any]:
    content: dict[str, Any] = {
        "code": error.code,
        "exit_code": error.exit_code,
        "file": error.file,
        "message": error.message,
        "remedy": error.remedy,
    }
    if isinstance(error, ConfigError) and error.problems:
        content["problems"] = [vars(problem) for problem in error.problems]
    return content


def _stop(word: str, code: int) -> int:
    _say(f"{PROGRAM}: {word}")
    return code


def _say(text: str) -> None:
    """Print on standard error; where even that is closed, the exit code has to do."""
    with contextlib.suppress(OSError):
        click.echo(text, err=True)


def _raise_terminated(signum: int, frame: FrameType | None) -> None:
    raise Terminated
