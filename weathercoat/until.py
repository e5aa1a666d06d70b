"""Whether a run has reached what it was told to stop at, asked after every step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from weathercoat.errors import UsageError
from weathercoat.grades import Limit, parse_limits
from weathercoat.mesh.surface import Indices, Surface
from weathercoat.output.condition import is_rusted, percent_of
from weathercoat.sim.simulation import Simulation
from weathercoat.stain.rust import metal_rust_at


class Until:
    """The limits of `ageing.until`: alternatives, each of limits that have to be reached all.

    Area that is rusted or flaked never becomes less, so what is not reached now was not reached before. The
    figures are those of the snapshots' severity, with the same bits.
    """

    def __init__(self, wanted: Sequence[str], surface: Surface) -> None:
        """Limits for the `surface` that is simulated; UsageError where it has no such group or part."""
        require_groups(wanted, surface)
        self._alternatives = [(text, parse_limits(text)) for text in wanted]
        self._area = surface.face_areas()
        self._faces = surface.faces
        named = {limit.group for _, limits in self._alternatives for limit in limits}
        self._chosen = {name: _faces_of(surface, name) for name in named}

    def reached(self, simulation: Simulation) -> str | None:
        """The first alternative that is reached, as it was asked for; None where none is."""
        flaked = ~simulation.mesh.alive
        masks = {"flaked": flaked}
        if any(limit.figure == "rusted" for _, limits in self._alternatives for limit in limits):
            rust = metal_rust_at(simulation.rust, simulation.stain_parameters, simulation.age)
            masks["rusted"] = is_rusted(flaked, self._faces, rust)
        for text, limits in self._alternatives:
            if all(self._is_reached(limit, masks) for limit in limits):
                return text
        return None

    def why_it_ended(self, simulation: Simulation) -> str:
        """Why a run makes no further step: what is reached, or that nothing of it is, at the last one."""
        at = f"step {simulation.step_count}, age {simulation.age:g}"
        reached = self.reached(simulation)
        if reached is not None:
            return f"reached {reached} at {at}"
        missed = " or ".join(text for text, _ in self._alternatives)
        return f"reached the end: {at}" + (f"; {missed} was not reached" if missed else "")

    def _is_reached(self, limit: Limit, masks: dict[str, NDArray[np.bool_]]) -> bool:
        chosen, area = self._chosen[limit.group], self._area
        mask = masks[limit.figure]
        return limit.is_reached(percent_of(mask[chosen], area[chosen]))


def require_groups(wanted: Sequence[str], surface: Surface) -> None:
    """Raise UsageError where limits name what is neither a material group nor a part of the surface."""
    names = _names(surface)
    for text in wanted:
        for limit in parse_limits(text):
            if limit.group is not None and limit.group not in names:
                raise UsageError(
                    f"{limit.text} names no painted group or part",
                    file=surface.name,
                    remedy=f"there are {', '.join(sorted(names))}",
                )


def _names(surface: Surface) -> set[str]:
    names = {surface.groups[i] for i in np.unique(surface.face_group)}
    if surface.face_part is not None:
        names |= {surface.parts[i].name for i in np.unique(surface.face_part)}
    return names


def _faces_of(surface: Surface, name: str | None) -> slice | NDArray[np.bool_]:
    """The faces of the group of a name, or of the parts, where no group has it; all for None."""
    if name is None:
        return slice(None)
    if name in {surface.groups[i] for i in np.unique(surface.face_group)}:
        return _named(surface.face_group, surface.groups, name)
    assert surface.face_part is not None
    return _named(surface.face_part, [part.name for part in surface.parts], name)


def _named(number: Indices, names: Sequence[str], name: str) -> NDArray[np.bool_]:
    return np.array([other == name for other in names])[number]
