"""Material libraries of OBJ, translated to glTF's materials.

Source: Wavefront, MTL Material Format, 1995; the keys Pr, Pm and norm are the physically based extension that
Blender and others write. Roughness from the exponent of Phong's highlight: sqrt(2 / (Ns + 2)), after Walter
et al., Microfacet models for refraction through rough surfaces, 2007.
"""

from __future__ import annotations

import math
import mimetypes
from pathlib import Path
from typing import Any

from weathercoat.mesh.materials import SourceMaterial, Texture

_LARGEST_LIBRARY, _LARGEST_PICTURE = 64 << 20, 512 << 20  # bytes
# Options of a texture, with how many words follow them at most; those are numbers but for the last three.
_OPTIONS = {"-o": 3, "-s": 3, "-t": 3, "-mm": 2, "-bm": 1, "-boost": 1, "-texres": 1, "-clamp": 1,
            "-blendu": 1, "-blendv": 1, "-cc": 1, "-imfchan": 1, "-type": 1}  # fmt: skip
_SHOWN = {"base": ("map_kd",), "normal": ("norm", "map_kn")}
_WORDS = ("-clamp", "-blendu", "-blendv", "-cc", "-imfchan", "-type")


def read_library(path: Path, folder: Path) -> tuple[dict[str, SourceMaterial], list[str]]:
    """The materials of a library by name, and the pictures that they name which are not within `folder`.

    Raises OSError where the library cannot be read. What is no number or of no known key is passed over.
    """
    with path.open("rb") as stream:
        blocks = _blocks(stream.read(_LARGEST_LIBRARY))
    pictures: dict[str, Texture | None] = {}
    materials = {name: _material(name, block, folder, pictures) for name, block in blocks.items()}
    return materials, [name for name, texture in pictures.items() if texture is None]


def picture_names(library: bytes) -> list[str]:
    """The pictures that the materials of a library show."""
    keys = {key for keys in _SHOWN.values() for key in keys}
    words = (block[key] for block in _blocks(library).values() for key in block if key in keys and block[key])
    return list(dict.fromkeys(map(_file_of, words)))


def _blocks(library: bytes) -> dict[str, dict[str, list[str]]]:
    """The words after each key, by the name of the material."""
    blocks: dict[str, dict[str, list[str]]] = {}
    current: dict[str, list[str]] = {}
    for line in library.decode("utf-8", "replace").splitlines():
        key, *words = line.split()[:64] or [""]
        if key == "newmtl":
            current = blocks.setdefault(" ".join(words) or "default", {})
        elif key and not key.startswith("#"):
            current[key.lower()] = words
    return blocks


def _material(
    name: str, block: dict[str, list[str]], folder: Path, pictures: dict[str, Texture | None]
) -> SourceMaterial:
    textures: list[Texture] = []

    def texture_of(*keys: str) -> dict[str, Any] | None:
        words = next((block[key] for key in keys if block.get(key)), None)
        if words is None:
            return None
        file = _file_of(words)
        if file not in pictures:
            pictures[file] = _picture(file, folder)
        texture = pictures[file]
        if texture is None:
            return None
        if texture not in textures:
            textures.append(texture)
        return {"index": textures.index(texture)}

    diffuse = _numbers(block.get("kd", ()), 3) or [1.0, 1.0, 1.0]
    opacity = (_numbers(block.get("d", ()), 1) or [1.0])[0]
    shine = _numbers(block.get("ns", ()), 1)
    rough = _numbers(block.get("pr", ()), 1)
    base = texture_of(*_SHOWN["base"])
    surface: dict[str, Any] = {
        # a colour beside a picture is often black or grey by habit and would dim it
        "baseColorFactor": [*([1.0] * 3 if base else map(_linear, diffuse)), _share(opacity)],
        "metallicFactor": _share((_numbers(block.get("pm", ()), 1) or [0.0])[0]),
        "roughnessFactor": _share(
            rough[0] if rough else math.sqrt(2.0 / (max(shine[0], 0.0) + 2.0)) if shine else 0.8
        ),
    }
    entry: dict[str, Any] = {"name": name, "pbrMetallicRoughness": surface, "doubleSided": True}
    if base:
        surface["baseColorTexture"] = base
    normal = texture_of(*_SHOWN["normal"])
    if normal:
        entry["normalTexture"] = normal
    emission = _numbers(block.get("ke", ()), 3)
    if emission and any(emission):
        entry["emissiveFactor"] = [_share(x) for x in emission]
    if opacity < 1.0:
        entry["alphaMode"] = "BLEND"
    return SourceMaterial(name, entry, tuple(textures))


def _file_of(words: list[str]) -> str:
    """The name of the picture, after the options."""
    i = 0
    while i < len(words) - 1 and words[i].lower() in _OPTIONS:
        option, most = words[i].lower(), _OPTIONS[words[i].lower()]
        i += 1
        taken = 0
        while taken < most and i < len(words) - 1 and (option in _WORDS or _is_number(words[i])):
            i, taken = i + 1, taken + 1
    return " ".join(words[i:])


def _picture(name: str, folder: Path) -> Texture | None:
    """The picture of a name, if it lies within the folder of the model."""
    path = Path(name.replace("\\", "/"))
    try:
        full = (folder / path).resolve()
        if path.is_absolute() or not full.is_relative_to(folder.resolve()) or not full.is_file():
            return None
        if full.stat().st_size > _LARGEST_PICTURE:
            return None
        return Texture(full.read_bytes(), mimetypes.guess_type(full.name)[0] or "image/png", full.stem)
    except (OSError, ValueError):
        return None


def _numbers(words: Any, count: int) -> list[float] | None:
    """The first `count` words as finite numbers, or None."""
    if len(words) < count or not all(map(_is_number, words[:count])):
        return None
    return [float(word) for word in words[:count]]


def _is_number(word: str) -> bool:
    try:
        return math.isfinite(float(word))
    except ValueError:
        return False


def _share(value: float) -> float:
    return min(max(value, 0.0), 1.0)


def _linear(value: float) -> float:
    """A colour, which MTL means as shown on a screen, as linear light."""
    value = _share(value)
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4
