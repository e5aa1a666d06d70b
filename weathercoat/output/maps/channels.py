"""Which maps there are, what their channels hold and how their numbers are to be read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.errors import UsageError
from weathercoat.mesh.surface import Indices
from weathercoat.output.maps import planes as planes_of
from weathercoat.output.maps.planes import Planes

_STEPS = 65536  # of the table by which linear light becomes sRGB


@dataclass(frozen=True)
class Channel:
    """A channel of a map: the plane it shows, the value outside of all charts, and what 0 and 1 stand for."""

    plane: int
    outside: float = 0.0
    low: float = 0.0
    high: float = 1.0


@dataclass(frozen=True)
class MapKind:
    """A map: its channels, and whether they are colours (sRGB in PNG, linear in EXR)."""

    channels: tuple[Channel, ...]
    is_color: bool = False


SCALARS = {
    "occlusion": Channel(planes_of.OCCLUSION, 1.0),
    "roughness": Channel(planes_of.ROUGHNESS, 1.0),
    "metalness": Channel(planes_of.METALNESS),
    "height": Channel(planes_of.HEIGHT),
    "bare": Channel(planes_of.BARE),
    "rust": Channel(planes_of.RUST),
    "dirt": Channel(planes_of.DIRT),
    "crack": Channel(planes_of.CRACKED),
    "lift": Channel(planes_of.LIFT),
    "separated": Channel(planes_of.SEPARATED),
    "age": Channel(planes_of.AGE),
}
MAPS: dict[str, MapKind] = {
    "base_color": MapKind(
        tuple(Channel(plane) for plane in (planes_of.RED, planes_of.GREEN, planes_of.BLUE)), True
    ),
    "orm": MapKind((SCALARS["occlusion"], SCALARS["roughness"], SCALARS["metalness"])),
    "normal": MapKind(
        (
            Channel(planes_of.NORMAL_X, 0.0, -1.0, 1.0),
            Channel(planes_of.NORMAL_Y, 0.0, -1.0, 1.0),
            Channel(planes_of.NORMAL_Z, 1.0, -1.0, 1.0),
        )
    ),
    **{
        name: MapKind((SCALARS[name],))
        for name in ("height", "bare", "rust", "dirt", "crack", "lift", "separated", "age")
    },
}
PACKED = "packed"


def parse_pack(text: str) -> tuple[str, tuple[str, ...]]:
    """The name of a packed map and the values in its channels, of `R=rust,G=dirt` or `name:R=rust,G=dirt`.

    Channels begin with R, and none is left out. Raises UsageError.
    """
    name, _, channels = text.rpartition(":")
    name = name or PACKED
    given: dict[str, str] = {}
    for part in channels.split(","):
        letter, _, value = (piece.strip() for piece in part.partition("="))
        letter = letter.upper()
        if letter not in ("R", "G", "B", "A") or letter in given:
            raise UsageError(
                f"a packed map has the channels R, G, B and A once each, not {letter or text!r}",
                remedy="such as --pack R=rust,G=dirt,B=bare,A=crack",
            )
        if value not in SCALARS:
            raise UsageError(
                f"there is no map {value!r} with one channel", remedy=f"pack {', '.join(SCALARS)}"
            )
        given[letter] = value
    if sorted(given, key="RGBA".index) != list("RGBA"[: len(given)]):
        raise UsageError(
            f"a packed map has its channels in the order RGBA, without a gap, not {', '.join(given)}",
            remedy="such as --pack R=rust,G=dirt,B=bare",
        )
    if name in MAPS or not name.replace("_", "").replace("-", "").isalnum():
        raise UsageError(f"a packed map cannot be called {name!r}", remedy="take letters, digits, - and _")
    return name, tuple(given[letter] for letter in "RGBA" if letter in given)


def map_kinds(maps: Sequence[str], packs: Sequence[tuple[str, tuple[str, ...]]]) -> dict[str, MapKind]:
    """The wanted maps by name; UsageError for an unknown or repeated one."""
    kinds: dict[str, MapKind] = {}
    for name in maps:
        if name not in MAPS:
            raise UsageError(f"there is no map {name!r}", remedy=f"the maps are {', '.join(MAPS)}")
        kinds[name] = MAPS[name]
    for name, values in packs:
        if name in kinds:
            raise UsageError(f"two maps are called {name!r}", remedy="name packed maps, as in a:R=rust")
        kinds[name] = MapKind(tuple(SCALARS[value] for value in values))
    return kinds


def fitted(kind: MapKind, ranges: Mapping[int, tuple[float, float]], outside: Mapping[int, float]) -> MapKind:
    """The map with what depends on the model: by plane, what 0 and 1 stand for, and the value outside."""
    channels = tuple(
        Channel(c.plane, outside.get(c.plane, c.outside), *ranges.get(c.plane, (c.low, c.high)))
        for c in kind.channels
    )
    return MapKind(channels, kind.is_color)


def quantised(kind: MapKind, planes: Planes, source: Indices, bits: int) -> NDArray[Any]:
    """Whole numbers of 8 or 16 bits for the texels (r, w) whose values are at `source`, -1 for none;
    (r, w, channels).
    """
    whole = (1 << bits) - 1
    rows, columns = source.shape
    out = np.empty((rows * columns, len(kind.channels)), np.uint8 if bits == 8 else np.uint16)
    table = _srgb_table(whole) if kind.is_color else np.zeros(0, out.dtype)
    for index, channel in enumerate(kind.channels):
        scale = 1.0 / (channel.high - channel.low)
        _quantise(
            planes[channel.plane], source.ravel(), channel.low, scale, channel.outside, whole, table,
            out[:, index],
        )  # fmt: skip
    return out.reshape(rows, columns, -1)


def as_floats(
    kind: MapKind, planes: Planes, source: Indices, factors: Mapping[int, float]
) -> NDArray[np.float16]:
    """Half floats for the texels (r, w), (r, w, channels), multiplied by the `factors` of planes; what is a
    direction is moved to 0 to 1, as in PNG.
    """
    flat = source.ravel()
    out = np.empty((*source.shape, len(kind.channels)), np.float16)
    for index, channel in enumerate(kind.channels):
        values = np.where(flat >= 0, planes[channel.plane][flat], np.float32(channel.outside))
        if channel.low == -1.0:
            values = 0.5 * values + 0.5
        out[..., index] = (values * np.float32(factors.get(channel.plane, 1.0))).reshape(source.shape)
    return out


def _srgb_table(whole: int) -> NDArray[Any]:
    """sRGB numbers for linear light in equal steps of its square root, which are fine where it is dark."""
    linear = (np.arange(_STEPS) / (_STEPS - 1)) ** 2
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1.0 / 2.4) - 0.055)
    return np.rint(whole * encoded).astype(np.uint8 if whole == 255 else np.uint16)


@kernel
def _quantise(
    plane: NDArray[np.float32],
    source: Indices,
    low: float,
    scale: float,
    outside: float,
    whole: int,
    table: NDArray[Any],
    out: NDArray[Any],
) -> None:
    for i in range(len(source)):
        value = np.float64(plane[source[i]]) if source[i] >= 0 else outside
        value = min(max((value - low) * scale, 0.0), 1.0)
        if len(table):
            out[i] = table[int(np.sqrt(value) * 65535.0 + 0.5)]
        else:
            out[i] = int(value * whole + 0.5)
