"""`weathercoat export`: a finished run in other formats."""

from __future__ import annotations

import json
from pathlib import Path

import click

from weathercoat.cli import options
from weathercoat.errors import UsageError

_FORMATS = ("obj", "ply", "glb", "vtu", "animation", "usd")


@click.command()
@click.argument("run", type=click.Path(path_type=Path))
@options.output("The folder to write into.", required=True)
@click.option(
    "--to",
    "formats",
    multiple=True,
    required=True,
    type=click.Choice(_FORMATS),
    help="A format; may be given again. With vtu comes a .pvd; animation is one GLB, usd one stage.",
)
@click.option("--step", "steps", type=int, multiple=True, metavar="N", help="Only this snapshot; may repeat.")
@click.option(
    "--thickness/--sheet",
    default=True,
    show_default=True,
    help="Film with back and rim, or as a sheet.",
)
@click.option("--flakes", is_flag=True, help="Loose pieces of film as objects of their own.")
@click.option(
    "--lods",
    type=click.IntRange(0, 8),
    default=0,
    metavar="N",
    help="Coarser levels, each a quarter of one before.",
)
@click.option(
    "--seconds",
    type=click.FloatRange(0.01, 3600),
    default=0.5,
    show_default=True,
    metavar="S",
    help="How long an animation shows each snapshot.",
)
@click.option("--model", type=click.Path(path_type=Path), metavar="PATH", help="The model of the run.")
@options.overwrite
@options.quiet
@options.as_json
@options.debug
def command(
    run: Path,
    output: Path,
    formats: tuple[str, ...],
    steps: tuple[int, ...],
    thickness: bool,
    flakes: bool,
    lods: int,
    seconds: float,
    model: Path | None,
    overwrite: bool,
    quiet: bool,
    as_json: bool,
) -> None:
    """Write RUN, the folder of a finished run, as OBJ, PLY, GLB, VTU, an animated GLB or USD.

    The model's own materials and names come back where its file is found beside the run, or is given.
    """
    from weathercoat.cli.messages import Messages
    from weathercoat.export import ExportParameters, export_run
    from weathercoat.finished import open_run
    from weathercoat.output.folder import RunFolder
    from weathercoat.run import report_compiling

    finished = open_run(run)
    known = finished.steps
    for step in steps:
        if step not in known:
            there = ", ".join(map(str, known))
            what = f"the run has no snapshot of step {step}"
            raise UsageError(what, file=str(run), remedy=f"there are {there}")
    with Messages(quiet=quiet or as_json) as messages, report_compiling(messages.log):
        found = finished.find_model(model)
        parameters = ExportParameters(
            formats=formats,
            steps=sorted(set(steps)) or known,
            thickness=thickness,
            flakes=flakes,
            lods=lods,
            seconds=seconds,
            model=found,
        )
        with RunFolder(output, overwrite=overwrite, marker="export.json") as folder:
            files = export_run(finished, folder, parameters, messages.log)
            names = [path.relative_to(folder).as_posix() for path in files]
            about = {"run": finished.report["fingerprint"], "files": names}
            (folder / "export.json").write_text(json.dumps(about, indent=2) + "\n", encoding="utf-8")
    if as_json:
        click.echo(json.dumps({"written": str(output), "files": names}, ensure_ascii=False))
    else:
        click.echo(f"written to {output}")
