"""The generated yard: what the bar on scenes asks for, and a believable place."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest

from weathercoat.errors import OutputExistsError, UsageError
from weathercoat.mesh.surface import Surface
from weathercoat.output.rays import make_rays
from weathercoat.scene.graph import Scene, SceneObject, world_surface
from weathercoat.scene.read import read_scene
from weathercoat.scene.yard import write_yard, write_yard_files


@pytest.fixture(scope="module")
def yard(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    _, rules = write_yard_files(tmp_path_factory.mktemp("yard") / "yard.glb")
    return read_scene(rules)


def test_fifty_objects_of_ten_meshes_and_a_path(yard: Scene) -> None:
    painted = [o for o in yard.objects if yard.decision(o.name).weathered is not False]
    assert len(painted) == 50 and len({o.mesh for o in painted}) == 10
    assert {o.name for o in yard.objects} - {o.name for o in painted} == {"ground"}
    assert not any(o.kept for o in yard.objects) and not yard.notes
    assert not any(surface.notes for surface in yard.meshes.values())
    assert yard.camera is not None and len(yard.camera.positions) > 50
    assert np.ptp(yard.camera.positions[:, 0]) > 10


def test_rules_match_something(yard: Scene) -> None:
    for rule in yard.rules:
        alone = Scene("one", {}, yard.objects, rules=(rule,))
        assert any(alone.decision(o.name) != type(rule)(o.name) for o in yard.objects), rule.pattern


def test_things_stand_on_the_ground_and_not_in_it(yard: Scene) -> None:
    lowest = {o.name: world_surface(yard, o).vertices[:, 1].min() for o in yard.objects}
    assert lowest.pop("ground") == pytest.approx(-0.1)
    assert min(lowest.values()) > -0.03  # a gear that leans digs in a little
    for name in ("barrel-4", "barrel-5", "locker-1", "post-3", "fence-post-1", "pipe-1"):
        assert lowest[name] == pytest.approx(0.0, abs=0.01)


def test_the_roof_shelters_what_is_stored(yard: Scene) -> None:
    placed = [world_surface(yard, o) for o in yard.objects]
    first = np.cumsum([0, *(len(s.vertices) for s in placed[:-1])])
    faces = np.concatenate([s.faces + start for s, start in zip(placed, first, strict=True)])
    rays = make_rays(np.concatenate([s.vertices for s in placed]), faces.astype(np.int32))

    def is_sheltered(name: str) -> bool:
        top = highest(placed[[o.name for o in yard.objects].index(name)])
        start = (top + np.array([0.0, 0.01, 0.0])).astype(np.float32)[None]
        return bool(rays.blocked(start, np.array([[0.0, 1.0, 0.0]], np.float32), 100.0)[0])

    assert all(map(is_sheltered, ("barrel-1", "locker-2", "gear-2", "sign-1", "post-5")))
    assert not any(map(is_sheltered, ("barrel-4", "barrel-5", "sign-2", "pipe-3", "gear-3", "roof-2")))


def highest(surface: Surface) -> np.ndarray:
    """The highest vertex of a surface, (3,)."""
    return surface.vertices[surface.vertices[:, 1].argmax()]


def test_the_same_bytes_each_time(tmp_path: Path) -> None:
    first, second = io.BytesIO(), io.BytesIO()
    write_yard(first)
    write_yard(second)
    assert first.getvalue() == second.getvalue()


def test_files_are_refused_before_anything_is_written(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="obj"):
        write_yard_files(tmp_path / "yard.obj")
    (tmp_path / "yard.yaml").write_text("mine")
    with pytest.raises(OutputExistsError):
        write_yard_files(tmp_path / "yard.glb")
    assert [path.name for path in tmp_path.iterdir()] == ["yard.yaml"]
    write_yard_files(tmp_path / "yard.glb", overwrite=True)


def test_mirrored_objects_are_among_them(yard: Scene) -> None:
    mirrored = [o for o in yard.objects if o.is_mirrored()]
    assert {o.mesh for o in mirrored} == {"bracket"}
    assert all(volume(yard, o) > 0 for o in mirrored)


def volume(yard: Scene, thing: SceneObject) -> float:
    surface = world_surface(yard, thing)
    return float(np.linalg.det(surface.vertices[surface.faces]).sum() / 6)
