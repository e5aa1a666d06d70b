"""The failure of the film in its plain form, the reference for the fast one: every step looks at everything.

One pass over all faces brings their tension to the age, one over all attached vertices finds who lets go, one
over all edges finds what is overloaded, and after a step in which something happened all pieces of free film
are collected anew. The rules and the order of every sum are those of the package, which must agree bit for
bit; nothing is shared with it but the half-edges, the geometry and the closed forms.
"""

from __future__ import annotations

import math
from typing import NamedTuple
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.film.state import (
    FilmParameters,
    FilmRules,
    FilmState,
    drying_tension,
    make_film_rules,
    tension_at,
)
from weathercoat.mesh.dihedral import half_edge_bend
from weathercoat.mesh.halfedge import EventLog, HalfEdgeMesh, cut_edge, drop_face, next_of, prev_of
from weathercoat.mesh.surface import Indices, Vectors
from weathercoat.sim.simulation import Simulation

_EQUAL = 1e-9
_REACH = 3.0


class PlainState(NamedTuple):
    """The arrays of a `FilmState`, and tension_now (m,): the tension of every face at the age of the step."""

    adhesion: Vectors
    adhesion_loss: Vectors
    lift_gain: Vectors
    separated: NDArray[np.bool_]
    separation_age: Vectors
    is_tip: NDArray[np.bool_]
    crack_direction: Vectors
    tension: Vectors
    tension_age: Vectors
    tension_cap: Vectors
    relief: Vectors
    stress: Vectors
    fray_age: Vectors
    cohesion: Vectors
    lift_factor: Vectors
    tie: NDArray[np.uint64]
    crack_budget: Vectors
    mean_edge: float
    rest_lift: Vectors
    disturbed: NDArray[np.bool_]
    tension_now: Vectors


def make_plain_state(film: FilmState) -> PlainState:
    """A state that shares its arrays with `film`."""
    return PlainState(*film, tension_now=np.empty(len(film.tension)))


def plain_step(simulation: Simulation) -> None:
    """One tick of ageing by `Simulation.step`, with the plain failure in place of the fast one."""
    state = make_plain_state(simulation.film)

    def plain_separate(mesh, film, agenda, parameters, age, tick):  # type: ignore[no-untyped-def]
        evaluate_tension(state, make_film_rules(parameters), age)
        separating = find_separating(mesh, state, parameters, age)
        separate(mesh, state, separating, age)
        return separating

    def plain_fracture(mesh, film, agenda, parameters, age, tick, log):  # type: ignore[no-untyped-def]
        fracture(mesh, state, parameters, age, tick, log)

    def plain_flake(mesh, film, agenda, parameters, age, separating, log):  # type: ignore[no-untyped-def]
        return flake(mesh, state, parameters, age, len(separating), log)

    with patch.multiple(
        "weathercoat.sim.simulation", separate=plain_separate, fracture=plain_fracture, flake=plain_flake
    ):
        simulation.step()


@kernel
def evaluate_tension(state: PlainState, rules: FilmRules, age: float) -> None:
    """Bring `tension_now` of every face to an age."""
    tension, tension_age, tension_cap, now = (
        state.tension,
        state.tension_age,
        state.tension_cap,
        state.tension_now,
    )
    for f in range(len(now)):
        now[f] = tension_at(
            tension[f], tension_age[f], tension_cap[f], rules.tension_rate, rules.saturating, age
        )


@kernel
def lift_factor_now(
    h: int,
    positions: Vectors,
    tail: Indices,
    twin: Indices,
    separated: NDArray[np.bool_],
    rest_factor: Vectors,
    convexity: float,
) -> float:
    """1 / (1 + exp(-a (phi - pi))) of half-edge h with its present dihedral; one without a twin lifts as if
    flat.

    The apex of h is attached. Where the other three corners of the hinge are too, it has not moved since the
    start.
    """
    g = twin[h]
    if g < 0:
        return 0.5
    if not (separated[tail[h]] or separated[tail[next_of(h)]] or separated[tail[prev_of(g)]]):
        return rest_factor[h]
    return 1.0 / (1.0 + math.exp(-convexity * half_edge_bend(h, positions, tail, twin)))


