"""The opened runs, their cases in one list, and samples of expressions."""

from __future__ import annotations

import ast
from dataclasses import dataclass, replace
from functools import cached_property
from string import ascii_uppercase
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.component import unit as units
from twin.errors import ScenarioError, TwinError, UnknownNameError, nearest
from twin.results import Signals, dimension, expression, si_conversion
from twin.viewer import following
from twin.viewer.live_run import GrowingRecording, UnfinishedRun, is_running
from twin.viewer.recording import ColumnCache, ParquetRecording
from twin.viewer.verdicts import Verdicts

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from twin.face import Run
    from twin.results import Expression, RecordedVariable
    from twin.viewer.recording import RecordedColumns

    Array = np.ndarray[Any, Any]

MAX_RUNS = len(ascii_uppercase)  # runs
PARTS = ("mean", "low", "high")  # of the values of several seeds


@dataclass(frozen=True)
class RecordedCase:
    """One case of one run; `begin`, `end`: of its recording [s]."""

    run: int
    variant: str
    seed: int
    begin: float
    end: float
    samples: int

    @property
    def key(self) -> tuple[str, int]:
        """Variant and seed."""
        return self.variant, self.seed


@dataclass(frozen=True)
class ViewedCurve:
    """A drawn line: an expression in a case, optionally minus the same in case `minus`, over time or over `x`.

    `shift`: added to the times of `minus` [s] to align runs. `seeds`: cases whose mean, lowest or highest value (`part`) is
    drawn at the times of `case`; `partners`: what is subtracted from each of them.
    """

    signal: str
    case: int
    minus: int | None = None
    shift: float = 0.0
    x: str = ""
    seeds: tuple[int, ...] = ()
    partners: tuple[int, ...] = ()
    part: str = "mean"


@dataclass(frozen=True)
class CurveSamples:
    """All values of a curve: `y` over `time` [s] or over `x`. Displayed as `factor * y + offset`, in `unit`.

    `is_real`: interpolated between samples; otherwise constant until the next sample, as integers and Booleans.
    """

    time: Array
    y: Array
    unit: str = ""
    factor: float = 1.0
    offset: float = 0.0
    is_real: bool = True
    is_boolean: bool = False

    def shown(self, values: Array) -> Array:
        """Return values in the display unit, Float64."""
        values = np.asarray(values, np.float64)
        return values if (self.factor, self.offset) == (1.0, 0.0) else values * self.factor + self.offset


