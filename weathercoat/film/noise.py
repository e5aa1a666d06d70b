"""Named random streams tied to places, and Perlin's improved noise.

Every random number is a hash of (seed, name of the stream, position quantised to 1e-6 of the size): it does
not hang on the numbering of the mesh, nor on how many other numbers were drawn.
"""

from __future__ import annotations

import math
import zlib

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.mesh.surface import Vectors

_QUANTUM = 1e-6
_SHIFT = 0.381966  # of a quantum: keeps simple fractions, where grids have vertices, off its bounds

# The permutation of Perlin's reference implementation of improved noise, 2002.
PERMUTATION = np.array(
    """151 160 137 91 90 15 131 13 201 95 96 53 194 233 7 225 140 36 103 30 69 142 8 99 37 240 21 10 23 190
    6 148 247 120 234 75 0 26 197 62 94 252 219 203 117 35 11 32 57 177 33 88 237 149 56 87 174 20 125
    136 171 168 68 175 74 165 71 134 139 48 27 166 77 146 158 231 83 111 229 122 60 211 133 230 220 105
    92 41 55 46 245 40 244 102 143 54 65 25 63 161 1 216 80 73 209 76 132 187 208 89 18 169 200 196 135
    130 116 188 159 86 164 100 109 198 173 186 3 64 52 217 226 250 124 123 5 202 38 147 118 126 255 82
    85 212 207 206 59 227 47 16 58 17 182 189 28 42 223 183 170 213 119 248 152 2 44 154 163 70 221 153
    101 155 167 43 172 9 129 22 39 253 19 98 108 110 79 113 224 232 178 185 112 104 218 246 97 228 251
    34 242 193 238 210 144 12 191 179 162 241 81 51 145 235 249 14 239 107 49 192 214 31 181 199 106 157
    184 84 204 176 115 121 50 45 127 4 150 254 138 236 205 93 222 114 67 29 24 72 243 141 128 195 78 66
    215 61 156 180""".split(),  # noqa: SIM905
    dtype=np.int64,
)


def stream_key(seed: int, name: str) -> np.uint64:
    """The key of the stream `name` under `seed`."""
    return np.uint64((seed * 0x9E3779B97F4A7C15 + zlib.crc32(name.encode()) * 0xD1B54A32D192ED03) % 2**64)


def hash_uniform(points: Vectors, key: np.uint64) -> Vectors:
    """A number in [0, 1) for each of the points (n, 3), given in sizes."""
    cells = np.floor(points / _QUANTUM + _SHIFT).astype(np.int64).view(np.uint64)
    out = np.empty(len(points))
    with np.errstate(over="ignore"):  # without the JIT, NumPy warns of what is meant to wrap round
        _hash_points(cells, key, out)
    return out


def hash_bits(points: Vectors, key: np.uint64) -> NDArray[np.uint64]:
    """A 53-bit hash for each of the points (n, 3), given in sizes, for breaking ties."""
    return (hash_uniform(points, key) * 2.0**53).astype(np.uint64)


@kernel
def _mix(value: np.uint64) -> np.uint64:
    """The finaliser of SplitMix64 (Steele, Lea and Flood, 2014)."""
    value = (value ^ (value >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    value = (value ^ (value >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return value ^ (value >> np.uint64(31))


@kernel
def _hash_points(cells: NDArray[np.uint64], key: np.uint64, out: Vectors) -> None:
    for i in range(len(cells)):
        value = _mix(key + np.uint64(0x9E3779B97F4A7C15))
        for axis in range(3):
            value = _mix(value ^ (cells[i, axis] + np.uint64(0x9E3779B97F4A7C15)))
        out[i] = float(value >> np.uint64(11)) / 9007199254740992.0


@kernel
def _gradient(corner: int, x: float, y: float, z: float) -> float:
    """Dot product with the gradient of a corner: one of the twelve edge directions of a cube."""
    h = corner & 15
    u = x if h < 8 else y
    if h < 4:
        v = y
    elif h == 12 or h == 14:
        v = x
    else:
        v = z
    return (u if h & 1 == 0 else -u) + (v if h & 2 == 0 else -v)


@kernel
def perlin(x: float, y: float, z: float, table: NDArray[np.int64]) -> float:
    """Improved noise at a point, in [-1, 1], zero on the lattice; table is `PERMUTATION`.

    Source: Perlin, Improving noise, 2002.
    """
    fx, fy, fz = math.floor(x), math.floor(y), math.floor(z)
    ix, iy, iz = int(fx) & 255, int(fy) & 255, int(fz) & 255
    x, y, z = x - fx, y - fy, z - fz
    u = x * x * x * (x * (x * 6 - 15) + 10)
    v = y * y * y * (y * (y * 6 - 15) + 10)
    w = z * z * z * (z * (z * 6 - 15) + 10)
    total = 0.0
    for dx in range(2):
        a = table[(ix + dx) & 255]
        wx = u if dx else 1.0 - u
        for dy in range(2):
            b = table[(a + iy + dy) & 255]
            wy = v if dy else 1.0 - v
            for dz in range(2):
                wz = w if dz else 1.0 - w
                total += wx * wy * wz * _gradient(table[(b + iz + dz) & 255], x - dx, y - dy, z - dz)
    return total


@kernel
def _fractal(points: Vectors, octaves: int, gain: float, table: NDArray[np.int64], out: Vectors) -> None:
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        weight = 1.0
        value = 0.0
        for _ in range(octaves):
            value += weight * perlin(x, y, z, table)
            # an irrational shift keeps the octaves' lattices, where noise is zero, from falling on one
            # another
            x, y, z = 2.0 * x + 17.31, 2.0 * y + 5.77, 2.0 * z + 29.13
            weight *= gain
        out[i] = value


def fractal_noise(
    points: Vectors, *, wavelength: float, octaves: int, gain: float, key: np.uint64
) -> Vectors:
    """Sum of octaves of noise, each half as long as the one before and `gain` times as strong; about -1 to 1.

    points: (n, 3), in sizes; wavelength: of the first octave, in sizes. The stream's key moves the lattice.
    """
    out = np.empty(len(points))
    shift = hash_uniform(np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), key) * 256.0
    _fractal(points / wavelength + shift, octaves, gain, PERMUTATION, out)
    return out
