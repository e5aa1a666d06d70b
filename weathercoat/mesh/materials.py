"""Materials and textures of the input, as glTF 2.0 describes them whatever the format that they came from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Texture:
    """A picture that materials refer to: its bytes as they came, in a format of `mime`, such as image/png.

    sampler: how it is repeated and filtered, an entry of glTF's `samplers`; empty where nothing is said.
    """

    image: bytes
    mime: str
    name: str = ""
    sampler: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class SourceMaterial:
    """A material of the input.

    entry: an entry of glTF's `materials`, in which the `index` of a texture is one of `textures`; materials
    of other formats are translated. A picture that several materials show is one object.
    """

    name: str
    entry: Mapping[str, Any] = field(default_factory=dict)
    textures: tuple[Texture, ...] = ()

    @property
    def base_color(self) -> tuple[float, float, float, float]:
        """The factor on the base colour, linear RGBA."""
        factor = self.entry.get("pbrMetallicRoughness", {}).get("baseColorFactor", (1.0, 1.0, 1.0, 1.0))
        r, g, b, a = (float(x) for x in factor)
        return r, g, b, a

    @property
    def base_texture(self) -> Texture | None:
        """The texture of the base colour, if there is one."""
        place = self.entry.get("pbrMetallicRoughness", {}).get("baseColorTexture")
        return None if place is None else self.textures[place["index"]]
