"""Whatever is wrong with a glTF scene, it is refused when it is read, before any work, or can be written."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.scene.documents import Document
from tests.scene.test_write import aged_cube
from weathercoat.errors import WeathercoatError
from weathercoat.scene.read import read_scene
from weathercoat.scene.write import write_scene

ODD = (None, -1, "x", {})
MORE = (True, 10**30, 0.5, [], [[0]], float("nan"))


def rich_document(folder: Path) -> dict[str, Any]:
    """A document with something of all that is read or carried along."""
    document = Document()
    times, moves = np.array([0, 1], "<f4"), np.array([[0, 0, 0], [5, 6, 7]], "<f4")
    sampler = {"input": document.accessor(times), "output": document.accessor(moves)}
    extension = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": document.accessor(moves)}}}
    mesh, other = document.mesh("a", material=0), document.mesh("b", extras={"bufferView": 99})
    document.node(name="group", children=[1, 2, 3], rotation=[0, 0, 0, 1])
    document.node(name="many", mesh=mesh, extensions=extension)
    document.node(name="one", mesh=other, matrix=np.eye(4).ravel().tolist())
    document.node(name="eye", camera=0, translation=[0, 1, 5])
    document.write(
        folder / "rich.gltf",
        animations=[
            {
                "channels": [{"sampler": 0, "target": {"node": 3, "path": "translation"}}],
                "samplers": [sampler],
            }
        ],
        cameras=[{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}],
        materials=[{"name": "x", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        textures=[{"source": 0}],
        images=[{"bufferView": 0, "mimeType": "image/png"}, {"uri": "none.png"}],
        skins=[{"joints": [0], "inverseBindMatrices": 0}],
        extensionsUsed=["EXT_mesh_gpu_instancing"],
    )
    made: dict[str, Any] = json.loads((folder / "rich.gltf").read_text())
    return made


def places(part: Any, way: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The way to every value of a document."""
    if way:
        yield way
    if isinstance(part, dict | list) and len(way) < 9:
        for key, value in part.items() if isinstance(part, dict) else enumerate(part):
            yield from places(value, (*way, key))


def test_the_document_itself_is_sound(tmp_path: Path) -> None:
    rich_document(tmp_path)
    scene = read_scene(tmp_path / "rich.gltf")
    assert [o.name for o in scene.objects] == ["many/0", "many/1", "one"]
    write_scene(tmp_path / "out.glb", scene, {"one": "v", "many/0": "v"}, {"v": aged_cube()})
    assert len(read_scene(tmp_path / "out.glb").objects) == 3


@pytest.mark.parametrize(
    "odd", [*ODD, *(pytest.param(odd, marks=pytest.mark.long) for odd in MORE)], ids=repr
)
def test_any_value_may_be_odd(odd: object, tmp_path: Path) -> None:
    document = rich_document(tmp_path)
    film = aged_cube()
    refused = 0
    ways = [way for way in places(document) if way[:1] != ("buffers",)]
    for way in ways:
        changed = deepcopy(document)
        part: Any = changed
        for key in way[:-1]:
            part = part[key]
        part[way[-1]] = odd
        (tmp_path / "odd.gltf").write_text(json.dumps(changed))
        try:
            scene = read_scene(tmp_path / "odd.gltf")
        except WeathercoatError as error:
            assert error.code != "E-INTERNAL", way
            refused += 1
            continue
        for names in ([scene.objects[0].name], [o.name for o in scene.objects]):
            write_scene(io.BytesIO(), scene, dict.fromkeys(names, "v"), {"v": film})
    assert refused > 10
