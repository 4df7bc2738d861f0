"""Finalization of a run: from the recording to signals.parquet, summary.json and report.html."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from twin.errors import SimulationError
from twin.results import Journal, default_run, evaluate, fill_sentence, find_violations, link_latest, worst_seeds_first
from twin.results import run_folder as results
from twin.run.cases import Hardware, RunResult, add_notes
from twin.run.conditions import OCCURRENCES, condition_notes
from twin.run.operator_result import (
    WARNING,
    operation_text,
    operator_requirements,
    operator_result,
    session_verdict,
    warning_notes,
)
from twin.run.parameter_table import parameter_rows, with_unit

if TYPE_CHECKING:
    from twin.scenario import Case

OPERATED = "operated.yaml"  # a folder with this file is that of an operator's session


def finalize_run(
    result: RunResult, cases: Sequence[Case], report: bool, hardware: Hardware | None, journal: Journal
) -> None:
    """Write the folder, then remove the recording; SimulationError if writing fails, and the recording stays."""
    scenario, info = result.scenario, result.run
    try:
        evaluate_result = partial(
            evaluate,
            scenario.metrics,
            scenario.expectations,
            result.tables,
            scenario.paper_applies,
            result.terminations,
            unchanged=scenario.unchanged_variants,
        )
        write_signals(result)
        result.evaluation = evaluate_result()
        run_cases = [case for case in cases if (case.variant, case.seed) in result.tables]
        if (result.folder / OPERATED).exists():
            add_operation(result, run_cases)
        else:
            add_notes(info, warning_notes(scenario, result.catalogs, result.tables))
        add_notes(info, scenario.replaced_values({variant for variant, _ in result.tables}))
        add_notes(info, condition_notes(run_cases, info.extra.get(OCCURRENCES, ())))
        if hardware is not None:
            info.extra = {**info.extra, "hardware": hardware.report()}
            add_notes(info, hardware.notes())
        write_summary_and_report(result, cases, report, hardware.pictures() if hardware is not None else [])
    except OSError as error:
        with suppress(OSError):
            journal.set_owners("")  # this process may continue, but does not finalize it
        raise SimulationError(describe_write_error(result, journal, error)) from error
    journal.remove()
    link_latest(result.folder)


def add_operation(result: RunResult, cases: Sequence[Case]) -> None:
    """Add score, warnings and verdict of an operator's session; targets and warnings count as requirements."""
    operation = dict[str, Any]()
    for case in cases:  # a session has one
        if (catalog := result.catalogs.get(case.variant)) is not None:
            operation = operator_result(result.scenario, catalog, result.tables[case.variant, case.seed])
    evaluation = result.evaluation
    requirements = (*evaluation.expectation_results, *operator_requirements(operation))
    result.evaluation = replace(evaluation, expectation_results=requirements)
    verdicts = [each.verdict for each in evaluation.metric_results]
    verdicts += [each.verdict for each in evaluation.expectation_results]
    verdicts += ["fail" if warning["duration"] else "pass" for warning in operation.get("warnings", ())]
    all_reached = not operation.get("targets", {}).get("missed")
    verdict = session_verdict(verdicts, all_reached, result.run.status == "completed")
    text = operation_text(operation)
    shown = [warning for warning in operation.get("warnings", ()) if warning["afterwards"] and not warning["duration"]]
    add_notes(result.run, [f"{WARNING}{warning['text']}{warning['afterwards']}" for warning in shown])
    result.run.extra = {**result.run.extra, "operation": {"verdict": verdict, "text": text, **operation}}


def describe_write_error(result: RunResult, journal: Journal, error: OSError) -> str:
    """Describe in one line why the folder could not be written, and the remedy."""
    prefix = f"{result.run.reason.splitlines()[0]} " if result.run.reason else ""
    if not journal.folder.exists():
        return f"{prefix}{result.folder}: has disappeared, and with it what was recorded. Run again."
    reason = os.strerror(error.errno) if error.errno else str(error)
    return (
        f"{prefix}{result.folder}: cannot be finished ({reason}). What was recorded is kept: free some space, then: "
        f"twin recover {result.folder}"
    )


def write_signals(result: RunResult) -> None:
    """Write signals.parquet atomically."""
    path = result.folder / "signals.parquet"
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with results.SignalFile(temporary, result.columns, {"scenario": result.scenario.name}) as file:
            for (variant, seed), signals in result.tables.items():
                for part in signals.parts():
                    file.write(variant, seed, part)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def write_summary_and_report(
    result: RunResult, cases: Sequence[Case], with_report: bool, pictures: Sequence[dict[str, str]] = ()
) -> None:
    """Write summary.json and report.html."""
    result.summary = results.build_summary(result.run, result.evaluation, result.tables, result.terminations)
    result.summary["sentence"] = fill_sentence(result.scenario.sentence, result.evaluation.metric_results)
    result.summary["overrides"] = [
        with_unit(each, result.scenario, result.catalogs)[0] for each in result.run.overrides
    ]
    if result.study_case is not None:
        result.summary["study"] = result.study_case.summary(result.folder, result.run.overrides)
    results.write_summary(result.folder / "summary.json", result.summary)
    if with_report:
        from twin.run import report_page, scenes
        from twin.run.event_table import event_rows
        from twin.run.recorded_views import reached_times, variant_views

        distinct = list({case.variant: case for case in cases}.values())
        reached = reached_times(result.run.extra.get("operation", {}))
        views = variant_views(result.scenario, distinct, result.catalogs, result.tables, reached)
        violations = find_violations(result.scenario.expectations, result.evaluation, result.tables)
        text = report_page.report_html(
            result.summary,
            result.evaluation,
            result.tables,
            plots=result.scenario.plots,
            parameters=parameter_rows(distinct, result.catalogs, str(result.scenario.path)),
            events=event_rows(distinct, result.summary.get(OCCURRENCES, ())),
            scenes=scenes.report_scenes(
                result.scenario.scenes, worst_seeds_first(result.tables, violations), views, violations
            ),
            pictures=pictures,
            terminations=result.terminations,
            structures=list(result.structures.items()),
            refinements=[refinement.table_cells for refinement in result.refinements],
            expectations=result.scenario.expectations,
            analyses=result.scenario.analyses,
            previous_values=result.scenario.previous_values(),
            folder=str(result.folder),
            default_folder=str(default_run(result.folder) or "") if result.run.overrides else "",
            progress=result.report_progress,
        )
        results.write_text(result.folder / "report.html", text)
