"""Shape of a study file: keys, their types and what they mean. Names and units are checked in `loading`."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from twin.identify import listed, shorthand
from twin.scenario import Keys, Moment, Period, Reference, Seed, Text, Value, first_unit

Share = Annotated[float, Field(gt=0.0, lt=1.0)]


def part(value: Any) -> Any:
    """A part of one, from `95 %` or 0.95."""
    try:
        return float(value.rstrip().removesuffix("%")) / 100 if isinstance(value, str) else float(value)
    except (TypeError, ValueError):
        raise ValueError("expected a part of one, such as 95 %") from None


Part = Annotated[Share, BeforeValidator(part)]
Parts = Annotated[list[Part], BeforeValidator(listed)]
Names = Annotated[list[Text], BeforeValidator(listed)]
References = Annotated[list[Reference], BeforeValidator(listed)]
Pair = Annotated[list[Value], Field(min_length=2, max_length=2)]


class FactorKeys(Keys):
    """What varies: variables that are set, or multiplied, and how it is distributed.

    Without `sets` and `scales` the factor's own name is the variable. `normal`: mean and standard deviation; `log_normal`:
    median and geometric standard deviation, a plain number; `from` and `to` truncate. `grid`: first, last, count.
    `at`: time at which the value takes effect, as an event; by default from the start.
    """

    sets: References = Field(default_factory=list)
    scales: References = Field(default_factory=list)
    uniform: Pair | None = None
    log_uniform: Pair | None = None
    normal: Pair | None = None
    log_normal: Pair | None = None
    values: list[Value] | None = None
    grid: Annotated[list[Value], Field(min_length=3, max_length=3)] | None = None
    low: Value | None = Field(None, alias="from")
    high: Value | None = Field(None, alias="to")
    source: Text = ""
    at: Moment | None = None

    @property
    def stated_unit(self) -> str:
        """Unit in which the file states the values; "" for bare numbers."""
        raws = (self.uniform, self.log_uniform, self.normal, self.log_normal, self.values, self.grid)
        return first_unit([raw for given in raws for raw in given or []] + [self.low, self.high])


class EstimateKeys(Keys):
    """A file that `twin identify` wrote. `names`: what an unknown of it is called in this scenario."""

    file: Text
    names: dict[Text, Reference] = Field(default_factory=dict)


class CorrelationKeys(Keys):
    """Two factors that vary together: the correlation of their normal scores."""

    factors: Annotated[list[Text], Field(min_length=2, max_length=2)]
    coefficient: Annotated[float, Field(gt=-1.0, lt=1.0)]


class SamplesKeys(Keys):
    """How the factors are sampled. `count`: samples; of a Sobol sensitivity its base, of Morris its trajectories."""

    method: Literal["latin_hypercube", "sobol", "random", "grid", "one_at_a_time", "sensitivity", "morris"] = (
        "latin_hypercube"
    )
    count: Annotated[int, Field(strict=True, ge=1, le=1_000_000)] = 100
    seed: Seed = 1
    seeds: Annotated[list[Seed] | Literal["own"], Field()] = (
        "own"  # of the scenario: each sample its own, or all of these
    )


class SignalKeys(Keys):
    """A signal of which the spread over all cases is kept, over time."""

    signal: Text
    unit: Text = ""


class KeepKeys(Keys):
    """What is kept besides metrics. `bands`: of all cases; whole recordings of so many `worst` of each metric, of so many `failed` in all."""

    bands: dict[Text, Annotated[SignalKeys, shorthand("signal")]] = Field(default_factory=dict)
    every: Period = 50_000_000
    failed: Annotated[int, Field(strict=True, ge=0, le=1000)] = 0
    worst: Annotated[int, Field(strict=True, ge=0, le=1000)] = 0


class LimitKeys(Keys):
    """What a tuning has to keep: a metric's statistic below or above a limit, or how often an expectation holds."""

    metric: Text = ""
    expectation: Text = ""
    of: Literal["mean", "median", "quantile", "max", "min"] = "mean"
    quantile: Part = 0.95
    at_most: Value | None = None
    at_least: Value | None = None


class SearchKeys(Keys):
    """The worst case within the factors' distributions, found by optimization instead of by chance."""

    metric: Text
    variant: Text = ""
    goal: Literal["max", "min"] = "max"
    evaluations: Annotated[int, Field(strict=True, ge=8, le=100_000)] = 200
    inside: Part = 0.95  # of each factor's distribution
    seed: Seed = 1


class KnobKeys(Keys):
    """What is tuned, and between which values."""

    sets: References = Field(default_factory=list)
    low: Value = Field(alias="from")
    high: Value = Field(alias="to")
    scale: Literal["linear", "log"] = "linear"

    @property
    def stated_unit(self) -> str:
        """Unit in which the file states the limits; "" for bare numbers."""
        return first_unit([self.low, self.high])


class TuneKeys(Keys):
    """The best values of some parameters over all samples, by an objective and limits."""

    variant: Text = ""
    knobs: Annotated[dict[Text, KnobKeys], Field(min_length=1)]
    metric: Text
    of: Literal["mean", "median", "quantile", "max", "min"] = "mean"
    quantile: Part = 0.95
    goal: Literal["max", "min"] = "min"
    limits: list[LimitKeys] = Field(default_factory=list)
    trials: Annotated[int, Field(strict=True, ge=2, le=10_000)] = 50
    seed: Seed = 1


class StudyKeys(Keys):
    """A study file."""

    title: Text = ""
    description: Text = ""
    scenario: Text
    variants: Names = Field(default_factory=list)
    metrics: Names = Field(default_factory=list)  # that are told of; none named: all
    set: dict[Text, Value] = Field(default_factory=dict)
    samples: SamplesKeys = SamplesKeys()
    vary: dict[Text, FactorKeys] = Field(default_factory=dict)
    estimates: list[EstimateKeys] = Field(default_factory=list)
    correlated: list[CorrelationKeys] = Field(default_factory=list)
    keep: KeepKeys = KeepKeys()
    quantiles: Parts = Field(default_factory=lambda: [0.05, 0.5, 0.95])
    confidence: Part = 0.95
    worst: SearchKeys | None = None
    tune: TuneKeys | None = None
