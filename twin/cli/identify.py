"""`twin identify`: fit the parameters of any model to recorded data."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from twin.cli.options import build_option, force_option, no_report_option, refuse_existing, restart_options
from twin.cli.progress import ProgressBar
from twin.cli.terminal import make_table, open_console, say

if TYPE_CHECKING:
    from twin.identify import Result


@click.command(name="identify")
@click.argument("file", type=click.Path(path_type=Path), metavar="FILE")
@restart_options
@click.option(
    "--intervals",
    type=click.Choice(("jacobian", "profile", "bootstrap")),
    default="jacobian",
    show_default=True,
    help="Method for confidence intervals, from fastest (jacobian) to slowest (bootstrap).",
)
@click.option(
    "--output",
    "-o",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE.yaml",
    help="Parameter set to write; the report has the same name.  [default: FILE_parameters.yaml]",
)
@force_option
@no_report_option
@build_option
def command(
    file: Path, starts: int, seed: int, intervals: str, output: Path | None, force: bool, no_report: bool, build: Path
) -> None:
    """Fit parameters of a component or a scenario to recorded data; write them as a parameter set.

    FILE names the unknowns, the model and the recordings (CSV or CAN traces). Ctrl-C writes the best fit so far.

    Exit code 1 if an unknown cannot be determined from the data, 130 after Ctrl-C; the files are written in each case.

    \b
    twin identify sheath.yaml
    twin identify sheath.yaml --starts 32 --intervals profile -o my_sheath.yaml
    """
    from twin.identify import command_line, html, identify, load
    from twin.results import write_text

    target = output or Path(f"{file.stem}_parameters.yaml")
    page = target.with_suffix(".html")
    for path in (target, *([] if no_report else [page])):
        refuse_existing(path, force)
    problem = load(file)
    with IdentifyProgress(problem.title) as display:
        result = identify(
            problem,
            starts=starts,
            seed=seed,
            intervals=intervals,
            build=build,
            progress=display.update,
            command=command_line(sys.argv[2:]),
        )
    write_text(target, result.text(target.parent))
    if not no_report:
        write_text(page, html(result))
    show(result)
    say(f"{target}: list it last in `parameter_sets` of a scenario to use it for all members of its components.")
    if not no_report:
        say(str(page))
    if result.fit.interrupted:
        sys.exit(130)
    if not result.passed:
        sys.exit(1)


class IdentifyProgress(ProgressBar):
    """Progress of the search: a bar on a terminal, one line per restart elsewhere; both on stderr."""

    phase = ""

    def update(self, phase: str, fraction: float, best: str) -> None:
        """Show the phase, its progress and the best fit so far."""
        self.show(f"{phase}: {best}" if best else phase, fraction)
        if self.bar is None and phase != self.phase:
            say(phase, err=True)
        self.phase = phase


def show(result: Result) -> None:
    """Print the values with their intervals, the notes and the quality of the fit."""
    from rich.text import Text

    problem, console = result.problem, open_console()
    console.print(problem.title, style="bold")
    table = make_table("unknown", "value", f"{100 * problem.keys.confidence:.4g} % interval", "identified", left=1)
    table.columns[-1].justify = "left"
    for column in table.columns:
        column.no_wrap = True
    for i, unknown in enumerate(problem.unknowns):
        verdict = Text("NO", "bold red") if result.verdicts[i] else Text("yes", "green")
        table.add_row(Text(unknown.name), unknown.shown(result.values[i]), result.interval_text(i), verdict)
    console.print(table)
    for note in result.notes():
        console.print(f"note: {note}", soft_wrap=True)
    search = result.fit
    rate = search.simulations / search.seconds if search.seconds else 0.0
    console.print(
        f"{search.agreeing} of {len(search.starts)} starts agree; {search.simulations} simulations, "
        f"{rate:.0f} per second, {search.derivatives.partition(',')[0]}; "
        f"RMS residual relative to noise {result.knowledge.residual:.3g}",
        soft_wrap=True,
    )