@kernel
def lift_on(
    first: int,
    positions: Vectors,
    tail: Indices,
    twin: Indices,
    separated: NDArray[np.bool_],
    rest_factor: Vectors,
    convexity: float,
    face_tension: Vectors,
    per_valence: bool,
) -> float:
    """Sum of tension times lift factor over the half-edges opposite to an attached vertex.

    first: the half-edge at which the vertex's fan begins.
    per_valence scales the sum to six half-edges, so that valence and rim do not matter.
    """
    total = 0.0
    count = 0
    leaving = first
    while leaving >= 0:
        h = next_of(leaving)
        total += face_tension[h // 3] * lift_factor_now(
            h, positions, tail, twin, separated, rest_factor, convexity
        )
        count += 1
        leaving = twin[prev_of(leaving)]
        if leaving == first:
            break
    if per_valence and count > 0:
        total *= 6.0 / count
    return total


@kernel
def find_overcome(
    mesh: HalfEdgeMesh,
    state: PlainState,
    convexity: float,
    per_valence: bool,
    lift_scale: float,
    age: float,
    face_tension: Vectors,
    is_uniform: bool,
    out: Indices,
) -> int:
    """Collect in out the attached vertices with `lift_scale` times their sum above their adhesion; returns
    how many.

    Adhesion is that at the start less its loss, not below 0. Where the tension is the same everywhere,
    vertices round which nothing has moved keep the sum that they had at the start, `rest_lift`.
    """
    positions, tail, twin, half_edge, origin = (
        mesh.positions,
        mesh.tail,
        mesh.twin,
        mesh.half_edge,
        mesh.origin,
    )
    separated, disturbed, adhesion = state.separated, state.disturbed, state.adhesion
    rest_factor, rest_lift = state.lift_factor, state.rest_lift
    found = 0
    # vertices beyond the first ones are copies at cracks, which have all separated
    for v in range(len(adhesion)):
        if separated[v] or half_edge[v] < 0:
            continue
        if is_uniform and not disturbed[v]:
            total = rest_lift[v]
        else:
            total = lift_on(
                half_edge[v],
                positions,
                tail,
                twin,
                separated,
                rest_factor,
                convexity,
                face_tension,
                per_valence,
            )
        o = origin[v]
        if lift_scale * (total * state.lift_gain[o]) > max(adhesion[o] - state.adhesion_loss[o] * age, 0.0):
            out[found] = v
            found += 1
    return found


@kernel
def disturb(mesh: HalfEdgeMesh, state: PlainState, vertices: Indices) -> None:
    """Mark the vertices whose lift depends on one of these, which move from now on."""
    tail, twin, half_edge, disturbed = mesh.tail, mesh.twin, mesh.half_edge, state.disturbed
    for v in vertices:
        leaving = half_edge[v]
        while leaving >= 0:
            h = next_of(leaving)
            disturbed[tail[h]] = True
            disturbed[tail[next_of(h)]] = True
            if twin[h] >= 0:
                disturbed[tail[prev_of(twin[h])]] = True
            leaving = twin[prev_of(leaving)]
            if leaving == half_edge[v]:
                break


def find_separating(mesh: HalfEdgeMesh, state: PlainState, parameters: FilmParameters, age: float) -> Indices:
    """The attached vertices whose lift exceeds their adhesion at an age, ascending, int32 (k,).

    By default the film's drying tension lifts, not the face's own, since the relaxed one would leave the
    pieces round a crack on the metal for ever. Tensions must have been evaluated at this age.
    """
    p = parameters
    is_uniform = p.lift_tension == "drying"
    scale = p.lift_coefficient * (float(drying_tension(make_film_rules(p), age)) if is_uniform else 1.0)
    weight = np.ones(len(mesh.alive)) if is_uniform else state.stress * state.tension_now
    found = np.empty(len(state.adhesion), np.int32)
    count = find_overcome(
        mesh, state, p.lift_convexity, p.lift_sum == "per_valence", scale,
        age, weight, is_uniform, found,
    )  # fmt: skip
    return found[:count].copy()


def separate(mesh: HalfEdgeMesh, state: PlainState, vertices: Indices, age: float) -> None:
    """Let the vertices go."""
    state.separated[vertices] = True
    state.separation_age[vertices] = age
    disturb(mesh, state, vertices)


