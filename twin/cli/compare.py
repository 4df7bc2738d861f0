"""`twin compare`: compare two runs."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from twin.cli.options import signal_option
from twin.cli.terminal import say, show_table, show_text

if TYPE_CHECKING:
    from twin.results import Comparison, MetricChange

MAX_LISTED = 20  # metrics, and other differences, without --all
MAX_SIGNALS = 8  # without --all
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
@click.option("--all", "everything", is_flag=True, help="List all differences, not only the largest.")
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

    Changed verdicts come first, new failures on top. Metrics are means over the seeds; changes that are large over the
    seeds' spread come first. Signals are sorted by relative difference, each with that of the case in which it is largest
    and the number of cases (--all lists them); the signal with the earliest `from` is the likeliest cause. Requirements
    are of all variants: --variant leaves them out. Runs with different communication steps are compared by
    interpolation, with a note.

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
    show_verdicts(comparison, everything)
    if summaries[0]["overrides"] != summaries[1]["overrides"]:
        for word, summary in zip(("first", "second"), summaries, strict=True):
            show_text(", ".join(summary["overrides"]) or "nothing", f"set in the {word} run: ")
    if not patterns:
        show_metrics(comparison, everything)
    show_text(comparison.headline)
    for note in comparison.notes:
        show_text(note, "note: ")
    for entry in comparison.missing:
        show_text(entry.text(len(entry.names) if everything else MAX_NAMES))
    above = ("metric ", "requirement ") if comparison.changes and not everything else ()
    problems = [problem for problem in comparison.problems if not problem.startswith(above)]
    for problem in problems[: None if everything else MAX_LISTED]:
        show_text(problem)
    show_rest(len(problems), MAX_LISTED, everything)
    show_signals(comparison, everything)
    if not comparison.agrees:
        sys.exit(1)


def show_verdicts(comparison: Comparison, everything: bool) -> None:
    """Print the verdicts that changed: a line for each that is, or was, a failure; the others in one line with their number."""
    others: dict[tuple[str, str], list[str]] = {}
    for name, first, second in comparison.verdicts:
        if everything or "fail" in (first, second):
            show_text(f"{first} -> {second}: {name}")
        else:
            others.setdefault((first, second), []).append(f'"{name}"')
    for (first, second), names in others.items():
        more = f" and {len(names) - 1} more" * (len(names) > 1)
        after = "other settings" if second == "other" else second
        show_text(f"{len(names)} verdict{'s' * (len(names) > 1)}: {names[0]}{more}", f"{first} -> {after}: ")


def show_metrics(comparison: Comparison, everything: bool) -> None:
    """Print the metrics that differ beyond the tolerance, in the units of the report."""
    from twin.results import common_format, display_units, si_conversion

    units = display_units({change.metric: change.unit for change in comparison.changes})
    formats = {}
    for name, unit in units.items():
        own = [change for change in comparison.changes if change.metric == name]
        factor, offset = si_conversion(own[0].unit)
        values = [value * factor + offset for each in own for value in (each.first, each.second) if value is not None]
        formats[name] = (common_format(values, unit), factor, offset)
    changes = [each for each in comparison.changes if not is_small(each, comparison.tolerance)]
    rows = []
    for change in changes if everything else [each for each in changes if each.significance > 1][:MAX_LISTED]:
        shown, factor, offset = formats[change.metric]
        pair = (change.first, change.second)
        texts = ["-" if value is None else shown.text(value * factor + offset) for value in pair]
        ratio = change.second / change.first if change.first and change.second is not None else None
        is_ratio = ratio is not None and abs(change.first or 0.0) > change.spread
        rows.append([change.metric, change.variant, *texts, f"{ratio:.2f}" if is_ratio else "-"])
    show_table(["metric", "variant", "first", "second", "ratio"], rows, 2)
    if len(changes) > len(rows):
        smaller = "smaller" if rows else "within the spread of the seeds"
        say(f"and {len(changes) - len(rows)} more, {smaller}: use --all")


def is_small(change: MetricChange, tolerance: float) -> bool:
    """Whether the values of a metric differ by no more than the tolerance."""
    if change.change is None:
        return change.first is change.second
    return abs(change.change) <= tolerance * max(abs(change.first or 0.0), abs(change.second or 0.0))


def show_rest(count: int, limit: int, everything: bool) -> None:
    """Print how many entries of a list were left out."""
    if count > limit and not everything:
        say(f"and {count - limit} more: use --all")


def show_signals(comparison: Comparison, everything: bool) -> None:
    """Print the largest difference of each signal, or with `everything` of each case."""
    differing = comparison.differing
    if differing:
        by_signal = {signal.name: [each for each in differing if each.name == signal.name] for signal in differing}
        listed = differing if everything else [cases[0] for cases in by_signal.values()]
        several = len({(each.variant, each.seed) for each in comparison.signals}) > 1
        rows = []
        for each in listed if everything else listed[:MAX_SIGNALS]:
            cases = f"{each.variant}, seed {each.seed}" if everything else str(len(by_signal[each.name]))
            rows.append([each.name, each.text, f"{each.time:.6g} s", f"{each.part:.2g}", *[cases] * several])
        titles = ["case" if everything else "cases"] * several
        show_table(["signal", "difference", "from", "relative", *titles], rows, 1)
        show_rest(len(listed), MAX_SIGNALS, everything)
