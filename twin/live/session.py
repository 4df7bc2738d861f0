"""The course of a run that a person operates: blocks of the compiled loop, paced against the wall clock, and what is told.

Between two blocks the loop listens. All that changes anything happens there, at a communication point, and is written
into operated.yaml before the loop goes on, so that running this file gives the same bits.
"""

from __future__ import annotations

import time as wall
from math import inf, lcm
from typing import TYPE_CHECKING, Any, Protocol

from twin import clock
from twin.errors import SimulationError
from twin.live import commands
from twin.live.catalog_builder import catalog_of, prepared_events
from twin.live.channel import Channel, ClosedError
from twin.live.command_checks import WHERE, CommandExecutor
from twin.live.dead_man_switch import DeadManSwitch
from twin.live.operation_log import NAME, OperationLog, time_text
from twin.live.pacing import BLOCK, Pace
from twin.live.scheduling_priority import LoopPriority
from twin.scenario import EventSpec, FaultSpec, Node, connected

if TYPE_CHECKING:
    from collections.abc import Callable

    from twin.coupling import CoSimulation
    from twin.scenario import Case, Scenario

MAX_SLEEP = 0.1  # longest sleep where nothing is to be done [s]
DRIVE_STATUS_PERIOD = 0.1  # between two states of the drives [s]


class Drives(Protocol):
    """What hardware tells of itself while it runs."""

    @property
    def wall_clock(self) -> bool:
        """Whether the drives keep the time, so that nothing can be paused."""

    @property
    def cycle(self) -> clock.Time:
        """Between two targets that they are sent [ns]."""

    def status(self) -> dict[str, Any]:
        """Status of the drives for the operator."""

    def strike(self, fault: FaultSpec) -> None:
        """Let a fault happen at its time; ScenarioError if it cannot."""


