"""A lock on a folder that holds as long as its process lives, however that ends."""

from __future__ import annotations

import contextlib
import errno
import os
from pathlib import Path
from typing import BinaryIO

LOCK = "lock"
_HELD = (errno.EAGAIN, errno.EACCES, errno.EDEADLK)  # what systems say of a lock that another process has


class FolderLock:
    """The lock of a folder: `take` it, and nobody else can until `release` or the end of the process.

    It is a lock of the operating system on the file `name` in the folder, so none is left behind by a process
    that was killed.
    """

    def __init__(self, folder: Path, name: str = LOCK) -> None:
        self._path = folder / name
        self._stream: BinaryIO | None = None

    def take(self) -> bool:
        """Take the lock; False where another process has it.

        Raises OSError where there can be none: the folder cannot be written, or its file system has no locks.
        """
        stream = self._path.open("ab")
        try:
            _lock(stream)
            # who had it may have moved the folder away between the opening and the locking
            is_here = os.path.samestat(os.fstat(stream.fileno()), self._path.stat())
        except OSError as error:
            is_here = False
            if error.errno not in (*_HELD, errno.ENOENT):
                stream.close()
                raise
        if not is_here:
            stream.close()
            return False
        self._stream = stream
        return True

    def release(self, *, remove: bool) -> None:
        """Give the lock back, if it was taken; its file goes, or stays and tells whose folder this is."""
        if self._stream is None:
            return
        if os.name == "nt":  # where a file that is open cannot go
            self._stream.close()
        if remove:
            with contextlib.suppress(OSError):
                self._path.unlink()
        _unlock(self._stream)
        self._stream.close()
        self._stream = None


if os.name == "nt":
    import msvcrt

    def _lock(stream: BinaryIO) -> None:
        msvcrt.locking(stream.fileno(), msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]

    def _unlock(stream: BinaryIO) -> None:
        """Closing is enough: no process inherits the lock."""

else:
    import fcntl

    def _lock(stream: BinaryIO) -> None:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)

    def _unlock(stream: BinaryIO) -> None:
        # closing would leave it to a process that was forked meanwhile
        fcntl.flock(stream, fcntl.LOCK_UN)