@kernel
def set_tension(state: PlainState, f: int, value: float, cap: float, age: float) -> None:
    """Start the tension of face f anew from a value at an age, tending to `cap`."""
    state.tension[f] = value
    state.tension_now[f] = value
    state.tension_age[f] = age
    state.tension_cap[f] = cap


@kernel
def unload_round_crack(
    mesh: HalfEdgeMesh,
    state: PlainState,
    rules: FilmRules,
    age: float,
    seed: int,
    start: int,
    end: int,
    tip_start: bool,
    tip_end: bool,
    stack: Indices,
) -> None:
    """Relax the film that hangs together with face `seed` beside a broken edge between the origins start and
    end.

    A free edge unloads the film beside it over the shear lag: caps fall to 1 - exp(-r / lambda) at the
    distance r, and tensions are clipped to them. What lies ahead of a tip, within alpha of its direction, is
    not unloaded: that is where the stress of a crack goes. A face that is as relaxed already is not crossed,
    since what lies behind it mostly is as well.
    """
    depth = 1
    stack[0] = seed
    while depth > 0:
        depth -= 1
        f = stack[depth]
        distance, along_start, along_end = place_by_edge(mesh, f, start, end)
        if distance > _REACH * rules.shear_lag and f != seed:
            continue
        if (tip_end and along_end > rules.direction_threshold) or (
            tip_start and along_start > rules.direction_threshold
        ):
            continue
        cap = 1.0 - math.exp(-distance / rules.shear_lag)
        if cap >= state.tension_cap[f] - _EQUAL:
            continue
        set_tension(state, f, min(state.tension_now[f], cap), cap, age)
        rest_direction(mesh, start, end, state.relief[f])
        for h in range(3 * f, 3 * f + 3):
            g = mesh.twin[h]
            if g >= 0:
                stack[depth] = g // 3
                depth += 1


@kernel
def place_by_edge(mesh: HalfEdgeMesh, f: int, start: int, end: int) -> tuple[float, float, float]:
    """Where the rest centre of face f lies from the edge between two origins.

    Returned: the distance to the edge, and for each end the cosine between the edge's outward direction there
    and the way from that end to the centre.
    """
    squared = 0.0
    along = 0.0
    to_start = 0.0
    to_end = 0.0
    for axis in range(3):
        a, b = mesh.rest_positions[start, axis], mesh.rest_positions[end, axis]
        centre = (
            mesh.rest_positions[mesh.faces[f, 0], axis]
            + mesh.rest_positions[mesh.faces[f, 1], axis]
            + mesh.rest_positions[mesh.faces[f, 2], axis]
        ) / 3.0
        squared += (b - a) ** 2
        along += (centre - a) * (b - a)
        to_start += (centre - a) ** 2
        to_end += (centre - b) ** 2
    length = math.sqrt(squared)
    if length == 0.0:
        return math.sqrt(to_start), 0.0, 0.0
    along /= length
    if along < 0.0:
        distance = math.sqrt(to_start)
    elif along > length:
        distance = math.sqrt(to_end)
    else:
        distance = math.sqrt(max(to_start - along * along, 0.0))
    cosine_start = -along / math.sqrt(to_start) if to_start > 0.0 else 0.0
    cosine_end = (along - length) / math.sqrt(to_end) if to_end > 0.0 else 0.0
    return distance, cosine_start, cosine_end


@kernel
def rest_direction(mesh: HalfEdgeMesh, source: int, target: int, out: Vectors) -> None:
    """Unit vector at rest from one origin to another into out (3,); zero where they coincide."""
    length = 0.0
    for axis in range(3):
        out[axis] = mesh.rest_positions[target, axis] - mesh.rest_positions[source, axis]
        length += out[axis] ** 2
    if length > 0.0:
        out /= math.sqrt(length)


