"""A run whose process died: finished from its recording, by the next process or by `twin recover`."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from twin import clock
from twin.errors import TwinError
from twin.process import Link, Stop
from twin.results import Ending, Journal, Stream, column_of
from twin.results import run_folder as results
from twin.results import stream as streams
from twin.run.cases import Outcome, Progress, analyzed, note, prepare, silent
from twin.run.executor import ABOUT, Work, unheard
from twin.scenario import Form

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from twin.scenario import Case


def resume(
    folder: Path,
    form: Form = Form.fmu,
    *,
    link: Link,
    build: Path = Path("build"),
    progress: Progress = silent,
    report: bool = True,
    others: bool = False,
    logged: Sequence[str] = (),
    hear: Callable[[str], object] = unheard,
) -> Outcome:
    """Finish a run whose process died, from its recording. `others`: first run the cases that had not begun.

    `logged` and `hear` as of `run_scenario`.
    """
    journal = Journal(folder)
    journal.own(link.owners)
    recorded = streams.read(folder)
    work = restored(recorded, folder, link, form, build, progress, report, journal)
    work.logged, work.hear = logged, hear
    with Stop() as work.stop:
        work.link.keep(resume=str(folder), hint=f"Then: twin recover {folder}")
        left = bury(work, recorded)
        if others and left:
            work.build_members()
            work.run(left)
        elif left:
            work.outcome.end("interrupted", f"{len(left)} of {len(work.cases)} cases had not begun")
        try:
            work.end()
        finally:
            work.link.close()
    return work.outcome


def restored(
    recorded: Stream,
    folder: Path,
    link: Link,
    form: Form,
    build: Path,
    progress: Progress,
    report: bool,
    journal: Journal,
) -> Work:
    """A run as its recording tells it: the cases that have ended are in its tables."""
    from twin.scenario import displayed, load_scenario

    told = recorded.about
    scenario = load_scenario(folder / "scenario.yaml")
    own = {key: told[key] for key in ("name", "title", "description", "source", "paper_applies")}
    scenario = replace(scenario, path=Path(told["path"]), overrides=tuple(told["overrides"]), **own)
    catalogs: dict[str, Any] = {}
    with suppress(TwinError):  # an FMU may be gone, and what it recorded is there
        catalogs = prepare(scenario)
        scenario = displayed(scenario, catalogs)
    about = results.Run(
        **{**{key: told[key] for key in ABOUT}, "step_ns": clock.of_plain(told["step_ns"])},
        overrides=tuple(told["overrides"]),
        started=datetime.fromisoformat(told["started"]),
    )
    outcome = Outcome(scenario, catalogs, about, folder=folder)
    outcome.columns = [column_of(one) for one in told["columns"]]
    variants = {case.variant: case for case in scenario.variants}
    cases = [replace(variants[variant], seed=seed) for variant, seed in recorded.cases]
    return Work(outcome, cases, form, build, progress, report and told["report"], None, link, journal)


def bury(work: Work, recorded: Stream) -> list[Case]:
    """Take over the cases that have ended, and end the one that died; those that have not begun."""
    outcome, link = work.outcome, work.link
    for part in recorded.parts:
        variant, seed = recorded.cases[part.number]
        if part.end is None:
            death = recorded.located(part.number, link.death)
            known = "" if link.death else streams.explanation(outcome.folder)
            part.end = {
                "end": part.number,
                "complete": False,
                "failure": known or f"{variant}, seed {seed}: {death.text()}",
                "interrupted": death.from_outside and not known,
                "took": 0.0,
                "last": None,
            }
            work.journal.add(**part.end)
        end = part.end
        outcome.run.wall_time += end["took"]
        outcome.run.members = end.get("members") or outcome.run.members
        note(outcome.run, end.get("notes", []))
        if ending := end.get("ending"):
            outcome.endings[variant, seed] = Ending(**{**ending, "log": tuple(ending["log"])})
        signals = analyzed(outcome.scenario, variant, recorded.signals(part.number), work.progress)
        outcome.take(variant, seed, signals, timed=bool(end["took"]))
        if end["interrupted"]:
            outcome.end("interrupted", end["failure"] or f"interrupted in {variant}, seed {seed}")
        elif end["failure"]:
            outcome.end("failed", end["failure"])
    begun = len(recorded.parts)
    if link.death is not None and link.death.from_outside and begun < len(work.cases):
        outcome.end("interrupted", link.death.text())
    return work.cases[begun:] if outcome.run.status != "interrupted" else []


def recover(folder: Path, *, report: bool = True, progress: Progress = silent) -> Outcome:
    """Finish a run that nobody finishes any more, from its recording; TwinError if there is nothing to finish."""
    if not (folder / streams.FOLDER).exists():
        what = "is complete" if (folder / "summary.json").exists() else "is no folder of a run"
        raise TwinError(f"{folder}: {what}: there is nothing to recover.")
    if not streams.abandoned(folder):
        raise TwinError(f"{folder}: the run goes on. Wait for it, or end it with Ctrl-C.")
    if not streams.has_begun(folder):
        Journal(folder).remove()
        raise TwinError(f"{folder}: was killed before anything was recorded.")
    return resume(folder, link=Link(), report=report, progress=progress)
