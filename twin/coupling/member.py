"""A member: one component or FMU as the co-simulation algorithm sees it, whatever it is made of.

Call sequence (FMI's): `instantiate`, `set` start values, `enter_initialization(t)`, `set` and `get` while inputs are
being found, `exit_initialization`, then the loop calls `step_function` by its address, at last `close`.
"""

from __future__ import annotations

import ctypes
from abc import ABC, abstractmethod
from contextlib import suppress
from dataclasses import dataclass
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.compiler import machine
from twin.component import solver, unit
from twin.errors import CouplingError, TwinError, described

if TYPE_CHECKING:
    from collections.abc import Callable

    from twin.coupling.system import Link

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
    interval: str = ""  # intervalVariability of a clock that ticks by time; empty: triggered

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
        first_value = flat[tuple(wrong[0])].item()
        index = f"[{','.join(str(i + 1) for i in wrong[0])}]" if np.ndim(value) else ""
        bounds = [None if bound is None else self.shown(bound) for bound in (self.minimum, self.maximum)]
        side = "below the minimum" if first_value < low else "above the maximum" if first_value > high else "no number"
        text = self.shown(first_value) if self.shown(first_value) not in bounds else self.shown(first_value, 15)
        range_ = (
            f"{bounds[0]} to {bounds[1]}"
            if None not in bounds
            else (f"at least {bounds[0]}" if bounds[0] else f"at most {bounds[1]}")
        )
        return f"{index}: {text} is {side}", f"Give {range_}."

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
    takes_size: bool = True  # whether the number of values is an argument: not in FMI 2.0

    @property
    def size_argument(self) -> int:
        """The last argument, for `machine.call_access`."""
        return self.size if self.takes_size else machine.NO_SIZE

    def call(self, instance: int, values: int) -> int:
        """Move the values to or from an address; the function's status."""
        references = self.references.ctypes.data
        return machine.call_access(self.function, instance, references, self.count, values, self.size_argument)


@dataclass(slots=True)
class Way:
    """The way back for a member, as the loop goes it: memory that is copied, or functions of FMI's form.

    `get` and `set`: addresses of `fmiNGetFMUState` and `fmiNSetFMUState`, `places`: of a pointer for each saved state.
    """

    address: int = 0
    words: int = 0
    get: int = 0
    set: int = 0
    places: tuple[int, ...] = ()


class Member(ABC):
    """Base of the two kinds of members: records in this process, and FMUs."""

    name: str
    variables: dict[str, MemberVariable]
    period_ns: clock.Time = 0  # the member's own period; 0: every communication point
    step_function: int = 0  # address
    step_signature: int = machine.FMI3  # which arguments it takes
    step_name: str = "step"  # of that function
    instance: int = 0  # address of the instance
    writes_flags: bool = True  # whether its step writes what FMI 3.0's does: event, terminate, early return
    log: list[str]  # last lines it logged
    logs: bool = False  # whether it is to log more than what went wrong; told before `instantiate`
    identity: dict[str, str]  # what ran: kind, version, content hash
    can_restore: bool = False  # whether `save` and `restore` are there, and may be called as one likes
    early: bool = False  # whether it is told that its steps may end before their end
    is_hasty: bool = False  # whether it might do so without being told: somebody else's FMU of FMI 3.0
    can_roll_back: bool = False  # whether `way` is there: what somebody else's FMU says of itself
    driven: frozenset[str] = frozenset()  # local variables that are inputs of a part, in a group
    death: str = ""  # how the process ended that the member had of its own, in one line
    continuous: bool = False  # whether it is solved together with those of its kind that it is connected with
    clocked: bool = False  # whether it has clocks, and takes part in `events`
    failure: BaseException | None = None  # what was raised in its step, if that is Python

    def join(self, members: list[Member], links: list[Link]) -> None:
        """Be solved together with others that are `continuous`, along these connections; before instantiation."""
        raise NotImplementedError

    def override(self, name: str, value: Any, element: int | None = None) -> None:
        """Let those it is solved with see a value instead of a variable's own; None: no longer."""

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

    def lost(self, time: clock.Time) -> str:
        """`death`, if that came in the step from `time` [ns]; empty if the member is there."""
        return ""

    def release(self) -> None:
        """Free what this process holds of a member that another process has instantiated and closed."""

    def last_successful_time(self, reached: float) -> float | None:
        """Until where [s] the last step came; `reached` is what the member itself wrote, if it did."""
        return reached

    def try_step(self, t: float, h: float, flags: np.ndarray[Any, Any]) -> int:
        """Step from t by h [s] as a step that may be taken back; its status. `flags`: four words that it may write."""
        return machine.call_trial(self.step_function, self.step_signature, self.instance, t, h, flags.ctypes.data)

    def save(self) -> Any:
        """All that the member holds, for `restore`; the latest is valid."""
        raise NotImplementedError

    def restore(self, saved: Any) -> None:
        """Be again as when `saved` was saved, also after a failure."""
        raise NotImplementedError

    def input_derivatives(self) -> int:
        """Address of `fmi2SetRealInputDerivatives`, or 0 if the member takes no derivatives of inputs."""
        return 0

    def slopes(self, inputs: list[MemberVariable], outputs: list[MemberVariable]) -> tuple[Any, Any, Any, Any] | None:
        """A, B, C, D of der(x) = A x + B u, y = C x + D u in small changes, from here; None if it does not tell."""
        return None

    def way(self, count: int) -> Way:
        """How the loop brings the member back to any of `count` points that it keeps: here by `save` and `restore`."""
        if count > 1:
            raise CouplingError(f"{self.name}: can be brought back to one point only, since it is isolated.")
        saved: list[Any] = []

        def guarded(call: Callable[[], object]) -> int:
            try:
                call()
            except Exception as error:  # nothing may pass through native frames
                self.log.append(str(error) if isinstance(error, TwinError) else described(error))
                return solver.ERROR
            return solver.OK

        def get(_instance: int, address: int) -> int:
            ctypes.c_void_p.from_address(address).value = address
            return guarded(lambda: saved.__setitem__(slice(None), [self.save()]))

        def back(_instance: int, _state: int) -> int:
            return guarded(lambda: self.restore(saved[0]))

        self._state_callbacks = machine.STATE(get), machine.STATE(back), ctypes.c_void_p()
        addresses = [ctypes.cast(callback, ctypes.c_void_p).value or 0 for callback in self._state_callbacks[:2]]
        return Way(get=addresses[0], set=addresses[1], places=(ctypes.addressof(self._state_callbacks[2]),))

    @abstractmethod
    def close(self) -> None:
        """Terminate and free. Safe to call twice and in any state."""
