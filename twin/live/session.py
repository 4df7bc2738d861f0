"""The run of a session: blocks of the compiled loop, paced against the wall clock, with commands and status messages.

Between two blocks the loop receives commands. Every change happens there, at a communication point, and is written to
operated.yaml before the loop advances, so that running this file gives the same results to the bit.
"""

from __future__ import annotations

import time as wall
from math import inf
from typing import TYPE_CHECKING, Any, Protocol

from twin import clock
from twin.errors import SimulationError
from twin.live.catalog_builder import catalog_of, prepared_events, steps_to_common
from twin.live.channel import Channel, ClosedError
from twin.live.operator import commands
from twin.live.operator.command_checks import WHERE, CommandExecutor
from twin.live.operator.dead_man_switch import EXPIRED, HOLD, SIMULATED_HOLD, DeadManSwitch
from twin.live.operator.operation_log import NAME, OperationLog, time_text
from twin.live.pacing import BLOCK, Pace
from twin.live.scheduling_priority import LoopPriority
from twin.scenario import EventSpec, FaultSpec, Node, connected

if TYPE_CHECKING:
    from collections.abc import Callable

    from twin.coupling import CoSimulation
    from twin.scenario import Case, ScenarioSpec

MAX_SLEEP = 0.1  # longest sleep while idle [s]
DRIVE_STATUS_PERIOD = 0.1  # between two status messages of the drives [s]


class Drives(Protocol):
    """Status interface of hardware during a run."""

    @property
    def wall_clock(self) -> bool:
        """Whether the drives determine the time, so that nothing can be paused."""

    @property
    def cycle(self) -> clock.Time:
        """Time between two targets [ns]."""

    def status(self) -> dict[str, Any]:
        """Status of the drives for the operator."""

    def strike(self, fault: FaultSpec) -> None:
        """Let a fault happen at its time; ScenarioError if it cannot."""


