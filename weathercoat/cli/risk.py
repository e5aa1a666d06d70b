"""`weathercoat risk`: how near a model, or a finished run, is to separation and fracture."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from weathercoat.cli import options
from weathercoat.errors import UsageError

if TYPE_CHECKING:
    from weathercoat.sim.simulation import Simulation


@click.command()
@click.argument(
    "given", metavar="CONFIG MODEL | RUN", nargs=-1, required=True, type=click.Path(path_type=str)
)
@options.output("Folder for the meshes, the picture and the summary.", required=True)
@click.option(
    "--step",
    type=click.IntRange(0),
    metavar="N",
    help="Of RUN: after this step, not the last; simulates again.",
)
@click.option(
    "--horizon", type=click.IntRange(1), metavar="STEPS", help="How far to look ahead; the steps of the run."
)
@click.option(
    "--show",
    type=click.Choice(["separation", "fracture"]),
    default="separation",
    show_default=True,
    help="Which of them the vertex colours of the meshes are.",
)
@click.option("--model", type=click.Path(path_type=Path), metavar="PATH", help="Of RUN: its model.")
@click.option("--masks", type=click.Path(path_type=Path), metavar="FOLDER", help="Of RUN: where masks lie.")
@options.assignments
@options.quality
@options.seed
@options.steps
@options.faces
@options.model_format
@options.threads
@options.max_memory
@options.overwrite
@options.quiet
@options.as_json
@options.debug
def command(
    given: tuple[str, ...],
    output: Path,
    step: int | None,
    horizon: int | None,
    show: str,
    model: Path | None,
    masks: Path | None,
    assignments: tuple[str, ...],
    quality: str | None,
    seed: int | None,
    steps: int | None,
    faces: int | None,
    model_format: str | None,
    threads: int | None,
    max_memory: int | None,
    overwrite: bool,
    quiet: bool,
    as_json: bool,
) -> None:
    """Tell how near each place is to separation and fracture: of MODEL by the rules of CONFIG before a single
    step is run, or of RUN, the folder of a finished run.

    The ratios are of the state as it is; the steps are those after which a place fails if nothing else
    happens, so they are late where a neighbour fails first.
    """
    from weathercoat.cli.messages import Messages
    from weathercoat.output.folder import RunFolder
    from weathercoat.output.risk import SUMMARY, write_risk
    from weathercoat.run import report_compiling
    from weathercoat.sim.risk import assess_risk

    if len(given) > 2:
        raise UsageError("too many words", remedy="give CONFIG and MODEL, or the folder of a finished run")
    shortcuts = list(options.shortcuts(quality=quality, seed=seed, steps=steps, faces=faces))
    many = threads or options.threads_beside(1)
    folder = RunFolder(output, overwrite=overwrite, marker=SUMMARY)
    with Messages(quiet=quiet or as_json) as messages, report_compiling(messages.log), folder as target:
        if len(given) == 1:
            if assignments or shortcuts or model_format:
                raise UsageError("a finished run has its config", remedy="give CONFIG and MODEL to change it")
            simulation = _of_run(given[0], step, model, masks, many, messages.log)
        else:
            if step is not None or model is not None or masks is not None:
                raise UsageError("--step, --model and --masks are of a finished run", remedy="leave them out")
            settings = [*assignments, *shortcuts]
            simulation = _of_model(given[0], given[1], settings, model_format, many, max_memory, messages.log)
        about = write_risk(target, simulation.surface, assess_risk(simulation, horizon), shown=show)
    if as_json:
        click.echo(json.dumps(about, indent=2, ensure_ascii=False))
    elif not quiet:
        click.echo("\n".join([*_lines(about), f"written to {output}"]))


def _of_run(
    run: str,
    step: int | None,
    model: Path | None,
    masks: Path | None,
    threads: int,
    say: Callable[[str], None],
) -> Simulation:
    from weathercoat.finished import open_run
    from weathercoat.restore import restore_simulation

    return restore_simulation(open_run(run), step, model=model, masks=masks, threads=threads, say=say)


def _of_model(
    config: str,
    model: str,
    settings: list[Any],
    model_format: str | None,
    threads: int,
    max_memory: int | None,
    say: Callable[[str], None],
) -> Simulation:
    from weathercoat.cli.reading import read_model
    from weathercoat.config.load import load_config
    from weathercoat.masks.evaluate import require_masks
    from weathercoat.masks.files import hash_masks, mask_source
    from weathercoat.plan import make_plan
    from weathercoat.run import name_errors, prepare_simulation, remesh_painted, report_notes, split_paint

    options.require_config_first(config, model)
    options.require_one_reader(config, model)
    loaded = load_config(config, settings)
    hash_masks(loaded)
    surface = read_model(model, model_format, up=loaded.config.model.up, max_memory=max_memory)
    with name_errors(model):
        painted, _ = split_paint(surface, loaded.config)
        source = mask_source(loaded)
        require_masks(loaded.config.steering, painted, source.origin)
        plan = make_plan(loaded, painted, len(surface.faces)).loaded.config
        meshed = remesh_painted(painted, plan)
        report_notes(meshed.notes, model, say)
        return prepare_simulation(meshed, plan, painted, masks=source, threads=threads)


def _lines(about: dict[str, Any]) -> Iterator[str]:
    """The summary for people."""
    yield f"step {about['step']:,}, age {about['age']:.4g}: {about['attached_share']:.1%} of the film holds"
    for key, what in (("separation", "the area lets go"), ("fracture", "the edges crack")):
        figures = about[key]
        shares = ", ".join(f"{share:.1%} within {int(n):,}" for n, share in figures["within_steps"].items())
        yield f"{what} by steps: {shares}; {figures['never']:.1%} not"
        if figures["first"]:
            first = figures["first"]
            place = ", ".join(f"{x:.4g}" for x in first["position"])
            yield f"first in {first['in_steps']:,} steps, at the age {first['age']:.4g}, near ({place})"
