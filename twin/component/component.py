"""The component: variables as class fields, behavior as plain functions over them.

Call sequence, the same for every way of running it:

1. Instantiated         memory zero, start values applied; parameters and inputs are set from outside
2. InitializationMode   `initialize(self)`, maybe repeated while inputs are being found; outputs are those of the start
3. StepMode             `step(self, t, h)` or `derivatives(self, t)`: inputs are those of `t`, on return outputs are
                        those of `t + h`
4. Terminated           nothing is called any more; after an error this is the only way on

Kinds, by the functions a class has:

- continuous: `derivatives(self, t)` sets `der_x` of every state `x`, and the outputs; `method` integrates it;
  `switches` names quantities at whose zeros it bends or jumps, for a solver outside that looks for them
- sampled: `step(self, t, h)` and a `period` [s]: inputs of `t`, published at `t + period`
- stepped: `step(self, t, h)` without a period: called at every communication point; `samples_at` names the parameter
  with what it samples at by itself, of which a step must be a multiple
- Python-side (`PythonComponent`): `step` may use all of Python (pymunk, a bus); its FMU needs Python

Of any kind: `terminal` fields group what is connected together.

An instance is the interpreted form: set inputs, call `start` and `advance`, read outputs, put breakpoints anywhere.
"""

from __future__ import annotations

import dis
import inspect
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from twin import clock
from twin.component import solver, unit
from twin.component.variable import Float64, MemoryLayout, Role, Terminal, Variable, derivative, layout
from twin.errors import DeclarationError, nearest, suggestion

RESERVED = {"start", "advance", "views", "record", "layout", "variables", "method", "period", "period_ns", "icon"}
RESERVED |= {"initialize", "step", "derivatives", "close", "start_values", "switches", "terminals"}
RESERVED |= {"sampled_as", "samples_at", "bind_record", "move_record"}
RESERVED |= {"time"}  # the independent variable of every FMU

OWN = {"record", "views"}  # attributes of an instance

ARGUMENTS = {"initialize": ("self",), "step": ("self", "t", "h"), "derivatives": ("self", "t")}


LISTED = 12  # variables that an instance prints
CONNECTABLE = (Role.input, Role.output, Role.parameter)


def terminals(cls: type[Component]) -> dict[str, Terminal]:
    """The terminals declared in a class and its bases; their members are inputs, outputs or parameters of it."""
    declared = {name: v for base in reversed(cls.__mro__) for name, v in vars(base).items() if isinstance(v, Terminal)}
    connectable = {v.name for v in cls.variables if v.role in CONNECTABLE}
    taken = {v.name for v in cls.variables} | RESERVED
    for name, terminal in declared.items():
        where = f"{cls.__name__}.{name}"
        if name in taken or not name.isascii():
            raise DeclarationError(
                f"{where}: a terminal cannot have this name. Choose another in a to z, digits and _."
            )
        if terminal.rule not in ("plug", "bus"):
            raise DeclarationError(f'{where}: matching rule {terminal.rule!r} is not known. Use "plug" or "bus".')
        wrong = [key for key, v in terminal.members.items() if not isinstance(v, Variable) or v.name not in connectable]
        if wrong or not terminal.members:
            raise DeclarationError(
                f"{where}: {', '.join(wrong) or 'nothing'} is no variable to connect. Name inputs, outputs or parameters."
            )
    return declared


def inputs_of(variables: Iterable[Variable]) -> solver.Inputs:
    """Name, type and shape of the inputs."""
    return tuple(
        (variable.name, variable.type, variable.shape) for variable in variables if variable.role is Role.input
    )


def unknown(part: Component, name: str) -> DeclarationError:
    """Return the error for a name that is no variable of a component."""
    names = [variable.name for variable in part.variables if variable.role is not Role.derivative]
    return DeclarationError(f"{type(part).__name__}: no variable {name!r}. {nearest(name, names)}")


