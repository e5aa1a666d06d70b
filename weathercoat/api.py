"""The Python interface: read, remesh, simulate, write, verify, each a call."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path

from weathercoat.config.load import load_config
from weathercoat.errors import OutputError
from weathercoat.masks.files import mask_source
from weathercoat.mesh.read import read_surface
from weathercoat.mesh.remesh import RemeshParameters
from weathercoat.mesh.remesh import remesh as remesh_surface
from weathercoat.mesh.surface import Surface
from weathercoat.output.folder import output_errors
from weathercoat.output.meshes import write_mesh
from weathercoat.output.pictures import PictureParameters, render_snapshot, write_png
from weathercoat.output.snapshots import write_snapshot_glb, write_snapshot_ply
from weathercoat.plan import make_plan
from weathercoat.run import prepare_simulation
from weathercoat.sim.recorders import run_simulation
from weathercoat.sim.simulation import Simulation
from weathercoat.sim.snapshot import Snapshot
from weathercoat.verification.run import Verification, verify_run


def read(
    path: str | os.PathLike[str], *, up: str | tuple[float, float, float] = "auto", format: str | None = None
) -> Surface:
    """Read a model, weld and repair it; what was repaired is listed in the surface's `notes`.

    up: x, y, z, -x, -y, -z, a vector, or "auto" for the habit of the format. format: overrules the
    extension. Raises subclasses of `weathercoat.errors.WeathercoatError`.
    """
    return read_surface(os.fspath(path), format=format, up=up)


def remesh(surface: Surface, *, faces: int = 10_000, crease_angle: float = 30.0, seed: int = 1) -> Surface:
    """Remesh into about `faces` homogeneous, random triangles; edges that bend by more than `crease_angle`
    degrees stay.
    """
    return remesh_surface(surface, RemeshParameters(faces=faces, crease_angle=crease_angle, seed=seed))


def simulate(
    surface: Surface,
    config: str | os.PathLike[str] = "standard",
    overrides: Sequence[str] = (),
    *,
    until: float = 1.0,
    threads: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> Simulation:
    """Age a surface as it is, without remeshing it, and return the simulation where it stands.

    config: a YAML file or the name of a shipped config; overrides: `key.path=value`, as for `--set`. until:
    share of the run to simulate; call the result's `step()` to go on, `snapshot()` for its film and metal.
    threads: how many share a step's work; their number changes no result. progress: called with the steps
    done and their number.
    """
    plan = make_plan(load_config(config, overrides), surface, len(surface.faces))
    loaded = plan.loaded
    simulation = prepare_simulation(surface, loaded.config, threads=threads, masks=mask_source(loaded))
    run_simulation(simulation, [], progress, until=round(until * simulation.steps))
    return simulation


def write(path: str | os.PathLike[str], content: Surface | Snapshot) -> None:
    """Write a surface (OBJ, PLY, STL, OFF, GLB) or a snapshot (PLY, GLB, PNG), by the extension."""
    path = Path(path)
    if isinstance(content, Surface):
        write_mesh(path, content, overwrite=True)
        return
    kind = path.suffix.lower()
    with output_errors(path):
        if kind == ".ply":
            write_snapshot_ply(path.parent, content, path.stem)
        elif kind == ".glb":
            write_snapshot_glb(path, content)
        elif kind == ".png":
            write_png(path, render_snapshot(content, PictureParameters()))
        else:
            raise OutputError(
                f"no format for a snapshot has the extension {kind!r}",
                file=str(path),
                remedy="use .ply, .glb or .png",
            )


def verify(folder: str | os.PathLike[str]) -> Verification:
    """Prove the folder of a finished run whole, or find what is wrong with it.

    The result has `is_whole`, `findings` (each with `check`, `file` and `message`), and how many `files`,
    `snapshots` and `checks` there were. Raises `weathercoat.errors.AccessError` where there is no run.
    """
    return verify_run(os.fspath(folder))
