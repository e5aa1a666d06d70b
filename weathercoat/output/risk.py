"""Risk as files: meshes with the figures at their vertices, a picture with a legend, and a summary."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weathercoat.mesh.surface import Surface, Vectors, vertex_normals
from weathercoat.output.camera import Camera, make_camera
from weathercoat.output.display import Normalisation
from weathercoat.output.glb import Material, Node, write_glb
from weathercoat.output.maps.padding import find_padding
from weathercoat.output.maps.raster import rasterise, texel_corners
from weathercoat.output.ply import color_bytes, write_ply
from weathercoat.output.rays import make_rays
from weathercoat.output.report import write_json
from weathercoat.output.sheets import METAL_CREASE, make_sheet, srgb_to_linear
from weathercoat.sim.risk import ATTACHED, BARE, NEVER, SEPARATED, Risk

PLY, GLB, PICTURE, SUMMARY = "risk.ply", "risk.glb", "risk.png", "risk.json"
MAP = "risk_map.png"  # where the model has texture coordinates
_PADDING = 8  # texels
SHOWN = ("separation", "fracture")

Image = NDArray[np.uint8]

# Viridis by Nathaniel Smith and Stefan van der Walt (CC0): even in lightness, safe for the colour-blind.
_VIRIDIS = np.array(
    [
        (68, 1, 84), (71, 44, 122), (59, 81, 139), (44, 113, 142), (33, 144, 141),
        (39, 173, 129), (92, 200, 99), (170, 220, 50), (253, 231, 37),
    ]
)  # fmt: skip
_NEVER = np.array([46, 46, 52])
_DONE = np.array([168, 168, 172])
_LOST = np.array([214, 214, 216])
_PAPER = np.array([250, 250, 249])
_INK = (70, 70, 70)
_SAMPLES = 2  # side of the square of samples in a pixel
_LEAST_SHADE = 0.7  # of a surface seen edge-on
_RATIOS = (0.5, 0.8, 1.0)
_SHARES = (0.01, 0.05, 0.1, 0.25, 0.5, 1.0)  # of the horizon


def risk_colors(risk: Risk, shown: str) -> Vectors:
    """sRGB colours (n0, 3), 0 to 1, of the steps to separation or to fracture: yellow soon, purple late, dark
    not within the horizon; grey where the film has separated, for separation, or is gone.
    """
    steps = risk.separation_steps if shown == "separation" else risk.fracture_steps_on_vertices()
    sooner = 1.0 - np.maximum(steps, 0) / max(risk.horizon, 1)
    colors = _scale(sooner)
    colors[steps == NEVER] = _NEVER
    if shown == "separation":
        colors[risk.state == SEPARATED] = _DONE
    colors[risk.state == BARE] = _LOST
    return colors / 255.0


def _scale(value: Vectors) -> Vectors:
    at = np.linspace(0.0, 1.0, len(_VIRIDIS))
    return np.stack([np.interp(value, at, _VIRIDIS[:, c]) for c in range(3)], axis=-1)


def write_risk(folder: Path, surface: Surface, risk: Risk, *, shown: str = "separation") -> dict[str, Any]:
    """Write a PLY and a GLB with the scalars of `Risk.scalars`, a picture, a map where there are texture
    coordinates, and a summary, which is returned.

    surface: that of the simulation; shown: which of `SHOWN` the vertex colours of the meshes are. In PLY and
    GLB what is not within the horizon is -1, and ratios end at 1,000. Raises OSError.
    """
    scalars = {name: np.minimum(values, 1000.0).astype(np.float32) for name, values in risk.scalars().items()}
    colors = risk_colors(risk, shown)
    normals = vertex_normals(surface.vertices, surface.faces)
    write_ply(
        folder / PLY,
        surface.vertices,
        surface.faces,
        normals=normals,
        colors=color_bytes(colors),
        scalars={**scalars, "state": risk.state},
        comments=[f"step {risk.step}", f"age {risk.age!r}", f"horizon {risk.horizon} steps"],
    )
    material = Material("risk", metallic=0.0, roughness=0.9, double_sided=True)
    sheet = make_sheet(
        material,
        surface.vertices,
        surface.faces,
        crease=METAL_CREASE,
        colors=srgb_to_linear(colors),
        scalars={f"_{name.upper()}": values for name, values in scalars.items()},
    )
    about = summarise(surface, risk)
    write_glb(folder / GLB, [Node("risk", [sheet])], up=surface.up, extras={"risk": about})
    from weathercoat.output.pictures import write_png

    write_png(folder / PICTURE, draw_risk(surface, risk))
    if surface.uv is not None:
        write_png(folder / MAP, draw_risk_map(surface, surface.uv, colors))
    write_json(folder / SUMMARY, about)
    return about


def draw_risk_map(surface: Surface, uv: Vectors, colors: Vectors, size: int = 1024) -> Image:
    """Colours of the vertices (n0, 3), 0 to 1, on the texture coordinates (m, 3, 2), v upwards, uint8 (size,
    size, 3). Coordinates beyond the first tile come back into it; where several faces claim a texel the first
    one shows.
    """
    tile = np.floor(uv.mean(axis=1, keepdims=True))
    face = np.full((size, size), -1, np.int32)
    weights, again = np.zeros((size, size, 2), np.float32), np.zeros((size, size), np.uint8)
    rasterise(texel_corners(uv - tile, size, size), 0, face, weights, again)
    source = np.empty_like(face)
    find_padding(face, _PADDING, source)
    shown = np.flatnonzero(source.ravel() >= 0)
    texel = source.ravel()[shown]
    corners = colors[surface.faces[face.ravel()[texel]]]
    second, third = weights.reshape(-1, 2)[texel].T.astype(np.float64)[:, :, None]
    picture = np.full((size * size, 3), _PAPER / 255.0)
    picture[shown] = (1.0 - second - third) * corners[:, 0] + second * corners[:, 1] + third * corners[:, 2]
    return color_bytes(picture).reshape(size, size, 3)


def summarise(surface: Surface, risk: Risk) -> dict[str, Any]:
    """The risk in figures: shares of the area, by how near vertices are and how soon they let go; shares of
    the whole edges; and where it begins.
    """
    area = np.repeat(surface.face_areas() / 3.0, 3)
    weight = np.bincount(surface.faces.reshape(-1), area, len(risk.state)) / area.sum()
    attached = risk.state == ATTACHED

    def area_share(chosen: NDArray[np.bool_]) -> float:
        return round(float(weight[chosen].sum()), 6)

    def edge_share(chosen: NDArray[np.bool_]) -> float:
        return round(float(chosen.mean()), 6) if len(chosen) else 0.0

    edge_centre = surface.vertices[risk.edges].mean(axis=1)
    return {
        "step": risk.step,
        "age": risk.age,
        "horizon_steps": risk.horizon,
        "horizon_age": float(risk.ages[-1]),
        "attached_share": area_share(attached),
        "separated_share": area_share(risk.state == SEPARATED),
        "bare_share": area_share(risk.state == BARE),
        "separation": {
            "ratio_above": {f"{r:g}": area_share(attached & (risk.separation > r)) for r in _RATIOS},
            "within_steps": _within(
                risk,
                lambda steps: area_share(
                    attached & (risk.separation_steps != NEVER) & (risk.separation_steps <= steps)
                ),
            ),
            "never": area_share(attached & (risk.separation_steps == NEVER)),
            "first": _first(risk, np.where(attached, risk.separation_steps, NEVER), surface.vertices),
        },
        "fracture": {
            "ratio_above": {f"{r:g}": edge_share(risk.fracture > r) for r in _RATIOS},
            "within_steps": _within(
                risk,
                lambda steps: edge_share((risk.fracture_steps != NEVER) & (risk.fracture_steps <= steps)),
            ),
            "never": edge_share(risk.fracture_steps == NEVER),
            "first": _first(risk, risk.fracture_steps, edge_centre),
        },
    }


def _within(risk: Risk, share: Any) -> dict[str, float]:
    steps = sorted({max(1, round(part * risk.horizon)) for part in _SHARES})
    return {str(count): share(count) for count in steps}


def _first(risk: Risk, steps: NDArray[np.int32], places: Vectors) -> dict[str, Any] | None:
    """The step and age of the first failure, of how many, and where one of them is."""
    known = steps != NEVER
    if not known.any():
        return None
    soonest = int(steps[known].min())
    at = np.flatnonzero(known & (steps == soonest))
    return {
        "in_steps": soonest,
        "age": float(risk.ages[soonest]),
        "count": len(at),
        "position": [round(float(x), 9) for x in places[at[0]]],
    }


def draw_risk(surface: Surface, risk: Risk, *, width: int = 640, height: int = 520) -> Image:
    """A picture of the risk of separation, and beside it that of fracture, each with its legend, uint8."""
    from PIL import Image as Pillow
    from PIL import ImageDraw, ImageFont

    normalise = Normalisation.of_mesh(surface.vertices, surface.faces)
    vertices = normalise(surface.vertices)
    normals = vertex_normals(surface.vertices, surface.faces)
    legend = 84
    drawn = height - legend
    camera = make_camera(
        vertices, normals, surface.up, aspect=width / drawn, azimuth=32.0, elevation=24.0, margin=0.08
    )
    sheet = Pillow.new("RGB", (2 * width, height), tuple(int(c) for c in _PAPER))
    draw = ImageDraw.Draw(sheet)
    font = ImageFont.load_default(15)
    titles = {"separation": "lets go of the metal", "fracture": "cracks, once it has let go"}
    for panel, shown in enumerate(SHOWN):
        placed = replace(surface, vertices=vertices)
        image = _draw_colors(placed, normals, risk_colors(risk, shown), camera, width, drawn)
        left = panel * width
        sheet.paste(Pillow.fromarray(image), (left, 0))
        bar = _scale(np.linspace(1.0, 0.0, 240)).round().astype(np.uint8)
        sheet.paste(Pillow.fromarray(np.broadcast_to(bar, (14, 240, 3)).copy()), (left + 30, drawn + 30))
        draw.text((left + 30, drawn + 6), titles[shown], fill=_INK, font=font)
        draw.text((left + 30, drawn + 50), f"step {risk.step:,}", fill=_INK, font=font)
        end = f"{risk.step + risk.horizon:,}"
        draw.text((left + 270, drawn + 50), end, fill=_INK, font=font, anchor="ra")
        boxes = [(_NEVER, "not by then")]
        if (risk.state == SEPARATED).any() and shown == "separation":
            boxes.append((_DONE, "has let go"))
        if (risk.state == BARE).any():
            boxes.append((_LOST, "bare"))
        at = left + 300
        for color, text in boxes:
            draw.rectangle((at, drawn + 30, at + 14, drawn + 44), fill=tuple(int(c) for c in color))
            draw.text((at + 22, drawn + 28), text, fill=_INK, font=font)
            at += 36 + int(draw.textlength(text, font=font))
    return np.asarray(sheet)


def _draw_colors(
    surface: Surface, normals: Vectors, colors: Vectors, camera: Camera, width: int, height: int
) -> Image:
    """The surface in its vertex colours, a little darker where it turns away, so that it can be read off."""
    rays = make_rays(surface.vertices, surface.faces)
    wide, high = width * _SAMPLES, height * _SAMPLES
    directions = camera.directions(np.arange(high), np.arange(wide), wide, high)
    origins = np.tile(camera.position.astype(np.float32), (len(directions), 1))
    face, weights = rays.nearest(origins, directions)
    picture = np.tile(_PAPER / 255.0, (len(face), 1))
    seen = np.flatnonzero(face >= 0)
    corner = surface.faces[face[seen]]
    share = np.concatenate([1.0 - weights[seen].sum(axis=1, keepdims=True), weights[seen]], axis=1)
    unit = directions[seen] / np.linalg.norm(directions[seen], axis=1, keepdims=True)
    normal = np.einsum("ij,ijk->ik", share, normals[corner])
    facing = np.abs(np.einsum("ij,ij->i", normal, unit))
    shade = _LEAST_SHADE + (1.0 - _LEAST_SHADE) * np.clip(facing, 0.0, 1.0)
    picture[seen] = np.einsum("ij,ijk->ik", share, colors[corner]) * shade[:, None]
    small = picture.reshape(height, _SAMPLES, width, _SAMPLES, 3).mean(axis=(1, 3))
    return (small * 255.0).round().astype(np.uint8)
