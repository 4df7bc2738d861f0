"""Step refinement: comparison of a case with the same at half the step, as an estimate of the coupling error."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.errors import TwinError
from twin.results import MetricResult, compute_metric, si_conversion
from twin.run.cases import Progress, apply_analyses, build_simulation, noop, recorded_signals, run_case

if TYPE_CHECKING:
    from pathlib import Path

    from twin.results import Signals
    from twin.run.cases import RunResult
    from twin.scenario import Backend, Case

MIN_RELATIVE_SIZE = 0.01


@dataclass(frozen=True)
class StepRefinement:
    """Metric of a case at its step and at half the step [SI]; None: not a number."""

    variant: str
    seed: int
    step: clock.Time
    metric_result: MetricResult
    value: float | None
    half: float | None

    @property
    def difference(self) -> float | None:
        """Change by the smaller step; for an algorithm of order one the remaining error is as large."""
        return None if self.value is None or self.half is None else self.half - self.value

    @property
    def part(self) -> float | None:
        """Difference relative to the value, or to a hundredth of the operands that the value is computed from."""
        difference = self.difference
        size = max(abs(self.half or 0.0), MIN_RELATIVE_SIZE * self.metric_result.scale)
        return None if difference is None or not size else abs(difference) / size

    @property
    def table_cells(self) -> dict[str, str]:
        """Texts for a table, in the metric's unit."""
        metric = self.metric_result.metric
        factor = si_conversion(metric.unit, is_difference=True)[0]
        difference = self.difference
        return {
            "variant": self.variant,
            "metric": metric.name,
            "value": metric.shown(self.value, self.metric_result.scale),
            "half": metric.shown(self.half, self.metric_result.scale),
            "difference": "-" if difference is None else f"{difference / factor:+.2g} {metric.unit}".rstrip(),
            "part": "-" if self.part is None else f"{100 * self.part:.2g} %",
        }

    def to_dict(self) -> dict[str, Any]:
        """Return the values for summary.json, SI."""
        return {
            "variant": self.variant,
            "seed": self.seed,
            "metric": self.metric_result.metric.name,
            "step": clock.seconds(self.step),
            "value": self.value,
            "half": self.half,
            "difference": self.difference,
        }


def refine_step(
    result: RunResult, case: Case, recorded_coarse: Signals, backend: Backend, build: Path, progress: Progress = noop
) -> list[StepRefinement]:
    """Compare the metrics of a finished case with those at half the step; TwinError if a member cannot make that step."""
    step = clock.to_time(Fraction(case.step_ns) / 2)
    fine_case = replace(case, step_ns=step, record=replace(case.record, every_ns=case.record.every_ns or case.step_ns))
    cosimulation = build_simulation(fine_case, result.catalogs[case.variant], backend, build)
    try:
        run_case(fine_case, cosimulation, lambda name, part: progress(f"{name}, half the step", part))
        recorded_fine = apply_analyses(result.scenario, case.variant, recorded_signals(cosimulation, True))
    except TwinError as error:
        raise TwinError(f"{case.name} at half the step, {clock.text(step)}: {error}") from error
    finally:
        cosimulation.terminate()
    refinements = []
    for metric in result.scenario.metrics.values():
        if metric.variants and case.variant not in metric.variants:
            continue
        coarse, fine = (
            compute_metric(metric, case.variant, {(case.variant, case.seed): recording})
            for recording in (recorded_coarse, recorded_fine)
        )
        if coarse.values:
            scaled = replace(coarse, scale=max(coarse.scale, fine.scale))
            refinements.append(StepRefinement(case.variant, case.seed, step, scaled, coarse.mean, fine.mean))
    return refinements


def summarize_refinements(rows: list[StepRefinement]) -> str:
    """Summarize the largest change in one line."""
    relative_changes = [
        (refinement.part, refinement)
        for refinement in rows
        if refinement.part is not None and np.isfinite(refinement.part)
    ]
    if not relative_changes:
        return "half the step: no metric to compare"
    relative, refinement = max(relative_changes, key=lambda pair: pair[0])
    largest = f"{100 * relative:.2g} %"
    return f"half the step changes metrics by at most {largest} ({refinement.metric_result.metric.name}, {refinement.variant})"
