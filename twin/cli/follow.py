"""`twin follow`: estimate states and parameters of a model from a recording or a running rig, with their uncertainty."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from twin.cli.follow_page import PageOptions, serve
from twin.cli.options import build_option, duration_option, no_open_option, port_option, runs_option
from twin.cli.progress import ProgressBar
from twin.cli.terminal import open_console, say, show_table, show_text
from twin.errors import SimulationError
from twin.installed import import_optional

if TYPE_CHECKING:
    from collections.abc import Sequence

    from twin import clock
    from twin.follow import Alarm, Estimate, FollowProblem


@click.command(name="follow")
@click.argument("file", type=click.Path(path_type=Path), metavar="FILE")
@click.option(
    "--recording",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Recording to follow: CSV, MATLAB, Parquet or a run.  [default: that of `data` in FILE]",
)
@click.option(
    "--rig",
    metavar="ADDRESS|FILE",
    help="Rig to follow live: where its JSON messages arrive, udp://HOST:PORT, mqtt://BROKER/TOPIC or zenoh://ROUTER/TOPIC, or a file of its sources.  "
    "[default: that of `rig` in FILE]",
)
@duration_option("--duration", "End after this time of a rig, e.g. 60s.  [default: Ctrl-C]")
@click.option(
    "--console",
    is_flag=True,
    help="Show estimates, bands, changes and forecasts on a page of the browser until Ctrl-C.",
)
@port_option(1024)
@no_open_option
@runs_option
@build_option
def command(
    file: Path,
    recording: Path | None,
    rig: str | None,
    duration: clock.Time,
    console: bool,
    port: int | None,
    no_open: bool,
    runs: Path,
    build: Path,
) -> None:
    """Follow a recording or a running rig with a model: estimate states and parameters, with standard deviations.

    FILE names the model, the recording or rig, the measured signals with their noise, and what is estimated. The result is a run
    in runs/FILE/TIME/: estimates, deviations, innovations, and their normalized square (NIS) with its 95 % band.

    A rig is only received. Ctrl-C ends following it; estimates are written while they arrive.

    Exit code 1 if the model fails at a point of the filter or a rig is lost and the file says stop, 130 after Ctrl-C in a
    recording; estimates up to then are written.

    \b
    twin follow mass.yaml
    twin follow mass.yaml --recording bench.csv && twin view runs/mass/latest
    twin follow mass.yaml --rig udp://127.0.0.1:4710 --console
    """
    from twin.follow import has_rig

    page = PageOptions(port, no_open) if console else None
    if console:
        import_optional("nicegui", "console", "twin follow --console")
    elif port is not None or no_open:
        raise click.UsageError("--port and --no-open are for a page. Add --console.")

    if rig is not None and recording is not None:
        raise click.UsageError("--rig and --recording exclude each other. Drop one of them.")
    if rig is not None or (recording is None and has_rig(file)):
        from twin.cli.follow_live import follow_live

        return follow_live(file, rig, duration, runs, build, page)
    if duration:
        raise click.UsageError("--duration is for a rig. A recording has its own end.")
    return follow_recording(file, recording, runs, build, page)


def follow_recording(
    file: Path, recording: Path | None, runs: Path, build: Path, page: PageOptions | None = None
) -> None:
    """Follow a recording, write the run and print the result; with `page` show it in the browser until Ctrl-C."""
    from twin.follow import follow, in_band, load, write_run
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
    alarms = [estimate.alarm for estimate in estimates if estimate.alarm]
    show(problem, estimates, alarms, f"{len(estimates)} times with measurements", in_band(estimates), folder)
    if failure:
        say(f"{status}: {failure}", err=True)
        sys.exit(130 if status == "interrupted" else 1)
    if page is not None:
        serve(folder, page.port, say, open_browser=not page.no_open)


def show(
    problem: FollowProblem,
    estimates: Sequence[Estimate],
    alarms: Sequence[Alarm],
    count: str,
    fraction: float,
    folder: Path,
) -> None:
    """Print the last estimates, the notes and the consistency of the innovations. `fraction`: of NIS in its band."""
    from twin.follow import remarks
    from twin.results import format_value, si_conversion

    last = estimates[-1]
    open_console().print(problem.title, style="bold")
    rows = []
    for variable, value, deviation in zip(problem.estimates, last.values, last.deviations, strict=True):
        factor, offset = si_conversion(variable.unit)
        shown = variable.display_unit or variable.unit
        spread = format_value(deviation * factor, shown, is_difference=True)
        rows.append([variable.name, format_value(value * factor + offset, shown), spread])
    show_table(["estimate", "value", "standard deviation"], rows, 1)
    for alarm in alarms:
        show_text(
            f"{alarm.name}, since {alarm.onset:.1f} s, with a probability of {100 * alarm.probability:.1f} %; "
            f"noticed at {alarm.time:.1f} s",
            "change: ",
        )
    for note in (*problem.notes, *remarks(problem, estimates)):
        show_text(note, "note: ")
    show_text(f"{count}, {100 * fraction:.0f} % of them with NIS in its 95 % band. Look: twin view {folder}")
