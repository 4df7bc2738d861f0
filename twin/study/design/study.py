"""A checked study: what runs in which case, as plain data, and what cannot be judged in a case."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from twin.scenario import ScenarioSpec, member_seed

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from twin.arrays import Array
    from twin.coupling import Catalog
    from twin.results import Expectation, Expression, Metric
    from twin.study.design.factor import Factor
    from twin.study.design.keys import StudyKeys
    from twin.study.design.sampling import Design

SAMPLED = "sample"  # part of a study; the others are `worst` and `tune`


@dataclass(frozen=True)
class StudyRequest:
    """One case: a variant with a seed and values of the factors, NaN where the scenario's own stay.

    `number` counts from 1 through the whole study, `sample` through its samples. `extra`: knobs of a tuning.
    """

    number: int
    part: str
    sample: int
    variant: str
    seed: int
    values: tuple[float, ...]
    extra: tuple[float, ...] = ()

    @property
    def all_values(self) -> tuple[float, ...]:
        """Of the factors, then of the knobs."""
        return self.values + self.extra


def is_cut(scenario: ScenarioSpec, variant: str, judged: Metric | Expectation) -> bool:
    """Whether a variant's stop time is more than an interval of its record before the end of what is judged."""
    (case,) = (case for case in scenario.variants if case.variant == variant)
    stop_ns = scenario.metrics.get(getattr(judged, "metric", None) or "", judged).window.stop_ns
    return stop_ns is not None and stop_ns - case.stop_ns > (case.record.every_ns or case.step_ns)


@dataclass(frozen=True)
class Knob:
    """What is tuned, between `low` and `high` in its variable's unit."""

    factor: Factor
    low: float
    high: float
    is_log: bool = False


@dataclass(frozen=True)
class Limit:
    """What a tuning has to keep, in SI: `statistic` of a metric, or the share of cases in which an expectation holds."""

    metric: str
    expectation: str
    statistic: str
    quantile: float
    at_most: float | None
    at_least: float | None
    text: str


@dataclass(frozen=True)
class Study:
    """A study file, checked against its scenario."""

    path: Path
    keys: StudyKeys
    scenario: ScenarioSpec
    catalogs: dict[str, Catalog]
    variants: tuple[str, ...]
    factors: tuple[Factor, ...]
    correlation: Array | None
    design: Design
    bands: dict[str, Expression] = field(default_factory=dict)
    band_units: dict[str, str] = field(default_factory=dict)
    knobs: tuple[Knob, ...] = ()
    limits: tuple[Limit, ...] = ()

    def __repr__(self) -> str:
        names = ", ".join(factor.name for factor in self.all_factors)
        return f"<Study {self.name}: {self.title}; variants {', '.join(self.variants)}; {self.count} cases; varies {names}>"

    @property
    def name(self) -> str:
        """Name of the file."""
        return self.path.stem

    @property
    def title(self) -> str:
        """Title."""
        return self.keys.title or f"Study of {self.scenario.title}"

    @property
    def metrics(self) -> dict[str, Metric]:
        """Metrics of the scenario that are reported: those that are named, else all that any variant has."""
        chosen = set(self.variants)
        if self.keys.metrics:
            return {name: self.scenario.metrics[name] for name in self.keys.metrics}
        return {
            k: metric
            for k, metric in self.scenario.metrics.items()
            if not metric.variants or chosen & set(metric.variants)
        }

    @property
    def all_factors(self) -> tuple[Factor, ...]:
        """What varies, and the knobs of the tuning."""
        return (*self.factors, *(knob.factor for knob in self.knobs))

    def seeds(self, sample: int) -> list[int]:
        """Seeds of a sample, counted from 1: its own, or those that all samples have."""
        wanted = self.keys.samples.seeds
        if wanted == "own":
            return [member_seed(self.keys.samples.seed, f"{self.name}, sample {sample}")]
        return list(wanted)

    @property
    def per_sample(self) -> int:
        """Cases of each sample."""
        return len(self.variants) * len(self.seeds(1))

    @property
    def count(self) -> int:
        """Cases of all samples."""
        return len(self.design.values) * self.per_sample

    @property
    def searched_cases(self) -> dict[str, int]:
        """Number of cases of the searches by their variant; "": the study's first one."""
        worst, tune, counts = self.keys.worst, self.keys.tune, dict[str, int]()
        if worst is not None:
            counts[worst.variant] = worst.evaluations
        if tune is not None:
            trials = (tune.trials + 1) * len(self.design.values) * len(self.seeds(1))
            counts[tune.variant] = counts.get(tune.variant, 0) + trials
        return counts

    @property
    def total(self) -> int:
        """Cases in all, as far as their number is certain before the searches."""
        return self.count + sum(self.searched_cases.values())

    def requests(self) -> Iterator[StudyRequest]:
        """The cases of all samples, in order."""
        number = 0
        for sample, row in enumerate(self.design.values, 1):
            for variant in self.variants:
                for seed in self.seeds(sample):
                    number += 1
                    values = tuple(float(value) for value in row)
                    yield StudyRequest(
                        number, SAMPLED, sample, variant, seed, values, (float("nan"),) * len(self.knobs)
                    )

    def input_hashes(self) -> dict[str, Any]:
        """SHA-256 of the inputs that determine the results, by name, to detect changes."""
        texts = {
            "study file": json.dumps(
                self.keys.model_dump(mode="json", exclude={"title", "description"}), sort_keys=True
            ),
            "scenario": self.scenario.frozen(),
        }
        hashes = {name: hashlib.sha256(text.encode()).hexdigest() for name, text in texts.items()}
        return hashes | {"samples": hashlib.sha256(self.design.values.tobytes()).hexdigest()}
