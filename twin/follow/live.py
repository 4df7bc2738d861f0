"""Following of a rig while it runs, and from Python: messages become measurements and inputs at their time of the model, and estimates."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

from twin import clock
from twin.errors import SimulationError
from twin.follow.follower import Estimate, Follower, follow
from twin.follow.live_problem import LiveProblem, LiveSignal, has_rig, load_live
from twin.follow.problem import FollowProblem, load
from twin.follow.records import signals_of
from twin.follow.sensor_clock import RigClock
from twin.follow.signal_checks import Notes, SignalChecks
from twin.follow.sources import Inbox, Message, now, open_source
from twin.follow.timeline import RevisableFollower, Timeline
from twin.installed import import_optional
from twin.run import noop

POLL = 0.01  # longest wait for a message [s]: a step that waits for a source is that much late
EARLY = 1000  # messages that are kept until all inputs have a value


@dataclass
class SourceState:
    """State of a source: arrival of its last message [s], whether it is lost, and the time of the model [s] up to which it has sent all."""

    lost_after: float
    last_arrival: float | None = None
    is_lost: bool = False
    frontier: float = -math.inf
    delay: float = 0.0  # largest of its signals
    messages: int = 0


class MessageFollower:
    """Follower of messages: `receive` them in any order, then `estimate`. Use it with `with`.

    `notes`: gets a line for each kind of event. Host times are those of `Message.arrival`.
    """

    def __init__(self, problem: LiveProblem, build: Path, notes: Notes) -> None:
        self.problem, self.build, self.notes = problem, build, notes
        case, rig = problem.experiment.case, problem.rig
        self.timeline = Timeline(case, len(problem.inputs), clock.seconds(rig.max_delay))
        self.clock = RigClock(rig, self.timeline.begin)
        self.checks = SignalChecks(problem.measured, notes, rig.on_bad)
        self.states = {name: SourceState(clock.seconds(keys.lost_after)) for name, keys in rig.sources.items()}
        self.follower: RevisableFollower | None = None
        self.counts: Counter[str] = Counter()
        self._units: dict[str, dict[str, str]] = {name: {} for name in rig.sources}  # a source need not repeat them
        self._early: list[Message] = []  # before all inputs have a value
        self._wait, self._forecast_due = clock.seconds(rig.wait), 0
        self._signals: dict[str, list[tuple[LiveSignal, bool, int]]] = {}
        for is_input, signals in ((True, problem.inputs), (False, problem.measured)):
            for number, signal in enumerate(signals):
                self._signals.setdefault(signal.name, []).append((signal, is_input, number))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        if self.follower is not None:
            self.follower.__exit__(*error)

    def receive(self, message: Message) -> None:
        """Take a message; SimulationError if it is one at which following has to stop."""
        rig, state = self.problem.rig, self.states[message.source]
        connection = f"connection {message.source}"
        if message.connection:
            self.notes.report(connection, f"{message.source}: {message.connection}")
            return
        if self.notes.counts[connection]:
            self.notes.report_again(connection)
        was_lost = state.is_lost
        if was_lost and state.last_arrival is not None:
            silence = message.arrival - state.last_arrival
            self.notes.report(f"back {message.source}", f"{message.source} is back after {silence:.1f} s.")
            self.notes.report_again(f"lost {message.source}")
        state.is_lost, state.last_arrival, state.messages = False, message.arrival, state.messages + 1
        if message.problem:
            self.notes.report(f"bad {message.source}", f"{message.source}: {message.problem}: left out.", rig.on_bad)
            return
        self._units[message.source].update(message.units)
        self.checks.note_names(message.source, message.values, message.arrival)
        jump = self.clock.add(message.source, message.stamp, message.arrival, was_lost=was_lost)
        if jump is None:
            self.counts["outside"] += 1
            return
        if jump:
            text = f"{message.source}: its clock has jumped by {jump:+.3f} s."
            self.notes.report_again(f"jump {message.source}")
            self.notes.report(f"jump {message.source}", f"{text} The model goes on with a new offset.", rig.on_jump)
        own = self.clock.clocks.get(message.source)
        if message.stamp is not None and own is not None and (outlier := own.outlier):
            limit = clock.seconds(rig.max_delay)
            text = f"a message came {outlier:.3g} s late, or its stamp is wrong; max_delay is {limit:g} s: left out."
            self.notes.report(f"outside {message.source}", f"{message.source}: {text}")
        if self.follower is None:
            self._early = [*self._early[-EARLY:], message]
            self._begin()
        else:
            self._add(message)

    def _begin(self) -> None:
        """Start the model at the first time at which all inputs have a value."""
        missing = {name for name, uses in self._signals.items() if any(is_input for _, is_input, _ in uses)}
        last = None
        for message in self._early:
            if names := missing.intersection(message.values):
                missing -= names
                last = message
        if missing:
            return
        first = last or self._early[0]
        stamp = self.clock.stamp(first.source, first.stamp, first.arrival)
        own = self.clock.clocks.get(first.source)
        self.clock.origin = stamp
        if first.source != self.clock.reference and self.clock.kinds[first.source] != "shared":
            self.clock.origin = 0.0
            host = stamp + own.at(stamp) if own is not None else stamp
            self.clock.origin = self.clock.at(host) - self.clock.begin
        early, self._early = self._early, []
        for message in early:
            self._add(message)
        self.follower = RevisableFollower(self.problem, self.timeline, self.build)

    def _add(self, message: Message) -> None:
        """Add the values of a message at their times."""
        stamp = self.clock.stamp(message.source, message.stamp, message.arrival)
        time, state = self.clock.time(message.source, stamp), self.states[message.source]
        units = self._units[message.source]
        for name, value in message.values.items():
            for signal, is_input, number in self._signals.get(name, ()):
                state.delay = max(state.delay, signal.delay)
                converted = self.checks.checked(signal, value, units.get(name, ""), time)
                if converted is None:
                    self.counts["left out"] += 1
                elif not self._add_value(is_input, number, time - signal.delay, converted):
                    self.counts["late"] += 1
                    assert self.follower is not None
                    lateness = self.timeline.begin + self.follower.tick * self.timeline.step - time + signal.delay
                    limit = clock.seconds(self.problem.rig.max_delay)
                    self.notes.report(
                        f"late {name}", f"{name} came {lateness:.3g} s late, max_delay is {limit:g} s: left out."
                    )
        state.frontier = max(state.frontier, time - state.delay)

    def _add_value(self, is_input: bool, number: int, time: float, value: float) -> bool:
        if self.follower is None and is_input:
            self.timeline.add_input(number, time, value)
            return True
        if self.timeline.tick(time) <= 0:  # before the start of the model
            return True
        if self.follower is None:
            self.timeline.add_measurement(number, time, value)
            return True
        add = self.follower.add_input if is_input else self.follower.add_measurement
        return add(number, time, value)

    def estimate(self, host: float) -> list[Estimate]:
        """Return the estimates that are new or have changed at a host time [s]: of the last of them all later ones follow again."""
        self._check_sources(host)
        if self.follower is None:
            return []
        alive = [state.frontier for state in self.states.values() if not state.is_lost]
        frontier = min(alive, default=-math.inf)
        reached = max(frontier, self.clock.at(host) - self._wait)
        limit = math.floor((reached - self.timeline.begin) / self.timeline.step + 1e-6)
        estimates = self.follower.run(limit)
        settings = self.problem.forecast
        if estimates and settings is not None and self.follower.tick >= self._forecast_due:
            self._forecast_due = self.follower.tick + settings.repeat
            estimates[-1] = replace(estimates[-1], forecast=self.follower.forecast())
        return estimates

    def _check_sources(self, host: float) -> None:
        rig = self.problem.rig
        for name, state in self.states.items():
            if state.last_arrival is None or state.is_lost or host - state.last_arrival < state.lost_after:
                continue
            state.is_lost = True
            text = f"{name}: no message for {state.lost_after:g} s."
            self.notes.report_again(f"back {name}")
            self.notes.report(
                f"lost {name}", f"{text} Its last inputs are held." if rig.on_loss == "continue" else text, rig.on_loss
            )
        self.checks.check_names(self._signals, self.states, host)

    def summary(self) -> dict[str, object]:
        """Return counts, clocks and notes for summary.json."""
        clocks = {
            name: {"offset": sensor_clock.offset, "drift": sensor_clock.drift}
            for name, sensor_clock in self.clock.clocks.items()
        }
        return {
            "messages": {name: state.messages for name, state in self.states.items()},
            "values": dict(self.counts),
            "origin": self.clock.origin,
            "clocks": clocks,
            "events": dict(self.notes.counts),
        }


class LiveFollowing:
    """Estimates of a rig, until the iteration is left. After late measurements the estimates since then come again.

    `show`: gets a line for each event. SimulationError if the model fails, or as the rig's file says.
    """

    def __init__(self, problem: LiveProblem, build: Path = Path("build"), show: Callable[[str], object] = noop) -> None:
        self.problem, self.build = problem, build
        self.messages = MessageFollower(problem, build, Notes(show))

    def revisions(self) -> Iterator[list[Estimate]]:
        """Yield lists of estimates, empty ones while nothing arrives: each list replaces all estimates since its first one."""
        self._prepare()
        sources = {name: open_source(name, keys) for name, keys in self.problem.rig.sources.items()}
        with Inbox(sources) as inbox, self.messages as messages:
            while True:
                for message in inbox.take(POLL):
                    messages.receive(message)
                yield messages.estimate(now())

    def __iter__(self) -> Iterator[Estimate]:
        for estimates in self.revisions():
            yield from estimates

    def _prepare(self) -> None:
        """Compile the model before anything arrives, and refuse one that cannot be initialized."""
        try:
            with Follower(self.problem, self.build) as follower:
                if self.problem.forecast is not None:
                    follower.forecast()
        except SimulationError as error:
            raise SimulationError(f"{self.problem.path}: {error}") from error


class Following:
    """Estimates of a follow file's recording or rig, one after the other while the iteration goes on.

    `rig`: address of JSON messages such as udp://127.0.0.1:4710, mqtt:// or zenoh://127.0.0.1/rig, or a file of sources; a rig has no end: leave the loop.
    After late measurements the estimates since then come again; `estimates` has the latest ones in the order of time.
    """

    def __init__(
        self,
        file: str | Path,
        recording: str | Path | None = None,
        rig: str | Path | None = None,
        build: str | Path = "build",
    ) -> None:
        self.build = Path(build)
        self.estimates: list[Estimate] = []
        is_live = rig is not None or (recording is None and has_rig(file))
        self.problem: FollowProblem | LiveProblem = load_live(file, rig) if is_live else load(file, recording)

    def __iter__(self) -> Iterator[Estimate]:
        self.estimates = []
        for estimates in self._revisions():
            while self.estimates and estimates and self.estimates[-1].time >= estimates[0].time:
                self.estimates.pop()
            for estimate in estimates:
                self.estimates.append(estimate)
                yield estimate

    def _revisions(self) -> Iterator[list[Estimate]]:
        if isinstance(self.problem, LiveProblem):
            yield from LiveFollowing(self.problem, self.build).revisions()
        else:
            for estimate in follow(self.problem, self.build):
                yield [estimate]

    def to_xarray(self) -> Any:
        """Return a Dataset over time [s] of all estimates so far, with the signals and units of a run of `twin follow`."""
        xarray = import_optional("xarray", "python", "a Dataset")
        if not self.estimates:
            raise SimulationError("there is no estimate yet. Iterate first: for estimate in twin.follow(...).")
        signals, columns = signals_of(self.problem, self.estimates)
        arrays = {
            column.name: ("time", signals.values[column.name], {"units": column.unit, "long_name": column.description})
            for column in columns
        }
        return xarray.Dataset(arrays, {"time": ("time", signals.time, {"units": "s"})})
