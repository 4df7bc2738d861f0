"""`twin study`: one scenario many times, with what varies; how often it holds, what drives it, what is worst or best."""

from __future__ import annotations

import shlex
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Self

import click

from twin.cli import completion
from twin.cli.terminal import bar, paper, say

if TYPE_CHECKING:
    from rich.table import Table

    from twin.study import Answers, StudyOutcome, StudyProgress

EVERY = 10.0  # between two lines where no bar is seen [s]
SHOWN = 8  # rows of what fails


@click.command(name="study")
@click.argument("file", type=click.Path(path_type=Path), metavar="STUDY", shell_complete=completion.studies)
@click.option(
    "--workers", type=click.IntRange(0, 1024), default=0, metavar="N", help="Processes. [default: one per core]"
)
@click.option("--scheduler", default="", metavar="ADDRESS", help="A dask scheduler instead, such as tcp://host:8786.")
@click.option("--resume", is_flag=True, help="Go on with the newest folder of this study.")
@click.option("--timeout", type=click.FloatRange(0.0), default=0.0, metavar="S",
              help="End a case that takes longer [s]. [default: 20 times the longest, at least 60]")  # fmt: skip
@click.option("--memory", type=click.FloatRange(0.0), default=0.0, metavar="GB",
              help="Of each process. [default: its part of the machine's]")  # fmt: skip
@click.option("--runs", type=click.Path(file_okay=False, path_type=Path), default=Path("runs"), show_default=True,
              help="Folder of results.")  # fmt: skip
@click.option("--build", type=click.Path(file_okay=False, path_type=Path), default=Path("build"), show_default=True,
              help="Folder of compiled code.")  # fmt: skip
@click.option("--no-report", is_flag=True, help="Write the tables alone.")
def command(
    file: Path, workers: int, scheduler: str, resume: bool, timeout: float, memory: float, runs: Path, build: Path,
    no_report: bool,
) -> None:  # fmt: skip
    """Run a scenario many times with values that vary; tell how its metrics spread, and why.

    Results go to runs/<study>/<time>/: cases.parquet, manifest.json, answers.json, report.html.
    Ctrl-C keeps what is done; --resume goes on. Exit code 1 if a case did not come to its end, 130 after Ctrl-C.

    \b
    twin study thousand_patients
    twin run --case thousand_patients:713     one of its cases, all signals
    """
    from twin.study import Answers, latest, load_study, run_study

    study = load_study(file)
    folder = latest(runs, study.name) if resume else None
    with Display(study.title) as display:
        outcome = run_study(
            study, root=runs, build=build, workers=workers, scheduler=scheduler, timeout=timeout, memory=int(memory * 1e9),
            resume=folder, listen=display, command=shlex.join(["twin", *sys.argv[1:]]), report=not no_report,
        )  # fmt: skip
    count = len(outcome.cases.rows)
    answers = Answers(outcome.cases) if count else None
    if answers is not None:
        show(outcome, answers)
        say(str(outcome.folder / ("cases.parquet" if no_report else "report.html")))
    if outcome.status == "interrupted":
        say(f"interrupted: {count} case{'s are' if count != 1 else ' is'} kept. Go on with --resume.", err=True)
        sys.exit(130)
    if answers is not None and answers.failed:
        sys.exit(1)


class Display:
    """A bar on a terminal, a line now and then elsewhere: rate, time left, failures so far. Both on stderr."""

    def __init__(self, title: str) -> None:
        self.title, self.last = title, 0.0

    def __enter__(self) -> Self:
        self.bar = bar(err=True) if sys.stderr.isatty() else None
        if self.bar is not None:
            self.bar.start()
            self.task = self.bar.add_task(self.title, total=1.0)
        return self

    def __call__(self, progress: StudyProgress) -> None:
        """Show how far it is."""
        text = told(progress)
        if self.bar is not None:
            self.bar.update(self.task, description=text, completed=progress.done / max(progress.count, 1))
        elif time.monotonic() - self.last >= EVERY or progress.done == progress.count:
            self.last = time.monotonic()
            say(text, err=True)

    def __exit__(self, *_: object) -> None:
        if self.bar is not None:
            self.bar.stop()


