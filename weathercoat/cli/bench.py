"""`weathercoat bench`: measure this machine and this version."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from weathercoat.cli import options
from weathercoat.cli.messages import Messages
from weathercoat.errors import UsageError

if TYPE_CHECKING:
    from weathercoat.bench.files import Draw
    from weathercoat.output.folder import RunFolder


@click.group()
def command() -> None:
    """Measure how fast and how accurate it is, and what the mesh changes."""


@command.command("speed")
@click.argument("meshes", metavar="[MESH]...", nargs=-1, type=click.Path(path_type=Path))
@click.option(
    "--faces",
    metavar="N,N,...",
    help="Sizes of the generated plates, or none. Default: 3000,10000,100000,300000,1000000.",
)
@click.option("--steps", type=int, default=1000, show_default=True, metavar="N", help="Steps of a run.")
@click.option("--repeats", type=int, default=3, show_default=True, metavar="N", help="Runs of each case.")
@click.option(
    "--threads",
    type=int,
    default=2,
    show_default=True,
    metavar="N",
    help="Threads of the variant that runs on several; 1 for none.",
)
@options.output("Folder for speed.json, speed.csv and speed.png; without it nothing is written.")
@options.overwrite
@options.quiet
@options.as_json
@options.debug
def speed(
    meshes: tuple[Path, ...],
    faces: str | None,
    steps: int,
    repeats: int,
    threads: int,
    output: Path | None,
    overwrite: bool,
    quiet: bool,
    as_json: bool,
) -> None:
    """Time 1,000 steps on each MESH as it is, and on generated plates, stage by stage.

    The situation is fixed: 60 % of the vertices separate and 2,000 edges break on 10,000 faces, both evenly.
    Each case runs in a process of its own, on one core but for the variant on several threads. Of long runs
    a few steps are timed in each tenth.
    """
    from weathercoat.bench.cases import FACES
    from weathercoat.bench.chart import draw_chart
    from weathercoat.bench.speed import bench_speed
    from weathercoat.bench.tables import as_csv, as_text

    plates = FACES if faces is None else _parse_whole_numbers("--faces", faces)
    folder = _results_folder("speed", output, overwrite=overwrite)
    with Messages(quiet=quiet or as_json) as messages:
        results = bench_speed(
            meshes,
            plates,
            steps=steps,
            repeats=repeats,
            threads=threads,
            progress=messages.progress,
            say=messages.log,
        )
        if folder is not None:
            _write(folder, "speed", results, as_csv(results), {"speed": draw_chart}, messages.log)
    _print(results, as_text, output, quiet=quiet, as_json=as_json)


@command.command("accuracy")
@click.argument("cases", metavar="[CASE]...", nargs=-1)
@options.output("Folder for accuracy.json, accuracy.csv and the charts; without it nothing is written.")
@options.overwrite
@options.quiet
@options.as_json
@options.debug
def accuracy(
    cases: tuple[str, ...], output: Path | None, overwrite: bool, quiet: bool, as_json: bool
) -> None:
    """Measure work against precision on films whose deformed shape is known, or on the CASEs named.

    Each solver and form of the angle constraint starts from flat film with larger and larger budgets. Times
    are CPU milliseconds, set-up and factorisation included.
    """
    from weathercoat.bench.accuracy import bench_accuracy
    from weathercoat.bench.accuracy_chart import case_charts
    from weathercoat.bench.accuracy_tables import as_csv, as_text

    folder = _results_folder("accuracy", output, overwrite=overwrite)
    with Messages(quiet=quiet or as_json) as messages:
        results = bench_accuracy(cases, progress=messages.progress, say=messages.log)
        if folder is not None:
            _write(folder, "accuracy", results, as_csv(results), case_charts(results), messages.log)
    _print(results, as_text, output, quiet=quiet, as_json=as_json)


@command.command("stability")
@click.argument("maps", metavar="[MAP]...", nargs=-1)
@options.output("Folder for stability.json, stability.csv and the charts; without it nothing is written.")
@options.overwrite
@options.quiet
@options.as_json
@options.debug
def stability(
    maps: tuple[str, ...], output: Path | None, overwrite: bool, quiet: bool, as_json: bool
) -> None:
    """Try every solver and form of the angle constraint where methods fail, on all maps or the MAPs named.

    Maps are curl per step and shape of triangles, budget and length of flaps, folds up to a full turn,
    degenerate elements, unit and place of the model, and parameters at their bounds and beyond. Each cell is
    converged, slow, oscillating, flipped, different, non-finite or refused.
    """
    from weathercoat.bench.stability import bench_stability
    from weathercoat.bench.stability_chart import map_charts
    from weathercoat.bench.stability_tables import as_csv, as_text

    folder = _results_folder("stability", output, overwrite=overwrite)
    with Messages(quiet=quiet or as_json) as messages:
        results = bench_stability(maps, progress=messages.progress, say=messages.log)
        if folder is not None:
            _write(folder, "stability", results, as_csv(results), map_charts(results), messages.log)
    _print(results, as_text, output, quiet=quiet, as_json=as_json)


@command.command("convergence")
@click.argument("solvers", metavar="[SOLVER]...", nargs=-1)
@click.option(
    "--faces", type=click.IntRange(100), default=10_000, show_default=True, metavar="N", help="Faces."
)
@click.option("--steps", type=click.IntRange(10), default=1000, show_default=True, metavar="N", help="Steps.")
@options.output("Folder for convergence.json, .csv and .png; without it nothing is written.")
@options.overwrite
@options.quiet
@options.as_json
@options.debug
def convergence(
    solvers: tuple[str, ...],
    faces: int,
    steps: int,
    output: Path | None,
    overwrite: bool,
    quiet: bool,
    as_json: bool,
) -> None:
    """Age a plate with each solver, or the SOLVERs named, and hold every tenth of the run against its
    minimum.

    Times are CPU seconds of the steps. Gaps are of the energy above the minimum that is found from there.
    """
    from weathercoat.bench.convergence import bench_convergence
    from weathercoat.bench.convergence_tables import as_csv, as_text, draw_convergence

    folder = _results_folder("convergence", output, overwrite=overwrite)
    with Messages(quiet=quiet or as_json) as messages:
        results = bench_convergence(solvers, faces=faces, steps=steps, progress=messages.progress)
        if folder is not None:
            charts: dict[str, Draw] = {"convergence": draw_convergence}
            _write(folder, "convergence", results, as_csv(results), charts, messages.log)
    _print(results, as_text, output, quiet=quiet, as_json=as_json)


@command.command("independence")
@click.option(
    "--faces", metavar="N,N,...", help="Sizes of the sheets. Default: 3000,10000,30000,100000,300000."
)
@click.option("--seeds", type=int, default=5, show_default=True, metavar="N", help="Runs of each kind.")
@click.option("--steps", type=int, default=300, show_default=True, metavar="N", help="Steps of a run.")
@click.option(
    "--solver",
    type=click.Choice(["sweeps", "momentum", "descent", "newton", "none"]),
    default="sweeps",
    show_default=True,
    help="Solver of the deformation under the default rules.",
)
@click.option(
    "--shear-lag",
    type=click.FloatRange(0.001, 1.0),
    default=0.05,
    show_default=True,
    metavar="SIZES",
    help="fracture.shear_lag of the runs that compare meshes.",
)
@options.output("Folder for independence.json, .csv and .png; without it nothing is written.")
@options.overwrite
@options.quiet
@options.as_json
@options.debug
def independence(
    faces: str | None,
    seeds: int,
    steps: int,
    solver: str,
    shear_lag: float,
    output: Path | None,
    overwrite: bool,
    quiet: bool,
    as_json: bool,
) -> None:
    """Age the same paint on coarser and finer sheets: spacing of cracks, area of flakes, radius of curls.

    By the default rules and by the paper's literal ones, with several seeds; and the spacing of cracks
    against the shear lag.
    """
    from weathercoat.bench.independence import FACES, bench_independence
    from weathercoat.bench.independence_chart import draw_chart
    from weathercoat.bench.independence_tables import as_csv, as_text

    folder = _results_folder("independence", output, overwrite=overwrite)
    with Messages(quiet=quiet or as_json) as messages:
        results = bench_independence(
            FACES if faces is None else _parse_whole_numbers("--faces", faces),
            seeds=seeds,
            steps=steps,
            solver=solver,
            shear_lag=shear_lag,
            progress=messages.progress,
            say=messages.log,
        )
        if folder is not None:
            charts: dict[str, Draw] = {"independence": draw_chart}
            _write(folder, "independence", results, as_csv(results), charts, messages.log)
    _print(results, as_text, output, quiet=quiet, as_json=as_json)


@command.command("fidelity")
@click.option(
    "--seeds", metavar="N,N,...", default="1,2", show_default=True, help="Seeds that every way runs with."
)
@options.output(
    "Folder for fidelity.json, .csv, .png and quality.json, the front; without it nothing is written."
)
@options.overwrite
@options.quiet
@options.as_json
@options.debug
def fidelity(seeds: str, output: Path | None, overwrite: bool, quiet: bool, as_json: bool) -> None:
    """Seconds against the error of what a viewer sees, in many ways to run, beside a fine reference.

    Meshes, numbers of steps and solvers on one plate; areas over the age, cracks, the place and outline of
    the film, and pictures at several sizes. The ways that no other beats are what `quality` chooses from. It
    takes about ten minutes.
    """
    from weathercoat.bench.fidelity import bench_fidelity
    from weathercoat.bench.fidelity_chart import draw_chart
    from weathercoat.bench.fidelity_tables import as_csv, as_text, make_front

    wanted = _parse_whole_numbers("--seeds", seeds)
    folder = _results_folder("fidelity", output, overwrite=overwrite)
    with Messages(quiet=quiet or as_json) as messages:
        results = bench_fidelity(seeds=wanted, progress=messages.progress, say=messages.log)
        if folder is not None:
            front = {"quality.json": make_front(results)}
            charts = {"fidelity": draw_chart}
            _write(folder, "fidelity", results, as_csv(results), charts, messages.log, front)
    _print(results, as_text, output, quiet=quiet, as_json=as_json)


@command.command("scenes")
@options.assignments
@options.output("Folder for scenes.json and scenes.csv; without it nothing is written.")
@options.overwrite
@options.quiet
@options.as_json
@options.debug
def scenes(
    assignments: tuple[str, ...], output: Path | None, overwrite: bool, quiet: bool, as_json: bool
) -> None:
    """What `quality: auto` picks for a near, a middle and a far view, beside the reference.

    On a plate and a barrel, with seeds that the front was not measured with. It takes about ten minutes.
    """
    from weathercoat.bench.scenes import as_csv, bench_scenes, scenes_table
    from weathercoat.bench.tables import as_lines

    folder = _results_folder("scenes", output, overwrite=overwrite)
    with Messages(quiet=quiet or as_json) as messages:
        results = bench_scenes(overrides=assignments, progress=messages.progress, say=messages.log)
        if folder is not None:
            _write(folder, "scenes", results, as_csv(results), {}, messages.log)
    _print(results, lambda found: as_lines(scenes_table(found)), output, quiet=quiet, as_json=as_json)


@command.command("noise")
@click.option("--faces", type=int, default=3000, show_default=True, metavar="N", help="Faces of each run.")
@click.option("--steps", type=int, default=300, show_default=True, metavar="N", help="Steps of each run.")
@click.option(
    "--seeds", type=int, default=20, show_default=True, metavar="N",
    help="Seeds of each part and config, for the spread.",
)  # fmt: skip
@click.option(
    "--judged", type=int, default=40, show_default=True, metavar="N",
    help="Further seeds, that groups to judge are drawn from.",
)  # fmt: skip
@click.option(
    "--trials", type=int, default=1000, show_default=True, metavar="N", help="Judgements of each kind."
)
@options.output(
    "Folder for noise.json, .csv and shipped.json, which comparisons read; without it nothing is written."
)
@options.overwrite
@options.quiet
@options.as_json
@options.debug
def noise(
    faces: int,
    steps: int,
    seeds: int,
    judged: int,
    trials: int,
    output: Path | None,
    overwrite: bool,
    quiet: bool,
    as_json: bool,
) -> None:
    """How far seeds are apart in each figure, and how well comparisons tell that from a change.

    Four parts by four configs for the spread; then how often groups of runs of one kind are called different,
    and how often such with another crack direction threshold. It takes about ten minutes.
    """
    from weathercoat.bench.noise import bench_noise, make_shipped
    from weathercoat.bench.noise_tables import as_csv, as_text

    folder = _results_folder("noise", output, overwrite=overwrite)
    with Messages(quiet=quiet or as_json) as messages:
        results = bench_noise(
            faces=faces, steps=steps, seeds=seeds, judged=judged, trials=trials,
            progress=messages.progress, say=messages.log,
        )  # fmt: skip
        if folder is not None:
            shipped = {"shipped.json": make_shipped(results)}
            _write(folder, "noise", results, as_csv(results), {}, messages.log, shipped)
    _print(results, as_text, output, quiet=quiet, as_json=as_json)


def _results_folder(name: str, output: Path | None, *, overwrite: bool) -> RunFolder | None:
    """The folder for a benchmark's results, refused before any work where it cannot be written."""
    from weathercoat.output.folder import RunFolder

    return None if output is None else RunFolder(output, overwrite=overwrite, marker=f"{name}.json")


