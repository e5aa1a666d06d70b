"""The peer: the same constraints in PositionBasedDynamics, through its Python bindings (pypbd, MIT)."""

from __future__ import annotations

import time
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from weathercoat.deform.plain import Active
from weathercoat.sim.simulation import Simulation

_TIME_STEP = 1e-6  # so short that gravity and inertia move nothing


def peer_version() -> str | None:
    """The version of pypbd, or None where it is not installed."""
    try:
        return version("pypbd")
    except PackageNotFoundError:
        return None


class PeerSheet:
    """A model of pypbd with a distance and a dihedral constraint for each active one of a simulation, at the
    same positions.
    """

    def __init__(self, simulation: Simulation, active: Active) -> None:
        import pypbd

        self._pypbd = pypbd
        peer = pypbd.Simulation.getCurrent()
        peer.initDefault()
        self._model = peer.getModel()
        self._stepper = peer.getTimeStep()
        self._set(NUM_SUB_STEPS=1, MAX_ITERATIONS_V=0)
        pypbd.TimeManager.getCurrent().setTimeStepSize(_TIME_STEP)
        particles = self._model.getParticles()
        mesh, count = simulation.mesh, simulation.mesh.vertex_count
        rest = mesh.rest_positions[mesh.origin[:count]]
        masses = (simulation.constraints.inverse_mass[:count] > 0.0).astype(float)  # 0 holds a vertex still
        for v in range(count):
            particles.addVertex(rest[v])
            particles.setMass(v, masses[v])
        for a, b in active.ends.tolist():
            self._model.addDistanceConstraint(a, b, 1.0)
        for p1, p2, p3, p4 in active.hinges.tolist():
            self._model.addDihedralConstraint(p3, p4, p1, p2, 1.0)
        for v in range(count):  # away from rest only now, so that every constraint has something to correct
            particles.setPosition(v, mesh.positions[v])
        self._step(1)  # groups the constraints

    def seconds_per_iteration(self, iterations: int) -> float:
        """Wall time of an iteration over all constraints, without what else a time step does."""
        return (self._step(1 + iterations) - self._step(1)) / iterations  # 1 is the fewest it takes

    def _step(self, iterations: int) -> float:
        self._set(MAX_ITERATIONS=iterations)
        started = time.perf_counter()
        self._stepper.step(self._model)
        return time.perf_counter() - started

    def _set(self, **values: int) -> None:
        kind: Any = self._pypbd.TimeStepController
        for name, value in values.items():
            self._stepper.setValueUInt(getattr(kind, name), value)
