"""`twin follow`: estimate states and parameters of a model from a recording, with their uncertainty."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from twin.cli.options import build_option, runs_option
from twin.cli.progress import ProgressBar
from twin.cli.terminal import make_table, open_console, say, show_text
from twin.errors import SimulationError

if TYPE_CHECKING:
    from twin.follow import Estimate, FollowProblem


@click.command(name="follow")
@click.argument("file", type=click.Path(path_type=Path), metavar="FILE")
@click.option(
    "--recording",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Recording to follow: CSV, MATLAB, Parquet or a run.  [default: that of `data` in FILE]",
)
@runs_option
@build_option
def command(file: Path, recording: Path | None, runs: Path, build: Path) -> None:
    """Follow a recording with a model: estimate states and parameters from measured signals, with standard deviations.

    FILE names the model, the recording, the measured signals with their noise, and what is estimated. The result is a run in
    runs/FILE/TIME/: estimates, deviations, innovations, and their normalized square (NIS) with its 95 % band.

    Exit code 1 if the model fails at a point of the filter, 130 after Ctrl-C; estimates up to then are written.

    \b
    twin follow mass.yaml
    twin follow mass.yaml --recording bench.csv && twin view runs/mass/latest
    """
    from twin.follow import follow, load, write_run
    from twin.results import link_latest

    problem = load(file, recording)
    begin, estimates = time.perf_counter(), []
    case = problem.experiment.case
    first, last = case.start_ns * 1e-9, case.stop_ns * 1e-9
    status, failure = "completed", ""
    try:
        with ProgressBar(problem.title) as display:
            for estimate in follow(problem, build):
                estimates.append(estimate)
                display.show(case.variant, float((estimate.time - first) / (last - first)))
    except KeyboardInterrupt:
        status, failure = "interrupted", f"interrupted after {len(estimates)} measurements"
    except SimulationError as error:
        status, failure = "failed", str(error)
    if not estimates:
        raise SimulationError(
            failure or f"{file}: no measured value lies after the start of the model. Check its times."
        )
    folder = write_run(problem, estimates, runs, time.perf_counter() - begin, failure, status)
    link_latest(folder)
    show(problem, estimates, folder)
    if failure:
        say(f"{status}: {failure}", err=True)
        sys.exit(130 if status == "interrupted" else 1)


def show(problem: FollowProblem, estimates: list[Estimate], folder: Path) -> None:
    """Print the last estimates, the notes and the consistency of the innovations."""
    from twin.follow import in_band, remarks
    from twin.results import format_value, si_conversion

    console, last = open_console(), estimates[-1]
    console.print(problem.title, style="bold")
    table = make_table("estimate", "value", "standard deviation", left=1)
    for variable, value, deviation in zip(problem.estimates, last.values, last.deviations, strict=True):
        factor, offset = si_conversion(variable.unit)
        shown = variable.display_unit or variable.unit
        table.add_row(
            variable.name,
            format_value(value * factor + offset, shown),
            format_value(deviation * factor, shown, is_difference=True),
        )
    console.print(table)
    for alarm in (estimate.alarm for estimate in estimates if estimate.alarm):
        show_text(
            f"{alarm.name}, since {alarm.onset:.1f} s, with a probability of {100 * alarm.probability:.1f} %; "
            f"noticed at {alarm.time:.1f} s",
            "change: ",
        )
    for note in (*problem.notes, *remarks(problem, estimates)):
        show_text(note, "note: ")
    show_text(
        f"{len(estimates)} times with measurements, {100 * in_band(estimates):.0f} % of them with NIS in its 95 % band. "
        f"Look: twin view {folder}"
    )
