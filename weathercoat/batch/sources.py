"""From the arguments of a batch to its jobs: files, globs, folders, lists, manifests, and studies of them."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path, PurePath
from typing import BinaryIO

from weathercoat.batch.job import Job
from weathercoat.batch.loading import load_jobs
from weathercoat.batch.manifest import Row, is_manifest, read_manifest
from weathercoat.batch.names import (
    PARTIAL,
    STYLES,
    Named,
    check_names,
    check_room,
    found_name,
    model_name,
)
from weathercoat.batch.record import RECORD
from weathercoat.batch.storage import is_url
from weathercoat.batch.study import check_count, parse_study
from weathercoat.config.load import Override
from weathercoat.errors import ConfigProblem, UsageError
from weathercoat.mesh.formats.sniff import FOREIGN, OWN
from weathercoat.output.folder import REPORT

# Extensions that mostly belong to other things than models; such files are taken where they are named.
_AMBIGUOUS = {"avs", "dat", "dato", "e", "ele", "fem", "inp", "node", "post", "tec", "wkt", "xml"}
_EXTENSIONS = frozenset(f".{name}" for name in {*OWN, *FOREIGN} - _AMBIGUOUS)


def collect_jobs(
    arguments: Sequence[str],
    *,
    config: str = "standard",
    overrides: Sequence[str | Override] = (),
    matrix: Sequence[str] = (),
    vary: Sequence[str] = (),
    variants: int | None = None,
    names: str = "stem",
    null_separated: bool = False,
    stdin: BinaryIO | None = None,
    out: Path | None = None,
) -> list[Job]:
    """The jobs of a batch, in the order of its arguments, with names of their own and valid configs.

    arguments: models by path or URL, globs, folders, manifests, and `-` for a list of models on `stdin`, one
    a line or, `null_separated`, each with a NUL behind it. config: of jobs whose manifest names none.
    overrides: as `load_config` takes them, after what a manifest sets. matrix, vary, variants: see
    `study.parse_study`. names: `stem`, or `path` for names that are paths as they were given. out: where
    results will be, which is not looked at for models.

    A model that does not exist is no error here: its job will fail by itself. Raises UsageError for arguments
    that name nothing, for two jobs with one name, and for a study that is none; ConfigError with all problems
    of all manifests and configs; LimitError for more than `study.MOST_JOBS` jobs; and OutputExistsError where
    a result in `out` is in the way.
    """
    if names not in STYLES:
        raise UsageError(f"names are made by {' or '.join(STYLES)}, not by {names}")
    study = parse_study(matrix, vary, variants)
    search = _Search(names, out)
    rows: list[Row] = []
    for argument in arguments:
        if argument != "-":
            rows += search.rows_of(argument)
        elif stdin is None or arguments.count(argument) > 1:
            raise UsageError("- stands for standard input, which is read once", remedy="give it once")
        else:
            rows += _listed(stdin.read(), names, null_separated)
    if not arguments:
        raise UsageError("there are no jobs", remedy="name models, folders, globs or a manifest")
    if null_separated and "-" not in arguments:
        raise UsageError(
            "-0 is about a list on standard input", remedy="add - to the arguments, or leave it out"
        )
    check_count(len(rows) * study.size)
    check_names(Named(row.name, row.asset, row.place) for row in rows)
    jobs = load_jobs(rows, study, config, overrides, search.problems)
    if out is not None:
        check_room((job.name for job in jobs), out)
    return jobs


def _listed(data: bytes, style: str, null_separated: bool) -> Iterator[Row]:
    """A row for each model in a list; lines that are blank or begin with # are passed over."""
    if null_separated:
        items = [item for item in data.split(b"\0") if item]
    else:
        lines = data.removeprefix(b"\xef\xbb\xbf").split(b"\n")
        items = [
            line.removesuffix(b"\r") for line in lines if line.strip() and not line.lstrip().startswith(b"#")
        ]
    if not items:
        raise UsageError("the list on standard input holds no models", remedy="give one a line")
    for number, item in enumerate(items, 1):
        model = os.fsdecode(item)
        yield Row(model_name(model, style), model, f"standard input, model {number}")


