"""`python -m tests.fuzz KIND ...`: what to fuzz, each kind in a module of its own with `main(arguments)`."""

from __future__ import annotations

import argparse
import importlib
import sys

KINDS = {"files": "tests.fuzz.files", "configs": "tests.fuzz.configs", "runs": "tests.fuzz.runs"}
"""Modules by kind. `main` takes the arguments after the kind, at least `--count`, `--seed` and `--seconds`,
and returns the number of violations."""


def main() -> int:
    """Run one kind with its own arguments, or `all` of them, each for its share of `--seconds`."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("kind", choices=[*KINDS, "all"])
    kind, rest = parser.parse_args(sys.argv[1:2]).kind, sys.argv[2:]
    if kind != "all":
        return _violations(kind, rest) > 0
    shares = argparse.ArgumentParser(prog="python -m tests.fuzz all")
    shares.add_argument("--seconds", type=float, required=True, help="for all kinds together")
    shares.add_argument("--seed", type=int, default=0)
    options = shares.parse_args(rest)
    share = ["--seconds", str(options.seconds / len(KINDS)), "--seed", str(options.seed)]
    return sum(_violations(kind, share) for kind in KINDS) > 0


def _violations(kind: str, arguments: list[str]) -> int:
    found: int = importlib.import_module(KINDS[kind]).main(arguments)
    return found


if __name__ == "__main__":
    sys.exit(main())
