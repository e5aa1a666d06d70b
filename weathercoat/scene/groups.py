"""Which objects of a scene share a result: instances of one mesh become one variant, or several."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from weathercoat.batch.study import hashed
from weathercoat.mesh.surface import Vectors
from weathercoat.output.folder import safe_name
from weathercoat.scene.graph import Rule, Scene, SceneObject, decompose
from weathercoat.scene.weathering import Weathering

# Instances whose upward directions differ by more, in their own axes, never share a result: rust runs down.
LARGEST_TILT = 10.0  # degrees
LARGEST_SPREAD = (
    0.2  # of the degrees of weathering within a result, where rules do not say how many there are
)
_SEED_SHIFT = 75  # of 128 bits: seeds of 53 bits are whole in every reader of JSON
_DIGITS = 5  # of the shape of a stretch, for comparison


@dataclass(frozen=True)
class Placement:
    """How an object stands, as far as its result depends on it.

    up (3,): unit vector against gravity in the axes of the mesh times `shape`. shape (3, 3): symmetric, of
    determinant 1, the uneven part of its scale. scale: the even part, units of the scene for one of the mesh.
    """

    up: Vectors
    shape: Vectors
    scale: float
    is_mirrored: bool


@dataclass(frozen=True)
class Member:
    """An object that is weathered, what is decided for it, how it weathers, and the least distance of the
    camera [units of the scene]: None where it is never seen or there is no camera.
    """

    item: SceneObject
    rule: Rule
    weathering: Weathering
    placement: Placement
    distance: float | None


@dataclass(frozen=True)
class Variant:
    """A result that its members share. name: a safe file name, different from those of all others."""

    name: str
    members: tuple[Member, ...]
    weathering: Weathering

    @property
    def mesh(self) -> str:
        """The mesh of all members."""
        return self.members[0].item.mesh

    @property
    def rule(self) -> Rule:
        """What is decided for all members."""
        return self.members[0].rule

    @property
    def placement(self) -> Placement:
        """That of the first member; those of the others hardly differ but for the scale."""
        return self.members[0].placement

    @property
    def nearest(self) -> float | None:
        """The least distance of the camera to a member [units of the mesh]; None where none is seen."""
        seen = [m.distance / m.placement.scale for m in self.members if m.distance is not None]
        return min(seen, default=None)

    def seed(self, base: int) -> int:
        """Its own seed, which hangs on the config's and on its name alone."""
        return hashed(base, self.name, "seed", 0) >> _SEED_SHIFT


def placement_of(scene: Scene, item: SceneObject) -> Placement:
    """How an object of the scene stands."""
    turn, stretch = decompose(item.transform)
    scale = float(np.cbrt(np.linalg.det(stretch)))
    shape = np.round(stretch / scale, _DIGITS) + 0.0
    up = np.einsum("ji,j->i", turn, np.asarray(scene.up, np.float64))
    return Placement(up / np.linalg.norm(up), shape, scale, item.is_mirrored())


def group_members(members: Sequence[Member]) -> list[Variant]:
    """The variants, in the order of their first members.

    Instances share a set where mesh, rules, shape of the scale, handedness and upward direction agree. A set
    is one variant, named as the mesh where it is the first of that, else with its first object behind it; or
    several by degree, from the least weathered on: as many as its rules say, else as few as keep the degrees
    of each within `LARGEST_SPREAD`; or one for `each` object, named as that.
    """
    taken: set[str] = set()
    named: set[str] = set()
    variants = []
    for group in _sets(members):
        mesh, first = group[0].item.mesh, group[0].item.name
        other = first if first.startswith(mesh) else f"{mesh}-{first}"
        name = other if mesh in named else mesh
        wanted = group[0].rule.variants
        if wanted == "each":
            parts = [(m.item.name, [m]) for m in group]
        else:
            named.add(mesh)
            degrees = [m.weathering.degree for m in group]
            clusters = _cluster_closely(degrees) if wanted is None else cluster_degrees(degrees, wanted)
            count = int(clusters.max()) + 1
            parts = [
                (
                    name if count == 1 else f"{name}-v{k + 1}",
                    [group[i] for i in np.flatnonzero(clusters == k)],
                )
                for k in range(count)
            ]
        for wish, part in parts:
            variants.append(
                Variant(_free_name(wish, taken), tuple(part), _mean([m.weathering for m in part]))
            )
    return variants


