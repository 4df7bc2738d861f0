"""What a run leaves unjudged: variants that an acceptance criterion does not name, and windows after the end of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.errors import quote_names

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence

    from twin.results.evaluation.expression import Expression
    from twin.results.evaluation.metrics import Expectation, Metric, MetricResult
    from twin.results.recording.signals import Signals, Window

    Tables = Mapping[tuple[str, int], Signals]

MAX_GROUPS = 2  # of cases that fail in a line
MAX_NAMES = 6  # of variants or expectations in a sentence


def ends_before(time: np.ndarray[Any, Any], stop: float) -> bool:
    """Return whether recorded times [s] end an interval or more before a window that ends at `stop` [s]."""
    interval = float(time[-1] - time[-2]) if len(time) > 1 else 0.0
    return bool(stop - time[-1] > (1.0 + 1e-6) * interval)


def describe_cut(window: Window, signal: Expression | None, variants: Sequence[str], tables: Tables) -> str:
    """Return a sentence on the first run that ends before a window; empty if all last long enough. No `variants`: all."""
    if window.stop_ns is None or signal is None:
        return ""
    for (variant, seed), signals in tables.items():
        is_judged = (not variants or variant in variants) and len(signals.time) and signals.has(signal)
        if is_judged and ends_before(signals.time[-2:], clock.seconds(window.stop_ns)):
            end = clock.text(round(float(signals.time[-1]) * clock.NANOSECONDS))
            case = describe_case((variant, seed))
            return (
                f"Not judged: the run of {case}, ends at {end}, before its window ends at {clock.text(window.stop_ns)}."
            )
    return ""


def describe_late(window: Window, tables: Tables) -> str:
    """Return a sentence if all runs end before a window begins, as they do with a short stop time of an option; empty otherwise."""
    end = max((float(signals.time[-1]) for signals in tables.values() if len(signals.time)), default=np.inf)
    if window.start_ns is None or end >= clock.seconds(window.start_ns):
        return ""
    end_text = clock.text(round(end * clock.NANOSECONDS))
    return f"Not judged: the run ends at {end_text}, before the window begins at {clock.text(window.start_ns)}."


def describe_cut_expectation(expectation: Expectation, metrics: Mapping[str, Metric], tables: Tables) -> str:
    """Return a sentence on the first judged run that ends before an expectation's window; empty if none does."""
    metric = metrics.get(expectation.metric or "")
    window, signal = (metric.window, metric.signal) if metric else (expectation.window, expectation.signal)
    judged = expectation.ordered or expectation.variants or (metric.variants if metric else ())
    return describe_cut(window, signal, judged, tables)


def judged_variants(expectation: Expectation, results: Iterable[MetricResult], tables: Tables) -> tuple[str, ...]:
    """Return the variants of `tables` that an expectation judges: it names them, and they have its metric or signal."""
    if expectation.metric is not None:
        present = {result.variant for result in results if result.metric.name == expectation.metric}
    elif expectation.signal is not None:
        present = {variant for (variant, _), signals in tables.items() if signals.has(expectation.signal)}
    else:
        present = {variant for variant, _ in tables}
    names = expectation.ordered or expectation.variants or present
    return tuple(variant for variant in variants_of(tables) if variant in names and variant in present)


def describe_case(case: tuple[str, int]) -> str:
    """Return a case as `PI, seed 1`."""
    return f"{quote_names(case[:1])[0]}, seed {case[1]}"


def describe_cases(
    cases: Sequence[tuple[str, int]], run: Iterable[tuple[str, int]], max_groups: int = MAX_GROUPS
) -> str:
    """Return some cases of a run as `all variants, all seeds` or `PI, all seeds; FF, seeds 1-3`; empty if it has one case.

    Cases of more groups of variants with the same seeds are counted.
    """
    seeds: dict[str, list[int]] = {}
    for variant, seed in run:
        seeds.setdefault(variant, []).append(seed)
    groups: dict[tuple[int, ...], list[str]] = {}
    for variant in dict.fromkeys(variant for variant, _ in cases):
        own = tuple(seed for name, seed in cases if name == variant)
        groups.setdefault(() if len(own) == len(seeds[variant]) else own, []).append(variant)
    if len(groups) > max_groups:
        return f"{len(cases)} of {sum(map(len, seeds.values()))} runs"
    texts = []
    for own, names in groups.items():
        subject = "all variants" if len(names) == len(seeds) else list_names(names)
        of_seeds = f"seed{'s' * (len(own) > 1)} {join_numbers(own)}" if own else "all seeds"
        has_seeds = max(map(len, seeds.values())) > 1
        texts.append(", ".join([subject] * (len(seeds) > 1) + [of_seeds] * has_seeds))
    return "; ".join(texts)


