"""A member: one component or FMU as the co-simulation algorithm sees it, whatever it is made of.

Call sequence (FMI's): `instantiate`, `set` start values, `enter_initialization(t)`, `set` and `get` while inputs are
being found, `exit_initialization`, then the loop calls `step_function` by its address, at last `close`.
"""

from __future__ import annotations

import ctypes
from abc import ABC, abstractmethod
from contextlib import suppress
from dataclasses import dataclass, field
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.compiler import dependencies, machine
from twin.component import Component, PythonComponent, Role, Variable, solver, unit
from twin.errors import CouplingError, SimulationError, TwinError, described

if TYPE_CHECKING:
    from collections.abc import Callable

# FMI 3.0 type -> type of one scalar in memory; FMI 2.0's Real, Integer, Boolean are Float64, Int32, Boolean here
DTYPES: dict[str, np.dtype[Any]] = {
    "Float64": np.dtype(np.float64), "Float32": np.dtype(np.float32),
    "Int8":    np.dtype(np.int8),    "UInt8":   np.dtype(np.uint8),
    "Int16":   np.dtype(np.int16),   "UInt16":  np.dtype(np.uint16),
    "Int32":   np.dtype(np.int32),   "UInt32":  np.dtype(np.uint32),
    "Int64":   np.dtype(np.int64),   "UInt64":  np.dtype(np.uint64),
    "Boolean": np.dtype(np.bool_),   "Enumeration": np.dtype(np.int64),
    "String":  np.dtype(object),     "Binary":  np.dtype(object),
}  # fmt: skip

ROUNDING = 8  # units in the last place by which a converted value may miss a bound that it is meant to meet


@dataclass(frozen=True, slots=True)
class TerminalMember:
    """The place of a variable in a terminal, in FMI 3.0's words.

    `name`: what the same quantity is called at the other side. `rule`: FMI's matchingRule, "plug", "bus", "sequence" or
    another standard's. `kind`: FMI's variableKind, "signal", "inflow", "outflow" or another's; "stream" for streams.
    """

    terminal: str
    name: str
    rule: str = "plug"
    kind: str = "signal"


@dataclass(frozen=True, slots=True)
class MemberVariable:
    """A variable of a member. `dtype` is how one scalar lies in memory where the loop reads or writes it.

    `causality` is FMI's (input, output, parameter, local, ...). `dependencies`: names of the inputs an output depends
    on directly at one instant, or None if unknown (then all).
    """

    name: str
    causality: str
    variability: str
    type: str
    dtype: np.dtype[Any]
    shape: tuple[int, ...] = ()
    unit: str = ""
    display_unit: str = ""
    start: Any = None
    description: str = ""
    dependencies: tuple[str, ...] | None = None
    references: tuple[int, ...] = ()  # value references: one (FMI 3.0), or one per element (FMI 2.0)
    initial: str = ""  # FMI's: exact and approx mean that the start value may be set, also of a state or an output
    items: tuple[tuple[str, int], ...] = ()  # of an enumeration: name and number
    minimum: float | None = None
    maximum: float | None = None
    terminals: tuple[TerminalMember, ...] = ()  # that it belongs to

    @property
    def size(self) -> int:
        """Number of scalars."""
        return prod(self.shape)

    @property
    def connectable(self) -> bool:
        """Whether the loop can move its values: numbers and Booleans, not strings and binaries."""
        return self.dtype.kind != "O"

    @property
    def is_bounded(self) -> bool:
        """Whether a smallest or largest value is declared."""
        return self.minimum is not None or self.maximum is not None

    @property
    def limits(self) -> tuple[float, float]:
        """Smallest and largest value that is within the declared bounds, but for rounding; what is finite if none is."""
        largest = float(np.finfo(np.float64).max)
        part = ROUNDING * float(np.finfo(self.dtype).eps) if self.dtype.kind == "f" else 0.0
        low, high = self.minimum, self.maximum
        return (
            -largest if low is None else low - part * abs(low),
            largest if high is None else high + part * abs(high),
        )

    def outside(self, value: Any) -> tuple[str, str]:
        """(`[2]: -5 ms is below the minimum`, `Give at least 1 ms.`) if a value leaves the declared bounds; else empty."""
        low, high = self.limits
        if not (self.is_bounded and self.connectable):
            return "", ""
        flat = np.atleast_1d(value)
        wrong = np.argwhere(~((flat >= low) & (flat <= high)))
        if not len(wrong):
            return "", ""
        found = flat[tuple(wrong[0])].item()
        place = f"[{','.join(str(i + 1) for i in wrong[0])}]" if np.ndim(value) else ""
        bounds = [None if one is None else self.shown(one) for one in (self.minimum, self.maximum)]
        side = "below the minimum" if found < low else "above the maximum" if found > high else "no number"
        text = self.shown(found) if self.shown(found) not in bounds else self.shown(found, 15)
        range_ = (
            f"{bounds[0]} to {bounds[1]}"
            if None not in bounds
            else (f"at least {bounds[0]}" if bounds[0] else f"at most {bounds[1]}")
        )
        return f"{place}: {text} is {side}", f"Give {range_}."

    def shown(self, value: float, digits: int = 6) -> str:
        """A value for people, in the unit that they prefer."""
        symbol, factor, offset = self.unit, 1.0, 0.0
        if self.display_unit and self.unit:
            with suppress(CouplingError):  # an FMU may have any text for a unit
                factor, offset = unit.conversion(self.unit, self.display_unit, self.name)
                symbol = self.display_unit
        number = f"{value * factor + offset:.{digits}g}" if self.dtype.kind == "f" else f"{value:.0f}"
        return number if symbol in ("", "1") else f"{number} {symbol}"


