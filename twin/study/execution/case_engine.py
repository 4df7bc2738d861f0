"""Many cases of a scenario in one process: members are made once for each variant, and taken back to that for each case.

No import, build, check or file per case. What cannot go back, Python-side members and somebody else's FMUs, is made anew.
Cases that are equal up to a time share the run until then: it is computed once, and its state restored for each of them.
The bits do not depend on which cases ran before, nor in which process.
"""

from __future__ import annotations

import base64
import time
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from twin import clock
from twin.arrays import Array
from twin.coupling import (
    Catalog,
    CoSimulation,
    MemoryRecorder,
    RecordMember,
    SavedState,
    restore_state,
    save_state,
    serialization_problems,
)
from twin.errors import SimulationError, TwinError
from twin.results import Expectation, Expression, Signals, evaluate, expression, list_names
from twin.run import apply_analyses, build_simulation, noop, recorded_signals, resolve_catalogs, run_case
from twin.scenario import Backend, Case, RecordSpec, ScenarioSpec, load_scenario
from twin.study.design import CommonPrefixes, Factor, StudyRequest, VariantInputs, is_cut

BUFFER_BYTES = 1 << 20
DONE, FAILED = "done", "failed"


@dataclass(frozen=True)
class Job:
    """What a process has to know of a study: told once, before its first case. All of it can be pickled.

    `scenario`: path of the frozen file, `options`: those that made it what it is. `bands`: expressions of which samples are kept every `every_ns`.
    """

    scenario: Path
    options: tuple[str, ...]
    factors: tuple[Factor, ...]
    bands: tuple[tuple[str, str], ...]
    every_ns: int
    build: Path


@dataclass
class Row:
    """What came out of a case. `metrics`: SI, None without a value; `holds`: of each expectation, None if it does not apply.

    `extremes`: smallest and largest sample of the signal of each expectation that has one, SI; None of any other.
    `bands`: samples of signals, Float32 in base64. `seconds` and `process` are the only ones that another run will not repeat.
    """

    number: int
    status: str
    why: str
    metrics: tuple[float | None, ...]
    holds: tuple[bool | None, ...]
    seconds: float = 0.0
    bands: tuple[str, ...] = ()
    tries: int = 1
    extremes: tuple[Sequence[float] | None, ...] = ()


