"""Colour of a point of the picture: procedural paint, primer, steel and rust, lit by a sun, a sky and the
ground.

Everything is in linear light and in units of the object's size (the square root of its area), so the pattern
belongs to the paint and neither to the mesh nor to the picture. Positions are those at rest: the pattern
moves with the film.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.mesh.surface import Vectors

# What a face shows.
FRONT, BACK, RIM, METAL, BARE_PART, OWN_PART = range(6)
# Rows of the palette: colours, but for the optical depth of a full stain in red, green and blue.
PRIMER, STEEL, RUST_RIM, RUST_BODY, RUST_CORE, STAIN, STAIN_DEPTH, DUST, UNPAINTED = range(9)
_OPEN_SHARE = 0.906  # of the horizon's radiance: what a surface under the open sky receives


def to_linear(srgb: object) -> NDArray[np.float64]:
    """Linear light of sRGB values from 0 to 1 (IEC 61966-2-1)."""
    value = np.asarray(srgb, np.float64)
    return np.where(value <= 0.04045, value / 12.92, ((np.maximum(value, 0.0) + 0.055) / 1.055) ** 2.4)


def to_srgb(linear: NDArray[np.floating]) -> NDArray[np.uint8]:
    """sRGB bytes of linear light from 0 to 1 (IEC 61966-2-1)."""
    value = np.clip(linear, 0.0, 1.0)
    value = np.where(value <= 0.0031308, 12.92 * value, 1.055 * value ** (1.0 / 2.4) - 0.055)
    return np.rint(value * 255.0).astype(np.uint8)


@kernel
def _hash(i: int, j: int, k: int) -> np.uint32:
    """32 fixed bits for an integer lattice point (murmur3's finaliser)."""
    h = (
        (np.uint32(i) * np.uint32(0x8DA6B343))
        ^ (np.uint32(j) * np.uint32(0xD8163841))
        ^ (np.uint32(k) * np.uint32(0xCB1AB31F))
    )
    h = np.uint32(h ^ (h >> np.uint32(16)))
    h = np.uint32(h * np.uint32(0x85EBCA6B))
    h = np.uint32(h ^ (h >> np.uint32(13)))
    h = np.uint32(h * np.uint32(0xC2B2AE35))
    return np.uint32(h ^ (h >> np.uint32(16)))


@kernel
def gradient_noise(x: float, y: float, z: float, slope: Vectors) -> float:
    """Gradient noise in about [0, 1] with one random gradient per unit cell corner; its own gradient goes to
    `slope` (3,).

    Bumps need the gradient, so this is not the noise of the film. Source of the method: Perlin, Improving
    noise, 2002.
    """
    fx, fy, fz = np.floor(x), np.floor(y), np.floor(z)
    i, j, k = np.int64(fx), np.int64(fy), np.int64(fz)
    u, v, w = x - fx, y - fy, z - fz
    su = u * u * u * (u * (u * 6.0 - 15.0) + 10.0)
    sv = v * v * v * (v * (v * 6.0 - 15.0) + 10.0)
    sw = w * w * w * (w * (w * 6.0 - 15.0) + 10.0)
    du = 30.0 * u * u * (u * (u - 2.0) + 1.0)
    dv = 30.0 * v * v * (v * (v - 2.0) + 1.0)
    dw = 30.0 * w * w * (w * (w - 2.0) + 1.0)
    value, gx, gy, gz = 0.0, 0.0, 0.0, 0.0
    for corner in range(8):
        a, b, c = corner & 1, (corner >> 1) & 1, corner >> 2
        bits = _hash(i + a, j + b, k + c)
        px = np.float64(bits & np.uint32(1023)) * (2.0 / 1023.0) - 1.0
        py = np.float64((bits >> np.uint32(10)) & np.uint32(1023)) * (2.0 / 1023.0) - 1.0
        pz = np.float64((bits >> np.uint32(20)) & np.uint32(1023)) * (2.0 / 1023.0) - 1.0
        wx, dx = (su, du) if a else (1.0 - su, -du)
        wy, dy = (sv, dv) if b else (1.0 - sv, -dv)
        wz, dz = (sw, dw) if c else (1.0 - sw, -dw)
        rise = px * (u - a) + py * (v - b) + pz * (w - c)
        value += wx * wy * wz * rise
        gx += wx * wy * wz * px + dx * wy * wz * rise
        gy += wx * wy * wz * py + wx * dy * wz * rise
        gz += wx * wy * wz * pz + wx * wy * dz * rise
    slope[0], slope[1], slope[2] = 0.9 * gx, 0.9 * gy, 0.9 * gz
    return 0.5 + 0.9 * value


@kernel
def fractal_noise(
    x: float, y: float, z: float, frequency: float, octaves: int, slope: Vectors, scratch: Vectors
) -> float:
    """Octaves of noise, each half as high and 2.03 times as fine, about [0, 1]; gradient to `slope` (3,)."""
    total, weight, height, f = 0.0, 0.0, 1.0, frequency
    slope[0] = slope[1] = slope[2] = 0.0
    for octave in range(octaves):
        shift = 17.31 * octave
        total += height * gradient_noise(x * f + shift, y * f + 1.7 * shift, z * f + 2.3 * shift, scratch)
        for axis in range(3):
            slope[axis] += height * f * scratch[axis]
        weight += height
        height *= 0.5
        f *= 2.03
    for axis in range(3):
        slope[axis] /= weight
    return total / weight


@kernel
def _smooth_step(low: float, high: float, x: float) -> float:
    t = min(1.0, max(0.0, (x - low) / (high - low)))
    return t * t * (3.0 - 2.0 * t)


@kernel
def _copy(color: Vectors, out: Vectors) -> None:
    for c in range(3):  # a slice would compile NumPy's broadcasting, which takes seconds
        out[c] = color[c]


@kernel
def _blend(color: Vectors, other: Vectors, share: float) -> None:
    for c in range(3):
        color[c] += share * (other[c] - color[c])


@kernel
def _rust_layer(
    rest: Vectors,
    amount: float,
    palette: Vectors,
    albedo: Vectors,
    bump: Vectors,
    slope: Vectors,
    scratch: Vectors,
) -> float:
    """Lay rust of a given `amount` (0 to 1) over `albedo`, roughen `bump`; returns the share of the surface
    it covers.

    Rust spreads where the amount exceeds a noise, so it grows as patches with an irregular edge: bright where
    it is young (just above the threshold), dark brown in the core, with darker pits.
    """
    if amount <= 0.004:
        return 0.0
    x, y, z = rest[0], rest[1], rest[2]
    patch = fractal_noise(x, y, z, 9.0, 4, slope, scratch)
    grain = fractal_noise(x, y, z, 64.0, 4, slope, scratch)
    level = 1.5 * amount - 1.6 * (patch - 0.2) + 0.5 * (grain - 0.5) * (1.0 - 0.5 * amount)
    # Ahead of the rust proper the steel is tarnished.
    _blend(albedo, palette[RUST_CORE], 0.45 * _smooth_step(-0.4, 0.05, level))
    cover = _smooth_step(-0.05, 0.12, level)
    if cover <= 0.0:
        return 0.0
    region = gradient_noise(x * 4.3 + 5.0, y * 4.3, z * 4.3, scratch)
    mottle = 0.45 * patch + 0.55 * grain
    age = level + 2.4 * (0.5 - mottle) + 0.5 * (region - 0.5)
    body = _smooth_step(0.0, 0.4, age)
    core = 0.9 * _smooth_step(0.25, 1.2, age)
    powder = 0.55 * _smooth_step(0.54, 0.7, mottle) * _smooth_step(0.3, 0.7, region)
    pit = _smooth_step(0.6, 0.7, grain) * _smooth_step(0.2, 0.6, level)
    shade = 0.5 + 0.85 * grain
    for c in range(3):
        rust = palette[RUST_RIM, c] + body * (palette[RUST_BODY, c] - palette[RUST_RIM, c])
        rust += core * (palette[RUST_CORE, c] - rust)
        rust += powder * (palette[RUST_RIM, c] - rust)
        rust *= shade * (1.0 - 0.7 * pit)
        albedo[c] += cover * (rust - albedo[c])
    for axis in range(3):
        bump[axis] += cover * 0.009 * slope[axis]
    return cover


@kernel
def _brushed(rest: Vectors, bump: Vectors, slope: Vectors) -> float:
    """Fine scratches along one direction of the metal, to `bump`; returns how bright they are, 0 to 1."""
    x, y, z = rest[0], rest[1], rest[2]
    along, across, over = 0.8 * x + 0.36 * y + 0.48 * z, -0.6 * x + 0.48 * y + 0.64 * z, -0.8 * y + 0.6 * z
    value = gradient_noise(5.0 * along, 240.0 * across, 240.0 * over, slope)
    a, b, c = 5.0 * slope[0], 240.0 * slope[1], 240.0 * slope[2]
    bump[0] += 0.00012 * (0.8 * a - 0.6 * b)
    bump[1] += 0.00012 * (0.36 * a + 0.48 * b - 0.8 * c)
    bump[2] += 0.00012 * (0.48 * a + 0.64 * b + 0.6 * c)
    return value


@kernel
def _film_color(
    rest: Vectors,
    up: Vectors,
    stain: float,
    dust: float,
    is_own: bool,
    palette: Vectors,
    albedo: Vectors,
    bump: Vectors,
    slope: Vectors,
    scratch: Vectors,
) -> tuple[float, float]:
    """Paint with runoff rust and dust over it, to `albedo`; returns its roughness and its gloss (0 to 1).

    Paint of one colour is given some life, but one that shows a picture of its own (`is_own`).
    """
    x, y, z = rest[0], rest[1], rest[2]
    cloud = fractal_noise(x, y, z, 6.0, 5, slope, scratch)
    if not is_own:
        for c in range(3):
            albedo[c] *= 0.84 + 0.32 * cloud
    gradient_noise(x * 95.0, y * 95.0, z * 95.0, slope)
    for axis in range(3):
        bump[axis] += 0.02 * slope[axis]  # orange peel
    roughness, gloss = 0.20 + 0.20 * cloud, 1.0
    if stain > 0.01:
        # Streaks: fine across the fall line, long along it.
        fall = x * up[0] + y * up[1] + z * up[2]
        sx, sy, sz = x - fall * up[0], y - fall * up[1], z - fall * up[2]
        streak = fractal_noise(
            42.0 * sx + 4.0 * fall * up[0],
            42.0 * sy + 4.0 * fall * up[1],
            42.0 * sz + 4.0 * fall * up[2],
            1.0,
            3,
            slope,
            scratch,
        )
        cover = _smooth_step(0.0, 0.9, stain * (0.3 + 2.0 * max(0.0, streak - 0.15)))
        for c in range(3):
            # A thin stain filters the paint's light, a thick one covers it.
            albedo[c] *= np.exp(-cover * palette[STAIN_DEPTH, c])
        _blend(albedo, palette[STAIN], 0.85 * cover**1.3)
        roughness += 0.35 * cover
        gloss *= 1.0 - 0.7 * cover
    if dust > 0.01:
        speck = fractal_noise(x, y, z, 28.0, 3, slope, scratch)
        veil = (1.0 - np.exp(-1.4 * dust)) * min(1.0, 0.45 + 0.9 * speck)
        _blend(albedo, palette[DUST], 0.85 * veil)
        roughness += 0.4 * veil
        gloss *= 1.0 - 0.9 * veil
    return min(roughness, 0.95), gloss


@kernel
def _ggx(
    normal_light: float, normal_view: float, normal_half: float, view_half: float, roughness: float, f0: float
) -> float:
    """Specular lobe times cosine: GGX, Smith's shadowing in its joint approximation, Schlick's Fresnel.

    Source: Walter et al., Microfacet models for refraction through rough surfaces, 2007.
    """
    a = roughness * roughness
    a2 = a * a
    d = normal_half * normal_half * (a2 - 1.0) + 1.0
    distribution = a2 / (np.pi * d * d)
    k = 0.5 * a
    visible = 0.25 / ((normal_light * (1.0 - k) + k) * (normal_view * (1.0 - k) + k))
    fresnel = f0 + (1.0 - f0) * (1.0 - view_half) ** 5
    return distribution * visible * fresnel * normal_light


@kernel
def _sky(x_up: float, radiance: Vectors, out: Vectors) -> None:
    """Radiance from a direction with the component `x_up` along up; `radiance` (3, 3) is that of the ground,
    the horizon and the zenith.
    """
    t = _smooth_step(-0.25, 0.35, x_up)
    high = max(0.0, x_up)
    for c in range(3):
        level = radiance[1, c] + high * (radiance[2, c] - radiance[1, c])
        out[c] = (1.0 - t) * radiance[0, c] + t * level


@kernel
def add_sky(
    directions: NDArray[np.float32],
    blocked: NDArray[np.bool_],
    up: Vectors,
    radiance: Vectors,
    total: Vectors,
) -> None:
    """Add to `total` (s, 3) the sky's light along one direction a sample; if blocked, a dim reflection."""
    sky = np.empty(3)
    for i in range(len(directions)):
        x_up = directions[i, 0] * up[0] + directions[i, 1] * up[1] + directions[i, 2] * up[2]
        _sky(x_up, radiance, sky)
        for c in range(3):
            total[i, c] += 0.07 * sky[c] if blocked[i] else sky[c]


@kernel
def _soft_box(reflected: Vectors, key: Vectors, side: Vectors, blur: float) -> float:
    """How much of a soft box round the key light a reflected ray meets, 0 to 1; `side` is its horizontal
    axis, `blur` how far a rough surface spreads its edge.
    """
    towards, across, along = 0.0, 0.0, 0.0
    for x in range(3):
        y, z = (x + 1) % 3, (x + 2) % 3
        towards += reflected[x] * key[x]
        across += reflected[x] * side[x]
        along += reflected[x] * (key[y] * side[z] - key[z] * side[y])
    if towards <= 0.05:
        return 0.0
    edge = 0.04 + blur
    x_share = _smooth_step(0.62 + edge, 0.62 - edge, abs(across / towards))
    y_share = _smooth_step(0.34 + edge, 0.34 - edge, abs(along / towards))
    return x_share * y_share


@kernel
def material_of(
    k: int,
    rest: Vectors,
    up: Vectors,
    stain: float,
    dust: float,
    rust: float,
    layer: float,
    color: Vectors,
    is_own: bool,
    own_roughness: float,
    own_metallic: float,
    palette: Vectors,
    albedo: Vectors,
    bump: Vectors,
    slope: Vectors,
    scratch: Vectors,
) -> tuple[float, float, float]:
    """What one point of the kind k is made of: its linear colour goes to `albedo` (3,), the gradient of its
    bumps to `bump` (3,); returns roughness, gloss and metalness. Arguments as of `shade`, for one point.
    """
    bump[0] = bump[1] = bump[2] = 0.0
    roughness, gloss, metallic = 0.6, 1.0, 0.0
    if k == FRONT or (k == RIM and layer > 0.6):
        _copy(color, albedo)
        roughness, gloss = _film_color(rest, up, stain, dust, is_own, palette, albedo, bump, slope, scratch)
    elif k in (BACK, RIM):
        _copy(palette[PRIMER], albedo)
        value = fractal_noise(rest[0], rest[1], rest[2], 30.0, 3, slope, scratch)
        for c in range(3):
            albedo[c] *= 0.82 + 0.3 * value
        if k == RIM:
            # A broken edge is fresh in places and holds grime in others.
            _blend(albedo, palette[DUST], 0.75 * _smooth_step(0.38, 0.6, value))
            for c in range(3):
                albedo[c] *= 0.8
        # Rust of the metal clings to the back of the film and bleeds out under its edge.
        cover = _rust_layer(rest, 0.6 * rust, palette, albedo, bump, slope, scratch)
        roughness, gloss = 0.8, 0.5 * (1.0 - cover)
    elif k == METAL:
        _copy(palette[STEEL], albedo)
        scale = fractal_noise(rest[0], rest[1], rest[2], 14.0, 4, slope, scratch)
        brush = _brushed(rest, bump, slope)
        for c in range(3):
            albedo[c] *= (0.82 + 0.5 * scale) * (0.82 + 0.36 * brush)
        cover = _rust_layer(rest, rust, palette, albedo, bump, slope, scratch)
        metallic = 0.85 * (1.0 - cover)
        roughness = 0.30 + 0.2 * scale + 0.55 * cover
        gloss = 1.0 - 0.6 * cover
        veil = 0.5 * (1.0 - np.exp(-1.4 * dust))
        _blend(albedo, palette[DUST], veil)
        metallic *= 1.0 - veil
    elif k == OWN_PART:
        _copy(color, albedo)
        roughness, metallic = own_roughness, own_metallic
    else:
        _copy(palette[UNPAINTED], albedo)
        roughness = 0.5
    return roughness, gloss, metallic


@kernel
def shade(
    kind: NDArray[np.uint8],
    position: Vectors,
    normal: Vectors,
    rest: Vectors,
    stain: Vectors,
    dust: Vectors,
    rust: Vectors,
    layer: Vectors,
    color: Vectors,
    is_own: NDArray[np.bool_],
    own_roughness: Vectors,
    own_metallic: Vectors,
    occlusion: Vectors,
    eye: Vectors,
    key: Vectors,
    key_color: Vectors,
    radiance: Vectors,
    box: float,
    up: Vectors,
    palette: Vectors,
    lit: Vectors,
    sky_light: Vectors,
    out: NDArray[np.float32],
) -> None:
    """Tone-mapped linear colour of s samples, to `out` float32 (s, 3).

    kind (s,), as named above; position, normal, rest (s, 3); stain, dust, rust, layer (s,), the last the
    place between the back (0) and the front (1) of the rim; color (s, 3), linear, of the paint or of parts
    that show their own; is_own (s,), whether it is from a material of the input; own_roughness,
    own_metallic, occlusion (s,), of such parts; key (3,) towards the key light; lit (s,) its visible share;
    radiance (3, 3) and box, see `lights.Light`; sky_light (s, 3) mean radiance over the cosine-weighted
    hemisphere. palette (9, 3), linear, by the rows named above.
    """
    albedo, bump, slope, scratch = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    n, view, env = np.empty(3), np.empty(3), np.empty(3)
    reflected, side = np.empty(3), np.empty(3)
    f0 = 0.04
    whole, width = 0.0, 0.0
    for c in range(3):
        y, z = (c + 1) % 3, (c + 2) % 3
        side[c] = up[y] * key[z] - up[z] * key[y]
        width += side[c] * side[c]
        whole += radiance[1, c] * _OPEN_SHARE
    for c in range(3):
        side[c] /= max(np.sqrt(width), 1e-9)
    for i in range(len(kind)):
        roughness, gloss, metallic = material_of(
            kind[i], rest[i], up, stain[i], dust[i], rust[i], layer[i], color[i], is_own[i],
            own_roughness[i], own_metallic[i], palette, albedo, bump, slope, scratch,
        )  # fmt: skip
        distance = 0.0
        for c in range(3):
            view[c] = eye[c] - position[i, c]
            distance += view[c] * view[c]
        along = 0.0
        for c in range(3):
            view[c] /= np.sqrt(distance)
            along += bump[c] * normal[i, c]
        length = 0.0
        for c in range(3):
            n[c] = normal[i, c] - (bump[c] - along * normal[i, c])
            length += n[c] * n[c]
        nl, nv, vl, up_reflected = 0.0, 0.0, 0.0, 0.0
        for c in range(3):
            n[c] /= np.sqrt(length)
            nl += n[c] * key[c]
            nv += n[c] * view[c]
            vl += view[c] * key[c]
        nv = max(nv, 0.04)
        for c in range(3):
            reflected[c] = 2.0 * nv * n[c] - view[c]
            up_reflected += up[c] * reflected[c]
        _sky(up_reflected, radiance, env)
        openness = (sky_light[i, 0] + sky_light[i, 1] + sky_light[i, 2]) / whole
        if box > 0.0:
            mirrored = box * _soft_box(reflected, key, side, 0.5 * roughness * roughness)
            for c in range(3):
                env[c] += mirrored * lit[i]
        specular = 0.0
        if nl > 0.0 and lit[i] > 0.0:
            half = np.sqrt(max(1e-9, 2.0 + 2.0 * vl))
            specular = _ggx(nl, nv, min(1.0, (nl + nv) / half), (1.0 + vl) / half, max(roughness, 0.2), 1.0)
        edge = (1.0 - nv) ** 5
        for c in range(3):
            tint = f0 * gloss * (1.0 - metallic) + metallic * albedo[c]
            fresnel = tint + (max(tint, 1.0 - roughness) - tint) * edge * gloss
            light = (
                albedo[c]
                * (1.0 - metallic)
                * (max(nl, 0.0) * lit[i] * key_color[c] / np.pi + occlusion[i] * sky_light[i, c])
            )
            light += tint * specular * lit[i] * key_color[c] + 0.8 * fresnel * env[c] * min(
                1.0, openness * occlusion[i]
            )
            out[i, c] = tone(light)


@kernel
def tone(x: float) -> float:
    """A film-like shoulder: linear up to 0.55, then bent, so that only far brighter light becomes white."""
    if x <= 0.55:
        return x
    return 0.55 + 0.45 * (1.0 - np.exp(-(x - 0.55) / 0.45))
