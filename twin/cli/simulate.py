"""`twin simulate`: simulate a single FMU and write its outputs."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from twin import clock
from twin.cli.options import timeout_option
from twin.cli.progress import ProgressBar
from twin.cli.terminal import say, show_elapsed, show_table
from twin.errors import FMUError, SimulationError
from twin.process import supervise

if TYPE_CHECKING:
    from twin.fmi import FMUMember, Results


@dataclass(frozen=True, kw_only=True, slots=True)
class SimulateOptions:
    """Options of `twin simulate`."""

    fmu: Path
    input: Path | None
    output: Path | None
    start_values: tuple[str, ...]
    start_time: str | None
    stop_time: str | None
    step_size: str | None
    output_interval: str | None
    record: tuple[str, ...]
    interface: str | None
    solver: str
    tolerance: float | None
    show_log: bool
    timeout: float


@click.command("simulate")
@click.argument("fmu", type=click.Path(path_type=Path), metavar="FMU")
@click.option(
    "--input",
    "-i",
    type=click.Path(path_type=Path),
    metavar="CSV",
    help="Inputs over time: column `time`, then variables; `x [mm]` converts units, `u[1]` is an element.",
)
@click.option(
    "--output",
    "-o",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Results, .csv or .parquet.  [default: FMU_out.csv]",
)
@click.option(
    "--start-value",
    "-s",
    "start_values",
    multiple=True,
    metavar="NAME=VALUE",
    help="Start value, e.g. m=0.2, A=[[1,2],[3,4]] or A[1,2]=5. Repeatable.",
)
@click.option("--start-time", metavar="S", help="Start of the simulation [s].  [default: of the FMU, or 0]")
@click.option("--stop-time", metavar="S", help="End of the simulation [s].  [default: of the FMU, or 1 s later]")
@click.option(
    "--step-size",
    metavar="S",
    help="Communication step [s], e.g. 0.001 or 1/30.  [default: of the FMU, or a 500th of the time]",
)
@click.option("--output-interval", metavar="S", help="Time between rows of the results [s].  [default: the step size]")
@click.option(
    "--record",
    "-r",
    multiple=True,
    metavar="NAME",
    help="Variable to record instead of the outputs; * matches any text. Repeatable.",
)
@click.option(
    "--interface",
    type=click.Choice(["co_simulation", "model_exchange", "scheduled_execution"]),
    default=None,
    help="FMI interface type.  [default: co_simulation, if available]",
)
@click.option(
    "--solver",
    default="",
    metavar="NAME",
    help="Model Exchange: Radau, BDF, RK45, RK23, DOP853, CVODE or ARKODE.  [default: Radau]",
)
@click.option(
    "--tolerance",
    type=click.FloatRange(0.0, min_open=True),
    metavar="X",
    help="Relative tolerance of the solver, or of the FMU's own.  [default: of the FMU; Model Exchange: or 1e-6]",
)
@click.option("--log", "show_log", is_flag=True, help="Enable logging of the FMU and show its last messages.")
@timeout_option("End the simulation when one step takes longer [s].  [default: no limit]")
def command(**options: Any) -> None:
    """Simulate an FMU alone (Co-Simulation, Model Exchange or Scheduled Execution) and write its outputs.

    The folder into which the FMU is unpacked is removed at the end.
    """
    simulate_fmu(SimulateOptions(**options))


def simulate_fmu(options: SimulateOptions) -> None:
    """Simulate an FMU in a supervised process and write its results."""
    link = supervise(options.timeout)
    from twin.fmi import csv_tables, left, plan, simulate

    name, target = options.fmu.stem, options.output or Path(f"{options.fmu.stem}_out.csv")
    csv_tables.check_output(target)
    with show_elapsed(f"reading {options.fmu.name}"):
        member = load_member(options)
    try:
        planned = plan(
            member,
            start=options.start_time,
            stop=options.stop_time,
            step=options.step_size,
            interval=options.output_interval,
            record=options.record,
        )
        with show_elapsed(f"reading {options.input}"):
            inputs = csv_tables.read_inputs(options.input, member) if options.input else None
        with ProgressBar("simulating", delay=1.0) as bar:
            show = partial(bar.show, bar.title) if bar.bar is not None else None
            outcome = (
                left(member, planned, link)
                if link.attempt
                else simulate(member, planned, inputs, progress=show, link=link)
            )
    finally:
        member.close()
        if options.show_log:
            for line in member.log:
                say(f"log: {line}", err=True)
    replaced = options.output is None and target.exists()
    csv_tables.write(outcome.results, target)
    for note in outcome.notes:
        say(f"note: {name}: {note}", err=True)
    report_results(outcome.results, target, replaced, with_summary=sys.stdout.isatty())
    if outcome.interrupted:
        raise KeyboardInterrupt
    if outcome.failure:
        hint = "" if options.show_log or member.log or link.attempt else " Use --log to see the FMU's messages."
        raise SimulationError(f"{outcome.failure}{hint} Results up to then are in {target}.")


def load_member(options: SimulateOptions) -> FMUMember:
    """Load the FMU with its start values."""
    from twin.fmi import member

    return member(
        options.fmu.stem,
        options.fmu,
        parse_start_values(options.start_values),
        interface=options.interface or "",
        solver=options.solver,
        tolerance=options.tolerance,
        logging=options.show_log,
    )


def report_results(results: Results, target: Path, replaced: bool, with_summary: bool) -> None:
    """Print the file and its extent, on request with a table of values."""
    if with_summary:
        summarize(results)
    rows = results.times
    say(
        f"{target}: {len(rows)} rows, {clock.seconds(rows[0]):g} s to {clock.seconds(rows[-1]):g} s"
        + " (replaced)" * replaced
    )


def parse_start_values(start_values: tuple[str, ...]) -> dict[str, str]:
    """Return `NAME=VALUE` arguments as a dict."""
    values: dict[str, str] = {}
    for text in start_values:
        name, separator, value = text.partition("=")
        if not separator or not name.strip():
            raise FMUError(f"--start-value {text!r}: expected NAME=VALUE, such as mass=0.2.")
        if name.strip() in values:
            raise FMUError(f"--start-value {name.strip()} is given twice. Give it once.")
        values[name.strip()] = value
    return values


def summarize(results: Results) -> None:
    """Print minimum, maximum and final value of every recorded number."""
    rows = []
    for name, variable, column in results.columns():
        is_text = variable.dtype.kind == "O"
        ends = ["", "", str(column[-1])] if is_text else [f"{x:.6g}" for x in (column.min(), column.max(), column[-1])]
        rows.append([name, *ends, variable.unit])
    show_table(["variable", "min", "max", "final", "unit"], rows, 1, texts=1)
