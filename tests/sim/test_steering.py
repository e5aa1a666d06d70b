"""Steering: what changes do, that the fast failure stays the plain one, and that runs resume to the bit."""

from __future__ import annotations

import numpy as np
import pytest

from tests.film.plain import plain_step
from tests.film.test_plain import assert_same
from tests.sim.runs import LITERAL_CURL, LITERAL_FILM, finish, make_run
from weathercoat.mesh.shapes import make_random_sheet, make_sphere
from weathercoat.sim.checkpoint import restore_state, state_arrays
from weathercoat.sim.simulation import Simulation
from weathercoat.sim.steering import PARAMETERS, Change

ALWAYS = ((0.0, 1.0),)
RISING = ((0.1, 0.5), (0.4, 2.0), (0.6, 2.0), (0.8, 1.2))


def sheet_run(*, steps: int = 40, **arguments: object) -> Simulation:
    return make_run(make_random_sheet(400, seed=3), steps=steps, **arguments)  # type: ignore[arg-type]


def ramp(simulation: Simulation) -> np.ndarray:
    """A mask that rises from 0 to 1 across the surface."""
    x = simulation.mesh.rest_positions[:, 0]
    return (x - x.min()) / (x.max() - x.min())


def every_change(simulation: Simulation) -> list[Change]:
    """A change of each parameter, most of them over time."""
    mask = ramp(simulation)
    return [
        Change("adhesion", mask, True, ((0.0, 1.0), (0.5, 0.6))),
        Change("tension", 1.0 - mask, True, RISING),
        Change("tension", mask, False, ((0.0, 1.5),)),
        Change("cohesion", mask, True, RISING),
        Change("thickness", mask, True, ((0.0, 1.4),)),
        Change("dirt", mask, True, RISING),
        Change("protection", 1.0 - mask, False, ((0.2, 0.0), (0.5, 0.9), (0.7, 0.1))),
    ]


def steered(make: object = sheet_run, **arguments: object) -> Simulation:
    simulation = make(**arguments)  # type: ignore[operator]
    simulation.steer(every_change(simulation))
    return simulation  # type: ignore[no-any-return]


@pytest.mark.parametrize("parameter", PARAMETERS)
def test_a_factor_of_one_and_a_mask_of_zero_change_nothing(parameter: str) -> None:
    plain, other = finish(sheet_run()), sheet_run()
    keys = ((0.0, 1.0), (0.3, 1.0))
    zero = np.zeros(other.mesh.vertex_count)
    other.steer(
        [Change(parameter, zero + 1.0, True, keys), Change(parameter, zero, False, ((0.0, 0.3), (1.0, 0.9)))]
    )
    finish(other)
    assert_same(other, plain)
    snapshots = plain.snapshot(), other.snapshot()
    for name in ("film_vertices", "adhesion"):
        assert np.array_equal(*(getattr(snapshot, name) for snapshot in snapshots)), name
    for name in ("dust", "substrate_rust"):  # their integrals over keys round
        np.testing.assert_allclose(*(getattr(snapshot, name) for snapshot in snapshots), atol=1e-14)


@pytest.mark.compiled
@pytest.mark.parametrize("literal", [False, True])
def test_the_agenda_misses_nothing_while_values_change(literal: bool) -> None:
    """Bit for bit the failure that tests everything in every step."""
    rules = {"film": LITERAL_FILM, "curl": LITERAL_CURL} if literal else {}
    fast, plain = steered(steps=60, **rules), steered(steps=60, **rules)
    while plain.step_count < plain.steps:
        fast.step()
        plain_step(plain)
        assert_same(fast, plain)
    assert fast.flake_areas


@pytest.mark.parametrize("at", [3, 22, 28, 39])
def test_a_resumed_run_is_the_same_to_the_bit(at: int) -> None:
    """Before, within and between keys."""
    whole, first, second = steered(), steered(), steered()
    first.step()
    for _ in range(at - 1):
        first.step()
    restore_state(second, {name: array.copy() for name, array in state_arrays(first).items()})
    finish(whole), finish(second)
    assert_same(second, whole)
    for name in ("dust", "substrate_rust", "adhesion"):
        assert np.array_equal(getattr(whole.snapshot(), name), getattr(second.snapshot(), name)), name


