"""`weathercoat plan`: what a run would do and cost, without running it."""

from __future__ import annotations

import json

import click

from weathercoat.cli import options
from weathercoat.errors import UsageError
from weathercoat.memory import memory_limit


@click.command()
@click.argument("config_and_model", metavar="[CONFIG] MODEL", nargs=-1, required=True)
@options.assignments
@options.quality
@options.steps
@options.until
@options.faces
@options.model_format
@options.max_memory
@options.as_json
@options.debug
def command(
    config_and_model: tuple[str, ...],
    assignments: tuple[str, ...],
    quality: str | None,
    steps: int | None,
    until: tuple[str, ...],
    faces: int | None,
    model_format: str | None,
    max_memory: int | None,
    as_json: bool,
) -> None:
    """Tell what a run of MODEL by CONFIG would choose, cost and be wrong by, without running.

    CONFIG is a YAML file or the name of a shipped config, standard by default. The model is read, not
    remeshed.
    """
    from weathercoat.cli.messages import Messages
    from weathercoat.cli.reading import read_model
    from weathercoat.config.load import load_config
    from weathercoat.plan import cost_figures, make_plan, plan_lines, refusal_lines
    from weathercoat.run import name_errors, report_compiling, split_paint

    if len(config_and_model) > 2:
        raise UsageError("plan takes one config and one model", remedy="see `weathercoat plan --help`")
    *configs, model = config_and_model
    for config in configs:
        options.require_config_first(config, model)
        options.require_one_reader(config, model)
    shortcuts = options.shortcuts(quality=quality, steps=steps, faces=faces, until=until)
    loaded = load_config(configs[0] if configs else "standard", [*assignments, *shortcuts])
    with Messages(quiet=as_json) as messages, report_compiling(messages.log), name_errors(model):
        surface = read_model(model, model_format, up=loaded.config.model.up, max_memory=max_memory)
        painted, _ = split_paint(surface, loaded.config)
        plan = make_plan(loaded, painted, len(surface.faces))
    limit = memory_limit(max_memory)
    if as_json:
        content = {
            "quality": plan.quality,
            "cost": cost_figures(plan, limit),
            "config": plan.loaded.config.as_dict(),
        }
        click.echo(json.dumps(content, indent=2, ensure_ascii=False))
    else:
        click.echo("\n".join([*plan_lines(plan), *refusal_lines(plan, limit)]))
