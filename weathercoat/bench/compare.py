"""How far apart two runs of the same mesh end: what a variant costs in accuracy."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from weathercoat.sim.simulation import Simulation


def save_end(simulation: Simulation, path: Path) -> None:
    """Write the film to an .npz file: where the corners of its faces are, in mean edges, and which live.

    By faces, since they are never renumbered, while copies of vertices are numbered as cracks come.
    """
    mesh, film = simulation.mesh, simulation.film
    np.savez(path, corners=mesh.positions[mesh.tail] / film.mean_edge, alive=mesh.alive)


def compare_ends(path: Path, reference: Path) -> dict[str, float]:
    """The distance between the corners of faces that live in both files, in mean edges: root mean square,
    99th percentile and largest; and the share of faces that live in one only.
    """
    with np.load(path) as ours, np.load(reference) as theirs:
        both = ours["alive"] & theirs["alive"]
        gap = (ours["corners"] - theirs["corners"]).reshape(len(both), 3, 3)[both]
        distance = np.sqrt((gap**2).sum(axis=2)).ravel()
        return {
            "rms": float(np.sqrt(np.mean(distance**2))),
            "percentile_99": float(np.quantile(distance, 0.99)),
            "largest": float(distance.max()),
            "faces_in_one": float(np.mean(ours["alive"] != theirs["alive"])),
        }