def test_keyed_protection_integrates_the_loss_of_adhesion() -> None:
    """By a fine sum over the ages; the midpoint rule with 10,000 intervals is good to 1e-8 here."""
    simulation = sheet_run()
    mask = ramp(simulation)
    adhesion, loss = simulation.film.adhesion.copy(), simulation.film.adhesion_loss.copy()
    keys = ((0.2, 0.0), (0.5, 0.9), (0.7, 0.1))
    simulation.steer([Change("protection", mask, False, keys)])
    for age in (0.1, 0.35, 0.5, 0.6, 1.0):
        ages = (np.arange(10_000) + 0.5) / 10_000 * age
        protected = np.interp(ages, *zip(*keys, strict=True)).mean() * age * mask
        simulation.steering.go_to(age)
        held = simulation.film.adhesion - simulation.film.adhesion_loss * age
        np.testing.assert_allclose(held, adhesion - loss * (age - protected), atol=1e-7)
        np.testing.assert_allclose(
            simulation.steering.worn(np.full(len(mask), age)), age - protected, atol=1e-7
        )


def test_integrals_of_several_keyed_changes_are_exact() -> None:
    """The product of two linear functions of the age, against its antiderivative."""
    simulation = sheet_run()
    ones = np.ones(simulation.mesh.vertex_count)
    to_two, to_three = ((0.0, 1.0), (1.0, 2.0)), ((0.0, 1.0), (1.0, 3.0))
    simulation.steer([Change("dirt", ones, True, to_two), Change("dirt", ones, True, to_three)])
    for age in (0.3, 1.0):  # (1 + a)(1 + 2 a)
        exact = 1.0 + 1.5 * age + 2.0 * age**2 / 3.0
        np.testing.assert_allclose(simulation.steering.mean_dirt(age), exact, rtol=1e-14)


def test_changes_come_one_after_the_other() -> None:
    simulation = sheet_run()
    half = np.full(simulation.mesh.vertex_count, 0.5)
    start = simulation.film.adhesion.copy()
    simulation.steer(
        [Change("adhesion", half, False, ((0.0, 3.0),)), Change("adhesion", half, True, ((0.0, 3.0),))]
    )
    np.testing.assert_allclose(simulation.film.adhesion, (start + 0.5 * (3.0 - start)) * 2.0, rtol=1e-15)


def test_thickness_lifts_and_stiffens_in_proportion() -> None:
    """Stoney: the moment grows with the thickness, the radius of curl with it too."""
    plain, thick = sheet_run(), sheet_run()
    thick.steer([Change("thickness", np.ones(thick.mesh.vertex_count), True, ((0.0, 2.0),))])
    np.testing.assert_array_equal(thick.constraints.span, plain.constraints.span / 2.0)
    assert (thick.film.lift_gain == 2.0).all() and (thick.film.stress == 1.0).all()


def test_local_changes_act_where_they_are() -> None:
    """Half of a ball with a tenth of the adhesion lets go while the other half holds."""
    simulation = make_run(make_sphere(600), steps=20)
    side = (simulation.mesh.rest_positions[:, 0] > 0.0).astype(float)
    simulation.steer(
        [Change("adhesion", side, False, ((0.0, 0.1),)), Change("adhesion", 1.0 - side, False, ((0.0, 9.0),))]
    )
    finish(simulation)
    snapshot = simulation.snapshot()
    assert snapshot.separated[side[snapshot.film_origin] == 1.0].mean() > 0.9
    assert snapshot.separated[side[snapshot.film_origin] == 0.0].mean() < 0.1


def test_whole_protection_stops_rust_and_loss() -> None:
    simulation = sheet_run()
    side = (simulation.mesh.rest_positions[:, 0] > 0.0).astype(float)
    simulation.steer([Change("protection", side, False, ALWAYS)])
    finish(simulation)
    rust = simulation.snapshot().substrate_rust
    assert (rust[side == 1.0] == 0.0).all() and rust[side == 0.0].max() > 0.3
    assert (simulation.film.adhesion_loss[side == 1.0] == 0.0).all()
