"""Fuzzing: inputs made from good ones by random changes, each with a verdict; `python -m tests.fuzz --help`."""
