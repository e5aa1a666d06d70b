"""The simulation: one step of ageing in the paper's order."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from weathercoat.deform.constraints import Constraints, follow_events, make_constraints, release, repack
from weathercoat.deform.deformation import deform
from weathercoat.deform.descending import Solved
from weathercoat.deform.momentum import Momentum, make_momentum
from weathercoat.deform.parameters import DeformParameters
from weathercoat.deform.residual import Residual, measure_residual
from weathercoat.deform.sleep import Rest, make_rest
from weathercoat.deform.team import Team
from weathercoat.film.agenda import Agenda, forget_forecasts, make_agenda
from weathercoat.film.flaking import flake
from weathercoat.film.fracture import fracture
from weathercoat.film.separation import separate
from weathercoat.film.start import FilmLayout, lay_out_film, make_film_state
from weathercoat.film.state import (
    FilmParameters,
    FilmState,
    adhesion_at,
    make_film_rules,
)
from weathercoat.mesh.frame import Frame, make_frame
from weathercoat.mesh.halfedge import EventLog, HalfEdgeMesh, make_event_log, make_half_edges
from weathercoat.mesh.order import order_surface
from weathercoat.mesh.surface import Indices, Surface, Vectors
from weathercoat.sim.snapshot import Snapshot
from weathercoat.sim.steering import Change, Steering
from weathercoat.stain import runoff as runoff_room
from weathercoat.stain import rust as rust_room
from weathercoat.stain.color import Palette, stain_color
from weathercoat.stain.dust import dust_at, dust_exposure
from weathercoat.stain.runoff import Runoff, make_runoff
from weathercoat.stain.rust import RustState, StainParameters, make_rust_state, metal_rust_at

_UP = np.array([0.0, 0.0, 1.0])  # in the simulation's frame


@dataclass
class Solving:
    """What the solver of the deformation did in all steps: iterations or sweeps; the largest gap that it left
    (see `deform.descending.Solved`), None where it knows none; steps that ended over their budget.
    """

    iterations: int = 0
    largest_gap: float | None = None
    unfinished_steps: int = 0

    def add(self, solved: Solved) -> None:
        """Count one step."""
        self.iterations += solved.iterations
        if solved.gap is not None:
            self.largest_gap = max(self.largest_gap or 0.0, solved.gap)
        self.unfinished_steps += solved.unfinished > 0


@dataclass
class Simulation:
    """The state of a run. All lengths inside are in sizes, in the frame of the shape.

    `surface` is the input in the order that the simulation uses; `team` are the threads that share a step;
    `flake_areas` lists the rest areas, in square sizes, of all flakes that fell; `solving` sums what the
    solver did, `steering` changes parameters place by place, and `seconds` the time by stage, in the rows
    of the paper's table.
    """

    surface: Surface
    frame: Frame
    mesh: HalfEdgeMesh
    film: FilmState
    constraints: Constraints
    rust: RustState
    dust_exposure: Vectors
    film_parameters: FilmParameters
    deform_parameters: DeformParameters
    stain_parameters: StainParameters
    palette: Palette
    steps: int
    duration: float
    step_count: int = 0
    flake_areas: list[float] = field(default_factory=list)
    seconds: dict[str, float] = field(
        default_factory=lambda: {"failure": 0.0, "deformation": 0.0, "stains": 0.0}
    )
    solving: Solving = field(default_factory=Solving)
    team: Team = field(default_factory=Team)
    steering: Steering | None = None
    log: EventLog = field(init=False)
    rest: Rest = field(init=False)
    momentum: Momentum | None = field(init=False)
    runoff: Runoff = field(init=False)
    agenda: Agenda = field(init=False)

    def __post_init__(self) -> None:
        self.log = make_event_log(len(self.mesh.faces))
        self.rest = make_rest(len(self.mesh.twin))
        has_momentum = self.deform_parameters.deformation_solver == "momentum"
        self.momentum = make_momentum(self.mesh, self.constraints) if has_momentum else None
        self.derive()

    def derive(self) -> None:
        """Make anew what follows from the state; to be called after the state was changed from outside."""
        if self.steering is not None:
            self.steering.go_to(self.age)
        repack(self.mesh, self.constraints)
        self.runoff = make_runoff(self.mesh, self.rust, self.stain_parameters, _UP)
        self.agenda = make_agenda(self.mesh, self.film, make_film_rules(self.film_parameters))

    def steer(self, changes: Sequence[Change]) -> None:
        """Change parameters place by place, from the start; to be called once, at age 0."""
        lifts_by_face = self.film_parameters.lift_tension == "face"
        self.steering = Steering(self.mesh, self.film, self.constraints, changes, lifts_by_face)
        self.derive()

    @property
    def age(self) -> float:
        """The age reached."""
        return self.age_after(self.step_count)

    def age_after(self, steps: int) -> float:
        """The age after a number of steps; that after the same step of a longer run has the same bits."""
        return float(Fraction(str(self.duration)) * steps / max(self.steps, 1))

    def step(self, count: int = 1) -> None:
        """Age by `count` steps at once: age, separate, fracture, flake, deform, stain."""
        self.step_count += count
        age, tick = self.age, self.age_after(count)
        started = time.perf_counter()
        self.log.clear()
        if self.steering is not None and self.steering.go_to(age):
            forget_forecasts(self.agenda)

        separating = separate(self.mesh, self.film, self.agenda, self.film_parameters, age, tick)
        release(self.mesh, self.constraints, separating, age)
        rust_room.expose_lifted(self.mesh, self.rust, separating, age)

        fracture(self.mesh, self.film, self.agenda, self.film_parameters, age, tick, self.log)

        fallen = flake(self.mesh, self.film, self.agenda, self.film_parameters, age, separating, self.log)
        self.flake_areas.extend(fallen.tolist())
        follow_events(self.mesh, self.constraints, self.log)
        decided = time.perf_counter()

        self.solving.add(
            deform(
                self.mesh,
                self.constraints,
                self.deform_parameters,
                age,
                team=self.team,
                rest=self.rest,
                momentum=self.momentum,
            )
        )
        deformed = time.perf_counter()

        rust_room.follow_events(self.mesh, self.rust, self.log, age)
        runoff_room.follow_events(self.mesh, self.rust, self.runoff, self.log)
        runoff_room.run_off(self.mesh, self.rust, self.runoff, tick)
        self.seconds["failure"] += decided - started
        self.seconds["deformation"] += deformed - decided
        self.seconds["stains"] += time.perf_counter() - deformed

    def residual(self) -> Residual:
        """How far the film is from its length and angle constraints now."""
        return measure_residual(self.mesh, self.constraints, self.deform_parameters, self.age)

    def snapshot(self) -> Snapshot:
        """Film and substrate now, in the model's units and axes."""
        mesh, frame, age = self.mesh, self.frame, self.age
        film_face = np.flatnonzero(mesh.alive).astype(np.int32)
        corners = mesh.tail.reshape(-1, 3)[film_face]
        used, faces = np.unique(corners, return_inverse=True)
        origin = mesh.origin[used]
        exposure, worn = self.dust_exposure, None
        if self.steering is not None:
            exposure, worn = exposure * self.steering.mean_dirt(age), self.steering.worn
        dust = dust_at(exposure, self.stain_parameters.dust_rate, age)
        metal_rust = metal_rust_at(self.rust, self.stain_parameters, age, worn)
        separated = self.film.separated[used]
        return Snapshot(
            step=self.step_count,
            age=age,
            film_vertices=self._film_positions(used),
            film_faces=faces.reshape(-1, 3).astype(np.int32),
            film_face=film_face,
            film_origin=origin,
            film_rust=self.rust.film[used],
            separated=separated,
            separation_age=np.where(separated, age - np.minimum(self.film.separation_age[used], age), 0.0),
            adhesion=np.where(
                separated, 0.0, adhesion_at(self.film.adhesion, self.film.adhesion_loss, age)[origin]
            ),
            film_color=stain_color(self.palette.paint, self.palette, self.rust.film[used], dust[origin]),
            substrate_vertices=self.surface.vertices,
            substrate_normals=frame.turn(mesh.rest_normals),
            substrate_faces=self.surface.faces,
            substrate_rust=metal_rust,
            dust=dust,
            bare=self.rust.film_corners == 0,
            substrate_color=stain_color(self.palette.metal, self.palette, metal_rust, dust),
            surface=self.surface,
        )

    def _film_positions(self, used: Indices) -> Vectors:
        """Positions of film vertices in model units; the attached ones exactly where the input has them."""
        positions = self.frame.globalise(self.mesh.positions[used])
        attached = ~self.film.separated[used]
        positions[attached] = self.surface.vertices[self.mesh.origin[used[attached]]]
        return positions


