"""The simulation of a finished run, at any of its steps."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from weathercoat.errors import CorruptError, UsageError
from weathercoat.finished import FinishedRun
from weathercoat.masks.files import MaskSource, hash_files
from weathercoat.output.checkpoints import read_checkpoint, read_kept_surface
from weathercoat.output.folder import CHECKPOINT, REPORT
from weathercoat.run import prepare_simulation, remesh_painted, split_paint
from weathercoat.sim.checkpoint import restore_state
from weathercoat.sim.simulation import Simulation


def restore_simulation(
    finished: FinishedRun,
    step: int | None = None,
    *,
    model: Path | None = None,
    masks: Path | None = None,
    threads: int = 1,
    say: Callable[[str], None] = lambda line: None,
) -> Simulation:
    """The simulation of a run after a step, by default the last that it reached.

    The last one comes from the run's checkpoint, others are simulated again from the start. model: the run's
    model, and masks: the folder of the files of `steering`, where they are not beside the run's folder or in
    the working folder. Raises UsageError where one of them is not there or is another than the run's, or for
    a step outside the run.
    """
    config = finished.config
    if step is not None and not 0 <= step <= config.ageing.steps:
        what = f"the run has no step {step}"
        raise UsageError(what, file=str(finished.path), remedy=f"give one from 0 to {config.ageing.steps}")
    painted, _ = split_paint(finished.read_model(model), config)
    checkpoint = read_checkpoint(finished.path)
    if checkpoint and config.remesh:
        surface = read_kept_surface(finished.path)
    else:
        surface = remesh_painted(painted, config)
    source = _find_masks(finished, masks)
    simulation = prepare_simulation(surface, config, painted, masks=source, threads=threads)
    wanted = finished.steps[-1] if step is None else step
    if checkpoint and checkpoint.step <= wanted:
        try:
            restore_state(simulation, checkpoint.arrays)
        except (KeyError, ValueError, IndexError, TypeError) as error:
            where = str(finished.path / CHECKPOINT)
            raise CorruptError("the checkpoint is broken", file=where, remedy="run again") from error
    elif wanted > 0:
        say(f"simulating again up to step {wanted:,}")
    while simulation.step_count < wanted:
        simulation.step()
    return simulation


def _find_masks(finished: FinishedRun, folder: Path | None) -> MaskSource:
    """Where the files of `steering` lie that the run was made with."""
    origin = str(finished.path / REPORT)
    wanted = {
        name: entry["sha256"]
        for name, entry in finished.report["inputs"].items()
        if name.startswith("steering/")
    }
    places = [finished.path.parent, Path()] if folder is None else [folder]
    for place in places:
        names = (name.removeprefix("steering/") for name in wanted)
        if all((place / name).is_file() for name in names):
            source = MaskSource(origin, place)
            if hash_files(finished.config, source) == wanted:
                return source
    names_of_all = ", ".join(name.removeprefix("steering/") for name in wanted)
    raise UsageError(
        f"the masks of the run, {names_of_all}, are not there as they were",
        file=str(finished.path),
        remedy="give their folder with --masks",
    )
