"""What stays of the glTF document that a scene was read from, when some of its meshes are replaced.

Nodes, cameras, lights, animations, skins, extras and all that extensions add stay as they are. Meshes that no
node shows any more go, with the materials, pictures and bytes that nothing else refers to; where an extension
is in use that is not known here, which may refer to anything, only the meshes go. All buffers, and pictures
that lie beside the file, become one buffer.
"""

from __future__ import annotations

import json
import mimetypes
from collections.abc import Iterable, Iterator, Sequence
from copy import deepcopy
from typing import Any

from weathercoat.errors import WeathercoatError
from weathercoat.mesh.formats.gltf_document import GltfDocument, check_index
from weathercoat.output.glb import GlbBuffer

INSTANCING = "EXT_mesh_gpu_instancing"
_COMPRESSION = "EXT_meshopt_compression"
# Extensions whose entries refer to no accessor, or to those that are known here; others may refer to any.
_UNDERSTOOD = (
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "KHR_lights_",
    "KHR_xmp",
    "KHR_mesh_quantization",
    "KHR_draco_mesh_compression",
    INSTANCING,
    _COMPRESSION,
)

_Place = tuple[dict[str, Any], str]  # a mapping and the key under which a number stands in it


def retain(source: GltfDocument, buffer: GlbBuffer, shown: Iterable[int]) -> dict[str, Any]:
    """A copy of the document's JSON with the meshes `shown` alone; their bytes, views and accessors are in
    `buffer`, which was empty, and so not in the copy.

    What stays is numbered anew, in its old order, everywhere but in the nodes that show a mesh which goes:
    the caller gives these another. Call it within `malformed_is_corrupt`.
    """
    document: dict[str, Any] = deepcopy(source.json)
    meshes = document.get("meshes", [])
    kept = sorted(set(shown))
    number = {old: new for new, old in enumerate(kept)}
    document["meshes"] = [meshes[i] for i in kept]
    for node in document.get("nodes", []):
        if node.get("mesh") in number:
            node["mesh"] = number[node["mesh"]]
    dropped = [mesh for i, mesh in enumerate(meshes) if i not in number]
    if all(str(name).startswith(_UNDERSTOOD) for name in document.get("extensionsUsed", [])):
        _drop_accessors(document, dropped)
        _drop_materials(document, dropped)
    _copy_views(source, document, buffer)
    _embed_pictures(source, document, buffer)
    buffer.accessors += document.pop("accessors", [])
    return document


def check_retained(source: GltfDocument) -> None:
    """Raise CorruptError now for what would make `retain` or the writing fail, after hours of work maybe.

    Call it within `malformed_is_corrupt`.
    """
    for shown in (range(len(source.json.get("meshes", []))), ()):
        document = retain(source, _Sizes(), shown)
        json.dumps(document, allow_nan=False)


class _Sizes(GlbBuffer):
    """A buffer that forgets its bytes."""

    def add_bytes(self, content: bytes, **view: Any) -> int:
        number = super().add_bytes(content, **view)
        self.pieces.clear()
        return number


def _drop_accessors(document: dict[str, Any], dropped: Sequence[dict[str, Any]]) -> None:
    """Drop the accessors that only the meshes `dropped` have."""
    places = list(_references(document))
    gone = _values(place for mesh in dropped for place in _mesh_references(mesh)) - _values(places)
    _renumber(document, "accessors", gone, places)


def _drop_materials(document: dict[str, Any], dropped: Sequence[dict[str, Any]]) -> None:
    """Drop the materials that only the meshes `dropped` have, and the textures and pictures of these.

    The materials of a mesh that has several stay: parts of it may carry no paint, and show them.
    """
    materials, textures = document.get("materials", []), document.get("textures", [])
    places = [place for mesh in document["meshes"] for place in _material_references(mesh)]
    alone, stays = set(), _values(places)
    for mesh in dropped:
        own = _values(_material_references(mesh))
        if len(own) > 1:
            stays |= own
        else:
            alone |= own
    gone = alone - stays
    lost = [materials[i] for i in sorted(gone)]
    _renumber(document, "materials", gone, places)
    kept = [place for entry in document.get("materials", []) for place in _texture_references(entry)]
    gone = _values(place for entry in lost for place in _texture_references(entry)) - _values(kept)
    lost = [textures[i] for i in sorted(gone)]
    _renumber(document, "textures", gone, kept)
    kept = [place for entry in document.get("textures", []) for place in _picture_references(entry)]
    gone = _values(place for entry in lost for place in _picture_references(entry)) - _values(kept)
    _renumber(document, "images", gone, kept)


