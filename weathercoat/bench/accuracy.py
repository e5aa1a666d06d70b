"""The accuracy benchmark: work against precision, for every solver and form of the angle constraint."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from statistics import median
from typing import Any

from weathercoat.bench.machine import describe_machine
from weathercoat.bench.reference import ReferenceCase, measure_errors, momentum_of, solve_case
from weathercoat.bench.reference_cases import make_flap, make_reference_cases
from weathercoat.deform.deformation import deform
from weathercoat.errors import UsageError

SWEEPS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1_000, 2_000, 5_000, 10_000)
_SECONDS, _MOST_SECONDS = 0.7, 2.0  # CPU time after which a ladder has no further rung,
_FACES, _STEPS = 3_000, 50  # for each so many faces or steps
_MOST_WORK = 10_000  # sweeps or iterations of all steps, where targets grow
_SHORT, _REPEATS = 0.02, 3  # CPU seconds below which a rung is timed so many times


@dataclass(frozen=True)
class Setting:
    """How a method is used: the share of an angle correction, whether the targets grow step by step or are
    there at once, and whether it begins a thousandth of the way to the answer instead of flat.
    """

    stiffness: float = 1.0
    growing: bool = False
    nudged: bool = False

    @property
    def label(self) -> str:
        """For people."""
        words = ["growing" if self.growing else "at once"]
        if self.stiffness < 1.0:
            words.append(f"stiffness {self.stiffness:g}")
        if self.nudged:
            words.append("nudged")
        return ", ".join(words)


@dataclass(frozen=True)
class Method:
    """A way to deform: a solver with a form of the angle constraint, the budgets a step that are tried, and
    the settings.
    """

    label: str
    values: dict[str, Any]  # keys of the config, dotted, by which it is chosen
    budget: str  # the key that the budget goes to
    budgets: tuple[int, ...]
    settings: tuple[Setting, ...]
    goes_on: bool = False  # a step of a + b is a step of a and one of b
    endless: dict[str, Any] = field(default_factory=dict)  # with these it ends only at its budget


_SWEEP_SETTINGS = (Setting(), Setting(stiffness=0.3), Setting(growing=True))


def _sweeps(form: str, settings: tuple[Setting, ...]) -> Method:
    values = {"deformation.angle": form}
    return Method(f"sweeps, {form}", values, "deformation.sweeps", SWEEPS, settings, goes_on=True)


ITERATIONS = (1, 2, 3, 5, 10, 20, 30, 50, 100, 200, 300)
_ITERATION_SETTINGS = (Setting(), Setting(growing=True))


def _converging(solver: str) -> Method:
    """A solver of the energy."""
    values, endless = {"deformation.solver": solver}, {"deformation.tolerance": 1e-12}
    return Method(solver, values, "deformation.iterations", ITERATIONS, _ITERATION_SETTINGS, endless=endless)


METHODS = (
    _sweeps("dihedral", _SWEEP_SETTINGS),
    _sweeps("split", _SWEEP_SETTINGS),
    _sweeps("arccos", (Setting(), Setting(nudged=True))),  # what is flat has no gradient in this form
    Method("momentum", {"deformation.solver": "momentum"}, "deformation.sweeps", SWEEPS, _SWEEP_SETTINGS),
    _converging("descent"),
    _converging("newton"),
)


def bench_accuracy(
    names: Sequence[str] = (),
    *,
    progress: Callable[[int, int], None] = lambda done, total: None,
    say: Callable[[str], None] = lambda line: None,
) -> dict[str, Any]:
    """The curves of all methods on the cases, or on those named, as plain values.

    progress: called with the ladders done and their number. say: called with what is worth knowing, a line
    each. Raises UsageError for an unknown name.
    """
    known = make_reference_cases()
    for name in names:
        if name not in known:
            raise UsageError(f"no case {name!r}", remedy=f"there are {', '.join(known)}")
    say("compiling where that has not been done yet")
    warm_up(METHODS)
    makers = make_reference_cases(names)
    total = len(makers) * sum(len(method.settings) for method in METHODS)
    done = 0
    found = []
    for make in makers.values():
        case = make()
        if case.answer is None:
            case = solve_case(case)
        say(f"{case.name}: {case.about}")
        curves = []
        for method in METHODS:
            ladders = []
            for setting in method.settings:
                points = list(climb(case, method, setting)) if is_usable(case, setting) else []
                if points:
                    ladders.append({"setting": setting.label, "points": points})
                done += 1
                progress(done, total)
            curves.append({"method": method.label, "ladders": ladders})
        found.append(describe_case(case) | {"curves": curves})
    return {"schema": 1, "machine": describe_machine(), "cases": found}


def describe_case(case: ReferenceCase) -> dict[str, Any]:
    """What a case is, as plain values."""
    assert case.answer is not None
    return {
        "name": case.name,
        "about": case.about,
        "faces": case.faces,
        "free_vertices": len(case.active.free),
        "answer": case.answer.kind,
        "growth_steps": case.growth_steps if case.can_grow else None,
        "start": _plain(asdict(measure_errors(case, case.start))),
    }


def is_usable(case: ReferenceCase, setting: Setting) -> bool:
    """Whether the case can be run so: the targets of frozen film are what they are."""
    return case.can_grow or not setting.growing


def climb(case: ReferenceCase, method: Method, setting: Setting) -> Iterator[dict[str, Any]]:
    """The points of a ladder: budget a step, CPU milliseconds of all steps, and errors at the end."""
    assert case.answer is not None
    steps = case.growth_steps if setting.growing else 1
    enough = min(_SECONDS * max(1.0, case.faces / _FACES, steps / _STEPS), _MOST_SECONDS)
    start = case.start + 1e-3 * (case.answer.positions - case.start) if setting.nudged else case.start
    mesh, behind, so_far, spent = case.mesh_at(start), 0, 0.0, 0.0
    most = max(method.budgets) if steps == 1 else _MOST_WORK // steps
    for budget in (budget for budget in method.budgets if budget <= most):
        if method.goes_on and steps == 1:
            so_far += _run(case, mesh, method, setting, budget - behind)
            behind, work = budget, so_far
            spent = so_far
        else:
            trials: list[float] = []
            for _ in range(_REPEATS):
                mesh = case.mesh_at(start)
                trials.append(_run(case, mesh, method, setting, budget))
                if trials[0] > _SHORT:
                    break
            work = median(trials)
            spent += sum(trials)
        errors = measure_errors(case, mesh.positions[: mesh.vertex_count])
        yield {"budget": budget, **_plain({"cpu_ms": 1e3 * work, **asdict(errors)})}
        if spent > enough or not math.isfinite(errors.angle):
            return


def _run(case: ReferenceCase, mesh: Any, method: Method, setting: Setting, budget: int) -> float:
    """CPU seconds of all steps of a case with a budget each; changes the positions of the mesh."""
    given = {
        **method.values,
        **method.endless,
        "deformation.angle_stiffness": setting.stiffness,
        method.budget: budget,
    }
    parameters = case.parameters_with(given)
    spent = 0.0
    steps = case.growth_steps if setting.growing else 1
    for step in range(steps):
        if case.can_grow:
            case.aim((step + 1) / steps)
        started = time.process_time()
        if step == 0:
            momentum = momentum_of(case, parameters)
        deform(mesh, case.constraints, parameters, case.age, momentum=momentum)
        spent += time.process_time() - started
    return spent


def _plain(values: dict[str, float]) -> dict[str, float | None]:
    """Measured values as JSON has them: with four digits, and None for what is not finite."""
    return {name: float(f"{v:.4g}") if math.isfinite(v) else None for name, v in values.items()}


def warm_up(methods: Sequence[Method]) -> None:
    """Run every method once on a small film, so that it is compiled."""
    case = make_flap(4)
    for method in methods:
        _run(case, case.mesh_at(case.start), method, Setting(), 2)
