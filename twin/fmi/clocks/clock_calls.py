"""The functions of FMI 3.0 for clocks as methods of an FMU: intervals, shifts, and which clocks tick."""

from __future__ import annotations

import ctypes
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.errors import FMUError
from twin.fmi import values
from twin.fmi.clocks.clock_declarations import PERIODIC, UNCHANGED, Clock, Timer, computed
from twin.fmi.importing.local_state import FMUWithSlots

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence


class ClockedFMU(FMUWithSlots):
    """An FMU with clocks. Intervals that are for the importer to choose are start values of the clocks [s]."""

    def _describe(self, start_values: dict[str, Any]) -> None:
        self._intervals: dict[str, float] = {}
        self._to_tick: list[str] = []  # clocks that are to tick at the next event
        super()._describe(start_values)
        declarations = self._unpacked.description.clocks
        self.clocks = {declaration.name: declaration for declaration in declarations.every}
        self.timers = {name: Timer(clock) for name, clock in self.clocks.items() if clock.is_time_based}
        self._sensed = [declaration for declaration in declarations.every if declaration.causality != "input"]

    def _start_values(self, given: dict[str, Any]) -> dict[str, np.ndarray[Any, Any]]:
        """Intervals of clocks, then values as of any FMU."""
        clocks = {clock.name: clock for clock in self._unpacked.description.clocks.every}
        for name in [name for name in given if name in clocks]:
            self._intervals[name] = self._interval(clocks[name], given.pop(name))
        return super()._start_values(given)

    def _interval(self, own: Clock, value: Any) -> float:
        if not own.is_settable:
            raise FMUError(
                f"{self.name}: {own.name} is a {own.variability} clock of the FMU's own interval. "
                "Give an interval only to fixed and tunable clocks that declare one."
            )
        seconds = values.real(value, f"{self.name}: {own.name}", np.dtype(np.float64))
        if not 0.0 < seconds < np.inf:
            raise FMUError(f"{self.name}: the interval {seconds:g} s of {own.name} is not positive. Give seconds.")
        return seconds

    def enter_initialization(self, t: float, stop: float | None) -> None:
        """Remember when the clocks begin."""
        super().enter_initialization(t, stop)
        self._begin = self._now = clock.nanoseconds(t)

    def begin_timers(self) -> None:
        """Query the clocks in Initialization Mode, the only mode that allows most of these calls."""
        for name, timer in self.timers.items():
            self._begin_timer(name, timer)

    def _begin_timer(self, name: str, timer: Timer) -> None:
        """The first tick, in Initialization Mode."""
        own = timer.own
        if name in self._intervals:
            timer.interval = self._set_interval(own, self._intervals[name])
            timer.due = self._begin + own.shift
        elif own.interval is not None and own.variability in PERIODIC:
            timer.begin(self._begin, None)
        else:
            interval, qualifier = self.read_interval(own)
            shift = self._read_shift(own) if own.variability in PERIODIC else 0
            timer.begin(self._begin, interval if qualifier >= UNCHANGED else None)
            if timer.due is not None and own.variability in PERIODIC:
                timer.due = self._begin + shift
        if own.variability in PERIODIC and not (timer.interval and timer.interval > 0):
            raise FMUError(f"{self._unpacked.path}: its periodic clock {name} has no interval above 0. Export it anew.")

    @property
    def due(self) -> clock.Time | None:
        """When the next time-based clock ticks [ns]; None if none is scheduled."""
        return min((timer.due for timer in self.timers.values() if timer.due is not None), default=None)

    def due_clocks(self, now: clock.Time) -> list[str]:
        """Return the clocks that tick now: those due by time and those whose tick was requested."""
        requested, self._to_tick = self._to_tick, []
        return requested + [name for name, timer in self.timers.items() if timer.due is not None and timer.due <= now]

    def request_tick(self, own: Clock, value: Any) -> None:
        """Let a triggered input clock tick at the next event if `value` is true."""
        if own.is_time_based or own.causality != "input":
            raise FMUError(
                f"{self.name}: {own.name} ticks by itself. Set a triggered input clock to true, to let it tick."
            )
        if values.boolean(value, f"{self.name}: {own.name}"):
            self._to_tick.append(own.name)

    def read_interval(self, own: Clock) -> tuple[clock.Time | None, int]:
        """The interval [ns] until the next tick as the FMU returns it, and its qualifier."""
        qualifier = (ctypes.c_int * 1)()
        interval = self._read_time("Interval", own, qualifier)
        return interval, qualifier[0]

    def _read_shift(self, own: Clock) -> clock.Time:
        return self._read_time("Shift", own) or 0

    def _read_time(self, what: str, own: Clock, *qualifier: Any) -> clock.Time | None:
        reference = (ctypes.c_uint * 1)(own.reference)
        if own.supports_fraction:
            counter, resolution = (ctypes.c_uint64 * 1)(), (ctypes.c_uint64 * 1)(1)
            self._call(f"fmi3Get{what}Fraction", reference, 1, counter, resolution, *qualifier)
            return clock.to_time(Fraction(counter[0], resolution[0] or 1) * clock.NANOSECONDS)
        seconds = (ctypes.c_double * 1)()
        self._call(f"fmi3Get{what}Decimal", reference, 1, seconds, *qualifier)
        is_defined = not qualifier or qualifier[0][0] != 0
        return computed(seconds[0], f"{self.name}: {own.name}", self._now) if is_defined else None

    def _set_interval(self, own: Clock, seconds: float) -> clock.Time:
        self._call("fmi3SetIntervalDecimal", (ctypes.c_uint * 1)(own.reference), 1, (ctypes.c_double * 1)(seconds))
        return clock.nanoseconds(seconds, f"{self.name}: {own.name}")

    def is_ticking(self, own: Clock) -> bool:
        """Whether a clock of the FMU ticks."""
        answer = ctypes.c_bool()
        self._call("fmi3GetClock", (ctypes.c_uint * 1)(own.reference), 1, ctypes.byref(answer))
        return answer.value

    def set_clocks(self, clocks: Sequence[Clock]) -> None:
        """Activate input clocks, in Event Mode."""
        references = (ctypes.c_uint * len(clocks))(*(clock.reference for clock in clocks))
        self._call("fmi3SetClock", references, len(clocks), (ctypes.c_bool * len(clocks))(*(True for _ in clocks)))

    def reschedule(self, now: clock.Time, ticked: Collection[int]) -> None:
        """Query, at the end of an event, the intervals of clocks that the FMU schedules."""
        for timer in self.timers.values():
            own = timer.own
            if timer.needs_interval_query and (own.variability != "changing" or own.reference in ticked):
                timer.update(now, *self.read_interval(own))