def unfit(part: Component, name: str, value: Any) -> DeclarationError:
    """Return the error for a value that does not fit a variable of a component."""
    variable = next(each for each in part.variables if each.name == name)
    expected = f"an array of shape {variable.shape}" if variable.shape else "a number"
    symbol = f" in {variable.unit}" if variable.unit not in ("", "1") else ""
    return DeclarationError(f"{type(part).__name__}.{name}: {value!r} does not fit. Give {expected}{symbol}.")


class Component:
    """Base of all components; see this module's docstring for what a subclass declares."""

    period: ClassVar[float | None] = None
    method: ClassVar[solver.Method] = solver.rk4(1e-4)
    switches: ClassVar[tuple[str, ...]] = ()
    samples_at: ClassVar[str] = ""  # parameter [s]
    # parameter [s] or [Hz], and most periods that its value or its inverse may take
    buffers: ClassVar[tuple[tuple[str, float], ...]] = ()
    former_names: ClassVar[
        dict[str, str]
    ] = {}  # former -> present name of variables, which scenarios may use for one release

    variables: ClassVar[tuple[Variable, ...]] = ()
    terminals: ClassVar[dict[str, Terminal]] = {}
    layout: ClassVar[MemoryLayout] = layout((), {})
    period_ns: ClassVar[int] = 0
    _names: ClassVar[frozenset[str]] = frozenset()  # of the variables
    sampled_as: ClassVar[str] = ""  # what `resampled` puts behind the name

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        declared: dict[str, Variable] = {}
        for base in reversed(cls.__mro__):
            for name, value in vars(base).items():
                if isinstance(value, Variable) and value.role is not Role.derivative:
                    declared[name] = named(cls, name, value)
        ordered: list[Variable] = []
        for name in (name for name, variable in declared.items() if variable.role is Role.state):
            if f"der_{name}" in declared:
                raise DeclarationError(f"{cls.__name__}.der_{name}: is declared by the state {name!r}. Drop it.")
        for variable in declared.values():
            ordered.append(variable)
            if variable.role is Role.state:
                ordered.append(derivative(variable))
                setattr(cls, f"der_{variable.name}", ordered[-1])
        if cls.period is not None and not cls.period >= 0:
            raise DeclarationError(f"{cls.__name__}.period: {cls.period} s is not positive. Use 0.001 and the like.")
        cls.period_ns = clock.whole_nanoseconds(cls.period, f"{cls.__name__}.period") if cls.period else 0
        states = sum(variable.size for variable in ordered if variable.role is Role.state)
        inputs = inputs_of(ordered)
        cls.variables = tuple(ordered)
        cls._names = frozenset(variable.name for variable in ordered)
        is_continuous = "derivatives" in dir(cls)
        if states and not is_continuous:
            raise DeclarationError(f"{cls.__name__}: has a state but no derivatives(self, t). Use local() for memory.")
        cls.terminals = terminals(cls)
        if cls.switches:
            check_switches(cls, is_continuous)
        method = cls.method if is_continuous else None
        cls.layout = layout(ordered, solver.hidden(method, cls.period_ns, states, inputs))

    def __init__(self, **values: Any) -> None:
        self.bind_record(np.zeros(1, self.layout.dtype))
        for name, value in type(self).start_values().items():
            self.views[name][...] = value
        for name, value in values.items():
            if name not in self.views:
                raise unknown(self, name)
            try:
                self.views[name][...] = value
            except (TypeError, ValueError):
                raise unfit(self, name, value) from None

    if not TYPE_CHECKING:  # else any name would be one

        def __getattr__(self, name: str) -> Any:
            """Raise AttributeError with the similar variables."""
            text = f"{type(self).__name__!r} object has no attribute {name!r}"
            hint = "" if name.startswith("_") else suggestion(name, type(self)._names)
            raise AttributeError(f"{text}. {hint}" if hint else text)

    def __repr__(self) -> str:
        """Class and values of inputs, outputs and parameters: `<Spring: force = 0.2 N, stiffness = 50 N/m>`."""
        views = vars(self).get("views", {})  # none before it is initialized
        own = [v for v in self.variables if v.role in CONNECTABLE and not v.shape and v.name in views]
        units = {v.name: unit.shown(v.unit) if v.unit != "1" else "" for v in own}
        texts = [f"{v.name} = {views[v.name].item():.6g} {units[v.name]}".rstrip() for v in own[:LISTED]]
        more = f" and {len(own) - LISTED} more" if len(own) > LISTED else ""
        return f"<{type(self).__name__}{': ' * bool(texts)}{', '.join(texts)}{more}>"

    def bind_record(self, record: np.ndarray[Any, Any]) -> None:
        """Use a record of the layout's type, one element, as the memory of the variables."""
        self.record = record
        assert self.layout.dtype.names is not None
        self.views = {name: record[name][0, ...] for name in self.layout.dtype.names}
        for name, view in self.views.items():
            if name.startswith("_"):
                self.__dict__[name] = view

    def move_record(self, record: np.ndarray[Any, Any]) -> None:
        """Move all variables to another record; addresses taken before are invalid."""
        values = self.record.copy()
        self.bind_record(record)
        record[...] = values

    def __setattr__(self, name: str, value: Any) -> None:
        if name in self._names:
            try:
                self.views[name][...] = value
            except (TypeError, ValueError):
                raise unfit(self, name, value) from None
        elif name in OWN or name.startswith("_") or hasattr(type(self), name):
            object.__setattr__(self, name, value)
        else:
            raise unknown(self, name)  # else a misspelled parameter would change nothing, silently

    @classmethod
    def start_values(cls) -> dict[str, Any]:
        """Start value of every variable and of the solver's own fields."""
        values = {variable.name: variable.start_array() for variable in cls.variables}
        if "_nominal" in (cls.layout.dtype.names or ()):
            states = [variable for variable in cls.variables if variable.role is Role.state]
            nominal = [np.full(variable.size, variable.nominal or 1.0) for variable in states]
            values["_nominal"] = np.concatenate(nominal)
        return values

    def start(self, t: float = 0.0) -> None:
        """Initialize at t [s]: states and outputs follow from parameters and inputs."""
        functions(type(self))[0](self, t)

    def advance(self, t: float, h: float) -> int:
        """Go from t to t + h [s] with the inputs as they are; returns a status of `solver`."""
        return int(functions(type(self))[1](self, t, h))


