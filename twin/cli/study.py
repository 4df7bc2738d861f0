"""`twin study`: run a Monte Carlo, sensitivity, worst-case or tuning study."""

from __future__ import annotations

import json
import os
import shlex
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import click

from twin.cli import completion
from twin.cli.options import build_option, no_report_option, runs_option, timeout_option
from twin.cli.progress import ProgressBar
from twin.cli.terminal import open_console, say, show_elapsed, show_outcome, show_table, show_text
from twin.errors import printable

if TYPE_CHECKING:
    from rich.console import Console

    from twin.study import Answers, Study, StudyOutcome, StudyProgress, TimeEstimate

INTERRUPTED = 130  # exit code
SAME_SIGNAL = 1.0  # further signals in this time are of the same request: of a terminal and of `timeout`, say [s]
CLEAR_LINE, SHOW_CURSOR = "\r\033[K", "\033[?25h"
LINE_INTERVAL = 10.0  # between two progress lines without a bar [s]
NOTHING = "nothing is finished, nothing is written"  # before the first case
WORST = "worst case"  # title of a column
MAX_FAILURES = 8  # groups of failed cases that are listed


@click.command(name="study")
@click.argument("file", type=click.Path(path_type=Path), metavar="STUDY", shell_complete=completion.studies)
@click.option(
    "--workers",
    type=click.IntRange(0, 1024),
    default=0,
    metavar="N",
    help="Number of processes.  [default: one per core]",
)
@click.option(
    "--scheduler",
    default="",
    metavar="ADDRESS",
    help="Use a dask scheduler, e.g. tcp://host:8786, instead of own processes.",
)
@click.option("--resume", is_flag=True, help="Continue the newest run of this study.")
@click.option("--check", "check_only", is_flag=True, help="Validate the study, run few cases and estimate its time.")
@click.option(
    "--require-pass",
    is_flag=False,
    flag_value="100 %",
    default="",
    metavar="[RATE]",
    help="Fail if the pass rate of a requirement is below RATE, e.g. '95 %'.  [without RATE: 100 %]",
)
@timeout_option("Time limit of a case [s].  [default: 20 times the longest, at least 60]")
@click.option(
    "--memory",
    type=click.FloatRange(0.0),
    default=0.0,
    metavar="GB",
    help="Memory limit of each process.  [default: an equal share of the machine's]",
)
@runs_option
@build_option
@no_report_option
def command(
    file: Path,
    workers: int,
    scheduler: str,
    resume: bool,
    check_only: bool,
    require_pass: str,
    timeout: float,
    memory: float,
    runs: Path,
    build: Path,
    no_report: bool,
) -> None:
    """Run a study: many cases of a scenario with varied parameters.

    Results go to runs/STUDY/TIME/: cases.parquet, manifest.json, answers.json, report.html.

    Ctrl-C keeps the completed cases; --resume continues. Exit code 1 if a case did not finish or a pass rate is below that
    of --require-pass, 130 after Ctrl-C.

    --check writes no results: it reports all mistakes of the file at once, builds the members (in build/) and runs three
    cases of each variant. `twin check STUDY` compiles and runs nothing.

    \b
    twin study thousand_patients --check
    twin study thousand_patients
    twin study thousand_patients --require-pass '95 %'
    twin run --case thousand_patients:713     repeat one case, with all signals
    """
    required = required_rate(require_pass)
    say(f"reading {file} ...", err=True)  # at once: what follows takes seconds
    from twin.study import Answers, is_complete, latest, load_study, run_study

    study = load_study(file)
    if check_only:
        from twin.study import estimate_time, unreached_windows

        with show_elapsed("running three cases of each variant"):
            estimate = estimate_time(study, build=build, workers=workers)
        show_estimate(study, estimate)
        for note in unreached_windows(study):
            say(f"note: {note}")
        sys.exit(1 if estimate.failures else 0)
    folder = latest(runs, study.name) if resume else None
    if folder is not None and is_complete(study, folder):
        say(f"{study.title}: already complete, nothing run. Results: {folder}")
        sys.exit(bool(required) and fails_gate(stored_rates(folder), required))
    line = shlex.join(["twin", *sys.argv[1:]])
    file_name = "cases.parquet" if no_report else "report.html"
    with StudyDisplay(study.title, f"{line}{' --resume' * (not resume)}", file_name) as display:
        outcome = run_study(
            study,
            root=runs,
            build=build,
            workers=workers,
            scheduler=scheduler,
            timeout=timeout,
            memory=int(memory * 1e9),
            resume=folder,
            listen=display.update,
            notify=display.acknowledge_signal,
            command=line,
            report=not no_report,
        )
    count = len(outcome.cases.rows)
    answers, is_below = Answers(outcome.cases) if count else None, False
    if answers is not None:
        named = show(outcome, answers)
        rates = [(rate.name, rate.variant, rate.part) for rate in answers.shares]
        is_below = required > 0.0 and outcome.status == "completed" and fails_gate(rates, required)
        show_verdict(outcome, answers, file_name, named, is_below=is_below)
    if outcome.status == "interrupted":
        cases = f"{count} finished case{'s are' if count != 1 else ' is'} kept" if count else "no case is finished"
        say(f"interrupted: {cases}. Continue: {display.resume}", err=True)
        sys.exit(INTERRUPTED)
    if answers is not None and (answers.failed or is_below):
        sys.exit(1)


