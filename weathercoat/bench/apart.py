"""Measuring each case in a process of its own, so that none finds memory, caches or threads of another.

The process is `python -m weathercoat.bench.apart`. It reads the job as JSON from its standard input and
answers with JSON, a line each: `progress`, and at last `result`.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from weathercoat.bench.cases import Case
from weathercoat.errors import CheckError

_THREADS = "1"  # of libraries: our own threads are asked for by the case
_PACKAGE = Path(__file__).resolve().parents[1]


def measure_machine_apart() -> dict[str, Any]:
    """`describe_machine` with the time that compiling or loading the kernels takes, and what memory and
    arithmetic can do.
    """
    return _ask({"job": "machine"}, "the machine", lambda done: None)


def measure_apart(
    case: Case, mesh: Path, end: Path, repeats: int, progress: Callable[[int], None] = lambda steps: None
) -> dict[str, Any]:
    """The figures of `measure.measure_case` on the mesh in an .npz file with `vertices` and `faces`.

    end: the .npz file that gets the film at the end.

    Raises CheckError where the case cannot be measured.
    """
    job = {"job": "case", "case": asdict(case), "mesh": str(mesh), "end": str(end), "repeats": repeats}
    return _ask(job, case.label, progress)


def _ask(job: dict[str, Any], label: str, progress: Callable[[int], None]) -> dict[str, Any]:
    """Have a job done in a new process."""
    path = os.pathsep.join(filter(None, [str(_PACKAGE.parent), os.environ.get("PYTHONPATH")]))
    threads = dict.fromkeys(("NUMBA_NUM_THREADS", "OMP_NUM_THREADS"), _THREADS)
    environment = {**os.environ, "PYTHONPATH": path, **threads}
    with subprocess.Popen(
        [sys.executable, "-m", __spec__.name],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=environment,
    ) as process:
        assert process.stdin is not None and process.stdout is not None
        try:
            with process.stdin as stdin:
                stdin.write(json.dumps(job))
            for line in process.stdout:
                answer = json.loads(line)
                if "progress" in answer:
                    progress(answer["progress"])
                else:
                    found: dict[str, Any] = answer["result"]
                    return found
        finally:
            process.kill()
    raise CheckError(
        f"its process ended with the code {process.returncode} and no result",
        file=label,
        remedy="see above for its message, or ask for fewer faces",
    )


def _do(job: dict[str, Any]) -> dict[str, Any]:
    """The answer to a job."""
    if job["job"] == "machine":
        return {"result": _machine()}
    import numpy as np

    from weathercoat.bench.measure import measure_case, warm_up
    from weathercoat.mesh.surface import make_surface

    warm_up()
    case = Case(**{**job["case"], "overrides": tuple(job["case"]["overrides"])})
    with np.load(job["mesh"]) as arrays:
        surface = make_surface(arrays["vertices"], arrays["faces"])
    end = Path(job["end"])
    figures = measure_case(case, surface, repeats=job["repeats"], progress=_say_progress, end=end)
    return {"result": figures}


def _machine() -> dict[str, Any]:
    from weathercoat.bench import machine
    from weathercoat.bench.measure import warm_up
    from weathercoat.compile import watch_compiling

    with watch_compiling(lambda: None) as compiling:
        seconds = warm_up()
    return {
        **machine.describe_machine(),
        "warm_up": {"seconds": seconds, "compiled_kernels": compiling.kernels},
        "copy_bandwidth": machine.copy_bandwidth(),
        "arithmetic_peak": machine.arithmetic_peak(),
    }


def _say_progress(steps: int) -> None:
    print(json.dumps({"progress": steps}), flush=True)


if __name__ == "__main__":
    print(json.dumps(_do(json.load(sys.stdin))), flush=True)
