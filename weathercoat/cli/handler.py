"""The one place where an error becomes a line on standard error and an exit code.

0 done, 2 usage or config, 3 to 8 as each error says, 70 internal, 130 interrupted, 141 the reader of standard
output went away, 143 terminated.
"""

from __future__ import annotations

import contextlib
import json
import os
import sys
import traceback
from collections.abc import Sequence
from io import TextIOWrapper

import click

from weathercoat.cli.root import weathercoat
from weathercoat.cli.signals import Interrupted, Stopped
from weathercoat.errors import UsageError, WeathercoatError, internal_error

PROGRAM = "weathercoat"
COMPLETION_VARIABLE = "_WEATHERCOAT_COMPLETE"
_BROKEN_PIPE = 141


def run() -> int:
    """Run the command line of this process and return its exit code."""
    if isinstance(sys.stdout, TextIOWrapper):
        # A path that is no valid text, or a sign that the terminal lacks, is no reason to fail.
        sys.stdout.reconfigure(errors="backslashreplace")
    instruction = os.environ.get(COMPLETION_VARIABLE)
    if instruction:
        from click.shell_completion import shell_complete

        return shell_complete(weathercoat, {}, PROGRAM, COMPLETION_VARIABLE, instruction)
    return call(sys.argv[1:])


def call(arguments: Sequence[str]) -> int:
    """Run one command line and return its exit code; every error is reported on standard error."""
    try:
        with weathercoat.make_context(PROGRAM, list(arguments), obj=list(arguments)) as context:
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
        return _stop(Interrupted())
    except Stopped as stopped:
        return _stop(stopped)
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
    return internal_error(error)


def _report(raised: Exception, arguments: Sequence[str]) -> int:
    options = arguments[: arguments.index("--")] if "--" in arguments else arguments
    if "--debug" in options:
        traceback.print_exception(raised)
    error = _as_weathercoat_error(raised)
    if "--json" in options:
        notes = {"notes": _notes(raised)} if _notes(raised) else {}
        _say(json.dumps({"error": {**error.as_dict(), **notes}}, ensure_ascii=False))
    else:
        _say("\n".join(f"{PROGRAM}: {line}" for line in [*error.lines(), *_notes(raised)]))
    return error.exit_code


def _stop(stopped: Stopped) -> int:
    _say("; ".join([f"{PROGRAM}: {stopped.word}", *_notes(stopped)]))
    return stopped.exit_code


def _notes(error: BaseException) -> list[str]:
    """What was noted on the way out, such as where finished work is kept."""
    return list(getattr(error, "__notes__", []))


def _say(text: str) -> None:
    """Print on standard error; where even that is closed, the exit code has to do."""
    with contextlib.suppress(OSError):
        click.echo(text, err=True)
