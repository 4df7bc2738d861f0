"""The sentence that answers what a scenario asks, with values of its metrics filled in.

`The force stays within {force_error_max[PI+FF]} of 0.2 N; the paper: {force_error_max[PI+FF].reference}.`
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from twin.errors import nearest
from twin.results.evaluation.metric_format import metric_formats

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from twin.results.evaluation.metrics import Metric, MetricResult

PLACEHOLDER = re.compile(r"\{([^{}\[\].]+)(?:\[([^{}\[\]]+)\])?(?:\.(mean|worst|reference))?\}")
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
        problems.append("a placeholder is not `{metric}` or `{metric[variant].worst}` (or .mean, .reference).")
    return problems


def fill_sentence(text: str, results: Iterable[MetricResult]) -> str:
    """Return the text with values; a sentence ends before its first clause that lacks one. Without a variant the first one is meant."""
    results = list(results)
    formats = metric_formats(results)
    by_name: dict[str, list[MetricResult]] = {}
    for result in results:
        by_name.setdefault(result.metric.name, []).append(result)

    def value(match: re.Match[str]) -> str:
        name, variant, which = match.groups()
        group = by_name.get(name, [])
        result = next((each for each in group if variant in (None, each.variant)), None)
        number = None if result is None else {"worst": result.worst, "reference": result.paper}.get(which, result.mean)
        if result is None or number is None or result.verdict == "cut":
            raise LookupError
        style = formats[name]  # as in the tables
        return style.reference(number) if which == "reference" else style.text(number, result.scale)

    sentences = []
    for sentence in SENTENCE_END.split(" ".join(text.split())):
        clauses = []
        try:
            for clause in sentence.split("; "):
                clauses.append(PLACEHOLDER.sub(value, clause))
        except LookupError:  # e.g. a variant that was not run
            clauses[-1:] = [f"{clause}." for clause in clauses[-1:]]
        sentences += ["; ".join(clauses)] * bool(clauses)
    return " ".join(sentences)
