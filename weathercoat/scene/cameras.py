"""The cameras of a glTF document, with the animations that move them, as one path.

Source: Khronos, glTF 2.0 specification, sections 3.10 (cameras), 3.11 and appendix C (animations).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weathercoat.errors import CorruptError, Note
from weathercoat.mesh.formats.gltf_document import (
    AT_REST,
    FLOATS,
    NORMALISED,
    GltfDocument,
    PlacedNode,
    check_index,
    node_matrix,
    trs_matrices,
)
from weathercoat.mesh.surface import Vectors
from weathercoat.scene.graph import ASPECT, CameraPath

# An animated camera is looked at so often, and at each of its keys where there are no more than `_MOST_KEYS`.
_SAMPLES = 96
_MOST_KEYS = 2000
_NEARLY_PARALLEL = 1e-6


@dataclass(frozen=True)
class _Channel:
    """An animated transform of a node: values (k, width) at times (k,) [seconds]; for cubic splines (k, 3,
    width), each with its tangent in and out.
    """

    times: Vectors
    values: Vectors
    interpolation: str


def read_cameras(document: GltfDocument, nodes: Sequence[PlacedNode]) -> tuple[CameraPath | None, list[Note]]:
    """The perspective cameras of the scene as one path, in the order of the nodes; None where there are none.

    A camera that is animated, or hangs below a node that is, counts at each moment, in every animation for
    itself. The narrowest angle of view holds for all, since it shows the most detail. Orthographic cameras
    are passed over with a note.
    """
    entries = document.json.get("cameras", [])
    by_number = {node.number: node for node in nodes}
    animations = [_channels(document, animation) for animation in document.json.get("animations", [])]
    poses, angles, aspects, flat = [], [], [], 0
    for node in nodes:
        if "camera" not in node.entry:
            continue
        check_index(node.entry["camera"], entries, "camera")
        camera = entries[node.entry["camera"]]
        if camera["type"] != "perspective":
            flat += 1
            continue
        lens = camera["perspective"]
        angles.append(_positive_number(lens["yfov"], "yfov"))
        aspects.append(_positive_number(lens.get("aspectRatio", ASPECT), "aspectRatio"))
        poses.append(_poses(by_number, node, animations))
    notes = [Note("W-OBJECT", flat, "orthographic cameras were passed over")] if flat else []
    if not poses:
        return None, notes
    narrowest = int(np.argmin(angles))
    matrices = np.concatenate(poses)
    backward = matrices[:, :3, 2]
    length = np.linalg.norm(backward, axis=1, keepdims=True)
    if not np.isfinite(matrices).all() or not (length > 0).all():
        raise CorruptError("the transform of a camera is not finite, or flattens it")
    path = CameraPath(
        positions=matrices[:, :3, 3],
        directions=-backward / length,
        field_of_view=math.degrees(angles[narrowest]),
        aspect=aspects[narrowest],
    )
    return path, notes


def animated_nodes(document: GltfDocument) -> set[int]:
    """The numbers of the nodes that an animation moves."""
    return {
        channel["target"]["node"]
        for animation in document.json.get("animations", [])
        for channel in animation["channels"]
        if channel["target"].get("path") in AT_REST and "node" in channel["target"]
    }


def _poses(
    nodes: Mapping[int, PlacedNode], camera: PlacedNode, animations: Sequence[dict[int, dict[str, _Channel]]]
) -> NDArray[np.float64]:
    """Matrices to the world (k, 4, 4) of a node in all animations that move it; at rest where none does."""
    line = [camera]
    while line[-1].parent >= 0:
        line.append(nodes[line[-1].parent])
    poses = []
    for channels in animations:
        moving = [channel for node in line for channel in channels.get(node.number, {}).values()]
        if not moving:
            continue
        times = _moments(moving)
        matrices = np.broadcast_to(np.eye(4), (len(times), 4, 4))
        for node in line:
            own = channels.get(node.number)
            matrix = node_matrix(node.entry)[None] if own is None else _moved(node.entry, own, times)
            matrices = np.einsum("...ij,...jk->...ik", matrix, matrices)
        poses.append(matrices)
    return np.concatenate(poses) if poses else camera.matrix[None]


def _moments(channels: Sequence[_Channel]) -> Vectors:
    """When to look: at every key, and evenly between the first and the last."""
    keys = np.unique(np.concatenate([channel.times for channel in channels]))
    even = np.linspace(keys[0], keys[-1], _SAMPLES)
    return np.unique(np.concatenate([even, keys])) if len(keys) <= _MOST_KEYS else even


def _moved(entry: dict[str, Any], channels: Mapping[str, _Channel], times: Vectors) -> NDArray[np.float64]:
    """Matrices (k, 4, 4) of a node at `times` (k,)."""
    if "matrix" in entry:
        raise CorruptError("an animated node has a matrix")
    parts = []
    for name, rest in AT_REST.items():
        if name in channels:
            parts.append(_at(channels[name], times, is_rotation=name == "rotation"))
        else:
            parts.append(np.tile(np.array(entry.get(name, rest), np.float64), (len(times), 1)))
    return trs_matrices(*parts)


def _at(channel: _Channel, times: Vectors, *, is_rotation: bool) -> Vectors:
    """Values of a channel at `times` (k,), (k, width); the first and the last hold before and after."""
    times = np.clip(times, channel.times[0], channel.times[-1])
    after = np.clip(np.searchsorted(channel.times, times, side="right"), 1, max(len(channel.times) - 1, 1))
    before = after - 1
    if len(channel.times) == 1:
        after = before
    span = channel.times[after] - channel.times[before]
    share = np.divide(times - channel.times[before], span, out=np.zeros_like(times), where=span > 0)[:, None]
    if channel.interpolation == "STEP":
        last = share[:, 0] >= 1.0
        return channel.values[np.where(last, after, before)]
    if channel.interpolation == "CUBICSPLINE":
        values = _hermite(channel.values[before], channel.values[after], span[:, None], share)
    elif is_rotation:
        values = _slerp(channel.values[before], channel.values[after], share)
    else:
        values = (1.0 - share) * channel.values[before] + share * channel.values[after]
    return values / np.linalg.norm(values, axis=1, keepdims=True) if is_rotation else values


def _hermite(before: Vectors, after: Vectors, span: Vectors, t: Vectors) -> Vectors:
    """Cubic Hermite splines between keys (k, 3, width): tangent in, value, tangent out."""
    return (
        (2 * t**3 - 3 * t**2 + 1) * before[:, 1]
        + span * (t**3 - 2 * t**2 + t) * before[:, 2]
        + (-2 * t**3 + 3 * t**2) * after[:, 1]
        + span * (t**3 - t**2) * after[:, 0]
    )


def _slerp(before: Vectors, after: Vectors, t: Vectors) -> Vectors:
    """Between quaternions (k, 4) along the shorter way (Shoemake 1985)."""
    cosine = np.sum(before * after, axis=1, keepdims=True)
    after = np.where(cosine < 0, -after, after)
    angle = np.arccos(np.clip(np.abs(cosine), 0.0, 1.0))
    sine = np.sin(angle)
    near = sine < _NEARLY_PARALLEL
    safe = np.where(near, 1.0, sine)
    first = np.where(near, 1.0 - t, np.sin((1.0 - t) * angle) / safe)
    second = np.where(near, t, np.sin(t * angle) / safe)
    return first * before + second * after


def _channels(document: GltfDocument, animation: dict[str, Any]) -> dict[int, dict[str, _Channel]]:
    """The channels of an animation that move nodes, by node and by what they change."""
    found: dict[int, dict[str, _Channel]] = {}
    for entry in animation["channels"]:
        target = entry["target"]
        name = target.get("path")
        if "node" not in target or name not in AT_REST:
            continue
        check_index(target["node"], document.json.get("nodes", []), "node")
        check_index(entry["sampler"], animation["samplers"], "sampler")
        sampler = animation["samplers"][entry["sampler"]]
        found.setdefault(target["node"], {})[name] = _channel(document, sampler, len(AT_REST[name]))
    return found


def _channel(document: GltfDocument, sampler: dict[str, Any], width: int) -> _Channel:
    times = document.accessor(sampler["input"], ("SCALAR",), FLOATS).ravel()
    values = document.accessor(sampler["output"], (f"VEC{width}",), _COMPONENTS_OF_ANIMATIONS)
    interpolation = sampler.get("interpolation", "LINEAR")
    if interpolation not in ("LINEAR", "STEP", "CUBICSPLINE"):
        raise CorruptError(f"an animation interpolates by {str(interpolation)[:40]!r}")
    if not (np.diff(times) > 0).all() or not np.isfinite(times).all():
        raise CorruptError("the times of an animation do not rise")
    rows = 3 * len(times) if interpolation == "CUBICSPLINE" else len(times)
    if len(values) != rows:
        raise CorruptError(f"an animation has {len(values)} values for {len(times)} times")
    if interpolation == "CUBICSPLINE":
        values = values.reshape(len(times), 3, width)
    return _Channel(times, values, interpolation)


_COMPONENTS_OF_ANIMATIONS = NORMALISED | {(5120, True), (5122, True)}


def _positive_number(value: object, name: str) -> float:
    if type(value) not in (int, float) or not (0.0 < value < math.inf):  # type: ignore[operator]
        raise CorruptError(f"{name} is {value!r}, but must be a number above 0")
    return float(value)  # type: ignore[arg-type]
