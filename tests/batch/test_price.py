"""Prices of jobs, and how long they take together."""

from __future__ import annotations

from pathlib import Path

from tests.batch.jobs import make_broken_job, make_job, make_task
from weathercoat.batch.price import Price, price_job, seconds_together, total_price
from weathercoat.batch.processes import InlineExecutor


def test_a_price_follows_faces_and_steps(tmp_path: Path) -> None:
    small = price_job(make_job(tmp_path, "a", "remesh=on", "remesh.faces=1000"))
    large = price_job(make_job(tmp_path, "a", "remesh=on", "remesh.faces=100000"))
    longer = price_job(make_job(tmp_path, "a", "remesh=on", "remesh.faces=1000", "ageing.steps=100000"))
    assert small.seconds < large.seconds
    assert small.memory < large.memory
    assert small.disk < large.disk
    assert longer.seconds > 10 * small.seconds
    assert longer.disk == small.disk


def test_without_remeshing_the_model_makes_the_price(tmp_path: Path) -> None:
    prices = [price_job(make_job(tmp_path, "a", faces=faces)).memory for faces in (100, 20_000)]
    assert prices[1] > prices[0] + 1e7


def test_the_price_of_disk_is_about_right(tmp_path: Path) -> None:
    job = make_job(tmp_path, "a", "output.preview=true", "output.picture_width=200", faces=2000)
    list(InlineExecutor().run([make_task(job, tmp_path)]))
    written = sum(path.stat().st_size for path in (tmp_path / "a").rglob("*") if path.is_file())
    assert 0.5 < price_job(job).disk / written < 2.0


def test_quality_auto_reads_the_model(tmp_path: Path) -> None:
    near, far = (
        make_job(tmp_path, "a", "remesh=on", "quality=auto", f"scene.distance={distance}")
        for distance in (1.0, 100.0)
    )
    assert price_job(near).seconds > price_job(far).seconds


def test_a_model_that_cannot_be_read_costs_little_and_raises_nothing(tmp_path: Path) -> None:
    job = make_broken_job(tmp_path, "a")
    assert price_job(job).seconds < 10.0


def test_seconds_together() -> None:
    prices = [Price(seconds, 1.0, 2.0) for seconds in (3.0, 1.0, 1.0, 1.0)]
    assert seconds_together(prices, 1) == 6.0
    assert seconds_together(prices, 2) == 3.0
    assert seconds_together(prices, 100) == 3.0
    assert seconds_together([], 2) == 0.0
    assert total_price({str(i): price for i, price in enumerate(prices)}) == Price(6.0, 1.0, 8.0)
    assert total_price({}) == Price(0.0, 0.0, 0.0)
