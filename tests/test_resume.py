"""Runs that were interrupted go on, and finished ones further: the folder is that of a run at once."""

from __future__ import annotations

import json
import multiprocessing
import os
import random
import shutil
import signal
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

import pytest

from weathercoat.config.load import load_config
from weathercoat.errors import CorruptError, OutputError, OutputExistsError, ResumeError
from weathercoat.mesh.shapes import make_random_sheet
from weathercoat.output.folder import CHECKPOINT_STATE, RunFolder
from weathercoat.output.meshes import write_mesh
from weathercoat.run import run_asset

STEPS = 24
SETTINGS = (
    "remesh.faces=150",
    f"ageing.steps={STEPS}",
    "adhesion.amplitude=0.9",
    "snapshots.count=4",
    "output.preview=false",
)
PICTURES = ("output.preview=true", "output.picture_width=48", "output.picture_height=32")


class StopAfter:
    """Asks to stop after so many steps."""

    def __init__(self, steps: int) -> None:
        self.left = steps

    @property
    def is_asked(self) -> bool:
        self.left -= 1
        return self.left <= 0

    def stop(self) -> NoReturn:
        raise KeyboardInterrupt

    def __enter__(self) -> object:
        return self

    def __exit__(self, *error: Any) -> None:
        pass


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("model") / "sheet.ply"
    write_mesh(path, make_random_sheet(faces=150))
    return path


def run(model: Path, out: Path, *settings: str, config: str = "standard", **more: Any) -> dict[str, Any]:
    return run_asset(load_config(config, [*SETTINGS, *settings]), model, out, **more)


def interrupt(model: Path, out: Path, step: int, settings: Sequence[str] = (), **more: Any) -> Path:
    """Stop a run after a step; the folder where it is kept."""
    with pytest.raises(KeyboardInterrupt) as caught:
        run(model, out, *settings, patience=StopAfter(step), **more)
    partial = out.with_name(f"{out.name}.partial")
    assert caught.value.__notes__ == [f"the work so far is kept in {partial}"]
    return partial


def content(folder: Path) -> dict[str, bytes]:
    """All files of a folder but the timing."""
    files = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {str(file.relative_to(folder)): file.read_bytes() for file in files if file.name != "timing.json"}


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_the_folder_is_the_same_wherever_the_run_was_interrupted(model: Path, tmp_path: Path) -> None:
    run(model, tmp_path / "whole")
    whole = content(tmp_path / "whole")
    assert "checkpoint/state.npz" in whole and "snapshots/step_0024.ply" in whole
    for step in range(1, STEPS):
        out = tmp_path / f"after{step}"
        partial = interrupt(model, out, step)
        assert not out.exists() and len(list(partial.glob("snapshots/*.ply"))) == step // 6
        run(model, out, resume=True)
        assert content(out) == whole
        assert not partial.exists()


@pytest.mark.parametrize("settings", [PICTURES, ("remesh=off",), ("checkpoint.keep=false",), ("seed=3",)])
def test_it_is_the_same_with_other_outputs(model: Path, tmp_path: Path, settings: tuple[str, ...]) -> None:
    run(model, tmp_path / "whole", *settings)
    interrupt(model, tmp_path / "twice", 8, settings)
    interrupt(model, tmp_path / "twice", 7, settings, resume=True)
    run(model, tmp_path / "twice", *settings, resume=True)
    assert content(tmp_path / "twice") == content(tmp_path / "whole")
    assert ("checkpoint" in names(tmp_path / "whole")) == ("checkpoint.keep=false" not in settings)


def test_untouched_parts_go_on_too(tmp_path: Path) -> None:
    model = tmp_path / "two.obj"
    model.write_text(
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 3 0 1\nv 4 0 1\nv 4 1 1\n"
        "usemtl metal\nf 1 2 3 4\nusemtl glass\nf 5 6 7\n"
    )
    settings = ("paint.except=[glass]", *PICTURES)
    run(model, tmp_path / "whole", *settings)
    interrupt(model, tmp_path / "part", 9, settings)
    run(model, tmp_path / "part", *settings, resume=True)
    assert content(tmp_path / "part") == content(tmp_path / "whole")
    assert "untouched.ply" in names(tmp_path / "part")


