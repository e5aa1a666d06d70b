"""The command `weathercoat`, which finds its subcommands by name.

`--help` and `--version` stay fast because no subcommand's module imports more than Click and the standard
library before its command is called.
"""

from __future__ import annotations

from importlib import import_module

import click

from weathercoat import __version__
from weathercoat.memory import require_address_space

SUBCOMMANDS = (
    "run",
    "batch",
    "scene",
    "baseline",
    "plan",
    "config",
    "sample",
    "inspect",
    "remesh",
    "render",
    "export",
    "risk",
    "bake",
    "view",
    "severity",
    "verify",
    "compare",
    "schema",
    "warmup",
    "bench",
    "completion",
)


class _Subcommands(click.Group):
    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(SUBCOMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name not in SUBCOMMANDS:
            return None
        command: click.Command = import_module(f"weathercoat.cli.{name}").command
        return command


@click.group(
    cls=_Subcommands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100}
)
@click.version_option(__version__, prog_name="weathercoat", message="%(prog)s %(version)s")
def weathercoat() -> None:
    """Age painted metal: read a mesh and a config, simulate how the paint separates, cracks, curls, flakes
    off and rusts, and write meshes, pictures and a report.

    \b
    weathercoat sample sign -o sign.obj
    weathercoat run crackle sign.obj -o sign
    """
    require_address_space()
