"""`twin resume RUN`: continue an interrupted run from its last checkpoint."""

from __future__ import annotations

from pathlib import Path

import click

from twin.cli.options import build_option, no_report_option, runs_option, timeout_option, verbose_option

json_option = click.option("--json", "as_json", is_flag=True, help="Print summary.json, and nothing else, on stdout.")


@click.command(name="resume")
@click.argument("folder", type=click.Path(path_type=Path), metavar="RUN")
@runs_option
@build_option
@json_option
@verbose_option
@no_report_option
@timeout_option("End a case when a step of a member takes longer [s].  [default: no limit]")
def command(
    folder: Path, runs: Path, build: Path, as_json: bool, verbose: bool, no_report: bool, timeout: float
) -> None:
    """Continue a run that was interrupted, killed or failed from its last checkpoints, to its end.

    RUN is its folder, runs/SCENARIO/TIME; the run was started with `twin run --checkpoint DURATION`. The result is a new
    run with everything that was recorded before, equal to the bit to a run without interruption. It is refused if the
    engine, a model or the scenario has changed.

    Exit code as of `twin run`.

    \b
    twin run heart_wall_ten_minutes --checkpoint 60s
    twin resume runs/heart_wall_ten_minutes/2026-11-22_08-14-00
    """
    continue_from(folder, runs, build, as_json, no_report, timeout, verbose, at=None, overrides=())


def continue_from(
    folder: Path,
    runs: Path,
    build: Path,
    as_json: bool,
    no_report: bool,
    timeout: float,
    verbose: bool = False,
    *,
    at: int | None,
    overrides: tuple[str, ...],
) -> None:
    """Continue a run in a supervised process, print the results and exit with the code of the outcome."""
    from twin.cli.run import RunProgress, report_outcome
    from twin.process import supervise

    link = supervise(timeout)
    from twin.results import resolve_latest
    from twin.run import RunCallbacks, RunOptions, continue_run, resume

    folder = resolve_latest(folder)
    display = RunProgress(folder.parent.name, enabled=not as_json)
    options = RunOptions(root=runs, build=build, report=not no_report)
    callbacks = RunCallbacks(progress=display.update, on_log_line=display.show_line)
    with display:
        if link.attempt:  # The process that continued it has died: its successor finalizes what it recorded.
            outcome = resume(Path(link.successor_values["resume"]), options, channel=link, callbacks=callbacks)
        else:
            outcome = continue_run(folder, options, at_ns=at, overrides=overrides, channel=link, callbacks=callbacks)
    report_outcome(outcome, as_json, not no_report, verbose)