class PythonComponent(Component):
    """A component whose `step` may use all of Python: pymunk, a CAN bus, a file. Its FMU (`twin export --needs-python`) needs Python.

    `initialize` and `step` are called on the instance itself, which may keep any attributes; `close` is called at the
    end of a run, however it ends.
    """

    state_is_record: ClassVar[bool] = False  # whether its variables are all of its state, so that it can be saved

    def __setattr__(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)

    def close(self) -> None:
        """Release what the component holds; called once at the end of a run, also after a failure."""


_resampled: dict[tuple[type[Component], int], type[Component]] = {}


def resampled(cls: type[Component], period_ns: int) -> type[Component]:
    """A sampled component that samples at another period [ns]: a class of its own, for the period is compiled in."""
    if period_ns == cls.period_ns:
        return cls
    if (cls, period_ns) not in _resampled:
        units = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}
        suffix = next(f"_{period_ns // size}{symbol}" for symbol, size in units.items() if period_ns % size == 0)
        body = {"__doc__": cls.__doc__, "__module__": cls.__module__, "sampled_as": suffix}
        made = type(cls.__name__ + suffix, (cls,), body | {"period": clock.seconds(period_ns)})
        _resampled[cls, period_ns] = made
    return _resampled[cls, period_ns]


def check_switches(cls: type[Component], is_continuous: bool) -> None:
    """Switching functions are continuous quantities that `derivatives` computes."""
    roles = (Role.local, Role.output, Role.state)
    computed = {v.name for v in cls.variables if v.role in roles and v.type is Float64}
    for name in cls.switches:
        if name not in computed or not is_continuous:
            raise DeclarationError(
                f"{cls.__name__}: switches names {name!r}. Name states, or Float64 locals or outputs that derivatives(self, t) sets."
            )


