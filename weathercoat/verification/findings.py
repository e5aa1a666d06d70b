"""What a verification expects, counts and finds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


class BrokenFileError(Exception):
    """A file that cannot be read as what it should be; the message says why, without the file's name."""


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong: `check` is the name of what does not hold, `file` is relative to the run."""

    check: str
    file: str
    message: str

    def __str__(self) -> str:
        return f"{self.file}: {self.message}"


@dataclass
class Ledger:
    """Counts the checks that were made and keeps the findings of those that failed."""

    checks: int = 0
    findings: list[Finding] = field(default_factory=list)

    def expect(self, check: str, file: str, holds: bool | np.bool_, message: Callable[[], str] | str) -> bool:
        """Count a check; where it does not hold, keep the message as a finding. Returns whether it holds."""
        self.checks += 1
        if not holds:
            self.findings.append(Finding(check, file, message if isinstance(message, str) else message()))
        return bool(holds)

    def expect_all(
        self,
        check: str,
        file: str,
        holds: NDArray[np.bool_],
        message: Callable[[int], str],
    ) -> bool:
        """As `expect`, for the rows of `holds`, (n,) or (n, j): `message` tells of the first that fails, by
        its number.
        """
        self.checks += 1
        if holds.all():
            return True
        failing = np.flatnonzero(~holds.reshape(len(holds), -1).all(axis=1))
        more = f", and {len(failing) - 1:,} more" if len(failing) > 1 else ""
        self.findings.append(Finding(check, file, message(int(failing[0])) + more))
        return False
