"""Tables of a study's page that sort and filter: variants by metrics and expectations, and the cases that are named."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.results import format_value, si_conversion
from twin.study.answers.statistics import MetricDistribution, expectation_name
from twin.study.answers.summary import Answers, percent
from twin.study.execution.case_engine import DONE, Row

if TYPE_CHECKING:
    from collections.abc import Container, Iterable

    from twin.study.design import Factor
    from twin.study.execution.study_runner import StudyOutcome

ALL = 200  # cases of a study that is shown in whole
MOST = 200  # cases of a larger one: those that the page names, then others that fail

MAX_VALUES = 8  # of a factor, that are named


def cell(text: str = "", value: float = float("nan"), kind: str = "", more: str = "", tip: str = "") -> dict[str, Any]:
    """A cell; what it is sorted by is nothing where there is no value. `kind`: good, bad; `more`: in smaller letters; `tip`: at the pointer."""
    return {"text": text, "value": float(value) if np.isfinite(value) else None, "kind": kind, "more": more, "tip": tip}


def bare(answers: Answers, name: str, value: float) -> str:
    """A value of a metric without the unit, which stands above it."""
    return answers.formats[name].number(value) if np.isfinite(value) else "-"


def in_unit(answers: Answers, name: str, value: float) -> float:
    """A value of a metric as a number in its unit."""
    factor, offset = si_conversion(answers.formats[name].unit, answers.formats[name].is_difference)
    return (value - offset) / factor


def columns(answers: Answers) -> list[tuple[str, str, str]]:
    """Name, unit and meaning of each metric."""
    metrics = answers.study.metrics.values()
    return [
        (metric.name, answers.formats[metric.name].label, metric.description or metric.signal.text)
        for metric in metrics
    ]


def variants(answers: Answers) -> dict[str, Any]:
    """Quantiles of each metric and pass rates, a row for each variant; `of`: what rows are.

    With fewer variants than metrics and expectations, a row for each of these: the table is narrow enough for a page.
    """
    study = answers.study
    spreads = {(spread.variant, spread.metric): spread for spread in answers.spreads}
    shares = {(share.variant, share.name): share for share in answers.shares}
    judged = list(dict.fromkeys(share.name for share in answers.shares if share.variant in study.variants))
    grid = []
    for variant in study.variants:
        cells = [quantiles(answers, name, variant, spreads.get((variant, name))) for name in study.metrics]
        for name in judged:
            own = shares.get((variant, name))
            verdict = "pass" if own and own.part == 1.0 else "fail"
            cells.append(cell(percent(own.part), own.part, verdict) if own else cell("-"))
        grid.append(cells)
    of, lines, heads = "variant", [(variant, "", "") for variant in study.variants], columns(answers)
    heads += [(name, "pass rate", "") for name in judged]
    if len(lines) < len(heads):
        of, lines, heads, grid = "metric", heads, lines, [list(cells) for cells in zip(*grid, strict=True)]
    rows = [
        {"name": name, "unit": unit, "meaning": meaning, "cells": cells, "bad": any(c["kind"] == "fail" for c in cells)}
        for (name, unit, meaning), cells in zip(lines, grid, strict=True)
    ]
    return {"of": of, "columns": heads, "rows": rows, "worth": len(study.variants) > 1 and bool(answers.spreads)}


def quantiles(answers: Answers, name: str, variant: str, spread: MetricDistribution | None) -> dict[str, Any]:
    """Return the cell of a metric: the quantile in the middle, and below it the first and the last, or why there are none."""
    if spread is None or not spread.quantiles:
        return cell("-", kind="empty", more=why_no_value(answers, name, variant))
    values = answers.quantiles(spread)
    middle, ends = values[len(values) // 2], [bare(answers, spread.metric, value) for value in (values[0], values[-1])]
    more = " to ".join(ends) if len(values) > 1 else ""
    return cell(bare(answers, spread.metric, middle), in_unit(answers, spread.metric, middle), "", more)


def why_no_value(answers: Answers, name: str, variant: str) -> str:
    """Return why a metric has no value in any case of a variant, or in one of its complete cases."""
    own = answers.study.metrics[name].variants
    if own and variant not in own:
        return f"only with {', '.join(own)}"
    reasons = (
        entry.why for entry in answers.left_out if entry.name == name and variant in (entry.variants or [variant])
    )
    return next(reasons, "no value")


def named(answers: Answers, examples: int, more: Iterable[int]) -> list[int]:
    """Numbers of the cases that are listed: all of a small study, else those that the page names and that fail."""
    numbers = [request.number for request in answers.cases.requests]
    if len(numbers) <= ALL:
        return numbers
    case_numbers = {number for share in answers.shares for number in share.failing[:examples]}
    case_numbers |= {end[0] for spread in answers.spreads for end in (spread.least, spread.most)}
    case_numbers |= (
        {cluster.cases[0] for cluster in answers.clusters} | {change.number for change in answers.changes} | set(more)
    )
    failing = [
        n for n, row in zip(numbers, answers.cases.rows, strict=True) if row.status != DONE or False in row.holds
    ]
    case_numbers |= set(failing[: max(MOST - len(case_numbers), 0)])
    return sorted(case_numbers & set(numbers))


def singles(outcome: StudyOutcome, answers: Answers, numbers: Iterable[int]) -> dict[str, Any]:
    """A row for each of some cases, failures first: verdict, factors, metrics, and the command that opens the case."""
    cases, study = answers.cases, answers.study
    varied = [k for k in range(len(study.all_factors)) if np.isfinite(cases.values[:, k]).any()]
    wanted, rows = set(numbers), []
    for i, (request, row) in enumerate(zip(cases.requests, cases.rows, strict=True)):
        if request.number not in wanted:
            continue
        broken = [
            expectation_name(expectation, k)
            for k, (expectation, holds) in enumerate(zip(study.scenario.expectations, row.holds, strict=False))
            if holds is False
        ]
        passes = "pass" if True in row.holds else ""
        rows.append(
            {
                "number": request.number,
                "variant": request.variant,
                "seed": request.seed,
                "cells": [factor_cell(study.all_factors[k], request.all_values[k]) for k in varied]
                + [
                    metric_cell(answers, name, float(cases.metric(name)[i]), request.variant, row)
                    for name in study.metrics
                ],
                "failed": f"did not finish: {row.why}" if row.status != DONE else ", ".join(broken),
                "verdict": passes,
                "run": outcome.runs.get(request.number, ""),
                "command": open_command(str(outcome.folder), request.number, outcome.runs),
            }
        )
    heads = [(own.name, own.shown_unit, own.source) for own in (study.all_factors[k] for k in varied)]
    rows.sort(key=lambda row: not row["failed"])
    return {"columns": [*heads, *columns(answers)], "rows": rows, "of": len(cases.rows)}


def factor_cell(factor: Factor, value: float) -> dict[str, Any]:
    """A cell with a factor's value in the unit above it; `-`: as in the scenario."""
    own = float(factor.in_shown_unit(value))
    return cell(f"{own:.4g}" if np.isfinite(own) else "-", own)