class Engine:
    """The scenario in this process, with the members of the variants that have run."""

    def __init__(self, job: Job) -> None:
        self.job = job
        self.scenario = load_scenario(job.scenario, job.options)
        self.catalogs = resolve_catalogs(self.scenario)
        self.bands = [expression.parse(text) for _, text in job.bands]
        self.prefixes = CommonPrefixes(self.scenario.variants, job.factors)
        self._states: dict[clock.Time, PrefixState] = {}
        self._cells: dict[str, Cell] = {}

    def cell(self, variant: str) -> Cell:
        """Members of a variant, created on first use."""
        if variant not in self._cells:
            (case,) = (case for case in self.scenario.variants if case.variant == variant)
            catalog = self.catalogs[variant]
            slim = replace(case, record=needed(self.scenario, self.bands, case, catalog), threads=1)
            inputs = VariantInputs(slim, catalog, self.job.factors)
            self._cells[variant] = Cell(inputs, catalog, self.job.build, self.prefixes, self._states)
        return self._cells[variant]

    def row(self, request: StudyRequest) -> Row:
        """Run a case and judge it."""
        begin = time.perf_counter()
        recorded: Signals | None = None
        status, why = DONE, ""
        try:
            recorded = self.cell(request.variant).run(request)
        except (TwinError, ArithmeticError, ValueError, LookupError) as error:  # of analyses too
            if isinstance(error.__cause__, MemoryError):
                raise MemoryError from error  # noqa: TRY004 - of this process, not of the case
            status, why = FAILED, str(error)
        row = self.judged(request, recorded, status, why)
        row.seconds = time.perf_counter() - begin
        return row

    def judged(self, request: StudyRequest, recorded: Signals | None, status: str, why: str) -> Row:
        """Metrics, verdicts and samples of what was recorded. A metric whose window the run does not reach has no value.

        Where the stop time is the reason, an expectation in the window does not fail either: a pass rate would have failures alone.
        """
        metrics, expectations = self.scenario.metrics, self.scenario.expectations
        if recorded is None:
            own = [request.variant in (expectation.variants or (request.variant,)) for expectation in expectations]
            alone = [
                not (expectation.ordered or expectation.mean or expectation.ends or expectation.nominal)
                for expectation in expectations
            ]
            lost = tuple(False if a and b else None for a, b in zip(own, alone, strict=True))
            return Row(request.number, status, why, (None,) * len(metrics), lost)
        recorded = apply_analyses(self.scenario, request.variant, recorded)
        evaluation = evaluate(metrics, expectations, {(request.variant, request.seed): recorded}, paper_applies=False)
        values = {
            result.metric.name: None if result.verdict == "cut" else result.values[request.seed]
            for result in evaluation.metric_results
        }
        verdicts: list[bool | None] = []
        for expectation, outcome in zip(expectations, evaluation.expectation_results, strict=True):
            is_judged = not (
                expectation.ordered or expectation.mean or expectation.ends or outcome.verdict == "skipped"
            )
            is_judged &= not is_cut(self.scenario, request.variant, expectation)
            verdicts.append(outcome.verdict == "pass" if is_judged else None)
            if is_judged and outcome.verdict == "fail" and not why:
                why = f"{outcome.name}: {outcome.detail}"
        why = " ".join(filter(None, [why, *self.missing_values(request.variant, values)]))
        bands = tuple(self.sampled(band, recorded) for band in self.bands)
        extremes = tuple(extreme_samples(recorded, expectation) for expectation in expectations)
        metric_values = tuple(values.get(metric) for metric in metrics)
        return Row(request.number, status, why, metric_values, tuple(verdicts), bands=bands, extremes=extremes)

    def missing_values(self, variant: str, values: Mapping[str, float | None]) -> list[str]:
        """Sentences on the metrics of a variant that have no value."""
        names: dict[str, list[str]] = {}
        for name, value in values.items():
            if value is None:
                is_short = is_cut(self.scenario, variant, self.scenario.metrics[name])
                reason = "the case ends before their window" if is_short else "no finite sample in their window"
                names.setdefault(reason, []).append(name)
        return [f"Without a value: {list_names(own)} ({reason})." for reason, own in names.items()]

    def sampled(self, signal: Expression, recorded: Signals) -> str:
        """A signal at multiples of the study's period, as text; empty if this variant has not got it."""
        if not recorded.has(signal) or (evaluated := recorded.evaluate(signal)) is None:
            return ""
        when, values = evaluated
        every = self.job.every_ns * 1e-9
        sample_times = np.arange(np.ceil(when[0] / every - 1e-9), np.floor(when[-1] / every + 1e-9) + 1) * every
        sampled_values = np.asarray(values)[np.minimum(np.searchsorted(when, sample_times - 1e-9), len(when) - 1)]
        return base64.b64encode(sampled_values.astype(np.float32).tobytes()).decode()

    def close(self) -> None:
        """Free all members."""
        for cell in self._cells.values():
            cell.close()
        self._cells.clear()


def extreme_samples(recorded: Signals, expectation: Expectation) -> tuple[float, float] | None:
    """Return the smallest and the largest sample of an expectation's signal in its window; None without finite ones."""
    if expectation.signal is None or not recorded.has(expectation.signal):
        return None
    parts = [values for _, values in recorded.evaluate_parts(expectation.signal, expectation.window) if len(values)]
    ends = [float(end([end(part) for part in parts])) for end in (np.min, np.max)] if parts else [np.nan]
    return (ends[0], ends[-1]) if np.isfinite(ends).all() else None


@dataclass(frozen=True)
class PrefixState:
    """State of a case at a time [ns], with the rows recorded until then. `key`: cases with an equal one have this state."""

    time_ns: clock.Time
    key: Hashable
    saved: SavedState
    rows: Array

    @property
    def met(self) -> tuple[tuple[clock.Time, int], ...]:
        """Time [ns] and index of each condition that was met."""
        return self.saved.met


