"""Plans: nearer scenes get dearer runs, and what was chosen is told with its reasons."""

from __future__ import annotations

from pathlib import Path

import pytest

from weathercoat.config import quality
from weathercoat.config.load import load_config
from weathercoat.config.quality import Errors, Front, Point
from weathercoat.mesh.shapes import make_plate
from weathercoat.output.folder import read_run
from weathercoat.output.meshes import write_mesh
from weathercoat.plan import make_plan, plan_lines
from weathercoat.run import run_asset


def point(edge: float, steps: int, solver: str, errors: Errors | None) -> Point:
    return Point(edge, {"ageing.steps": steps, "deformation.solver": solver}, errors)


FLAT = point(1.0, 20, "none", Errors(0.08, 0.05, 0.2, {1.0: 0.4, 10.0: 0.45, 100.0: 0.9}))
WRONG = point(1.0, 10, "none", Errors(0.3, 0.05, 0.2, {1.0: 0.1}))
CURLED = point(0.5, 40, "newton", Errors(0.02, 0.02, 0.01, {1.0: 0.2, 100.0: 0.4}))
FINEST = point(0.4, 50, "newton", None)


@pytest.fixture(autouse=True)
def front(monkeypatch: pytest.MonkeyPatch) -> None:
    """A front whose points fail one by one as the scene comes nearer."""
    points = (WRONG, FLAT, CURLED, FINEST)
    levels = {"draft": WRONG, "standard": FLAT, "fine": CURLED, "reference": FINEST}
    made = Front(points, levels, {"areas": 0.1, "spacing": 0.1})
    monkeypatch.setattr("weathercoat.plan.read_front", lambda: made)
    monkeypatch.setattr(quality, "read_front", lambda: made)


def plan_for(pixels_per_size: float, *overrides: str) -> dict[str, object]:
    """What `run.json` would say of a plate of size 2, which is seen in so many pixels."""
    part = make_plate(2.0, 2.0)
    scene = f"scene.pixels_per_metre={pixels_per_size / 2}"
    plan = make_plan(load_config("standard", ["quality=auto", scene, *overrides]), part, len(part.faces))
    assert plan.quality is not None
    return plan.quality


@pytest.mark.parametrize(
    ("pixels_per_size", "steps", "reason"),
    [
        (25.0, 20, "the next cheaper one lacks: areas off by 30%"),
        (124.0, 20, "film off by 0.99 pixels"),
        (126.0, 40, "the next cheaper one lacks: film off by 1 pixels"),
        (2400.0, 40, "film off by 0.96 pixels"),
        (2600.0, 50, "no cheaper way is good enough"),
    ],
)
def test_the_cheapest_good_way_is_taken(pixels_per_size: float, steps: int, reason: str) -> None:
    """A shear lag is 0.04 sizes: `FLAT` is off by a pixel from 125 pixels a size on."""
    found = plan_for(pixels_per_size)
    assert found["chosen"]["steps"] == steps  # type: ignore[index]
    assert reason in str(found["why"])


def test_expected_errors_are_those_at_the_size_of_the_scene() -> None:
    found = plan_for(25.0)
    assert found["expected"]["errors"] == {  # type: ignore[index]
        "pixels": 0.2, "image": 0.4, "areas": 0.08, "spacing": 0.05,
    }  # fmt: skip
    assert found["scene"] == pytest.approx({"per_unit": 12.5, "per_size": 25.0, "per_lag": 1.0})
    assert found["chosen"] == {
        "edge_length": pytest.approx(0.08), "faces": FLAT.faces(0.04), "steps": 20, "solver": "none",
        "curls": False,
    }  # fmt: skip
    assert plan_for(2600.0)["expected"]["errors"] is None  # type: ignore[index]


def test_what_was_kept_is_told_and_no_errors_are_promised() -> None:
    found = plan_for(25.0, "ageing.steps=33")
    assert found["kept"] == {"ageing.steps": "--set"}
    assert found["chosen"]["steps"] == 33  # type: ignore[index]
    assert found["expected"]["errors"] is None  # type: ignore[index]


def test_a_plan_for_people() -> None:
    part = make_plate(2.0, 2.0)
    loaded = load_config("standard", ["quality=auto", "scene.pixels_per_metre=12.5", "ageing.steps=33"])
    text = "\n".join(plan_lines(make_plan(loaded, part, 2)))
    assert "none: the film stays flat" in text
    assert "ageing.steps, as it is set by --set" in text
    assert "1 pixels long" in text
    plain = "\n".join(plan_lines(make_plan(load_config("standard"), part, 2)))
    assert "sweeps, 10 a step" in plain and "quality" not in plain


def test_a_run_follows_its_plan_and_reports_it(tmp_path: Path) -> None:
    write_mesh(tmp_path / "plate.obj", make_plate())
    small = ["snapshots.count=1", "output.preview=false", "output.formats=ply", "fracture.shear_lag=0.2"]
    loaded = load_config("standard", ["quality=auto", "scene.pixels_per_metre=5", *small])
    said: list[str] = []
    report = run_asset(loaded, tmp_path / "plate.obj", tmp_path / "out", log=said.append)
    assert report["quality"]["chosen"]["steps"] == report["config"]["ageing"]["steps"] == 20
    assert report["meshes"]["film"]["faces"] == pytest.approx(report["quality"]["chosen"]["faces"], rel=0.05)
    assert any(line.startswith("quality auto: the cheapest") for line in said)
    stored, snapshots = read_run(tmp_path / "out")
    assert stored["quality"] == report["quality"]
    assert snapshots[-1].step == 20
