"""`weathercoat inspect`: what a model is, what its repair did, and what a run would cost."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import click

from weathercoat.cli import options
from weathercoat.errors import BatchError, WeathercoatError, printable
from weathercoat.memory import memory_limit


@click.command()
@click.argument("models", metavar="MODEL...", nargs=-1, required=True, type=click.Path(path_type=str))
@click.option("--self-intersections", is_flag=True, help="Look for faces that cut through others too.")
@click.option(
    "--config", "config", metavar="CONFIG", default="standard", help="Config whose run is estimated."
)
@options.assignments
@options.model_format
@options.max_memory
@options.as_json
@options.debug
def command(
    models: tuple[str, ...],
    self_intersections: bool,
    config: str,
    assignments: tuple[str, ...],
    model_format: str | None,
    max_memory: int | None,
    as_json: bool,
) -> None:
    """Tell faces, components, boundary and manifoldness of each MODEL, its repairs, and the cost of a run.

    Of several models, one that cannot be read is told of on standard error, and the others go on; the exit
    code is 8 then. With --json each of several is an object on a line of its own.
    """
    from weathercoat.cli.messages import Messages
    from weathercoat.cli.reading import read_model
    from weathercoat.config.load import load_config
    from weathercoat.mesh.inspect import inspect_surface
    from weathercoat.plan import cost_figures, make_plan, refusal_lines
    from weathercoat.run import report_compiling

    for model in models:
        options.require_one_reader(config, model)
    loaded = load_config(config, assignments)
    limit = memory_limit(max_memory)

    def inspect(model: str) -> tuple[dict[str, Any], list[str]]:
        with Messages(quiet=as_json) as messages, report_compiling(messages.log):
            surface = read_model(model, model_format, up=loaded.config.model.up, max_memory=max_memory)
            found = inspect_surface(surface, self_intersections=self_intersections)
        plan = make_plan(loaded, surface, len(surface.faces))
        return {**found, "run_cost": cost_figures(plan, limit)}, list(refusal_lines(plan, limit))

    if len(models) > 1:
        _inspect_several(models, inspect, as_json=as_json)
        return
    found, refusal = inspect(models[0])
    if as_json:
        click.echo(json.dumps(found, indent=2, ensure_ascii=False))
    else:
        click.echo("\n".join(map(printable, [*_lines(found), *refusal])))


def _inspect_several(
    models: Sequence[str], inspect: Callable[[str], tuple[dict[str, Any], list[str]]], *, as_json: bool
) -> None:
    """Tell of each as soon as it is known; raises BatchError at the end where some could not be read."""
    failed = []
    for model in models:
        try:
            found, refusal = inspect(model)
        except WeathercoatError as error:
            error.file = error.file or model
            failed.append(model)
            if as_json:
                click.echo(json.dumps({"file": model, "error": error.as_dict()}, ensure_ascii=False))
            else:
                click.echo("\n".join(f"weathercoat: {line}" for line in error.lines()), err=True)
            continue
        if as_json:
            click.echo(json.dumps({"file": model, **found}, ensure_ascii=False))
        else:
            click.echo("\n".join(map(printable, [model, *_lines(found), *refusal, ""])))
    if failed:
        raise BatchError(
            f"{len(failed)} of {len(models)} models could not be inspected",
            remedy="mend what the messages name",
        )


def _lines(found: dict[str, Any]) -> Iterator[str]:
    """The findings for people, one a line; a list of findings has a line for each."""
    for key, value in found.items():
        title = key.replace("_", " ")
        if key == "notes":
            yield from (f"{'note':18} {note['code']}({note['count']}): {note['message']}" for note in value)
        elif key == "groups":
            yield from (f"{'group':18} {group['name']}: {group['faces']:,} faces" for group in value)
        elif key == "parts":
            yield from (f"{'part':18} {part['name']}: {part['faces']:,} faces" for part in value)
        elif key == "materials":
            yield from (
                f"{'material':18} {material['name']}: {material['textures']} textures" for material in value
            )
        elif value is None:
            continue
        elif key == "run_cost":
            yield f"{'a run would take':18} about {value['seconds']:,.0f} s and {value['memory_mb']:,} MB"
        elif isinstance(value, dict):
            yield f"{title:18} " + ", ".join(f"{name} {_shown(part)}" for name, part in value.items())
        else:
            yield f"{title:18} {_shown(value)}"


def _shown(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return f"{value:,}"
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list):
        return ", ".join(f"({_shown(part)})" if isinstance(part, list) else _shown(part) for part in value)
    return str(value)
