"""Materials of a glTF document, with the pictures that they show.

Source: Khronos, glTF 2.0 specification, sections 3.8 and 3.9.
"""

from __future__ import annotations

import base64
import binascii
import mimetypes
from collections.abc import Iterator
from copy import deepcopy
from typing import Any

from weathercoat.errors import WeathercoatError
from weathercoat.mesh.formats.gltf_document import GltfDocument, check_index, natural, positive
from weathercoat.mesh.materials import SourceMaterial, Texture

_OTHER_FORMATS = ("EXT_texture_webp", "EXT_texture_avif")
_LARGEST_PICTURE = 512 << 20  # bytes


def read_materials(document: GltfDocument) -> tuple[SourceMaterial, ...]:
    """The materials, in the order of the file; call it within `malformed_is_corrupt`.

    A texture whose picture is missing, or of no kind that is known, is left out of its material.
    """
    pictures: dict[int, tuple[bytes, str, str] | None] = {}
    textures: dict[int, Texture | None] = {}
    materials = []
    for number, entry in enumerate(document.json.get("materials", [])):
        own = deepcopy(entry)
        shown: list[Texture] = []
        for holder, key in list(texture_places(own)):
            place = holder[key]
            index = natural(place["index"], "index")
            if index not in textures:
                textures[index] = _texture(document, index, pictures)
            texture = textures[index]
            if texture is None:
                del holder[key]
                continue
            if texture not in shown:
                shown.append(texture)
            place["index"] = shown.index(texture)
        materials.append(SourceMaterial(str(entry.get("name") or f"material_{number}"), own, tuple(shown)))
    return tuple(materials)


def texture_places(material: Any) -> Iterator[tuple[dict[str, Any], str]]:
    """Where a material, or one of its extensions, names a texture: mappings and keys, which all end with
    `Texture`.
    """
    rest = [material]
    while rest:
        part = rest.pop()
        for key, value in part.items():
            if key == "extras" or not isinstance(value, dict):
                continue
            if key.endswith("Texture") and "index" in value:
                yield part, key
            else:
                rest.append(value)


def _texture(
    document: GltfDocument, index: int, pictures: dict[int, tuple[bytes, str, str] | None]
) -> Texture | None:
    textures = document.json.get("textures", [])
    check_index(index, textures, "texture")
    entry = textures[index]
    extensions = entry.get("extensions", {})
    sources = [extensions[name].get("source") for name in _OTHER_FORMATS if name in extensions]
    found = next((source for source in [*sources, entry.get("source")] if source is not None), None)
    if found is None:
        return None
    if found not in pictures:
        pictures[found] = _picture(document, found)
    picture = pictures[found]
    if picture is None:
        return None
    image, mime, name = picture
    sampler: dict[str, Any] = {}
    if "sampler" in entry:
        check_index(entry["sampler"], document.json.get("samplers", []), "sampler")
        sampler = document.json["samplers"][entry["sampler"]]
    return Texture(image, mime, str(entry.get("name") or name), sampler)


def _picture(document: GltfDocument, index: int) -> tuple[bytes, str, str] | None:
    """The bytes, MIME type and name of a picture; None where it cannot be had."""
    images = document.json.get("images", [])
    check_index(index, images, "image")
    entry = images[index]
    name = str(entry.get("name") or "")
    if "bufferView" in entry:
        views = document.json.get("bufferViews", [])
        check_index(entry["bufferView"], views, "bufferView")
        view = views[entry["bufferView"]]
        begin = natural(view.get("byteOffset", 0), "byteOffset")
        length = positive(view["byteLength"], "byteLength")
        image = document.buffer(view["buffer"])[begin : begin + length]
        return (image, str(entry.get("mimeType", "image/png")), name) if len(image) == length else None
    uri = str(entry.get("uri") or "")
    if uri.startswith("data:"):
        head, _, body = uri.partition(",")
        try:
            image = base64.b64decode(body, validate=True)
        except binascii.Error:
            return None
        return image, entry.get("mimeType") or head[5:].partition(";")[0], name
    try:
        path = document.beside(uri)
        if not path.is_file() or path.stat().st_size > _LARGEST_PICTURE:
            return None
        return path.read_bytes(), entry.get("mimeType") or _mime(uri), name or path.stem
    except (WeathercoatError, OSError):
        return None


def _mime(name: str) -> str:
    return mimetypes.guess_type(name)[0] or "image/png"