class OpenRun:
    """An opened run: its recording and its summary."""

    def __init__(self, run: Run | UnfinishedRun, cache: ColumnCache) -> None:
        self.run, self.folder, self.summary = run, run.folder, run.summary
        self.recording: RecordedColumns = (
            GrowingRecording(run.folder, cache) if isinstance(run, UnfinishedRun) else recording_of(run, cache)
        )
        self.variables: dict[str, RecordedVariable] = self.recording.variables

    @property
    def scenario_file(self) -> Path:
        """The scenario of the run: of a session the one with its commands."""
        operated = self.folder / "operated.yaml"
        return operated if operated.exists() else self.folder / "scenario.yaml"

    @cached_property
    def verdicts(self) -> Verdicts:
        """Expectations, metrics, events and plots of the run."""
        return Verdicts(self)

    def display_unit(self, column: str) -> str:
        """Return the unit in which a column is shown: that of its metrics, else its own."""
        variable = self.variables.get(column) or self.variables[column.partition("[")[0]]
        return self.verdicts.units.get(column) or variable.display_unit or variable.unit

    def parse(self, text: str) -> Expression:
        """Return an expression over recorded signals; TwinError if it is invalid."""
        result = expression.parse(text)
        for signal in result.signals:
            if signal.name not in self.variables:
                raise UnknownNameError(f"{signal.name!r} was not recorded. {nearest(signal.name, self.variables)}")
        shapes = {signal.name: self.variables[signal.name].shape for signal in result.signals}
        try:
            problem = result.array_problem(shapes)
        except IndexError as error:
            raise UnknownNameError(f"{error} has no such element. Elements are counted from 1.") from None
        if problem:
            raise ScenarioError(problem)
        return result

    def unit(self, parsed: Expression) -> str:
        """Return the display unit of an expression; ScenarioError if dimensions do not match."""
        if judged := self.verdicts.units.get(ast.unparse(parsed.tree)):
            return judged
        own = {signal.name: self.variables[signal.name] for signal in parsed.signals}
        result = dimension.expression_measure(parsed, {name: variable.unit for name, variable in own.items()})
        return dimension.preferred_unit(
            result,
            {name: variable.unit for name, variable in own.items()},
            {name: variable.display_unit for name, variable in own.items()},
        )

    def samples(self, case: tuple[str, int], text: str) -> CurveSamples:
        """Return all samples of a column or an expression in a case; a plain signal is not copied."""
        time = self.recording.column(case, "time")
        if text in self.recording.column_indices:
            return self._compact(case, self._column(case, text, time), [text])
        parsed = self.parse(text)
        for signal in parsed.signals:
            if not self.recording.has(case, self.variables[signal.name].columns[0]):
                raise UnknownNameError(f"{case[0]}, seed {case[1]} has not recorded {signal.name}.")

        def make() -> tuple[Array, ...]:
            own = {signal.name: self.variables[signal.name] for signal in parsed.signals}
            values = {name: self.recording.values(case, name) for name in own}
            result = Signals(time, values, {name: variable.unit for name, variable in own.items()}).evaluate(parsed)
            assert result is not None
            return (np.asarray(result[1]),)

        (value,) = self.recording.cache.get((self.recording.path, case, parsed.text, "SI"), make)
        shown = self.unit(parsed)
        factor, offset = si_conversion(shown, dimension.is_difference(parsed))
        samples = CurveSamples(time, value, units.shown(shown), 1 / factor, -offset / factor)
        return self._compact(case, samples, [signal.name for signal in parsed.signals])

    def _compact(self, case: tuple[str, int], samples: CurveSamples, names: Sequence[str]) -> CurveSamples:
        """Return samples of a followed rig without the times at which nothing was measured; smoothed ones at their own times."""
        if not following.is_followed(self):
            return samples
        if all(map(following.is_smoothed, names)):
            own = self.recording.column(case, following.SMOOTHED_TIME)
            finite = np.isfinite(own)
            time, y = following.with_gaps(own[finite], samples.y[finite])
            return replace(samples, time=time, y=y)
        if not any(map(following.is_sparse, names)):
            return samples
        time, y = following.compact(samples.time, samples.y)
        return replace(samples, time=time, y=y)

    def _column(self, case: tuple[str, int], name: str, time: Array) -> CurveSamples:
        if not self.recording.has(case, name):
            raise UnknownNameError(f"{case[0]}, seed {case[1]} has not recorded {name}.")
        values = self.recording.column(case, name)
        variable = self.variables.get(name) or self.variables[name.partition("[")[0]]
        shown = self.display_unit(name)
        (factor, offset), (own, beyond) = si_conversion(shown), si_conversion(variable.unit)
        scale = (1.0, 0.0) if shown == variable.unit else (own / factor, (beyond - offset) / factor)
        return CurveSamples(
            time, values, units.shown(shown), *scale, values.dtype.kind == "f", self.recording.is_boolean(name)
        )


def open_recorded_run(folder: Path) -> Run | UnfinishedRun:
    """Return a run by its folder, finished or in progress; TwinError if there is none."""
    from twin.face import open_run

    return UnfinishedRun(folder) if is_running(folder) else open_run(folder)


def recording_of(run: Run, cache: ColumnCache) -> ParquetRecording:
    """Return the recording of a finished run."""
    path = run.folder / "signals.parquet"
    if not path.is_file():
        raise TwinError(f"{path}: does not exist any more. Run the scenario again.")
    return ParquetRecording(path, cache)


