"""The folder of a run: it appears at its place whole or not at all, and reads back for `render`.

What lies in it:

    run.json        config, versions, inputs, notes and figures; the same bytes for the same input and seed
    timing.json     seconds by stage; the only file that differs from run to run
    severity.csv    percent, sizes and grades of each snapshot, of the whole, each group and each part
    preview.png     contact sheet over time
    view.html       a page that shows the run, where output.viewer asks for it
    snapshots/      step_0100.ply and step_0100.glb for each recorded step
    checkpoint/     what `run --resume` goes on from (see `output.checkpoints`)
    untouched.ply   the parts that carry no paint, where there are any; each GLB holds them as well
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import os
import re
import secrets
import shutil
import unicodedata
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

from weathercoat import unfinished
from weathercoat.errors import (
    AccessError,
    CheckError,
    CorruptError,
    FormatError,
    OutputBusyError,
    OutputError,
    OutputExistsError,
)
from weathercoat.lock import LOCK, FolderLock
from weathercoat.output.exchange import exchange
from weathercoat.sim.snapshot import Snapshot

REPORT, TIMING, PREVIEW, SNAPSHOTS = "run.json", "timing.json", "preview.png", "snapshots"
UNTOUCHED, SEVERITY, CHECKPOINT = "untouched.ply", "severity.csv", "checkpoint"
VIEWER = "view.html"
CHECKPOINT_STATE = f"{CHECKPOINT}/state.npz"  # there is nothing to go on from without it
LONGEST_NAME = 255
DEVICE_NAMES = re.compile(r"(?i)(con|prn|aux|nul|com\d|lpt\d)(\..*)?")  # no files on Windows
DEVICE_ERRORS = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO}


class RunFolder:
    """Context manager that gives a working folder, which becomes `target` when the block ends well.

    The working folder is `TARGET.partial`, beside the target and so on its file system. One process at a time
    has it; what a process that was killed left there is cleared away. After an exception it is removed,
    unless it holds a checkpoint to go on from (`is_kept`): such a one is only taken over with `resume`, or
    begun anew with `overwrite`. A result that failed its checks is no good to go on from.

    An existing target is refused with OutputExistsError before any work; with `overwrite` or `resume` it is
    replaced at the end, and only if it holds the file `marker`, as the folder of a run does, or nothing.
    OutputError where the target cannot be written, also for a write that fails inside the block because the
    disk is full, and OutputBusyError where another process is writing it.
    """

    def __init__(
        self, target: Path | str, *, overwrite: bool = False, resume: bool = False, marker: str = REPORT
    ) -> None:
        self.target = _resolved(target)
        self.path = self.target.with_name(_cut(self.target.name, ".partial", self.target.name))
        self.overwrite = overwrite
        self.resume = resume
        self.marker = marker
        self.is_kept = False
        self._is_wanted = True
        self._check_target()
        self._check_parent()
        if not (resume or overwrite):
            self._check_interrupted()

    def __enter__(self) -> Path:
        self._lock = FolderLock(self.path)
        try:
            with output_errors(self.target):
                if self.path.is_dir() and not (self.path / LOCK).exists() and any(self.path.iterdir()):
                    reason = f"{self.path.name} is in the way"
                    raise OutputError(reason, file=str(self.target), remedy="move it")
                self.path.mkdir(exist_ok=True)
                if not self._lock.take():
                    raise OutputBusyError("another process is writing it", file=str(self.target))
            if not self.resume:
                if not self.overwrite:
                    self._check_interrupted()
                self.clear()
            unfinished.begin(self._give_up)
        except BaseException:
            self._lock.release(remove=not (self.path / CHECKPOINT_STATE).is_file())
            with contextlib.suppress(OSError):
                self.path.rmdir()  # only if it is empty
            raise
        return self.path

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        try:
            if error is None and self._is_wanted:
                self._put_in_place()
            elif isinstance(error, OSError) and self._is_about_output(error):
                raise OutputError(_reason(error), file=str(self.target)) from error
        finally:
            was_stopped = error is not None and not isinstance(error, CheckError)
            self.is_kept = was_stopped and (self.path / CHECKPOINT_STATE).is_file()
            if self.path.is_dir() and not self.is_kept:
                shutil.rmtree(self.path, ignore_errors=True)
            self._lock.release(remove=not self.is_kept)
            unfinished.end(self._give_up)

    def _give_up(self, told: list[str]) -> str | None:
        """Clear away as `__exit__` does after a signal, at a moment when that does not come."""
        if (self.path / CHECKPOINT_STATE).is_file():
            return kept_in(self.path)
        shutil.rmtree(self.path, ignore_errors=True)
        return None

    def abandon(self) -> None:
        """Let the end of the block leave the target as it is."""
        self._is_wanted = False

    def clear(self) -> None:
        """Empty the working folder."""
        with output_errors(self.target):
            for entry in self.path.iterdir():
                if entry.is_dir() and not entry.is_symlink():
                    shutil.rmtree(entry)
                elif entry.name != LOCK:
                    entry.unlink()

    def _check_target(self) -> None:
        if not os.path.lexists(self.target):
            return
        if not self.target.is_dir():
            raise OutputError("is a file, not a folder", file=str(self.target))
        if not (self.overwrite or self.resume):
            raise OutputExistsError("the folder exists", file=str(self.target))
        with output_errors(self.target):
            is_run = (self.target / self.marker).is_file() or not any(self.target.iterdir())
        if not is_run:
            raise OutputError(
                f"holds no {self.marker}, so it is not overwritten",
                file=str(self.target),
                remedy="choose another folder",
            )

    def _check_parent(self) -> None:
        parent = self.target.parent
        if not parent.is_dir():
            raise OutputError(f"there is no folder {parent}", file=str(self.target), remedy="create it first")
        if not os.access(parent, os.W_OK | os.X_OK):
            raise OutputError(f"the folder {parent} is not writable", file=str(self.target))

    def _check_interrupted(self) -> None:
        if (self.path / CHECKPOINT_STATE).is_file():
            raise OutputExistsError(
                f"{self.path.name} holds an interrupted run",
                file=str(self.target),
                remedy="go on with --resume, or begin anew with --overwrite",
            )

    def _is_about_output(self, error: OSError) -> bool:
        inside = isinstance(error.filename, str) and Path(error.filename).is_relative_to(self.path)
        return inside or error.errno in DEVICE_ERRORS

    def _put_in_place(self) -> None:
        """Rename the whole folder to the target; what was there goes only once the new one is in place."""
        self._check_target()
        with output_errors(self.target):
            (self.path / LOCK).unlink()
            if not self.target.is_dir():
                self.path.rename(self.target)
                return
            old = _aside(self.target)
            if exchange(self.path, self.target):
                self.path.rename(old)
            else:
                self.target.rename(old)
                try:
                    self.path.rename(self.target)
                except BaseException:
                    old.rename(self.target)
                    raise
        shutil.rmtree(old, ignore_errors=True)


def kept_in(path: Path) -> str:
    """What to tell of a working folder that holds a checkpoint."""
    return f"the work so far is kept in {path}"


@contextlib.contextmanager
def whole_file(target: Path | str, *, overwrite: bool = False) -> Iterator[BinaryIO]:
    """A binary stream that becomes the file `target` when the block ends without an error.

    A device or pipe is written directly. Raises OutputExistsError for a file that exists, unless `overwrite`,
    and OutputError where the target cannot be written, also for a full disk inside the block.
    """
    path = _resolved(target)
    if path.is_dir():
        raise OutputError("is a folder", file=str(path), remedy="give the name of a file")
    if os.path.lexists(path) and not path.is_file():
        with output_errors(path), path.open("wb") as stream:
            yield stream
        return
    if path.is_file() and not overwrite:
        raise OutputExistsError(
            "the file exists", file=str(path), remedy="choose another, or give --overwrite"
        )
    aside = _aside(path)

    def give_up(told: list[str]) -> None:
        aside.unlink(missing_ok=True)

    unfinished.begin(give_up)
    try:
        with output_errors(path):
            with aside.open("xb") as stream:
                yield stream
            aside.replace(path)
    finally:
        aside.unlink(missing_ok=True)
        unfinished.end(give_up)


def safe_name(text: str, suffix: str = "") -> str:
    """A file name made of any text, such as the stem of a model's path, followed by `suffix`.

    Keeps letters, digits and marks of all scripts and ` -_.+`; everything else becomes `_`, and leading dots
    and dashes go. At most 255 bytes in UTF-8: longer text is cut, and a hash of the whole keeps names apart.
    """
    normal = unicodedata.normalize("NFC", text)
    kept = "".join(c if unicodedata.category(c)[0] in "LNM" or c in " -_.+" else "_" for c in normal)
    name = kept.strip(" .-") or "model"
    if DEVICE_NAMES.fullmatch(name):
        name = f"_{name}"
    return _cut(name, suffix, text)


def snapshot_stem(step: int, steps: int) -> str:
    """Name of a snapshot's files without extension; sorted by name they are in order of time."""
    return f"step_{step:0{max(4, len(str(steps)))}d}"


