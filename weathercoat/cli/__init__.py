"""The command line: one module per subcommand, loaded when it is needed."""

from __future__ import annotations

import sys
from typing import NoReturn

from weathercoat.cli.signals import Stopped, raise_signals


def main() -> NoReturn:
    """The entry point: run the command line of this process and exit."""
    raise_signals()
    try:
        from weathercoat.cli.handler import run

        code = run()
    except Stopped as stopped:
        print(f"weathercoat: {stopped.word}", file=sys.stderr)
        code = stopped.exit_code
    sys.exit(code)