class PrefixStates:
    """States at the times at which cases begin to differ, each of the last case that computed it; for `run_case`.

    `keys`: of a case, by these times. The case continues from the latest state that it has in common with another one.
    """

    def __init__(self, states: dict[clock.Time, PrefixState], keys: Mapping[clock.Time, Hashable]) -> None:
        self._states, self._keys = states, keys
        common = [state for time_ns, state in states.items() if keys.get(time_ns) == state.key]
        self.start = max(common, key=lambda state: state.time_ns, default=None)

    def next_time(self, now: clock.Time) -> clock.Time | None:
        """Return the next time after `now` [ns] at which the state is saved; None if there is none."""
        return min((time_ns for time_ns in self._keys if time_ns > now), default=None)

    def restore(self, cosimulation: CoSimulation) -> None:
        """Restore the common state, and the rows recorded until then."""
        assert self.start is not None
        assert isinstance(cosimulation.recorder, MemoryRecorder)
        restore_state(cosimulation, self.start.saved)
        cosimulation.recorder.add(self.start.rows)

    def write(self, cosimulation: CoSimulation) -> None:
        """Save the state at the communication point reached."""
        now = cosimulation.time
        state = PrefixState(now, self._keys[now], save_state(cosimulation), cosimulation.recorder.words())
        self._states[now] = state


class Cell:
    """A variant's members, and how they were made. `states`: states that its cases have in common with others."""

    def __init__(
        self, inputs: VariantInputs, catalog: Catalog, build: Path, prefixes: CommonPrefixes, states: dict[Any, Any]
    ) -> None:
        self.inputs, self.catalog, self.build, self.prefixes, self.states = inputs, catalog, build, prefixes, states
        self._first: CoSimulation | None = build_simulation(
            inputs.case, catalog, Backend.compiled, build, MemoryRecorder(BUFFER_BYTES)
        )
        own = self._first.members
        self._times = () if serialization_problems(own) else prefixes.times
        self._saved: dict[str, Any] = {}
        if all(isinstance(member, RecordMember) and member.has_cheap_fmu_state for member in own.values()):
            self._saved = {name: member.save() for name, member in own.items()}
        else:
            self._first.terminate()
            self._first = None

    def run(self, request: StudyRequest) -> Signals:
        """What the case records; SimulationError if it fails."""
        values = self.inputs.assignment.values(request.all_values)
        case = self.inputs.with_events(request)
        keys = {time_ns: self.prefixes.key(self.inputs, request, time_ns) for time_ns in self._times}
        simulated = self._again(values, request.seed) if self._first else self._anew(values, request.seed)
        try:
            run_case(case, simulated, noop, PrefixStates(self.states, keys) if keys else None)
            if simulated.finished and not simulated.conditions.has_stopped:
                raise SimulationError(simulated.failure)
            recorded = recorded_signals(simulated, complete=True)
            if spell := simulated.watch.spell([(recorded.time, recorded.values)]):
                raise SimulationError(spell)
        finally:
            if self._first is None:
                simulated.terminate()
        return recorded

    def _again(self, values: Mapping[tuple[str, str], Any], seed: int) -> CoSimulation:
        """The members as they were made, with other values."""
        first = self._first
        assert first is not None
        for name, saved in self._saved.items():
            first.members[name].restore(saved)
            first.members[name].log.clear()
        for (name, variable), value in (self.inputs.seeds(seed) | dict(values)).items():
            first.members[name].set(variable, value)
        exempt = [name for name, spec in self.inputs.case.members.items() if not spec.finite]
        return first.renewed(recorder=MemoryRecorder(BUFFER_BYTES), exempt=exempt)

    def _anew(self, values: Mapping[tuple[str, str], Any], seed: int) -> CoSimulation:
        """New members with these values."""
        members = dict(self.inputs.case.members)
        for (name, variable), value in values.items():
            own = {**members[name].parameters, variable: np.asarray(value).tolist()}
            members[name] = replace(members[name], parameters=own)
        case = replace(self.inputs.case, members=members, seed=seed)
        return build_simulation(case, self.catalog, Backend.compiled, self.build, MemoryRecorder(BUFFER_BYTES))

    def close(self) -> None:
        """Free the members."""
        if self._first is not None:
            self._first.terminate()


def needed(scenario: ScenarioSpec, bands: Sequence[Expression], case: Case, catalog: Catalog) -> RecordSpec:
    """What metrics, expectations, analyses and bands read: nothing else is recorded."""
    expressions = [metric.signal for metric in scenario.metrics.values()]
    expressions += [expectation.signal for expectation in scenario.expectations if expectation.signal]
    expressions += [signal for analysis in scenario.analyses for signal in analysis.inputs.values()]
    names = dict.fromkeys(signal.name for expression in (*expressions, *bands) for signal in expression.signals)
    first = next(iter(case.record.select(catalog)), "")
    return replace(case.record, patterns=tuple(names) or (first,), needed=())  # no pattern would be everything
