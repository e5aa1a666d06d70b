"""The chart of the speed benchmark: seconds by stage over the number of faces, and speed over the age."""

from __future__ import annotations

from typing import Any, BinaryIO

from weathercoat.bench.cases import PAPER, STAGES

_COLORS = {
    "failure": "#b5482a",
    "deformation": "#2f6f7e",
    "mesh": "#8a8f3c",
    "stains": "#7a5195",
    "total": "#222222",
}


def draw_chart(results: dict[str, Any], stream: BinaryIO) -> None:
    """Write the chart as PNG. Raises ImportError without matplotlib (the extra `charts`)."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 4.6), layout="constrained")
    growth, speed = figure.subplots(1, 2)
    cases = [case for case in results["cases"] if not case["variant_of"]]
    plates = [case for case in cases if case["label"].startswith("plate ")] or cases
    faces = [case["faces"] for case in plates]
    for name in (*(stage for stage in STAGES if stage != "other"), "total"):
        seconds = [case["seconds"][name] for case in plates]
        exponent = results["growth"]["exponents"].get(name)
        label = name if exponent is None else f"{name}, exponent {exponent:.2f}"
        growth.plot(faces, seconds, "o-", color=_COLORS[name], label=label, markersize=4)
    growth.plot(
        [timing.faces for timing in PAPER],
        [timing.seconds for timing in PAPER],
        "x",
        color=_COLORS["total"],
        label="total in the paper",
    )
    growth.set(xscale="log", yscale="log", xlabel="faces", ylabel="seconds for 1,000 steps")
    growth.legend(fontsize=8)
    for case in cases:
        tenths = len(case["steps_per_second"])
        ages = [(i + 0.5) / tenths for i in range(tenths)]
        speed.plot(ages, case["steps_per_second"], "o-", label=case["label"], markersize=3)
    speed.set(yscale="log", xlabel="age of the film", ylabel="steps per second")
    speed.legend(fontsize=8)
    for axes in (growth, speed):
        axes.grid(True, which="major", color="#dddddd")
    figure.savefig(stream, format="png", dpi=110)
