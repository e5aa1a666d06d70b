"""The files of a run: those that are there, those that its report lists, and their hashes."""

from __future__ import annotations

import hashlib
import os
import re
import stat
from collections.abc import Collection
from pathlib import Path
from typing import Any

from weathercoat.verification.fields import take
from weathercoat.verification.findings import BrokenFileError, Ledger

REPORT, TIMING = "run.json", "timing.json"


class Listing:
    """The folder of a run as its report lists it; every file is read once, and its hash checked then.

    names: what the report lists, sorted; read: how many files have been read.
    """

    def __init__(
        self, folder: Path, report: dict[str, Any], ledger: Ledger, ignored: Collection[str] = ()
    ) -> None:
        self._folder = folder
        self._ledger = ledger
        self._unlisted = {REPORT, TIMING, *ignored}
        self._digests = _digests(report)
        self.names = sorted(self._digests)
        self.read = 0

    def check_names(self, expected: set[str]) -> None:
        """Whether all that is listed is there and nothing else, and all that is expected is listed."""
        regular, others = _walk(self._folder)
        for name in sorted(others):
            self._ledger.expect("files-listed", name, False, "is neither a file nor a folder")
        for name in self.names:
            self._ledger.expect("files-there", name, name in regular, "is listed in run.json, but missing")
        for name in sorted(regular - self._unlisted):
            self._ledger.expect("files-listed", name, name in self._digests, "is not listed in run.json")
        for name in sorted(expected):
            self._ledger.expect(
                "files-expected",
                name,
                name in self._digests,
                "follows from run.json, but is not listed there",
            )
        self._there = regular

    def content(self, name: str) -> bytes | None:
        """The bytes of a listed file, held against its hash; None where it cannot be read."""
        if name not in self._there or name not in self._digests:
            return None
        try:
            content = (self._folder / name).read_bytes()
        except OSError as error:
            self._ledger.expect("files-there", name, False, f"cannot be read: {error.strerror or error}")
            return None
        self.read += 1
        digest = hashlib.sha256(content).hexdigest()
        self._ledger.expect(
            "hashes", name, digest == self._digests[name], "is not what the run wrote: its hash differs"
        )
        return content


def _digests(report: dict[str, Any]) -> dict[str, str]:
    """The hashes that the report lists, by file."""
    listed = take(report, "files", dict)
    for name, digest in listed.items():
        if not isinstance(digest, str) or not re.fullmatch("[0-9a-f]{64}", digest):
            raise BrokenFileError(f"the SHA-256 of {name[:80]!r} in files is {str(digest)[:70]!r}")
    return listed


def _walk(folder: Path) -> tuple[set[str], set[str]]:
    """The regular files below a folder, and all else that is no folder, relative to it and with slashes."""
    regular, others = set(), set()
    for place, folders, files in os.walk(folder):
        for path in (Path(place) / name for name in (*files, *folders)):
            name = path.relative_to(folder).as_posix()
            try:
                mode = path.stat().st_mode
            except OSError:
                others.add(name)
                continue
            if stat.S_ISREG(mode):
                regular.add(name)
            elif not stat.S_ISDIR(mode) or path.is_symlink():
                others.add(name)
    return regular, others
