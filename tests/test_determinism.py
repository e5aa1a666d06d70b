"""The contract of docs/determinism.md: the same input, config and seed give the same bytes, whatever is round
the run.

Each run is compared whole: every file but `timing.json`.
"""

from __future__ import annotations

import ast
import hashlib
import json
import locale
import multiprocessing
import os
import re
import subprocess
import sys
import zlib
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

import weathercoat
from weathercoat.config.load import load_config
from weathercoat.config.presets import preset_names
from weathercoat.config.schema import Deformation
from weathercoat.deform import deformation
from weathercoat.mesh.shapes import make_random_sheet, make_sign
from weathercoat.output.meshes import write_mesh
from weathercoat.output.rays import make_rays
from weathercoat.output.tree import TreeRays
from weathercoat.run import run_asset

Expected = Callable[..., dict[str, str]]

PACKAGE = Path(weathercoat.__file__).parent
PAGE = PACKAGE.parent / "docs" / "determinism.md"
SOLVERS = get_args(Deformation.model_fields["solver"].annotation)
MODEL = "schild_é.obj"  # a name that the encoding of a locale may not have
SMALL = {
    "remesh.faces": 300,
    "ageing.steps": 20,
    "snapshots.count": 2,
    "output.picture_width": 32,
    "output.picture_height": 24,
}

# What may surround a run, as the environment of its process. Freed and fresh memory is filled with a byte in
# place of whatever the process has left there, so that what reads memory before it is written shows.
SURROUNDINGS: dict[str, dict[str, str]] = {
    "plain C locale": {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"},
    "Turkish": {"LC_ALL": "tr_TR.UTF-8", "LANG": "tr_TR.UTF-8"},
    "German": {"LC_ALL": "de_DE.UTF-8", "LANG": "de_DE.UTF-8"},
    "time zone": {"TZ": "Pacific/Kiritimati"},
    "order of sets": {"PYTHONHASHSEED": "77"},
    "threads of libraries": {
        "NUMBA_NUM_THREADS": "2",
        "OPENBLAS_NUM_THREADS": "4",
        "OMP_NUM_THREADS": "3",
    },
    "memory of ones": {"MALLOC_PERTURB_": "255"},
    "memory of 0x5a": {"MALLOC_PERTURB_": "165"},
    "umask": {"UMASK": "077"},
}
ALL_AT_ONCE = {key: value for name in SURROUNDINGS for key, value in SURROUNDINGS[name].items()}


def digests(folder: Path) -> dict[str, str]:
    """SHA-256 of every file of a run that is promised to be the same every time."""
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != "timing.json"
    }


def assignments(**more: object) -> list[str]:
    """`SMALL` and more as `--set` takes them; `solver` is the deformation's."""
    values = {**SMALL, **({"deformation.solver": more["solver"]} if "solver" in more else {})}
    return [f"{key}={value}" for key, value in values.items()]


def run_here(model: Path, out: Path, config: str = "standard", **more: object) -> dict[str, str]:
    """The digests of a run in this process."""
    run_asset(load_config(config, assignments(**more)), model, out)
    return digests(out)


