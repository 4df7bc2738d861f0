"""A running simulation: advance, read, set."""

from __future__ import annotations

import logging
import threading
import time as wall
import weakref
from html import escape
from math import inf
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from twin import clock
from twin.coupling import MemoryRecorder, find
from twin.errors import CouplingError, SimulationError, TwinError, UnknownNameError
from twin.face import notebook
from twin.face.arrays import frame
from twin.face.conversions import convert, finite, nanoseconds, override_text
from twin.face.signal_plots import PlotSource, SignalPlots
from twin.files import split_unit
from twin.live import Pace, checked_rate
from twin.results import RecordedVariable
from twin.run import WARNING, apply_event, build_simulation, event_rows, recorded_signals
from twin.scenario import Backend, EventSpec, event_problems, has_source

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from pathlib import Path

    import pandas as pd
    from numpy.typing import NDArray

    from twin.component import Component
    from twin.coupling import Catalog, MemberVariable
    from twin.results import Plot, Signals
    from twin.scenario import Case

WHERE = "simulation"  # in messages
BUFFER_BYTES = 1 << 20  # for rows; small, since many short simulations are common


class Simulation(SignalPlots):
    """Running members: `simulation["member.variable"]` reads and writes, `advance` advances the time.

    Use it in a `with` statement: at its end all members are freed, and `results` stay.
    """

    def __init__(
        self,
        case: Case,
        catalog: Catalog,
        backend: Backend,
        build: Path,
        stops: bool,
        silent: bool,
        remarks: Callable[[str, str], list[str]] | None = None,
        plots: Sequence[Plot] = (),
    ) -> None:
        self._where, self._plots = WHERE, plots
        self._case, self._remarks = case, remarks
        self._targets = {connection.target for connection in case.system(catalog).single()[0]}
        self.notes = (
            [] if backend is Backend.interpreted else sourceless(member.made for member in self._case.members.values())
        )
        self._failed = ""
        self._set_keys: set[tuple[str, str]] = set()  # of variables that the person has set, and not overridden since
        self._signals: Signals | None = None
        self.rate = inf
        self._simulated = build_simulation(self._case, catalog, backend, build, MemoryRecorder(BUFFER_BYTES))
        if silent:
            self._simulated.recorded = []
        self._lock, self._is_closing = threading.RLock(), False
        self._close = weakref.finalize(self, self._simulated.terminate)
        self._catalog = {name: member.variables for name, member in self._simulated.members.items()}
        try:
            self._simulated.initialize(self._case.start_ns, self._case.stop_ns if stops else None)
            self._events = list(case.events)
            self._apply_due_events()
        except BaseException:
            self._close()
            raise

    @property
    def time(self) -> float:
        """Current communication point [s]."""
        return clock.seconds(self._simulated.time)

    @property
    def stop_time(self) -> float:
        """Last communication point [s]: that of the scenario or of `simulate`, a hundred days if none is given."""
        return clock.seconds(self._case.stop_ns)

    @property
    def rate(self) -> float:
        """Simulated over wall-clock time while advancing: 0.1 to 10, or inf: as fast as possible. Can be set at any time."""
        return self._pace.rate

    @rate.setter
    def rate(self, rate: float) -> None:
        self._pace = Pace(checked_rate(rate, "rate"), clock.seconds(self._case.step_ns))
        self._is_scheduled = False

    @property
    def lag(self) -> float:
        """Delay behind the schedule of `rate` [s]; beyond 0.25 s, also of your own code, it is not caught up."""
        return self._pace.lag

    @property
    def finished(self) -> bool:
        """Whether a member ended the simulation."""
        return self._simulated.finished

    @property
    def reason(self) -> str:
        """Why it ended before it was closed: a request or failure of a member."""
        return self._failed or self._simulated.failure

    @property
    def variables(self) -> tuple[str, ...]:
        """Names of all variables."""
        return tuple(f"{member}.{name}" for member, variables in self._catalog.items() for name in variables)

    def advance(
        self,
        duration: float | str | None = None,
        *,
        until: float | str | None = None,
        progress: Callable[[float], object] | None = None,
    ) -> float:
        """Advance by `duration`, or to the time `until`, or by one step if neither is given; return the time reached [s].

        Whole steps only; with a `rate` it returns when the wall clock is there. SimulationError if a member fails or has ended the
        simulation before; if it ends it now, `finished` is set. Recorded signals are kept. `progress` is called with the time [s]
        about twenty times a second.
        """
        if not self._lock.acquire(blocking=False):
            raise TwinError("advance: another thread is advancing the simulation. Wait for it, or create another one.")
        try:
            return self._advance(duration, until, progress)
        finally:
            self._lock.release()

    def _advance(
        self, duration: float | str | None, until: float | str | None, progress: Callable[[float], object] | None
    ) -> float:
        self._check_open()
        if self.finished:
            raise SimulationError(f"advance: the simulation has ended: {self.reason} Create a new one.")
        if duration is not None and until is not None:
            raise TwinError("advance: duration and until are both given. Keep one.")
        now = self._simulated.time
        end = nanoseconds(until, "until") if until is not None else now + self._case.step_ns
        if duration is not None:
            end = now + nanoseconds(duration, "duration")
        if end < now:
            raise TwinError(f"advance: {clock.text(end)} is before {clock.text(now)}. Time cannot go back.")
        if end > self._case.stop_ns:
            rest = self._case.stop_ns - now
            remedy = f"Advance by at most {clock.text(rest)} more." if rest else "Create a new simulation."
            raise TwinError(f"advance: {clock.text(end)} is after the stop, {clock.text(self._case.stop_ns)}. {remedy}")
        if (end - self._case.start_ns) % self._case.step_ns:
            what, begin = ("until", self._case.start_ns) if duration is None else ("duration", now)
            raise TwinError(
                f"advance: {what} {clock.text(end - begin)} is no multiple of the step, {clock.text(self._case.step_ns)}. Give a multiple."
            )

        report = None if progress is None else lambda time: progress(clock.seconds(time))
        try:
            while self._events and self._events[0].time_ns <= end and not (self.finished or self._is_closing):
                self._advance_paced(self._events[0].time_ns, report)
                self._apply_due_events()
            if not (self.finished or self._is_closing):
                self._advance_paced(end, report)
        except SimulationError as error:
            self._failed = str(error)
            raise
        return self.time

    def _advance_paced(self, end: clock.Time, report: Callable[[clock.Time], object] | None) -> None:
        """Advance to `end`: at once, or in blocks that each begin when the schedule of the rate says, and wait for its end."""
        simulated, pace = self._simulated, self._pace
        if pace.rate == inf:
            simulated.advance(end, report)
            return
        if not self._is_scheduled:
            pace.begin(wall.monotonic(), self.time)
            self._is_scheduled = True
        while simulated.time < end and not (self.finished or self._is_closing):
            before, begin = simulated.time, wall.monotonic()
            simulated.advance(min(end, before + pace.count() * self._case.step_ns), report)
            count = (simulated.time - before) // self._case.step_ns
            pace.record_block(begin, wall.monotonic(), clock.seconds(before), self.time, count)
            wall.sleep(max(pace.due(self.time) - wall.monotonic(), 0.0))

    def _apply_due_events(self) -> None:
        """Apply the events of the scenario up to the current time."""
        while self._events and self._events[0].time_ns <= self._simulated.time and not self.finished:
            apply_event(self._events.pop(0), self._case, self._simulated, self._catalog)

    def __getitem__(self, name: str) -> float | NDArray[Any]:
        """Return the current value of a variable or element `member.x[1]`: number, Boolean or array; text of an FMU's String.

        It is in the variable's own unit, or in that of a name like `wall.force [mN]`.
        A parameter or input that was set has its new value at once; the member uses it from its next step.
        """
        current: float | NDArray[Any] = self._value(name)
        return current

    def _value(self, name: str) -> Any:
        self._check_open()
        base, symbol = split_unit(name)
        if symbol:
            factor, offset = convert(self._find(base).variable.unit, symbol, base)
            return self[base] * factor + offset
        reference = self._find(name)
        variable = reference.variable
        if reference.key in self._set_keys:  # published at the member's next step
            value = np.asarray(self._simulated.members[reference.member].get(variable.name))
        else:
            value = self._simulated.value(reference.key)
        if variable.type == "Boolean":
            value = value.astype(np.bool_)  # a C int in FMI 2.0, a byte in an array
        if reference.element is not None:
            value = value.reshape(-1)[reference.element]
        is_array = variable.shape and reference.element is None
        return value if is_array else value.item()

    def variable(self, name: str) -> MemberVariable:
        """Return the declaration of a variable: unit, description, causality, bounds; UnknownNameError if there is none."""
        declaration: MemberVariable = self._find(name).variable
        return declaration

    def __setitem__(self, name: str, value: Any) -> None:
        """Set a tunable parameter or a free input, as text with a unit or a number in its own unit, from the member's next step on."""
        self._happen("set", name, value)

    def override(self, name: str, value: Any) -> None:
        """Replace an output, or the input of a member, by `value` for all readers."""
        self._happen("override", name, value)

    def release(self, name: str) -> None:
        """End an override; TwinError if there is none."""
        self._happen("release", name)

    def _happen(self, kind: str, name: str, value: Any = None) -> None:
        self._check_open()
        if self._find(name).element is not None and kind != "set":
            raise TwinError(f"{WHERE}: {name} is an element. Override or release all of {name.partition('[')[0]}.")
        event = EventSpec(self._simulated.time, kind, name, finite(value, f"{WHERE}: {name}"), WHERE)
        if problems := event_problems(event, self._catalog, self._targets):
            raise CouplingError(problems)
        if kind == "release" and name not in self._overridden:
            raise TwinError(f"{WHERE}: {name} is not overridden. {'; '.join(self._overridden) or 'Nothing'} is.")
        apply_event(event, self._case, self._simulated, self._catalog)
        if self._remarks is not None and value is not None:
            self._note_implausible(name, value, self._remarks)
        (self._set_keys.add if kind == "set" else self._set_keys.discard)(self._find(name).key)

    def _note_implausible(self, name: str, value: Any, remarks: Callable[[str, str], list[str]]) -> None:
        """Log and note, once, that a value is outside of the range that the scenario states, or far from its own."""
        member, _, variable = name.partition(".")
        previous = self._case.members[member].parameters.get(variable, "")
        for line in remarks(f"{name}={override_text(value)}", str(previous)):
            if line.startswith(WARNING) and line not in self.notes:
                self.notes.append(line)
                logging.getLogger("twin").warning("%s", line)

    def _find(self, name: str) -> Any:
        try:
            return find(name, self._catalog)
        except CouplingError as error:
            raise UnknownNameError(f"{WHERE}: {error}") from None

    def __contains__(self, name: object) -> bool:
        return name in self.variables

    def _ipython_key_completions_(self) -> list[str]:
        return list(self.variables)

    def _check_open(self) -> None:
        if not self._close.alive:
            raise TwinError(f"{WHERE}: is closed; `results` stay. Create a new one with `live` or `simulate`.")
        if self._failed:
            raise SimulationError(f"{WHERE}: has failed: {self._failed}")

    @property
    def results(self) -> pd.DataFrame:
        """Recorded signals: column `time` [s], then one for each scalar; units in `.attrs["units"]`."""
        signals = self._recording()
        return frame(signals.time, signals.values, signals.units)

    def _recording(self) -> Signals:
        return self._signals or recorded_signals(self._simulated, True)

    @property
    def _source(self) -> PlotSource:
        recording, case = self._recording(), self._case
        variables = {name: self._find(name).variable for name in recording.values}
        recorded = {
            name: RecordedVariable(
                name, values.dtype, values.shape[1:], variables[name].unit, variables[name].display_unit
            )
            for name, values in recording.values.items()
        }
        lines = [row.annotation for row in event_rows([case])]
        cases = {(case.variant, case.seed): recording}
        return PlotSource([case.variant], [case.seed], recorded, recorded, (), self._plots, lines, lambda _names: cases)

    def _repr_html_(self) -> str:
        """Return the outputs with their units, for notebooks."""
        if not self._close.alive:
            return notebook.page(notebook.paragraph(repr(self)))
        rows = [
            (
                escape(f"{member}.{name}"),
                notebook.value(self._value(f"{member}.{name}"), variable.unit, variable.display_unit),
                escape(variable.description),
            )
            for member, variables in self._catalog.items()
            for name, variable in variables.items()
            if variable.causality == "output" and variable.connectable and not variable.shape
        ]
        titles = {"output": "text", "value": "number", "description": "text"}
        return notebook.page(notebook.paragraph(repr(self)), notebook.table(titles, rows))

    def close(self) -> None:
        """Free all members; `results` stay. Safe to call twice."""
        self._is_closing = True  # ends `advance` in another thread
        with self._lock:
            if self._close.alive:
                self._signals = self._recording()
                self._close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def _overridden(self) -> list[str]:
        return [".".join(key) for key in self._simulated.overridden]

    def __repr__(self) -> str:
        state = self.reason or ("running" if self._close.alive else "closed")
        parts = {"members": list(self._catalog), "overridden": self._overridden}
        lists = "; ".join(f"{what} {', '.join(names)}" for what, names in parts.items() if names)
        return f"<Simulation of {self._case.name} at {clock.text(self._simulated.time)}: {state}; {lists}>"


def sourceless(classes: Iterable[type[Component] | None]) -> list[str]:
    """Return a note for each class that runs interpreted because its source is not available."""
    return [
        f"{cls.__name__} runs interpreted: its source cannot be found. Define it in a file or in a cell of a notebook."
        for cls in dict.fromkeys(classes)
        if cls is not None and not has_source(cls)
    ]