def test_resuming_begins_where_there_is_nothing_and_leaves_a_finished_run_alone(
    model: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    run(model, out, resume=True)
    before = {path: path.stat().st_mtime_ns for path in out.rglob("*")}
    said: list[str] = []
    report = run(model, out, resume=True, log=said.append)
    assert said[-1] == f"{out}: finished already"
    assert report["stopped"] == "reached the end: step 24, age 1" and "timing" not in report
    assert {path: path.stat().st_mtime_ns for path in out.rglob("*")} == before
    assert names(tmp_path) == ["out"]


def test_a_finished_run_can_be_extended(model: Path, tmp_path: Path) -> None:
    """More age and more snapshots, from the last state; the result is that of a run at once."""
    short = ("snapshots.steps=[6,12,24]",)
    longer = ("ageing.steps=48", "ageing.duration=2.0", "snapshots.steps=[12,24,30,48]")
    run(model, tmp_path / "whole", *longer)
    run(model, tmp_path / "out", *short)
    said: list[str] = []
    run(model, tmp_path / "out", *longer, resume=True, log=said.append)
    assert any("going on from step 24 of 48" in line for line in said)
    assert content(tmp_path / "out") == content(tmp_path / "whole")
    assert names(tmp_path) == ["out", "whole"]


def test_pictures_are_extended_too(model: Path, tmp_path: Path) -> None:
    longer = ("ageing.steps=36", "ageing.duration=1.5", "snapshots.count=3", *PICTURES)
    run(model, tmp_path / "whole", *longer)
    run(model, tmp_path / "out", "snapshots.count=2", *PICTURES)
    run(model, tmp_path / "out", *longer, resume=True)
    assert content(tmp_path / "out") == content(tmp_path / "whole")


def test_names_of_snapshots_follow_a_longer_run(model: Path, tmp_path: Path) -> None:
    """From ten thousand steps on, the names have another digit."""
    quick = ("ageing.steps=6", "ageing.duration=0.0006", "snapshots.steps=[3]", "deformation.sweeps=1")
    longer = ("ageing.steps=10000", "ageing.duration=1.0", "snapshots.steps=[3,9]", "deformation.sweeps=1")
    run(model, tmp_path / "out", *quick)
    partial = interrupt(model, tmp_path / "out", 4, longer, resume=True)
    assert names(partial / "snapshots") == [
        f"step_0000{step}.{kind}" for step in (3, 9) for kind in ("glb", "ply")
    ]
    assert names(tmp_path / "out" / "snapshots") == ["step_0003.glb", "step_0003.ply"]


def test_a_snapshot_that_was_passed_makes_the_run_begin_again(model: Path, tmp_path: Path) -> None:
    settings = ("snapshots.steps=[5,24]",)
    run(model, tmp_path / "whole", *settings)
    run(model, tmp_path / "out", "snapshots.steps=[6,24]")
    said: list[str] = []
    run(model, tmp_path / "out", *settings, resume=True, log=said.append)
    assert any("begins again" in line and "step 5" in line for line in said)
    assert content(tmp_path / "out") == content(tmp_path / "whole")


def test_a_run_without_a_kept_state_begins_again_when_it_is_extended(model: Path, tmp_path: Path) -> None:
    longer = ("ageing.steps=48", "ageing.duration=2.0", "checkpoint.keep=false")
    run(model, tmp_path / "whole", *longer)
    run(model, tmp_path / "out", "checkpoint.keep=false")
    run(model, tmp_path / "out", *longer, resume=True)
    assert content(tmp_path / "out") == content(tmp_path / "whole")


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        (("curl.radius=0.07", "seed=9"), "curl.radius is 0.07, and was 0.05, seed is 9, and was 1"),
        (("ageing.steps=30",), "ageing.duration / ageing.steps"),
        (("ageing.steps=6", "ageing.duration=0.25", "snapshots.count=1"), "has reached step 8"),
        (("output.formats=[ply]",), "output.formats is ['ply'], and was ['ply', 'glb']"),
    ],
)
def test_another_config_is_refused_by_name(
    model: Path, tmp_path: Path, settings: tuple[str, ...], says: str
) -> None:
    partial = interrupt(model, tmp_path / "out", 8)
    before = content(partial)
    with pytest.raises(ResumeError) as caught:
        run(model, tmp_path / "out", *settings, resume=True)
    assert says in caught.value.line() and caught.value.exit_code == 7
    assert content(partial) == before
    run(model, tmp_path / "out", resume=True)


def test_another_input_is_refused_by_name(model: Path, tmp_path: Path) -> None:
    mine = tmp_path / "sheet.ply"
    shutil.copy(model, mine)
    run(mine, tmp_path / "done")
    interrupt(mine, tmp_path / "out", 8)
    write_mesh(mine, make_random_sheet(faces=150, seed=7), overwrite=True)
    for out in (tmp_path / "done", tmp_path / "out"):
        with pytest.raises(ResumeError, match=r"input sheet\.ply"):
            run(mine, out, resume=True)
    assert names(tmp_path) == ["done", "out.partial", "sheet.ply"]