class _Search:
    """Finds the models that arguments stand for, but not those that a batch or run has written.

    problems: what is wrong with the manifests so far.
    """

    def __init__(self, style: str, out: Path | None) -> None:
        self.problems: list[ConfigProblem] = []
        self._style = style
        self._out = None if out is None else os.path.realpath(out)
        self._is_ours = cache(self._look)

    def rows_of(self, argument: str) -> list[Row]:
        """The rows of an argument other than `-`. Raises UsageError where it is a folder or a glob with no
        model.
        """
        if not argument:
            raise UsageError("an argument is empty", remedy="name models, folders, globs or a manifest")
        if is_url(argument):
            return [self._named(argument)]
        if os.path.isdir(argument):  # noqa: PTH112 (any text will do)
            return self._found(argument, argument, self._below(argument))
        if not os.path.lexists(argument) and glob.has_magic(argument):
            folder, found = self._matches(argument)
            return self._found(argument, folder, found)
        return self._read(argument) if is_manifest(argument) else [self._named(argument)]

    def _named(self, model: str) -> Row:
        return Row(model_name(model, self._style), model, model)

    def _read(self, manifest: str) -> list[Row]:
        rows, problems = read_manifest(manifest, self._style)
        self.problems += problems
        return rows

    def _found(self, argument: str, folder: str, found: list[PurePath]) -> list[Row]:
        if not found:
            remedy = "results of runs and hidden files are passed over; name files to take them all the same"
            raise UsageError("no model is there", file=argument, remedy=remedy)
        rows: list[Row] = []
        for path in sorted(found, key=lambda path: path.parts):
            whole = os.path.join(folder, path)  # noqa: PTH118 (keeps the path as it was given)
            if is_manifest(whole):
                rows += self._read(whole)
            else:
                rows.append(Row(found_name(folder, path, self._style), whole, argument))
        return rows

    def _below(self, folder: str) -> list[PurePath]:
        """The models below a folder, relative to it."""

        def refuse(error: OSError) -> None:
            what = f"cannot be searched: {error.strerror}"
            raise UsageError(what, file=str(error.filename), remedy="name the models themselves") from error

        found: list[PurePath] = []
        for place, folders, files in os.walk(folder, onerror=refuse):
            folders[:] = [
                name
                for name in folders
                if not name.startswith(".") and not self._is_ours(os.path.join(place, name))  # noqa: PTH118
            ]
            above = PurePath(os.path.relpath(place, folder))
            found += [above / name for name in files if not name.startswith(".") and _is_model(name)]
        return found

    def _matches(self, pattern: str) -> tuple[str, list[PurePath]]:
        """The fixed part of a glob, and the files that match, relative to it: with the extension that the
        pattern names, or else with that of a model.
        """
        parts = PurePath(pattern).parts
        count = next(i for i, part in enumerate(parts) if glob.has_magic(part))
        folder = str(PurePath(*parts[:count])) if count else ""
        extension = os.path.splitext(parts[-1])[1]  # noqa: PTH122
        names_extension = bool(extension) and not glob.has_magic(extension)
        found = []
        for match in set(glob.glob(pattern, recursive=True)):  # noqa: PTH207 (takes absolute ones too)
            path = PurePath(match).relative_to(folder)
            above = (os.path.join(folder, parent) for parent in path.parents if parent.parts)  # noqa: PTH118
            if (
                (names_extension or _is_model(path.name))
                and os.path.isfile(match)  # noqa: PTH113
                and not any(map(self._is_ours, above))
            ):
                found.append(path)
        return folder, found

    def _look(self, folder: str) -> bool:
        """Whether a folder holds results: of a run, of a batch, or of this one."""
        if folder.endswith(PARTIAL) or os.path.realpath(folder) == self._out:
            return True
        return any(os.path.isfile(os.path.join(folder, name)) for name in (REPORT, RECORD))  # noqa: PTH113, PTH118


def _is_model(name: str) -> bool:
    return os.path.splitext(name)[1].lower() in _EXTENSIONS  # noqa: PTH122
