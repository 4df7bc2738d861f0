"""What a case becomes at half its step: an estimate of what the coupling itself makes of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.errors import TwinError
from twin.results import Figure, coherent, figure
from twin.run.cases import Progress, analyzed, run_case, signals, silent, simulation

if TYPE_CHECKING:
    from pathlib import Path

    from twin.results import Signals
    from twin.run.cases import Outcome
    from twin.scenario import Case, Form

SMALL = 0.01


@dataclass(frozen=True)
class Halved:
    """A metric of a case at its step and at half of it [SI]; None: not a number."""

    variant: str
    seed: int
    step: clock.Time
    figure: Figure
    value: float | None
    half: float | None

    @property
    def difference(self) -> float | None:
        """What the smaller step changes; for an algorithm of order one as much again remains."""
        return None if self.value is None or self.half is None else self.half - self.value

    @property
    def part(self) -> float | None:
        """The difference as part of the value, or of a hundredth of the numbers that the value is made of."""
        gap = self.difference
        size = max(abs(self.half or 0.0), SMALL * self.figure.scale)
        return None if gap is None or not size else abs(gap) / size

    @property
    def cells(self) -> dict[str, str]:
        """As text, in the metric's unit."""
        metric = self.figure.metric
        factor = coherent(metric.unit, is_difference=True)[0]
        gap = self.difference
        return {
            "variant": self.variant,
            "metric": metric.name,
            "value": metric.shown(self.value, self.figure.scale),
            "half": metric.shown(self.half, self.figure.scale),
            "difference": "-" if gap is None else f"{gap / factor:+.2g} {metric.unit}".rstrip(),
            "part": "-" if self.part is None else f"{100 * self.part:.2g} %",
        }

    @property
    def plain(self) -> dict[str, Any]:
        """For summary.json, SI."""
        return {
            "variant": self.variant, "seed": self.seed, "metric": self.figure.metric.name,
            "step": clock.seconds(self.step), "value": self.value, "half": self.half, "difference": self.difference,
        }  # fmt: skip


def halved(
    outcome: Outcome, case: Case, whole: Signals, form: Form, build: Path, progress: Progress = silent
) -> list[Halved]:
    """The metrics of a case that ran, beside those at half its step; TwinError if a member cannot make that step."""
    step = clock.whole(Fraction(case.step_ns) / 2)
    finer = replace(case, step_ns=step, record=replace(case.record, every_ns=case.record.every_ns or case.step_ns))
    simulated = simulation(finer, outcome.catalogs[case.variant], form, build)
    try:
        run_case(finer, simulated, lambda name, part: progress(f"{name}, half the step", part))
        recorded = analyzed(outcome.scenario, case.variant, signals(simulated, True))
    except TwinError as error:
        raise TwinError(f"{case.name} at half the step, {clock.text(step)}: {error}") from error
    finally:
        simulated.terminate()
    found = []
    for metric in outcome.scenario.metrics.values():
        if metric.variants and case.variant not in metric.variants:
            continue
        one, other = (figure(metric, case.variant, {(case.variant, case.seed): each}) for each in (whole, recorded))
        if one.values:
            scaled = replace(one, scale=max(one.scale, other.scale))
            found.append(Halved(case.variant, case.seed, step, scaled, one.mean, other.mean))
    return found


def worst(rows: list[Halved]) -> str:
    """One line on all of them."""
    parts = [(one.part, one) for one in rows if one.part is not None and np.isfinite(one.part)]
    if not parts:
        return "half the step: no metric to compare"
    part, one = max(parts, key=lambda pair: pair[0])
    return f"half the step changes metrics by at most {100 * part:.2g} % ({one.figure.metric.name}, {one.variant})"
