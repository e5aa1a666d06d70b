"""Each subcommand does what its help says; the work behind `run` and `render` is tested with its rooms."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import pytest

from weathercoat import __version__
from weathercoat.cli import root
from weathercoat.cli.handler import call
from weathercoat.cli.messages import Messages
from weathercoat.config.load import load_config
from weathercoat.config.presets import preset_names
from weathercoat.errors import FormatError, OutputError
from weathercoat.mesh.shapes import SHAPES

REPORT: dict[str, Any] = {
    "snapshots": [
        {
            "step": 10,
            "age": 1.0,
            "separated_share": 0.25,
            "lost_share": 0.125,
            "flakes": {"count": 3},
            "substrate_rust": 0.5,
        }
    ]
}


@pytest.fixture(autouse=True)
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What `run` hands to the work, which is left out."""
    found: dict[str, Any] = {}

    def run_asset(loaded: Any, model: Any, out: Path, **more: Any) -> dict[str, Any]:
        found.update(loaded=loaded, model=model, out=out, **more)
        more["log"]("W-DEGENERATE(1): dropped")
        more["progress"](1, 2)
        return REPORT

    monkeypatch.setattr("weathercoat.run.run_asset", run_asset)
    return found


def test_version_and_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["--version"]) == 0
    assert capsys.readouterr().out == f"weathercoat {__version__}\n"
    assert call(["--help"]) == 0
    out = capsys.readouterr().out
    commands = out.partition("Commands:")[2]
    for name in ("run", "plan", "config", "sample", "inspect", "remesh", "render", "verify", "bench"):
        assert f"  {name} " in commands


def commands_below(command: click.Command, name: str) -> Iterator[tuple[str, click.Command]]:
    """A command and all below it, by name."""
    yield name, command
    if isinstance(command, click.Group):
        context = click.Context(command)
        for child in command.list_commands(context):
            found = command.get_command(context, child)
            assert found is not None
            yield from commands_below(found, f"{name} {child}")


def test_every_option_has_help() -> None:
    for name, command in commands_below(root.weathercoat, "weathercoat"):
        assert command.help, name
        for parameter in command.params:
            if isinstance(parameter, click.Option):
                assert parameter.help, f"{name} {parameter.name}"


def test_every_command_tells_its_errors_as_json_and_with_a_traceback() -> None:
    for name, command in commands_below(root.weathercoat, "weathercoat"):
        if not isinstance(command, click.Group):
            flags = {flag for parameter in command.params for flag in parameter.opts}
            assert {"--json", "--debug"} <= flags, name


