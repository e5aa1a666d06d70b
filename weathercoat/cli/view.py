"""`weathercoat view`: a page that shows a finished run in a browser."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from weathercoat.cli import options
from weathercoat.cli.writing import STANDARD_OUTPUT, open_output, say_written
from weathercoat.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Callable

    from weathercoat.finished import FinishedRun
    from weathercoat.mesh.surface import Vectors
    from weathercoat.sim.snapshot import Snapshot


class _Steps(click.ParamType):
    name = "steps"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, ...]:
        try:
            return tuple(sorted({int(word) for word in str(value).split(",")}))
        except ValueError:
            self.fail(f"{value!r} is no list of steps, such as 200,400", param, ctx)


@click.command()
@click.argument("run", type=click.Path(path_type=Path))
@options.output("The page; - for standard output.", required=True)
@click.option("--steps", type=_Steps(), metavar="N,N,...", help="The snapshots to show; all by default.")
@click.option("--step", type=int, metavar="N", help="The snapshot to begin with; the last by default.")
@click.option(
    "--before", type=int, metavar="N", help="Begin with a divider: the snapshot of this step to its left,"
)
@click.option(
    "--after", type=int, metavar="N", help="and that of this one to its right; by default the last."
)
@click.option(
    "--risk",
    is_flag=True,
    help="Lay over it, too, how near the film is to letting go; simulates the run again.",
)
@click.option(
    "--model",
    type=click.Path(path_type=Path),
    help="The model of the run, for --risk, where it is not beside the run or in the working folder.",
)
@options.overwrite
@options.as_json
@options.debug
def command(
    run: Path,
    output: Path,
    steps: tuple[int, ...] | None,
    step: int | None,
    before: int | None,
    after: int | None,
    risk: bool,
    model: Path | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Write one HTML page that shows RUN, the folder of a finished run or its folder of snapshots.

    The page holds all that it shows and needs no network: turn the model, move through time, lay rust, dirt,
    adhesion or strain over it, and slide between two moments.
    """
    from weathercoat.cli.messages import Messages
    from weathercoat.finished import open_run
    from weathercoat.output.viewer.page import Start, write_page
    from weathercoat.recording import picture_parameters
    from weathercoat.run import report_compiling

    if as_json and output == STANDARD_OUTPUT:
        raise UsageError("--json and -o - both write to standard output", remedy="give a file to -o")
    if before is None and after is not None:
        raise UsageError("--after goes with --before", remedy="give --before too, or --step")
    if before is not None and step is not None:
        raise UsageError("--step and --before both say what to begin with", remedy="give --after")
    with (
        Messages(quiet=as_json) as messages,
        report_compiling(messages.log),
        open_output(output, "a page", overwrite=overwrite) as stream,
    ):
        finished = open_run(run)
        wanted = _wanted(finished, steps, step, before, after)
        rows = {int(row["step"]): row for row in finished.report["snapshots"]}
        snapshots = finished.read_snapshots(wanted, finished.find_model(model))
        write_page(
            stream,
            snapshots,
            [rows[number] for number in wanted],
            picture_parameters(finished.config),
            name=Path(finished.report["model"]).stem,
            up=finished.up,
            untouched=finished.untouched,
            risk=_risk(finished, snapshots, model, messages.log) if risk else None,
            start=Start(after if step is None else step, before),
        )
    say_written(output, as_json=as_json)


def _wanted(finished: FinishedRun, steps: tuple[int, ...] | None, *shown: int | None) -> list[int]:
    """The steps to put into the page; UsageError where the run has no snapshot of one."""
    wanted = list(steps) if steps else finished.steps
    for number in (*wanted, *(each for each in shown if each is not None)):
        if number not in finished.steps:
            raise UsageError(
                f"the run has no snapshot of step {number}",
                file=str(finished.path),
                remedy=f"there are {', '.join(map(str, finished.steps))}",
            )
    return sorted({*wanted, *(each for each in shown if each is not None)})


def _risk(
    finished: FinishedRun, snapshots: list[Snapshot], model: Path | None, say: Callable[[str], None]
) -> dict[int, Vectors]:
    """By step, the ratio of lift to adhesion of each vertex of the film, 1 where it has let go."""
    import numpy as np

    from weathercoat.restore import restore_simulation
    from weathercoat.sim.risk import assess_risk

    simulation = restore_simulation(finished, snapshots[0].step, model=model, say=say)
    ratios = {}
    for snapshot in snapshots:
        while simulation.step_count < snapshot.step:
            simulation.step()
        ratio = assess_risk(simulation, horizon=0).separation[snapshot.film_origin]
        ratios[snapshot.step] = np.where(snapshot.separated, 1.0, ratio)
    return ratios
