"""The documentation: its commands run, its links lead somewhere, and its generated pages are up to date."""

from __future__ import annotations

import importlib
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import click
import pytest

from weathercoat import errors
from weathercoat.cli.handler import call
from weathercoat.cli.root import weathercoat
from weathercoat.cli.signals import Stopped
from weathercoat.config.presets import preset_names
from weathercoat.config.schema import parameters
from weathercoat.notes import MEANINGS

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted(DOCS.glob("*.md"))]
WITH_COMMANDS = [page for page in PAGES if "```console" in page.read_text(encoding="utf-8")]
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\(([^)\s]+)\)")
CODE_SPAN = re.compile(r"`[^`\n]+`")
# What a run is given on top, so that it takes a moment; its snapshots keep their numbers, thinned out.
QUICK = ("--faces", "300", "--set", "output.picture_width=24", "--set", "output.picture_height=16")
QUICK_SCENE = ("--set", "remesh.faces=300", "--set", "ageing.steps=50", "--no-preview")
QUICK_BASELINE = ("--faces", "300", "--steps", "50")
SHELL_ONLY = ("make", "pip", "pipx", "mkdir")
LARGEST_IMAGES = 12_000_000


def blocks(page: Path, language: str) -> list[str]:
    """The code blocks of a page in one language."""
    return [body for name, body in BLOCK.findall(page.read_text(encoding="utf-8")) if name == language]


def commands(page: Path) -> list[str]:
    """The commands of a page, in order."""
    lines = [line for block in blocks(page, "console") for line in block.splitlines()]
    assert all(line.startswith("$ ") for line in lines), f"{page.name}: a console line is no command"
    return [line.removeprefix("$ ") for line in lines]


def calls(command: str) -> Iterator[list[str]]:
    """The calls of weathercoat in a command line of the shell, as arguments."""
    words: list[str] = []
    lexer = shlex.shlex(command, posix=True, punctuation_chars=True)
    lexer.whitespace_split = True
    for word in [*lexer, ";"]:
        if set(word) <= set("|;&<>()"):
            if "weathercoat" in words and words[0] not in SHELL_ONLY:
                yield words[words.index("weathercoat") + 1 :]
            words = []
        else:
            words.append(word)


def is_plain(command: str) -> bool:
    """Whether a command is a single call of weathercoat that needs neither a shell nor a process of its
    own, whose libraries are not yet loaded.
    """
    return command.startswith("weathercoat ") and not re.search(r"[|;<>$~]| --portable", command)


def quick(arguments: list[str]) -> list[str]:
    """The same call on a coarse mesh, with small pictures."""
    extra = {"run": QUICK, "scene": QUICK_SCENE}
    if arguments[:2] == ["baseline", "record"]:
        return [*arguments, *QUICK_BASELINE]
    return [*arguments, *extra.get(arguments[0], ())]


@pytest.fixture(scope="module")
def making() -> Iterator[ModuleType]:
    """The module that makes the generated pages."""
    sys.path.insert(0, str(DOCS))
    try:
        yield importlib.import_module("making.pages")
    finally:
        sys.path.remove(str(DOCS))


@pytest.mark.parametrize("page", WITH_COMMANDS, ids=lambda page: page.name)
def test_commands_are_understood(page: Path) -> None:
    found = [arguments for command in commands(page) for arguments in calls(command)]
    assert found
    for arguments in found:
        parse(arguments)


def parse(arguments: list[str]) -> None:
    """Parse a call without running it: unknown commands, options and missing arguments raise UsageError."""
    command: click.Command = weathercoat
    rest = list(arguments)
    while isinstance(command, click.Group):
        inner = command.get_command(click.Context(command), rest[0])
        if inner is None:
            raise click.UsageError(f"no command {rest[0]}")
        command, rest = inner, rest[1:]
    command.make_context(command.name, rest)


def test_wrong_commands_are_noticed() -> None:
    for wrong in (["rum", "a", "b"], ["run", "standard"], ["run", "standard", "a.obj", "--face", "3"]):
        with pytest.raises(click.UsageError):
            parse(wrong)
    assert list(calls("cat a | weathercoat inspect - && make demo > b")) == [["inspect", "-"]]