def run_elsewhere(
    model: Path | str, out: Path, config: str = "standard", *, cwd: Path | None = None, **environment: str
) -> dict[str, str]:
    """The digests of a run of the command line in a process of its own."""
    given = {**os.environ, "PYTHONPATH": str(PACKAGE.parent), **environment}
    umask = int(given.pop("UMASK", "022"), 8)
    solver = given.pop("SOLVER", "sweeps")
    options = [part for text in assignments(solver=solver) for part in ("--set", text)]
    done = subprocess.run(
        [sys.executable, "-m", "weathercoat", "run", config, str(model), "-o", str(out), "-q", *options],
        cwd=cwd,
        env=given,
        umask=umask,
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    return digests(out)


@pytest.fixture(scope="module")
def sign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sign of two material groups, one with a name outside ASCII."""
    path = tmp_path_factory.mktemp("models") / MODEL
    write_mesh(path, make_sign(edge_length=0.05))
    lines = path.read_text(encoding="utf-8").splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith("f "))
    lines[first:first] = ["usemtl Müll"]
    lines[-20:-20] = ["usemtl Glas"]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def expected(sign: Path, tmp_path_factory: pytest.TempPathFactory) -> Expected:
    """The digests that a run by a config and a solver must have, made once in this process."""

    @cache
    def digests_of(config: str = "standard", solver: str = "sweeps") -> dict[str, str]:
        return run_here(sign, tmp_path_factory.mktemp("runs") / "out", config, solver=solver)

    return digests_of


# --- what surrounds a run ---


def test_nothing_round_a_run_matters(sign: Path, expected: Expected, tmp_path: Path) -> None:
    """All at once: elsewhere, by a relative path, in another environment, with other memory."""
    there = tmp_path / "there"
    there.mkdir()
    model = os.path.relpath(sign, there)
    assert run_elsewhere(model, tmp_path / "out", cwd=there, **ALL_AT_ONCE) == expected()


@pytest.mark.long
@pytest.mark.parametrize("name", SURROUNDINGS)
def test_each_of_it_by_itself(name: str, sign: Path, expected: Expected, tmp_path: Path) -> None:
    wanted, before = SURROUNDINGS[name].get("LC_ALL", "C"), locale.setlocale(locale.LC_ALL)
    try:
        locale.setlocale(locale.LC_ALL, wanted)
    except locale.Error:
        pytest.skip(f"this machine has no locale {wanted}")
    finally:
        locale.setlocale(locale.LC_ALL, before)
    assert run_elsewhere(sign, tmp_path / "out", **SURROUNDINGS[name]) == expected()


@pytest.mark.long
@pytest.mark.parametrize("config", preset_names())
def test_every_shipped_config(config: str, sign: Path, expected: Expected, tmp_path: Path) -> None:
    assert run_elsewhere(sign, tmp_path / "out", config, **ALL_AT_ONCE) == expected(config)


@pytest.mark.long
@pytest.mark.parametrize("solver", SOLVERS)
def test_every_solver(solver: str, sign: Path, expected: Expected, tmp_path: Path) -> None:
    found = run_elsewhere(sign, tmp_path / "out", SOLVER=solver, **ALL_AT_ONCE)
    assert found == expected("standard", solver)


def test_solvers_and_configs_give_different_bytes(expected: Expected) -> None:
    """Or the comparisons above would say nothing."""
    snapshots = {expected(config)["snapshots/step_0020.ply"] for config in preset_names()}
    snapshots |= {expected("standard", solver)["snapshots/step_0020.ply"] for solver in SOLVERS}
    # the config standard sweeps, and the environment c3 is what it stands in
    assert len(snapshots) == len(preset_names()) + len(SOLVERS) - 2


# --- processes and threads ---


def test_what_ran_before_in_the_process_does_not_matter(
    sign: Path, expected: Expected, tmp_path: Path
) -> None:
    run_here(sign, tmp_path / "another", "crackle", solver="momentum")
    assert run_here(sign, tmp_path / "again") == expected()


@pytest.mark.parametrize("solver", SOLVERS)
def test_threads(solver: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a sheet of three tiles, with the threshold below which one thread works alone taken away."""
    monkeypatch.setattr(deformation, "_WORTH_SHARING", 0)
    write_mesh(tmp_path / "sheet.ply", make_random_sheet(6000, 1.0, 0.8, 3))
    quick = ["remesh=off", "ageing.steps=12", "snapshots.count=1", "output.preview=false"]
    quick += ["adhesion.base=0.4", "deformation.iterations=3", f"deformation.solver={solver}"]
    found = []
    for threads in (1, 2, 4):
        out = tmp_path / f"out_{threads}"
        report = run_asset(load_config("standard", quick), tmp_path / "sheet.ply", out, threads=threads)
        found.append(digests(out))
    assert report["snapshots"][-1]["separated_share"] + report["snapshots"][-1]["lost_share"] > 0.1
    assert found[0] == found[1] == found[2]


@pytest.mark.long
def test_two_processes_at_once(sign: Path, expected: Expected, tmp_path: Path) -> None:
    options = [part for text in assignments() for part in ("--set", text)]
    command = [sys.executable, "-m", "weathercoat", "run", "standard", str(sign), "-q", *options, "-o"]
    environment = {**os.environ, "PYTHONPATH": str(PACKAGE.parent)}
    outs = [tmp_path / "one", tmp_path / "other"]
    for process in [subprocess.Popen([*command, str(out)], env=environment) for out in outs]:
        assert process.wait() == 0
    assert [digests(out) for out in outs] == [expected()] * 2


@pytest.mark.long
@pytest.mark.parametrize("method", multiprocessing.get_all_start_methods())
def test_a_pool_of_processes(method: str, sign: Path, expected: Expected, tmp_path: Path) -> None:
    """More jobs than processes, so that some follow others in one process."""
    configs = ["standard", "crackle", "standard", "literal"]
    outs = [tmp_path / f"out_{number}" for number in range(4)]
    with ProcessPoolExecutor(2, multiprocessing.get_context(method)) as pool:
        found = list(pool.map(run_here, [sign] * 4, outs, configs))
    assert found == [expected(config) for config in configs]


# --- where the model comes from ---


@pytest.mark.long
def test_a_model_from_standard_input(sign: Path, expected: Expected, tmp_path: Path) -> None:
    """Report and checkpoint name their input, and standard input has no name; all else is the same."""
    options = [part for text in assignments() for part in ("--set", text)]
    command = [sys.executable, "-m", "weathercoat", "run", "standard", "-", "--format", "obj", "-q", *options]
    with sign.open("rb") as stream:
        environment = {**os.environ, "PYTHONPATH": str(PACKAGE.parent)}
        subprocess.run([*command, "-o", str(tmp_path / "piped")], stdin=stream, env=environment, check=True)
    piped, direct = (
        {name: digest for name, digest in files.items() if not name.endswith((".json", ".npz"))}
        for files in (digests(tmp_path / "piped"), expected())
    )
    assert piped == direct and len(piped) > 4
    run_here(sign, tmp_path / "direct")
    reports = [json.loads((tmp_path / name / "run.json").read_text("utf-8")) for name in ("piped", "direct")]
    assert [report.pop("model") for report in reports] == ["-", MODEL]
    assert reports[0].pop("inputs") == {"-": reports[1].pop("inputs")[MODEL]}
    assert all(report.pop("files") for report in reports)
    assert reports[0] == reports[1]


# --- pictures ---


def test_pictures_without_embree_repeat_too(
    sign: Path, expected: Expected, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The fallback may round single pixels otherwise, but every time alike, and no mesh hangs on it."""
    with_embree = expected()
    monkeypatch.setitem(sys.modules, "embreex.mesh_construction", None)
    assert isinstance(make_rays(np.eye(3), np.array([[0, 1, 2]], np.int32)), TreeRays)
    one, other = (run_here(sign, tmp_path / name) for name in ("one", "other"))
    assert one == other
    assert without_pictures(one) == without_pictures(with_embree)


def without_pictures(files: dict[str, str]) -> dict[str, str]:
    """Neither the pictures nor the report, which may list them."""
    return {name: digest for name, digest in files.items() if name.startswith("snapshots/")}


# --- random streams ---


def sources() -> list[Path]:
    """The modules of the package, but for the benchmarks, which lay out films of their own."""
    return [path for path in sorted(PACKAGE.rglob("*.py")) if "bench" not in path.parts]


def calls_of(names: set[str]) -> Iterator[tuple[Path, ast.Call]]:
    """Every call of a function or method of one of these names in what a run is made of."""
    for path in sources():
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and ast.unparse(node.func).rpartition(".")[2] in names:
                yield path, node


def test_random_streams_are_documented_and_have_names_of_their_own() -> None:
    """One use each, and keys that differ under every seed: odd multiples of different checksums."""
    names = []
    for path, call in calls_of({"stream_key", "_stream"}):
        assert isinstance(call.args[1], ast.Constant), f"{path}: the name of a stream is no constant"
        names.append(call.args[1].value)
    assert len({zlib.crc32(name.encode()) for name in names}) == len(names)
    rows = re.findall(r"^\| `(\w+)` \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert sorted(rows) == sorted(names)


def test_there_are_no_other_random_numbers() -> None:
    """Neither Python's nor NumPy's shared generators, nor a generator that is seeded by chance."""
    for path in sources():
        source = path.read_text(encoding="utf-8")
        assert not re.search(r"^\s*(import|from) random\b", source, re.MULTILINE), path
        used = set(re.findall(r"\bnp\.random\.(\w+)", source))
        assert used <= {"Generator", "PCG64", "default_rng"}, path
    for path, call in calls_of({"default_rng", "PCG64"}):
        assert call.args, f"{path}: a generator without a seed"
