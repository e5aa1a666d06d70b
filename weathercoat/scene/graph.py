"""`Scene`: meshes, the objects that place them in the world, a camera, and the rules of what is aged how.

Matrices act on columns: a point p of a mesh lies at (M p), with the translation in the last column. Nothing
here reads or writes files.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from functools import cached_property
from typing import Any, Literal

import numpy as np

from weathercoat.errors import Note
from weathercoat.mesh.formats.gltf_document import GltfDocument
from weathercoat.mesh.surface import Surface, Vectors
from weathercoat.sim.snapshot import Snapshot

ASPECT = 16.0 / 9.0
# Digits to which stretches are rounded, so that instances of one size share it: float32, in which matrices of
# a GLB are often made, holds no more.
_STRETCH_DIGITS = 6


@dataclass(frozen=True)
class SceneObject:
    """A mesh at its place.

    name: different from those of all other objects: the node's own, a path `rack/shelf` where names repeat,
    and with a number behind it where paths do. path: names of all nodes down to it, with slashes. mesh: key
    of `Scene.meshes`. transform: float64 (4, 4), mesh to world; may scale unevenly and mirror. node: number
    of its node in `Scene.source`, or None; instance: its number among those of a node that places a mesh
    many times. kept: why it cannot be weathered, such as `it is skinned`; empty where it can.
    """

    name: str
    mesh: str
    transform: Vectors
    node: int | None = None
    instance: int | None = None
    kept: str = ""
    path: str = ""

    def is_mirrored(self) -> bool:
        """Whether the transform turns left into right, and so the faces' winding around."""
        return bool(np.linalg.det(self.transform[:3, :3]) < 0.0)


@dataclass(frozen=True)
class CameraPath:
    """Where the scene is seen from: one place, or k of them along the way.

    positions: float64 (k, 3), world. directions: float64 (k, 3), unit, world. field_of_view: from top to
    bottom [degrees]. image_height [pixels]. aspect: width of the image over its height.
    """

    positions: Vectors
    directions: Vectors
    field_of_view: float = 40.0
    image_height: int = 1080
    aspect: float = ASPECT


@dataclass(frozen=True)
class Rule:
    """What is decided for the objects whose names match; None and an empty `set` decide nothing.

    pattern: glob over names of objects, and over their paths, in which * also stands for slashes. config:
    path or shipped name. set: values of the config by dotted keys. age [ages]. variants: how many results
    the instances of one mesh share, or `each` for one apiece. weathered: False leaves the object as it is.
    exposure: degree of weathering, 0 to 1, instead of what is derived.
    """

    pattern: str
    config: str | None = None
    set: Mapping[str, Any] = field(default_factory=dict)
    age: float | None = None
    variants: int | Literal["each"] | None = None
    weathered: bool | None = None
    exposure: float | None = None


@dataclass(frozen=True)
class Scene:
    """Objects, the meshes that they place, and what is asked of them.

    meshes: surfaces in their own coordinates, by key; several objects may place one. up: unit vector against
    gravity, world. ground: height of the ground along `up`, or None. config, overrides: what all objects
    start from. rules: all that match an object apply, the later ones win. source: the glTF file that the
    scene was read from, which a written scene is a copy of; None for objects of a YAML file. notes: what
    cannot be kept; repairs of a mesh are notes of the mesh.
    """

    name: str
    meshes: Mapping[str, Surface]
    objects: tuple[SceneObject, ...]
    up: tuple[float, float, float] = (0.0, 1.0, 0.0)
    ground: float | None = None
    camera: CameraPath | None = None
    config: str = "standard"
    overrides: Mapping[str, Any] = field(default_factory=dict)
    rules: tuple[Rule, ...] = ()
    source: GltfDocument | None = None
    notes: tuple[Note, ...] = ()

    @cached_property
    def _paths(self) -> dict[str, str]:
        return {thing.name: thing.path or thing.name for thing in self.objects}

    def decision(self, name: str) -> Rule:
        """The rules that match the object of that name, or its path, as one; its pattern is the name.

        Values of `set` are merged key by key.
        """
        path = self._paths.get(name, name)
        merged: dict[str, Any] = {}
        values: dict[str, Any] = {}
        for rule in self.rules:
            if not (fnmatchcase(name, rule.pattern) or fnmatchcase(path, rule.pattern)):
                continue
            values.update(rule.set)
            for key in ("config", "age", "variants", "weathered", "exposure"):
                if getattr(rule, key) is not None:
                    merged[key] = getattr(rule, key)
        return Rule(name, set=values, **merged)


