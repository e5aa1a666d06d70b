"""Materials of the input, and maps made for it, as pictures show them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from weathercoat.mesh.materials import SourceMaterial
from weathercoat.mesh.surface import Indices, Surface, Vectors
from weathercoat.output.texels import Footprint, Texels, make_texels, measure_footprints, read_texels

if TYPE_CHECKING:
    from weathercoat.output.camera import Camera
    from weathercoat.output.display import DisplayMesh, Samples

Pixels = NDArray[np.uint8] | NDArray[np.uint16]


@dataclass(frozen=True)
class Material:
    """A metallic-roughness material of glTF 2.0.

    color: linear, (3,); it multiplies the vertex colours and the texture `base`. roughness, metallic:
    multiply the green and the blue of `orm`. occlusion: its red says how much of the sky is seen, as far as
    `occlusion_strength`. normal: tangent-space normals, green upwards along the picture.
    """

    color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    roughness: float = 1.0
    metallic: float = 1.0
    base: Texels | None = None
    orm: Texels | None = None
    occlusion: Texels | None = None
    occlusion_strength: float = 1.0
    normal: Texels | None = None
    normal_scale: float = 1.0

    def without_textures(self) -> Material:
        """The same for a surface without texture coordinates."""
        return replace(self, base=None, orm=None, occlusion=None, normal=None)


def read_material(source: SourceMaterial, *, only_color: bool = False) -> Material:
    """A material of the input with its textures decoded; only_color: no more than the base colour.

    Raises CorruptError where a texture cannot be decoded.
    """
    entry: Mapping[str, Any] = source.entry
    pbr = entry.get("pbrMetallicRoughness", {})

    def texels(place: Mapping[str, Any] | None, *, is_color: bool = False) -> Texels | None:
        if place is None:
            return None
        return read_texels(source.textures[place["index"]], place, is_color=is_color)

    base = texels(pbr.get("baseColorTexture"), is_color=True)
    if only_color:
        return Material(source.base_color[:3], base=base)
    normal, occlusion = entry.get("normalTexture"), entry.get("occlusionTexture")
    return Material(
        color=source.base_color[:3],
        roughness=float(pbr.get("roughnessFactor", 1.0)),
        metallic=float(pbr.get("metallicFactor", 1.0)),
        base=base,
        orm=texels(pbr.get("metallicRoughnessTexture")),
        occlusion=texels(occlusion),
        occlusion_strength=float((occlusion or {}).get("strength", 1.0)),
        normal=texels(normal),
        normal_scale=float((normal or {}).get("scale", 1.0)),
    )


def make_material(
    base_color: Pixels | None = None, orm: Pixels | None = None, normal: Pixels | None = None
) -> Material:
    """A material of maps (h, w, 3 or more), the first row on top: base colour (sRGB), occlusion, roughness
    and metalness (linear), tangent-space normals (green upwards).

    Without `orm` it is rough and no metal.
    """

    def texels(pixels: Pixels | None, *, is_color: bool = False) -> Texels | None:
        return None if pixels is None else make_texels(pixels[:, :, :3], is_color=is_color)

    shared = texels(orm)
    return Material(
        metallic=0.0 if orm is None else 1.0,
        base=texels(base_color, is_color=True),
        orm=shared,
        occlusion=shared,
        normal=texels(normal),
    )


def apply_materials(
    mesh: DisplayMesh,
    face: NDArray[np.int32],
    weights: NDArray[np.float32],
    group: NDArray[np.int64],
    camera: Camera,
    shape: tuple[int, int],
    samples: Samples,
) -> None:
    """Give `samples` what their materials show: colour, roughness, metalness, occlusion and normal.

    face (s,), weights (s, 2): all samples of a picture of `shape`; each shows what sample `group` (s,) of
    `samples` does, which takes the mean of its followers.
    """
    count = len(samples.kind)
    of_sample = mesh.material[face]
    for number, material in enumerate(mesh.materials):
        chosen = np.flatnonzero(of_sample == number)
        if len(chosen) == 0:
            continue
        owner = group[chosen]
        followers = np.bincount(owner, minlength=count)
        shown = np.flatnonzero(followers)
        footprint = _footprint(mesh, face[chosen], weights[chosen], camera, shape)

        def means(
            texels: Texels,
            footprint: Footprint = footprint,
            owner: NDArray[np.int64] = owner,
            shown: NDArray[np.int64] = shown,
            followers: NDArray[np.int64] = followers,
        ) -> Vectors:
            values = texels.at(footprint)
            sums = [np.bincount(owner, values[:, c], count)[shown] for c in range(3)]
            return np.stack(sums, axis=1) / followers[shown, None]

        samples.color[shown] *= material.color
        if material.base is not None:
            samples.color[shown] *= means(material.base)
        samples.roughness[shown] = material.roughness
        samples.metallic[shown] = material.metallic
        if material.orm is not None:
            orm = means(material.orm)
            samples.roughness[shown] *= orm[:, 1]
            samples.metallic[shown] *= orm[:, 2]
        if material.occlusion is not None:
            seen = means(material.occlusion)[:, 0]
            samples.occlusion[shown] = 1.0 - material.occlusion_strength * (1.0 - seen)
        if material.normal is not None:
            leader = np.empty(count, np.int64)
            leader[owner[::-1]] = chosen[::-1]
            turned = 2.0 * means(material.normal) - 1.0
            turned[:, :2] *= material.normal_scale
            samples.normal[shown] = _turned(mesh, face[leader[shown]], samples.normal[shown], turned)


def _footprint(
    mesh: DisplayMesh,
    face: NDArray[np.int32],
    weights: NDArray[np.float32],
    camera: Camera,
    shape: tuple[int, int],
) -> Footprint:
    height, width = shape
    footprint = Footprint(*(np.empty((len(face), 2)) for _ in range(3)))
    measure_footprints(
        face,
        weights,
        mesh.vertices,
        mesh.faces,
        mesh.uv,
        camera.position,
        camera.forward,
        camera.right * (2.0 * camera.tangent_x / width),
        camera.up * (-2.0 * camera.tangent_y / height),
        footprint.uv,
        footprint.across,
        footprint.down,
    )
    return footprint


def _turned(mesh: DisplayMesh, face: NDArray[np.int32], normal: Vectors, tangent_normal: Vectors) -> Vectors:
    """Normals (s, 3) turned by tangent-space ones (s, 3): x along growing u, y along growing v; a face whose
    texture coordinates span nothing keeps its own.
    """
    a, b, c = (mesh.vertices[mesh.faces[face, i]] for i in range(3))
    uv = mesh.uv[face].astype(np.float64)
    p, q = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    span = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
    side = np.where(span < 0.0, -1.0, 1.0)[:, None]
    along = side * ((b - a) * q[:, 1:] - (c - a) * p[:, 1:])
    along -= np.einsum("ij,ij->i", along, normal)[:, None] * normal
    length = np.linalg.norm(along, axis=1, keepdims=True)
    has_one = (length[:, 0] > 0.0) & (span != 0.0)
    along = np.divide(along, length, out=np.zeros_like(along), where=length > 0.0)
    upwards = side * np.cross(normal, along)
    x, y, z = tangent_normal.T[:, :, None]
    turned = x * along + y * upwards + z * normal
    turned /= np.maximum(np.linalg.norm(turned, axis=1, keepdims=True), 1e-9)
    return np.where(has_one[:, None], turned, normal)


def face_materials(surface: Surface) -> Indices:
    """The material of each face of a surface, int32 (m,), -1 where it has none."""
    if surface.face_part is None or not surface.materials:
        return np.full(len(surface.faces), -1, np.int32)
    return np.array([part.material for part in surface.parts], np.int32)[surface.face_part]


def film_materials(surface: Surface, look: str) -> Indices:
    """The material that a film over each face of a surface shows, int32 (m,), -1 where it shows its paint.

    look: `paint`, always its paint; `model`, the material of the input wherever there is one; `auto`, where
    that has a base colour texture.
    """
    material = face_materials(surface)
    shows = [shows_material(surface, number, look) for number in range(len(surface.materials))]
    return np.where(np.array([*shows, False])[material], material, np.int32(-1))


def shows_material(surface: Surface, number: int, look: str) -> bool:
    """Whether a film shows the material of this number, by a `look` as for `film_materials`."""
    if number < 0 or number >= len(surface.materials) or look == "paint":
        return False
    source = surface.materials[number]
    if look == "model":
        return bool(source.entry)
    return surface.uv is not None and source.base_texture is not None