def metric_cell(answers: Answers, name: str, value: float, variant: str, row: Row) -> dict[str, Any]:
    """Return a cell with a metric's value in the unit above it; without a value, its tip says why."""
    if np.isfinite(value):
        return cell(bare(answers, name, value), in_unit(answers, name, value))
    return cell("-", tip=why_no_value(answers, name, variant) if row.status == DONE else "did not finish")


def open_command(address: str, number: int, recorded: Container[int]) -> str:
    """Return the command that shows a case in the viewer if its recording was kept, else that runs it again."""
    return f"twin {'view' if number in recorded else 'run --case'} {shlex.quote(f'{address}:{number}')}"


def factors(outcome: StudyOutcome) -> list[dict[str, str]]:
    """A row for each factor: variables, distribution in words, range of the samples, source."""
    values = outcome.cases.values
    rows = []
    for k, factor in enumerate(outcome.study.all_factors):
        own = values[np.isfinite(values[:, k]), k]
        targets = ", ".join(factor.sets) or f"{', '.join(factor.scales)} (multiplied)"
        targets += f" at {clock.text(factor.at_ns)}" if factor.at_ns is not None else ""
        span = f"{factor.shown(own.min())} to {factor.shown(own.max())}" if len(own) else "-"
        rows.append(
            {
                "name": factor.name,
                "targets": targets,
                "kind": distribution_text(factor),
                "span": span,
                "source": factor.source,
            }
        )
    return rows


def distribution_text(factor: Factor) -> str:
    """Return `normal: mean 75 /min, standard deviation 13 /min; from 48 /min to 120 /min`."""
    own = factor.distribution
    if own.kind == "values":
        shown = [factor.shown(value) for value in own.numbers]
        more = f" and {len(shown) - MAX_VALUES} more" if len(shown) > MAX_VALUES else ""
        return f"equally likely: {', '.join(shown[:MAX_VALUES])}{more}"
    first, second = own.numbers
    if own.kind == "normal":  # a deviation is a difference: of 26.85 degC one of 2 K is no -271.1 degC
        unit = factor.display_unit or factor.unit
        width = second * si_conversion(factor.unit, is_difference=True)[0]
        text = f"mean {factor.shown(first)}, standard deviation {format_value(width, unit, is_difference=True)}"
    elif own.kind == "log_normal":
        text = f"median {factor.shown(first)}, geometric standard deviation {second:g}"
    else:
        text = f"from {factor.shown(first)} to {factor.shown(second)}"
    ends = [f"{word} {factor.shown(end)}" for word, end in (("from", own.low), ("to", own.high)) if np.isfinite(end)]
    return f"{own.kind.replace('_', '-')}: {text}{'; ' * bool(ends)}{' '.join(ends)}"
