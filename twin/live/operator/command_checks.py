"""Checks of operator commands, made in the process of the loop: messages of a page are not trusted."""

from __future__ import annotations

from contextlib import suppress
from math import isfinite
from typing import TYPE_CHECKING, Any

from twin import clock
from twin.coupling import find
from twin.errors import CouplingError, nearest
from twin.live.recording_reader import RefusedError
from twin.run import apply_event
from twin.scenario import EventSpec, event_problems, short

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin.coupling import CoSimulation
    from twin.live.catalog import Catalog, CatalogControl
    from twin.live.operator.operation_log import OperationLog
    from twin.scenario import Case, ConditionSpec, FaultSpec

WHERE = "console"  # in messages
MAX_DEPTH, MAX_ITEMS, MAX_LETTERS = 3, 10_000, 80  # of a value: lists in lists, items, letters


def check_value(value: Any, what: str, depth: int = 0) -> Any:
    """Return a value of a type that scenarios have, with finite numbers; raise RefusedError otherwise."""
    if isinstance(value, bool) or (isinstance(value, str) and len(value) <= MAX_LETTERS):
        return value
    if isinstance(value, int) and abs(value) < 2**63:
        return value
    if isinstance(value, float) and isfinite(value):
        return value
    if isinstance(value, list) and depth < MAX_DEPTH and len(value) <= MAX_ITEMS:
        return [check_value(item, what, depth + 1) for item in value]
    raise RefusedError(f"{what}: {short(str(value))} is not a value. Use a finite number, true, false or a quantity.")