class RunCollection:
    """The opened runs, named A, B, C in the given order."""

    def __init__(self, opened: Sequence[Run | UnfinishedRun], cache: ColumnCache | None = None) -> None:
        if len(opened) > MAX_RUNS:
            raise TwinError(f"{len(opened)} runs: at most {MAX_RUNS} are viewed together. Name fewer.")
        self.cache = cache or ColumnCache()
        self.runs = [OpenRun(run, self.cache) for run in opened]
        if not self.cases:
            raise TwinError(f"{opened[0].folder}: no signals were recorded. Run the scenario again.")

    @cached_property
    def cases(self) -> list[RecordedCase]:
        """The cases of all runs in order."""
        return [
            RecordedCase(number, *key, *run.recording.span(key), run.recording.samples(key))
            for number, run in enumerate(self.runs)
            for key in run.recording.cases
        ]

    @property
    def growing(self) -> list[int]:
        """Numbers of the runs in progress."""
        return [number for number, run in enumerate(self.runs) if isinstance(run.recording, GrowingRecording)]

    def following(self) -> dict[str, Any] | None:
        """Return the status of the first followed rig, with its number; None if there is none."""
        for number, run in enumerate(self.runs):
            if content := following.status(run):
                return content | {"run": number}
        return None

    def progress(self) -> dict[str, Any]:
        """Return the progress of runs for polling; `over`: the page must be reloaded."""
        with self.cache.lock:
            over = self.refresh()
            return {
                "over": over,
                "problem": [] if over else [text for number in self.growing if (text := self.problem(number))],
                "cases": [[case.begin, case.end, case.samples] for case in self.cases],
                "following": self.following(),
            }

    def problem(self, number: int) -> str:
        """Return why a run in progress does not continue, or nothing."""
        try:
            UnfinishedRun(self.runs[number].folder)
        except TwinError as error:
            return error.problems[0]
        return ""

    def refresh(self) -> bool:
        """Read new rows of the runs in progress; return whether one has finished."""
        from twin.face import open_run

        ended = False
        for number in self.growing:
            recording = self.runs[number].recording
            assert isinstance(recording, GrowingRecording)
            if recording.is_over:
                self.cache.forget(recording.path)
                self.runs[number] = OpenRun(open_run(recording.folder), self.cache)
                ended = True
            elif recording.refresh():
                self.__dict__.pop("cases", None)
        if ended:
            self.__dict__.pop("cases", None)
        return ended

    def run_of(self, case: RecordedCase) -> OpenRun:
        """Return the run of a case."""
        return self.runs[case.run]

    def label(self, case: RecordedCase) -> str:
        """Return `A: PI, seed 1`, without letter for a single run."""
        letter = f"{ascii_uppercase[case.run]}: " if len(self.runs) > 1 else ""
        return f"{letter}{case.variant}, seed {case.seed}"

    def samples(self, curve: ViewedCurve, text: str = "") -> CurveSamples:
        """Return all samples of a curve; UnknownNameError or ScenarioError if there are none."""
        if curve.seeds:
            return self._across_seeds(curve, text or curve.signal)
        case = self.cases[curve.case]
        own = self.run_of(case).samples(case.key, text or curve.signal)
        if curve.minus is None:
            return own
        return self._difference(curve, own, text or curve.signal)

    def _across_seeds(self, curve: ViewedCurve, text: str) -> CurveSamples:
        """Return mean, lowest or highest value of several cases, at the first case's times; missing values are left out."""
        own = self.samples(ViewedCurve(text, curve.case, curve.minus, curve.shift))
        partners = curve.partners or (None,) * len(curve.seeds)

        def make() -> tuple[Array, ...]:
            count, total = np.zeros(len(own.time)), np.zeros(len(own.time))
            low, high = np.full(len(own.time), np.nan), np.full(len(own.time), np.nan)
            for number, partner in zip(curve.seeds, partners, strict=True):
                other = self.samples(ViewedCurve(text, number, partner, curve.shift))
                if other.unit != own.unit:
                    raise ScenarioError(f"{text}: its unit differs between seeds. Show the seeds separately.")
                y = interpolate(own.time, other)
                y[own.time > self.cases[number].end] = np.nan  # it ended earlier
                finite = np.isfinite(y)
                count += finite
                total[finite] += y[finite]
                low, high = np.fmin(low, y), np.fmax(high, y)
            with np.errstate(invalid="ignore"):
                return total / count, low, high

        paths = (self.run_of(self.cases[number]).recording.path for number in (*curve.seeds, *curve.partners))
        key = (*paths, curve.seeds, curve.partners, curve.shift, text)
        y = self.cache.get(key, make)[PARTS.index(curve.part)]
        return CurveSamples(own.time, y, own.unit, is_real=own.is_real)

    def _difference(self, curve: ViewedCurve, own: CurveSamples, text: str) -> CurveSamples:
        """Return the difference of two cases, at the first case's times within both recordings."""
        assert curve.minus is not None
        case, other = self.cases[curve.case], self.cases[curve.minus]
        less = self.run_of(other).samples(other.key, text)
        if own.unit != less.unit:
            raise ScenarioError(
                f"{text}: in {own.unit or 'no unit'} and in {less.unit or 'no unit'}. Compare quantities of one unit."
            )

        def make() -> tuple[Array, ...]:
            when = own.time - curve.shift
            both = (when >= other.begin) & (when <= other.end) if len(less.time) else np.zeros(len(when), bool)
            when = when[both]
            y = own.shown(own.y[both]) - interpolate(when, less)
            return own.time[both], y

        key = (
            self.run_of(case).recording.path,
            case.key,
            text,
            self.run_of(other).recording.path,
            other.key,
            curve.shift,
        )
        time, y = self.cache.get(key, make)
        return CurveSamples(time, y, own.unit, is_real=own.is_real)


def interpolate(when: Array, samples: CurveSamples) -> Array:
    """Return display values at other times: linear, or the last value of integers and Booleans."""
    if not len(samples.time):
        return np.full(np.shape(when), np.nan)
    if samples.is_real:
        return samples.shown(np.interp(when, samples.time, samples.y))
    return samples.shown(samples.y[np.clip(np.searchsorted(samples.time, when, side="right") - 1, 0, None)])
