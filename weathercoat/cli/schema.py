"""`weathercoat schema`: the published forms of the files that the program reads and writes."""

from __future__ import annotations

import json
from pathlib import Path

import click

from weathercoat.cli import options
from weathercoat.errors import UsageError

_FOLDER = Path(__file__).parent.parent / "schemas"
_CONFIG = "config"


@click.command()
@click.argument("name", required=False)
@options.as_json
@options.debug
def command(name: str | None, as_json: bool) -> None:
    """Print the JSON Schema NAME, or list what there is: of configs, of run.json, batch.json and others."""
    from weathercoat.config.describe import json_schema

    titles = {path.stem: path for path in sorted(_FOLDER.glob("*.json"))}
    known = sorted([_CONFIG, *titles])
    if name is None:
        click.echo(json.dumps({"schemas": known}) if as_json else "\n".join(known))
    elif name == _CONFIG:
        click.echo(json.dumps(json_schema(), indent=2, ensure_ascii=False))
    elif name in titles:
        click.echo(titles[name].read_text(encoding="utf-8"), nl=False)
    else:
        raise UsageError(f"no schema {name!r}", remedy=f"there are {', '.join(known)}")
