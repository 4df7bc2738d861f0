"""Calls of an FMU's functions by name: results, values of all types, and errors that name the function."""

from __future__ import annotations

import ctypes
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import FMUError, SimulationError
from twin.fmi.fmi_version import FMI2
from twin.fmi.importing import binary
from twin.fmi.importing.c_functions import FUNCTIONS, CallError, EventInfo, MissingFunctionError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from twin.coupling import MemberVariable
    from twin.fmi.importing.c_functions import Library
    from twin.fmi.importing.unpacked import Unpacked


class FmuCalls:
    """The part of a member that calls its FMU."""

    name: str
    instance: int
    log: list[str]
    _unpacked: Unpacked
    _library: Library | None
    _state: str

    @property
    def _prefix(self) -> str:
        return self._unpacked.fmi.prefix

    def _type(self, variable: MemberVariable) -> str:
        return self._unpacked.fmi.function_types.get(variable.type, variable.type)

    def _address(self, function: str) -> int:
        try:
            return self._loaded.address(self._prefix + function)
        except MissingFunctionError as error:
            raise FMUError(f"{self._unpacked.path}: {error}") from None

    @property
    def _loaded(self) -> Library:
        if self._library is None:
            raise SimulationError(f"{self.name}: is not instantiated. Call instantiate first.")
        return self._library

    def _call(self, function: str, *arguments: Any) -> None:
        try:
            self._loaded.call(function, self.instance, *arguments)
        except CallError as error:
            if error.status > binary.DISCARD:
                self._state = "fatal" if error.status == binary.FATAL else "failed"
            raise binary.failed(self.name, error.function, error.status, self.log) from None
        except MissingFunctionError as error:
            raise FMUError(f"{self._unpacked.path}: {error}") from None

    def _move(self, verb: str, variable: MemberVariable, buffer: np.ndarray[Any, Any]) -> None:
        function = f"{self._prefix}{verb}{self._type(variable)}"
        reference = (ctypes.c_uint * 1)(variable.references[0])
        pointer = ctypes.cast(ctypes.c_void_p(buffer.ctypes.data), FUNCTIONS[function][2])
        size = (buffer.size,) if self._unpacked.fmi.has_sizes else ()
        with self._about(variable):
            self._call(function, reference, 1, pointer, *size)

    @contextmanager
    def _about(self, variable: MemberVariable) -> Iterator[None]:
        """Name the variable that a refused call was about."""
        try:
            yield
        except SimulationError as error:
            raise SimulationError(f"{error} It was asked for {variable.name} ({self._reference(variable)}).") from None

    @staticmethod
    def _reference(variable: MemberVariable) -> str:
        return f"value reference {', '.join(map(str, variable.references[:3]))}{'...' * (len(variable.references) > 3)}"

    def _state_function(self, verb: str) -> str:
        return self._unpacked.fmi.function(f"{verb}FMUState")

    @property
    def _byte(self) -> Any:
        """Type of the bytes of a serialized state: fmi2Byte is char, fmi3Byte unsigned."""
        return ctypes.c_ubyte if self._unpacked.fmi.has_sizes else ctypes.c_char

    def serialize(self) -> bytes:
        """Return the FMU state as bytes, by a saved state of its own: that of `save` stays as it is."""
        state, size = ctypes.c_void_p(), ctypes.c_size_t()
        self._call(self._state_function("Get"), ctypes.byref(state))
        try:
            self._call(self._unpacked.fmi.function("SerializedFMUStateSize"), state, ctypes.byref(size))
            data = (self._byte * size.value)()
            self._call(self._state_function("Serialize"), state, data, size)
        finally:
            self._call(self._state_function("Free"), ctypes.byref(state))
        return bytes(memoryview(data))

    def deserialize(self, data: bytes) -> None:
        """Restore a serialized FMU state; SimulationError if the FMU refuses it."""
        state, buffer = ctypes.c_void_p(), (self._byte * len(data)).from_buffer_copy(data)
        self._call(self._state_function("Deserialize"), buffer, len(data), ctypes.byref(state))
        try:
            self._call(self._state_function("Set"), state)
        finally:
            self._call(self._state_function("Free"), ctypes.byref(state))

    def directional_derivative(
        self, unknowns: np.ndarray[Any, Any], value_reference: int, seed: np.ndarray[Any, Any], size: int
    ) -> np.ndarray[Any, Any]:
        """Return the derivative of unknowns, with `size` values in all, along `seed` of one known variable.

        CallError or MissingFunctionError if the FMU refuses.
        """
        change, version = np.zeros(size), self._unpacked.fmi
        sizes = (len(seed), size) if version.has_sizes else ()
        floats, words = ctypes.POINTER(ctypes.c_double), ctypes.POINTER(ctypes.c_uint)
        self._loaded.call(
            version.function("GetDirectionalDerivative"),
            self.instance,
            unknowns.ctypes.data_as(words),
            len(unknowns),
            (ctypes.c_uint * 1)(value_reference),
            1,
            seed.ctypes.data_as(floats),
            *sizes[:1],
            change.ctypes.data_as(floats),
            *sizes[1:],
        )
        return change

    def update_discrete_states(self) -> tuple[bool, bool, bool, float | None]:
        """End an iteration of Event Mode.

        Whether another is needed, whether the end is wanted, whether continuous states have changed; time of the next
        event [s], None if the FMU announces none.
        """
        if self._unpacked.fmi == FMI2:
            info = EventInfo()
            self._call("fmi2NewDiscreteStates", ctypes.byref(info))
            needed, terminate, _, states, is_defined = (bool(getattr(info, name)) for name, _ in EventInfo._fields_[:5])
            due = info.nextEventTime
        else:
            answers: list[Any] = [*(ctypes.c_bool() for _ in range(5)), ctypes.c_double()]
            self._call("fmi3UpdateDiscreteStates", *map(ctypes.byref, answers))
            needed, terminate, _, states, is_defined, due = (answer.value for answer in answers)
        return needed, terminate, states, due if is_defined else None

    def _write(self, variable: MemberVariable, value: np.ndarray[Any, Any]) -> None:
        if variable.connectable:
            self._move("Set", variable, np.ascontiguousarray(value).reshape(-1))
            return
        reference = (ctypes.c_uint * 1)(variable.references[0])
        size = (variable.size,) if self._unpacked.fmi.has_sizes else ()
        if variable.type == "String":
            texts = (ctypes.c_char_p * variable.size)(*(text.encode() for text in value.flat))
            self._call(f"{self._prefix}SetString", reference, 1, texts, *size)
            return
        buffers = [(ctypes.c_uint8 * max(len(data), 1)).from_buffer_copy(data or b"\0") for data in value.flat]
        lengths = (ctypes.c_size_t * variable.size)(*(len(data) for data in value.flat))
        pointers = (ctypes.POINTER(ctypes.c_uint8) * variable.size)(
            *(ctypes.cast(buffer, ctypes.POINTER(ctypes.c_uint8)) for buffer in buffers)
        )
        self._call("fmi3SetBinary", reference, 1, lengths, pointers, *size)

    def _read_objects(self, variable: MemberVariable) -> Any:
        reference = (ctypes.c_uint * 1)(variable.references[0])
        size = (variable.size,) if self._unpacked.fmi.has_sizes else ()
        result = np.empty(variable.size, dtype=object)
        if variable.type == "String":
            texts = (ctypes.c_char_p * variable.size)()
            self._call(f"{self._prefix}GetString", reference, 1, texts, *size)
            result[:] = [(text or b"").decode(errors="replace") for text in texts]
        elif variable.type == "Binary":
            lengths = (ctypes.c_size_t * variable.size)()
            pointers = (ctypes.POINTER(ctypes.c_uint8) * variable.size)()
            self._call("fmi3GetBinary", reference, 1, lengths, pointers, *size)
            pairs = zip(pointers, lengths, strict=True)
            result[:] = [ctypes.string_at(pointer, n) if pointer else b"" for pointer, n in pairs]
        else:
            raise SimulationError(f"{self.name}: {variable.name} is a clock. Clocks need event mode.")
        return result.reshape(variable.shape)[()]
