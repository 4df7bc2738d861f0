"""Options of a run and callbacks during it."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from twin.former import note_former
from twin.run.cases import Progress, noop, run_case
from twin.scenario import Backend

if TYPE_CHECKING:
    from twin import clock
    from twin.coupling import CoSimulation
    from twin.run.continuation import Origin
    from twin.scenario import Case

FORMER_CALLBACKS = {"progress": "progress", "on_log_line": "on_log_line", "case_runner": "run_case"}


@dataclass(frozen=True)
class StudyCase:
    """The case of a study that a run is. `factors`: their values as text; `options`: the overrides that set them.

    `folder`: of the study.
    """

    study: str
    number: int
    factors: dict[str, str]
    options: Sequence[str]
    folder: Path

    def summary(self, run_folder: Path, overrides: Sequence[str]) -> dict[str, Any]:
        """Return what summary.json has of it: other overrides, and the way from the run's page to that of the study."""
        page = self.folder / "report.html"
        is_reachable = self.folder.resolve() in run_folder.resolve().parents or page.is_file()
        return {
            "title": self.study,
            "case": self.number,
            "factors": self.factors,
            "overrides": [option for option in overrides if option not in self.options],
            "page": Path(os.path.relpath(page, run_folder)).as_posix() if is_reachable else "",
        }


@dataclass(frozen=True, kw_only=True, slots=True)
class RunOptions:
    """Options of a run: what is run, how members are executed, and where results are written.

    `variants`, `seeds`: those to run; empty: all. `refine_steps`: also run the first seed of each variant at half the step,
    and report the changes. `log_patterns`: members, or patterns of their names, whose FMU log goes to log.txt.
    `checkpoint_ns`: simulated time between two checkpoints, 0: none. `origin`: the run that is continued. `study_case`: the case of a study that is run.
    """

    backend: Backend = Backend.fmu
    variants: Sequence[str] = ()
    seeds: Sequence[int] = ()
    root: Path = Path("runs")
    build: Path = Path("build")
    report: bool = True
    refine_steps: bool = False
    log_patterns: Sequence[str] = ()
    checkpoint_ns: clock.Time = 0
    origin: Origin | None = None
    study_case: StudyCase | None = None


@dataclass(frozen=True, kw_only=True, slots=True)
class RunCallbacks:
    """Callbacks of a run.

    `progress`: gets the name of a case and its completed fraction. `on_log_line`: gets each line of the members in
    `log_patterns`. `run_case`: takes each case from its start to its end, if not to its stop time. `operator_changes`: lines
    about what an operator changed in the last case; then the run is not one of the file's own settings. `early_end`: why the
    last case ended before its end, and whether it is incomplete. `paused_time`: for how long an operator paused the last case [s].
    """

    progress: Progress = noop
    on_log_line: Callable[[str], object] = noop
    run_case: Callable[[Case, CoSimulation, Progress], object] = run_case
    operator_changes: Callable[[], list[str]] = list
    early_end: Callable[[], tuple[str, bool]] = lambda: ("", False)
    paused_time: Callable[[], float] = float


def accept_former_arguments(
    options: RunOptions | Backend | None, callbacks: RunCallbacks, former: dict[str, Any]
) -> tuple[RunOptions, RunCallbacks]:
    """Return options and callbacks, also from the former arguments of `run_scenario`."""
    if isinstance(options, Backend):
        options, former = None, {"backend": options, **former}
    if former:
        note_former(
            f"run_scenario({', '.join(f'{name}=...' for name in former)})", "RunOptions(...), RunCallbacks(...)"
        )
    changes = {name: value for name, value in former.items() if name not in FORMER_CALLBACKS}
    calls = {FORMER_CALLBACKS[name]: value for name, value in former.items() if name in FORMER_CALLBACKS}
    return replace(options or RunOptions(), **changes), replace(callbacks, **calls)
