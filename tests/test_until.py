"""Runs that stop where enough paint is gone: at the first step, with the state of a run to that step."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.test_resume import StopAfter
from weathercoat.config.load import load_config
from weathercoat.errors import ConfigError, ResumeError, UsageError
from weathercoat.grades import FLAKING_FROM, RUST_FROM
from weathercoat.mesh.shapes import make_random_sheet
from weathercoat.mesh.surface import Surface
from weathercoat.output.checkpoints import read_checkpoint
from weathercoat.output.cracks import find_openings
from weathercoat.output.meshes import write_mesh
from weathercoat.output.severity import measure_severity
from weathercoat.run import prepare_simulation, run_asset
from weathercoat.until import Until

STEPS = 60
SETTINGS = (
    "remesh.faces=300",
    f"ageing.steps={STEPS}",
    "ageing.duration=1.2",
    "snapshots.count=3",
    "output.preview=false",
    "output.formats=ply",
)


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("model") / "sheet.ply"
    write_mesh(path, make_random_sheet(faces=300))
    return path


@pytest.fixture(scope="module")
def every_step(model: Path, tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """The severity of the whole after each step of a run to the end."""
    folder = tmp_path_factory.mktemp("whole") / "out"
    steps = ",".join(map(str, range(STEPS + 1)))
    report = _run(model, folder, "snapshots.count=null", f"snapshots.steps=[{steps}]")
    return [row["severity"]["whole"] for row in report["snapshots"]]


def _run(model: Path, out: Path, *settings: str, **more: Any) -> dict[str, Any]:
    return run_asset(load_config("standard", [*SETTINGS, *settings]), model, out, **more)


@pytest.mark.parametrize(
    ("limit", "figure", "least"),
    [
        ("rust=Ri3", "rusted_percent", RUST_FROM[2]),
        ("rust=D610:4", "rusted_percent", 3.0 + 1e-12),
        ("flaking=5", "flaked_percent", FLAKING_FROM[4]),
        ("bare=12%", "flaked_percent", 12.0),
    ],
)
def test_a_run_stops_at_the_first_step_that_reaches_a_limit(
    limit: str, figure: str, least: float, model: Path, every_step: list[dict[str, Any]], tmp_path: Path
) -> None:
    first = next(step for step, figures in enumerate(every_step) if figures[figure] >= least)
    assert 0 < first < STEPS
    report = _run(model, tmp_path / "out", f"ageing.until={limit}")
    last = report["snapshots"][-1]
    assert (last["step"], last["severity"]["whole"]) == (first, every_step[first])
    assert report["stopped"] == f"reached {limit} at step {first}, age {last['age']:g}"


def test_all_of_a_mix_and_any_of_a_list(
    model: Path, every_step: list[dict[str, Any]], tmp_path: Path
) -> None:
    both = next(
        step
        for step, figures in enumerate(every_step)
        if figures["rusted_percent"] >= 3.0 and figures["flaked_percent"] >= 2.0
    )
    limits = '["bare=100%", "rust=3%,bare=2%"]'
    report = _run(model, tmp_path / "out", f"ageing.until={limits}")
    assert report["stopped"].startswith(f"reached rust=3%,bare=2% at step {both},")


def test_the_state_is_that_of_a_run_to_that_step(model: Path, tmp_path: Path) -> None:
    stopped = _run(model, tmp_path / "a", "ageing.until=bare=5%")
    step = stopped["snapshots"][-1]["step"]
    _run(
        model, tmp_path / "b", f"ageing.steps={step}", f"ageing.duration={1.2 * step / STEPS:.6g}",
        "snapshots.count=1",
    )  # fmt: skip
    one, two = read_checkpoint(tmp_path / "a"), read_checkpoint(tmp_path / "b")
    assert one is not None and two is not None
    assert one.arrays.keys() == two.arrays.keys()
    for name in one.arrays:
        np.testing.assert_array_equal(one.arrays[name], two.arrays[name], err_msg=name)


def test_a_limit_that_is_never_reached(model: Path, tmp_path: Path) -> None:
    lines: list[str] = []
    report = _run(model, tmp_path / "out", "ageing.until=bare=100%", log=lines.append)
    assert report["snapshots"][-1]["step"] == STEPS
    assert report["stopped"] == f"reached the end: step {STEPS}, age 1.2; bare=100% was not reached"
    assert report["stopped"] in lines


def test_resumed_runs_stop_at_the_same_step(model: Path, tmp_path: Path) -> None:
    until = "ageing.until=bare=5%"
    whole = _run(model, tmp_path / "whole", until)
    with pytest.raises(KeyboardInterrupt):
        _run(model, tmp_path / "out", until, patience=StopAfter(4))
    _run(model, tmp_path / "out", until, resume=True)
    for name in [*sorted(whole["files"]), "run.json"]:
        assert (tmp_path / "out" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name


def test_a_stopped_run_goes_on_to_a_later_limit_and_to_the_end(model: Path, tmp_path: Path) -> None:
    _run(model, tmp_path / "out", "ageing.until=bare=2%")
    further = _run(model, tmp_path / "out", "ageing.until=bare=5%", resume=True)
    at_once = _run(model, tmp_path / "at once", "ageing.until=bare=5%")
    assert further["files"] == at_once["files"]
    assert _run(model, tmp_path / "out", resume=True)["snapshots"][-1]["step"] == STEPS


def test_a_limit_that_the_run_has_passed(model: Path, tmp_path: Path) -> None:
    _run(model, tmp_path / "out", "ageing.until=bare=5%")
    before = (tmp_path / "out" / "run.json").read_bytes()
    with pytest.raises(ResumeError, match="is past bare=2%"):
        _run(model, tmp_path / "out", "ageing.until=bare=2%", resume=True)
    assert (tmp_path / "out" / "run.json").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def _halves() -> Surface:
    """A sheet with two material groups."""
    from dataclasses import replace

    sheet = make_random_sheet(faces=300)
    left = sheet.vertices[sheet.faces][:, :, 0].mean(axis=1) < np.median(sheet.vertices[:, 0])
    return replace(sheet, face_group=left.astype(np.int32), groups=("right", "left"))


def test_limits_of_a_group_have_the_bits_of_its_severity() -> None:
    config = load_config("standard", ["remesh=off", *SETTINGS[1:]]).config
    simulation = prepare_simulation(_halves(), config)
    until = Until(["bare@left=4%"], simulation.surface)
    others = 0.0
    while until.reached(simulation) is None and simulation.step_count < STEPS:
        simulation.step()
        snapshot = simulation.snapshot()
        groups = measure_severity(snapshot, find_openings(snapshot))["groups"]
        assert (groups["left"]["flaked_percent"] >= 4.0) == (until.reached(simulation) == "bare@left=4%")
        others = groups["right"]["flaked_percent"]
    assert until.reached(simulation)
    assert others != groups["left"]["flaked_percent"]


def test_a_group_that_is_not_there(model: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="rust@mast=Ri2 names no painted group or part"):
        _run(model, tmp_path / "out", '"ageing.until=rust@mast=Ri2"'.strip('"'))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("limit", ["rust=Ri9", "bare=12", "[bare=2%, snow=3]"])
def test_no_limits(limit: str) -> None:
    with pytest.raises(ConfigError, match=r"ageing\.until\[\d\]: must be"):
        load_config("standard", [f"ageing.until={limit}"])


def test_asking_costs_little_beside_a_step() -> None:
    config = load_config("standard", ["remesh=off"]).config
    simulation = prepare_simulation(make_random_sheet(faces=4000), config)
    until = Until(["rust=Ri5", "bare=90%"], simulation.surface)
    simulation.step()
    spent = {"asking": 0.0, "steps": 0.0}
    for _ in range(30):
        started = time.process_time()
        simulation.step()
        middle = time.process_time()
        until.reached(simulation)
        spent["asking"] += time.process_time() - middle
        spent["steps"] += middle - started
    assert spent["asking"] < spent["steps"]


def test_sizes_in_millimetres_follow_from_the_units(model: Path, tmp_path: Path) -> None:
    for name, setting in (("cm", "model.units=cm"), ("own", "scene.metres_per_unit=0.01")):
        _run(model, tmp_path / name, setting, "ageing.steps=30")
        whole = json.loads((tmp_path / name / "run.json").read_text())["snapshots"][-1]["severity"]["whole"]
        assert whole["millimetres"]["area"] == pytest.approx(whole["area"] * 100.0, rel=1e-11)
        assert whole["grades"]["iso_4628_5_size"] is not None
