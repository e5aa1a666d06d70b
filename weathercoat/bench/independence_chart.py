"""The chart of the benchmark of independence: what the mesh changes, and what the shear lag does."""

from __future__ import annotations

from typing import Any, BinaryIO

_COLORS = {"standard": "#2f6f7e", "literal": "#b5482a"}
_PANELS = {
    "spacing": "crack spacing [sizes]",
    "flake_area": "median flake area [sizes²]",
    "curl_radius": "radius of curls [sizes]",
}


def draw_chart(results: dict[str, Any], stream: BinaryIO) -> None:
    """Write the chart as PNG. Raises ImportError without matplotlib (the extra `charts`)."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(14, 3.8), layout="constrained")
    *panels, slope = figure.subplots(1, len(_PANELS) + 1)
    for axes, (name, label) in zip(panels, _PANELS.items(), strict=True):
        for rules, color in _COLORS.items():
            rows = [row for row in results["means"] if row["kind"] == "faces" and row["rules"] == rules]
            axes.errorbar(
                [row["faces"] for row in rows],
                [row[name] for row in rows],
                yerr=[row[f"{name}_deviation"] for row in rows],
                fmt="o-",
                markersize=4,
                capsize=2,
                color=color,
                label=rules,
            )
        axes.set(xscale="log", yscale="log", xlabel="faces", ylabel=label)
        axes.legend(fontsize=8)
    rows = [row for row in results["means"] if row["kind"] == "shear_lag"]
    fitted = "" if results["slope"] is None else f"slope {results['slope']:.2f}"
    slope.plot(
        [row["shear_lag"] for row in rows],
        [row["spacing"] for row in rows],
        "o-",
        color=_COLORS["standard"],
        label=fitted or None,
    )
    slope.set(xscale="log", yscale="log", xlabel="shear lag [sizes]", ylabel=_PANELS["spacing"])
    if fitted:
        slope.legend(fontsize=8)
    for axes in (*panels, slope):
        axes.grid(True, which="major", color="#dddddd")
    figure.savefig(stream, format="png", dpi=100)