@dataclass(slots=True)
class Access:
    """One call that moves values between a member and memory: `fmiNGetXXX` or `fmiNSetXXX` by address."""

    function: int
    references: np.ndarray[Any, Any]  # uint32 value references
    count: int  # number of references
    size: int  # number of values
    name: str = "access"  # of the function, for whoever looks after a crash


class Member(ABC):
    """Base of the two kinds of members: records in this process, and FMUs."""

    name: str
    variables: dict[str, MemberVariable]
    period_ns: int = 0  # the member's own period; 0: every communication point
    step_function: int = 0  # address of int32 (*)(void *instance, double t, double h, ...)
    step_name: str = "step"  # of that function
    instance: int = 0  # address of the instance
    log: list[str]  # last lines it logged
    identity: dict[str, str]  # what ran: kind, version, content hash
    can_restore: bool = False  # whether `save` and `restore` are there, and may be called as one likes
    driven: frozenset[str] = frozenset()  # local variables that are inputs of a part, in a group
    death: str = ""  # how the process ended that the member had of its own, in one line

    @abstractmethod
    def instantiate(self) -> None:
        """Bring the member into the state Instantiated, start values applied."""

    @abstractmethod
    def enter_initialization(self, t: float, stop: float | None) -> None:
        """Enter InitializationMode at t [s]."""

    @abstractmethod
    def exit_initialization(self) -> None:
        """Leave InitializationMode for StepMode."""

    @abstractmethod
    def set(self, name: str, value: Any) -> None:
        """Write a variable."""

    @abstractmethod
    def get(self, name: str) -> Any:
        """Read a variable: a scalar, or an array of its shape."""

    @abstractmethod
    def address(self, name: str) -> int:
        """Where the variable lies in memory, or 0 if it can only be reached by calls."""

    @abstractmethod
    def access(self, names: list[str], write: bool) -> Access:
        """The call that moves these variables, which share one dtype and type, in this order."""

    def finish_reason(self) -> str:
        """Why the member discarded its step, if that was its wish to end the simulation; else empty."""
        return ""

    def failed(self, status: int) -> None:
        """Take note that a step by address returned `status`, ERROR or FATAL: `close` calls nothing forbidden then."""

    def lost(self, time: int) -> str:
        """`death`, if that came in the step from `time` [ns]; empty if the member is there."""
        return ""

    def release(self) -> None:
        """Free what this process holds of a member that another process has instantiated and closed."""

    def last_successful_time(self, reached: float) -> float | None:
        """Until where [s] the last step came; `reached` is what the member itself wrote, if it did."""
        return reached

    def save(self) -> Any:
        """All that the member holds, for `restore`; the latest is valid."""
        raise NotImplementedError

    def restore(self, saved: Any) -> None:
        """Be again as when `saved` was saved, also after a failure."""
        raise NotImplementedError

    @abstractmethod
    def close(self) -> None:
        """Terminate and free. Safe to call twice and in any state."""


