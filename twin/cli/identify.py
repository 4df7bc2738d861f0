"""`twin identify`: recordings of a real machine to the parameters of a model of it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Self

import click

from twin.cli.terminal import bar, paper, say
from twin.errors import TwinError

if TYPE_CHECKING:
    from twin.identify import Result


@click.command(name="identify")
@click.argument("file", type=click.Path(path_type=Path), metavar="FILE")
@click.option(
    "--starts", type=click.IntRange(1, 10_000), default=8, show_default=True, help="Searches from other places."
)
@click.option(
    "--seed", type=click.IntRange(0, 2**31 - 1), default=0, show_default=True, help="Of the places, and of bootstrap."
)
@click.option("--intervals", type=click.Choice(("jacobian", "profile", "bootstrap")), default="jacobian", show_default=True,
              help="How confidence intervals are found; the later, the slower.")  # fmt: skip
@click.option("-o", "--output", type=click.Path(dir_okay=False, path_type=Path), metavar="SET.yaml",
              help="Parameter set to write; the report lies beside it. [default: FILE_parameters.yaml here]")  # fmt: skip
@click.option("--force", is_flag=True, help="Replace the files if they are there.")
@click.option("--no-report", is_flag=True, help="Write no report.")
@click.option("--build", type=click.Path(file_okay=False, path_type=Path), default=Path("build"), show_default=True,
              help="Folder of compiled code.")  # fmt: skip
def command(
    file: Path, starts: int, seed: int, intervals: str, output: Path | None, force: bool, no_report: bool, build: Path
) -> None:
    """Fit parameters of a component or a scenario to recorded files; write them as a parameter set.

    FILE says what is looked for, in which model, from which recordings. Ctrl-C keeps the best so far.
    Exit code 1 if the data do not tell an unknown, 130 after Ctrl-C; the files are written all the same.

    \b
    twin identify sheath.yaml
    twin identify sheath.yaml --starts 32 --intervals profile -o my_sheath.yaml
    """
    from twin.identify import command_line, html, identify, load
    from twin.results import write_text

    target = output or Path(f"{file.stem}_parameters.yaml")
    page = target.with_suffix(".html")
    for path in (target, *([] if no_report else [page])):
        if path.exists() and not force:
            raise TwinError(f"{path} is there already. Give --force to replace it, or another name with -o.")
    problem = load(file)
    with Display(problem.title) as progress:
        result = identify(
            problem, starts=starts, seed=seed, intervals=intervals, build=build, progress=progress,
            command=command_line(sys.argv[2:]),
        )  # fmt: skip
    write_text(target, result.text(target.parent))
    if not no_report:
        write_text(page, html(result))
    show(result)
    say(f"{target}: as the last of a scenario's `parameter_sets` it holds for every member of its components.")
    if not no_report:
        say(str(page))
    if result.found.interrupted:
        sys.exit(130)
    if not result.passed:
        sys.exit(1)


class Display:
    """A bar on a terminal, a line for each start elsewhere; with how good the best is. Both on stderr."""

    def __init__(self, title: str) -> None:
        self.title, self.before = title, ""

    def __enter__(self) -> Self:
        self.bar = bar(err=True) if sys.stderr.isatty() else None
        if self.bar is not None:
            self.bar.start()
            self.task = self.bar.add_task(self.title, total=1.0)
        return self

    def __call__(self, what: str, part: float, best: str) -> None:
        """Show how far it is."""
        if self.bar is not None:
            self.bar.update(self.task, description=f"{what}: {best}" if best else what, completed=part)
        elif what != self.before:
            say(what, err=True)
        self.before = what

    def __exit__(self, *_: object) -> None:
        if self.bar is not None:
            self.bar.stop()


def show(result: Result) -> None:
    """The values with their intervals, then what the person has to know."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    problem, console = result.problem, paper()
    console.print(problem.title, style="bold")
    grid = Table(box=box.SIMPLE_HEAD, pad_edge=False, header_style="bold")
    for title in ("unknown", "value", f"{100 * problem.keys.confidence:.4g} % interval", "identified"):
        grid.add_column(title, no_wrap=True, justify="left" if title in ("unknown", "identified") else "right")
    for i, one in enumerate(problem.unknowns):
        verdict = Text("NO", "bold red") if result.verdicts[i] else Text("yes", "green")
        grid.add_row(Text(one.name), one.shown(result.values[i]), result.interval_text(i), verdict)
    console.print(grid)
    for note in result.notes():
        console.print(f"note: {note}", soft_wrap=True)
    found = result.found
    rate = found.simulations / found.seconds if found.seconds else 0.0
    console.print(
        f"{found.agreeing} of {len(found.starts)} starts came to this; {found.simulations} simulations, "
        f"{rate:.0f} a second, {found.derivatives.partition(',')[0]}; RMS residual by noise {result.knowledge.residual:.3g}",
        soft_wrap=True,
    )
