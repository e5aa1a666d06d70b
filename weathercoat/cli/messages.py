"""What a long command says while it works: lines and a progress bar on standard error, and a log file."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any

import click

from weathercoat.errors import OutputError, WeathercoatError


class Messages:
    """Context manager whose `log` and `progress` are handed to the work.

    quiet: nothing goes to standard error. log_file: gets every message with its time, and the error that ends
    the work; it is begun anew. The bar appears on a terminal only. Raises OutputError for a file that cannot
    be written.
    """

    def __init__(self, *, quiet: bool, log_file: Path | None = None) -> None:
        self._quiet = quiet
        self._log_file = log_file
        self._has_bar = not quiet and sys.stderr.isatty()
        self._bar: Any = None

    def __enter__(self) -> Messages:
        if self._log_file is not None:
            with self._log_errors():
                self._log = self._log_file.open("w", encoding="utf-8")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.close()
        if self._log_file is not None:
            if error is not None:
                lines = (
                    error.lines()
                    if isinstance(error, WeathercoatError)
                    else [f"{type(error).__name__}: {error}".removesuffix(": ")]
                )
                with contextlib.suppress(OutputError):  # the error itself is what counts
                    self._write(*lines)
            with contextlib.suppress(OSError):  # what could not be written has been reported
                self._log.close()

    def log(self, text: str) -> None:
        """Say one line."""
        if self._log_file is not None:
            self._write(text)
        if self._quiet:
            return
        if self._bar is not None:
            self._bar.clear()
        click.echo(f"weathercoat: {text}", err=True)

    def progress(self, done: int, total: int) -> None:
        """Show that `done` of `total` steps are done."""
        if not self._has_bar:
            return
        if self._bar is None:
            from tqdm import tqdm

            self._bar = tqdm(total=total, unit="step", leave=False, file=sys.stderr)
        self._bar.update(done - self._bar.n)

    def share(self, done: float, what: str) -> None:
        """Show that a share of all work is done; what: a few words, such as how many of how many jobs."""
        if not self._has_bar:
            return
        if self._bar is None:
            from tqdm import tqdm

            form = "{percentage:3.0f}%|{bar}| {desc} [{elapsed}<{remaining}]"
            self._bar = tqdm(total=1.0, leave=False, file=sys.stderr, bar_format=form)
        self._bar.set_description_str(what, refresh=False)
        self._bar.update(done - self._bar.n)

    def _write(self, *lines: str) -> None:
        now = time.strftime("%Y-%m-%d %H:%M:%S")
        with self._log_errors():
            self._log.writelines(f"{now} {line}\n" for line in lines)
            self._log.flush()

    @contextlib.contextmanager
    def _log_errors(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise OutputError(
                f"the log cannot be written: {error.strerror}",
                file=str(self._log_file),
                remedy="choose another file",
            ) from error
