"""The end of a run: from what was recorded to signals.parquet, summary.json and report.html, whatever the end was."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING

from twin.component import catalog
from twin.errors import SimulationError
from twin.results import Journal, evaluate
from twin.results import run_folder as results
from twin.run.cases import Hardware, Outcome, note

if TYPE_CHECKING:
    from twin.scenario import Case

SYSTEMS = 3  # that are drawn, where variants differ


def finish(outcome: Outcome, cases: Sequence[Case], report: bool, hardware: Hardware | None, journal: Journal) -> None:
    """Write the folder, then remove the recording; SimulationError if the disk does not let it, the recording stays."""
    scenario, about = outcome.scenario, outcome.run
    try:
        judge = partial(
            evaluate, scenario.metrics, scenario.expectations, outcome.tables, scenario.paper_applies, outcome.endings
        )
        write_signals(outcome)
        outcome.evaluation = judge()
        if hardware is not None:
            about.extra = {**about.extra, "hardware": hardware.report()}
            note(about, hardware.notes())
        write(outcome, cases, report, hardware.pictures() if hardware is not None else [])
    except OSError as error:
        with suppress(OSError):
            journal.own("")  # this process may live on, and does not finish it
        raise SimulationError(unwritten(outcome, journal, error)) from error
    journal.remove()


def unwritten(outcome: Outcome, journal: Journal, error: OSError) -> str:
    """Why the folder could not be written, and what to do, in one line."""
    before = f"{outcome.run.reason.splitlines()[0]} " if outcome.run.reason else ""
    if not journal.folder.exists():
        return f"{before}{outcome.folder}: has disappeared, and with it what was recorded. Run again."
    why = os.strerror(error.errno) if error.errno else str(error)
    return (
        f"{before}{outcome.folder}: cannot be finished ({why}). What was recorded is kept: free some space, then: "
        f"twin recover {outcome.folder}"
    )


def write_signals(outcome: Outcome) -> None:
    """Write signals.parquet, whole or not at all."""
    path = outcome.folder / "signals.parquet"
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with results.SignalFile(beside, outcome.columns, {"scenario": outcome.scenario.name}) as file:
            for (variant, seed), signals in outcome.tables.items():
                for part in signals.parts():
                    file.write(variant, seed, part)
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)


def sources(cases: Iterable[Case]) -> dict[str, str]:
    """Where the parameters' values come from, as their components declare it."""
    found = {}
    for case in cases:
        for name, spec in case.members.items():
            if not spec.component.endswith(".fmu"):
                found.update(
                    {
                        f"{name}.{v.name}": v.source
                        for v in (spec.made or catalog.component(spec.component)).variables
                        if v.source
                    }
                )
    return found


def write(outcome: Outcome, cases: Sequence[Case], report: bool, pictures: Sequence[dict[str, str]] = ()) -> None:
    """Write summary.json and report.html."""
    outcome.summary = results.summary(outcome.run, outcome.evaluation, outcome.tables, outcome.endings)
    results.write_summary(outcome.folder / "summary.json", outcome.summary)
    if report:
        from twin.run import report as page
        from twin.run import scenes

        distinct = list({case.variant: case for case in cases}.values())
        text = page.html(
            outcome.summary,
            outcome.evaluation,
            outcome.tables,
            plots=outcome.scenario.plots,
            parameters=page.parameters(distinct, outcome.catalogs, sources(distinct)),
            events=page.events(distinct),
            pictures=[*scenes.pictures(outcome.scenario.scenes, outcome.tables), *pictures],
            endings=outcome.endings,
            systems=list(outcome.systems.items())[:SYSTEMS],
            halved=[one.cells for one in outcome.halved],
            expectations=outcome.scenario.expectations,
        )
        results.write_text(outcome.folder / "report.html", text)
