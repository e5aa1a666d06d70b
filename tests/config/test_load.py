"""Layers and origins of values, and the messages for everything that is wrong."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weathercoat.config.load import ConfigLoader, Override, load_config
from weathercoat.config.presets import preset_names
from weathercoat.config.schema import Config, Remesh
from weathercoat.errors import ConfigError


@pytest.fixture
def write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], str]:
    """Write `c.yaml` into an empty working directory."""
    monkeypatch.chdir(tmp_path)

    def write_config(text: str) -> str:
        Path("c.yaml").write_text(text, encoding="utf-8")
        return "c.yaml"

    return write_config


def problems(source: str, *overrides: str) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        load_config(source, overrides)
    assert caught.value.exit_code == 2
    return [str(problem) for problem in caught.value.problems]


def test_an_empty_file_gives_the_defaults(write: Callable[[str], str]) -> None:
    loaded = load_config(write("# nothing\nlift:\n"))
    assert loaded.config == Config()
    assert set(loaded.origins.values()) == {"default"}


def test_later_layers_win_and_origins_tell(write: Callable[[str], str]) -> None:
    path = write("preset: literal\nlift:\n  sum: per_valence\nseed: 5\n")
    loaded = load_config(path, ["seed=6", "curl.radius=1e-1", "seed=7"])
    assert loaded.config.seed == 7
    assert loaded.config.lift.sum == "per_valence" and loaded.config.lift.tension == "face"
    assert loaded.config.curl.radius == 0.1
    assert loaded.origins["preset"] == "c.yaml:1"
    assert loaded.origins["lift.sum"] == "c.yaml:3"
    assert loaded.origins["lift.tension"].startswith("preset literal:")
    assert loaded.origins["seed"] == loaded.origins["curl.radius"] == "--set"
    assert loaded.origins["dust.rate"] == "default"


def test_presets_in_a_list_the_last_winning(write: Callable[[str], str]) -> None:
    path = write("preset: [curling, crackle]\n")
    assert load_config(path).config.curl.radius == load_config("crackle").config.curl.radius
    assert load_config(path, ["preset=literal"]).config.curl.rule == "angle"


def test_a_preset_that_is_named_again_counts_where_it_comes_last(write: Callable[[str], str]) -> None:
    again = load_config(write("preset: [crackle, curling, crackle]\n")).config
    assert again.curl == load_config(write("preset: [curling, crackle]\n")).config.curl
    assert again.curl != load_config(write("preset: [crackle, curling]\n")).config.curl
    many = load_config(write(f"preset: [{'literal, ' * 3000}crackle]\n")).config
    assert many.lift == load_config(write("preset: [literal, crackle]\n")).config.lift


def test_a_file_comes_before_a_preset_of_the_same_name(write: Callable[[str], str]) -> None:
    write("")
    Path("crackle").write_text("seed: 99\n")
    assert load_config("crackle").config.seed == 99
    assert load_config("literal").origins["flaking.rule"].startswith("preset literal:")


def test_remesh_off_and_back_on(write: Callable[[str], str]) -> None:
    off = load_config(write("remesh: off\n"))
    assert off.config.remesh is False
    assert off.origins["remesh"] == "c.yaml:1"
    assert not any(key.startswith("remesh.") for key in off.origins)
    on = load_config("c.yaml", ["remesh=on", Override("remesh.faces", 500, "--faces")])
    assert on.config.remesh == Remesh(faces=500)
    assert on.origins["remesh.faces"] == "--faces"
    assert on.origins["remesh.crease_angle"] == "default"
    assert load_config("standard", ["remesh=off"]).config.remesh is False


@pytest.mark.parametrize("off", ["off", "false", "no"])
def test_a_part_of_what_is_off_does_not_switch_it_on(write: Callable[[str], str], off: str) -> None:
    path = write(f"remesh: {off}\n")
    with pytest.raises(ConfigError) as raised:
        load_config(path, [Override("remesh.faces", 500, "--faces")])
    assert raised.value.lines() == [
        "--faces: E-CONFIG: remesh.faces: remesh is off by c.yaml:1; add --set remesh=on, or leave this out"
    ]
    assert load_config(path, ["remesh={faces: 500}"]).config.remesh == Remesh(faces=500)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_config_from_a_pipe(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    keeper = os.open(pipe, os.O_RDWR)
    try:
        threading.Timer(0.1, lambda: (os.write(keeper, b"seed: 7\n"), os.close(keeper))).start()
        assert load_config(str(pipe)).config.seed == 7
    finally:
        with suppress(OSError):
            os.close(keeper)


def test_a_later_layer_may_choose_steps_over_count(write: Callable[[str], str]) -> None:
    path = write("snapshots:\n  count: 3\n")
    loaded = load_config(path, ["snapshots.steps=[1, 2]"])
    assert loaded.config.snapshots.steps == (1, 2) and loaded.config.snapshots.count is None
    assert loaded.origins["snapshots.count"] == "default"
    assert load_config(path, ["snapshots.steps=[1, 2]", "snapshots.count=4"]).config.snapshots.count == 4


def test_a_section_may_be_given_whole() -> None:
    loaded = load_config("standard", ["curl={rule: angle, angle_floor: 2}"])
    assert (loaded.config.curl.rule, loaded.config.curl.angle_floor) == ("angle", 2.0)


def test_all_problems_come_at_once_with_file_line_and_key(write: Callable[[str], str]) -> None:
    path = write(
        "seed: yes\n"
        "lift:\n"
        "  coeficient: 0.3\n"
        "  sum: plane\n"
        "fracture:\n"
        "  alpha: 0.3\n"
        "  direction_factor: 1.5\n"
        "stepps: 3\n"
        "ageing: 12\n"
        "appearance:\n"
        "  paint: #ff0000\n"
        "output:\n"
        "  formats: [ply, gltf]\n"
        "snapshots:\n"
        "  count: 3\n"
        "  steps: [1]\n"
    )
    assert problems(path, "remesh.faces=1", "curl.radios=1", "oops") == [
        "--set: 'oops' must be key.path=value",
        "--set: remesh.faces: must be at least 4, not 1",
        "--set: curl.radios: unknown key; did you mean curl.radius?",
        "c.yaml:1: seed: must be a number, not 'yes'",
        "c.yaml:3: lift.coeficient: unknown key; did you mean lift.coefficient?",
        "c.yaml:4: lift.sum: must be per_valence or plain, not 'plane'; did you mean plain?",
        "c.yaml:6: fracture.alpha: unknown key; did you mean fracture.direction_threshold?",
        "c.yaml:7: fracture.direction_factor: must be below 1, not 1.5",
        "c.yaml:8: stepps: unknown key; did you mean ageing.steps?",
        "c.yaml:9: ageing: must be a mapping, not 12",
        'c.yaml:11: appearance.paint: has no value; put a colour in quotes: "#rrggbb"',
        "c.yaml:13: output.formats[1]: must be ply or glb, not 'gltf'",
        "c.yaml:14: snapshots: give count or steps, not both",
    ]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("curvature: 3", "unknown key"),
        ("remesh: 12", "remesh: must be off or a mapping, not 12"),
        ("remesh: {faces: 1.5}", "remesh.faces: must be a whole number, not 1.5"),
        ("dust: {rate: .nan}", "dust.rate: must be a finite number"),
        ("dust: {rate: .inf}", "dust.rate: must be a finite number"),
        (
            "seed: " + "9" * 300,
            "seed: must be at most 9,223,372,036,854,775,807, not a number of over 30 digits",
        ),
        ("ageing: {duration: " + "9" * 399 + "}", "ageing.duration: "),
        ("paint: {only: [1]}", "paint.only[0]: must be text, put it in quotes, not 1"),
        ("paint: {only: [{a: 1}]}", "paint.only[0]: must be text"),
        ("output: {preview: maybe}", "output.preview: must be true or false, not 'maybe'"),
        ("seed:", "seed: has no value"),
        ("version: 2", "version: must be 1, not 2"),
        ("preset: foo", "preset: no shipped config 'foo'; there are aluminium_filiform, "),
        ("tension: {initial: 1.5}", "tension.initial: must be at most 1, the cap of the saturating law"),
        ("snapshots: {steps: [2000]}", "snapshots.steps: step 2000 is after the end, ageing.steps is 1000"),
        ("snapshots: {steps: [1, x]}", "snapshots.steps[1]: must be a number, not 'x'"),
        ("<<: {seed: 1}", "<<: unknown key"),
    ],
)
def test_one_problem_in_words(write: Callable[[str], str], text: str, expected: str) -> None:
    found = problems(write(text + "\n"))
    assert len(found) == 1
    assert expected in found[0]
    assert found[0].startswith("c.yaml:1: ")


def test_problems_are_printed_one_a_line(write: Callable[[str], str]) -> None:
    path = write("seed: -1\nlift: {sum: x}\n")
    with pytest.raises(ConfigError) as caught:
        load_config(path)
    assert caught.value.lines() == [
        "c.yaml:1: E-CONFIG: seed: must be at least 0, not -1",
        "c.yaml:2: E-CONFIG: lift.sum: must be per_valence or plain, not 'x'",
    ]


def test_files_that_are_none(write: Callable[[str], str], tmp_path: Path) -> None:
    write("")
    assert "no such file" in problems("nowhere.yaml")[0]
    assert "did you mean crackle?" in problems("crakle")[0]
    assert "not a regular file" in problems(str(tmp_path))[0]
    assert "cannot be read" in problems("a\0b")[0]
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe")
        assert "nobody writes to this pipe" in problems(str(tmp_path / "pipe"))[0]


@pytest.mark.parametrize("name", preset_names())
def test_every_shipped_config_loads(name: str) -> None:
    loaded = load_config(name)
    given = [key for key, origin in loaded.origins.items() if origin != "default"]
    assert all(loaded.origins[key].startswith(f"preset {name}:") for key in given)
    assert given


KEYS = st.sampled_from(
    ["remesh", "snapshots", "snapshots.count", "snapshots.steps", "paint.except", "seed", "curl"]
)
VALUES = st.sampled_from(
    ["3", "off", "[1, 2]", "{count: 2}", "{faces: 9}", "null", "", "x", "1e400", "{rule: angle}", "[{a: 1}]"]
)


@given(st.lists(st.tuples(KEYS, VALUES), max_size=5), st.sampled_from(["standard", "literal"]))
def test_any_mix_of_overrides_loads_or_names_its_problems(mix: list[tuple[str, str]], base: str) -> None:
    try:
        loaded = load_config(base, [f"{key}={value}" for key, value in mix])
    except ConfigError as error:
        assert all(problem.what for problem in error.problems)
    else:
        assert Config.model_validate(loaded.config.as_dict()) == loaded.config


def test_a_loader_reads_each_file_once(write: Callable[[str], str]) -> None:
    """And gives what `load_config` gives, also of a preset and of a file that is not valid."""
    path = write("preset: literal\nseed: 5\n")
    loader = ConfigLoader()
    cases: list[list[str]] = [[], ["seed=6", "preset=rusting"], ["quality=draft"], ["remesh=off"], []]
    wanted = [load_config(path, overrides) for overrides in cases]
    assert loader.load(path) == wanted[0]
    write("seed: 99\n")
    assert [loader.load(path, overrides) for overrides in cases] == wanted
    write("a: [")
    for _ in range(2):
        with pytest.raises(ConfigError):
            loader.load("./c.yaml")


def test_an_override_from_a_line_of_a_file(write: Callable[[str], str]) -> None:
    override = Override("curl.radius", 0.1, "jobs.csv", 7)
    assert load_config(write(""), [override]).origins["curl.radius"] == "jobs.csv:7"
    with pytest.raises(ConfigError) as caught:
        load_config("c.yaml", [override._replace(value=-1)])
    assert caught.value.problems[0].place() == "jobs.csv:7"
