"""Films in a known state for the tests: every value that decides is set by hand."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tests.zoo import find_edge, find_half_edge, make_mesh
from weathercoat.film.agenda import Agenda, begin_step, make_agenda
from weathercoat.film.flaking import flake
from weathercoat.film.fracture import fracture
from weathercoat.film.fringe import disturb_round
from weathercoat.film.lift import lift_on
from weathercoat.film.separation import separate
from weathercoat.film.start import make_film_state
from weathercoat.film.state import (
    FilmParameters,
    FilmRules,
    FilmState,
    face_tension,
    make_film_rules,
)
from weathercoat.mesh.halfedge import EventLog, HalfEdgeMesh, check_half_edges, make_event_log
from weathercoat.mesh.surface import Indices, Surface, Vectors

# A film of tension 1 for ever that no defect or scatter disturbs, under the paper's literal rules.
STEADY = {
    "tension_law": "saturating",
    "tension_initial": 1.0,
    "tension_rate": 0.0,
    "adhesion_base": 1.0,
    "adhesion_amplitude": 0.0,
    "adhesion_decay_rate": 0.0,
    "cohesion_base": 1000.0,
    "cohesion_scatter": 0.0,
    "cohesion_decay_rate": 0.0,
    "defects_rule": "share",
    "defects_share": 0.0,
    "lift_coefficient": 0.1,
    "lift_convexity": 2.0,
    "fracture_direction_threshold": 0.45,
    "fracture_direction_factor": 0.2,
    "fracture_relaxation": "faces",
    "fracture_face_factor": 0.5,
    "fracture_rounds": "one",
    "flaking_rule": "islands",
    "flaking_hanging_share": 0.0,
}


@dataclass
class Film:
    """A mesh of the zoo with its film and log; vertices are separated unless `attached` names them."""

    mesh: HalfEdgeMesh
    state: FilmState
    parameters: FilmParameters
    log: EventLog
    initial_twin: Indices
    positions: Vectors = field(repr=False)

    @property
    def rules(self) -> FilmRules:
        return make_film_rules(self.parameters)

    def set_cohesion(self, value: float, *edges: tuple[int, int]) -> None:
        """Give both half-edges of each edge, a pair of rest vertices, a cohesion."""
        for a, b in edges:
            h = find_edge(self.mesh, a, b)
            self.state.cohesion[h] = value
            if self.initial_twin[h] >= 0:
                self.state.cohesion[self.initial_twin[h]] = value

    def half_edge(self, a: int, b: int) -> int:
        return find_half_edge(self.mesh, a, b)

    def fracture(self, age: float = 1.0, duration: float = 1.0) -> set[tuple[int, int]]:
        """One call of `fracture`; the edges that broke in it, as pairs of rest vertices, and a sound mesh."""
        self.log.clear()
        fracture(self.mesh, self.state, self.agenda(age, duration), self.parameters, age, duration, self.log)
        assert check_half_edges(self.mesh) == ""
        tail, head = self.mesh.faces.reshape(-1), self.mesh.faces[:, [1, 2, 0]].reshape(-1)
        return {
            (int(min(tail[h], head[h])), int(max(tail[h], head[h]))) for h in self.log.break_entries()[:, 0]
        }

    def flake(self, age: float = 1.0, separating: tuple[int, ...] = (0,)) -> list[float]:
        """One call of `flake` in a step in which some vertices let go; the areas that fell."""
        self.log.clear()
        released = np.array(separating, np.int32)
        areas = flake(self.mesh, self.state, self.agenda(age, 1.0), self.parameters, age, released, self.log)
        assert check_half_edges(self.mesh) == ""
        return areas.tolist()

    def separate(self, age: float) -> list[int]:
        """One call of `separate`; who let go."""
        return separate(self.mesh, self.state, self.agenda(age, 1.0), self.parameters, age, 1.0).tolist()

    def agenda(self, age: float, tick: float) -> Agenda:
        """An agenda of its own for a step at an age, since the tests change the state at will."""
        agenda = make_agenda(self.mesh, self.state, self.rules)
        begin_step(self.mesh, self.state, self.rules, agenda, age, tick)
        return agenda

    def tension(self, age: float = 1.0) -> Vectors:
        """Tension of all faces at an age."""
        return np.array([face_tension(self.state, self.rules, f, age) for f in range(len(self.mesh.alive))])

    def tips(self) -> dict[int, tuple[float, float, float]]:
        """The tips with their directions, rounded to 1e-12."""
        return {
            int(v): tuple(np.round(self.state.crack_direction[v], 12) + 0.0)
            for v in np.flatnonzero(self.state.is_tip[: self.mesh.vertex_count])
        }

    def copies(self, origin: int) -> list[int]:
        """The film vertices in use that stem from a rest vertex."""
        used = np.unique(self.mesh.tail[np.repeat(self.mesh.alive, 3)])
        return [int(v) for v in used if self.mesh.origin[v] == origin]


def sum_lift(film: Film, age: float = 1.0) -> Vectors:
    """The lift sum of each vertex worked out anew, 0 where it has separated."""
    mesh, state = film.mesh, film.state
    attached = ~state.separated[: mesh.vertex_count] & (mesh.half_edge[: mesh.vertex_count] >= 0)
    return np.array(
        [lift_on(mesh, state, film.rules, v, age) if attached[v] else 0.0 for v in range(mesh.vertex_count)]
    )


def make_film(surface: Surface, *, attached: tuple[int, ...] = (), seed: int = 1, **changes: object) -> Film:
    """A separated film in the STEADY state, but for `changes`."""
    mesh = make_mesh(surface)
    parameters = FilmParameters(**{**STEADY, **changes})  # type: ignore[arg-type]
    state = make_film_state(mesh, parameters, seed)
    free = np.setdiff1d(np.arange(mesh.vertex_count), attached)
    state.separated[free] = True
    state.separation_age[free] = 0.0
    film = Film(
        mesh, state, parameters, make_event_log(len(mesh.faces)), mesh.twin.copy(), mesh.positions.copy()
    )
    agenda = film.agenda(0.0, 1.0)
    for v in free:
        disturb_round(
            mesh.half_edge[v], mesh.tail, mesh.twin, state.separated, state.disturbed,
            agenda.fringe, agenda.membership, agenda.counts,
        )  # fmt: skip
    return film
