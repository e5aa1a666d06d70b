"""The film of one snapshot: a manifold over the metal, attached where it says so, and nowhere inside it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from weathercoat.verification.findings import Ledger
from weathercoat.verification.metal import Metal
from weathercoat.verification.ply import PlySnapshot
from weathercoat.verification.precision import DOUBLE, ROUNDINGS, SINGLE


@dataclass(frozen=True)
class Film:
    """Film over the half-edges of the metal's m faces, so that snapshots compare face by face.

    faces: int64 (k, 3), corners among the film's vertices; over: int32 (k,), the face of the metal beneath
    each. Over half-edges of the metal, (3 m,) each: start, the film's vertex where one starts, -1 where there
    is no film; separated, whether that has let go; is_joined, is_apart, is_outline: whether the film hangs
    together with that across the edge, lies beside it but has come apart, or lies beside lost film.
    """

    faces: NDArray[np.int64]
    over: NDArray[np.int32]
    start: NDArray[np.int64]
    separated: NDArray[np.bool_]
    is_joined: NDArray[np.bool_]
    is_apart: NDArray[np.bool_]
    is_outline: NDArray[np.bool_]

    @property
    def is_left(self) -> NDArray[np.bool_]:
        """Whether there is film over each face of the metal, (m,)."""
        return self.start[::3] >= 0


def check_arrays(ledger: Ledger, file: str, snapshot: PlySnapshot) -> bool:
    """Whether all numbers are finite and in their ranges, and all indices refer to something."""
    metal = int(np.count_nonzero(snapshot.part == 0))
    metal_faces = int(np.count_nonzero(snapshot.face_part == 0))
    count, face_count = len(snapshot.part), len(snapshot.face_part)

    def tell(values: NDArray[np.generic], name: str, wanted: str) -> Callable[[int], str]:
        return lambda i: f"{_vertex(i, metal)} has {name} {values[i]}, which is not {wanted}"

    sound = ledger.expect(
        "parts",
        file,
        bool(
            (snapshot.part[metal:] == 1).all()
            and (snapshot.face_part[metal_faces:] == 1).all()
            and (snapshot.part[:metal] == 0).all()
            and (snapshot.face_part[:metal_faces] == 0).all()
        ),
        "its parts are not first metal, 0, and then film, 1",
    )
    if not sound:
        return False
    sound &= ledger.expect("metal-there", file, metal > 0 and metal_faces > 0, "holds no metal")
    for name, values in (("position", snapshot.positions), ("normal", snapshot.normals)):
        sound &= ledger.expect_all(
            "finite",
            file,
            np.isfinite(values),
            tell(values, name, "finite"),
        )
    low = np.zeros(face_count, np.int64)
    low[metal_faces:] = metal
    high = np.full(face_count, count)
    high[:metal_faces] = metal
    sound &= ledger.expect_all(
        "indices",
        file,
        (snapshot.faces >= low[:, None]) & (snapshot.faces < high[:, None]),
        lambda i: _tell_index(i, snapshot, metal, metal_faces),
    )
    origin = snapshot.origin
    sound &= ledger.expect_all(
        "origins",
        file,
        (origin >= 0) & (origin < metal),
        lambda i: f"{_vertex(i, metal)} has origin {origin[i]}, but there are {metal:,} vertices of metal",
    )
    face_origin = snapshot.face_origin
    sound &= ledger.expect_all(
        "origins",
        file,
        (face_origin >= 0) & (face_origin < metal_faces),
        lambda i: (
            f"{_face(i, metal_faces)} has origin {face_origin[i]},"
            f" but there are {metal_faces:,} faces of metal"
        ),
    )
    ledger.expect_all(
        "origins",
        file,
        origin[:metal] == np.arange(metal),
        lambda i: f"metal vertex {i} has origin {origin[i]}, not its own number",
    )
    ledger.expect_all(
        "origins",
        file,
        face_origin[:metal_faces] == np.arange(metal_faces),
        lambda i: f"metal face {i} has origin {face_origin[i]}, not its own number",
    )

    squared = np.einsum("ij,ij->i", snapshot.normals.astype(np.float64), snapshot.normals)
    ledger.expect_all(
        "unit-normals",
        file,
        (np.abs(squared - 1.0) <= 4 * SINGLE) | (squared == 0.0),
        lambda i: f"the normal of {_vertex(i, metal)} has the length {np.sqrt(squared[i]):.9g}",
    )
    for name, values in (("rust", snapshot.rust), ("dust", snapshot.dust)):
        ledger.expect_all(
            "ranges", file, (values >= 0.0) & (values <= 1.0), tell(values, name, "within 0 and 1")
        )
    for name, flags in (("separated", snapshot.separated), ("bare", snapshot.bare)):
        sound &= ledger.expect_all("ranges", file, flags <= 1, tell(flags, name, "0 or 1"))
    is_metal, separated = snapshot.part == 0, snapshot.separated == 1
    adhesion, since = snapshot.adhesion, snapshot.separation_age
    ledger.expect_all(
        "ranges",
        file,
        np.where(separated | is_metal, adhesion == 0.0, (adhesion >= 0.0) & np.isfinite(adhesion)),
        tell(adhesion, "adhesion", "0 where nothing holds, and finite and no less elsewhere"),
    )
    oldest = snapshot.age * (1.0 + SINGLE)
    ledger.expect_all(
        "ranges",
        file,
        np.where(separated, (since >= 0.0) & (since <= oldest), since == 0.0),
        tell(since, "separation age", "0 before it separates, and within the age after"),
    )
    ledger.expect_all(
        "ranges",
        file,
        ~np.where(is_metal, separated, snapshot.bare == 1),
        lambda i: f"{_vertex(i, metal)} is {'separated' if i < metal else 'bare'}, which it cannot be",
    )
    return sound


def check_film(ledger: Ledger, file: str, snapshot: PlySnapshot, metal: Metal) -> Film | None:
    """Whether the film is a manifold over the metal, and where its vertices are; None where figures of it
    would mean nothing. The arrays have passed `check_arrays`.
    """
    count, face_count = len(metal.vertices), len(metal.faces)
    faces = snapshot.faces[face_count:].astype(np.int64) - count
    over, origin = snapshot.face_origin[face_count:], snapshot.origin[count:]
    separated = snapshot.separated[count:] == 1

    times = np.bincount(over, minlength=face_count)
    sound = ledger.expect_all(
        "film-once", file, times <= 1, lambda i: f"{times[i]} film faces lie over metal face {i}"
    )
    expected = metal.faces[over]
    sound &= ledger.expect_all(
        "film-over-metal",
        file,
        origin[faces] == expected,
        lambda i: (
            f"film face {i} has corners of the origins {_list(origin[faces[i]])},"
            f" but metal face {over[i]} beneath it has {_list(expected[i])}"
        ),
    )
    used = np.bincount(faces.ravel(), minlength=len(origin)) > 0
    ledger.expect_all("film-used", file, used, lambda i: f"film vertex {i} is of no face")
    _check_places(ledger, file, snapshot, metal)
    bare = np.bincount(origin[faces].ravel(), minlength=count) == 0
    is_bare = snapshot.bare[:count] == 1
    ledger.expect_all(
        "bare-metal",
        file,
        bare == is_bare,
        lambda i: (
            f"metal vertex {i} is {'' if is_bare[i] else 'not '}bare, but has {'no' if bare[i] else ''} film"
        ),
    )
    ledger.expect_all(
        "dust-alike",
        file,
        snapshot.dust[count:] == snapshot.dust[origin],
        lambda i: f"film vertex {i} has other dust than the metal that it stems from",
    )
    if not sound:
        return None
    film = _join(faces, over, separated, metal)
    return film if _check_fans(ledger, file, film, len(origin)) else None


def _check_places(ledger: Ledger, file: str, snapshot: PlySnapshot, metal: Metal) -> None:
    """Attached film lies on the metal, and none below the tangent plane where it began."""
    count = len(metal.vertices)
    origin = snapshot.origin[count:]
    way = snapshot.positions[count:] - metal.vertices[origin]
    attached = snapshot.separated[count:] == 0
    off = np.abs(way)
    ledger.expect_all(
        "attached",
        file,
        (off <= metal.reach) | ~attached[:, None],
        lambda i: f"film vertex {i} is attached, but {off[i].max():.3g} off the metal",
    )
    height = np.einsum("ij,ij->i", way, metal.normals[origin])
    distance = np.sqrt(np.einsum("ij,ij->i", way, way))
    extent = max(metal.extent, float(np.abs(snapshot.positions).max()))
    # The normals are rounded to 32 bits, which tilts the plane, and shifts it by as much of the hair.
    rounding = SINGLE * (distance + metal.hair) + ROUNDINGS * DOUBLE * extent
    ledger.expect_all(
        "above-plane",
        file,
        height >= -rounding,
        lambda i: (
            f"film vertex {i} is {-height[i]:.3g} below the tangent plane of metal vertex {origin[i]},"
            f" which is more than the rounding, {rounding[i]:.1g}"
        ),
    )


def _join(
    faces: NDArray[np.int64], over: NDArray[np.int32], separated: NDArray[np.bool_], metal: Metal
) -> Film:
    """Which half-edges of the film hang together, by those of the metal beneath them."""
    corners = np.full((len(metal.faces), 3), -1, np.int64)
    corners[over] = faces
    start, end = corners.ravel(), corners[:, [1, 2, 0]].ravel()
    is_left, twin = start >= 0, metal.twin
    has_other = is_left & (twin >= 0)
    is_beside = has_other & is_left[twin]
    is_joined = is_beside & (start == end[twin]) & (end == start[twin])
    separated_corners = np.zeros(len(start), np.bool_)
    separated_corners[is_left] = separated[start[is_left]]
    return Film(
        faces=faces,
        over=over,
        start=start,
        separated=separated_corners,
        is_joined=is_joined,
        is_apart=is_beside & ~is_joined,
        is_outline=has_other & ~is_beside,
    )


def _check_fans(ledger: Ledger, file: str, film: Film, count: int) -> bool:
    """Whether each of the `count` vertices of the film has one fan.

    Film faces cover faces of the metal one to one and corner by corner, so every half-edge of the film is one
    of the metal's, none twice, and what is joined round a vertex is a part of the one fan of the metal there.
    A part of a path or of a circle that has one corner more than it has joints is one path; one
    that has as many is the whole circle.
    """
    corners = np.bincount(film.faces.ravel(), minlength=count)
    joints = np.bincount(film.start[film.is_joined], minlength=count)
    return ledger.expect_all(
        "film-manifold",
        file,
        corners - joints <= 1,
        lambda i: f"film vertex {i} joins {corners[i] - joints[i]} fans, as if welded across a crack",
    )


def _vertex(i: int, metal: int) -> str:
    return f"metal vertex {i}" if i < metal else f"film vertex {i - metal}"


def _face(i: int, metal_faces: int) -> str:
    return f"metal face {i}" if i < metal_faces else f"film face {i - metal_faces}"


def _tell_index(i: int, snapshot: PlySnapshot, metal: int, metal_faces: int) -> str:
    """What is wrong with the corners of a face, of which one at least is out of range."""
    first, last = (0, metal) if i < metal_faces else (metal, len(snapshot.part))
    index = next(int(corner) for corner in snapshot.faces[i] if not first <= corner < last)
    if 0 <= index < len(snapshot.part):
        return f"{_face(i, metal_faces)} has index {index}, which is {_vertex(index, metal)}"
    return f"{_face(i, metal_faces)} has index {index}, but there are {len(snapshot.part):,} vertices"


def _list(values: NDArray[np.int32]) -> str:
    return ", ".join(map(str, values.tolist()))