def test_interrupted_work_is_not_lost_by_a_mistake(model: Path, tmp_path: Path) -> None:
    """A run without --resume refuses; with --overwrite it begins anew."""
    partial = interrupt(model, tmp_path / "out", 8)
    with pytest.raises(OutputExistsError, match="holds an interrupted run") as caught:
        run(model, tmp_path / "out")
    assert "--resume" in caught.value.line() and (partial / CHECKPOINT_STATE).is_file()
    run(model, tmp_path / "out", overwrite=True)
    assert names(tmp_path) == ["out"]


@pytest.mark.parametrize("file", ["state.npz", "surface.npz"])
@pytest.mark.parametrize("damage", ["cut", "flip", "empty", "gone"])
def test_a_damaged_checkpoint_is_one_line(model: Path, tmp_path: Path, file: str, damage: str) -> None:
    partial = interrupt(model, tmp_path / "out", 8)
    path = partial / "checkpoint" / file
    whole = path.read_bytes()
    middle = len(whole) // 2
    damaged = {
        "cut": whole[:middle],
        "flip": whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :],
        "empty": b"",
    }
    if damage == "gone":
        path.unlink()
    else:
        path.write_bytes(damaged[damage])
    if (file, damage) == ("state.npz", "gone"):
        run(model, tmp_path / "out", resume=True)  # there is nothing to go on from
        return
    with pytest.raises(CorruptError, match="checkpoint is broken") as caught:
        run(model, tmp_path / "out", resume=True)
    assert "--overwrite" in caught.value.line()


def test_a_checkpoint_of_another_version_is_refused(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patched:
        patched.setattr("weathercoat.output.checkpoints.__version__", "0.0.1")
        interrupt(model, tmp_path / "out", 8)
    with pytest.raises(ResumeError, match=r"weathercoat 0\.0\.1 wrote"):
        run(model, tmp_path / "out", resume=True)


def test_two_processes_do_not_write_one_folder(model: Path, tmp_path: Path) -> None:
    with (
        RunFolder(tmp_path / "out") as folder,
        pytest.raises(OutputError, match="another process is writing it"),
    ):
        (folder / "run.json").write_text("{}")
        run(model, tmp_path / "out")
    assert names(tmp_path / "out") == ["run.json"]


def test_checkpoints_come_by_steps_and_by_the_clock(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written: list[int] = []

    def write(self: Any, simulation: Any) -> None:
        written.append(simulation.step_count)

    monkeypatch.setattr("weathercoat.recording.CheckpointKeeper.write", write)
    run(model, tmp_path / "steps", "checkpoint.steps=7", "checkpoint.minutes=0")
    assert written == [7, 14, 21, 24]
    written.clear()
    run(model, tmp_path / "clock", "checkpoint.minutes=1e-9")
    assert written == [*range(STEPS), 24]
    written.clear()
    run(model, tmp_path / "none", "checkpoint.minutes=0", "checkpoint.keep=false")
    assert written == []


@pytest.mark.skipif(os.name == "nt", reason="processes are forked")
@pytest.mark.parametrize("kills", [8, pytest.param(200, marks=pytest.mark.long)])
def test_whoever_is_killed_goes_on(model: Path, tmp_path: Path, kills: int) -> None:
    """SIGKILL at random moments, again and again, also of runs that replace or extend an older result: what
    was there is not touched, and in the end all bytes are those of a run at once.
    """
    settings = ("checkpoint.steps=3", *PICTURES)
    longer = (*settings, "ageing.steps=48", "ageing.duration=2.0", "snapshots.count=8")
    run(model, tmp_path / "whole", *settings)
    run(model, tmp_path / "longer", *longer)
    whole, extended = content(tmp_path / "whole"), content(tmp_path / "longer")
    timing = json.loads((tmp_path / "longer" / "timing.json").read_text())
    moments = random.Random(kills)
    fork = multiprocessing.get_context("fork")
    out = tmp_path / "out"
    done = finished = 0
    while done < kills:
        was_whole = out.exists()
        assert not was_whole or content(out) == whole
        wanted = longer if was_whole else settings
        child = fork.Process(target=run, args=(model, out, *wanted), kwargs={"resume": True})
        child.start()
        time.sleep(moments.uniform(0.0, 0.6 * timing["seconds"]))
        if child.is_alive():
            assert child.pid is not None
            os.kill(child.pid, signal.SIGKILL)
        child.join()
        if child.exitcode == -signal.SIGKILL:
            done += 1
        else:
            assert child.exitcode == 0
        if out.exists() and (was_whole or content(out) == extended) and content(out) != whole:
            assert content(out) == extended
            finished += 1
            shutil.rmtree(out)
    assert finished >= kills // 50
    run(model, out, *longer, resume=True)
    assert content(out) == extended
