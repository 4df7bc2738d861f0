"""`twin compare`: compare two runs."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from twin.cli.options import signal_option
from twin.cli.terminal import say, show_table, show_text
from twin.errors import TwinError, quote_names

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from twin.results import Comparison, Difference, MetricChange

MAX_LISTED = 20  # metrics, and other differences, without --all
MAX_SETTINGS = 8  # without --all
MAX_SIGNALS = 8  # without --all
MAX_NAMES = 6  # names in a line without --all
WORDS = {"other": "other settings", "cut": "run too short"}  # verdicts as in the tables of `twin run`
NEAR_ZERO = 0.05  # of the largest metric of the same signal
SIGNALS = "Signals: largest difference and its time (at), first time (from), relative to the largest magnitude:"
MAX_CASES = 2  # of the cases of one run only, the same


@click.command(name="compare")
@click.argument("first", type=click.Path(path_type=Path), metavar="RUN")
@click.argument("second", type=click.Path(path_type=Path), metavar="[RUN]", required=False)
@click.option(
    "--tolerance",
    type=click.FloatRange(0.0),
    default=1e-9,
    show_default=True,
    metavar="X",
    help="Allowed difference of a signal, relative to its largest magnitude; 0: none.",
)
@signal_option
@click.option(
    "--variant",
    "variants",
    multiple=True,
    metavar="NAME",
    help="Compare only this variant; 'A=B': variant A of the first run with B of the second. Repeatable.",
)
@click.option("--all", "everything", is_flag=True, help="List all differences, not only the largest.")
def command(
    first: Path,
    second: Path | None,
    tolerance: float,
    patterns: tuple[str, ...],
    variants: tuple[str, ...],
    everything: bool,
) -> None:
    """Compare two runs, or two variants of one or two runs: signals sample by sample, metrics, verdicts.

    Exit code 0 if nothing differs by more than the tolerance, else 1, so that a CI job can compare with a reference run.

    Cases of one run only and changed verdicts come first, new failures on top. Metrics are means over the seeds, sorted by
    relative change, without those that changed within the spread of the seeds (--all lists them). Signals are sorted by relative difference, each with that of the case in which it is largest
    and the number of cases; the signal with the earliest `from` is the likeliest cause. Requirements
    are of all variants: --variant leaves them out. Runs with different communication steps are compared by
    interpolation, with a note. Runs of two scenarios are compared if they have most signals and metrics in common.

    \b
    twin compare runs/mine/2026-11-22_08-14-00 runs/mine/latest
    twin compare before runs/mine/latest --tolerance 1e-6 --signal "sensor.*"
    twin compare latest --variant "PI=PI+FF"
    twin compare latest OTHER --variant "soft wall=PI+FF"
    """
    from twin.cli.list import outcome
    from twin.face import open_run
    from twin.results import compare_runs

    pairs = [variant for variant in variants if "=" in variant]
    if second is None and not pairs:
        raise click.UsageError('Name a second RUN, or two variants of this one, such as --variant "PI=PI+FF".')
    runs = open_run(first), open_run(second or first)
    folders, summaries = (runs[0].folder, runs[1].folder), (runs[0].summary, runs[1].summary)
    comparison = compare_runs(folders, summaries, tolerance, patterns, variants)
    words = ("run",) if second is None else ("first", "second")
    for word, folder, summary in zip(words, folders, summaries, strict=False):
        show_text(f"{with_time(folder, str(summary['started']))}; {outcome(folder)}", f"{word}: ")
    names = [summary["scenario"]["name"] for summary in summaries]
    if names[0] != names[1] and not pairs:
        counts, is_related = common_names(comparison)
        advice = "" if is_related or everything else " (--all compares them)"
        show_text(
            f"The runs are of two scenarios, {' and '.join(names)}: {counts} have the same name and case{advice}."
        )
        if not is_related and not everything:
            show_variants(summaries)
            sys.exit(1)
    if not pairs and folders[0].resolve() == folders[1].resolve():
        show_text("Both are the same run.", "note: ")
    cases = [entry for entry in comparison.missing if entry.kind == "case"]
    for entry in cases:
        show_text(entry.text(len(entry.names) if everything else MAX_CASES))
    show_settings(folders, summaries, variants, everything)
    show_verdicts(comparison, everything, has_all_cases=not cases)
    if not patterns:
        show_metrics(
            comparison, everything, {name: each.get("signal", name) for name, each in summaries[0]["metrics"].items()}
        )
    show_text(comparison.headline)
    for note in comparison.notes:
        show_text(note, "note: ")
    for entry in (entry for entry in comparison.missing if entry not in cases):
        show_text(entry.text(len(entry.names) if everything else MAX_NAMES))
    changed = {change.metric for change in comparison.changes if not is_small(change, tolerance)}
    above = (*(f"metric {name} of" for name in changed), *["requirement "] * bool(comparison.verdicts))
    problems = [problem for problem in comparison.problems if not problem.startswith(above)]
    for problem in problems[: None if everything else MAX_LISTED]:
        show_text(problem)
    show_rest(len(problems), MAX_LISTED, everything)
    show_signals(comparison, everything)
    if not comparison.agrees:
        sys.exit(1)


def show_variants(summaries: Sequence[Mapping[str, Any]]) -> None:
    """Print the variants of two runs that have little in common, and how to compare two of them."""
    own = [list(dict.fromkeys(case["variant"] for case in summary["cases"])) for summary in summaries]
    if not all(own):
        return
    for word, names in zip(("first", "second"), own, strict=True):
        show_text(", ".join(quote_names(names)), f"variants of the {word}: ")
    chosen = [next((name for name in names if name not in others), names[0]) for names, others in (own, own[::-1])]
    show_text(f'Compare two of them: --variant "{"=".join(chosen)}"')


def with_time(folder: Path, started: str) -> str:
    """Return the path of a run, with the time of its start if its name does not say it."""
    minute = started[:16]
    return (
        str(folder)
        if minute.replace("T", "_").replace(":", "-") in folder.name
        else f"{folder}, {minute.replace('T', ' ')}"
    )


def common_names(comparison: Comparison) -> tuple[str, bool]:
    """Return how many signals and metrics runs of two scenarios have in common, and whether that is most of them."""
    signals, metrics = ({each.name for each in comparison.differences}, {each.metric for each in comparison.changes})
    single = {name for entry in comparison.missing if entry.kind in ("signal", "metric") for name in entry.names}
    return f"{len(signals)} signals and {len(metrics)} metrics", len(signals) + len(metrics) > len(single)


def show_settings(
    folders: tuple[Path, Path],
    summaries: tuple[Mapping[str, Any], Mapping[str, Any]],
    chosen: Sequence[str],
    everything: bool,
) -> None:
    """Print the settings that differ between the variants that are compared, from the scenarios that the runs merged."""
    from twin.results import variant_pairs
    from twin.run import case_settings
    from twin.scenario import load_scenario

    names = [case["variant"] for case in summaries[0]["cases"]]
    own = [name for name in dict.fromkeys(names) if any(case["variant"] == name for case in summaries[1]["cases"])]
    rows: dict[tuple[str, ...], list[str]] = {}
    try:
        pairs = variant_pairs(summaries, chosen) if chosen else {name: (name, name) for name in own}
        scenarios = [load_scenario(folder / "scenario.yaml") for folder in folders]
        for name, pair in pairs.items():
            first, second = (case_settings(*each) for each in zip(scenarios, pair, strict=True))
            for key in dict.fromkeys([*first[0], *second[0]]):
                is_same = first[0].get(member := key.partition(".")[0]) == second[0].get(member)  # its component
                defaults = first[1] | second[1] if is_same else {}  # of an input that only one of the runs sets
                values = [each[0].get(key) or defaults.get(key) or "-" for each in (first, second)]
                if values[0] != values[1]:
                    rows.setdefault((key, *values), []).append(name)
    except (OSError, TwinError):  # such as of an FMU that has moved
        return
    listed = [[*row, "" if len(names) == len(pairs) else ", ".join(quote_names(names))] for row, names in rows.items()][
        : None if everything else MAX_SETTINGS
    ]
    if listed:
        say("Settings that differ:")
        width = 3 + any(row[3] for row in listed)
        sides = (
            chosen[0].split("=", 1)
            if len(chosen) == 1 and chosen[0] in pairs and "=" in chosen[0]
            else ["first", "second"]
        )
        show_table(["setting", *sides, "variants"][:width], (row[:width] for row in listed), 1, texts=width - 3)
        show_rest(len(rows), MAX_SETTINGS, everything)


def show_verdicts(comparison: Comparison, everything: bool, *, has_all_cases: bool) -> None:
    """Print the verdicts that changed: a line for each that is, or was, a failure; the others in one line with their number.

    Without `has_all_cases` requirements that only one run judges are counted: the cases say why.
    """
    others: dict[tuple[str, str], list[str]] = {}
    unjudged = 0
    for name, *verdicts in comparison.verdicts:
        first, second = (WORDS.get(verdict, verdict) for verdict in verdicts)
        if "skipped" in verdicts and not has_all_cases:
            unjudged += 1
        elif everything or "fail" in verdicts:
            show_text(f"{first} -> {second}: {name}")
        else:
            others.setdefault((first, second), []).append(f'"{name}"')
    for (first, second), names in others.items():
        more = f" and {len(names) - 1} more" * (len(names) > 1)
        show_text(f"{len(names)} verdict{'s' * (len(names) > 1)}: {names[0]}{more}", f"{first} -> {second}: ")
    if unjudged:
        show_text(f"{unjudged} requirement{'s are' if unjudged > 1 else ' is'} judged in one run only.")


def show_metrics(comparison: Comparison, everything: bool, signals: Mapping[str, str]) -> None:
    """Print the metrics that differ beyond the tolerance, in the units of the report. `signals`: of the metrics."""
    from twin.results import common_format, display_units, larger_unit, si_conversion

    units = display_units({change.metric: change.unit for change in comparison.changes})
    formats = {}
    for name, unit in units.items():
        own = [change for change in comparison.changes if change.metric == name]
        factor, offset = si_conversion(own[0].unit)
        values = [value * factor + offset for each in own for value in (each.first, each.second) if value is not None]
        formats[name] = (common_format(values, larger_unit(values, unit)), factor, offset)
    changes = [each for each in comparison.changes if not is_small(each, comparison.tolerance)]
    sizes: dict[tuple[str, str], float] = {}  # largest metric of a signal: the scale of a mean around zero
    for each in comparison.changes:
        key = each.variant, signals.get(each.metric, each.metric)
        sizes[key] = max(sizes.get(key, 0.0), abs(each.first or 0.0))

    def part(change: MetricChange) -> tuple[float, bool]:  # for sorting, and whether it is shown as a percentage
        size = sizes[change.variant, signals.get(change.metric, change.metric)]
        if (change.first or 0.0) > max(change.spread, NEAR_ZERO * size) and (change.second or 0.0) > 0.0:
            return abs(change.relative or 0.0), True
        return abs(change.change or 0.0) / max(size, abs(change.second or 0.0), change.spread), False

    changes.sort(key=part, reverse=True)
    rows = []
    for change in changes if everything else [each for each in changes if each.significance > 1][:MAX_LISTED]:
        shown, factor, offset = formats[change.metric]
        pair = (change.first, change.second)
        texts = ["-" if value is None else shown.text(value * factor + offset) for value in pair]
        difference = replace(shown, is_difference=True).text((change.change or 0.0) * factor)
        signed = "-" if change.change is None else difference if difference.startswith("-") else f"+{difference}"
        rows.append([change.metric, change.variant, *texts, percent(change.relative) if part(change)[1] else signed])
    if rows:
        say("Metrics, by relative change; a difference near or below zero:")
    if len(compared := {row[1] for row in rows}) == 1 and "=" in (chosen := next(iter(compared))):
        show_table(["metric", *chosen.split("=", 1), "change"], ([row[0], *row[2:]] for row in rows), 1)
    else:
        show_table(["metric", "variant", "first", "second", "change"], rows, 2)
    if len(changes) > len(rows):
        smaller = "smaller" if rows else "within the spread of the seeds"
        say(f"and {len(changes) - len(rows)} more, {smaller}: use --all")


def percent(part: float | None) -> str:
    """Return a relative change as `+12 %`, a large one as a factor."""
    value = 100.0 * (part or 0.0)
    decimals = 0 if abs(value) >= 10.0 else 1 if abs(value) >= 1.0 else 2
    return f"{value:+.{decimals}f} %" if abs(value) < 900.0 else f"{1.0 + value / 100.0:.3g} times"


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
    """Print the largest difference of each signal, or with `everything` of each case; equal differences, as of connected signals, once."""
    total = len({(each.variant, each.seed) for each in comparison.differences})
    by_signal: dict[str, list[Difference]] = {}
    for each in comparison.differing:
        by_signal.setdefault(each.name, []).append(each)
    groups: dict[tuple[Any, ...], list[str]] = {}
    for each in comparison.differing if everything else [cases[0] for cases in by_signal.values()]:
        count = len(by_signal[each.name])
        cases = f"{each.variant}, seed {each.seed}" if everything else "all" if count == total else str(count)
        times = (f"{time:.6g} s" for time in (each.peak_time, each.time))
        groups.setdefault((each.text, *times, f"{each.part:.2g}", cases), []).append(each.name)
    rows = [[names[0] + f" and {len(names) - 1} equal" * (len(names) > 1), *texts] for texts, names in groups.items()]
    if not rows:
        return
    show_text(SIGNALS)
    has_cases = any(row[-1] != "all" for row in rows) and total > 1
    titles = ["signal", "difference", "at", "from", "relative", *["case" if everything else "cases"] * has_cases]
    show_table(titles, (row[: len(titles)] for row in rows[: None if everything else MAX_SIGNALS]), 1)
    show_rest(len(rows), MAX_SIGNALS, everything)
