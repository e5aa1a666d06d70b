"""`weathercoat inspect`: what a model is, what its repair did, and what a run would cost."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import click

from weathercoat.cli import options
from weathercoat.errors import printable
from weathercoat.memory import memory_limit


@click.command()
@options.model
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
    model: str,
    self_intersections: bool,
    config: str,
    assignments: tuple[str, ...],
    model_format: str | None,
    max_memory: int | None,
    as_json: bool,
) -> None:
    """Tell the faces, components, boundary and manifoldness of MODEL, its repairs, and the cost of a run."""
    from weathercoat.cli.messages import Messages
    from weathercoat.cli.reading import read_model
    from weathercoat.config.load import load_config
    from weathercoat.mesh.inspect import inspect_surface
    from weathercoat.plan import cost_figures, make_plan, refusal_lines
    from weathercoat.run import report_compiling

    loaded = load_config(config, assignments)
    with Messages(quiet=as_json) as messages, report_compiling(messages.log):
        surface = read_model(model, model_format, up=loaded.config.model.up, max_memory=max_memory)
        found = inspect_surface(surface, self_intersections=self_intersections)
    plan, limit = make_plan(loaded, surface, len(surface.faces)), memory_limit(max_memory)
    found["run_cost"] = cost_figures(plan, limit)
    if as_json:
        click.echo(json.dumps(found, indent=2, ensure_ascii=False))
    else:
        click.echo("\n".join(map(printable, [*_lines(found), *refusal_lines(plan, limit)])))


def _lines(found: dict[str, Any]) -> Iterator[str]:
    """The findings for people, one a line; a list of findings has a line for each."""
    for key, value in found.items():
        title = key.replace("_", " ")
        if key == "notes":
            yield from (f"{'note':18} {note['code']}({note['count']}): {note['message']}" for note in value)
        elif key == "groups":
            yield from (f"{'group':18} {group['name']}: {group['faces']:,} faces" for group in value)
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