class Session:
    """A run that an operator controls. `scenario`: with all variants, whose events can be triggered."""

    def __init__(self, channel: Channel, rate: float, running: bool) -> None:
        self.channel, self.rate, self.running = channel, rate, running
        self.scenario: ScenarioSpec
        self.session_scenario: ScenarioSpec  # the scenario of this run: one variant
        self.variant = ""
        self.head = ""  # of operated.yaml
        self.drives: Drives | None = None
        self.epoch = 0
        self.phase = "starting"
        self.ending = self.again = self.gone = self.killed = False
        self.folder = ""
        self.left: int | None = None  # remaining communication steps while paused
        self.stepping: int | None = None  # number of the step command
        self.priority = LoopPriority()
        self._last_status_time = self._last_drive_status_time = -inf
        self._last_update = wall.monotonic()  # of held inputs
        self.first_values: dict[str, Any] = {}  # set at the start, as an operator would
        self.paused_time = 0.0  # of the current run [s]
        self._message, self.shown_message = 0, ""
        self._executor: CommandExecutor | None = None

    # --------------------------------------------------------------------------------------------------- run

    def course(self, case: Case, simulated: CoSimulation, report_progress: Callable[[str, float], object]) -> None:
        """Run a case from its start until the operator ends it."""
        simulated.initialize(case.start_ns, None)
        folder = simulated.recorder.file.parent.parent  # type: ignore[attr-defined]
        self.folder, self.epoch = str(folder), self.epoch + 1
        self.ending = self.again = False
        self.paused_time = 0.0
        self.simulated, self.case = simulated, case
        variables = {name: member.variables for name, member in simulated.members.items()}
        wall_clock = self.drives is not None and self.drives.wall_clock
        simulated_drives = self.drives is not None and not wall_clock
        held = {control.input.partition("[")[0] for control in self.session_scenario.console}
        self.prepared = prepared_events(self.scenario, self.variant, case, variables, held, simulated_drives)
        events = {key: event for key, (event, _) in self.prepared.items()}
        catalog = catalog_of(
            self.session_scenario,
            self.scenario,
            self.variant,
            case,
            simulated,
            events,
            self.drives is not None,
            wall_clock,
        )
        self.macro = steps_to_common(case, simulated)  # an FMU makes no step beyond the stop time
        file = OperationLog(folder / NAME, self.head, case.start_ns + self.macro * case.step_ns)
        self._executor = CommandExecutor(case, simulated, catalog, connected(case, variables), file)
        self.along = {control.input: dict(control.along) for control in self.session_scenario.console}
        for spec in case.conditions:
            file.add(spec)
        if not wall_clock:
            self._executor.set_first(self.first_values)
        self._met = 0  # conditions that were noted
        self.dead_man = DeadManSwitch(SIMULATED_HOLD if self.drives is None else HOLD)
        self.given, self._next, self.wall_clock, self.expired_holds = dict[str, Any](), 0, wall_clock, set[str]()
        self._faults = list(case.faults)
        stop = next(each.stop_ns for each in self.scenario.variants if each.variant == self.variant)
        self.pause_ns = None if catalog.controls or wall_clock else stop  # an operator works on beyond the end
        self.pace = Pace(1.0 if wall_clock else min(self.rate, catalog.fastest_rate), catalog.step)
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
        """Alternate between commands and blocks of the loop until the session ends."""
        simulated = self.simulated
        self.apply_events()
        while not self.ending:
            time, now = simulated.time, wall.monotonic()
            goes = self.phase == "running" or bool(self.left)
            due = self.pace.due(clock.seconds(time)) if self.phase == "running" and not self.wall_clock else now
            if not goes or due > now:
                latest = min(due if goes else now + MAX_SLEEP, self.dead_man.deadline, now + MAX_SLEEP)
                self.listen(max(latest - now, 0.0))
                self.update_held_inputs()
                self.paused_time += 0.0 if goes else wall.monotonic() - now
                if goes and wall.monotonic() >= due:
                    continue  # the block has precedence over status messages
            else:
                self.listen(0.0)
                self.update_held_inputs()
                if not self.ending and (self.phase == "running" or self.left):  # a command may have changed them
                    self.block()
            report_progress(self.case.name, 0.0)
            self.report()
        if not self.wall_clock and not simulated.finished:
            self.left = self.left_to_common()
            while self.left and not simulated.finished:
                self.block()

    @property
    def has_stepped(self) -> bool:
        """Whether a step was made: drives have started then."""
        return self.simulated.time > self.case.start_ns

    def left_to_common(self, more: int = 0) -> int:
        """Return the communication steps to the next point common to all members, at least `more`."""
        made = (self.simulated.time - self.case.start_ns) // self.case.step_ns
        return -(-(made + more) // self.macro) * self.macro - made

    def operator_changes(self) -> list[str]:
        """Return a line about the variables that the operator changed in the last run before the end of what is judged, or none."""
        executor = self._executor
        if executor is None:
            return []
        end = executor.catalog.judged_until
        changes = [
            (name, before)
            for name, times in executor.operator_changes.items()
            if (before := [time for time in times if clock.seconds(time) < end])
        ]
        texts = [
            f"{name} at {clock.text(times[0])}{f' and {len(times) - 1} times more' * (len(times) > 1)}"
            for name, times in changes
        ]
        return [f"operated by hand, at other values than the file's: {'; '.join(texts)}"] if texts else []

    def early_end(self) -> tuple[str, bool]:
        """Return why the last run ended before its end, or nothing, and whether its recording is therefore incomplete.

        With controls it has no end: then it is early for a requirement whose window had not begun or was not over.
        """
        executor, own = self._executor, self.session_scenario
        if executor is None or self.simulated.finished:
            return "", False
        end, what = executor.catalog.judged_until, "of the scenario"
        if executor.catalog.controls:
            judged = [own.metrics[each.metric] if each.metric else each for each in own.expectations]
            edges = [
                edge for each in judged for edge in (each.window.start_ns, each.window.stop_ns) if edge is not None
            ]
            end, what = clock.seconds(max(edges, default=0)), "of what is required"
        time = clock.seconds(self.simulated.time)
        if self.killed and executor.catalog.controls:
            return f"ended at {time:g} s: the console was killed.", False
        if time >= end:
            return "", False
        verb = "ended it" if self.drives is None else "stopped the drives (STOP or Ctrl-C)"
        cause = "the console was killed" if self.killed else f"the operator {verb}"
        return f"ended early, at {time:g} s: {cause} before the end {what}, {end:g} s.", not executor.catalog.controls

    def begin_pace(self) -> None:
        """Restart the schedule at the current time."""
        self.pace.begin(wall.monotonic(), clock.seconds(self.simulated.time))

    def block(self) -> None:
        """Advance some communication steps, at most to the next event of the scenario."""
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
        if self.pause_ns is not None and before < self.pause_ns:
            until = min(until, self.pause_ns)
        if self.wall_clock and before == self.case.start_ns:
            self.say("starting the drives.")
            self.report(now=True)
        while self._faults and self._faults[0].time_ns < until:
            fault = self._faults.pop(0)
            executor.write(fault, "fault", fault.text, by_operator=False)
        made = (until - before) // self.case.step_ns
        executor.file.commit(before + self.left_to_common(made) * self.case.step_ns)
        simulated.advance(until)
        made = (simulated.time - before) // self.case.step_ns
        self.pace.record_block(begin, wall.monotonic(), clock.seconds(before), clock.seconds(simulated.time), made)
        if not self.wall_clock:  # otherwise the drives set the priority of the thread
            self.priority.update(wall.thread_time() - worked, clock.seconds(simulated.time - before) / self.pace.rate)
        if self.left is not None:
            self.left -= made
        if simulated.finished:
            self.phase = "ended"
            self.say(simulated.failure)
        elif simulated.time == self.pause_ns and self.phase == "running":
            self.phase = "paused"
            self.say("the scenario has reached its end. Run continues beyond it.")
        if simulated.finished or self.left == 0:
            self.end_stepping()
        self.apply_events()

    def apply_events(self) -> None:
        """Apply the scenario's events at the current communication point; note the conditions that were met on the way."""
        events, executor = self.case.events, self._executor
        assert executor is not None
        for time, index in self.simulated.conditions.met[self._met :]:
            executor.note_condition(self.case.conditions[index], time)
        self._met = len(self.simulated.conditions.met)
        while self._next < len(events) and events[self._next].time_ns <= self.simulated.time:
            executor.apply(events[self._next])
            self._next += 1

    def strike(self, fault: FaultSpec) -> None:
        """Apply a fault of simulated drives, shortly after the communication point so that a repetition has the same order."""
        assert self.drives is not None
        time = self.simulated.time + 1000
        entries = {"at": Node(time_text(time), fault.tree.location)}
        now = FaultSpec(time, Node(fault.tree.entries | entries, fault.tree.location))
        self.drives.strike(now)
        self.executor.write(now, "fault", now.text, by_operator=True)

    # ------------------------------------------------------------------------------------------------------- held inputs

    def update_held_inputs(self) -> None:
        """Release expired holds, then apply the values of all held inputs and their companions."""
        executor = self._executor
        assert executor is not None
        longest, now = self.dead_man.longest, wall.monotonic()
        pause, self._last_update = now - self._last_update, now
        was_busy = pause > longest / 2
        cause = "this computer was busy" if was_busy else "nothing came from the page"
        cause += f" for {(pause if was_busy else now + longest - self.dead_man.deadline) * 1e3:.0f} ms"
        for name in self.dead_man.expire(now):
            self.expired_holds.add(name)
            executor.add_done(self.simulated.time, EXPIRED, f"{name}: {cause}", "", by_operator=True)
            control = executor.controls.get(name)
            self.say(
                f"{control.label if control else name}: at rest, not renewed for {longest * 1e3:.0f} ms: {cause}. "
                "Release and press again."
            )
        wanted: dict[str, Any] = {name: held.value for name, held in self.dead_man.inputs.items()}
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

    # ---------------------------------------------------------------------------------------------------- commands

    def listen(self, timeout: float) -> None:
        """Execute received messages; send all held inputs to rest if the session ends, as it does if the channel is closed."""
        try:
            for message in self.channel.receive(timeout):
                self.answer(message)
        except ClosedError:
            self.lose_channel()
        if self.ending:
            self.dead_man.release_hold()

    def lose_channel(self) -> None:
        """End the session since the channel is closed; without a stop command before, the console was killed."""
        self.killed = self.killed or not self.ending
        self.gone = self.ending = True

    def answer(self, message: dict[str, Any]) -> None:
        """Execute a message, and answer it if it has a number."""
        number = message.get("number")
        refused, later = commands.execute(self, message)
        if number is None and refused:
            self.say(refused)
        elif number is not None and not later:
            self.report(now=True)
            self.send(answer=number, refused=refused)

    def end_stepping(self) -> None:
        """Stop stepping, and answer the step command."""
        self.left = None
        if self.stepping is not None:
            self.report(now=True)
            self.send(answer=self.stepping)
            self.stepping = None

    @property
    def executor(self) -> CommandExecutor:
        """Executor of the current run."""
        assert self._executor is not None
        return self._executor

    # ------------------------------------------------------------------------------------------------------ status

    def send(self, **message: Any) -> None:
        """Send a message that must arrive; end the session if the channel is closed."""
        try:
            self.channel.send(**message)
        except ClosedError:
            self.lose_channel()

    def say(self, text: str) -> None:
        """Send a message to the operator."""
        self._message += 1
        self.shown_message = text
        self.send(said=[self._message, wall.time(), text])

    def withdraw_message(self) -> None:
        """Remove the shown message, which is true no longer."""
        if self.shown_message:
            self.say("")

    def confirm_hold(self, name: str) -> None:
        """Remove the message on a late hold once the input is held again."""
        if name in self.expired_holds:
            self.expired_holds.discard(name)
            self.withdraw_message()

    def enter(self, phase: str) -> None:
        """Change the phase and send it."""
        self.phase = phase
        self.send(phase=phase)

    def status(self) -> dict[str, Any]:
        """Return the state as plain data."""
        pace, executor, goes = self.pace, self.executor, self.phase == "running"
        return {
            "phase": self.phase,
            "time": clock.seconds(self.simulated.time),
            "rate": pace.rate,
            "achieved": pace.achieved if goes else 0.0,
            "lag": pace.lag if goes else 0.0,
            "jitter": pace.jitter,
            "values": executor.values,
            "overridden": executor.overridden,
            "changes": {name: clock.seconds(times[0]) for name, times in executor.operator_changes.items()},
            "held": {name: held.value for name, held in self.dead_man.inputs.items() if held.moves},
        }

    def report(self, now: bool = False) -> None:
        """Send the state, at most thirty times a second."""
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
                self.channel.send_droppable(hardware=self.drive_status(self.drives))
        except ClosedError:
            self.lose_channel()

    def drive_status(self, drives: Drives) -> dict[str, Any]:
        """Return the status of drives as plain data."""
        return {**drives.status(), "time": clock.seconds(self.simulated.time)}
