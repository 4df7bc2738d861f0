"""Component as a member: its record lies in this process; its functions are compiled or interpreted."""

# ruff: noqa: D102, ARG002 - described in the abstract class
from __future__ import annotations

import ctypes
import pickle
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import compiler
from twin.compiler import dependencies, machine
from twin.component import Component, PythonComponent, Role, Variable, evaluation, resampled
from twin.coupling.member import Access, Member, MemberVariable, StateAccess, TerminalMember
from twin.errors import CouplingError, SimulationError, described

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

CAUSALITY = {Role.input: "input", Role.output: "output", Role.parameter: "parameter"}


def declared_variables(cls: type[Component]) -> dict[str, MemberVariable]:
    """Return the member variables of a component by name."""
    feedthrough = dependencies(cls)
    continuous = evaluation(cls) is not None
    memberships: dict[str, list[TerminalMember]] = {}
    for name, terminal in cls.terminals.items():
        for member, variable in terminal.members.items():
            memberships.setdefault(variable.name, []).append(TerminalMember(name, member, terminal.rule))
    return {
        v.name: member_variable(v, continuous, feedthrough.get(v.name, ()), tuple(memberships.get(v.name, ())))
        for v in cls.variables
    }


def member_variable(
    variable: Variable, continuous: bool, feedthrough: tuple[str, ...], terminals: tuple[TerminalMember, ...] = ()
) -> MemberVariable:
    """Convert a component's variable to a member variable."""
    variability = "continuous" if continuous and variable.type == "Float64" else "discrete"
    if variable.role is Role.parameter:
        variability = "fixed" if variable.fixed else "tunable"
    return MemberVariable(
        variable.name,
        CAUSALITY.get(variable.role, "local"),
        variability,
        str(variable.type),
        variable.dtype,
        variable.shape,
        variable.unit,
        variable.display_unit,
        variable.start_array(),
        variable.description,
        feedthrough,
        minimum=variable.minimum,
        maximum=variable.maximum,
        terminals=terminals,
    )


def driven(cls: type[Component]) -> frozenset[str]:
    """Return the local variables of a group that are inputs of its parts (`part.variable`), set by an inner connection."""
    parts = getattr(cls, "parts", {})
    local = {v.name for v in cls.variables if v.role is Role.local}
    names: set[str] = set()
    for member, part in parts.items():
        inner = driven(part.component)
        inputs = (v.name for v in part.component.variables if v.role is Role.input or v.name in inner)
        names |= {name for own in inputs if (name := f"{member}.{own}") in local}
    return frozenset(names)


def importable_class(cls: type[Component]) -> tuple[type[Component], int]:
    """Return a class that another process can import, and its sample period [ns]; PicklingError if there is none."""
    if cls.__module__ == "__main__":
        raise pickle.PicklingError(f"{cls.__name__} is in the script that runs")
    return (cls.__mro__[1] if "sampled_as" in vars(cls) else cls), cls.period_ns


def _recreate(
    name: str,
    base: type[Component],
    period_ns: int,
    values: dict[str, Any],
    has_code: bool,
    log: list[str],
    identity: dict[str, str],
) -> RecordMember:
    part = resampled(base, period_ns)(**values)
    for variable, value in values.items():
        part.views[variable][...] = value
    return RecordMember(name, part, (0, 0) if has_code else None, log, identity)


@dataclass
class RecordMember(Member):
    """Member whose record lies in this process: interpreted, Python-side, or compiled (with `code`).

    `code`: addresses of `initialize(record, t)` and `advance(record, t, h)`; without it the Python functions run.
    """

    name: str
    component: Component
    code: tuple[int, int] | None = None
    log: list[str] = field(default_factory=list)
    identity: dict[str, str] = field(default_factory=dict)
    failure: BaseException | None = None

    def __post_init__(self) -> None:
        self.variables = declared_variables(type(self.component))
        self.period_ns = self.component.period_ns
        self.instance = self.component.record.ctypes.data
        self.has_cheap_fmu_state = self.has_fmu_state = not isinstance(self.component, PythonComponent)
        self.driven = driven(type(self.component))
        self._closed = self._initializing = self._stale = False
        self._t = 0.0
        if self.code:
            self._initialize: Callable[[float], int] = self._by_address(self.code[0])
            self.step_function, self.step_signature, self.writes_flags = self.code[1], machine.COMPONENT, False
            self.concurrent = True
        else:
            self._initialize = self.component.start  # type: ignore[assignment]
            self.step_by(self._step)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle for another process, not yet initialized; `load` must be called there next."""
        part = self.component
        values = {variable.name: np.array(part.views[variable.name]) for variable in type(part).variables}
        return _recreate, (self.name, *importable_class(type(part)), values, bool(self.code), self.log, self.identity)

    def load(self, build: Path) -> None:
        """Load the compiled code in this process, if the member is compiled."""
        if self.code:
            self.code = compiler.load_component(type(self.component), build)
            self.__post_init__()

    def move(self, record: np.ndarray[Any, Any]) -> None:
        """Move the record to other memory of its type, before the loop's tables are built."""
        self.component.move_record(record)
        self.instance = record.ctypes.data

    def _by_address(self, address: int) -> Callable[[float], int]:
        function = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_double)(address)
        return lambda t: int(function(self.instance, t))

    def _step(self, _instance: int, t: float, h: float, *_: int) -> int:
        return self.component.advance(t, h)

    def instantiate(self) -> None:
        """No-op: the component was created with its start values."""

    def enter_initialization(self, t: float, stop: float | None) -> None:
        self._t = t
        self._initializing = self._stale = True

    def _settle(self) -> None:
        if self._stale:
            self._stale = False
            try:
                self._initialize(self._t)
            except Exception as error:
                raise SimulationError(f"{self.name}: initialization failed: {described(error)}") from error

    def exit_initialization(self) -> None:
        self._settle()
        self._initializing = False

    def set(self, name: str, value: Any) -> None:
        self.component.views[name][...] = value
        self._stale = self._initializing

    def get(self, name: str) -> Any:
        self._settle()
        return self.component.views[name].copy()[()]

    def save(self) -> Any:
        return self.component.record.copy()

    def restore(self, saved: Any) -> None:
        self.component.record[...] = saved
        self.failure = None

    def state_copy_problem(self) -> str:
        return "cannot save its state: " + problem if (problem := self.serialization_problem()) else ""

    def serialization_problem(self) -> str:
        python_side = isinstance(self.component, PythonComponent) and not self.component.state_is_record
        return "it is Python-side, and its state lies in Python objects" if python_side else ""

    def serialize(self) -> bytes:
        return self.component.record.tobytes()

    def deserialize(self, data: bytes) -> None:
        if len(data) != self.component.record.nbytes:
            raise SimulationError(
                f"{self.name}: a state of {len(data)} byte is not of this model, which has {self.component.record.nbytes}. Use the model that saved it."
            )
        self.component.record[...] = np.frombuffer(data, self.component.record.dtype)

    def state_access(self, count: int) -> StateAccess:
        return StateAccess(self.instance, self.component.record.nbytes // 8)

    def address(self, name: str) -> int:
        return self.instance + self.component.layout.offset(name)

    def access(self, names: list[str], write: bool) -> Access:
        raise CouplingError(f"{self.name}: a record is read and written in place.")

    def close(self) -> None:
        if not self._closed and isinstance(self.component, PythonComponent):
            self._closed = True
            try:
                self.component.close()
            except Exception as error:  # The other members must be closed too.
                self.log.append(f"close failed: {described(error)}")
        self._closed = True
