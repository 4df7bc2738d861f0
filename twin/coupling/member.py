"""Interface of a member: a component or FMU for the co-simulation algorithm.

Call sequence (FMI's): `instantiate`, `set` start values, `enter_initialization(t)`, `set` and `get` while initial inputs
are computed, `exit_initialization`, then the loop calls `step_function` by its address, finally `close`.

Over 400 lines: one interface, with the callbacks through which native code calls a member.
"""

from __future__ import annotations

import ctypes
from abc import ABC, abstractmethod
from contextlib import suppress
from dataclasses import dataclass, replace
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.compiler import machine
from twin.component import solver, unit
from twin.errors import CouplingError, TwinError, described, nearest

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from twin.coupling.system import ResolvedConnection

# FMI 3.0 type -> type of one scalar in memory; FMI 2.0's Real, Integer, Boolean are Float64, Int32, Boolean here
DTYPES: dict[str, np.dtype[Any]] = {
    "Float64": np.dtype(np.float64),
    "Float32": np.dtype(np.float32),
    "Int8": np.dtype(np.int8),
    "UInt8": np.dtype(np.uint8),
    "Int16": np.dtype(np.int16),
    "UInt16": np.dtype(np.uint16),
    "Int32": np.dtype(np.int32),
    "UInt32": np.dtype(np.uint32),
    "Int64": np.dtype(np.int64),
    "UInt64": np.dtype(np.uint64),
    "Boolean": np.dtype(np.bool_),
    "Enumeration": np.dtype(np.int64),
    "String": np.dtype(object),
    "Binary": np.dtype(object),
}

ROUNDING = 8  # tolerance of bounds for converted values [units in the last place]


@dataclass(frozen=True, slots=True)
class TerminalMember:
    """Membership of a variable in a terminal, in the terms of FMI 3.0.

    `name`: FMI's memberName, by which variables of two terminals match. `rule`: FMI's matchingRule, "plug", "bus",
    "sequence" or another standard's. `kind`: FMI's variableKind, "signal", "inflow", "outflow" or another's; "stream"
    for streams.
    """

    terminal: str
    name: str
    rule: str = "plug"
    kind: str = "signal"