def told(progress: StudyProgress) -> str:
    """`sample: 713 of 4000, 9.1 a second, 6 min left, 2 failed`."""
    left = f"{progress.left:.0f} s" if progress.left < 90 else f"{progress.left / 60:.0f} min"
    return (
        f"{progress.part.partition(' ')[0]}: {progress.done} of {progress.count}, {progress.rate:.3g} a second, "
        f"{left} left, {progress.failed} failed"
    )


def show(outcome: StudyOutcome, answers: Answers) -> None:
    """What came out, in tables that fit 80 columns where names are short."""
    from rich import box
    from rich.table import Table

    from twin.study import percent

    study, console = outcome.study, paper()

    def table(*titles: str) -> Table:
        grid = Table(box=box.SIMPLE_HEAD, pad_edge=False, header_style="bold")
        for i, title in enumerate(titles):
            grid.add_column(title, justify="left" if i < 2 else "right", overflow="fold")
        return grid

    console.print(study.title, style="bold")
    if answers.changes:
        show_changes(answers, table("change", "metric", "from", "to"))
    elif answers.spreads:
        grid = table("metric", "variant", *(percent(one) for one in study.keys.quantiles), "most in case")
        for one in answers.spreads:
            quantiles = [answers.metric(one.metric, item.value) for item in one.quantiles]
            grid.add_row(one.metric, one.variant, *quantiles, str(one.most[0]))
        console.print(grid)
    if answers.shares:
        grid = table("expectation", "variant", "holds in", f"{percent(study.keys.confidence)} interval")
        for share in answers.shares:
            grid.add_row(share.name, share.variant, percent(share.part), answers.interval(share))
        console.print(grid)
    for cluster in answers.clusters[:SHOWN]:
        marks = ", ".join(f"{m.factor} {'high' if m.separation > 0 else 'low'}" for m in cluster.factors)
        number = len(cluster.cases)
        console.print(
            f"fails: {cluster.what} ({cluster.variant}): {number} case{'s' * (number > 1)}{f', {marks}' if marks else ''}, "
            f"such as {cluster.cases[0]}"
        )
    show_searched(outcome, answers)
    rate = (len(outcome.cases.rows) - outcome.before) / outcome.seconds if outcome.seconds else 0.0
    console.print(
        f"{len(outcome.cases.rows)} cases, {answers.failed} failed, {outcome.seconds:.0f} s, {rate:.3g} a second"
    )


def show_changes(answers: Answers, grid: Table) -> None:
    """One factor at a time: what each value changes."""
    for one in answers.changes:
        grid.add_row(
            answers.change(one), one.metric, answers.metric(one.metric, one.before), answers.metric(one.metric, one.now)
        )
    paper().print(grid)


def show_searched(outcome: StudyOutcome, answers: Answers) -> None:
    """The worst case, and what tuning found."""
    console, worst, tuned, keys = paper(), outcome.worst, outcome.tuned, outcome.study.keys.tune
    if worst is not None:
        console.print(
            f"worst: {worst.metric} of {worst.variant} {answers.metric(worst.metric, worst.value)} in case {worst.number}; by "
            f"chance {answers.metric(worst.metric, worst.sampled)}"
        )
    if tuned is None or keys is None:
        return
    if tuned.best is None:
        console.print(f"tuned: none of {len(tuned.trials)} trials keeps the limits")
        return
    values = ", ".join(
        f"{one.factor.name} {one.factor.shown(value)}"
        for one, value in zip(outcome.study.knobs, tuned.best.knobs, strict=True)
    )
    own, best = (answers.metric(keys.metric, one.objective) for one in tuned.unseen)
    console.print(f"tuned: {values}; {keys.of} of {keys.metric} on unseen samples {best}, as in the scenario {own}")
