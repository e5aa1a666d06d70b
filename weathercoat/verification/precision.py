"""What rounding makes of the numbers in a run's files; every tolerance follows from these."""

from __future__ import annotations

# The largest relative error of a number rounded to 32 bits, and to 64.
SINGLE = 2.0**-24
DOUBLE = 2.0**-53
# Positions go through at most this many roundings, of numbers no larger than coordinates, on their way from
# the simulation's frame into the file and from the file into a figure.
ROUNDINGS = 32
# The largest relative error of a figure with the 12 significant digits of the report.
REPORTED = 5e-12