class Session:
    """A run that an operator controls. `scenario`: the scenario with all variants, whose events can be triggered."""

    def __init__(self, channel: Channel, rate: float, running: bool) -> None:
        self.channel, self.rate, self.running = channel, rate, running
        self.scenario: Scenario
        self.session_scenario: Scenario  # what is run
        self.variant = ""
        self.head = ""  # of operated.yaml
        self.drives: Drives | None = None
        self.epoch = 0
        self.phase = "starting"
        self.ending = self.again = self.gone = False
        self.folder = ""
        self.left: int | None = None  # communication steps to go while it is paused
        self.stepping: int | None = None  # number of the message that asked for them
        self.priority = LoopPriority()
        self._last_status_time = self._last_drive_status_time = -inf
        self._message = 0
        self._executor: CommandExecutor | None = None

    # --------------------------------------------------------------------------------------------------- the course

    def course(self, case: Case, simulated: CoSimulation, report_progress: Callable[[str, float], object]) -> None:
        """Take a case from its start to where a person ends it."""
        simulated.initialize(case.start_ns, None)
        folder = simulated.recorder.file.parent.parent  # type: ignore[attr-defined]
        self.folder, self.epoch = str(folder), self.epoch + 1
        self.ending = self.again = False
        self.simulated, self.case = simulated, case
        variables = {name: member.variables for name, member in simulated.members.items()}
        wall_clock = self.drives is not None and self.drives.wall_clock
        simulated_drives = self.drives is not None and not wall_clock
        held = {one.input.partition("[")[0] for one in self.session_scenario.console}
        self.prepared = prepared_events(self.scenario, self.variant, case, variables, held, simulated_drives)
        events = {key: event for key, (event, _) in self.prepared.items()}
        catalog = catalog_of(
            self.session_scenario, self.variant, case, simulated, events, self.drives is not None, wall_clock
        )
        # where all members have whole steps behind them, in communication steps: an FMU makes none beyond the stop time
        self.macro = lcm(*(period // case.step_ns for period in simulated.periods.values()))
        file = OperationLog(folder / NAME, self.head, case.start_ns + self.macro * case.step_ns)
        self._executor = CommandExecutor(case, simulated, catalog, connected(case, variables), file)
        self.along = {one.input: dict(one.along) for one in self.session_scenario.console}
        self.dead_man, self.given, self._next, self.wall_clock = DeadManSwitch(), dict[str, Any](), 0, wall_clock
        self._faults = list(case.faults)
        self.pace = Pace(1.0 if wall_clock else self.rate, catalog.step)
        self.phase = "running" if self.running else "paused"
        self.begin_pace()
        self.send(catalog=catalog.plain(), folder=self.folder, epoch=self.epoch, state=self.status())
        try:
            self.go(report_progress)
            self.enter("finishing")
        except SimulationError as error:
            self.say(str(error))
            raise
        finally:
            self.priority.end()
            file.close()

    def go(self, report_progress: Callable[[str, float], object]) -> None:
        """Until it is ended: listen, then let the loop go on when it is time."""
        simulated = self.simulated
        self.apply_events()
        while not self.ending:
            time, now = simulated.time, wall.monotonic()
            goes = self.phase == "running" or (self.left is not None and self.left > 0)
            due = self.pace.due(clock.seconds(time)) if self.phase == "running" and not self.wall_clock else now
            if not goes or due > now:
                latest = min(due if goes else now + MAX_SLEEP, self.dead_man.deadline, now + MAX_SLEEP)
                self.listen(max(latest - now, 0.0))
                self.update_held_inputs()
                if goes and wall.monotonic() >= due:
                    continue  # the block first: what is told can wait for its end
            else:
                self.listen(0.0)
                self.update_held_inputs()
                if not self.ending and (self.phase == "running" or self.left):
                    self.block()
            report_progress(self.case.name, 0.0)
            self.report()
        if not self.wall_clock and not simulated.finished:
            self.left = self.left_to_common()
            while self.left and not simulated.finished:
                self.block()

    @property
    def has_stepped(self) -> bool:
        """Whether it has made a step: then drives are up."""
        return self.simulated.time > self.case.start_ns

    def left_to_common(self, more: int = 0) -> int:
        """Communication steps to the next point where all members have whole ones behind them, `more` of them at least."""
        made = (self.simulated.time - self.case.start_ns) // self.case.step_ns
        return -(-(made + more) // self.macro) * self.macro - made

    def begin_pace(self) -> None:
        """From here on."""
        self.pace.begin(wall.monotonic(), clock.seconds(self.simulated.time))

    def block(self) -> None:
        """Some communication steps, until the next event of the scenario at most."""
        simulated, executor = self.simulated, self._executor
        assert executor is not None
        before, begin, worked = simulated.time, wall.monotonic(), wall.thread_time()
        count = self.pace.count()
        if self.left is not None:
            count = min(count, self.left)
        until = before + count * self.case.step_ns
        if self.drives is not None and self.wall_clock:
            # The session listens half way between two cycles, where no drive waits.
            half = self.drives.cycle // self.case.step_ns // 2 * self.case.step_ns
            until += (half - (until - self.case.start_ns)) % self.drives.cycle
        if self._next < len(self.case.events):
            until = min(until, self.case.events[self._next].time_ns)
        if self.wall_clock and before == self.case.start_ns:
            self.say("the drives are being brought up.")
            self.report(now=True)
        while self._faults and self._faults[0].time_ns < until:
            fault = self._faults.pop(0)
            executor.write(fault, "fault", fault.text, by_operator=False)
        made = (until - before) // self.case.step_ns
        executor.file.commit(before + self.left_to_common(made) * self.case.step_ns)
        simulated.advance(until)
        made = (simulated.time - before) // self.case.step_ns
        self.pace.record_block(begin, wall.monotonic(), clock.seconds(before), clock.seconds(simulated.time), made)
        if not self.wall_clock:  # else drives have the thread's priority in their hands
            self.priority.update(wall.thread_time() - worked, clock.seconds(simulated.time - before) / self.pace.rate)
        if self.left is not None:
            self.left -= made
        if simulated.finished:
            self.phase = "ended"
            self.say(simulated.failure)
        if simulated.finished or self.left == 0:
            self.end_stepping()
        self.apply_events()

    def apply_events(self) -> None:
        """The scenario's own events at the communication point that was reached."""
        events, executor = self.case.events, self._executor
        assert executor is not None
        while self._next < len(events) and events[self._next].time_ns <= self.simulated.time:
            executor.apply(events[self._next])
            self._next += 1

    def strike(self, fault: FaultSpec) -> None:
        """A fault of simulated drives, a little behind the communication point: in this order it happens again."""
        assert self.drives is not None
        time = self.simulated.time + 1000
        entries = {"at": Node(time_text(time), fault.tree.place)}
        now = FaultSpec(time, Node(fault.tree.entries | entries, fault.tree.place))
        self.drives.strike(now)
        self.executor.write(now, "fault", now.text, by_operator=True)

    # ------------------------------------------------------------------------------------------------------- hands

    def update_held_inputs(self) -> None:
        """Release expired holds, then apply the values of all held inputs and their companions."""
        executor = self._executor
        assert executor is not None
        for name in self.dead_man.expire(wall.monotonic()):
            self.say(f"{name}: was not renewed in time and went to rest. Let go and press again.")
        wanted: dict[str, Any] = {name: one.value for name, one in self.dead_man.inputs.items()}
        for name, along in self.along.items():
            for other, value in along.items():
                if name in self.dead_man.inputs and self.dead_man.inputs[name].moves:
                    wanted[other] = value
                else:
                    wanted.setdefault(other, executor.start(other))
        for name, value in wanted.items():
            if (self.given[name] if name in self.given else executor.start(name)) != value:
                executor.apply(EventSpec(self.simulated.time, "set", name, value, WHERE), by_operator=True)
                self.given[name] = value
                self._last_status_time = -inf  # The status shows a held input at once.

    # ---------------------------------------------------------------------------------------------------- listening

    def listen(self, timeout: float) -> None:
        """Execute received messages; send all held inputs to rest if the session ends, as it does if the channel is closed."""
        try:
            for message in self.channel.receive(timeout):
                self.answer(message)
        except ClosedError:
            self.gone = self.ending = True
        if self.ending:
            self.dead_man.release_hold()

    def answer(self, message: dict[str, Any]) -> None:
        """Do what a message asks, and say how it went if it wants to know."""
        number = message.get("number")
        refused, later = commands.execute(self, message)
        if number is None and refused:
            self.say(refused)
        elif number is not None and not later:
            self.report(now=True)
            self.send(answer=number, refused=refused)

    def end_stepping(self) -> None:
        """No more steps are to be made."""
        self.left = None
        if self.stepping is not None:
            self.report(now=True)
            self.send(answer=self.stepping)
            self.stepping = None

    @property
    def executor(self) -> CommandExecutor:
        """Of the present run."""
        assert self._executor is not None
        return self._executor

    # ------------------------------------------------------------------------------------------------------ telling

    def send(self, **message: Any) -> None:
        """Send a message that must arrive; end the session if the channel is closed."""
        try:
            self.channel.send(**message)
        except ClosedError:
            self.gone = self.ending = True

    def say(self, text: str) -> None:
        """A sentence for the person."""
        self._message += 1
        self.send(said=[self._message, wall.time(), text])

    def enter(self, phase: str) -> None:
        """Another phase, told at once."""
        self.phase = phase
        self.send(phase=phase)

    def status(self) -> dict[str, Any]:
        """How it stands, as plain data."""
        pace, executor, goes = self.pace, self.executor, self.phase == "running"
        return {
            "phase": self.phase, "time": clock.seconds(self.simulated.time), "rate": pace.rate,
            "achieved": pace.achieved if goes else 0.0, "lag": pace.lag if goes else 0.0, "jitter": pace.jitter,
            "values": executor.values, "overridden": executor.overridden,
            "held": {name: one.value for name, one in self.dead_man.inputs.items() if one.moves},
        }  # fmt: skip

    def report(self, now: bool = False) -> None:
        """Tell how it stands, thirty times a second at most."""
        instant, executor = wall.monotonic(), self.executor
        try:
            if executor.done:
                self.send(done=executor.done)
                executor.done = []
            if instant - self._last_status_time < BLOCK and not now:
                return
            self._last_status_time = instant
            self.channel.send_droppable(state=self.status())
            if self.drives is not None and instant - self._last_drive_status_time >= DRIVE_STATUS_PERIOD:
                self._last_drive_status_time = instant
                self.channel.send_droppable(hardware=self.drives.status())
        except ClosedError:
            self.gone = self.ending = True
