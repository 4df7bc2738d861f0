"""`twin compare`: compare two runs."""

from __future__ import annotations

import sys
from math import isfinite
from pathlib import Path

import click

from twin.cli.options import signal_option
from twin.cli.terminal import say, show_table, show_text

MAX_LISTED = 20  # signals, and other differences, without --all
MAX_NAMES = 6  # names in a line without --all


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
@click.option("--variant", "variants", multiple=True, metavar="NAME", help="Compare only this variant. Repeatable.")
@click.option("--all", "everything", is_flag=True, help=f"List all differences, not only {MAX_LISTED}.")
def command(
    first: Path,
    second: Path,
    tolerance: float,
    patterns: tuple[str, ...],
    variants: tuple[str, ...],
    everything: bool,
) -> None:
    """Compare two runs: signals sample by sample, metrics, verdicts.

    Exit code 0 if nothing differs by more than the tolerance, else 1, so that a CI job can compare with a reference run.

    The first line says whether the runs agree, the second what differs most. Signals and metrics are sorted by relative
    difference, each with that of the case in which it is largest and the number of cases (--all lists them); the signal
    with the earliest `from` is the likeliest cause. Requirements are of all variants: --variant leaves them out. Runs
    with different communication steps are compared by interpolation, with a note.

    \b
    twin compare runs/mine/2026-11-22_08-14-00 runs/mine/latest
    twin compare before runs/mine/latest --tolerance 1e-6 --signal "sensor.*"
    """
    from twin.face import open_run
    from twin.results import compare_runs

    runs = open_run(first), open_run(second)
    folders, summaries = (runs[0].folder, runs[1].folder), (runs[0].summary, runs[1].summary)
    comparison = compare_runs(folders, summaries, tolerance, patterns, variants)
    names = list(dict.fromkeys(summary["scenario"]["name"] for summary in summaries))
    if len(names) > 1:
        show_text(f"The runs are of two scenarios: {names[0]} and {names[1]}.", "note: ")
    show_text(comparison.headline)
    if summaries[0]["overrides"] != summaries[1]["overrides"]:
        for word, summary in zip(("first", "second"), summaries, strict=True):
            show_text(", ".join(summary["overrides"]) or "nothing", f"set in the {word} run: ")
    if (most := comparison.largest) is not None:
        by = f"{most.text}, {most.part:.2g} of its largest magnitude" if isfinite(most.part) else most.text
        show_text(f"{most.name} of {most.variant}, seed {most.seed}: {by}.", "Most: ")
    for note in comparison.notes:
        show_text(note, "note: ")
    for entry in comparison.missing:
        show_text(entry.text(len(entry.names) if everything else MAX_NAMES))
    for problem in comparison.problems[: None if everything else MAX_LISTED]:
        show_text(problem)
    if len(comparison.problems) > MAX_LISTED and not everything:
        say(f"and {len(comparison.problems) - MAX_LISTED} more: use --all")
    differing = comparison.differing
    if differing:
        by_signal = {signal.name: [each for each in differing if each.name == signal.name] for signal in differing}
        listed = differing if everything else [cases[0] for cases in by_signal.values()]
        several = len({(each.variant, each.seed) for each in comparison.signals}) > 1
        rows = []
        for each in listed if everything else listed[:MAX_LISTED]:
            cases = f"{each.variant}, seed {each.seed}" if everything else str(len(by_signal[each.name]))
            rows.append([each.name, each.text, f"{each.time:.6g} s", f"{each.part:.2g}", *[cases] * several])
        titles = ["case" if everything else "cases"] * several
        show_table(["signal", "difference", "from", "relative", *titles], rows, 1)
        if len(listed) > MAX_LISTED and not everything:
            say(f"and {len(listed) - MAX_LISTED} more: use --all")
    if not comparison.agrees:
        sys.exit(1)
