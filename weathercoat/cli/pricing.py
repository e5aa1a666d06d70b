"""The price of a batch before it runs: `weathercoat batch --dry-run`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from weathercoat.batch.job import Job
    from weathercoat.memory import MemoryLimit

_MOST_ROWS = 50


def price_of(jobs: Sequence[Job], output: str, workers: int, limit: MemoryLimit | None) -> dict[str, Any]:
    """What is left to do, and what it is expected to take; memory and disk in bytes, ready for JSON."""
    from weathercoat.batch.batch import sort_out
    from weathercoat.batch.price import price_job, seconds_together, total_price

    unchanged, left = sort_out(jobs, output)
    prices = {job.name: price_job(job) for job in left}
    total = total_price(prices)
    return {
        "jobs": [
            {
                "name": name,
                "seconds": round(price.seconds, 1),
                "memory": round(price.memory),
                "disk": round(price.disk),
            }
            for name, price in prices.items()
        ],
        "unchanged": len(unchanged),
        "workers": workers,
        "seconds": round(seconds_together(list(prices.values()), workers), 1),
        "seconds_of_work": round(total.seconds, 1),
        "largest_memory": round(total.memory),
        "disk": round(total.disk),
        "too_large": [name for name, price in prices.items() if limit and price.memory > limit.bytes],
    }


def price_lines(price: Mapping[str, Any]) -> Iterator[str]:
    """A price for people: the jobs that take longest, and all of them."""
    from weathercoat.cost import in_megabytes

    jobs = price["jobs"]
    shown = sorted(jobs, key=lambda job: -job["seconds"])[:_MOST_ROWS]
    width = max((len(job["name"]) for job in shown), default=4)
    if shown:
        yield f"{'job':{width}} {'seconds':>8} {'memory':>10} {'disk':>10}"
    for job in shown:
        memory, disk = in_megabytes(job["memory"]), in_megabytes(job["disk"])
        yield f"{job['name']:{width}} {job['seconds']:8.1f} {memory:>10} {disk:>10}"
    if len(jobs) > len(shown):
        yield f"... and {len(jobs) - len(shown)} that take less"
    many = len(jobs) + price["unchanged"]
    yield (
        f"{len(jobs)} of {many} jobs to do: about {_duration(price['seconds'])}, "
        f"{price['workers']} at a time, {in_megabytes(price['disk'])} on disk, "
        f"{in_megabytes(price['largest_memory'])} of memory for the largest"
    )
    for name in price["too_large"]:
        yield f"{name} needs more memory than there is"


def _duration(seconds: float) -> str:
    """A time for people."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes} min"
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"
