"""What jobs are expected to take, before they run: by the measured rates of `weathercoat.cost`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from weathercoat.batch.job import Job
from weathercoat.config.quality import AUTO
from weathercoat.cost import estimate_cost, memory_to_read
from weathercoat.errors import WeathercoatError
from weathercoat.mesh.count import count_faces
from weathercoat.mesh.read import Up, read_surface
from weathercoat.mesh.surface import Surface
from weathercoat.plan import make_plan
from weathercoat.run import split_paint

_SURFACES_KEPT = 16


class Price(NamedTuple):
    """Seconds of work on one core, bytes of memory at the peak, bytes that are written."""

    seconds: float
    memory: float
    disk: float


def price_job(job: Job) -> Price:
    """The price of a job. Only for a config with `quality: auto`, whose choice hangs on the model's size, is
    the model read; a model that cannot be read costs nothing.
    """
    loaded, faces, path = job.loaded, count_faces(Path(job.asset)), Path(job.asset)
    to_read = memory_to_read(path.stat().st_size, path.suffix[1:]) if path.is_file() else 0.0
    if loaded.config.quality == AUTO:
        try:
            surface = _read(job.asset, job.format, loaded.config.model.up)
            painted, _ = split_paint(surface, loaded.config)
            plan = make_plan(loaded, painted, len(surface.faces))
        except WeathercoatError:
            return Price(0.0, 0.0, 0.0)
        loaded, faces = plan.loaded, plan.model_faces
    cost = estimate_cost(loaded.config, faces)
    return Price(cost.seconds, max(cost.memory, to_read), cost.disk)


@lru_cache(_SURFACES_KEPT)
def _read(asset: str, format: str | None, up: Up) -> Surface:
    return read_surface(asset, format=format, up=up)


def seconds_together(prices: Sequence[Price], workers: int) -> float:
    """Seconds until all is done by so many workers: each takes the longest job that is left."""
    busy = [0.0] * max(1, min(workers, len(prices)))
    for seconds in sorted((price.seconds for price in prices), reverse=True):
        busy[busy.index(min(busy))] += seconds
    return max(busy)


def total_price(prices: Mapping[str, Price]) -> Price:
    """Seconds and disk of all jobs, and the memory of the one that needs most."""
    if not prices:
        return Price(0.0, 0.0, 0.0)
    return Price(
        sum(price.seconds for price in prices.values()),
        max(price.memory for price in prices.values()),
        sum(price.disk for price in prices.values()),
    )