def make_simulation(
    surface: Surface,
    *,
    film: FilmParameters | None = None,
    deform: DeformParameters | None = None,
    stain: StainParameters | None = None,
    palette: Palette | None = None,
    steps: int = 1000,
    duration: float = 1.0,
    seed: int = 1,
    frame: Frame | None = None,
    lay_out: Callable[[HalfEdgeMesh, FilmParameters, int], FilmLayout] = lay_out_film,
    threads: int = 1,
) -> Simulation:
    """A simulation of a manifold, oriented surface, at age 0; `duration` is the age that `steps` steps cover.

    `frame` is that of the surface itself unless given; give the input's, where the surface is a remeshed one,
    so that noise lies alike at every resolution. `lay_out` gives the film its adhesion and cohesion from the
    mesh, the parameters and the seed. `threads` share the work of a step; their number changes no result.
    """
    frame = frame or make_frame(surface)
    ordered, _ = order_surface(surface, frame.localise(surface.vertices))
    mesh = make_half_edges(frame.localise(ordered.vertices), ordered.faces)
    film = film or FilmParameters()
    return Simulation(
        surface=ordered,
        frame=frame,
        mesh=mesh,
        film=make_film_state(mesh, film, seed, lay_out(mesh, film, seed)),
        constraints=make_constraints(mesh),
        rust=make_rust_state(mesh),
        dust_exposure=dust_exposure(mesh, _UP),
        film_parameters=film,
        deform_parameters=deform or DeformParameters(),
        stain_parameters=stain or StainParameters(),
        palette=palette or Palette(),
        steps=steps,
        duration=duration,
        team=Team(threads),
    )