def required_rate(text: str) -> float:
    """Return the pass rate of `--require-pass`, 0 without one."""
    try:
        rate = float(text.rstrip().removesuffix("%")) / (100.0 if text.rstrip().endswith("%") else 1.0) if text else 0.0
    except ValueError:
        rate = -1.0
    if text and not 0.0 < rate <= 1.0:
        raise click.UsageError(f"--require-pass: {text!r} is no pass rate. Give one such as '95 %', after the study.")
    return rate


def stored_rates(folder: Path) -> list[tuple[str, str, float]]:
    """Return requirement, variant and pass rate of a study that has run, from its answers.json."""
    try:
        answers = json.loads((folder / "answers.json").read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise click.ClickException(f"{folder}: has no answers.json. Run the study again without --no-report.") from None
    return [(rate["name"], rate["variant"], rate["part"]) for rate in answers["expectations"]]


def fails_gate(rates: list[tuple[str, str, float]], required: float) -> bool:
    """Whether a pass rate is below the required one, or none is known; each of them is printed."""
    from twin.study import percent

    below = [(name, variant, part) for name, variant, part in rates if part < required]
    for name, variant, part in below:
        show_text(f"{name} ({variant}): pass rate {percent(part)}, required {percent(required)}", "below: ")
    if not rates:
        say("below: no requirement is judged, so that none can pass")
    return bool(below) or not rates


class StudyDisplay(ProgressBar):
    """Progress of a study: a bar on a terminal, a line every 10 s elsewhere; both on stderr."""

    def __init__(self, title: str, resume: str, file_name: str = "report.html") -> None:
        super().__init__(title)
        self.resume = resume  # command that continues the study
        self.file_name = file_name
        self.folder: Path | None = None
        self.last_line = -LINE_INTERVAL
        self.signal_time = 0.0  # of the first signal
        self.summary = NOTHING
        self.phase = ""

    def __enter__(self) -> Self:
        super().__enter__()
        self.show(self.title, 0.0)
        if self.bar is None:
            say(self.title, err=True)
        return self

    def update(self, progress: StudyProgress) -> None:
        """Show cases, remaining time and failures so far."""
        from twin.study import progress_text

        if self.folder is None and progress.folder is not None:
            self.folder = progress.folder
            say(f"results: {self.folder / self.file_name}", err=True)
        text = progress_text(progress)
        if progress.done:
            self.summary = f"{progress.done} of {progress.count} cases are kept"
        self.show(text, progress.fraction)
        is_end = progress.done == progress.count and not progress.phase
        before, self.phase = self.phase, progress.phase.partition(" ")[0]
        is_new = self.phase not in ("", before)
        if self.bar is None and (time.monotonic() - self.last_line >= LINE_INTERVAL or is_end or is_new):
            self.last_line = time.monotonic()
            say(text, err=True)

    def acknowledge_signal(self) -> None:
        """Say at once, in the signal handler, what a signal does; the second one ends the process: all cases are on disk."""
        now, is_first = time.monotonic(), not self.signal_time
        if not is_first and now - self.signal_time < SAME_SIGNAL:
            return
        self.signal_time = self.signal_time or now
        text = (
            f"interrupted: {self.summary}{', tables and report are being written' * (self.summary != NOTHING)}. Ctrl-C again: end at once. "
            if is_first
            else f"ended at once: {self.summary}. "
        )
        # not by `say`: the handler may have interrupted a write
        codes = (CLEAR_LINE + SHOW_CURSOR * (not is_first)) * (self.bar is not None)
        os.write(2, f"{codes}{printable(f'{text}Continue: {self.resume}')}\n".encode())
        if not is_first:
            os._exit(INTERRUPTED)


def show_estimate(study: Study, estimate: TimeEstimate) -> None:
    """Print the extent of a study and what it will take."""
    say(extent(study))
    if study.keys.samples.seeds == "own":
        say(
            f"Seeds of the noise come from the file's name: a copy not named {study.path.name} has others, "
            "unless `samples: {seeds: [1]}` states them."
        )
    rows = [[name, f"{count:,}", f"{estimate.seconds[name]:.3g} s"] for name, count in estimate.counts.items()]
    show_table(["variant", "cases", "time of a case"], rows, 1)
    for why in estimate.failures:
        say(f"did not finish: {why}")
    from twin.study import duration_text, finishing_time

    case, keep = max(estimate.seconds.values()), min(study.keys.keep.failed, study.count)
    least, most = (finishing_time(study, failing, case) for failing in (0, study.count))
    first = estimate.preparation + estimate.cases
    ends = [duration_text(first + end) for end in (least, most)]
    keeping = f", up to {duration_text(most - least)} to run {keep} cases that fail again with all signals" * bool(keep)
    say(
        f"In all {' to '.join(dict.fromkeys(ends))} with {estimate.workers} process{'es' * (estimate.workers > 1)}: "
        f"{duration_text(estimate.preparation)} to begin, {duration_text(estimate.cases)} for the cases, "
        f"{duration_text(least)} for the report{keeping}."
    )


def extent(study: Study) -> str:
    """Return `4,000 cases (1,000 samples x 4 variants), 400 more of worst case and tuning; 17 factors, sobol`."""
    samples, variants, seeds = len(study.design.values), len(study.variants), len(study.seeds(1))
    parts = [f"{samples:,} sample{'s' * (samples > 1)}"]
    parts += [f"{count} {word}s" for count, word in ((variants, "variant"), (seeds, "seed")) if count > 1]
    searched = sum(study.searched_cases.values())
    more = f", {searched:,} more of worst case and tuning" if searched else ""
    method = study.design.method.replace("_", " ")
    return f"{study.count:,} cases ({' x '.join(parts)}){more}; {len(study.factors)} factors, {method}"


def show(outcome: StudyOutcome, answers: Answers) -> int | None:
    """Print the results as tables and sentences; return the number of the first case that a sentence names."""
    from twin.study import headline

    console = open_console()
    console.print(outcome.study.title, style="bold")
    if answers.changes:
        show_changes(answers)
    elif answers.spreads:
        show_distributions(answers, console)
    if answers.shares:
        show_pass_rates(outcome, answers)
    sentences = headline(answers, outcome.worst, outcome.tuned)
    named = {sentence.case for sentence in sentences}
    is_said = all(not named.isdisjoint(cluster.cases) and not cluster.factors for cluster in answers.clusters)
    for cluster in () if is_said else answers.clusters[:MAX_FAILURES]:  # all groups: else their counts and rates differ
        factors = ", ".join(f"{mark.factor} {mark.side}" for mark in cluster.factors)
        number = len(cluster.cases)
        console.print(
            f"fails: {cluster.what} ({cluster.variant}): {number} case{'s' * (number > 1)}{f', {factors}' if factors else ''}, "
            f"such as case {cluster.cases[0]}"
        )
    if len(answers.clusters) > MAX_FAILURES:
        console.print(f"fails: {len(answers.clusters) - MAX_FAILURES} more groups, in the report")
    width, topic = max((len(sentence.topic) + 2 for sentence in sentences), default=0), ""
    for sentence in sentences:
        label = sentence.topic if sentence.topic != topic else ""
        topic = sentence.topic
        show_text(sentence.text.replace(" %", "\N{NO-BREAK SPACE}%"), f"{label:<{width}}", "bold")
    return next((sentence.case for sentence in sentences if sentence.case is not None), None)


def show_verdict(
    outcome: StudyOutcome, answers: Answers, file: str, named: int | None = None, *, is_below: bool = False
) -> None:
    """Print the last line: the verdict, the number of cases, the computing time, and where to look.

    `named`: the case to look at; by default the first one that was kept, or that failed. `is_below`: whether a pass rate is
    below the required one.
    """
    from twin.study import open_command

    count = len(outcome.cases.rows)
    rates = [rate.part for rate in answers.shares]
    passes = bool(rates) and min(rates) == 1.0
    word = "FAIL" if answers.failed or is_below else "PASS" if passes else "DONE"
    word = word if outcome.status == "completed" else outcome.status.upper()
    name = outcome.study.name if outcome.folder.parent.parent == Path("runs") else str(outcome.folder)
    failing = [cluster.cases[0] for cluster in answers.clusters]
    number = named or next(iter([*outcome.runs, *failing, 1]))
    look = open_command(name, number, outcome.runs)
    seconds = f"{outcome.seconds:.3g} s" if outcome.seconds < 100 else f"{outcome.seconds:.0f} s"
    of_total = f" of {outcome.study.total}" if outcome.status == "interrupted" else ""
    now = f", {count - outcome.before} of them now" if outcome.before else ""
    show_outcome(word, f"{count}{of_total} cases{now} in {seconds}.", outcome.folder / file, look)


def show_distributions(answers: Answers, console: Console) -> None:
    """Print quantiles of the metrics, in the layouts of `twin run` for any width."""
    from twin.run import MetricTable

    quantiles, rows = answers.part_names, []
    for spread in answers.spreads:
        values = [answers.metric(spread.metric, value) for value in answers.quantiles(spread)]
        worst = str(spread.worst) if answers.study.metrics[spread.metric].has_worst else "-"
        numbers = {**dict(zip(quantiles, values, strict=True)), WORST: worst}
        rows.append({"metric": spread.metric, "variant": spread.variant, "paper": "-", "verdict": "info", **numbers})
    table = MetricTable(rows)
    table.titles = {title: title for title in (*quantiles, WORST)}
    console.print(table)


def show_pass_rates(outcome: StudyOutcome, answers: Answers) -> None:
    """Print in how many cases each expectation is met; those that all cases meet in one line."""
    from twin.study import percent

    interval = f"{percent(outcome.study.keys.confidence)} confidence"
    has_intervals = any(map(answers.interval, answers.shares))
    below = [share for share in answers.shares if share.part < 1.0]
    rows = [
        [share.name, share.variant, percent(share.part), *[answers.interval(share)] * has_intervals] for share in below
    ]
    show_table(["requirement", "variant", "pass rate", *[interval] * has_intervals], rows, 2)
    if met := [share for share in answers.shares if share.part == 1.0]:
        missed = {share.name for share in below}
        names = dict.fromkeys(f"{own.name} ({own.variant})" if own.name in missed else own.name for own in met)
        least = f" ({interval}: at least {percent(min(own.low for own in met))})" if has_intervals else ""
        show_text(f"{'; '.join(names)}{least}".replace(" %", "\N{NO-BREAK SPACE}%"), "Pass rate 100 %: ")


def show_changes(answers: Answers) -> None:
    """Print the effects of one factor at a time."""
    rows = [
        [answers.change(each), each.metric, *(answers.metric(each.metric, value) for value in (each.before, each.now))]
        for each in answers.changes
    ]
    show_table(["change", "metric", "from", "to"], rows, 2)


def show_study(path: Path, text: str) -> bool:
    """Print the title of a study, what varies, and how to run it."""
    from twin.cli.describe import say_lines
    from twin.scenario import read

    keys = read(path, str(path)).plain()
    show_text(f"{path}: {keys.get('title', 'study')}")
    if not text:
        say_lines(str(keys.get("description", "")))
    samples = ", ".join(f"{key} {value}" for key, value in keys.get("samples", {}).items())
    say(f"Scenario: {Path(str(keys['scenario'])).stem}" + f"; samples: {samples}" * bool(samples))
    knobs = keys.get("tune", {}).get("knobs", {})
    rows = [(name, spread_text(factor)) for name, factor in keys.get("vary", {}).items()]
    rows += [(name, f"tuned, {spread_text(factor)}") for name, factor in knobs.items()]
    shown = show_table(("varies", "how"), [row for row in rows if text in " ".join(row)], 2)
    say(f"Run it: twin study {path.stem}")
    say(f"How long it takes: twin study {path.stem} --check")
    return shown


def spread_text(factor: dict[str, Any]) -> str:
    """Return how a factor is distributed: `normal 75 /min, 13 /min; from 48 /min`."""
    texts = [
        f"{key.replace('_', '-')} {', '.join(map(str, value)) if isinstance(value, list) else value}"
        for key, value in factor.items()
        if key != "source"
    ]
    return "; ".join(texts)