def read_report(path: Path | str) -> dict[str, Any]:
    """The report of the finished run in a folder.

    Raises AccessError where there is no such folder or report, CorruptError where the report is broken.
    """
    folder = Path(path)
    if not os.path.isdir(folder):  # noqa: PTH112 (any text will do)
        raise AccessError(
            "there is no such folder", file=str(folder), remedy="give the folder of a finished run"
        )
    try:
        text = (folder / REPORT).read_bytes()
    except OSError as error:
        reason = f"{REPORT}: {error.strerror}"
        raise AccessError(reason, file=str(folder), remedy="give the folder of a finished run") from error
    try:
        report = json.loads(text)
    except ValueError as error:
        raise CorruptError("no valid JSON", file=str(folder / REPORT), remedy="run again") from error
    if not isinstance(report, dict):
        raise CorruptError("no JSON object", file=str(folder / REPORT), remedy="run again")
    return report


def snapshot_files(path: Path | str) -> dict[int, Path]:
    """The PLY snapshots of the finished run in a folder, by step, in order of time.

    Raises FormatError where the run wrote none.
    """
    folder = Path(path)
    files = {int(file.stem.rpartition("_")[2]): file for file in (folder / SNAPSHOTS).glob("step_*.ply")}
    if not files:
        raise FormatError(
            "the run holds no PLY snapshots", file=str(folder), remedy="run again with PLY output"
        )
    return dict(sorted(files.items()))


