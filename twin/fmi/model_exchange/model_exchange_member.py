"""Third-party FMU for Model Exchange as a member: its equations are solved here, with those it is connected with.

What others read of it, and what they write, lies in this process (`address`), so that the loop copies it in place. Call
sequence of FMI 3.0.1, section 3.2, and FMI 2.0.4, section 3.2: after initialization Event Mode, then Continuous-Time Mode
with an excursion to Event Mode at every event.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from twin.compiler import machine
from twin.coupling import Access, Member, MemberVariable, ResolvedConnection
from twin.fmi.importing import binary
from twin.fmi.importing.local_state import VariableSlot
from twin.fmi.model_exchange import solvers
from twin.fmi.model_exchange.inputs import Followed
from twin.fmi.model_exchange.model_exchange_calls import CONTINUOUS, ContinuousFMU
from twin.fmi.model_exchange.solvers import Discarded
from twin.fmi.model_exchange.system import ContinuousSystem

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from twin.fmi.csv_tables import Inputs
    from twin.fmi.model_exchange.sensitivity import Sensitivity


class ExchangeMember(ContinuousFMU):
    """An FMU for Model Exchange. `solver`: one of `solvers.NAMES`; `tolerance`: relative, of the states.

    Between communication points it is evaluated at points that the solver may reject: what the FMU itself records of its
    evaluations is no trajectory.
    """

    interface = "ModelExchange"
    continuous = True
    step_name = "integration"

    def __init__(
        self,
        name: str,
        path: str | Path,
        start_values: dict[str, Any] | None = None,
        visible: bool = False,
        logging: bool = False,
        *,
        solver: str = "",
        tolerance: float | None = None,
    ) -> None:
        self.solver = solvers.check(solver) if solver else ""
        super().__init__(name, path, start_values, visible, logging)
        self.tolerance = tolerance or self.default_experiment.tolerance
        self.identity["interface"] = "Model Exchange"
        exact = self.tolerance or solvers.TOLERANCE
        self.notes.append(f"is integrated by {self.solver or solvers.DEFAULT}, relative tolerance {exact:g}")
        assert self._unpacked.description.continuous is not None
        self.structure = self._unpacked.description.continuous
        self.system: ContinuousSystem | None = None
        self._given: dict[str, np.ndarray[Any, Any]] = {}  # what was set last
        self._waiting: dict[str, Any] = {}  # what is to be set at the next event
        self.followed: Followed | None = None
        self.sensitivity: Sensitivity | None = None  # integrated together with the states of the system

    # call sequence

    def _find_step(self) -> None:
        self.step_by(self._step)

    def join(self, members: Sequence[Member], links: Sequence[ResolvedConnection]) -> None:
        """Integrate together with other members, as one system with these connections."""
        joined = [member for member in members if isinstance(member, ExchangeMember)]
        system = ContinuousSystem(joined, links)
        for exchange_member in joined:
            exchange_member.system = system

    def exit_initialization(self) -> None:
        super().exit_initialization()
        self._state = "event"
        if self.system is None:
            self.join([self], [])
        assert self.system is not None
        if all(member._state == "event" for member in self.system.members):
            self.system.start()

    def enter_initialization(self, t: float, stop: float | None) -> None:
        super().enter_initialization(t, stop)
        self.begin = t

    def set_states(self, values: Mapping[str, np.ndarray[Any, Any]]) -> None:
        """Set all continuous states, by name and in the order of the FMU, at the communication point reached."""
        assert self.system is not None
        self.states[:] = np.concatenate([np.ravel(value) for value in values.values()])
        self.system.reset_states()

    def restart(self, t: float) -> None:
        """Initialize anew at t [s], with the present inputs; the members that it is integrated with go through an event."""
        assert self.system is not None
        for other in self.system.members:
            if other is not self:
                other.enter_event_mode()
        self._start |= {
            name: slot.values.reshape(slot.variable.shape) for name, slot in self.slots.items() if slot.is_input
        }
        self.reinitialize(t)
        self._state = "event"
        self.system.restart()

    def _step(self, _instance: int, t: float, h: float, _: int, *flags: int) -> int:
        _event, terminate, _early, reached = flags
        assert self.system is not None
        self.system.step(t, h)
        if self.system.ended:
            machine.write8(terminate, 1)
            machine.write_float(reached, self.system.t)
        return binary.OK

    def last_successful_time(self, reached: float) -> float | None:
        return reached

    def close(self) -> None:
        if self._state in ("event", CONTINUOUS):
            self._state = "stepping"
        super().close()

    def serialization_problem(self) -> str:
        return "it is integrated here (Model Exchange), and the state of its solver cannot be written"

    def _local_state(self) -> tuple[Any, ...]:
        """State outside the FMU: values in this process, and the solver's progress."""
        assert self.system is not None
        return self.system.save(), super()._local_state(), self.states.copy(), dict(self._waiting)

    def _restore_local_state(self, saved: tuple[Any, ...]) -> None:
        assert self.system is not None
        at, values, states, waiting = saved
        super()._restore_local_state(values)
        self.states[:], self._waiting = states, dict(waiting)
        self.system.restore(at)

    # values

    @property
    def is_initializing(self) -> bool:
        """Whether it is in Initialization Mode."""
        return self._state == "initializing"

    def override(self, name: str, value: Any, element: int | None = None) -> None:
        if self.system is not None:
            self.system.override((self.name, name), value, element)

    def follow(self, inputs: Inputs) -> Followed:
        self.followed = Followed(self, inputs)
        return self.followed

    def set(self, name: str, value: Any) -> None:
        """Set a variable; while it is integrated, at the next communication point."""
        slot = self.slots.get(name)
        is_input = slot is not None and slot.is_input
        if self._state != CONTINUOUS:
            super().set(name, value)
            if slot is not None and is_input:
                slot.values[:] = slot.applied[:] = self._given[name]
        elif slot is not None and is_input:
            slot.values[:] = np.ravel(value)
        else:
            self._waiting[name] = value

    def _write(self, variable: MemberVariable, value: np.ndarray[Any, Any]) -> None:
        super()._write(variable, value)
        if variable.connectable and variable.causality == "input":
            self._given[variable.name] = np.array(value, variable.dtype).reshape(-1)

    def access(self, names: list[str], write: bool) -> Access:
        if not write:
            return super().access(names, write)

        def stage(slot: VariableSlot) -> None:
            if self.is_initializing:
                self._write(slot.variable, slot.values)
            elif not slot.is_input:
                self._waiting[slot.variable.name] = slot.values.reshape(slot.variable.shape).copy()

        made = self.slot_access([self.slot(name) for name in names], write, stage)
        made.name = super().access(names, write).name
        return made

    def fill(self, slot: VariableSlot) -> None:
        """Start with the input's value, or with that of now if the member is integrated."""
        name, variable = slot.variable.name, slot.variable
        if slot.is_input:
            initial = self._given.get(name, variable.start)
            slot.values[:] = slot.applied[:] = np.ravel(self.get(name) if initial is None else initial)
        elif self._state == CONTINUOUS:
            self.move(slot)

    def move(self, slot: VariableSlot) -> None:
        """Set an input's values in the FMU, or read another variable's from it."""
        status = slot.call()
        if status == binary.DISCARD:
            raise Discarded
        if status > binary.WARNING:
            super().check(status, f"{slot.name} of {slot.variable.name}")

    def publish(self) -> None:
        """Copy the values of the present point to the slots."""
        for slot in self.slots.values():
            if not slot.is_input:
                self.move(slot)

    # events

    def has_changed(self) -> bool:
        """Whether others have written an input, or a value waits to be set."""
        return bool(self._waiting) or any(slot.has_changed for slot in self.slots.values())

    def apply(self) -> None:
        """Set, in Event Mode, the values that were changed outside."""
        if self.followed:
            assert self.system is not None
            self.followed.apply(self.system.t)
        waiting, self._waiting = self._waiting, {}
        for name, value in waiting.items():
            super().set(name, value)
        for slot in self.slots.values():
            if slot.has_changed:
                self.move(slot)
                slot.applied[:] = slot.values

    def update(self) -> tuple[bool, bool, float]:
        """As the FMU; a jump of the inputs that it follows is an event, too."""
        needed, ends, due = super().update()
        assert self.system is not None
        return needed, ends, min(due, self.followed.due(self.system.t)) if self.followed else due

    def move_to(self, t: float, states: np.ndarray[Any, Any]) -> None:
        """Be at a time [s] and in a state, with the inputs that it follows."""
        super().move_to(t, states)
        if self.followed:
            self.followed.move_to(t)

    def reset_point(self, t: float) -> None:
        """Set the continuous inputs, too."""
        super().reset_point(t)
        for slot in self.slots.values():
            if slot.is_input and slot.variable.variability == "continuous":
                self.move(slot)
