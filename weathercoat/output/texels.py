"""Pictures that surfaces show, filtered to what a sample of the picture covers, so that nothing shimmers or
makes moire from afar.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.errors import CorruptError
from weathercoat.mesh.materials import Texture
from weathercoat.mesh.surface import Indices, Vectors
from weathercoat.output.shading import to_linear

REPEAT, CLAMP, MIRROR = range(3)
_WRAPS = {10497: REPEAT, 33071: CLAMP, 33648: MIRROR}  # glTF 2.0, section 5.26 (sampler)
_MOST_PROBES = 8  # along the longer axis of what a sample covers
_WHOLE = 65535
_AS_IT_IS = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)


@dataclass(frozen=True)
class Texels:
    """A picture and its reductions to half, a quarter and so on, down to one texel.

    values: uint16 (n, channels), linear, 65535 for 1, the rows of all levels one after the other. levels:
    int64 (l, 3), of each the first row of `values`, the height and the width. wrap: what lies beyond the
    edges across and down the picture. transform: of texture coordinates with their origin at the upper left,
    rows (a, b, c): u' = a u + b v + c.
    """

    values: NDArray[np.uint16]
    levels: NDArray[np.int64]
    wrap: tuple[int, int] = (REPEAT, REPEAT)
    transform: tuple[float, ...] = _AS_IT_IS

    def at(self, footprint: Footprint) -> NDArray[np.float32]:
        """The mean over each footprint, 0 to 1, float32 (s, channels)."""
        out = np.empty((len(footprint.uv), self.values.shape[1]), np.float32)
        matrix = np.array(self.transform).reshape(2, 3)
        linear = np.ascontiguousarray(matrix[:, :2].T)
        _filter_texels(
            self.values,
            self.levels,
            self.wrap[0],
            self.wrap[1],
            np.einsum("si,ij->sj", footprint.uv, linear) + matrix[:, 2],
            np.einsum("si,ij->sj", footprint.across, linear),
            np.einsum("si,ij->sj", footprint.down, linear),
            out,
        )
        return out


@dataclass(frozen=True)
class Footprint:
    """What samples of a picture cover of a texture: the place uv (s, 2), its origin at the upper left, and by
    how much it changes to the next sample across and down the picture, (s, 2) each.
    """

    uv: Vectors
    across: Vectors
    down: Vectors


def make_texels(
    pixels: NDArray[np.uint8] | NDArray[np.uint16],
    *,
    is_color: bool,
    wrap: tuple[int, int] = (REPEAT, REPEAT),
    transform: tuple[float, ...] = _AS_IT_IS,
) -> Texels:
    """Texels of a picture (h, w, channels); is_color: its values are sRGB-encoded, not linear."""
    whole = np.iinfo(pixels.dtype).max
    steps = np.arange(whole + 1) / whole
    encoded = np.rint(_WHOLE * (to_linear(steps) if is_color else steps)).astype(np.uint16)
    level = encoded[pixels]
    parts, levels, first = [], [], 0
    while True:
        height, width = level.shape[:2]
        parts.append(level.reshape(height * width, -1))
        levels.append((first, height, width))
        first += height * width
        if height == width == 1:
            return Texels(np.concatenate(parts), np.array(levels, np.int64), wrap, transform)
        level = _halved(_halved(level).transpose(1, 0, 2)).transpose(1, 0, 2)


def _halved(values: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """Half as many rows of values (n, k, channels), rounded down, each the mean of what it covers."""
    count = len(values)
    half = count // 2
    if count == 1:
        return values
    if count % 2 == 0:
        return ((values[0::2].astype(np.uint32) + values[1::2] + 1) >> 1).astype(np.uint16)
    row = np.arange(half, dtype=np.uint64)[:, None, None]
    total = (half - row) * values[0:-1:2] + half * values[1::2].astype(np.uint64) + (row + 1) * values[2::2]
    return ((total + np.uint64(half)) // np.uint64(count)).astype(np.uint16)


def read_texels(texture: Texture, place: Mapping[str, Any], *, is_color: bool) -> Texels:
    """Texels of a texture of the input; `place` is the glTF entry that refers to it.

    Raises CorruptError where the picture cannot be decoded.
    """
    sampler = texture.sampler
    wrap = (
        _WRAPS.get(sampler.get("wrapS", 10497), REPEAT),
        _WRAPS.get(sampler.get("wrapT", 10497), REPEAT),
    )
    return _decoded(texture.image, texture.name, is_color, wrap, _transform(place))


@lru_cache(maxsize=8)  # a run draws the same few textures again and again
def _decoded(
    image: bytes, name: str, is_color: bool, wrap: tuple[int, int], transform: tuple[float, ...]
) -> Texels:
    from PIL import Image

    try:
        with Image.open(BytesIO(image)) as opened:
            pixels = np.asarray(opened.convert("RGB"))
    except (OSError, ValueError, Image.DecompressionBombError) as error:
        raise CorruptError(
            f"the texture {name!r} cannot be decoded", remedy="use PNG, JPEG or WebP, or repair it"
        ) from error
    return make_texels(pixels, is_color=is_color, wrap=wrap, transform=transform)


def _transform(place: Mapping[str, Any]) -> tuple[float, ...]:
    """The matrix of the extension KHR_texture_transform, by its specification."""
    entry = place.get("extensions", {}).get("KHR_texture_transform")
    if entry is None:
        return _AS_IT_IS
    x, y = entry.get("offset", (0.0, 0.0))
    sx, sy = entry.get("scale", (1.0, 1.0))
    turn = float(entry.get("rotation", 0.0))
    c, s = float(np.cos(turn)), float(np.sin(turn))
    return (c * sx, s * sy, float(x), -s * sx, c * sy, float(y))


@kernel
def measure_footprints(
    face: Indices,
    weights: NDArray[np.float32],
    vertices: Vectors,
    faces: Indices,
    uv: NDArray[np.float32],
    eye: Vectors,
    forward: Vectors,
    across: Vectors,
    down: Vectors,
    out_uv: Vectors,
    out_across: Vectors,
    out_down: Vectors,
) -> None:
    """Texture coordinates of samples and their change to the next sample across and down the picture.

    face (s,), weights (s, 2): where the samples lie on the mesh of `vertices` (n, 3) and `faces` (t, 3). uv
    (t, 3, 2), v upwards. eye, forward: of the camera; across, down (3,): the change of a ray's direction,
    whose component along `forward` is 1, from one sample to the next. Results (s, 2), v downwards.

    Source: Igehy, Tracing ray differentials, 1999.
    """
    e, f, n, ray, way = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for s in range(len(face)):
        t = face[s]
        a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
        v, w = np.float64(weights[s, 0]), np.float64(weights[s, 1])
        depth = 0.0
        for x in range(3):
            e[x] = vertices[b, x] - vertices[a, x]
            f[x] = vertices[c, x] - vertices[a, x]
            ray[x] = vertices[a, x] + v * e[x] + w * f[x] - eye[x]
            depth += ray[x] * forward[x]
        squared, facing, length = 0.0, 0.0, 0.0
        for x in range(3):
            y, z = (x + 1) % 3, (x + 2) % 3
            n[x] = e[y] * f[z] - e[z] * f[y]
            squared += n[x] * n[x]
            facing += n[x] * ray[x]
            length += ray[x] * ray[x]
        least = 1e-3 * np.sqrt(squared * length)  # a face seen from its edge covers no end of texture
        facing = min(facing, -least) if facing < 0.0 else max(facing, least)
        for axis in range(2):
            e_uv = np.float64(uv[t, 1, axis]) - uv[t, 0, axis]
            f_uv = np.float64(uv[t, 2, axis]) - uv[t, 0, axis]
            value = uv[t, 0, axis] + v * e_uv + w * f_uv
            out_uv[s, axis] = 1.0 - value if axis == 1 else value
            sign = -1.0 if axis == 1 else 1.0
            for step in range(2):
                turned = 0.0
                for x in range(3):
                    way[x] = depth * (across[x] if step == 0 else down[x])
                    turned += n[x] * way[x]
                along_e, along_f = 0.0, 0.0
                for x in range(3):
                    way[x] -= ray[x] * turned / facing
                for x in range(3):
                    y, z = (x + 1) % 3, (x + 2) % 3
                    along_e += (way[y] * f[z] - way[z] * f[y]) * n[x]
                    along_f += (e[y] * way[z] - e[z] * way[y]) * n[x]
                change = sign * (along_e * e_uv + along_f * f_uv) / max(squared, 1e-300)
                if step == 0:
                    out_across[s, axis] = change
                else:
                    out_down[s, axis] = change


@kernel
def _wrapped(place: float, wrap: int) -> float:
    """A coordinate within one period of what lies beyond the edge, so that any number is a valid one."""
    if wrap == REPEAT:
        return place - np.floor(place)
    if wrap == MIRROR:
        return place - 2.0 * np.floor(0.5 * place)
    return min(max(place, -1.0), 2.0)


@kernel
def _texel(index: int, count: int, wrap: int) -> int:
    """The texel, of `count` in a row, that is shown at `index`."""
    if wrap == REPEAT:
        index = index % count
    elif wrap == MIRROR:
        index = index % (2 * count)
        index = min(index, 2 * count - 1 - index)
    return min(max(index, 0), count - 1)


@kernel
def _add_bilinear(
    values: NDArray[np.uint16],
    first: int,
    height: int,
    width: int,
    wrap_u: int,
    wrap_v: int,
    u: float,
    v: float,
    share: float,
    total: Vectors,
) -> None:
    x, y = _wrapped(u, wrap_u) * width - 0.5, _wrapped(v, wrap_v) * height - 0.5
    left, top = np.floor(x), np.floor(y)
    right_share, low_share = x - left, y - top
    for j in range(2):
        row = _texel(np.int64(top) + j, height, wrap_v)
        w_row = share * (low_share if j == 1 else 1.0 - low_share)
        for i in range(2):
            column = _texel(np.int64(left) + i, width, wrap_u)
            weight = w_row * (right_share if i == 1 else 1.0 - right_share)
            at = first + row * width + column
            for c in range(len(total)):
                total[c] += weight * values[at, c]


@kernel
def _filter_texels(
    values: NDArray[np.uint16],
    levels: NDArray[np.int64],
    wrap_u: int,
    wrap_v: int,
    uv: Vectors,
    across: Vectors,
    down: Vectors,
    out: NDArray[np.float32],
) -> None:
    """The mean of the texture over the parallelograms round `uv` (s, 2) of the sides `across` and `down`.

    Probes along the longer side, of the level whose texels are as large as the shorter one (EXT_texture_
    filter_anisotropic), each linear between the texels and between two levels.
    """
    channels = values.shape[1]
    total = np.empty(channels)
    height, width = levels[0, 1], levels[0, 2]
    for s in range(len(uv)):
        long = np.sqrt((across[s, 0] * width) ** 2 + (across[s, 1] * height) ** 2)
        short = np.sqrt((down[s, 0] * width) ** 2 + (down[s, 1] * height) ** 2)
        way_u, way_v = across[s, 0], across[s, 1]
        if short > long:
            long, short = short, long
            way_u, way_v = down[s, 0], down[s, 1]
        probes = int(min(max(np.rint(long / max(short, 1.0)), 1.0), _MOST_PROBES))
        level = min(np.log2(max(long / probes, 1.0)), len(levels) - 1.0)
        coarse_share = level - np.floor(level)
        fine = int(level)
        coarse = min(fine + 1, len(levels) - 1)
        total[:] = 0.0
        for probe in range(probes):
            along = (probe + 0.5) / probes - 0.5
            u, v = uv[s, 0] + along * way_u, uv[s, 1] + along * way_v
            _add_bilinear(
                values, levels[fine, 0], levels[fine, 1], levels[fine, 2], wrap_u, wrap_v, u, v,
                (1.0 - coarse_share) / probes, total,
            )  # fmt: skip
            if coarse_share > 0.0:
                _add_bilinear(
                    values, levels[coarse, 0], levels[coarse, 1], levels[coarse, 2], wrap_u, wrap_v, u, v,
                    coarse_share / probes, total,
                )  # fmt: skip
        for c in range(channels):
            out[s, c] = total[c] / _WHOLE
