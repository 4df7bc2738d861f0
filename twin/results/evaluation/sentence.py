"""The sentence that answers what a scenario asks, with values of its metrics filled in.

`The force stays within {force_error_max[PI+FF].max} of 0.2 N; the paper: {force_error_max[PI+FF].reference}.`
Without `.max`, `.min` (over seeds) or `.worst` a value is the mean over seeds, which is no limit of what a run did.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from twin.errors import nearest
from twin.results.evaluation.metric_format import metric_formats

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from twin.results.evaluation.metrics import Metric, MetricResult

PLACEHOLDER = re.compile(r"\{([^{}\[\].]+)(?:\[([^{}\[\]]+)\])?(?:\.(mean|min|max|worst|reference))?\}")
SENTENCE_END = re.compile(r"(?<=\.) ")


def check_sentence(text: str, metrics: Mapping[str, Metric], variants: Sequence[str]) -> list[str]:
    """Return a message for each placeholder that names no metric or no variant."""
    problems = []
    for metric, variant, _ in PLACEHOLDER.findall(text):
        if metric not in metrics:
            problems.append(f"there is no metric {metric!r}. {nearest(metric, metrics)}")
        elif variant and variant not in variants:
            problems.append(f"there is no variant {variant!r}. {nearest(variant, variants)}")
    if "{" in PLACEHOLDER.sub("", text):
        problems.append(
            "a placeholder is not `{metric}` or `{metric[variant].worst}` (or .mean, .min, .max, .reference)."
        )
    return problems


def fill_sentence(text: str, results: Iterable[MetricResult]) -> str:
    """Return the text with values, without clauses that lack one. Without a variant the first one is meant.

    `Subject: clause; clause.` keeps the clauses that have values; another sentence ends before its first clause that lacks one.
    """
    results = list(results)
    formats = metric_formats(results)
    by_name: dict[str, list[MetricResult]] = {}
    for result in results:
        by_name.setdefault(result.metric.name, []).append(result)

    def value(match: re.Match[str]) -> str:
        name, variant, which = match.groups()
        group = by_name.get(name, [])
        result = next((each for each in group if variant in (None, each.variant)), None)
        if result is None or result.mean is None or result.verdict == "cut":
            raise LookupError
        seeds = [each for each in result.values.values() if each is not None]
        numbers = {"worst": result.worst, "min": min(seeds), "max": max(seeds), "reference": result.paper}
        if (number := numbers.get(which, result.mean)) is None:
            raise LookupError
        style = formats[name]  # as in the tables
        return style.reference(number) if which == "reference" else style.text(number, result.scale)

    sentences = []
    for sentence in SENTENCE_END.split(" ".join(text.split())):
        head, colon, rest = sentence.partition(": ")
        has_subject = bool(colon) and "{" not in head
        texts = (rest if has_subject else sentence).split("; ")
        clauses = []
        for clause in texts:
            try:
                clauses.append(PLACEHOLDER.sub(value, clause))
            except LookupError:  # e.g. a variant that was not run
                if not has_subject:
                    break
        answer = "; ".join(clauses)
        answer += "." * (len(clauses) < len(texts) and not answer.endswith("."))
        sentences += [f"{head}: {answer}" if has_subject else answer] * bool(clauses)
    return " ".join(sentences)
