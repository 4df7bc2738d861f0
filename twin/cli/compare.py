"""`twin compare`: whether two runs are the same."""

from __future__ import annotations

import sys
from fnmatch import fnmatchcase
from pathlib import Path

import click

from twin.cli.terminal import paper, say

LISTED = 20  # signals, if not all are asked for


@click.command(name="compare")
@click.argument("first", type=click.Path(path_type=Path), metavar="RUN")
@click.argument("second", type=click.Path(path_type=Path), metavar="RUN")
@click.option("--tolerance", type=click.FloatRange(0.0), default=1e-9, show_default=True, metavar="PART",
              help="By how much a signal may differ, as part of its largest size; 0: not at all.")  # fmt: skip
@click.option("--signal", "patterns", multiple=True, metavar="NAME",
              help="Compare this alone, such as sensor.* or heart.position; may be repeated.")  # fmt: skip
@click.option("--all", "everything", is_flag=True, help=f"List every signal that differs, not {LISTED}.")
def command(first: Path, second: Path, tolerance: float, patterns: tuple[str, ...], everything: bool) -> None:
    """Compare two runs: signals sample by sample, metrics, verdicts.

    Exit code 0 if nothing differs by more than the tolerance, else 1: for a CI that keeps a run as its reference.
    Signals stand in the order in which they part: what comes first may be the cause.
    Runs with other communication steps are compared by interpolation, and said to be.

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
            raise TwinError(f"{pattern!r}: neither run recorded it. {nearest(pattern, runs[0].signals)}")
    found = compare_runs((runs[0].folder, runs[1].folder), (runs[0].summary, runs[1].summary), tolerance, patterns)
    for note in found.notes:
        say(f"note: {note}")
    for problem in found.problems:
        say(problem)
    differing = found.differing
    if differing:
        from rich import box
        from rich.table import Table
        from rich.text import Text

        grid = Table(box=box.SIMPLE_HEAD, pad_edge=False, header_style="bold")
        several = len({(one.variant, one.seed) for one in found.signals}) > 1
        for title in ("signal", *["case"] * several, "difference", "from", "part"):
            grid.add_column(title, justify="left" if title in ("signal", "case") else "right", overflow="fold")
        for one in differing if everything else differing[:LISTED]:
            case = [f"{one.variant}, seed {one.seed}"] * several
            grid.add_row(*map(Text, (one.name, *case, one.text, f"{one.time:.6g} s", f"{one.part:.2g}")))
        paper().print(grid)
        if len(differing) > LISTED and not everything:
            say(f"and {len(differing) - LISTED} more: --all lists them")
    within = len(found.signals) - found.identical_count - len(differing)
    say(
        f"{len(found.signals)} signals: {found.identical_count} the same to the bit, {within} within {tolerance:g}, "
        f"{len(differing)} beyond. {'The runs agree.' if found.agrees else 'The runs differ.'}"
    )
    if not found.agrees:
        sys.exit(1)
