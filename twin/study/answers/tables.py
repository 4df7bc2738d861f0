"""Tables of a study's page that sort and filter: variants by metrics and expectations, and the cases that are named."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from twin.results import si_conversion
from twin.study.answers.summary import percent
from twin.study.execution.case_engine import DONE

if TYPE_CHECKING:
    from collections.abc import Iterable

    from twin.study.answers.statistics import MetricDistribution
    from twin.study.answers.summary import Answers

ALL = 200  # cases of a study that is shown in whole
MOST = 200  # cases of a larger one: those that the page names, then others that fail


def cell(text: str = "", value: float = float("nan"), kind: str = "", more: str = "") -> dict[str, Any]:
    """A cell; what it is sorted by is nothing where there is no value. `kind`: good, bad; `more`: in smaller letters."""
    return {"text": text, "value": float(value) if np.isfinite(value) else None, "kind": kind, "more": more}


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
    """A row for each variant: quantiles of each metric, and how often each expectation holds."""
    study = answers.study
    spreads = {(spread.variant, spread.metric): spread for spread in answers.spreads}
    shares = {(share.variant, share.name): share for share in answers.shares}
    judged = list(dict.fromkeys(share.name for share in answers.shares if share.variant in study.variants))
    rows = []
    for variant in study.variants:
        cells = [quantiles(answers, spreads.get((variant, name))) for name in study.metrics]
        for name in judged:
            own = shares.get((variant, name))
            cells.append(cell(percent(own.part), own.part, "pass" if own.part == 1.0 else "fail") if own else cell())
        rows.append({"name": variant, "cells": cells, "bad": any(cell["kind"] == "fail" for cell in cells)})
    heads = [*columns(answers), *((name, "holds in", "") for name in judged)]
    return {"columns": heads, "rows": rows, "worth": len(rows) > 1 and bool(answers.spreads)}


def quantiles(answers: Answers, spread: MetricDistribution | None) -> dict[str, Any]:
    """The quantile in the middle, and below it the first and the last."""
    if spread is None or not spread.quantiles:
        return cell()
    values = [quantile.value for quantile in spread.quantiles]
    middle, ends = values[len(values) // 2], [bare(answers, spread.metric, value) for value in (values[0], values[-1])]
    more = " to ".join(ends) if len(values) > 1 else ""
    return cell(bare(answers, spread.metric, middle), in_unit(answers, spread.metric, middle), "", more)


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


def singles(answers: Answers, numbers: Iterable[int], runs: dict[int, str]) -> dict[str, Any]:
    """A row for each of some cases: metrics, what failed, and its run, if that was kept."""
    cases, metrics = answers.cases, list(answers.study.metrics)
    names = [
        expectation.name or expectation.metric or f"{k + 1}"
        for k, expectation in enumerate(answers.study.scenario.expectations)
    ]
    values = {name: cases.metric(name) for name in metrics}
    wanted, rows = set(numbers), []
    for i, (request, row) in enumerate(zip(cases.requests, cases.rows, strict=True)):
        if request.number not in wanted:
            continue
        own = [float(values[name][i]) for name in metrics]
        cells = [cell(bare(answers, name, x), in_unit(answers, name, x)) for name, x in zip(metrics, own, strict=True)]
        broken = [name for name, holds in zip(names, row.holds, strict=False) if holds is False]
        rows.append(
            {
                "number": request.number,
                "variant": request.variant,
                "seed": request.seed,
                "cells": cells,
                "failed": row.why if row.status != DONE else ", ".join(broken),
                "run": runs.get(request.number, ""),
            }
        )
    return {"columns": columns(answers), "rows": rows, "of": len(cases.rows)}
