"""What vertices and faces of a snapshot have from the model: rest position, place, colour, texture, names."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from weathercoat.verification.findings import Ledger
from weathercoat.verification.metal import Metal
from weathercoat.verification.ply import PlySnapshot
from weathercoat.verification.precision import SINGLE

_SIDES = {"texture": "texture coordinates"}


def check_inherited(
    ledger: Ledger, file: str, snapshot: PlySnapshot, metal: Metal, before: PlySnapshot | None
) -> None:
    """Hold what film and metal have from the model against each other, and against a snapshot before."""
    count, faces = len(metal.stored), len(metal.faces)
    _check_rest(ledger, file, snapshot, metal)
    _check_places(ledger, file, snapshot)
    for name, values in snapshot.vertex_more.items():
        ledger.expect_all(
            "inherited",
            file,
            values[count:] == values[snapshot.origin[count:]],
            _tell(f"film vertex # has not the {name} of the metal that it stems from"),
        )
    for name, values in snapshot.face_more.items():
        what = _SIDES.get(name, name)
        ledger.expect_all(
            "inherited",
            file,
            _same(values[faces:], values[snapshot.face_origin[faces:]]),
            _tell(f"film face # has not the {what} of the face that it covered"),
        )
    if before is None:
        return
    for kind, now, then, length in (
        ("vertex", snapshot.vertex_more, before.vertex_more, count),
        ("face", snapshot.face_more, before.face_more, faces),
    ):
        if not ledger.expect(
            "inherited", file, now.keys() == then.keys(), "has other properties than the snapshot before"
        ):
            continue
        for name in now:
            ledger.expect_all(
                "inherited",
                file,
                _same(now[name][:length], then[name][:length]),
                _tell(f"the {name} of metal {kind} # was another before"),
            )


def _check_rest(ledger: Ledger, file: str, snapshot: PlySnapshot, metal: Metal) -> None:
    """The metal's rest positions, of which the stored ones are a hair beneath."""
    rest = snapshot.vertex_more.get("rest")
    if rest is None:
        return
    away = np.abs(rest[: len(metal.stored)] - metal.vertices).max(axis=1)
    ledger.expect_all(
        "inherited",
        file,
        away <= metal.reach,
        lambda i: f"the rest position of metal vertex {i} is {away[i]:.3g} from the surface above it",
    )


def _check_places(ledger: Ledger, file: str, snapshot: PlySnapshot) -> None:
    """Places on the input: a face, and weights that are shares; texture coordinates are numbers."""
    weights, face = snapshot.vertex_more.get("input_weights"), snapshot.vertex_more.get("input_face")
    if weights is not None and face is not None:
        within = (weights >= 0.0).all(axis=1) & (weights.sum(axis=1) <= 1.0 + 4 * SINGLE) & (face >= 0)
        ledger.expect_all(
            "inherited",
            file,
            within,
            lambda i: f"vertex {i} lies nowhere on the input: face {face[i]}, weights {weights[i].tolist()}",
        )
    texture = snapshot.face_more.get("texture")
    if texture is not None:
        ledger.expect_all(
            "finite",
            file,
            np.isfinite(texture),
            lambda i: f"face {i} has texture coordinates that are not finite",
        )


def _tell(text: str) -> Callable[[int], str]:
    """A message with a number in the place of #."""
    return lambda i: text.replace("#", str(i))


def _same(one: NDArray[np.generic], other: NDArray[np.generic]) -> NDArray[np.bool_]:
    return np.asarray(one == other)
