"""The GLB of a snapshot: sound by itself, and the same film and metal as the PLY."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weathercoat.verification.film import Film
from weathercoat.verification.findings import Ledger
from weathercoat.verification.glb import Glb, Primitive
from weathercoat.verification.metal import Metal
from weathercoat.verification.ply import PlySnapshot
from weathercoat.verification.precision import DOUBLE, REPORTED, ROUNDINGS, SINGLE

_OF_FILM = {"_RUST", "_DIRT", "_SEPARATED", "_ADHESION", "_SEPARATION_AGE"}
_SCALARS = {"film": _OF_FILM, "back": _OF_FILM, "rim": _OF_FILM, "substrate": {"_RUST", "_DIRT", "_BARE"}}
_MATERIALS = {"back": "primer", "rim": "primer", "substrate": "metal"}
_HIGHEST = {"_RUST": 1.0, "_DIRT": 1.0, "_SEPARATED": 1.0, "_BARE": 1.0, "_ADHESION": np.inf}


def check_glb(
    ledger: Ledger,
    file: str,
    glb: Glb,
    *,
    film_faces: int,
    metal_faces: int,
    other_faces: int,
    is_shell: bool,
) -> bool:
    """Whether a GLB is sound and has as many faces as told: of the film, of the metal, and of unpainted
    parts. `is_shell`: whether the film has a thickness. Returns whether it can be compared with the PLY.
    """
    sound = True
    for primitive in glb.primitives:
        where = f"{primitive.role or 'unpainted'}, {primitive.material}"
        sound &= _check_primitive(ledger, file, where, primitive, glb.age)
        if primitive.role in _SCALARS:
            scalars = {key for key in primitive.attributes if key.startswith("_")}
            sound &= ledger.expect(
                "glb-attributes",
                file,
                scalars == _SCALARS[primitive.role] and "COLOR_0" in primitive.attributes,
                f"{where} has the attributes {', '.join(sorted(primitive.attributes))}",
            )
        if primitive.role in _MATERIALS:
            sound &= ledger.expect(
                "glb-materials",
                file,
                primitive.material == _MATERIALS[primitive.role],
                f"{where} is not made of {_MATERIALS[primitive.role]}",
            )
    backs = film_faces if is_shell else 0
    for role, told in (("film", film_faces), ("back", backs), ("substrate", metal_faces)):
        count = sum(len(primitive.indices) for primitive in glb.of_role(role))
        sound &= ledger.expect(
            "glb-counts", file, count == told, f"the {role} has {count:,} faces instead of {told:,}"
        )
    others = sum(len(p.indices) for p in glb.primitives if p.role not in _SCALARS)
    ledger.expect(
        "glb-counts",
        file,
        others == other_faces,
        f"unpainted parts have {others:,} faces instead of {other_faces:,}",
    )
    return sound


def check_agreement(
    ledger: Ledger,
    file: str,
    glb: Glb,
    snapshot: PlySnapshot,
    film: Film,
    metal: Metal,
    *,
    up: Sequence[float],
    thickness: float,
) -> None:
    """Whether a sound GLB shows what the PLY of the same step holds.

    up: the model's axis against gravity; thickness: no less than that of the film, in units of the model. The
    back of the shell lies where the PLY has the film, and the metal where the PLY has it.
    """
    ledger.expect(
        "formats-agree",
        file,
        (glb.step, glb.age) == (snapshot.step, snapshot.age),
        f"tells of step {glb.step}, age {glb.age!r}; the PLY of step {snapshot.step}, age {snapshot.age!r}",
    )
    turn = rotation_to_y(up)
    count = len(metal.vertices)
    turned = np.einsum("ij,nj->ni", turn, snapshot.positions)
    offsets = [float(np.abs(primitive.matrix[:3, 3]).max()) for primitive in glb.primitives]
    extent = float(np.abs(snapshot.positions).max()) + max(offsets, default=0.0)
    is_exact = all(part == round(part) for part in up)
    slack = extent * (ROUNDINGS * DOUBLE + (0.0 if is_exact else 4 * REPORTED))
    every = np.arange(count)
    of_film = np.arange(count, len(snapshot.part))
    rows: dict[str, NDArray[Any]] = {
        "_RUST": snapshot.rust,
        "_DIRT": snapshot.dust,
        "_BARE": snapshot.bare,
        "_SEPARATED": snapshot.separated,
        "_ADHESION": snapshot.adhesion,
        "_SEPARATION_AGE": snapshot.separation_age,
    }
    part = snapshot.face_more.get("object")
    lift = 2.0 * thickness if glb.of_role("back") else 0.0
    first = len(metal.faces)
    for primitive in glb.primitives:
        if primitive.role not in ("film", "back", "substrate"):
            continue
        of_metal = primitive.role == "substrate"
        faces = metal.faces if of_metal else film.faces
        if part is not None:
            faces = faces[(part[:first] if of_metal else part[first:]) == primitive.part]
        if primitive.role == "back":
            faces = faces[:, ::-1]
        is_own = primitive.role == "back" or primitive.material not in ("paint", "metal")
        _compare(
            ledger,
            file,
            f"{primitive.role} of {primitive.material}",
            primitive,
            faces,
            every if of_metal else of_film,
            turned,
            slack + (lift if primitive.role == "film" else 0.0),
            {name: rows[name] for name in _SCALARS[primitive.role]},
            None if is_own else snapshot.colors,
        )
    if glb.of_role("back"):
        rim = sum(len(primitive.indices) for primitive in glb.of_role("rim"))
        open_edges = film.faces.size - int(np.count_nonzero(film.is_joined))
        ledger.expect(
            "formats-agree",
            file,
            rim == 2 * open_edges,
            f"the rim has {rim:,} faces for {open_edges:,} open edges of the PLY",
        )


def rotation_to_y(up: Sequence[float]) -> NDArray[np.float64]:
    """The rotation (3, 3) that turns `up` to +y the short way, after half a turn about x where it points
    down: the product of two reflections, that of `up` and that of the middle between `up` and y.
    """
    axis = np.asarray(up, np.float64) / np.linalg.norm(up)
    half_turn = np.diag([1.0, -1.0, -1.0]) if axis[1] < 0.0 else np.eye(3)
    axis = half_turn @ axis
    middle = axis + np.array([0.0, 1.0, 0.0])
    return np.asarray(_mirror(middle) @ _mirror(axis) @ half_turn)


def _mirror(axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """The reflection (3, 3) that reverses an axis."""
    return np.eye(3) - 2.0 * np.outer(axis, axis) / (axis @ axis)


def _check_primitive(ledger: Ledger, file: str, where: str, primitive: Primitive, age: float) -> bool:
    """Whether indices, numbers and bounds of a primitive are in order."""
    count = len(primitive.attributes["POSITION"])
    highest = int(primitive.indices.max(initial=0))
    sound = ledger.expect(
        "glb-indices",
        file,
        highest < count,
        lambda: (
            f"{where}: face {np.flatnonzero((primitive.indices >= count).any(axis=1))[0]}"
            f" has index {highest}, but there are {count:,} vertices"
        ),
    )
    for name, values in primitive.attributes.items():
        sound &= ledger.expect_all(
            "glb-finite",
            file,
            np.isfinite(values),
            _tell(f"{where}: {name} of vertex", "is not finite"),
        )
    if not sound:
        return False
    positions = primitive.attributes["POSITION"]
    bounds = np.stack([positions.min(axis=0), positions.max(axis=0)])
    ledger.expect(
        "glb-bounds",
        file,
        bool((bounds == primitive.bounds).all()),
        lambda: f"{where}: positions lie within {bounds.tolist()}, not {primitive.bounds.tolist()}",
    )
    normals = primitive.attributes.get("NORMAL", np.zeros((count, 3), np.float32)).astype(np.float64)
    squared = np.einsum("ij,ij->i", normals, normals)
    # They have been rounded to 32 bits twice, before and after they were turned.
    ledger.expect_all(
        "glb-normals",
        file,
        np.abs(squared - 1.0) <= 8 * SINGLE,
        lambda i: f"{where}: the normal of vertex {i} has the length {np.sqrt(squared[i]):.9g}",
    )
    limits = {**_HIGHEST, "_SEPARATION_AGE": age * (1.0 + SINGLE), "COLOR_0": 1.0}
    for name, values in primitive.attributes.items():
        if name in limits:
            low, high = float(values.min()), float(values.max())
            ledger.expect(
                "glb-ranges",
                file,
                low >= 0.0 and high <= limits[name],
                f"{where}: {name} runs from {low:.9g} to {high:.9g}, not within 0 and {limits[name]:.9g}",
            )
    return True


def _compare(
    ledger: Ledger,
    file: str,
    what: str,
    primitive: Primitive,
    faces: NDArray[np.integer],
    numbers: NDArray[np.int64],
    turned: NDArray[np.float64],
    slack: float,
    rows: dict[str, NDArray[Any]],
    colors: NDArray[np.uint8] | None,
) -> None:
    """Hold a primitive against the PLY, face by face: faces (m, 3) in the vertices `numbers` of the PLY."""
    if not ledger.expect(
        "formats-agree",
        file,
        len(primitive.indices) == len(faces),
        f"{what}: there are {len(primitive.indices):,} faces, but {len(faces):,} in the PLY",
    ):
        return
    indices = (primitive.indices[:, [0, 2, 1]] if primitive.is_mirrored else primitive.indices).ravel()
    corners = numbers[faces.ravel()]
    count = len(primitive.attributes["POSITION"])
    source = np.zeros(count, np.int64)
    unused = np.ones(count, np.bool_)
    source[indices] = corners
    unused[indices] = False
    if not ledger.expect_all(
        "formats-agree",
        file,
        (source[indices] == corners).reshape(-1, 3),
        lambda i: f"{what}: face {i} has a vertex that stands for two of the PLY",
    ):
        return
    shown, rounded = primitive.placed()
    off = np.abs(shown - turned[source]) - 2 * SINGLE * rounded
    ledger.expect_all(
        "formats-agree",
        file,
        (off <= slack) | unused[:, None],
        lambda i: f"{what}: vertex {i} is {off[i].max():.3g} off vertex {source[i]} of the PLY",
    )
    for name, values in rows.items():
        ledger.expect_all(
            "formats-agree",
            file,
            (primitive.attributes[name] == values[source]) | unused,
            _tell(f"{what}: {name} of vertex", "is not that of the PLY"),
        )
    if colors is not None:
        shade, byte = primitive.attributes["COLOR_0"], colors[source]
        ledger.expect_all(
            "formats-agree",
            file,
            (shade >= _DARKEST[byte]) & (shade <= _BRIGHTEST[byte]) | unused[:, None],
            lambda i: f"{what}: the colour of vertex {i} is not that of vertex {source[i]} of the PLY",
        )


def _tell(subject: str, what: str) -> Callable[[int], str]:
    """A message about one of many."""
    return lambda i: f"{subject} {i} {what}"


def _linear(value: NDArray[np.float64]) -> NDArray[np.float64]:
    """Linear values of sRGB values 0 to 1 (IEC 61966-2-1)."""
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


# Between which linear values an sRGB colour lies that was rounded to a byte, with room for 32 bits.
_DARKEST = _linear(np.clip((np.arange(256) - 0.5) / 255.0, 0.0, 1.0)) * (1.0 - 2 * SINGLE)
_BRIGHTEST = _linear(np.clip((np.arange(256) + 0.5) / 255.0, 0.0, 1.0)) * (1.0 + 2 * SINGLE)
