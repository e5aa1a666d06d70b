"""What stays of the glTF document that a scene was read from, when some of its meshes are replaced.

Nodes, cameras, lights, animations, skins, materials, textures, extras and all that extensions add stay as
they are. Meshes that no node shows any more go, and with them the bytes that nothing else refers to. All
buffers, and pictures that lie beside the file, become one buffer.
"""

from __future__ import annotations

import mimetypes
from collections.abc import Iterable, Iterator
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


def retain(source: GltfDocument, buffer: GlbBuffer, shown: Iterable[int]) -> dict[str, Any]:
    """A copy of the document's JSON with the meshes `shown` alone; their bytes, views and accessors are in
    `buffer`, which was empty, and so not in the copy.

    Meshes, accessors and views are numbered anew, in their old order, everywhere but in the nodes that show
    a mesh which goes: the caller gives these another. Call it within `malformed_is_corrupt`.
    """
    document: dict[str, Any] = deepcopy(source.json)
    meshes = document.get("meshes", [])
    kept = sorted(set(shown))
    number = {old: new for new, old in enumerate(kept)}
    document["meshes"] = [meshes[i] for i in kept]
    for node in document.get("nodes", []):
        if node.get("mesh") in number:
            node["mesh"] = number[node["mesh"]]
    _drop_accessors(document, [mesh for i, mesh in enumerate(meshes) if i not in number])
    _copy_views(source, document, buffer)
    _embed_pictures(source, document, buffer)
    buffer.accessors += document.pop("accessors", [])
    return document


def _drop_accessors(document: dict[str, Any], dropped: list[dict[str, Any]]) -> None:
    """Drop the accessors that only the meshes `dropped` have, unless an extension may refer to them."""
    extensions = document.get("extensionsUsed", [])
    if not all(str(name).startswith(_UNDERSTOOD) for name in extensions):
        return
    accessors = document.get("accessors", [])
    gone = {box[key] for mesh in dropped for box, key in _mesh_references(mesh)}
    places = list(_references(document))
    gone -= {box[key] for box, key in places}
    kept = [i for i in range(len(accessors)) if i not in gone]
    number = {old: new for new, old in enumerate(kept)}
    document["accessors"] = [accessors[i] for i in kept]
    for box, key in places:
        box[key] = number[box[key]]


def _references(document: dict[str, Any]) -> Iterator[tuple[dict[str, Any], str]]:
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


def _mesh_references(mesh: dict[str, Any]) -> Iterator[tuple[dict[str, Any], str]]:
    for primitive in mesh["primitives"]:
        if "indices" in primitive:
            yield primitive, "indices"
        for attributes in (primitive["attributes"], *primitive.get("targets", [])):
            yield from ((attributes, name) for name in attributes)


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


def _views_in_use(part: Any) -> Iterator[dict[str, Any]]:
    """The mappings below `part` that refer to a view: glTF and its extensions all call it `bufferView`."""
    rest = [part]
    while rest:
        part = rest.pop()
        if isinstance(part, dict):
            if isinstance(part.get("bufferView"), int):
                yield part
            rest += [value for key, value in part.items() if key != "extras"]
        elif isinstance(part, list):
            rest += part
