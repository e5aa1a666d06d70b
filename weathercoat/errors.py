"""One family of errors; each class owns its exit code and its remedy.

An error is one line: what went wrong, where, and what to do. The command line prints it as
`weathercoat: FILE: CODE: what, where, what to do` and ends with `exit_code`.
"""

from __future__ import annotations

import errno
from dataclasses import dataclass
from typing import Any

_LONGEST_MESSAGE = 300
_DEVICE_ERRORS = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)


class WeathercoatError(Exception):
    """Base of every error that a user can meet.

    `code` is the stable message code, `exit_code` the exit code of the process, `remedy` the general advice
    that is printed where the message itself gives none.
    """

    code = "E-INTERNAL"
    exit_code = 70
    remedy = "report this, with the command and the input"

    def __init__(self, message: str, *, file: str | None = None, remedy: str | None = None) -> None:
        super().__init__(message)
        self.message = message
        self.file = file
        if remedy is not None:
            self.remedy = remedy

    def line(self) -> str:
        """The whole message on one line, without the program's name."""
        where = f"{self.file}: " if self.file else ""
        message = self.message
        # A message may quote what a file holds where a number should be.
        if len(message) > _LONGEST_MESSAGE:
            message = message[: _LONGEST_MESSAGE - 3] + "..."
        return _one_line(f"{where}{self.code}: {message}; {self.remedy}")

    def lines(self) -> list[str]:
        """The message as it is printed: one line for each problem."""
        return [self.line()]

    def as_dict(self) -> dict[str, Any]:
        """The error as JSON has it."""
        return {
            "code": self.code,
            "exit_code": self.exit_code,
            "file": self.file,
            "message": self.message,
            "remedy": self.remedy,
        }


def printable(text: str) -> str:
    """`text` with what no terminal should get, such as an escape in a name, spelt out."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def _one_line(text: str) -> str:
    return printable(" ".join(text.split()))


class UsageError(WeathercoatError):
    """The command line asks for something that does not exist or does not go together."""

    code = "E-USAGE"
    exit_code = 2
    remedy = "see --help"


@dataclass(frozen=True)
class ConfigProblem:
    """One thing that is wrong in a config.

    `where` is a file, `preset NAME` or `--set`; `line` counts from 1, 0 for none; `key` is dotted, or empty.
    """

    where: str
    line: int
    key: str
    what: str

    def place(self) -> str:
        """`FILE:LINE`, or what stands for it."""
        return f"{self.where}:{self.line}" if self.line else self.where

    def __str__(self) -> str:
        return ": ".join(part for part in (self.place(), self.key, self.what) if part)


class ConfigError(WeathercoatError):
    """The config is not valid; `problems` holds all that is wrong with it, where it was read from a file."""

    code = "E-CONFIG"
    exit_code = 2
    remedy = "see `weathercoat config new` for a commented example"

    def __init__(
        self,
        message: str = "",
        *,
        file: str | None = None,
        remedy: str | None = None,
        problems: tuple[ConfigProblem, ...] = (),
    ) -> None:
        super().__init__(message or " | ".join(map(str, problems)), file=file, remedy=remedy)
        self.problems = problems

    @classmethod
    def at(cls, where: str, what: str, *, line: int = 0) -> ConfigError:
        """The error of a single problem that concerns no key."""
        return cls(problems=(ConfigProblem(where, line, "", what),))

    def lines(self) -> list[str]:
        """One line for each problem, with its file and line where other errors have their file."""
        if not self.problems:
            return super().lines()
        keyed = ((p.place(), f"{p.key}: {p.what}" if p.key else p.what) for p in self.problems)
        return [_one_line(f"{place}: {self.code}: {what}") for place, what in keyed]

    def as_dict(self) -> dict[str, Any]:
        """The error as JSON has it, with each problem."""
        problems = {"problems": [vars(problem) for problem in self.problems]} if self.problems else {}
        return {**super().as_dict(), **problems}


class ModelError(WeathercoatError):
    """The model cannot be read."""

    exit_code = 3


class AccessError(ModelError):
    """The model's file is missing, no regular file, or may not be read."""

    code = "E-ACCESS"
    remedy = "give the path of a readable model file"


class EmptyFileError(ModelError):
    """The file has no bytes."""

    code = "E-EMPTY"
    remedy = "export the model again"


class FormatError(ModelError):
    """The content is of no supported format."""

    code = "E-FORMAT"
    remedy = "supported: OBJ, PLY, STL, OFF, GLB, glTF, and what meshio reads"


class CorruptError(ModelError):
    """The file contradicts itself: truncated, miscounted, or with indices out of range."""

    code = "E-CORRUPT"
    remedy = "export the model again"


class MissingFileError(ModelError):
    """A file that the model needs is missing."""

    code = "E-MISSING"
    remedy = "put the missing file beside the model"