def _values(places: Iterable[_Place]) -> set[int]:
    return {box[key] for box, key in places}


def _renumber(document: dict[str, Any], kind: str, gone: set[int], places: Iterable[_Place]) -> None:
    """Drop the entries `gone` of the list `kind`; what stands at `places` follows."""
    if not gone:
        return
    entries = document[kind]
    kept = [i for i in range(len(entries)) if i not in gone]
    number = {old: new for new, old in enumerate(kept)}
    for box, key in places:
        box[key] = number[box[key]]
    document[kind] = [entries[i] for i in kept]
    if not kept:
        del document[kind]


def _references(document: dict[str, Any]) -> Iterator[_Place]:
    """Where numbers of accessors stand: mappings and keys."""
    for mesh in document.get("meshes", []):
        yield from _mesh_references(mesh)
    for animation in document.get("animations", []):
        for sampler in animation["samplers"]:
            yield sampler, "input"
            yield sampler, "output"
    for skin in document.get("skins", []):
        if "inverseBindMatrices" in skin:
            yield skin, "inverseBindMatrices"
    for node in document.get("nodes", []):
        attributes = node.get("extensions", {}).get(INSTANCING, {}).get("attributes", {})
        yield from ((attributes, name) for name in attributes)


def _mesh_references(mesh: dict[str, Any]) -> Iterator[_Place]:
    for primitive in mesh["primitives"]:
        if "indices" in primitive:
            yield primitive, "indices"
        for attributes in (primitive["attributes"], *primitive.get("targets", [])):
            yield from ((attributes, name) for name in attributes)


def _material_references(mesh: dict[str, Any]) -> Iterator[_Place]:
    for primitive in mesh["primitives"]:
        if "material" in primitive:
            yield primitive, "material"
        variants = primitive.get("extensions", {}).get("KHR_materials_variants", {})
        yield from ((mapping, "material") for mapping in variants.get("mappings", []))


def _texture_references(material: dict[str, Any]) -> Iterator[_Place]:
    """The textures of a material and of its extensions: their keys all end with `Texture`."""
    for part in _mappings(material):
        for key, value in part.items():
            if key.endswith("Texture") and isinstance(value, dict) and "index" in value:
                yield value, "index"


def _picture_references(texture: dict[str, Any]) -> Iterator[_Place]:
    """The pictures of a texture, that of an extension for another format included."""
    return ((part, "source") for part in _mappings(texture) if "source" in part)


def _copy_views(source: GltfDocument, document: dict[str, Any], buffer: GlbBuffer) -> None:
    """Move the views in use, with their bytes, to the buffer."""
    views = document.pop("bufferViews", [])
    places = list(_views_in_use(document))
    number = {}
    for i in sorted({box["bufferView"] for box in places}):
        check_index(i, views, "bufferView")
        view = views[i]
        begin, length = view.get("byteOffset", 0), view["byteLength"]
        # accessors within may rely on where the view lay among four bytes
        lead = begin % 4
        more = {key: view[key] for key in ("byteStride", "target", "name", "extras") if key in view}
        content = source.buffer(view["buffer"])[begin - lead : begin + length]
        number[i] = buffer.add_bytes(content, **more)
        buffer.views[-1]["byteOffset"] += lead
        buffer.views[-1]["byteLength"] -= lead
    for box in places:
        box["bufferView"] = number[box["bufferView"]]


def _embed_pictures(source: GltfDocument, document: dict[str, Any], buffer: GlbBuffer) -> None:
    """Take the pictures that lie beside the file into the buffer; those that are missing stay named."""
    for image in document.get("images", []):
        uri = image.get("uri")
        if uri is None or uri.startswith("data:"):
            continue
        try:
            content = source.beside(uri).read_bytes()
        except (WeathercoatError, OSError):
            continue
        del image["uri"]
        image.setdefault("mimeType", mimetypes.guess_type(uri)[0] or "image/png")
        image["bufferView"] = buffer.add_bytes(content)


def _views_in_use(document: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The mappings that refer to a view: glTF and its extensions all call it `bufferView`."""
    return (part for part in _mappings(document) if isinstance(part.get("bufferView"), int))


def _mappings(part: Any) -> Iterator[dict[str, Any]]:
    """The mappings in `part`, itself included, but for extras, which mean nothing."""
    rest = [part]
    while rest:
        part = rest.pop()
        if isinstance(part, dict):
            yield part
            rest += [value for key, value in part.items() if key != "extras"]
        elif isinstance(part, list):
            rest += part
