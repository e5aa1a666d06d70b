"""The schema: defaults, bounds, and what each parameter says of itself."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from weathercoat.config.schema import LARGEST_SEED, Config, Snapshots, parameters
from weathercoat.config.section import Section


def nested(key: str, value: Any) -> dict[str, Any]:
    for name in reversed(key.split(".")):
        value = {name: value}
    return value


def test_defaults_hold_the_papers_values() -> None:
    config = Config()
    assert config.lift.convexity == 2.0
    assert config.fracture.direction_threshold == 0.45
    assert config.fracture.direction_factor == 0.20
    assert (config.defects.share, config.defects.strength) == (0.01, 0.001)
    assert config.ageing.steps == 1000
    assert config.appearance.rust == (132, 51, 0)


def test_resolved_values_give_the_same_config() -> None:
    config = Config.model_validate(
        {"remesh": False, "snapshots": {"steps": [0, 7]}, "paint": {"except": ["glass*"]}}
    )
    assert Config.model_validate(config.as_dict()) == config
    assert config.as_dict()["paint"] == {"only": [], "except": ["glass*"]}


def test_every_parameter_is_described_and_bounded() -> None:
    for parameter in parameters():
        assert parameter.description and parameter.kind, parameter.key
        if parameter.kind.startswith(("number", "whole number")):
            assert " from " in parameter.kind or " above " in parameter.kind, (
                f"{parameter.key} has no lower bound"
            )
            assert " to " in parameter.kind or " below " in parameter.kind, (
                f"{parameter.key} has no upper bound"
            )


def test_symbols_of_the_paper_name_one_key_each() -> None:
    symbols = [parameter.symbol for parameter in parameters() if parameter.symbol]
    assert {"k", "a", "α", "β", "λ", "A", "C", "T", "N"} <= set(symbols)  # noqa: RUF001
    assert len(symbols) == len(set(symbols))


@pytest.mark.parametrize("section", [kind for kind in Section.__subclasses__() if kind.model_fields])
def test_sections_are_frozen_and_closed(section: type[Section]) -> None:
    with pytest.raises(ValidationError, match="extra_forbidden"):
        section.model_validate({"no_such_key": 1})
    instance = section()
    with pytest.raises(ValidationError, match="frozen"):
        setattr(instance, next(iter(section.model_fields)), None)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("version", 2),
        ("seed", -1),
        ("seed", LARGEST_SEED + 1),
        ("seed", 1.5),
        ("remesh.faces", 3),
        ("remesh.faces", 20_000_001),
        ("remesh.crease_angle", 0),
        ("remesh.crease_angle", 180.1),
        ("ageing.steps", -1),
        ("ageing.duration", 0),
        ("ageing.duration", math.inf),
        ("tension.rate", -1),
        ("adhesion.wavelength", 0),
        ("adhesion.octaves", 0),
        ("cohesion.base", 0),
        ("cohesion.scatter", 1),
        ("defects.share", 1.1),
        ("fracture.direction_threshold", 0),
        ("fracture.direction_threshold", 1),
        ("fracture.direction_factor", 0),
        ("fracture.direction_factor", 1),
        ("fracture.shear_lag", 0),
        ("fracture.face_factor", 1),
        ("fracture.speed", 0),
        ("flaking.hanging_share", 1),
        ("curl.radius", 0),
        ("curl.angle_floor", math.pi),
        ("deformation.sweeps", -1),
        ("deformation.angle_stiffness", 1.01),
        ("dust.rate", math.nan),
        ("rust.runoff_length", 0),
        ("rust.alignment", 1),
        ("appearance.paint", [256, 0, 0]),
        ("appearance.paint", "red"),
        ("appearance.paint", [1.5, 0, 0]),
        ("appearance.thickness", -0.001),
        ("snapshots.count", 0),
        ("snapshots.steps", [-1]),
        ("snapshots.steps", [3, 2]),
        ("snapshots.steps", [2, 2]),
        ("output.formats", []),
        ("output.formats", ["fbx"]),
        ("output.picture_width", 15),
        ("model.up", [0, 0, 0]),
        ("model.up", [0, 1]),
        ("model.up", "w"),
        ("lift.coefficient", True),
        ("lift.coefficient", "0.3"),
        ("ageing.steps", True),
    ],
)
def test_values_that_cannot_work_are_refused(key: str, value: Any) -> None:
    with pytest.raises(ValidationError):
        Config.model_validate(nested(key, value))


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("remesh", "off", False),
        ("remesh", False, False),
        ("model.up", "-y", "-y"),
        ("model.up", [0, 0, 2], (0.0, 0.0, 2.0)),
        ("appearance.metal", "#0a0B0c", (10, 11, 12)),
        ("paint.only", "body", ("body",)),
        ("output.formats", "glb", ("glb",)),
        ("output.preview", "off", False),
        ("lift.coefficient", 1, 1.0),
        ("ageing.steps", 100.0, 100),
        ("seed", LARGEST_SEED, LARGEST_SEED),
    ],
)
def test_spellings_that_are_accepted(key: str, value: Any, expected: Any) -> None:
    found: Any = Config.model_validate(nested(key, value))
    for name in key.split("."):
        found = getattr(found, name)
    assert found == expected


def test_remesh_on_means_its_defaults() -> None:
    assert Config.model_validate({"remesh": "on"}) == Config.model_validate({"remesh": True}) == Config()


def test_values_that_contradict_each_other_are_named() -> None:
    config = Config.model_validate(
        {"tension": {"initial": 2.0}, "ageing": {"steps": 10}, "snapshots": {"steps": [5, 11]}}
    )
    assert [key for key, _ in config.conflicts()] == ["tension.initial", "snapshots.steps"]
    assert Config().conflicts() == []
    assert Config.model_validate({"tension": {"law": "linear", "initial": 2.0}}).conflicts() == []


@given(st.integers(1, 10_000), st.integers(1, 100))
def test_snapshots_are_evenly_spaced_and_end_with_the_run(steps: int, count: int) -> None:
    due = Snapshots(count=count).due(steps)
    assert due[-1] == steps and due[0] >= 1
    assert len(due) == min(count, steps)
    gaps = [later - earlier for earlier, later in zip((0, *due), due, strict=False)]
    assert max(gaps) - min(gaps) <= 1


def test_snapshots_at_explicit_steps() -> None:
    assert Snapshots(steps=(0, 3, 9)).due(9) == (0, 3, 9)
    with pytest.raises(ValidationError, match="count or steps"):
        Snapshots(steps=(1,), count=2)
