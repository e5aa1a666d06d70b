"""The command line: one module per subcommand, loaded when it is needed."""

from weathercoat.cli.handler import main

__all__ = ["main"]
