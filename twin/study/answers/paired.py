"""Two variants compared over the same samples: in how many samples a metric is lower, and the mean difference."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from twin.study.design import SAMPLED, Study

if TYPE_CHECKING:
    from twin.arrays import Array
    from twin.study.execution.case_table import CaseTable

INDEPENDENT_SAMPLES = ("latin_hypercube", "sobol", "random")  # of which an interval of the mean has a meaning
MIN_SAMPLES = 10  # for an interval
RESAMPLES = 2000
MAX_BOOTSTRAP = 2000  # samples; above, the mean is normal, and the jackknife of so many takes minutes


@dataclass(frozen=True)
class PairedDifference:
    """A metric of variant `second` minus that of `first`, sample by sample [SI].

    `lower`, `higher`: samples in which the second's is; `count`: all in which both have a value, `without` those in which
    one has none. `low`, `high`: confidence interval of the mean; NaN for few samples and for designs that are no random
    sample. `is_expected`: an expectation of the scenario orders the two.
    """

    metric: str
    first: str
    second: str
    lower: int
    higher: int
    count: int
    without: int
    mean: float
    low: float
    high: float
    is_expected: bool


def paired_differences(cases: CaseTable) -> list[PairedDifference]:
    """Compare the first variant with each other one, and neighbors of ordered expectations, in every metric of both."""
    study = cases.study
    differences = []
    for metric in study.metrics.values():
        variants = [name for name in study.variants if not metric.variants or name in metric.variants]
        ordered = ordered_pairs(study, metric.name)
        pairs = dict.fromkeys([*ordered, *((variants[0], name) for name in variants[1:])] if variants else [])
        values = {variant: sample_means(cases, metric.name, variant) for pair in pairs for variant in pair}
        for first, second in pairs:
            samples = sorted(values[first].keys() & values[second].keys())
            delta = np.array([values[second][sample] - values[first][sample] for sample in samples])
            finite = delta[np.isfinite(delta)]
            if len(finite):
                differences.append(
                    PairedDifference(
                        metric.name,
                        first,
                        second,
                        int(np.sum(finite < 0)),
                        int(np.sum(finite > 0)),
                        len(finite),
                        len(delta) - len(finite),
                        float(finite.mean()),
                        *mean_interval(finite, study),
                        (first, second) in ordered,
                    )
                )
    return differences


def ordered_pairs(study: Study, metric: str) -> list[tuple[str, str]]:
    """Neighbors in the ordered expectations of a metric, of variants that the study runs."""
    return [
        pair
        for expectation in study.scenario.expectations
        if expectation.metric == metric
        for pair in itertools.pairwise(expectation.ordered)
        if set(pair) <= set(study.variants)
    ]


def sample_means(cases: CaseTable, metric: str, variant: str) -> dict[int, float]:
    """Metric of a variant by sample: the mean over the sample's seeds, which are no independent samples."""
    values = cases.metric(metric)
    by_sample: dict[int, list[float]] = {}
    for i in cases.where(SAMPLED, variant):
        by_sample.setdefault(cases.requests[i].sample, []).append(float(values[i]))
    return {sample: float(np.mean(own)) for sample, own in by_sample.items()}


def mean_interval(differences: Array, study: Study) -> tuple[float, float]:
    """Bias-corrected and accelerated bootstrap interval of the mean (Efron, J. Am. Stat. Assoc. 82, 1987).

    Above `MAX_BOOTSTRAP` samples that of a normal mean. Of a Latin hypercube or Sobol sequence, whose means vary less than
    those of random samples, the interval is too wide rather than too narrow.
    """
    confidence = study.keys.confidence
    if study.design.method not in INDEPENDENT_SAMPLES or len(differences) < MIN_SAMPLES:
        return float("nan"), float("nan")
    if np.ptp(differences) == 0.0:
        return float(differences[0]), float(differences[0])
    if len(differences) > MAX_BOOTSTRAP:
        ends = stats.norm.interval(confidence, float(differences.mean()), float(stats.sem(differences)))
        return float(ends[0]), float(ends[1])
    generator = np.random.default_rng(study.keys.samples.seed)
    interval = stats.bootstrap(
        (differences,),
        np.mean,
        n_resamples=RESAMPLES,
        confidence_level=confidence,
        rng=generator,
        batch=max(1, 1_000_000 // len(differences)),
    ).confidence_interval
    return float(interval.low), float(interval.high)