@pytest.mark.parametrize(
    "arguments",
    [
        ["config", "list"],
        ["config", "new"],
        ["config", "new", "made.yaml"],
        ["config", "schema"],
        ["completion", "bash"],
        ["sample", "sign"],
        ["sample", "sign", "-o", "made.ply"],
    ],
)
def test_results_as_json_are_one_object(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert call([*arguments, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)
    assert call([*arguments, "--json", "--frob"]) == 2
    assert json.loads(capsys.readouterr().err)["error"]["code"] == "E-USAGE"


@pytest.mark.parametrize("command", ["run", "plan"])
def test_config_and_model_the_other_way_round(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    for config in ("standard", "my.yaml"):
        assert call([command, "sign.obj", config]) == 2
        told = f"{config} is a config, and CONFIG comes before MODEL; say {config} sign.obj"
        assert capsys.readouterr().err == f"weathercoat: E-USAGE: {told}\n"


def test_run_hands_over_what_was_asked(asked: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["crackle", "part.obj", "-o", "out", "--set", "curl.radius=0.2", "--set", "seed=4"]
    arguments += [
        "--seed",
        "5",
        "--steps",
        "20",
        "--faces",
        "300",
        "--format",
        "obj",
        "--overwrite",
        "--strict",
    ]
    assert call(["run", *arguments]) == 0
    config = asked["loaded"].config
    assert (config.seed, config.ageing.steps, config.remesh.faces, config.curl.radius) == (5, 20, 300, 0.2)
    assert asked["loaded"].origins["ageing.steps"] == "--steps"
    assert (asked["model"], asked["out"], asked["format"]) == ("part.obj", Path("out"), "obj")
    assert asked["overwrite"] is True and asked["strict"] is True
    captured = capsys.readouterr()
    assert captured.err == "weathercoat: W-DEGENERATE(1): dropped\n"
    assert captured.out.splitlines()[-2].split() == ["10", "1.00", "25.0%", "12.5%", "3", "0.50"]
    assert captured.out.splitlines()[-1] == "written to out"


def test_run_names_its_folder_after_model_and_config(asked: dict[str, Any]) -> None:
    Path("my rules.yaml").write_text("seed: 2\n")
    assert call(["run", "my rules.yaml", "models/gate 1.obj"]) == 0
    assert asked["out"] == Path("gate 1-my rules")
    assert asked["overwrite"] is False and asked["strict"] is False


def test_run_from_standard_input(asked: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    stdin = io.TextIOWrapper(io.BytesIO(b"v 0 0 0\n"))
    monkeypatch.setattr(sys, "stdin", stdin)
    assert call(["run", "standard", "-", "--format", "obj"]) == 0
    assert asked["model"] is stdin.buffer
    assert asked["out"] == Path("model-standard")


@pytest.mark.parametrize("flag", ["--quiet", "--json"])
def test_run_quietly(asked: dict[str, Any], flag: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["run", "standard", "part.obj", flag]) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    if flag == "--json":
        assert json.loads(captured.out) == REPORT


def test_run_refuses_a_bad_option_before_any_work(
    asked: dict[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(["run", "standard", "part.obj", "--faces", "3"]) == 2
    expected = "weathercoat: --faces: E-CONFIG: remesh.faces: must be at least 4, not 3\n"
    assert capsys.readouterr().err == expected
    assert asked == {}


def test_log_file_has_messages_and_the_final_error(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(FormatError), Messages(quiet=True, log_file=Path("log")) as messages:
        messages.log("half-way")
        raise FormatError("looks like HTML", file="a.obj")
    lines = Path("log").read_text().splitlines()
    assert [line.split(" ", 2)[2].partition(";")[0] for line in lines] == [
        "half-way",
        "a.obj: E-FORMAT: looks like HTML",
    ]
    assert capsys.readouterr().err == ""
    with pytest.raises(OutputError), Messages(quiet=True, log_file=Path("no/such/folder/log")):
        pass


def test_progress_bar_on_a_terminal_only(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with Messages(quiet=False) as messages:
        messages.progress(1, 2)
    assert capsys.readouterr().err == ""
    terminal = io.StringIO()
    monkeypatch.setattr(terminal, "isatty", lambda: True)
    monkeypatch.setattr(sys, "stderr", terminal)
    with Messages(quiet=False) as messages:
        messages.progress(1, 2)
    assert "/2 [" in terminal.getvalue()
    with Messages(quiet=True) as messages:
        terminal.truncate(0)
        messages.progress(1, 2)
    assert terminal.getvalue() == ""


def test_config_new_loads_and_is_not_overwritten(capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["config", "new", "a.yaml", "--from", "literal"]) == 0
    assert load_config("a.yaml").config == load_config("literal").config
    assert call(["config", "new", "a.yaml"]) == 7
    assert "E-EXISTS" in capsys.readouterr().err
    assert call(["config", "new", "a.yaml", "--overwrite"]) == 0
    assert call(["config", "new"]) == 0
    assert capsys.readouterr().out == Path("a.yaml").read_text(encoding="utf-8")


def test_config_show_schema_check_list(capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["config", "show", "crackle", "--set", "seed=9"]) == 0
    assert any(
        line.startswith("seed: 9") and line.endswith("# --set")
        for line in capsys.readouterr().out.splitlines()
    )
    assert call(["config", "show", "crackle", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["config"] == load_config("crackle").config.as_dict()
    assert shown["origins"]["dust.rate"].startswith("preset crackle:")
    assert call(["config", "schema"]) == 0
    assert json.loads(capsys.readouterr().out)["title"] == "weathercoat config"
    assert call(["config", "schema", "--markdown"]) == 0
    assert capsys.readouterr().out.startswith("# Configuration\n")
    assert call(["config", "check", *preset_names()]) == 0
    assert capsys.readouterr().out == "".join(f"{name}: valid\n" for name in preset_names())
    assert call(["config", "list"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == preset_names()


def test_config_check_reports_every_file(capsys: pytest.CaptureFixture[str]) -> None:
    Path("a.yaml").write_text("sed: 1\n")
    Path("b.yaml").write_text("lift: {sum: y}\n")
    assert call(["config", "check", "a.yaml", "crackle", "b.yaml"]) == 2
    captured = capsys.readouterr()
    assert captured.out == "crackle: valid\n"
    assert [line.split(":")[1].strip() for line in captured.err.splitlines()] == ["a.yaml", "b.yaml"]


@pytest.mark.parametrize("name", SHAPES)
def test_sample_writes_what_inspect_reads(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["sample", name, "--size", "10"]) == 0
    assert capsys.readouterr().out == f"written to {name}.obj\n"
    assert call(["inspect", f"{name}.obj", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["faces"] == len(SHAPES[name]().faces)
    low, high = found["bounding_box"]
    assert max(b - a for a, b in zip(low, high, strict=True)) == pytest.approx(10)
    is_open = name in ("plate", "curved-plate", "sheet")
    assert [note["code"] for note in found["notes"]] == (["W-BOUNDARY"] if is_open else [])
    assert found["manifold"] is True
    assert found["watertight"] is not is_open


def test_sample_options_are_the_arguments_of_the_shape(capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["sample", "plate", "--columns", "3", "--rows", "2", "-o", "p.ply"]) == 0
    assert call(["inspect", "p.ply", "--json"]) == 0
    assert json.loads(capsys.readouterr().out.partition("\n")[2])["faces"] == 12
    assert call(["sample", "gear", "--radius", "-1"]) == 2
    assert "radius must be above 0" in capsys.readouterr().err
    assert call(["sample", "plate", "-o", "p.ply"]) == 7
    assert call(["sample", "plate", "-o", "p.xyz"]) == 2
    assert sorted(path.name for path in Path().iterdir()) == ["p.ply"]


@pytest.mark.parametrize("suffix", ["obj", "ply", "stl", "off", "glb"])
def test_samples_stand_upright_in_every_format(suffix: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["sample", "plate", "--height", "3", "-o", f"p.{suffix}"]) == 0
    capsys.readouterr()
    assert call(["inspect", f"p.{suffix}", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    low, high = found["bounding_box"]
    extent = [b - a for a, b in zip(low, high, strict=True)]
    upwards = [abs(part) for part in found["up"]].index(1.0)
    assert extent[upwards] == pytest.approx(3)


def test_sample_writes_a_scene_and_its_rules(capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["sample", "--help"]) == 0
    assert "yard" in capsys.readouterr().out
    assert call(["sample", "yard", "-o", "y.yaml", "--json"]) == 0
    written = [json.loads(line)["written"] for line in capsys.readouterr().out.splitlines()]
    assert written == ["y.glb", "y.yaml"]
    assert 'scene: "y.glb"' in Path("y.yaml").read_text()
    assert call(["sample", "yard", "-o", "y.glb"]) == 7


def test_inspect_of_several_goes_on_after_one_that_fails(capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("plate", "bracket"):
        assert call(["sample", name]) == 0
    Path("broken.obj").write_text("no model")
    capsys.readouterr()
    models = ["plate.obj", "broken.obj", "bracket.obj"]
    assert call(["inspect", *models, "--json"]) == 8
    told = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [row["file"] for row in told] == models
    assert [row.get("name") for row in told] == ["plate", None, "bracket"]
    assert told[1]["error"]["code"] == "E-FORMAT"
    assert call(["inspect", *models]) == 8
    words, errors = capsys.readouterr()
    assert [line for line in words.splitlines() if line in models] == ["plate.obj", "bracket.obj"]
    assert "broken.obj: E-FORMAT" in errors and "1 of 3 models could not be inspected" in errors
    assert call(["inspect", "plate.obj", "bracket.obj"]) == 0


def test_inspect_in_words_names_repairs_and_cost(capsys: pytest.CaptureFixture[str]) -> None:
    Path("t.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\nf 1 2 2\n")
    assert call(["inspect", "t.obj", "--self-intersections"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any(line.startswith("faces ") and line.endswith(" 2") for line in lines)
    assert any(line.startswith("watertight ") and line.endswith(" no") for line in lines)
    assert any("W-DEGENERATE(1)" in line for line in lines)
    assert lines[-1].startswith("a run would take") and lines[-1].endswith(" MB")


def test_inspect_estimates_grow_with_what_is_asked(capsys: pytest.CaptureFixture[str]) -> None:
    def cost(*arguments: str) -> dict[str, float]:
        assert call(["inspect", "plate.obj", "--json", *arguments]) == 0
        found: dict[str, float] = json.loads(capsys.readouterr().out)["run_cost"]
        return found

    assert call(["sample", "plate"]) == 0
    capsys.readouterr()
    standard = cost()
    assert standard["seconds"] > 0 and standard["memory_mb"] > 0
    assert cost("--set", "remesh.faces=100000")["seconds"] > standard["seconds"]
    assert cost("--set", "remesh.faces=100000")["memory_mb"] > standard["memory_mb"]
    assert cost("--set", "ageing.steps=10000")["seconds"] > standard["seconds"]
    assert cost("--set", "remesh=off")["seconds"] < standard["seconds"]


def test_plan_tells_what_a_run_would_choose(capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["sample", "plate"]) == 0
    capsys.readouterr()
    assert call(["plan", "plate.obj"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["faces", "10,000"] and lines[-1].startswith("expected cost")
    steps = []
    for distance in ("0.5", "1000"):
        asked = ["--quality", "auto", "--set", f"scene.distance={distance}", "--json"]
        assert call(["plan", "crackle", "plate.obj", *asked]) == 0
        found = json.loads(capsys.readouterr().out)
        steps.append(found["quality"]["chosen"]["steps"])
        assert found["config"]["ageing"]["steps"] == steps[-1]
        assert found["cost"]["seconds"] == found["quality"]["expected"]["seconds"]
    assert steps[0] > steps[1]
    assert call(["plan", "plate.obj", "--quality", "draft", "--steps", "77"]) == 0
    assert "ageing.steps, as it is set by --steps" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        ([], "Missing argument"),
        (["standard", "a.obj", "b.obj"], "one config and one model"),
        (["--quality", "best", "a.obj"], "'best' is not one of"),
        (["--quality", "auto", "a.obj"], "auto needs scene.distance"),
    ],
)
def test_plan_refuses_what_it_cannot_plan(
    arguments: list[str], what: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(["plan", *arguments]) == 2
    assert what in capsys.readouterr().err


def test_models_that_cannot_be_read(capsys: pytest.CaptureFixture[str]) -> None:
    Path("page.obj").write_text("<!DOCTYPE html><html></html>")
    for command in (["inspect"], ["remesh", "-o", "x.obj"]):
        assert call([*command, "nowhere.obj"]) == 3
        assert capsys.readouterr().err.startswith("weathercoat: nowhere.obj: E-ACCESS: ")
        assert call([*command, "page.obj"]) == 3
        assert capsys.readouterr().err.startswith("weathercoat: page.obj: E-FORMAT: ")
    assert not Path("x.obj").exists()


def test_render_refuses_what_is_no_run(capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["render", "nowhere", "-o", "p.png"]) == 3
    assert "E-ACCESS" in capsys.readouterr().err
    Path("run").mkdir()
    Path("run/run.json").write_text("[")
    assert call(["render", "run", "-o", "p.png"]) == 3
    assert "E-CORRUPT" in capsys.readouterr().err
    assert not Path("p.png").exists()


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_scripts_call_back(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert "_WEATHERCOAT_COMPLETE" in script and f"{shell}_complete" in script


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("weathercoat ", set(root.SUBCOMMANDS)),
        ("weathercoat run cr", {"crackle"}),
        ("weathercoat run crackle a.obj --set curl.ra", {"curl.radius=", "curl.rate="}),
        ("weathercoat sample b", {"barrel", "box", "bracket"}),
        ("weathercoat config new --from lit", {"literal"}),
    ],
)
def test_completions(words: str, expected: set[str]) -> None:
    count = len(words.split(" ")) - 1
    asked = {"_WEATHERCOAT_COMPLETE": "bash_complete", "COMP_WORDS": words, "COMP_CWORD": str(count)}
    done = subprocess.run(
        [sys.executable, "-m", "weathercoat"],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PYTHONPATH": str(Path(root.__file__).parents[2]), **asked},
    )
    offered = [line.partition(",") for line in done.stdout.split()]
    assert {value for kind, _, value in offered if kind == "plain"} == expected


@pytest.mark.long
def test_a_small_run_from_file_to_folder(capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["sample", "sign"]) == 0
    arguments = ["sign.obj", "-o", "out", "--faces", "600", "--steps", "30", "--json"]
    arguments += ["--set", "output.picture_width=64", "--set", "output.picture_height=48"]
    capsys.readouterr()
    assert call(["run", "literal", *arguments]) == 0
    report = json.loads(capsys.readouterr().out)
    assert [row["step"] for row in report["snapshots"]] == [6, 12, 18, 24, 30]
    assert Path("out/preview.png").exists()
    assert call(["run", "literal", *arguments]) == 7
    assert call(["render", "out", "-o", "one.png", "--step", "30", "--width", "40", "--height", "30"]) == 0
    assert Path("one.png").read_bytes().startswith(b"\x89PNG")
    assert call(["render", "out/snapshots", "-o", "two.png", "--step", "31"]) == 2
    assert "there are 6, 12, 18, 24, 30" in capsys.readouterr().err
    small = ["--width", "40", "--height", "30"]
    for name, more in (
        ("turn.webp", ["--turntable", "3"]),
        ("ages.gif", ["--timelapse", "--seconds", "1"]),
        ("both.webp", ["--turntable", "4", "--timelapse", "--no-loop"]),
        ("clear.png", ["--step", "30", "--background", "transparent", "--no-ground", "--zoom", "2"]),
        (
            "lit.png",
            ["--step", "30", "--background", "#203040", "--light", "overcast", "--look-at", "0", "0", "0"],
        ),
    ):
        assert call(["render", "out", "-o", name, *small, *more]) == 0
        assert Path(name).stat().st_size > 100
    for more, message in (
        (["-o", "a.gif"], "no format for a still"),
        (["-o", "a.png", "--timelapse"], "no format for what moves"),
        (["-o", "a.png", "--background", "sky"], "is no colour"),
        (["-o", "a.png", "--seconds", "2"], "--seconds is for what moves"),
        (["-o", "a.webp", "--timelapse", "--step", "6"], "give one of them"),
        (["-o", "a.png", "--views", "2"], "--views is not for"),
        (["-o", "set", "--passes", "class"], "needs --cameras or --views"),
        (["-o", "set", "--passes", "class", "--views", "1", "--zoom", "2"], "--zoom is not for"),
        (["-o", "-", "--passes", "class", "--views", "1"], "writes a folder"),
        (["-o", "set", "--passes", "colour", "--views", "1"], "is none of beauty"),
    ):
        assert call(["render", "out", *more]) == 2
        assert message in capsys.readouterr().err
    labels = ["render", "out", "-o", "set", "--passes", "all", "--views", "2", "--step", "all", *small]
    assert call(labels) == 0
    content = json.loads(Path("set/labels.json").read_text())
    assert len(content["images"]) == 10 and content["run"]["fingerprint"] == report["fingerprint"]
    assert call(labels) == 7
    again = ["--passes", "class", "--cameras", "set/labels.json", *small]
    assert call(["render", "out", "-o", "again", *again]) == 0
    assert len(list(Path("again/class").iterdir())) == 2


@pytest.mark.long
def test_remesh_writes_about_the_wanted_faces(capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["sample", "plate"]) == 0
    capsys.readouterr()
    assert call(["remesh", "plate.obj", "-o", "fine.ply", "--faces", "1000", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["faces"] == pytest.approx(1000, rel=0.02)
    assert call(["remesh", "plate.obj", "-o", "fine.ply"]) == 7