class SecurityError(ModelError):
    """The model refers to the network or to a path outside its folder."""

    code = "E-SECURITY"
    remedy = "put every file beside the model, or embed it"


class UnsupportedError(ModelError):
    """A valid file uses a feature that is not supported."""

    code = "E-UNSUPPORTED"
    remedy = "export the model without it"


class SurfaceError(WeathercoatError):
    """The model was read but holds no usable surface."""

    exit_code = 4


class NoFacesError(SurfaceError):
    """The model has points or lines only."""

    code = "E-NOFACES"
    remedy = "export the model with its faces"


class NoAreaError(SurfaceError):
    """All faces are without area."""

    code = "E-NOAREA"
    remedy = "export a model whose faces have an area"


class NonFiniteError(SurfaceError):
    """All of the surface has positions that are not finite."""

    code = "E-NONFINITE"
    remedy = "export the model again"


class PrecisionError(SurfaceError):
    """Positions are so far from the origin that their digits no longer resolve the shape."""

    code = "E-PRECISION"
    remedy = "move the model to the origin before exporting"


class ScaleError(SurfaceError):
    """Positions are so large or small that areas overflow or vanish."""

    code = "E-SCALE"
    remedy = "scale the model to a sensible unit"


class StrictError(SurfaceError):
    """A warning under --strict."""

    code = "E-STRICT"
    remedy = "repair the model, or run without --strict"


class TextureCoordinatesError(SurfaceError):
    """The model has no texture coordinates that maps can be made on."""

    code = "E-UV"
    remedy = "give --atlas to `bake`, or maps.atlas in the config, which lays out new ones"


class LimitError(WeathercoatError):
    """A limit of size, faces, memory or time."""

    code = "E-LIMIT"
    exit_code = 5
    remedy = "raise the limit or ask for less"


class CheckError(WeathercoatError):
    """A result fails its checks: the tool's own, and then nothing was written, or a run given to `verify`."""

    code = "E-CHECK"
    exit_code = 6


class OutputError(WeathercoatError):
    """The output cannot be written, or exists."""

    code = "E-OUTPUT"
    exit_code = 7
    remedy = "choose another folder with -o"


class OutputExistsError(OutputError):
    """The output exists."""

    code = "E-EXISTS"
    remedy = "choose another folder with -o, or give --overwrite"


class OutputBusyError(OutputError):
    """Another process is writing the output."""

    code = "E-BUSY"
    remedy = "wait until it has ended, or choose another folder with -o"


class ResumeError(OutputError):
    """What lies at the output is no part of the run that is asked for, so that it cannot go on from there."""

    code = "E-RESUME"
    remedy = "choose another folder with -o, or begin anew with --overwrite"


class BatchError(WeathercoatError):
    """Some jobs of a batch failed; the results of the others are there, and a rerun goes on."""

    code = "E-BATCH"
    exit_code = 8
    remedy = "mend what the messages name, and run the batch again; what is done is kept"


class WorkerError(BatchError):
    """The process that worked on a job ended without a word, more than once."""

    code = "E-WORKER"
    remedy = "give the job more memory, or run it alone to see what happens"


class ClusterError(BatchError):
    """A cluster cannot be reached, was lost, or cannot run the jobs; what is done is kept."""

    code = "E-CLUSTER"
    remedy = "see that the scheduler and its workers run, and run the batch again"


def internal_error(error: Exception) -> WeathercoatError:
    """What stands for an exception that is none of ours: a lack of memory, a device that fails, or a fault of
    this program.
    """
    if _is_lack_of_memory(error):
        return LimitError("out of memory", remedy="ask for fewer faces, or use a machine with more memory")
    if isinstance(error, OSError) and error.errno in _DEVICE_ERRORS:
        if error.filename is None:
            remedy = "make room, or send it elsewhere"
            return OutputError(str(error.strerror), file="standard output", remedy=remedy)
        return OutputError(str(error.strerror), file=str(error.filename))
    summary = " ".join(f"{type(error).__name__}: {error}".split())
    return WeathercoatError(
        f"internal error, {summary}", remedy="report it with the traceback that --debug prints"
    )


def _is_lack_of_memory(error: Exception) -> bool:
    """Whether memory has run out, in the words of whoever noticed: Python, a thread, or the loader."""
    if isinstance(error, OSError):
        return error.errno == errno.ENOMEM
    words = {RuntimeError: "can't start new thread", ImportError: "failed to map segment"}
    return isinstance(error, MemoryError) or any(
        isinstance(error, kind) and text in str(error) for kind, text in words.items()
    )


@dataclass(frozen=True)
class Note:
    """Something that was repaired, dropped or cannot be kept; listed in `run.json` and on standard error.

    `code` is stable (`W-...`), `count` the number of elements it concerns.
    """

    code: str
    count: int
    message: str

    def line(self) -> str:
        """The note as it is printed, on one line."""
        return _one_line(f"{self.code}({self.count}): {self.message}")