@dataclass(frozen=True, slots=True)
class MemberVariable:
    """Variable of a member. `dtype`: representation of one scalar in memory where the loop reads or writes it.

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
    terminals: tuple[TerminalMember, ...] = ()  # its terminals
    interval: str = ""  # intervalVariability of a time-based clock; empty: triggered

    def __repr__(self) -> str:
        return unit.declaration(self.causality, self.name, self.shape, self.unit, self.description)

    @property
    def size(self) -> int:
        """Number of scalars."""
        return prod(self.shape)

    def index_of(self, element: str) -> int | None:
        """Return the index of an element `2,1`, counted from 1, in the flat values; None if it is outside of the shape."""
        index = [int(part) - 1 for part in element.split(",")]
        is_inside = len(index) == len(self.shape) and all(0 <= i < n for i, n in zip(index, self.shape, strict=True))
        return int(np.ravel_multi_index(index, self.shape)) if is_inside else None

    @property
    def connectable(self) -> bool:
        """Whether the loop moves its values: numbers and Booleans, not strings and binaries."""
        return self.dtype.kind != "O"

    @property
    def is_bounded(self) -> bool:
        """Whether a smallest or largest value is declared."""
        return self.minimum is not None or self.maximum is not None

    @property
    def limits(self) -> tuple[float, float]:
        """Smallest and largest value within the declared bounds, with a margin for rounding; the finite range without bounds."""
        largest = float(np.finfo(np.float64).max)
        part = ROUNDING * float(np.finfo(self.dtype).eps) if self.dtype.kind == "f" else 0.0
        low, high = self.minimum, self.maximum
        return (
            -largest if low is None else low - part * abs(low),
            largest if high is None else high + part * abs(high),
        )

    def outside(self, value: Any) -> tuple[str, str]:
        """Return problem and remedy if a value violates the bounds, else empty texts.

        For example `[2]: -5 ms is below the minimum` and `Give at least 1 ms.`
        """
        low, high = self.limits
        if not (self.is_bounded and self.connectable):
            return "", ""
        flat = np.atleast_1d(value)
        indices = np.argwhere(~((flat >= low) & (flat <= high)))
        if not len(indices):
            return "", ""
        first_value = flat[tuple(indices[0])].item()
        index = f"[{','.join(str(i + 1) for i in indices[0])}]" if np.ndim(value) else ""
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
        """Format a value in its display unit."""
        symbol, factor, offset = self.unit, 1.0, 0.0
        if self.display_unit and self.unit:
            with suppress(CouplingError):  # an FMU may have any text for a unit
                factor, offset = unit.conversion(self.unit, self.display_unit, self.name)
                symbol = self.display_unit
        number = f"{value * factor + offset:.{digits}g}" if self.dtype.kind == "f" else f"{value:.0f}"
        return number if symbol in ("", "1") else f"{number} {symbol}"


def renamed(variables: Mapping[str, MemberVariable], names: Mapping[str, str]) -> dict[str, MemberVariable]:
    """Return variables under other names, `names`: old -> new; CouplingError for an unknown old and an existing new name."""
    for old, new in names.items():
        if old not in variables:
            raise CouplingError(f"names: there is no variable `{old}`. {nearest(old, variables)}")
        if (new in variables and new not in names) or list(names.values()).count(new) > 1:
            raise CouplingError(f"names: there is another variable `{new}`. Choose a name that is free.")
    if not names:
        return dict(variables)
    result = {}
    for name, variable in variables.items():
        inputs = variable.dependencies
        dependencies = None if inputs is None else tuple(names.get(each, each) for each in inputs)
        new = names.get(name, name)
        result[new] = replace(variable, name=new, dependencies=dependencies)
    return result


@dataclass(slots=True)
class Access:
    """Call that moves values between a member and memory: `fmiNGetXXX` or `fmiNSetXXX` by address."""

    function: int
    references: np.ndarray[Any, Any]  # uint32 value references
    count: int  # number of references
    size: int  # number of values
    name: str = "access"  # of the function, for crash reports
    takes_size: bool = True  # whether the number of values is an argument: false for FMI 2.0
    callback: Any = None  # of a call into Python

    @property
    def size_argument(self) -> int:
        """Last argument of `machine.call_access`."""
        return self.size if self.takes_size else machine.NO_SIZE

    def call(self, instance: int, values: int) -> int:
        """Move the values to or from an address; return the FMI status."""
        references = self.references.ctypes.data
        return machine.call_access(self.function, instance, references, self.count, values, self.size_argument)


@dataclass(slots=True)
class StateAccess:
    """Access to the state of a member for rollback by the loop: memory to copy, or functions with FMI's signature.

    `get` and `set`: addresses of `fmiNGetFMUState` and `fmiNSetFMUState`; `pointer_addresses`: of a pointer for each saved
    state. The member must outlive it.
    """

    address: int = 0
    words: int = 0
    get: int = 0
    set: int = 0
    pointer_addresses: tuple[int, ...] = ()
    keep_alive: tuple[Any, ...] = ()  # callbacks and pointers

    @staticmethod
    def from_callbacks(
        get: Callable[..., int], set_: Callable[..., int], pointers: Sequence[ctypes.c_void_p]
    ) -> StateAccess:
        """Return the access by Python functions with the signature of `fmiNGetFMUState` and `fmiNSetFMUState`."""
        callbacks = machine.STATE(get), machine.STATE(set_)
        get_address, set_address = map(machine.address_of, callbacks)
        return StateAccess(
            get=get_address,
            set=set_address,
            pointer_addresses=tuple(map(ctypes.addressof, pointers)),
            keep_alive=(*callbacks, *pointers),
        )


class Member(ABC):
    """Base class of members: records in this process, and FMUs."""

    name: str
    variables: dict[str, MemberVariable]
    period_ns: clock.Time = 0  # the member's own period; 0: every communication point
    step_function: int = 0  # address
    step_signature: int = machine.FMI3  # signature of the step function
    step_name: str = "step"  # name of the step function
    instance: int = 0  # address of the instance
    writes_flags: bool = True  # whether its step writes the flags of FMI 3.0: event, terminate, early return
    log: list[str]  # last log lines
    logs: bool = False  # whether to log more than errors; set before `instantiate`
    identity: dict[str, str]  # kind, version and content hash of the executed model
    has_cheap_fmu_state: bool = False  # whether `save` and `restore` are implemented and may be called at any time
    early: bool = False  # whether early return is allowed (earlyReturnAllowed)
    may_return_early: bool = False  # whether its steps may return early in any case: third-party FMUs of FMI 3.0
    has_fmu_state: bool = False  # whether `way` is available: for third-party FMUs by their own declaration
    driven: frozenset[str] = frozenset()  # local variables of a group that are inputs of a part
    crash_text: str = ""  # description of the exit of the member's own process, in one line
    continuous: bool = False  # whether its equations are integrated together with connected members of this kind
    clocked: bool = False  # whether it has clocks and takes part in `events`
    concurrent: bool = False  # whether it may step in any thread, at the same time as others: no Python is called
    failure: BaseException | None = None  # exception raised in its step, if that is Python

    def join(self, members: list[Member], links: list[ResolvedConnection]) -> None:
        """Integrate together with other `continuous` members along these connections; called before instantiation."""
        raise NotImplementedError

    def override(self, name: str, value: Any, element: int | None = None) -> None:
        """Replace a variable's value for the members integrated together; None ends the override."""

    @abstractmethod
    def instantiate(self) -> None:
        """Enter the state Instantiated, with start values applied."""

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
        """Return the memory address of a variable, or 0 if it can only be reached by calls."""

    @abstractmethod
    def access(self, names: list[str], write: bool) -> Access:
        """Return the call that moves these variables in this order; they must share one dtype and type."""

    def finish_reason(self) -> str:
        """Return why the member discarded its step if it terminates the simulation, else empty."""
        return ""

    def failed(self, status: int) -> None:
        """Store that a step by address returned ERROR or FATAL, so that `close` makes only calls allowed in that state."""

    def lost(self, time: clock.Time) -> str:
        """Return `crash_text` if the member's process died in the step from `time` [ns], else empty."""
        return ""

    def release(self) -> None:
        """Free this process's resources of a member that another process has instantiated and closed."""

    def last_successful_time(self, reached: float) -> float | None:
        """Return the time [s] that the last step reached; `reached`: the time that the member wrote, if any."""
        return reached

    def try_step(self, t: float, h: float, flags: np.ndarray[Any, Any]) -> int:
        """Step from t by h [s] with rollback allowed; return the status. `flags`: four words that the step may write."""
        return machine.call_trial(self.step_function, self.step_signature, self.instance, t, h, flags.ctypes.data)

    def save(self) -> Any:
        """Save the member's state for `restore`; only the latest one is valid."""
        raise NotImplementedError

    def restore(self, saved: Any) -> None:
        """Restore a saved state, also after a failure."""
        raise NotImplementedError

    def state_copy_problem(self) -> str:
        """Return why another instance cannot continue from the member's state; empty if it can."""
        return "cannot save its state"

    def serialization_problem(self) -> str:
        """Return why the member's state cannot be written to a file; empty if it can."""
        return "" if self.has_cheap_fmu_state else "its state cannot be serialized"

    def serialize(self) -> bytes:
        """Return the state as bytes without addresses, for `deserialize` of the same model in any process."""
        raise NotImplementedError

    def deserialize(self, data: bytes) -> None:
        """Restore a serialized state; the member must be in StepMode. SimulationError if the model refuses it."""
        raise NotImplementedError

    def input_derivatives(self) -> int:
        """Return the address of `fmi2SetRealInputDerivatives`, or 0 if the member takes no derivatives of inputs."""
        return 0

    def slopes(self, inputs: list[MemberVariable], outputs: list[MemberVariable]) -> tuple[Any, Any, Any, Any] | None:
        """Return A, B, C, D of der(x) = A x + B u, y = C x + D u, linearized at the current state; None if unavailable."""
        return None

    def state_access(self, count: int) -> StateAccess:
        """Return the state access for rollback to any of `count` saved points; here by `save` and `restore`.

        CouplingError if the member cannot keep so many points.
        """
        if count > 1:
            raise CouplingError(f"{self.name}: can be brought back to one point only, since it is isolated.")
        saved: list[Any] = []

        def get(_instance: int, address: int) -> None:
            machine.write64(address, address)
            saved[:] = [self.save()]

        def back(_instance: int, _state: int) -> None:
            self.restore(saved[0])

        self._state_access = StateAccess.from_callbacks(self.guarded(get), self.guarded(back), [ctypes.c_void_p()])
        return self._state_access

    # functions that native code calls

    def guarded(self, call: Callable[..., int | None]) -> Callable[..., int]:
        """Wrap a callback: log and store its exception, since none may pass through native frames."""

        def called(*arguments: Any) -> int:
            try:
                return call(*arguments) or solver.OK
            except BaseException as error:  # also Ctrl-C
                self.failure = error
                self.log.append(str(error) if isinstance(error, TwinError) else described(error))
                return solver.ERROR

        return called

    def step_by(self, step: Callable[..., int]) -> None:
        """Let a Python function make the steps."""
        self._callback = machine.STEP(self.guarded(step))
        self.step_function = machine.address_of(self._callback)

    def slot_access(
        self, slots: Sequence[Any], write: bool, after_write: Callable[[Any], object] = lambda _slot: None
    ) -> Access:
        """Return a call that copies values between memory and slots of this process, which have `variable` and `values`."""

        def move_values(_instance: int, _references: int, _count: int, address: int, _size: int) -> None:
            for slot in slots:
                own = slot.values.ctypes.data
                target, source = (own, address) if write else (address, own)
                ctypes.memmove(target, source, slot.values.nbytes)
                address += slot.values.nbytes
                if write:
                    after_write(slot)

        callback = machine.ACCESS(self.guarded(move_values))
        references = np.array([slot.variable.references[0] for slot in slots], np.uint32)
        size = sum(slot.variable.size for slot in slots)
        return Access(machine.address_of(callback), references, len(slots), size, callback=callback)

    @abstractmethod
    def close(self) -> None:
        """Terminate and free. Safe to call twice and in any state."""