@kernel
def tension_across(
    mesh: HalfEdgeMesh, state: PlainState, rules: FilmRules, f: int, a: int, b: int, age: float
) -> float:
    """Tension of face f now that pulls across the edge from a to b.

    A free edge unloads the film across itself but not along itself, so a crack beside another one stops while
    one that comes straight at it runs on into it. Without this the film between them never comes apart where
    edges are much shorter than the shear lag.
    """
    along = 0.0
    length = 0.0
    relieved = 0.0
    for axis in range(3):
        step = mesh.rest_positions[mesh.origin[b], axis] - mesh.rest_positions[mesh.origin[a], axis]
        along += state.relief[f, axis] * step
        length += step * step
        relieved += state.relief[f, axis] ** 2
    tension = state.tension_now[f]
    if relieved == 0.0 or length == 0.0:
        return tension
    full = tension_at(rules.tension_initial, 0.0, 1.0, rules.tension_rate, rules.saturating, age)
    return tension + max(full - tension, 0.0) * max(1.0 - along * along / length, 0.0)


def fracture(
    mesh: HalfEdgeMesh,
    state: PlainState,
    parameters: FilmParameters,
    age: float,
    duration: float,
    log: EventLog,
) -> None:
    """Break what is overloaded at an age, in as many rounds as cracks run edges in `duration`; appends to the
    log.

    The most overloaded edges break first; each is tested again before it breaks, since every break relaxes
    what is round it. What a break makes critical comes in the next round, so that neither the mesh nor the
    number of steps sets the speed of a crack. Tensions must have been evaluated at this age.
    """
    rules = make_film_rules(parameters)
    rounds = 1
    if parameters.fracture_rounds == "by_speed":
        state.crack_budget[0] += parameters.fracture_speed * duration / state.mean_edge
        rounds = int(state.crack_budget[0])
        state.crack_budget[0] -= rounds
    overload = np.empty(len(mesh.twin))
    candidates = np.empty(len(mesh.twin), np.int32)
    stack = np.empty(len(mesh.twin), np.int32)
    first_break = int(log.counts[1])
    for number in range(rounds):
        if number == 0:
            found = find_overloaded(mesh, state, rules, age, candidates, overload)
        else:
            found = find_overloaded_at_tips(mesh, state, rules, age, log, first_break, candidates, overload)
        if found == 0:
            return
        order = np.lexsort((state.tie[candidates[:found]], -np.round(overload[:found] / _EQUAL)))
        first_break = int(log.counts[1])
        break_in_order(mesh, state, rules, age, candidates[:found][order], log, stack)