@dataclass(frozen=True)
class AgedMesh:
    """What ageing made of a mesh: a variant, which any number of objects show.

    snapshot: film and metal at the end. untouched: the parts that carry no paint. Both in the coordinates of
    the mesh times `stretch` (3, 3), see `decompose`, so that a mesh is aged in the size in which it stands.
    thickness [units of the snapshot], back_color: of the film, as for `write_snapshot_glb`.
    """

    snapshot: Snapshot
    thickness: float = 0.0
    back_color: tuple[float, float, float] | None = None
    untouched: Surface | None = None
    stretch: Vectors = field(default_factory=lambda: np.eye(3))


def place(points: Vectors, transform: Vectors) -> Vectors:
    """Points (n, 3) after a transform (4, 4) or (3, 3); without BLAS, whose last bits hang on the machine."""
    placed = (
        points[:, :1] * transform[:3, 0]
        + points[:, 1:2] * transform[:3, 1]
        + points[:, 2:3] * transform[:3, 2]
    )
    return placed if transform.shape[1] == 3 else placed + transform[:3, 3]


def decompose(transform: Vectors) -> tuple[Vectors, Vectors]:
    """The linear part (3, 3) of a transform as turn times stretch, its polar decomposition.

    turn (3, 3): orthogonal; it mirrors where the transform does. stretch (3, 3): symmetric, with lengths that
    are positive, rounded to six digits, so that objects of one size have the same. A direction of the world,
    such as up, is `turn.T @ direction` in the coordinates of the stretched mesh.
    Source: Higham, Computing the polar decomposition, 1986.
    """
    left, lengths, right = np.linalg.svd(transform[:3, :3])
    turn = np.einsum("ij,jk->ik", left, right)
    stretch = np.einsum("ji,j,jk->ik", right, lengths, right)
    scale = 10.0 ** (_STRETCH_DIGITS - 1 - np.floor(np.log10(lengths.max())))
    return turn, np.round(0.5 * (stretch + stretch.T) * scale) / scale + 0.0


def world_surface(scene: Scene, thing: SceneObject) -> Surface:
    """The surface of an object where it stands, its faces counter-clockwise seen from outside."""
    surface = scene.meshes[thing.mesh]
    faces = surface.faces[:, [0, 2, 1]] if thing.is_mirrored() else surface.faces
    uv = surface.uv
    if uv is not None and thing.is_mirrored():
        uv = uv[:, [0, 2, 1]]
    return replace(
        surface, vertices=place(surface.vertices, thing.transform), faces=faces, uv=uv, up=scene.up
    )


def unique_names(paths: Sequence[Sequence[str]]) -> list[str]:
    """A name for each path of node names: its last part where no other has it, else the whole path with
    slashes, and a number behind that where it is taken: `rack/bolt`, `rack/bolt-2`.
    """
    count: dict[str, int] = {}
    for path in paths:
        count[path[-1]] = count.get(path[-1], 0) + 1
    wanted = [path[-1] if count[path[-1]] == 1 else "/".join(path) for path in paths]
    taken: set[str] = set()
    reserved = set(wanted)
    names = []
    for name in wanted:
        number, chosen = 1, name
        while chosen in taken or (number > 1 and chosen in reserved):
            number += 1
            chosen = f"{name}-{number}"
        taken.add(chosen)
        names.append(chosen)
    return names
