"""The command line: one module per subcommand, loaded when it is needed."""

from __future__ import annotations

import gc
import os
import sys
from typing import NoReturn

from weathercoat.cli.signals import Stopped, raise_signals
from weathercoat.cli.streams import open_standard_streams


def prepare_process() -> None:
    """What any process of the program does before it loads anything else."""
    open_standard_streams()
    raise_signals()
    # No result depends on BLAS; its threads would reserve memory for every core, and where they get none,
    # raise SIGINT.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Modules and compiled functions stay to the end. To look through them for garbage again and again, and
    # once more at exit, would take a fifth of the time of a short run.
    gc.set_threshold(100_000, 50, 100)


def main() -> NoReturn:
    """The entry point: run the command line of this process and exit."""
    prepare_process()
    try:
        from weathercoat.cli.handler import run

        code = run()
    except Stopped as stopped:
        print(f"weathercoat: {stopped.word}", file=sys.stderr)
        code = stopped.exit_code
    gc.freeze()
    sys.exit(code)
