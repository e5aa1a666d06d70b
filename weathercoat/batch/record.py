"""The record of a batch, `batch.json`: what became of each job, kept up to date while the batch runs.

It appears whole each time, so that whoever watches a batch reads it at any moment. Its form is that of
`schemas/batch.json`.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from weathercoat.batch.job import Job, Outcome, Status
from weathercoat.batch.price import Price
from weathercoat.output.folder import output_errors
from weathercoat.output.report import versions, write_json

RECORD = "batch.json"
RECORD_VERSION = 1
STATUSES = ("waiting", "running", "done", "unchanged", "failed", "dropped")
_SECONDS_BETWEEN_WRITES = 1.0
_SHARE_OF_TIME = 0.02  # that writing may take; a large record is written less often


class Record:
    """What is known of each job of a batch in the folder `out`; what is noted is written when it is time."""

    def __init__(self, out: Path, jobs: Sequence[Job], prices: Mapping[str, Price], workers: int) -> None:
        self._path = out / RECORD
        self._begun = time.time()
        self._clock = time.monotonic()
        self._next_write = 0.0
        self._rows = {job.name: _row(job, prices.get(job.name)) for job in jobs}
        self._head: dict[str, Any] = {
            "batch_version": RECORD_VERSION,
            "versions": versions(),
            "started": _utc(self._begun),
            "workers": workers,
        }
        self.state = "running"

    def note_progress(self, name: str, done: int, total: int) -> None:
        """A job runs, and so many of its steps are done."""
        self._rows[name].update(status="running", steps_done=done, steps=total)
        self._changed()

    def note_outcome(self, outcome: Outcome) -> None:
        """A job has ended."""
        row = self._rows[outcome.name]
        _end_row(row, outcome.status)
        row.update(
            seconds=round(outcome.seconds, 3),
            attempts=outcome.attempts,
            figures=outcome.figures,
            error=outcome.error,
            messages=list(outcome.messages),
        )
        self._changed()

    def end(self, state: str) -> dict[str, Any]:
        """The batch has `finished`, or was `stopped` before its end, which drops what has not ended; returns
        what is written.
        """
        self.state = state
        for row in self._rows.values():
            if row["status"] in ("waiting", "running"):
                _end_row(row, "dropped")
        return self.write()

    def _as_dict(self) -> dict[str, Any]:
        """The content of `batch.json`."""
        now = time.monotonic() - self._clock
        counts = Counter(row["status"] for row in self._rows.values())
        return {
            **self._head,
            "state": self.state,
            "updated": _utc(self._begun + now),
            "seconds": round(now, 3),
            "counts": {status: counts[status] for status in STATUSES},
            "jobs": list(self._rows.values()),
        }

    def write(self) -> dict[str, Any]:
        """Write the record, and return it; OutputError where that cannot be."""
        began = time.monotonic()
        content = self._as_dict()
        aside = self._path.with_name(f".{RECORD}.partial")
        with output_errors(self._path):
            write_json(aside, content)
            aside.replace(self._path)
        took = time.monotonic() - began
        self._next_write = began + max(_SECONDS_BETWEEN_WRITES, took / _SHARE_OF_TIME)
        return content

    def _changed(self) -> None:
        if time.monotonic() >= self._next_write:
            self.write()


def _row(job: Job, price: Price | None) -> dict[str, Any]:
    config = job.loaded.config
    expected = None if price is None else {
        "seconds": round(price.seconds, 1),
        "memory_mb": round(price.memory / 1e6),
        "disk_mb": round(price.disk / 1e6, 1),
    }  # fmt: skip
    return {
        "name": job.name,
        "asset": job.asset,
        "config": job.loaded.source,
        "seed": config.seed,
        "set": dict(_changed_keys(job)),
        "folder": job.name,
        "status": "waiting",
        "expected": expected,
        "seconds": 0.0,
        "attempts": 0,
        "figures": None,
        "error": None,
        "messages": [],
    }


def _end_row(row: dict[str, Any], status: Status) -> None:
    """Let a job end, which has no steps to go then."""
    row["status"] = status
    for key in ("steps_done", "steps"):
        row.pop(key, None)


def _changed_keys(job: Job) -> list[tuple[str, Any]]:
    """The keys that options or the manifest set, with their values: what is neither default, nor of a preset,
    nor of the config file.
    """
    content = job.loaded.config.as_dict()
    found = []
    for key, origin in job.loaded.origins.items():
        if origin == "default" or origin.startswith(("preset ", "quality ", f"{job.loaded.source}:")):
            continue
        section, _, name = key.partition(".")
        value = content[section][name] if name else content[section]
        found.append((key, value))
    return found


def _utc(seconds: float) -> str:
    return time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(seconds))
