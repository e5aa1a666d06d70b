"""The stability benchmark from its first map to its results."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from weathercoat.bench.accuracy import METHODS, warm_up
from weathercoat.bench.machine import describe_machine
from weathercoat.bench.stability_history import CLASSES
from weathercoat.bench.stability_maps import StabilityMap, make_maps
from weathercoat.errors import UsageError


def bench_stability(
    names: Sequence[str] = (),
    *,
    progress: Callable[[int, int], None] = lambda done, total: None,
    say: Callable[[str], None] = lambda line: None,
) -> dict[str, Any]:
    """The class of every cell of all maps, or of those named, for every method, as plain values.

    progress: called with the maps done, of all methods, and their number. say: called with what is worth
    knowing, a line each. Raises UsageError for an unknown name.
    """
    maps = {made.name: made for made in make_maps()}
    for name in names:
        if name not in maps:
            raise UsageError(f"no map {name!r}", remedy=f"there are {', '.join(maps)}")
    say("compiling where that has not been done yet")
    warm_up(METHODS)
    wanted = [maps[name] for name in (names or maps)]
    found = []
    for number, made in enumerate(wanted):
        say(made.about)
        methods = []
        for place, method in enumerate(METHODS):
            methods.append({"method": method.label, "cells": fill_map(made, method.values)})
            progress(number * len(METHODS) + place + 1, len(wanted) * len(METHODS))
        found.append(
            {
                **{name: getattr(made, name) for name in ("name", "about", "x_label", "y_label")},
                "x": list(made.x),
                "y": list(made.y),
                "methods": methods,
            }
        )
    return {"schema": 1, "machine": describe_machine(), "classes": list(CLASSES), "maps": found}


def fill_map(made: StabilityMap, values: dict[str, Any]) -> list[list[str]]:
    """The classes of a map, row by row."""
    return [[made.cell(values, x, y) for x in range(len(made.x))] for y in range(len(made.y))]
