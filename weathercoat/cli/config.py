"""`weathercoat config`: begin, inspect and check a config."""

from __future__ import annotations

import json
from pathlib import Path

import click

from weathercoat.cli import options
from weathercoat.config.presets import preset_names, preset_purpose
from weathercoat.errors import ConfigError, ConfigProblem, UsageError


@click.group()
def command() -> None:
    """Begin, show and check configs."""


@command.command("list")
@options.as_json
@options.debug
def list_configs(as_json: bool) -> None:
    """Name the shipped configs and say what each is for."""
    if as_json:
        purposes = {name: preset_purpose(name) for name in preset_names()}
        click.echo(json.dumps({"configs": purposes}, indent=2, ensure_ascii=False))
        return
    width = max(map(len, preset_names()))
    for name in preset_names():
        click.echo(f"{name:{width}}  {preset_purpose(name)}")


@command.command("new")
@click.argument("file", required=False, type=click.Path(path_type=Path))
@click.option(
    "--from", "preset", type=click.Choice(preset_names()), help="Take the values of a shipped config."
)
@options.overwrite
@options.as_json
@options.debug
def new_config(file: Path | None, preset: str | None, overwrite: bool, as_json: bool) -> None:
    """Write a commented config to start from, to FILE or standard output."""
    from weathercoat.config.describe import example_yaml

    if preset is None:
        text = example_yaml()
    else:
        from weathercoat.config.load import load_config

        text = example_yaml(load_config(preset).config, f"# {preset_purpose(preset)}.\n")
    if file is None:
        click.echo(json.dumps({"yaml": text}, ensure_ascii=False) if as_json else text, nl=as_json)
        return
    from weathercoat.output.folder import whole_file

    with whole_file(file, overwrite=overwrite) as stream:
        stream.write(text.encode())
    if as_json:
        click.echo(json.dumps({"written": str(file)}, ensure_ascii=False))


@command.command("show")
@options.config
@options.assignments
@options.as_json
@options.debug
def show_config(config: str, assignments: tuple[str, ...], as_json: bool) -> None:
    """Print every value of CONFIG and where it came from: default, preset, file and line, or --set."""
    from weathercoat.config.describe import resolved_yaml
    from weathercoat.config.load import load_config

    loaded = load_config(config, assignments)
    if as_json:
        content = {"config": loaded.config.as_dict(), "origins": dict(loaded.origins)}
        click.echo(json.dumps(content, indent=2, ensure_ascii=False))
    else:
        click.echo(resolved_yaml(loaded), nl=False)


@command.command("schema")
@click.option("--markdown", is_flag=True, help="Print the reference of all keys in Markdown instead.")
@options.as_json
@options.debug
def print_schema(markdown: bool, as_json: bool) -> None:
    """Print the JSON Schema of a config, for editors."""
    from weathercoat.config.describe import json_schema, reference_markdown

    if markdown and as_json:
        raise UsageError("--markdown and --json exclude each other", remedy="give one of them")
    if markdown:
        click.echo(reference_markdown(), nl=False)
    else:
        click.echo(json.dumps(json_schema(), indent=2, ensure_ascii=False))


@command.command("check")
@click.argument("configs", nargs=-1, required=True, metavar="CONFIG...")
@options.assignments
@options.as_json
@options.debug
def check_configs(configs: tuple[str, ...], assignments: tuple[str, ...], as_json: bool) -> None:
    """Check configs without running: every problem of every file, with line and key."""
    from weathercoat.config.load import load_config

    problems: list[ConfigProblem] = []
    for config in configs:
        try:
            load_config(config, assignments)
        except ConfigError as error:
            problems += error.problems
        else:
            if not as_json:
                click.echo(f"{config}: valid")
    if problems:
        raise ConfigError(problems=tuple(dict.fromkeys(problems)))
    if as_json:
        click.echo(json.dumps({"valid": list(configs)}, ensure_ascii=False))
