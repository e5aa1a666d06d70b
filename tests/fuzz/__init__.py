"""Fuzzing: good inputs, damaged at random, each with a verdict; see `python -m tests.fuzz --help`."""
