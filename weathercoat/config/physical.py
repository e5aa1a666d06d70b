"""From physical units to the dimensionless parameters of the method, through Stoney's formula.

The outer share s of a film, its skin, dries and ages ahead of the rest and is under the drying stress σ; the
rest carries it. By Stoney, with the skin as the film and the rest of the coat as the plate, the coat
that has let go curls to the radius

    R = E ((1 − s) d)² / (6 (1 − ν) (s d) σ) = E (1 − s)² d / (6 (1 − ν) s σ),

and it takes the moment M = E d³ / (12 (1 − ν) R) per width to hold it flat. Spread over a length of one
thickness this is the stress M / d² that peels its rim off the metal,

    p = σ s / (2 (1 − s)²).

On flat metal the lift on a vertex is six times k T / 2, which is 3 k where T has reached 1, so that lift over
adhesion is p over the adhesion in MPa if k = p / (3 A). A bond that is loaded for years and is wet holds
about a third of what it does in a pull-off test.

Sources: Stoney, The tension of metallic films deposited by electrolysis, 1909; the constants are round
numbers, chosen so that a common coat comes near the defaults: see docs/physical.md.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from weathercoat.config.schema import Physical

SUSTAINED = 1.0 / 3.0  # of the pull-off strength is what holds for years in the wet
_DIGITS = 6  # significant ones of derived values: no paint is known to more
MPA_PER_GPA, METRES_PER_MICROMETRE = 1e3, 1e-6

# What each key follows from.
NEEDED: dict[str, tuple[str, ...]] = {
    "ageing.duration": ("years",),
    "lift.coefficient": ("stress", "adhesion"),
    "cohesion.base": ("stress", "strength"),
    "curl.radius": ("stress", "thickness", "modulus", "size"),
    "deformation.film_thickness": ("thickness", "size"),
}


def curl_radius(stress: float, thickness: float, modulus: float, poisson: float, skin: float) -> float:
    """Radius [m] to which a coat curls: drying stress [MPa], thickness [µm], Young's modulus [GPa]."""
    plate = modulus * MPA_PER_GPA * (1.0 - skin) ** 2 * thickness * METRES_PER_MICROMETRE
    return plate / (6.0 * (1.0 - poisson) * skin * stress)


def peel_stress(stress: float, skin: float) -> float:
    """Stress [MPa] that peels the rim of a coat under a drying stress [MPa]."""
    return stress * skin / (2.0 * (1.0 - skin) ** 2)


def physical_values(physical: Physical) -> dict[str, float]:
    """The values of config keys that follow from the physical ones that are given."""
    p, values = physical, {}
    if p.years is not None:
        values["ageing.duration"] = p.years / p.lifetime
    if p.stress is not None and p.adhesion is not None:
        values["lift.coefficient"] = peel_stress(p.stress, p.skin) / (3.0 * SUSTAINED * p.adhesion)
    if p.stress is not None and p.strength is not None:
        # an edge breaks where the tensions of its two faces, each σ at the end, exceed its cohesion
        values["cohesion.base"] = 2.0 * p.strength / p.stress
    if p.size is not None and p.thickness is not None:
        values["deformation.film_thickness"] = p.thickness * METRES_PER_MICROMETRE / p.size
        if p.stress is not None and p.modulus is not None:
            radius = curl_radius(p.stress, p.thickness, p.modulus, p.poisson, p.skin)
            values["curl.radius"] = radius / p.size
    return {key: float(f"{value:.{_DIGITS}g}") for key, value in values.items()}


def unused_values(physical: Physical) -> list[tuple[str, str]]:
    """Problems of a section: values from which nothing follows, for want of others; (key, what is wrong)."""
    given = {name for needed in NEEDED.values() for name in needed if getattr(physical, name) is not None}
    used = {name for needed in NEEDED.values() if given.issuperset(needed) for name in needed}
    problems = []
    for name in sorted(given - used):
        ways = [[other for other in needed if other != name] for needed in NEEDED.values() if name in needed]
        what = " or ".join(" and ".join(way) for way in ways)
        problems.append((f"physical.{name}", f"must have {what} beside it, or it sets nothing"))
    return problems
