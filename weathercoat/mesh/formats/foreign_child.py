"""The process in which meshio reads a file: `python foreign_child.py MODEL RESULT`.

meshio ends its process on some files, loops for ever on others, believes any count, and follows names of
other files that a model gives. Here it can do no harm: other files and the network are closed to it, its
memory has a limit, and `foreign.py` watches the clock. It runs as a script without the package, so that it
starts fast. RESULT is written with the points and the cells by type; a failure is one line on standard error.
"""

from __future__ import annotations

import os
import sys
import types
from pathlib import Path

import meshio
import numpy as np

READ, UNREADABLE, ESCAPED, LACKING = 0, 1, 2, 3
"""Exit codes: it was read, it could not be, it led elsewhere, it needs a module that is not installed."""
FORBIDDEN = ("socket.", "subprocess.", "os.system", "os.exec", "os.fork", "os.posix_spawn", "urllib.")
SPARE_BYTES = 2 << 30
BYTES_PER_BYTE = 100
"""A file may take so much memory for each of its bytes, beyond what every file may."""


def confine(folder: Path, *, is_xml: bool) -> list[str]:
    """Let only files of `folder` and Python's modules be opened; what else was tried is listed."""
    inside = str(folder.resolve()) + os.sep
    modules = tuple(str(Path(p).resolve()) + os.sep for p in (sys.prefix, sys.base_prefix))
    tried: list[str] = []

    def watch(event: str, arguments: tuple[object, ...]) -> None:
        if event.startswith(FORBIDDEN):
            tried.append(event)
            raise PermissionError(event)
        if event != "open" or not isinstance(arguments[0], (str, bytes)):
            return
        path = str(Path(os.fsdecode(arguments[0])).resolve())
        is_module = path.startswith(modules) and path.endswith((".py", ".pyc", ".so", ".pyd"))
        if not is_module and not path.startswith(inside):
            tried.append(path)
            raise PermissionError(path)

    def refuse(path: object, *more: object) -> None:
        tried.append(str(path))
        raise PermissionError(path)

    sys.addaudithook(watch)
    if is_xml:
        # XDMF may name any HDF5 file, which is not opened by Python.
        sys.modules["h5py"] = types.ModuleType("h5py")
        sys.modules["h5py"].File = refuse  # type: ignore[attr-defined]
    return tried


def limit_memory(size: int) -> None:
    """Let the process have what a file of `size` bytes may take and no more; where there is no way, all."""
    try:
        import resource

        now = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    except (ImportError, OSError):
        return
    limit = now + SPARE_BYTES + BYTES_PER_BYTE * size
    _, most = resource.getrlimit(resource.RLIMIT_AS)
    if most == resource.RLIM_INFINITY or limit < most:
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


def main(model: Path, result: Path) -> int:
    """Read `model` and write `result`, an .npz; an exit code."""
    limit_memory(model.stat().st_size)
    tried = confine(model.parent, is_xml=model.suffix in (".xdmf", ".xmf"))
    try:
        with np.errstate(all="ignore"):
            mesh = meshio.read(model)
            points = np.asarray(mesh.points, np.float64)
            cells = {f"{i} {b.type}": np.asarray(b.data, np.int64) for i, b in enumerate(mesh.cells)}
        np.savez(result, points=points, **cells)  # type: ignore[arg-type]
    except (Exception, SystemExit) as error:
        print(f"{type(error).__name__} {error}", file=sys.stderr)
        if isinstance(error, ImportError) and not tried:
            return LACKING
        return ESCAPED if tried else UNREADABLE
    return ESCAPED if tried else READ


if __name__ == "__main__":
    sys.exit(main(*map(Path, sys.argv[1:])))