def cluster_degrees(degrees: Sequence[float], count: int) -> NDArray[np.int64]:
    """The cluster of each degree, 0 for the lowest: at most `count` clusters with the least sum of squared
    distances to their means. Equal degrees stay together.

    Source: Wang and Song, Ckmeans.1d.dp: optimal k-means clustering in one dimension by dynamic programming,
    2011.
    """
    values, place, weight = np.unique(np.asarray(degrees), return_inverse=True, return_counts=True)
    n, k = len(values), min(count, len(values))
    total = np.concatenate([[0.0], np.cumsum(weight)])
    first = np.concatenate([[0.0], np.cumsum(weight * values)])
    second = np.concatenate([[0.0], np.cumsum(weight * values**2)])
    cost = np.full((k + 1, n + 1), np.inf)
    cut = np.zeros((k + 1, n + 1), np.int64)
    cost[0, 0] = 0.0
    for clusters in range(1, k + 1):
        for end in range(clusters, n + 1):
            start = np.arange(clusters - 1, end)
            mass, mean = total[end] - total[start], first[end] - first[start]
            within = np.maximum(second[end] - second[start] - mean**2 / mass, 0.0)
            costs = cost[clusters - 1, start] + within
            best = int(np.argmin(costs))
            cost[clusters, end], cut[clusters, end] = costs[best], start[best]
    label, end = np.empty(n, np.int64), n
    for clusters in range(k, 0, -1):
        label[cut[clusters, end] : end] = clusters - 1
        end = cut[clusters, end]
    return label[place]  # type: ignore[no-any-return]


def _cluster_closely(degrees: Sequence[float]) -> NDArray[np.int64]:
    """The cluster of each degree, 0 for the lowest: the fewest that are no wider than `LARGEST_SPREAD`, each
    from its lowest degree on.
    """
    values, place = np.unique(np.asarray(degrees), return_inverse=True)
    label, lowest = np.zeros(len(values), np.int64), values[0]
    for i in range(1, len(values)):
        is_beyond = values[i] - lowest > LARGEST_SPREAD
        label[i] = label[i - 1] + is_beyond
        if is_beyond:
            lowest = values[i]
    return label[place]  # type: ignore[no-any-return]


def _sets(members: Sequence[Member]) -> Iterator[list[Member]]:
    """The members that may share a result, set by set, in the order of their first ones."""
    alike: dict[str, list[list[Member]]] = {}
    order: list[list[Member]] = []
    for member in members:
        sets = alike.setdefault(_key(member), [])
        found = next((group for group in sets if _stand_alike(group[0], member)), None)
        if found is None:
            found = []
            sets.append(found)
            order.append(found)
        found.append(member)
    yield from order


def _key(member: Member) -> str:
    rule = member.rule
    decided = [rule.config, sorted(rule.set.items()), rule.age, rule.variants, rule.exposure]
    placement = member.placement
    return json.dumps(
        [member.item.mesh, decided, placement.shape.tolist(), placement.is_mirrored], default=str
    )


def _stand_alike(one: Member, other: Member) -> bool:
    """Whether the directions of two differ by no more than half of what any two of a set may."""
    cosine = float(np.einsum("i,i->", one.placement.up, other.placement.up))
    return cosine >= np.cos(np.radians(0.5 * LARGEST_TILT))


def _free_name(wish: str, taken: set[str]) -> str:
    """A safe name that no other variant has, whatever the case."""
    base = name = safe_name(wish.replace("/", "-"))
    number = 1
    while name.casefold() in taken:
        number += 1
        name = f"{base}-{number}"
    taken.add(name.casefold())
    return name


def _mean(parts: Sequence[Weathering]) -> Weathering:
    """The means of all numbers."""
    numbers = {
        field.name: round(sum(getattr(part, field.name) for part in parts) / len(parts), 3)
        for field in fields(Weathering)
        if field.name != "is_given"
    }
    return Weathering(**numbers, is_given=parts[0].is_given)
