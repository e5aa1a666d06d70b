"""Measure reading, remeshing and writing: `python -m tests.measure_files [--faces 10000 100000 1000000]`.

The meshes are rings of as many faces, in every format. CPU seconds, the median of three calls (one above
300,000 faces) after a small one that compiles or loads every kernel; peak memory is the largest resident set
of the process that reads, less what it had before. The last column is the exponent with which a stage grows
from the fewest to the most faces. With trimesh's loader beside ours, which neither welds nor repairs.
"""

from __future__ import annotations

import argparse
import multiprocessing
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from weathercoat.mesh import halfedge, inspect, order, repair, shapes, topology, triangulate, weld
from weathercoat.mesh.read import read_surface
from weathercoat.mesh.remesh import RemeshParameters, remesh
from weathercoat.mesh.surface import Surface, vertex_normals
from weathercoat.output.meshes import WRITERS, write_mesh

_MANY = 300_000  # faces, from which one call is enough


def make_ring(faces: int) -> Surface:
    """A torus of about so many faces."""
    sides = round(np.sqrt(faces / 5.5))
    return shapes.make_torus(segments=round(faces / (2 * sides)), sides=sides)


def cpu_seconds(work: Callable[[], object], faces: int) -> float:
    """Median CPU seconds of a call."""
    seconds = []
    for _ in range(1 if faces > _MANY else 3):
        start = time.process_time()
        work()
        seconds.append(time.process_time() - start)
    return float(np.median(seconds))


def peak_memory(path: Path, small: Path) -> float:
    """Megabytes that reading `path` adds to the largest resident set of a process that has read `small`."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(_peak_memory, (path, small))


def _peak_memory(path: Path, small: Path) -> float:
    read_surface(small)
    before = _high_water()
    read_surface(path)
    return _high_water() - before


def _high_water() -> float:
    """Megabytes of the largest resident set of this process so far; the kernel's own figure, by Linux."""
    status = Path("/proc/self/status").read_text()
    return int(status.partition("VmHWM:")[2].split()[0]) / 1024


def stages(surface: Surface) -> dict[str, Callable[[], object]]:
    """The passes between a file and a simulation, each by itself."""
    vertices, faces = surface.vertices, surface.faces
    corners, sizes = faces.ravel().astype(np.int64), np.full(len(faces), 3)
    ordered, _ = order.order_surface(surface, vertices)
    twin, _ = topology.match_twins(vertices, faces)
    return {
        "triangulate": lambda: triangulate.triangulate(vertices, corners, sizes),
        "weld": lambda: weld.weld(vertices, corners),
        "weld soup": lambda: weld.weld(vertices[corners], np.arange(len(corners))),
        "orient": lambda: topology.orient(vertices, faces, twin),
        "repair": lambda: repair.make_oriented_manifold(vertices, faces),
        "inspect": lambda: inspect.inspect_surface(surface),
        "order": lambda: order.order_surface(surface, vertices),
        "twins": lambda: halfedge.make_twins(ordered.faces),
        "normals": lambda: vertex_normals(ordered.vertices, ordered.faces),
        "half-edges": lambda: halfedge.make_half_edges(ordered.vertices, ordered.faces),
        "remesh": lambda: remesh(surface, RemeshParameters(faces=len(faces), face_limit=10**8)),
    }


def main() -> None:
    """Print the tables."""
    import trimesh

    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--faces", nargs="+", type=int, default=[10_000, 100_000, 1_000_000])
    sizes = parser.parse_args().faces
    surfaces = [make_ring(faces) for faces in sizes]
    rows: dict[str, list[float]] = {}
    for work in stages(make_ring(1000)).values():
        work()
    for surface in surfaces:
        for name, work in stages(surface).items():
            rows.setdefault(name, []).append(cpu_seconds(work, len(surface.faces)))
    with tempfile.TemporaryDirectory() as folder:
        for format in WRITERS:
            small = Path(folder, f"small.{format}")
            write_mesh(small, make_ring(1000))
            read_surface(small)
            for surface in surfaces:
                count = len(surface.faces)
                path = Path(folder, f"ring.{format}")
                written = cpu_seconds(lambda: write_mesh(path, surface, overwrite=True), count)  # noqa: B023
                read = cpu_seconds(lambda: read_surface(path), count)  # noqa: B023
                rows.setdefault(f"write {format}", []).append(written)
                rows.setdefault(f"read {format}", []).append(read)
            peer = cpu_seconds(lambda: trimesh.load(path, process=False), count)  # noqa: B023
            print(
                f"{format}: peak memory {peak_memory(path, small):.0f} MB, trimesh {peer:.2f} s", flush=True
            )
    span = np.log(len(surfaces[-1].faces) / len(surfaces[0].faces))
    print(f"{'faces':16s}" + "".join(f"{faces:12,d}" for faces in sizes) + "  exponent")
    for name, seconds in rows.items():
        growth = np.log(seconds[-1] / seconds[0]) / span if span else np.nan
        print(f"{name:16s}" + "".join(f"{s:12.4f}" for s in seconds) + f"{growth:10.2f}")


if __name__ == "__main__":
    main()