CAUSALITY = {Role.input: "input", Role.output: "output", Role.parameter: "parameter"}


def declared_variables(cls: type[Component]) -> dict[str, MemberVariable]:
    """The variables of a component as its members show them."""
    feedthrough = dependencies(cls)
    continuous = hasattr(cls, "derivatives")
    places: dict[str, list[TerminalMember]] = {}
    for name, terminal in cls.terminals.items():
        for member, variable in terminal.members.items():
            places.setdefault(variable.name, []).append(TerminalMember(name, member, terminal.rule))
    return {
        v.name: declared(v, continuous, feedthrough.get(v.name, ()), tuple(places.get(v.name, ())))
        for v in cls.variables
    }


def declared(
    variable: Variable, continuous: bool, feedthrough: tuple[str, ...], terminals: tuple[TerminalMember, ...] = ()
) -> MemberVariable:
    """A component's variable as its members show it."""
    variability = "continuous" if continuous and variable.type == "Float64" else "discrete"
    if variable.role is Role.parameter:
        variability = "fixed" if variable.fixed else "tunable"
    return MemberVariable(
        variable.name, CAUSALITY.get(variable.role, "local"), variability, str(variable.type), variable.dtype,
        variable.shape, variable.unit, variable.display_unit, variable.start_array(), variable.description, feedthrough,
        minimum=variable.minimum, maximum=variable.maximum, terminals=terminals,
    )  # fmt: skip


def driven(cls: type[Component]) -> frozenset[str]:
    """Local variables of a group that are inputs of its parts: `part.variable`, set by a connection inside."""
    parts = getattr(cls, "parts", {})
    local = {v.name for v in cls.variables if v.role is Role.local}
    return frozenset(
        name
        for member, part in parts.items()
        for v in part.component.variables
        if (v.role is Role.input or v.name in driven(part.component)) and (name := f"{member}.{v.name}") in local
    )


@dataclass
class RecordMember(Member):
    """A component whose record lies in this process: interpreted, Python-side, or compiled (`code` given).

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
        self.can_restore = not isinstance(self.component, PythonComponent)
        self.driven = driven(type(self.component))
        self._closed = self._initializing = self._stale = False
        self._t = 0.0
        if self.code:
            self._initialize: Callable[[float], int] = self._by_address(self.code[0])
            self.step_function = self.code[1]
        else:
            self._initialize = self.component.start  # type: ignore[assignment]
            self._callback = machine.STEP(self._step)
            self.step_function = ctypes.cast(self._callback, ctypes.c_void_p).value or 0

    def _by_address(self, address: int) -> Callable[[float], int]:
        function = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_double)(address)
        return lambda t: int(function(self.instance, t))

    def _step(self, _instance: int, t: float, h: float, *_: int) -> int:
        try:
            return self.component.advance(t, h)
        except BaseException as error:  # also Ctrl-C: nothing may pass through native frames
            self.failure = error
            self.log.append(str(error) if isinstance(error, TwinError) else described(error))
            return solver.ERROR

    def instantiate(self) -> None:
        """Nothing to do: the component was made with its start values."""

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

    def address(self, name: str) -> int:
        return self.instance + self.component.layout.offset(name)

    def access(self, names: list[str], write: bool) -> Access:
        raise CouplingError(f"{self.name}: a record is read and written in place.")

    def close(self) -> None:
        if not self._closed and isinstance(self.component, PythonComponent):
            self._closed = True
            try:
                self.component.close()
            except Exception as error:  # the others are to be closed all the same
                self.log.append(f"close failed: {described(error)}")
        self._closed = True