def named(cls: type, name: str, variable: Variable) -> Variable:
    """The declaration with its name, put back on the class so that instances find it."""
    if name in RESERVED or name.startswith("_"):
        raise DeclarationError(f"{cls.__name__}.{name}: this name is the engine's own. Choose another.")
    if not name.isascii():
        raise DeclarationError(f"{cls.__name__}.{name}: FMI allows letters a to z, digits and _ only. Rename it.")
    if variable.name and variable.name != name:
        raise DeclarationError(f"{cls.__name__}.{name}: already declared as {variable.name!r}. Declare it once more.")
    if not variable.name:
        object.__setattr__(variable, "name", name)
    return variable


def functions(cls: type[Component]) -> tuple[solver.Function, solver.Function]:
    """`initialize(self, t)` and `advance(self, t, h)` of a component class, as plain Python over its record."""
    cached: tuple[solver.Function, solver.Function] | None = cls.__dict__.get("_functions")
    if cached is None:
        cached = build_functions(cls)
        cls._functions = cached  # type: ignore[attr-defined]
    return cached


def evaluation(cls: type[Component]) -> solver.Function | None:
    """`evaluate(self, t)` of a continuous component, for a solver outside; nothing for other kinds."""
    own: solver.Function | None = getattr(cls, "_evaluation", None)  # of a group
    if own is not None:
        return own
    derivatives = getattr(cls, "derivatives", None)
    return None if derivatives is None or issubclass(cls, PythonComponent) else solver.evaluation(derivatives)


def returns_value(function: Any) -> bool:
    """Whether a function has a return statement with another value than None."""
    previous = None
    for instruction in dis.get_instructions(function) if hasattr(function, "__code__") else ():
        constant = previous if instruction.opname == "RETURN_VALUE" else instruction
        is_none = constant is not None and constant.opname in ("LOAD_CONST", "RETURN_CONST") and constant.argval is None
        if instruction.opname.startswith("RETURN_") and instruction.opname != "RETURN_GENERATOR" and not is_none:
            return True
        previous = instruction
    return False


def build_functions(cls: type[Component]) -> tuple[solver.Function, solver.Function]:
    """Combine a component's own functions with its method and period."""
    derivatives = getattr(cls, "derivatives", None)
    step = getattr(cls, "step", None)
    if (derivatives is None) == (step is None):
        raise DeclarationError(f"{cls.__name__}: needs either derivatives(self, t) or step(self, t, h).")
    for name, call in (("derivatives", derivatives), ("step", step), ("initialize", getattr(cls, "initialize", None))):
        if call is not None and len(inspect.signature(call).parameters) != len(ARGUMENTS[name]):
            raise DeclarationError(
                f"{cls.__name__}.{name}: expected {name}({', '.join(ARGUMENTS[name])}). Write it so."
            )
        if name != "step" and returns_value(call) and not issubclass(cls, PythonComponent):
            raise DeclarationError(
                f"{cls.__name__}.{name}: returns a value, which is lost. Only step returns a status."
            )
    if derivatives is not None and cls.period_ns:
        raise DeclarationError(f"{cls.__name__}: a continuous component has no period. Drop it, or use step.")
    size = cls.layout.state_size
    if step is not None:
        is_status = inspect.signature(step).return_annotation in (int, "int")
        if not is_status and returns_value(step):
            raise DeclarationError(
                f"{cls.__name__}.step: returns a value, which is a status only if it is declared. "
                "Write step(self, t, h) -> int, or return nothing."
            )
        advance = solver.discrete_advance(step, is_status)
        if cls.period_ns:
            advance = solver.sampled_advance(advance, cls.period_ns, inputs_of(cls.variables))
    elif size:
        advance = solver.continuous_advance(derivatives, cls.method, size)  # type: ignore[arg-type]
    else:
        advance = solver.algebraic_advance(derivatives)  # type: ignore[arg-type]
    start = solver.initialization(getattr(cls, "initialize", None), derivatives, bool(cls.period_ns))
    return start, advance