@pytest.mark.long
@pytest.mark.parametrize("page", WITH_COMMANDS, ids=lambda page: page.name)
def test_commands_run(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("PATH", f"{make_wrapper(tmp_path)}:/usr/bin:/bin")
    for command in commands(page):
        if is_plain(command):
            assert call(quick(shlex.split(command)[1:])) == 0, command
        elif command.split()[0] not in SHELL_ONLY[:3]:
            done = subprocess.run(["bash", "-euo", "pipefail", "-c", command], capture_output=True, text=True)
            assert done.returncode == 0, f"{command}: {done.stderr}"


def make_wrapper(folder: Path) -> Path:
    """A folder with a `weathercoat` for the shell, whose runs are quick, and a `dask`."""
    binaries = folder / "bin"
    binaries.mkdir()
    script = binaries / "weathercoat"
    extra = shlex.join(QUICK)
    script.write_text(
        f"""#!/bin/bash
export PYTHONPATH={shlex.quote(str(ROOT))}
[ "$1" = run ] && set -- "$@" {extra}
exec {shlex.quote(sys.executable)} -m weathercoat "$@"
""",
        encoding="utf-8",
    )
    dask = binaries / "dask"
    dask.write_text(
        f"""#!/bin/bash
export PYTHONPATH={shlex.quote(str(ROOT))}
exec {shlex.quote(sys.executable)} -m dask "$@"
""",
        encoding="utf-8",
    )
    for program in (script, dask):
        program.chmod(0o755)
    return binaries


def test_readme_commands_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for command in filter(is_plain, commands(ROOT / "README.md")):
        assert call(quick(shlex.split(command)[1:])) == 0, command


def test_python_of_the_docs_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    settings = "faces=300", "until=0.02"
    assert call(["sample", "sign", "-o", "sign.obj"]) == 0
    assert call(quick(["run", "standard", "sign.obj"])) == 0
    for page in PAGES:
        for body in blocks(page, "python"):
            for setting in settings:
                body = re.sub(rf"{setting.partition('=')[0]}=[\d._]+", setting, body)
            exec(compile(body, page.name, "exec"), {})
    assert (tmp_path / "aged.glb").stat().st_size > 1000
    assert (tmp_path / "aged.png").stat().st_size > 1000


def test_make_targets_exist() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    everything = [command.split() for page in WITH_COMMANDS for command in commands(page)]
    named = [words[1] for words in everything if words[0] == "make"]
    assert named
    for target in named:
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_and_images_exist(page: Path) -> None:
    text = CODE_SPAN.sub("", BLOCK.sub("", page.read_text(encoding="utf-8")))
    for link in LINK.findall(text):
        if link.startswith(("http://", "https://")):
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), f"{page.name}: {link}"
        if anchor:
            assert anchor in anchors(target), f"{page.name}: {link}"


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub makes them."""
    text = BLOCK.sub("", page.read_text(encoding="utf-8"))
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_every_image_is_shown() -> None:
    shown = {
        (page.parent / link).resolve()
        for page in PAGES
        for link in LINK.findall(page.read_text(encoding="utf-8"))
        if "images/" in link
    }
    images = {path for path in (DOCS / "images").rglob("*") if path.is_file()}
    assert images == shown
    assert sum(path.stat().st_size for path in images) < LARGEST_IMAGES


def test_every_shipped_config_is_mentioned() -> None:
    for page in (ROOT / "README.md", DOCS / "gallery.md"):
        text = page.read_text(encoding="utf-8")
        for name in preset_names():
            assert f"configs/{name}.yaml" in text, f"{page.name}: {name}"


def test_generated_pages_are_up_to_date(making: ModuleType) -> None:
    for name, make in making.PAGES.items():
        assert (DOCS / name).read_text(encoding="utf-8") == make(), f"{name}: run `make docs`"


def test_every_parameter_has_a_picture_or_a_reason(making: ModuleType) -> None:
    shown, without = set(making.effects.EFFECTS), set(making.effects.WITHOUT_PICTURE)
    assert not shown & without
    assert shown | without == {parameter.key for parameter in parameters()}


def test_every_code_is_explained(making: ModuleType) -> None:
    files = set((ROOT / "weathercoat").rglob("*.py"))
    table, classes = ROOT / "weathercoat" / "notes.py", ROOT / "weathercoat" / "errors.py"
    page = (DOCS / "errors.md").read_text(encoding="utf-8")
    for letter, origin, inside in (("W", table, files - {table}), ("E", classes, {classes})):
        code = rf"\b{letter}-[A-Z]+(?:-[A-Z]+)*\b"
        used = {found for path in inside for found in re.findall(f'"({code})"', path.read_text("utf-8"))}
        explained = set(re.findall(rf"^\| `({code})` \|", page, re.MULTILINE))
        assert used == explained, origin
    assert set(MEANINGS) == set(re.findall(r"^\| `(W-[A-Z-]+)` \|", page, re.MULTILINE))
    exits = {int(number) for number in re.findall(r"^\| (\d+) \|", page, re.MULTILINE)}
    assert exits >= {error.exit_code for error in making.coded_errors()}
    assert exits >= {kind.exit_code for kind in Stopped.__subclasses__()}
    for error in making.coded_errors():
        assert f"| `{error.code}` | {error.exit_code} |" in page
    assert len(making.coded_errors()) >= len(errors.WeathercoatError.__subclasses__()) - 2


@pytest.mark.long
def test_pictures_can_be_made_again(tmp_path: Path) -> None:
    docs = tmp_path / "docs"
    shutil.copytree(DOCS, docs, ignore=shutil.ignore_patterns("images", "__pycache__"))
    subprocess.run(
        [sys.executable, str(docs / "make.py"), "effects", "--key", "curl.radius"],
        check=True,
        env={"PYTHONPATH": str(ROOT), "HOME": str(Path.home()), "PATH": "/usr/bin:/bin"},
    )
    assert (docs / "images" / "parameters" / "curl_radius.webp").stat().st_size > 1000
