"""Reading a scene, from YAML or glTF."""

from __future__ import annotations

from pathlib import Path

from weathercoat.errors import EmptyFileError, FormatError, WeathercoatError
from weathercoat.mesh.read import load_bytes
from weathercoat.scene.graph import Scene

_YAML = (".yaml", ".yml")
_GLTF = (".glb", ".gltf")


def read_scene(path: str | Path, *, max_faces: int = 20_000_000) -> Scene:
    """Read a scene: the nodes of a GLB or glTF file, or what a YAML file lists.

    Every mesh is repaired as `read_surface` does, once, in its own coordinates. max_faces: triangles of all
    meshes together beyond which the scene is refused; instances do not count.

    Errors: ConfigError with every problem of a YAML file; for files and meshes those of `read_surface`, with
    the file's name.
    """
    path = Path(path)
    try:
        data = load_bytes(path)
        if not data:
            raise EmptyFileError("the file has no bytes")
        extension = path.suffix.lower()
        if data.startswith(b"glTF") or extension in _GLTF:
            from weathercoat.scene.read_glb import parse_glb

            return parse_glb(data, path, max_faces=max_faces)
        if extension in _YAML:
            from weathercoat.scene.read_yaml import parse_yaml

            return parse_yaml(data, path, max_faces=max_faces)
        raise FormatError("is no scene", remedy="give a YAML (.yaml), GLB or glTF file")
    except WeathercoatError as error:
        if not (hasattr(error, "problems") and error.problems):
            error.file = error.file or str(path)
        raise
