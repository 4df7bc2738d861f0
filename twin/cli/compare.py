"""`twin compare`: compare two runs."""

from __future__ import annotations

import sys
from fnmatch import fnmatchcase
from pathlib import Path

import click

from twin.cli.options import signal_option
from twin.cli.terminal import make_table, open_console, say

MAX_LISTED = 20  # signals without --all


@click.command(name="compare")
@click.argument("first", type=click.Path(path_type=Path), metavar="RUN")
@click.argument("second", type=click.Path(path_type=Path), metavar="RUN")
@click.option(
    "--tolerance",
    type=click.FloatRange(0.0),
    default=1e-9,
    show_default=True,
    metavar="X",
    help="Allowed difference of a signal, relative to its largest magnitude; 0: none.",
)
@signal_option
@click.option("--all", "everything", is_flag=True, help=f"List all differing signals, not only {MAX_LISTED}.")
def command(first: Path, second: Path, tolerance: float, patterns: tuple[str, ...], everything: bool) -> None:
    """Compare two runs: signals sample by sample, metrics, verdicts.

    Exit code 0 if nothing differs by more than the tolerance, else 1, so that a CI job can compare with a reference run.

    Signals are sorted by time of first deviation; the first is the likeliest cause. Runs with different communication
    steps are compared by interpolation, with a note.

    \b
    twin compare runs/mine/2026-11-22_08-14-00 runs/mine/latest
    twin compare before runs/mine/latest --tolerance 1e-6 --signal "sensor.*"
    """
    from twin.errors import TwinError, nearest
    from twin.face import open_run
    from twin.results import compare_runs

    runs = open_run(first), open_run(second)
    for pattern in patterns:
        if not any(fnmatchcase(name, pattern) for run in runs for name in run.signals):
            raise TwinError(f"{pattern!r}: not recorded in either run. {nearest(pattern, runs[0].signals)}")
    comparison = compare_runs((runs[0].folder, runs[1].folder), (runs[0].summary, runs[1].summary), tolerance, patterns)
    for note in comparison.notes:
        say(f"note: {note}")
    for problem in comparison.problems:
        say(problem)
    differing = comparison.differing
    if differing:
        from rich.text import Text

        several = len({(signal.variant, signal.seed) for signal in comparison.signals}) > 1
        table = make_table("signal", *["case"] * several, "difference", "from", "relative", left=1 + several)
        for signal in differing if everything else differing[:MAX_LISTED]:
            case = [f"{signal.variant}, seed {signal.seed}"] * several
            table.add_row(*map(Text, (signal.name, *case, signal.text, f"{signal.time:.6g} s", f"{signal.part:.2g}")))
        open_console().print(table)
        if len(differing) > MAX_LISTED and not everything:
            say(f"and {len(differing) - MAX_LISTED} more: use --all")
    within = len(comparison.signals) - comparison.identical_count - len(differing)
    say(
        f"{len(comparison.signals)} signals: {comparison.identical_count} equal to the bit, {within} within {tolerance:g}, "
        f"{len(differing)} above. {'The runs agree.' if comparison.agrees else 'The runs differ.'}"
    )
    if not comparison.agrees:
        sys.exit(1)
