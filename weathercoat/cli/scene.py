"""`weathercoat scene`: age the objects of a scene, each by its exposure."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from weathercoat.cli import options
from weathercoat.errors import BatchError

if TYPE_CHECKING:
    from weathercoat.scene.plan import ScenePlan

_EACH = "each"
_MOST_VARIANTS = 10_000


class _Variants(click.ParamType):
    name = "number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if value == _EACH or isinstance(value, int):
            return value
        if not value.isdecimal() or not 1 <= int(value) <= _MOST_VARIANTS:
            self.fail(f"must be each, or a whole number from 1 to {_MOST_VARIANTS:,}", param, ctx)
        return int(value)


@click.command()
@click.argument("scene", type=click.Path(path_type=Path))
@click.option(
    "-c", "--config", metavar="CONFIG",
    help="A YAML file or the name of a shipped config, instead of the scene's own.",
)  # fmt: skip
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), metavar="PATH",
    help="Folder of the results.  [default: the scene's name with -aged]",
)  # fmt: skip
@options.workers
@options.assignments
@click.option(
    "--age", type=click.FloatRange(0, 1000), metavar="AGES",
    help="How long objects have been exposed whose rules do not tell; ageing.duration by default.",
)  # fmt: skip
@click.option(
    "--variants", type=_Variants(), metavar="N",
    help="How many results the instances of a mesh share whose rules do not tell, or each; by default as "
    "many as their degrees ask for.",
)  # fmt: skip
@options.seed
@options.quality
@click.option(
    "--dry-run", is_flag=True, help="Print exposure, detail and cost of each object, and run nothing."
)
@click.option(
    "--no-preview", "preview", is_flag=True, flag_value=False, default=True, help="Draw no picture."
)
@options.portable
@options.max_memory
@options.no_check
@options.quiet
@options.as_json
@options.log_file
@options.debug
def command(
    scene: Path,
    config: str | None,
    output: Path | None,
    workers: int | None,
    assignments: tuple[str, ...],
    age: float | None,
    variants: int | Literal["each"] | None,
    seed: int | None,
    quality: str | None,
    dry_run: bool,
    preview: bool,
    max_memory: int | None,
    check: bool,
    quiet: bool,
    as_json: bool,
    log_file: Path | None,
) -> None:
    """Age the objects of SCENE, a YAML file or a GLB, each by how much sky and rain reach it.

    The folder gets scene.glb, which loads as the scene did, with the same names and transforms; scene.json,
    which tells of each object's exposure, degree and detail; a picture; and a run for each result in objects.
    Objects that place the same mesh share one result unless they weather otherwise, or rules say so. What is
    done already and unchanged is not done again.

    \b
    weathercoat sample yard -o yard.glb
    weathercoat scene yard.yaml -c rusting -o aged
    """
    from weathercoat.cli.executing import Teller, make_executor, pool_size, say_how_to_go_on
    from weathercoat.cli.messages import Messages
    from weathercoat.memory import memory_limit
    from weathercoat.run import report_compiling
    from weathercoat.scene.age import age_scene
    from weathercoat.scene.plan import Choices, plan_scene
    from weathercoat.scene.read import read_scene
    from weathercoat.scene.report import note_lines, table_lines

    out = output or Path(f"{scene.stem}-aged")
    choices = Choices(config, [*assignments, *options.shortcuts(quality=quality)], age, seed, variants)
    with Messages(quiet=quiet or as_json, log_file=log_file) as messages:
        with report_compiling(messages.log):
            read = read_scene(scene)
            for line in note_lines(read):
                messages.log(line)
            plan = plan_scene(read, choices)
        if dry_run:
            _say_plan(plan, scene.name, as_json=as_json)
            return
        size = pool_size("processes", workers)
        limit = memory_limit(max_memory)
        teller = Teller(messages, as_json=as_json)
        with say_how_to_go_on(str(out)):
            report = age_scene(
                plan,
                scene.name,
                out,
                make_executor("processes", size, None, limit),
                workers=size,
                threads=options.threads_beside(size),
                check=check,
                max_memory=None if limit is None else round(limit.bytes),
                preview=preview,
                begin=teller.begin,
                listen=teller,
                log=messages.log,
            )
    if as_json:
        click.echo(json.dumps({"event": "end", "folder": str(out)}, ensure_ascii=False))
    elif not quiet:
        click.echo("\n".join([*table_lines(report), f"written to {out}"]))
    failed = [row["name"] for row in report["variants"] if row["error"] is not None]
    if failed:
        raise BatchError(
            f"{len(failed)} of {len(plan.variants)} results failed: {', '.join(failed[:5])}", file=str(out)
        )


def _say_plan(plan: ScenePlan, source: str, *, as_json: bool) -> None:
    from weathercoat.scene.report import make_report, table_lines

    report: dict[str, Any] = make_report(plan, source)
    click.echo(
        json.dumps(report, indent=2, ensure_ascii=False) if as_json else "\n".join(table_lines(report))
    )
