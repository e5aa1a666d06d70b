"""Small jobs for the tests of batches."""

from __future__ import annotations

from pathlib import Path

from weathercoat.batch.job import Job, Task
from weathercoat.config.load import load_config
from weathercoat.mesh.shapes import make_random_sheet
from weathercoat.output.meshes import write_mesh

_SMALL = ("remesh=off", "snapshots.count=2", "output.preview=false", "ageing.steps=30")


def make_job(folder: Path, name: str, *overrides: str, faces: int = 100) -> Job:
    """A job on a random sheet of about so many faces, written into a folder; 30 steps, two snapshots."""
    model = folder / f"sheet_{faces}.obj"
    if not model.exists():
        write_mesh(model, make_random_sheet(faces))
    return Job(name, str(model), load_config("standard", [*_SMALL, *overrides]))


def make_broken_job(folder: Path, name: str) -> Job:
    """A job whose model does not exist."""
    return Job(name, str(folder / "missing.obj"), load_config("standard", _SMALL))


def make_task(job: Job, out: Path, *, memory: float = 1e6) -> Task:
    """The task of a job, into a folder of its name."""
    return Task(job, str(out / job.name), memory, 1.0)


def result_bytes(folder: Path) -> dict[str, bytes]:
    """All files of a run but its timing, by their paths."""
    files = (path for path in sorted(folder.rglob("*")) if path.is_file() and path.name != "timing.json")
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}