@kernel
def edge_overload(mesh: HalfEdgeMesh, state: PlainState, rules: FilmRules, h: int, age: float) -> float:
    """Tension of the two faces of an inner edge over its cohesion now, the direction factor included.

    Where an end is a tip and the way from it to the other end goes on in the tip's direction (dot product at
    least alpha, on the rest surface), the cohesion counts beta times, once, and of the tensions counts what
    pulls across the edge.
    """
    g = mesh.twin[h]
    a, b = mesh.tail[h], mesh.tail[g]
    bond = min(cohesion_at(state, rules, h, age), cohesion_at(state, rules, g, age))
    if leads_on(mesh, state, rules, a, b) or leads_on(mesh, state, rules, b, a):
        bond *= rules.direction_factor
        load = state.stress[h // 3] * tension_across(mesh, state, rules, h // 3, a, b, age)
        load += state.stress[g // 3] * tension_across(mesh, state, rules, g // 3, a, b, age)
    else:
        load = state.stress[h // 3] * state.tension_now[h // 3]
        load += state.stress[g // 3] * state.tension_now[g // 3]
    return load / bond if bond > 0.0 else math.inf


@kernel
def cohesion_at(state: PlainState, rules: FilmRules, h: int, age: float) -> float:
    """Cohesion of a half-edge at an age: it falls for ever once an edge of its face has broken."""
    fray_age = state.fray_age[h // 3]
    if fray_age < age:
        return state.cohesion[h] * math.exp(-rules.cohesion_decay_rate * (age - fray_age))
    return state.cohesion[h]


@kernel
def leads_on(mesh: HalfEdgeMesh, state: PlainState, rules: FilmRules, tip: int, other: int) -> bool:
    """Whether the edge from `tip` to `other` continues the crack that ends in `tip`; false where it is no
    tip.
    """
    if not state.is_tip[tip]:
        return False
    dot = 0.0
    length = 0.0
    for axis in range(3):
        step = mesh.rest_positions[mesh.origin[other], axis] - mesh.rest_positions[mesh.origin[tip], axis]
        dot += state.crack_direction[tip, axis] * step
        length += step * step
    return dot >= rules.direction_threshold * math.sqrt(length)


@kernel
def find_overloaded(
    mesh: HalfEdgeMesh,
    state: PlainState,
    rules: FilmRules,
    age: float,
    candidates: Indices,
    overload: Vectors,
) -> int:
    """Collect the edges that break at an age, by their smaller half-edge, with their overload; returns how
    many.
    """
    tail, twin, separated, is_tip = mesh.tail, mesh.twin, state.separated, state.is_tip
    tension, cohesion, fray_age, stress = state.tension_now, state.cohesion, state.fray_age, state.stress
    most_frayed = math.exp(-rules.cohesion_decay_rate * age)
    found = 0
    for h in range(len(twin)):
        g = twin[h]
        if g < h:
            continue
        a, b = tail[h], tail[g]
        if not (separated[a] and separated[b]):
            continue
        # what the edge cannot fall below is cheap to know, and settles most edges
        least = min(cohesion[h], cohesion[g])
        if fray_age[h // 3] < age or fray_age[g // 3] < age:
            least *= most_frayed
        load = stress[h // 3] * tension[h // 3] + stress[g // 3] * tension[g // 3]
        if load <= least and not (is_tip[a] or is_tip[b]):
            continue
        load = edge_overload(mesh, state, rules, h, age)
        if load > 1.0:
            candidates[found] = h
            overload[found] = load
            found += 1
    return found


@kernel
def find_overloaded_at_tips(
    mesh: HalfEdgeMesh,
    state: PlainState,
    rules: FilmRules,
    age: float,
    log: EventLog,
    first_break: int,
    candidates: Indices,
    overload: Vectors,
) -> int:
    """As `find_overloaded`, of the edges at the tips that the log's breaks from `first_break` on have made.

    Within a step tensions only fall and cohesion stays, so no other edge can have become overloaded. An edge
    between two tips is found at both.
    """
    found = 0
    for i in range(first_break, log.counts[1]):
        for side in range(2):
            tip = mesh.tail[log.breaks[i, side]]
            if not state.is_tip[tip]:
                continue
            leaving = mesh.half_edge[tip]
            while leaving >= 0:
                g = mesh.twin[leaving]
                if g >= 0 and state.separated[mesh.tail[g]]:
                    load = edge_overload(mesh, state, rules, leaving, age)
                    if load > 1.0:
                        candidates[found] = min(leaving, g)
                        overload[found] = load
                        found += 1
                leaving = mesh.twin[prev_of(leaving)]
    return found


@kernel
def break_in_order(
    mesh: HalfEdgeMesh,
    state: PlainState,
    rules: FilmRules,
    age: float,
    half_edges: Indices,
    log: EventLog,
    stack: Indices,
) -> None:
    """Break the edges one after another, each where it is still overloaded."""
    for h in half_edges:
        if mesh.twin[h] >= 0 and edge_overload(mesh, state, rules, h, age) > 1.0:
            break_edge(mesh, state, rules, age, h, log, stack)


@kernel
def break_edge(
    mesh: HalfEdgeMesh, state: PlainState, rules: FilmRules, age: float, h: int, log: EventLog, stack: Indices
) -> None:
    """Break the edge of half-edge h: part its faces, make tips or copies at its ends, relax the film round
    it.
    """
    g = mesh.twin[h]
    start, end = mesh.tail[h], mesh.tail[g]
    origins = mesh.origin[start], mesh.origin[end]
    first_split = log.counts[0]
    goes_on_from_start = leads_on(mesh, state, rules, start, end)
    goes_on_from_end = leads_on(mesh, state, rules, end, start)
    tip_start, tip_end = cut_edge(mesh, log, h)
    inherit_film(state, log, first_split)
    if tip_start:
        state.is_tip[start] = True
        rest_direction(mesh, origins[1], origins[0], state.crack_direction[start])
        if goes_on_from_end:
            keep_direction(mesh, state, rules, end, origins[1], origins[0], start)
    if tip_end:
        state.is_tip[end] = True
        rest_direction(mesh, origins[0], origins[1], state.crack_direction[end])
        if goes_on_from_start:
            keep_direction(mesh, state, rules, start, origins[0], origins[1], end)
    for side in range(2):
        f = h // 3 if side == 0 else g // 3
        state.fray_age[f] = min(state.fray_age[f], age)
        if rules.shear_lag > 0.0:
            unload_round_crack(mesh, state, rules, age, f, origins[0], origins[1], tip_start, tip_end, stack)
        else:
            set_tension(state, f, rules.face_factor * state.tension_now[f], state.tension_cap[f], age)


@kernel
def keep_direction(
    mesh: HalfEdgeMesh, state: PlainState, rules: FilmRules, before: int, source: int, target: int, tip: int
) -> None:
    """Turn the direction of the new tip, that of the edge from one origin to another, back towards that of
    the tip before it.
    """
    if rules.turning_length == 0.0:
        return
    squared = 0.0
    for axis in range(3):
        squared += (mesh.rest_positions[target, axis] - mesh.rest_positions[source, axis]) ** 2
    kept = math.exp(-(math.sqrt(squared) / rules.turning_length))
    mixed = kept * state.crack_direction[before] + (1.0 - kept) * state.crack_direction[tip]
    norm = mixed[0] ** 2 + mixed[1] ** 2 + mixed[2] ** 2
    state.crack_direction[tip] = mixed / math.sqrt(norm) if norm > 0.0 else mixed


@kernel
def inherit_film(state: PlainState, log: EventLog, first: int) -> None:
    """Give the vertices of the log's splits from `first` on what their parents have; copies are no tips."""
    for i in range(first, log.counts[0]):
        new, parent = log.splits[i, 0], log.splits[i, 1]
        state.separated[new] = state.separated[parent]
        state.separation_age[new] = state.separation_age[parent]
        state.is_tip[new] = False
        state.is_tip[parent] = False


def flake(
    mesh: HalfEdgeMesh,
    state: PlainState,
    parameters: FilmParameters,
    age: float,
    released: int,
    log: EventLog,
) -> Vectors:
    """Let fall what nothing holds; appends to the log and returns the rest area of each flake, (k,), in
    square sizes.

    Literally only a face whose three edges are broken falls. By default a connected piece that no attached
    vertex holds falls as a whole, and so does one that hangs by less than a share of its girth: it tears off.
    Nothing can fall in a step in which nothing broke and no vertex was released.
    """
    face_count = len(mesh.alive)
    areas = np.empty(face_count)
    if released == 0 and log.counts[1] == 0:
        return areas[:0]
    if parameters.flaking_rule == "faces":
        return areas[: drop_loose_faces(mesh, log, areas)].copy()
    free, seen = np.empty(face_count, np.bool_), np.empty(face_count, np.bool_)
    queue = np.empty(face_count, np.int32)
    find_free_faces(mesh, state, free)
    if parameters.flaking_hanging_share > 0.0:
        rules = make_film_rules(parameters)
        tear_hanging_pieces(mesh, state, rules, parameters.flaking_hanging_share, age, log, free, seen, queue)
    return areas[: drop_islands(mesh, log, free, seen, queue, areas)].copy()


@kernel
def rest_edge_length(mesh: HalfEdgeMesh, h: int) -> float:
    """Length of the edge of half-edge h at rest."""
    a, b = mesh.faces[h // 3, h % 3], mesh.faces[h // 3, (h + 1) % 3]
    squared = 0.0
    for axis in range(3):
        squared += (mesh.rest_positions[a, axis] - mesh.rest_positions[b, axis]) ** 2
    return math.sqrt(squared)


@kernel
def rest_face_area(mesh: HalfEdgeMesh, f: int) -> float:
    """Area of face f at rest."""
    a, b, c = mesh.faces[f, 0], mesh.faces[f, 1], mesh.faces[f, 2]
    squared = 0.0
    for axis in range(3):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        ui, uj = (
            mesh.rest_positions[b, i] - mesh.rest_positions[a, i],
            mesh.rest_positions[b, j] - mesh.rest_positions[a, j],
        )
        vi, vj = (
            mesh.rest_positions[c, i] - mesh.rest_positions[a, i],
            mesh.rest_positions[c, j] - mesh.rest_positions[a, j],
        )
        squared += (ui * vj - uj * vi) ** 2
    return 0.5 * math.sqrt(squared)


@kernel
def drop_loose_faces(mesh: HalfEdgeMesh, log: EventLog, areas: Vectors) -> int:
    """Delete each face whose three half-edges have no twin; their areas go to `areas`, their number is
    returned.
    """
    found = 0
    for f in range(len(mesh.alive)):
        h = 3 * f
        if mesh.alive[f] and mesh.twin[h] < 0 and mesh.twin[h + 1] < 0 and mesh.twin[h + 2] < 0:
            areas[found] = rest_face_area(mesh, f)
            found += 1
            drop_face(mesh, log, f)
    return found


@kernel
def find_free_faces(mesh: HalfEdgeMesh, state: PlainState, free: NDArray[np.bool_]) -> None:
    """Mark in free (m,) the live faces whose three corners have separated."""
    tail, alive, separated = mesh.tail, mesh.alive, state.separated
    for f in range(len(free)):
        h = 3 * f
        free[f] = alive[f] and separated[tail[h]] and separated[tail[h + 1]] and separated[tail[h + 2]]


@kernel
def collect_piece(
    seed: int, twin: Indices, free: NDArray[np.bool_], seen: NDArray[np.bool_], queue: Indices
) -> tuple[int, bool]:
    """Collect the connected free faces round `seed` in queue and mark them seen.

    Returns their number, and whether they touch a face that is not free: one with an attached corner.
    """
    held = False
    queue[0] = seed
    seen[seed] = True
    first, last = 0, 1
    while first < last:
        f = queue[first]
        first += 1
        for h in range(3 * f, 3 * f + 3):
            g = twin[h]
            if g < 0:
                continue
            if not free[g // 3]:
                held = True
            elif not seen[g // 3]:
                seen[g // 3] = True
                queue[last] = g // 3
                last += 1
    return last, held


@kernel
def drop_islands(
    mesh: HalfEdgeMesh,
    log: EventLog,
    free: NDArray[np.bool_],
    seen: NDArray[np.bool_],
    queue: Indices,
    areas: Vectors,
) -> int:
    """Delete each connected piece that has no attached vertex; returns their number, and their areas in
    `areas`.

    free: (m,) of `find_free_faces`; seen, queue: scratch (m,).
    """
    twin = mesh.twin
    seen[:] = False
    found = 0
    for seed in range(len(free)):
        if seen[seed] or not free[seed]:
            continue
        count, held = collect_piece(seed, twin, free, seen, queue)
        if held:
            continue
        areas[found] = 0.0
        for i in range(count):
            areas[found] += rest_face_area(mesh, queue[i])
            drop_face(mesh, log, queue[i])
        found += 1
    return found


@kernel
def tear_hanging_pieces(
    mesh: HalfEdgeMesh,
    state: PlainState,
    rules: FilmRules,
    share: float,
    age: float,
    log: EventLog,
    free: NDArray[np.bool_],
    seen: NDArray[np.bool_],
    queue: Indices,
) -> None:
    """Break the last edges of each free piece that hangs by less than `share` of the girth of its area.

    A piece hangs by the edges that it shares with faces that still have an attached corner. Its girth is the
    outline of a disc of its area: its own outline would count all cracks within it, and a wide web of film
    that many points hold would fall at once. free: (m,) of `find_free_faces`; seen, queue: scratch (m,).
    """
    twin = mesh.twin
    stack = np.empty(len(twin), np.int32)
    seen[:] = False
    for seed in range(len(free)):
        if seen[seed] or not free[seed]:
            continue
        count, held = collect_piece(seed, twin, free, seen, queue)
        if not held:
            continue
        area = 0.0
        hanging = 0.0
        for i in range(count):
            area += rest_face_area(mesh, queue[i])
            for h in range(3 * queue[i], 3 * queue[i] + 3):
                if twin[h] >= 0 and not free[twin[h] // 3]:
                    hanging += rest_edge_length(mesh, h)
        if hanging >= share * 2.0 * math.sqrt(math.pi * area):
            continue
        for i in range(count):
            for h in range(3 * queue[i], 3 * queue[i] + 3):
                if twin[h] >= 0 and not free[twin[h] // 3]:
                    break_edge(mesh, state, rules, age, h, log, stack)