def group_lines(lines: Iterable[str], run: Collection[tuple[str, int]]) -> list[str]:
    """Join lines that differ in the case alone, with which they begin: `PI, seed 1: ...`, as `all variants, all seeds: ...`."""
    names = {f"{variant}, seed {seed}: ": (variant, seed) for variant, seed in run}
    groups: dict[str, list[str]] = {}
    for line in dict.fromkeys(lines):
        name = next(filter(line.startswith, names), "")
        groups.setdefault(line.removeprefix(name), []).append(name)
    return [
        f"{describe_cases([names[name] for name in own], run)}: {text}" if len(own) > 1 and all(own) else own[0] + text
        for text, own in groups.items()
    ]


def join_numbers(numbers: Iterable[int]) -> str:
    """Join numbers, consecutive ones as a range: `1-3, 5`."""
    ranges: list[list[int]] = []
    for number in sorted(set(numbers)):
        if ranges and number == ranges[-1][-1] + 1:
            ranges[-1] = [ranges[-1][0], number]
        else:
            ranges.append([number])
    return ", ".join("-".join(map(str, ends)) for ends in ranges)


def variants_of(tables: Tables) -> list[str]:
    """Return the variants of a run, in its order."""
    return list(dict.fromkeys(variant for variant, _ in tables))


def describe_judged(expectation: Expectation, judged: Sequence[str], run: Sequence[str]) -> str:
    """Return which variants of a run were judged, to be appended to a verdict's detail; empty if all were."""
    if expectation.ordered:  # the detail names the variants
        missing = [name for name in expectation.ordered if name not in judged]
        return f"Not compared: {list_names(missing)}." if missing else ""
    left_out = [name for name in run if name not in judged]
    if not left_out:
        return ""
    names = f": {list_names(judged)}" if len(judged) <= len(left_out) else f", all but {list_names(left_out)}"
    return f"Judged in {len(judged)} of {len(run)} variants{names}."


def describe_unjudged(
    expectations: Sequence[Expectation], results: Sequence[MetricResult], tables: Tables
) -> tuple[str, ...]:
    """Return a sentence for the variants that ran and escape expectations that their authors probably meant for them too.

    That is so for a variant that no expectation and no reference value judges; for one of an extending file, which an
    inherited list cannot name; and for one that a limit of a signal leaves out, though it names most variants that have
    the signal. What judges the same metric or signal of the variant, or excludes it by `except`, is enough.
    """
    run = variants_of(tables)
    judged = [judged_variants(expectation, results, tables) for expectation in expectations]
    compared = {result.variant for result in results if result.verdict in ("pass", "fail", "none")}
    free = [name for name in run if name not in compared and not any(name in names for names in judged)]
    lines = [f"No requirement judges {list_names(free)}."] if free and expectations else []
    subjects = [(each.metric, each.signal.text if each.signal else None) for each in expectations]
    variants: dict[tuple[str, ...], list[str]] = {}  # by the expectations that leave them out
    for variant in (name for name in run if name not in free):
        covered = {
            subject
            for subject, each, names in zip(subjects, expectations, judged, strict=True)
            if variant in (*names, *each.excluded)
        }
        missed = tuple(
            each.name or each.metric or (each.signal.text if each.signal else each.ends)
            for subject, each, names in zip(subjects, expectations, judged, strict=True)
            if subject not in covered and not each.nominal and not each.ordered
            if variant in each.unlisted or (each.signal and is_of_most(each, names, variant, tables))
        )
        variants.setdefault(missed, []).append(variant)
    for missed, names in variants.items():
        if missed:
            verb = "is" if len(names) == 1 else "are"
            pronoun = "it" if len(names) == 1 else "them"
            lines.append(
                f"{list_names(names)} {verb} not judged by {list_names(missed)}. "
                f"Name {pronoun} in the variants of that requirement, or add a requirement."
            )
    return tuple(lines)


def is_of_most(expectation: Expectation, judged: Sequence[str], variant: str, tables: Tables) -> bool:
    """Whether a limit of a signal judges more than half of the variants that have the signal, and not this one."""
    assert expectation.signal is not None
    having = {name for (name, _), signals in tables.items() if signals.has(expectation.signal)}
    return variant in having - {*judged} and 2 * len(judged) > len(having)


def list_names(names: Sequence[str], word: str = "and") -> str:
    """Join names as `"PI+FF, replayed" and "PI"`; many are counted after the first of them."""
    more = len(names) - MAX_NAMES
    shown = quote_names(names if more < 2 else names[:MAX_NAMES]) + [f"{more} more"] * (more >= 2)
    return f" {word} ".join(filter(None, [", ".join(shown[:-1]), *shown[-1:]]))
