"""A case that is to be run, as plain data, and what cannot be judged in it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from twin.results import Expectation, Metric
    from twin.scenario import ScenarioSpec

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
