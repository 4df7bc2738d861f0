"""`twin simulate`: run any FMU alone and write its outputs."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from twin import clock
from twin.cli.terminal import bar, paper, say, working
from twin.errors import FMUError, SimulationError
from twin.process import supervise

if TYPE_CHECKING:
    from collections.abc import Callable

    from rich.progress import Progress

    from twin.fmi import Results

PATIENCE = 1.0  # a bar appears after this time [s]


class Bar:
    """A progress bar that appears only when a run takes long."""

    def __init__(self, title: str = "simulating") -> None:
        self.title = title
        self.began = time.monotonic()
        self.progress: Progress | None = None

    def __call__(self, share: float) -> None:
        """Show how far the run is."""
        if self.progress is None:
            if time.monotonic() - self.began < PATIENCE:
                return
            self.progress = bar()
            self.task = self.progress.add_task(self.title, total=1.0)
            self.progress.start()
        self.progress.update(self.task, completed=share)

    def close(self) -> None:
        """Remove the bar."""
        if self.progress is not None:
            self.progress.stop()


@click.command("simulate", short_help="Run any FMU alone and write its outputs.")
@click.argument("fmu", type=click.Path(path_type=Path))
@click.option(
    "--input",
    "-i",
    "input_",
    type=click.Path(path_type=Path),
    metavar="CSV",
    help="Inputs over time: column `time`, then names; `x [mm]` converts, `u[1]` is an element.",
)
@click.option(
    "--output",
    "-o",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Results, .csv or .parquet. [default: FMU_out.csv here]",
)
@click.option(
    "--start-value",
    "-s",
    "start_values",
    multiple=True,
    metavar="NAME=VALUE",
    help="Value before the run: `m=0.2`, `A=[[1,2],[3,4]]`, `A[1,2]=5`. May be repeated.",
)
@click.option("--start-time", metavar="S", help="[default: as the FMU suggests, or 0]")
@click.option("--stop-time", metavar="S", help="[default: as the FMU suggests, or 1 s later]")
@click.option(
    "--step-size", metavar="S", help="Such as 0.001 or 1/30. [default: as the FMU suggests, or at least 500 steps]"
)
@click.option("--output-interval", metavar="S", help="Time between rows. [default: the step size]")
@click.option(
    "--record",
    "-r",
    multiple=True,
    metavar="NAME",
    help="Variable to record instead of the outputs; * matches any text. May be repeated.",
)
@click.option("--interface", type=click.Choice(["co_simulation", "model_exchange", "scheduled_execution"]), default=None,
              help="[default: Co-Simulation, if the FMU has it]")  # fmt: skip
@click.option("--solver", default="", metavar="NAME",
              help="Of Model Exchange: Radau, BDF, RK45, RK23, DOP853; CVODE, ARKODE. [default: Radau]")  # fmt: skip
@click.option("--tolerance", type=click.FloatRange(0.0, min_open=True), metavar="RELATIVE",
              help="Of Model Exchange. [default: as the FMU suggests, or 1e-6]")  # fmt: skip
@click.option("--log", "show_log", is_flag=True, help="Let the FMU log, and show its last lines.")
@click.option("--timeout", type=click.FloatRange(0.0), default=0.0, metavar="S",
              help="End it where one step takes longer [s]. [default: never]")  # fmt: skip
def command(
    *,
    fmu: Path,
    input_: Path | None,
    output: Path | None,
    start_values: tuple[str, ...],
    start_time: str | None,
    stop_time: str | None,
    step_size: str | None,
    output_interval: str | None,
    record: tuple[str, ...],
    interface: str | None,
    solver: str,
    tolerance: float | None,
    show_log: bool,
    timeout: float,
) -> None:
    """Run the FMU (FMI 2.0 or 3.0; Co-Simulation, Model Exchange or Scheduled Execution) alone and write its outputs.

    The folder it is unpacked to is removed at the end.
    """
    link = supervise(timeout)
    from twin.fmi import csv_tables, left, plan, simulate
    from twin.fmi import member as made

    target = output or Path(f"{fmu.stem}_out.csv")
    csv_tables.check_output(target)
    with working(f"reading {fmu.name}"):
        member = made(
            fmu.stem, fmu, parsed(start_values), interface=interface or "", solver=solver, tolerance=tolerance,
            logging=show_log,
        )  # fmt: skip
    shown = Bar() if sys.stdout.isatty() else None
    try:
        planned = plan(
            member, start=start_time, stop=stop_time, step=step_size, interval=output_interval, record=record
        )
        with working(f"reading {input_}"):
            inputs = csv_tables.read_inputs(input_, member) if input_ else None
        outcome = (
            left(member, planned, link)
            if link.attempt
            else simulate(member, planned, inputs, progress=shown, link=link)
        )
    finally:
        member.close()
        if shown:
            shown.close()
        if show_log:
            for line in member.log:
                say(f"log: {line}", err=True)
    replaced = output is None and target.exists()
    csv_tables.write(outcome.results, target)
    told(fmu.stem, outcome.notes, outcome.results, target, replaced, in_full=shown is not None)
    if outcome.interrupted:
        raise KeyboardInterrupt
    if outcome.failure:
        hint = "" if show_log or member.log or link.attempt else " Use --log to see what it logs."
        raise SimulationError(f"{outcome.failure}{hint} What was recorded until then is in {target}.")


def told(name: str, notes: list[str], results: Results, target: Path, replaced: bool, in_full: bool) -> None:
    """Print what was simulated and where it lies."""
    for note in notes:
        say(f"note: {name}: {note}", err=True)
    if in_full:
        summarize(results)
    rows = results.times
    say(
        f"{target}: {len(rows)} rows, {clock.seconds(rows[0]):g} s to {clock.seconds(rows[-1]):g} s"
        + " (replaced)" * replaced
    )


def parsed(start_values: tuple[str, ...]) -> dict[str, str]:
    """`NAME=VALUE` arguments as a table."""
    values: dict[str, str] = {}
    for text in start_values:
        name, found, value = text.partition("=")
        if not found or not name.strip():
            raise FMUError(f"--start-value {text!r}: expected NAME=VALUE, such as mass=0.2.")
        if name.strip() in values:
            raise FMUError(f"--start-value {name.strip()} is given twice. Give it once.")
        values[name.strip()] = value
    return values


def summarize(results: Results) -> None:
    """Print smallest, largest and last value of every recorded number."""
    from rich.table import Table

    table = Table(box=None)
    table.add_column("variable", overflow="fold")
    for title in ("min", "max", "final"):
        table.add_column(title, justify="right", overflow="fold")
    table.add_column("unit", overflow="fold")
    for name, variable, column in results.columns():
        show: Callable[[Any], str] = str if variable.dtype.kind == "O" else lambda value: f"{value:.6g}"
        ends = ("", "") if variable.dtype.kind == "O" else (show(column.min()), show(column.max()))
        table.add_row(name, *ends, show(column[-1]), variable.unit)
    paper().print(table)
