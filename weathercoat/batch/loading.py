"""From rows to jobs: the members of their study, each with its config."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from weathercoat.batch.job import Job
from weathercoat.batch.manifest import Row
from weathercoat.batch.study import Study
from weathercoat.config.load import ConfigLoader, LoadedConfig, Override
from weathercoat.errors import ConfigError, ConfigProblem


def load_jobs(
    rows: Sequence[Row],
    study: Study,
    config: str,
    overrides: Sequence[str | Override] = (),
    problems: Sequence[ConfigProblem] = (),
) -> list[Job]:
    """The jobs that a study makes of all rows, in their order; each distinct config is loaded once.

    config: of rows that name none. overrides: come after those of rows, and before those of the study.
    problems: those that are known already. Raises ConfigError with them and with those of all configs.
    """
    loading = _Loading(study, config, tuple(overrides))
    jobs = [job for row in rows for job in loading.members_of(row)]
    found = [*problems, *loading.problems(len(rows))]
    if found:
        raise ConfigError(problems=tuple(sorted(found, key=lambda problem: (problem.where, problem.line))))
    return jobs


class _Loading:
    """Loads the configs of jobs, and collects what is wrong with any."""

    def __init__(self, study: Study, config: str, overrides: tuple[str | Override, ...]) -> None:
        self._study = study
        self._config = config
        self._overrides = overrides
        self._loader = ConfigLoader()
        self._loaded: dict[tuple[str, str], LoadedConfig | ConfigError] = {}
        self._problems: dict[tuple[str, ...], tuple[ConfigProblem, list[str]]] = {}

    def members_of(self, row: Row) -> Iterator[Job]:
        """The jobs that the study makes of a row, but for those whose configs are not valid."""
        for member in self._study.combinations:
            name = f"{row.name}/{member.suffix}" if member.suffix else row.name
            config = member.config or row.config or self._config
            overrides = (*row.overrides, *self._overrides, *member.overrides)
            loaded = self._load(name, config, overrides)
            if loaded is None:
                continue
            if self._study.variants is None:
                yield Job(name, row.asset, loaded, row.format)
                continue
            for variant in self._study.drawn(loaded.config.seed, name):
                own = f"{name}/{variant.suffix}"
                drawn = self._load(own, variant.config or config, (*overrides, *variant.overrides))
                if drawn is not None:
                    yield Job(own, row.asset, drawn, row.format)

    def _load(self, name: str, config: str, overrides: tuple[str | Override, ...]) -> LoadedConfig | None:
        """The config of a job, or None where it is not valid."""
        key = (config, repr(overrides))
        if key not in self._loaded:
            try:
                self._loaded[key] = self._loader.load(config, overrides)
            except ConfigError as error:
                self._loaded[key] = error
        loaded = self._loaded[key]
        if isinstance(loaded, LoadedConfig):
            return loaded
        for problem in loaded.problems:
            fault = problem.what.partition(", not ")[0]  # without the value, which may be drawn
            same = (problem.place(), problem.key, fault)
            self._problems.setdefault(same, (problem, []))[1].append(name)
        return None

    def problems(self, rows: int) -> Iterator[ConfigProblem]:
        """What is wrong with the configs, each problem with the jobs that have it, unless these are simply
        those of all the rows.
        """
        for problem, jobs in self._problems.values():
            others = f" and {len(jobs) - 1:,} more" if len(jobs) > 1 else ""
            is_common = not self._study.changes and len(jobs) == rows
            where = "" if is_common else f"; in the job {jobs[0]}{others}"
            yield replace(problem, what=problem.what + where)
