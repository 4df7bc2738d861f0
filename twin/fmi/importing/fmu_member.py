"""Third-party FMU as a member of a co-simulation: FMI 2.0 or 3.0, its C functions by address.

What is said here of steps is Co-Simulation's; `exchange` has Model Exchange.
"""

from __future__ import annotations

import ctypes
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from twin.compiler import machine
from twin.coupling import Access, Member, MemberVariable, StateAccess, renamed
from twin.errors import CouplingError, FMUError, SimulationError
from twin.fmi import values
from twin.fmi import variables as declarations
from twin.fmi.fmi_version import FMI2, FMI3
from twin.fmi.importing import binary
from twin.fmi.importing.c_functions import MissingFunctionError
from twin.fmi.importing.calls import FmuCalls
from twin.fmi.importing.unpacked import share

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from twin.fmi.csv_tables import Inputs
    from twin.fmi.importing.c_functions import Library


POINTERS = ("_saved", "_state_pointers", "_callback")  # into this process


class FMUMember(FmuCalls, Member):
    """An FMU. Its archive is checked and unpacked here, its library loaded by `instantiate`.

    `start_values`: by variable name, `A[1,2]` for one element of an array; text is converted. Several instances of one
    FMU share its library. What hangs or crashes in the library cannot be caught.
    """

    alone: ClassVar[dict[str, FMUMember]] = {}  # by token: living instances of FMUs that allow one per process
    abandoned: ClassVar[list[Any]] = []  # libraries that failed fatally
    interface = ""  # CoSimulation or ModelExchange; none: what the FMU has, Co-Simulation rather

    def __init__(
        self,
        name: str,
        path: str | Path,
        start_values: dict[str, Any] | None = None,
        visible: bool = False,
        logging: bool = False,
    ) -> None:
        self.name = name
        self.log: list[str] = []
        self.notes: list[str] = []
        self.tolerance: float | None = None  # relative, of the FMU's own solver
        self._visible, self.logs = visible, logging
        self._library: Library | None = None
        self._made: binary.Instance | None = None
        self._state = "none"
        self._log: binary.Log | None = None
        self._closed = False
        self._given: dict[str, np.ndarray[Any, Any]] = {}  # inputs that were set other than by the loop
        self._unpacked = share(path, self.interface)
        try:
            self._describe(dict(start_values or {}))
        except BaseException:
            self._unpacked.close()
            raise

    def __getstate__(self) -> dict[str, Any]:
        """Not yet instantiated, for another process."""
        return {name: value for name, value in vars(self).items() if name not in POINTERS}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._saved, self._state_pointers = ctypes.c_void_p(), list[ctypes.c_void_p]()

    # description

    def _describe(self, start_values: dict[str, Any]) -> None:
        unpacked, where = self._unpacked, str(self._unpacked.path)
        description = unpacked.description
        self._declared = {declared.name: declared for declared in description.variables}
        self._items = {name: declarations.items(declared, where) for name, declared in self._declared.items()}
        self.capabilities = description.capabilities
        self.can_get_and_set_state = self.capabilities["canGetAndSetFMUState"]
        # those of others often say so and cannot, or it takes them long
        self.has_cheap_fmu_state = self.can_get_and_set_state and description.generator.startswith("twin ")
        self.has_fmu_state = self.can_get_and_set_state
        self.may_return_early = self.capabilities["mightReturnEarlyFromDoStep"] and not self.has_cheap_fmu_state
        self._saved, self._state_pointers = ctypes.c_void_p(), list[ctypes.c_void_p]()
        self.default_experiment = declarations.experiment(description.experiment, where)
        self.tolerance = self.default_experiment.tolerance
        self.fixed_step = declarations.number(description.fixed_step, f"{where}: has fixedInternalStepSize")
        if not self.capabilities["canHandleVariableCommunicationStepSize"]:
            suggested = self.default_experiment.step_size if unpacked.fmi == FMI2 else None
            self.period_ns = declarations.period(self.fixed_step, suggested, where)
        self.notes += unpacked.notes
        if description.clocks.every and not self.capabilities["hasEventMode"]:
            self.notes.append("has clocks that never tick, since it has no Event Mode")
        self.identity = {
            "kind": "fmu",
            "fmi": unpacked.fmi.number,
            "generator": description.generator,
            "sha256": unpacked.sha256,
            "file": unpacked.path.name,
        }
        self._structural: dict[str, np.ndarray[Any, Any]] = {}
        self.variables = self._variables({})
        self._start = self._start_values(start_values)

    def _variables(self, sizes: dict[int, int]) -> dict[str, MemberVariable]:
        unpacked = self._unpacked
        return declarations.variables(unpacked.description, unpacked.fmi, str(unpacked.path), sizes, unpacked.terminals)

    def _start_values(self, given: dict[str, Any]) -> dict[str, np.ndarray[Any, Any]]:
        """Convert the start values; structural parameters come first since they change the shapes of others."""
        where = f"{self.name}: start value"
        for name in [name for name in given if self._is_structural(name)]:
            self._check_settable(self.variables[name], where)
            self._structural[name] = values.array(self.variables[name], given.pop(name), {}, where)
            self._check_bounds(name, self._structural[name], where)
        if self._structural:
            sizes = {self._declared[name].reference: int(value) for name, value in self._structural.items()}
            self.variables = self._variables(sizes)
        result: dict[str, np.ndarray[Any, Any]] = {}
        for name, value in given.items():
            variable, element = values.find(name, self.variables, where)
            self._check_settable(variable, where)
            items = self._items[variable.name]
            if element is None:
                result[variable.name] = values.array(variable, value, items, where)
                continue
            base = result.get(variable.name, variable.start)
            if base is None:
                raise FMUError(f"{where}: {variable.name} has no start value to change one element of. Give all of it.")
            result[variable.name] = changed = np.array(base, dtype=variable.dtype)
            changed.flat[element] = values.scalar_of(variable, items, where)(value)
        for name, value in result.items():
            self._check_bounds(name, value, where)
            self.variables[name] = replace(self.variables[name], start=value[()])
        return result

    def _check_bounds(self, name: str, value: Any, where: str) -> None:
        wrong, advice = self.variables[name].outside(value)
        if wrong:
            raise FMUError(f"{where}: {name}{wrong}. {advice}")

    def _is_structural(self, name: str) -> bool:
        return name in self._declared and self._declared[name].causality == "structuralParameter"

    def _check_settable(self, variable: MemberVariable, where: str) -> None:
        declared = self._declared[variable.name]
        if declared.variability != "constant" and declared.initial in ("exact", "approx"):
            return
        what = f"{declared.causality}, {declared.variability}, initial {declared.initial}"
        raise FMUError(f"{where}: {variable.name} cannot be set ({what}). Set a parameter, an input or a start state.")

    def follow(self, inputs: Inputs) -> Callable[[float], None] | None:
        """Take inputs over time from a table by itself; None: they are to be set at every communication point."""
        return None

    def rename(self, names: Mapping[str, str]) -> None:
        """Know variables by other names, `names`: old -> new. `der(x)` of an FMU is `der_x` in records."""
        self.variables = renamed(self.variables, names)
        for table in (self._declared, self._items, self._start, self._structural):
            entries: dict[str, Any] = {names.get(name, name): entry for name, entry in table.items()}
            table.clear()
            table.update(entries)

    # call sequence

    def instantiate(self) -> None:
        path = self._unpacked.path
        token = self._unpacked.description.token
        if self._state != "none":
            raise SimulationError(f"{self.name}: is instantiated already. Make a new member for a new run.")
        if self.capabilities["canBeInstantiatedOnlyOncePerProcess"]:
            if token in self.alone:
                raise FMUError(
                    f"{path}: allows one instance per process; {self.alone[token].name!r} is there. Use one only."
                )
            self.alone[token] = self
        self._log = binary.Log(self.name, self.log)
        try:
            self._library = binary.load(self._unpacked)
            arguments = self._library, self._unpacked, self._log, self._visible, self.logs
            self._made = binary.instantiate(*arguments, **self._instance_options())
        except MissingFunctionError as error:
            raise FMUError(f"{path}: {error}") from None
        self.instance = self._made.address
        if not self.instance:
            raise FMUError(f"{path}: refuses to be instantiated.{binary.last_words(self.log)}")
        self._state = "instantiated"
        self._find_step()
        if self._structural:
            self._call("fmi3EnterConfigurationMode")
            for name, value in self._structural.items():
                self._write(self.variables[name], value)
            self._call("fmi3ExitConfigurationMode")

    def _write_start_values(self) -> None:
        for name, value in self._start.items():
            self._write(self.variables[name], value)

    def _report_changed_parameters(self) -> None:
        """Log each parameter whose start value differs from the FMU's value after initialization."""
        for name, value in self._start.items():
            variable, state = self.variables[name], self._state
            if variable.causality != "parameter" or not variable.connectable:
                continue
            try:
                held = np.ravel(self.get(name))
            except SimulationError:  # The FMU does not return its parameters.
                self._state = state
                continue
            if not np.allclose(held, np.ravel(value), rtol=1e-6, atol=0.0, equal_nan=True):
                self.log.append(
                    f"{name} is {shown(held)} after initialization, not its start value {shown(np.ravel(value))}: "
                    f"the FMU changed it"
                )

    def _instance_options(self) -> dict[str, Any]:
        return {"early": self.early}

    def _find_step(self) -> None:
        self.step_function, self.step_name = self._address("DoStep"), f"{self._prefix}DoStep"
        # FMI says nothing of the thread of an FMU that allows one instance per process; log lines keep their order
        self.concurrent = not (self.capabilities["canBeInstantiatedOnlyOncePerProcess"] or self.logs)
        self.writes_flags = self._unpacked.fmi == FMI3
        self.step_signature = machine.FMI3 if self.writes_flags else machine.FMI2

    def enter_initialization(self, t: float, stop: float | None) -> None:
        experiment = (self.tolerance is not None, self.tolerance or 0.0, t, stop is not None, stop or 0.0)
        if self._unpacked.fmi == FMI2:
            self._call("fmi2SetupExperiment", *experiment)  # first: FMUs of 20-sim reset their parameters in it
            self._write_start_values()
            self._call("fmi2EnterInitializationMode")
        else:
            self._write_start_values()
            self._call("fmi3EnterInitializationMode", *experiment)
        self._state = "initializing"

    def exit_initialization(self) -> None:
        self._call(f"{self._prefix}ExitInitializationMode")
        self._state = "stepping"
        self._report_changed_parameters()

    def reinitialize(self, t: float) -> None:
        """Initialize once more at t [s], with the present start values."""
        self._call(f"{self._prefix}Reset")
        self._state = "instantiated"
        self.enter_initialization(t, None)
        self._call(f"{self._prefix}ExitInitializationMode")
        self._state = "stepping"

    def finish_reason(self) -> str:
        """Why the FMU discarded its step, if that was its wish to end the simulation; "" if it failed."""
        # 3: fmi2Terminated
        if self._unpacked.fmi == FMI2 and self._query_status("fmi2GetBooleanStatus", 3, ctypes.c_int(0)):
            return f"it set fmi2Terminated.{binary.last_words(self.log)}"
        return ""

    def failed(self, status: int) -> None:
        self._state = "fatal" if status == binary.FATAL else "failed"

    def check(self, status: int, what: str) -> None:
        """Raise `SimulationError` if a call of this member's functions by address returned more than WARNING."""
        if status in (binary.OK, binary.WARNING):
            return
        self.failed(status)
        hint = " Asynchronous steps are not supported." if status == binary.PENDING else ""
        raise binary.failed(self.name, what, status, self.log, hint)

    def last_successful_time(self, reached: float) -> float | None:
        """Return the end [s] of the last step: `reached` as FMI 3.0 wrote it, or the FMI 2.0 status `fmi2LastSuccessfulTime`."""
        if self._unpacked.fmi == FMI3:
            return reached
        # 2: fmi2LastSuccessfulTime
        last: float | None = self._query_status("fmi2GetRealStatus", 2, ctypes.c_double(0.0))
        return last

    def _query_status(self, function: str, kind: int, answer: Any) -> Any:
        """Query the FMI 2.0 status of the last step; None if the FMU lacks the function, as many do."""
        try:
            self._call(function, kind, ctypes.byref(answer))
        except (SimulationError, FMUError):
            return None
        return answer.value

    def save(self) -> ctypes.c_void_p:
        self._call(self._state_function("Get"), ctypes.byref(self._saved))
        return self._saved

    def restore(self, saved: ctypes.c_void_p) -> None:
        self._call(self._state_function("Set"), saved)

    def state_copy_problem(self) -> str:
        if not self.can_get_and_set_state:
            return "cannot save its state (canGetAndSetFMUState is not true)"
        if self.capabilities["canBeInstantiatedOnlyOncePerProcess"]:
            return "allows one instance per process (canBeInstantiatedOnlyOncePerProcess)"
        return "has clocks, whose state is not saved" if self.clocked else ""

    def serialization_problem(self) -> str:
        return "" if self.capabilities["canSerializeFMUState"] else "its FMU cannot (canSerializeFMUState)"

    def input_derivatives(self) -> int:
        return self._address("SetRealInputDerivatives") if self.capabilities["canInterpolateInputs"] else 0

    def slopes(self, inputs: list[MemberVariable], outputs: list[MemberVariable]) -> Any:
        from twin.fmi.importing.directional_derivatives import slopes

        return slopes(self, inputs, outputs)

    def state_access(self, count: int) -> StateAccess:
        pointers = [ctypes.c_void_p() for _ in range(count)]
        self._state_pointers += pointers
        get, set_ = (self._address(self._state_function(verb).removeprefix(self._prefix)) for verb in ("Get", "Set"))
        return StateAccess(
            get=get, set=set_, pointer_addresses=tuple(ctypes.addressof(pointer) for pointer in pointers)
        )

    def close(self) -> None:
        try:
            if self._state == "stepping":
                self._call(f"{self._prefix}Terminate")
        except (SimulationError, FMUError) as error:
            self.log.append(str(error))
        try:
            self._free()
        except FMUError as error:
            self.log.append(str(error))
        finally:
            self._library, self._made, self.instance, self.step_function, self._state = None, None, 0, 0, "closed"
            if self._log is not None:
                self._log.close()
            self._unpacked.close()

    def release(self) -> None:
        self._unpacked.close()

    def _free(self) -> None:
        token = self._unpacked.description.token
        if self._state == "fatal":
            # no function may be called any more, and neither its code nor its callbacks may vanish
            self.abandoned.append((self._library, self._made))
            if self._library is not None:
                self._library.settle()
            return
        for saved in (pointer for pointer in (self._saved, *self._state_pointers) if pointer):
            self._call(self._state_function("Free"), ctypes.byref(saved))
        if self.alone.get(token) is self:
            del self.alone[token]
        if self.instance:
            self._call(f"{self._prefix}FreeInstance")
        if self._library is not None:
            self._library.close()

    # values

    def set(self, name: str, value: Any) -> None:
        variable = self.variables[name]
        array = values.array(variable, value, self._items[name], self.name)
        self._write(variable, array)
        if variable.causality == "input":
            self._given[name] = array.copy()

    def get(self, name: str) -> Any:
        variable = self.variables[name]
        if variable.causality == "input" and (given := self._given.get(name, variable.start)) is not None:
            return np.array(given, variable.dtype).reshape(variable.shape)[()]  # Many FMUs refuse to return an input.
        if not variable.connectable:
            return self._read_objects(variable)
        buffer = np.zeros(variable.size, variable.dtype)
        self._move("Get", variable, buffer)
        if variable.type == "Boolean":
            buffer = buffer.astype(np.bool_)
        return buffer.reshape(variable.shape)[()]

    def items(self, name: str) -> values.Items:
        """Items of an enumeration, by name; none for other types."""
        return self._items[name]

    def address(self, name: str) -> int:
        return 0

    def access(self, names: list[str], write: bool) -> Access:
        variables = [self.variables[name] for name in names]
        if not all(variable.connectable for variable in variables):
            raise CouplingError(f"{self.name}: String, Binary and Clock variables cannot be moved by the loop.")
        references = np.array([variable.references[0] for variable in variables], np.uint32)
        function = f"{'Set' if write else 'Get'}{self._type(variables[0])}"
        size = sum(variable.size for variable in variables)
        address, name, takes_size = self._address(function), f"{self._prefix}{function}", self._unpacked.fmi.has_sizes
        return Access(address, references, len(references), size, name, takes_size)


def shown(values: np.ndarray[Any, Any]) -> str:
    """A value, or the values of an array, as text."""
    return str(values.item()) if values.size == 1 else str(values.tolist())