class CommandExecutor:
    """Executes sets, overrides and releases at the current communication point, and logs them."""

    def __init__(
        self, case: Case, simulated: CoSimulation, catalog: Catalog, targets: set[str], file: OperationLog
    ) -> None:
        self.case, self.simulated, self.catalog, self.targets, self.file = case, simulated, catalog, targets, file
        self.variables = {name: member.variables for name, member in simulated.members.items()}
        self.controls: Mapping[str, CatalogControl] = {control.input: control for control in catalog.controls}
        self.split = {event.variable for event in case.actions if event.kind == "override" and "[" in event.variable}
        self.values: dict[str, Any] = {}  # by the operator
        self.overridden: dict[str, Any] = {}
        self.done: list[dict[str, Any]] = []  # not sent yet
        self.count = 0
        self.operator_changes: dict[str, list[clock.Time]] = {}  # times of the changes of each variable by the operator

    def execute(self, kind: str, name: Any, value: Any = None, by_operator: bool = True) -> None:
        """Check a command and execute it now; raise RefusedError with one line if it is invalid."""
        name = self.check_name(name)
        self.refuse_full()
        given = None if kind == "release" else check_value(value, name)
        event = EventSpec(self.simulated.time, kind, name, given, WHERE)
        if problems := event_problems(event, self.variables, self.targets):
            raise RefusedError(problems[0].removeprefix(f"{WHERE}: "))
        if kind == "release" and name not in self.overridden:
            raise RefusedError(f"{name}: is not overridden. Nothing was released.")
        if kind == "override" and find(name, self.variables).element is not None and name not in self.split:
            raise RefusedError(f"{name}: is an element. Override all of {name.partition('[')[0]}.")
        self.apply(event, by_operator)

    def apply(self, event: EventSpec, by_operator: bool = False) -> None:
        """Apply a checked event."""
        try:
            apply_event(event, self.case, self.simulated, self.variables)
        except CouplingError as error:
            raise RefusedError(error.problems[0]) from None
        self.note_change(event)
        value = "" if event.kind == "release" else f" = {self.shown(event)}"
        self.write(event, event.kind, f"{event.kind} {event.variable}{value}", by_operator)

    def shown(self, event: EventSpec) -> str:
        """Return an event's value in the unit in which the variable is shown."""
        value, signal = event.value, self.catalog.signals.get(event.variable.partition("[")[0])
        if isinstance(value, bool):
            return str(value).lower()
        if isinstance(value, int | float) and signal is not None and signal.display_unit:
            return f"{signal.factor * value + signal.offset:.6g} {signal.display_unit}"
        return short(value)

    def note_change(self, event: EventSpec) -> None:
        """Update the values that the operator sees after an event was applied."""
        if event.kind == "set":
            self.values[event.variable] = event.value
        elif event.kind == "override":
            self.overridden[event.variable] = event.value
        else:
            self.overridden.pop(event.variable, None)

    def note_condition(self, spec: ConditionSpec, time: clock.Time) -> None:
        """Note that a condition was met and its event has happened; operated.yaml has the condition itself."""
        for action in spec.actions:
            self.note_change(action)
        self.add_done(time, "condition", spec.text, "", by_operator=False)

    def write(self, event: EventSpec | FaultSpec, kind: str, text: str, by_operator: bool) -> None:
        """Write an executed command to the log file and add it to `done`, which is sent next."""
        self.add_done(event.time_ns, kind, text, self.file.add(event), by_operator)
        if by_operator:
            name = event.variable if isinstance(event, EventSpec) else text
            self.operator_changes.setdefault(name, []).append(event.time_ns)
            if isinstance(event, EventSpec) and self.is_nominal(event):
                del self.operator_changes[name]

    def is_nominal(self, event: EventSpec) -> bool:
        """Return whether an operator's event sets the value of the file again before the first step, so that nothing is changed."""
        if event.kind != "set" or event.time_ns != self.case.start_ns or event.variable in self.overridden:
            return False
        signal = self.catalog.signals.get(event.variable)
        at_start = {each.variable for each in self.case.events if each.time_ns == self.case.start_ns}
        return signal is not None and event.variable not in at_start and signal.start == event.value

    def add_done(self, time: clock.Time, kind: str, text: str, line: str, by_operator: bool) -> None:
        """Add an executed command to `done`, which is sent next."""
        self.count += 1
        self.done.append(
            {
                "number": self.count,
                "time": clock.seconds(time),
                "kind": kind,
                "text": text,
                "line": line,
                "by_operator": by_operator,
            }
        )

    def check_name(self, name: Any) -> str:
        """Return the name of a variable; raise RefusedError if there is none."""
        if not isinstance(name, str) or len(name) > 300:
            raise RefusedError(f"{short(str(name))} is not a name. Use member.variable.")
        try:
            find(name, self.variables)
        except (CouplingError, ValueError) as error:
            raise RefusedError(str(error)) from None
        return name

    def set(self, name: Any, value: Any) -> None:
        """Set a tunable parameter, or a free input without a control."""
        signal = self.catalog.signals.get(self.check_name(name).partition("[")[0])
        if signal is not None and signal.held and not signal.settable:
            raise RefusedError(f"{name}: moves only while held. Use its control.")
        self.execute("set", name, value)

    def set_first(self, values: Mapping[str, Any]) -> None:
        """Set the values that an operator has chosen in the run before, as far as this variant has them."""
        for name, value in values.items():
            with suppress(RefusedError):
                self.set(name, value)

    def refuse_full(self) -> None:
        """Raise RefusedError if the operation log is full."""
        if self.file.is_full:
            raise RefusedError(
                "the log of this session is full; further commands could not be reproduced. Reset or stop it."
            )

    def check_hold(self, name: Any, value: Any) -> tuple[str, Any, Any]:
        """Return name, value and rest of an input to hold; raise RefusedError if it cannot be held."""
        name = self.check_name(name)
        self.refuse_full()
        signal = self.catalog.signals.get(name.partition("[")[0])
        if signal is None or not signal.held:
            raise RefusedError(f"{name}: is not a free input. {nearest(name, list(self.controls))}")
        control = self.controls.get(name)
        value = check_value(value, name)
        if signal.type == "Boolean":
            if not isinstance(value, bool):
                raise RefusedError(f"{name}: expected true or false, not {short(value)}.")
            return name, value, bool(control.rest) if control else bool(self.start(name))
        if isinstance(value, bool | str | list):
            raise RefusedError(f"{name}: expected a number in {signal.unit or '1'}, not {short(value)}.")
        if control is not None and not control.low <= value <= control.high:
            low, high = (edge * control.factor + control.offset for edge in (control.low, control.high))
            raise RefusedError(
                f"{name}: is outside its range, {low:g} to {high:g} {control.display_unit}.".rstrip(" .")
            )
        event = EventSpec(self.simulated.time, "set", name, value, WHERE)
        if problems := event_problems(event, self.variables, self.targets):
            raise RefusedError(problems[0].removeprefix(f"{WHERE}: "))
        return name, value, control.rest if control is not None else self.start(name)

    def start(self, name: str) -> Any:
        """Return the start value of an input: its rest value, unless its control has another."""
        reference = find(name, self.variables)
        values = self.case.values(reference.member, self.variables[reference.member])
        value = values.get(reference.variable.name, reference.variable.start)
        if reference.element is not None and value is not None:
            value = value.reshape(-1)[reference.element]
        kind = bool if reference.variable.type == "Boolean" else float if reference.variable.dtype.kind == "f" else int
        return kind(value if value is not None else 0)
