"""From the entries of `steering` to changes of a simulation: each mask at each vertex."""

from __future__ import annotations

import fnmatch
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from weathercoat.config.steering import Lines, Mask, Steer
from weathercoat.masks.files import MaskSource, problem, read_lines, read_picture, segments
from weathercoat.masks.geometry import (
    along_up,
    distance_to,
    fade,
    mean_of_corners,
    sample_picture,
    sharp_edges,
    turned_from,
)
from weathercoat.mesh.surface import Indices, Surface, Vectors
from weathercoat.sim.simulation import Simulation
from weathercoat.sim.steering import Change


def require_masks(entries: Sequence[Steer], surface: Surface, origin: str) -> None:
    """Raise ConfigError where masks need colours, texture coordinates or groups that a surface lacks.

    origin: where the entries came from, `FILE:LINE` or an option.
    """
    for key, mask in _masks(entries):
        if mask.color is not None and surface.colors is None:
            raise problem(origin, f"{key}.color", f"{surface.name} has no vertex colours")
        if mask.image is not None and surface.uv is None:
            raise problem(origin, f"{key}.image", f"{surface.name} has no texture coordinates")
        if mask.group:
            names = {name for named in _names_of_faces(surface) for name in named[0]}
            idle = [pattern for pattern in mask.group if not fnmatch.filter(names, pattern)]
            if idle:
                known = ", ".join(sorted(names))
                raise problem(
                    origin, f"{key}.group", f"{', '.join(idle)} fits nothing in {surface.name}, of {known}"
                )


def make_changes(entries: Sequence[Steer], simulation: Simulation, source: MaskSource) -> list[Change]:
    """The changes that entries from a source make of a simulation, in their order.

    Raises ConfigError where a mask cannot be evaluated.
    """
    require_masks(entries, simulation.surface, source.origin)
    evaluation = _Evaluation(simulation, source.origin, source.folder)
    return [
        Change(entry.name, evaluation.mask_of(entry, f"steering[{number}]"), entry.set is None, entry.keys)
        for number, entry in enumerate(entries)
    ]


def _masks(entries: Sequence[Steer]) -> Iterator[tuple[str, Mask]]:
    for number, entry in enumerate(entries):
        for place, mask in enumerate(entry.by):
            yield f"steering[{number}].by[{place}]", mask


def _names_of_faces(surface: Surface) -> Iterator[tuple[Sequence[str], Indices]]:
    """What faces are named after: names, and for each face a number in them."""
    yield surface.groups, surface.face_group
    if surface.face_part is not None and surface.parts:
        yield [part.name for part in surface.parts], surface.face_part


@dataclass(frozen=True)
class _Evaluation:
    """Masks on the vertices of a simulation's surface."""

    simulation: Simulation
    origin: str
    folder: Path

    def mask_of(self, entry: Steer, key: str) -> Vectors:
        """The product of all masks of an entry, (n0,)."""
        mask = np.ones(len(self.simulation.surface.vertices))
        if entry.guide is not None:
            half_width = max(0.5 * entry.width, self.simulation.film.mean_edge)
            mask *= fade(self._away_from(entry.guide, f"{key}.guide") - half_width, 0.0)
        for number, given in enumerate(entry.by):
            mask *= self._product(given, f"{key}.by[{number}]")
        return mask

    def _product(self, given: Mask, key: str) -> Vectors:
        """The product of what a mask holds."""
        surface = self.simulation.surface
        size = self.simulation.frame.size
        found = []
        if given.color is not None:
            assert surface.colors is not None
            found.append(np.clip(surface.colors[:, "rgba".index(given.color)], 0.0, 1.0))
        if given.image is not None:
            found.append(self._picture(given.image.file, given.image.channel, f"{key}.image"))
        if given.height is not None:
            band = given.height
            height = along_up(surface)
            most = float(height.max()) or 1.0
            height = height / (most if band.unit == "share" else size)
            found.append(fade(np.maximum(band.start - height, height - band.end), band.soft))
        if given.direction is not None:
            towards, within = _vector(given.direction.towards, surface.up), given.direction.within
            found.append(fade(turned_from(surface, towards) - within, given.direction.soft))
        if given.edges is not None:
            edges = given.edges
            sharp = sharp_edges(surface, self.simulation.mesh.twin, edges.angle, rims=edges.rims)
            found.append(fade(distance_to(surface.vertices, sharp) / size - edges.within, edges.soft))
        if given.line is not None:
            away = self._away_from(given.line.points, f"{key}.line")
            found.append(fade(away - given.line.within, given.line.soft))
        if given.group:
            found.append(mean_of_corners(surface, _in_groups(surface, given.group)))
        product = np.ones(len(surface.vertices))
        for one in found:
            product = product * one
        return 1.0 - product if given.invert else product

    def _picture(self, name: str, channel: str, key: str) -> Vectors:
        surface = self.simulation.surface
        assert surface.uv is not None
        try:
            picture = read_picture(self.folder / name, channel)
        except ValueError as error:
            raise problem(self.origin, key, str(error)) from error
        return mean_of_corners(surface, sample_picture(picture, surface.uv.reshape(-1, 2)))

    def _away_from(self, lines: Lines, key: str) -> Vectors:
        """Distances to lines, in sizes."""
        try:
            found = read_lines(self.folder / lines) if isinstance(lines, str) else list(map(np.array, lines))
        except ValueError as error:
            raise problem(self.origin, key, str(error)) from error
        return distance_to(self.simulation.surface.vertices, segments(found)) / self.simulation.frame.size


def _in_groups(surface: Surface, patterns: Sequence[str]) -> Vectors:
    """1 at the corners (m, 3) of faces whose group or part fits a pattern, else 0."""
    fits: NDArray[np.bool_] = np.zeros(len(surface.faces), np.bool_)
    for names, number in _names_of_faces(surface):
        wanted = [any(fnmatch.fnmatchcase(name, pattern) for pattern in patterns) for name in names]
        fits |= np.array(wanted)[number]
    return np.repeat(fits.astype(np.float64), 3).reshape(-1, 3)


def _vector(towards: str | tuple[float, float, float], up: tuple[float, float, float]) -> Vectors:
    if isinstance(towards, tuple):
        return np.array(towards)
    if towards in ("up", "down"):
        return np.array(up) * (1.0 if towards == "up" else -1.0)
    vector = np.zeros(3)
    vector["xyz".index(towards[-1])] = -1.0 if towards.startswith("-") else 1.0
    return vector