def read_run(path: Path | str) -> tuple[dict[str, Any], list[Snapshot]]:
    """Report and snapshots of a finished run, in order of time.

    Raises what `read_report`, `snapshot_files` and `read_snapshot_ply` raise.
    """
    from weathercoat.output.snapshots import read_snapshot_ply

    report = read_report(path)
    return report, [read_snapshot_ply(file) for file in snapshot_files(path).values()]


def _resolved(target: Path | str) -> Path:
    """The target with links followed, so that what a link points to is replaced and not the link."""
    try:
        path = Path(os.path.realpath(target))
        os.lstat(path)
    except FileNotFoundError:
        pass
    except (OSError, ValueError) as error:
        raise OutputError(_reason(error), file=str(target)[:100]) from error
    return path


def _cut(name: str, suffix: str, text: str) -> str:
    """A name and a suffix in at most 255 bytes: of a longer name the beginning, and a hash of `text`."""
    room = LONGEST_NAME - len(suffix.encode())
    content = name.encode("utf-8", "surrogateescape")
    if len(content) > room:
        digest = "-" + hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()[:12]
        name = content[: room - len(digest)].decode("utf-8", "ignore") + digest
    return name + suffix


def _aside(target: Path) -> Path:
    """A new hidden name beside the target, short whatever the target's name."""
    return target.parent / f".weathercoat-{secrets.token_hex(6)}.partial"


@contextlib.contextmanager
def output_errors(target: Path) -> Iterator[None]:
    """OSErrors of the block as OutputError of the target."""
    try:
        yield
    except OSError as error:
        raise OutputError(_reason(error), file=str(target)) from error


def _reason(error: OSError | ValueError) -> str:
    return getattr(error, "strerror", None) or str(error) or "cannot be written"