def _write(
    folder: RunFolder,
    name: str,
    results: dict[str, Any],
    table: str,
    charts: Mapping[str, Draw],
    say: Callable[[str], None],
    more: Mapping[str, Mapping[str, Any]] | None = None,
) -> None:
    """Fill the folder, with `more` files of JSON; says why there are no charts, if there are none."""
    from weathercoat.bench.files import write_results
    from weathercoat.output.report import write_json

    with folder as path:
        missing = write_results(path, name, results, table, charts)
        for file, content in (more or {}).items():
            write_json(path / file, content)
    if missing:
        say(missing)


def _print(
    results: dict[str, Any],
    as_text: Callable[[dict[str, Any]], Iterable[str]],
    output: Path | None,
    *,
    quiet: bool,
    as_json: bool,
) -> None:
    """The results as JSON, or as text for people, and where they were written."""
    if as_json:
        click.echo(json.dumps(results, indent=2, ensure_ascii=False))
    elif not quiet:
        click.echo("\n".join(as_text(results)))
        if output is not None:
            click.echo(f"written to {output}")


def _parse_whole_numbers(option: str, text: str) -> tuple[int, ...]:
    if text == "none":
        return ()
    try:
        return tuple(int(part) for part in text.replace("_", "").split(","))
    except ValueError:
        raise UsageError(
            f"{option}: {text!r} is no list of whole numbers", remedy="write them as 3000,10000"
        ) from None
