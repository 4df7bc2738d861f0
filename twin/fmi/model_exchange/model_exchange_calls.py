"""The functions of Model Exchange as methods of an FMU: modes, events, equations. FMI 2.0.4 and 3.0.1, section 3."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np

from twin.fmi.fmi_version import FMI2, FMI3
from twin.fmi.importing import binary
from twin.fmi.importing.c_functions import CallError, MissingFunctionError
from twin.fmi.importing.local_state import FMUWithSlots
from twin.fmi.model_description import Continuous
from twin.fmi.model_exchange.solvers import Discarded

CONTINUOUS = "continuous time"  # the mode in which it is integrated


class ContinuousFMU(FMUWithSlots):
    """FMU whose equations are evaluated at the solver's points."""

    structure: Continuous
    states: np.ndarray[Any, Any]
    derivatives: np.ndarray[Any, Any]
    nominals: np.ndarray[Any, Any]
    indicators: np.ndarray[Any, Any]
    _time: float | None = None  # of the point that it was moved to last [s]

    # events

    def enter_event_mode(self) -> None:
        """From Continuous-Time Mode."""
        self._call(f"{self._prefix}EnterEventMode")
        self._state = "event"

    def update(self) -> tuple[bool, bool, float]:
        """One iteration of Event Mode: whether another is needed, whether the end is wanted, when the next event is due."""
        needed, terminate, _, due = self.update_discrete_states()
        return needed, terminate, np.inf if due is None else due

    def enter_continuous_time(self) -> None:
        """From Event Mode; the states may have changed, and how many there are is known now."""
        self._call(f"{self._prefix}EnterContinuousTimeMode")
        if not hasattr(self, "states"):
            self._size()
        self._state = CONTINUOUS
        self.take_states()
        self._vector("GetNominalsOfContinuousStates")

    def take_states(self) -> None:
        """Know the states that the FMU is in."""
        self._vector("GetContinuousStates")

    def _size(self) -> None:
        count, indicators = len(self.structure.states), self.structure.indicators
        if self._unpacked.fmi == FMI3:
            count, indicators = (
                self._number(f"fmi3GetNumberOf{what}") for what in ("ContinuousStates", "EventIndicators")
            )
        self.states, self.derivatives, self.nominals = np.zeros(count), np.zeros(count), np.ones(count)
        self.indicators = np.zeros(indicators)
        values = {
            "SetContinuousStates": self.states,
            "GetContinuousStates": self.states,
            "GetContinuousStateDerivatives": self.derivatives,
            "GetNominalsOfContinuousStates": self.nominals,
            "GetEventIndicators": self.indicators,
        }
        pointer = ctypes.POINTER(ctypes.c_double)
        self._arrays = {name: (value.ctypes.data_as(pointer), len(value)) for name, value in values.items()}

    def _number(self, function: str) -> int:
        answer = ctypes.c_size_t()
        self._call(function, ctypes.byref(answer))
        return answer.value

    def complete_step(self) -> tuple[bool, bool]:
        """Call `CompletedIntegratorStep`; return whether there is an event and whether termination is requested."""
        if not self.structure.needs_completed_steps:
            return False, False
        kind = ctypes.c_int if self._unpacked.fmi == FMI2 else ctypes.c_bool
        event, terminate = kind(), kind()
        self._call(f"{self._prefix}CompletedIntegratorStep", True, ctypes.byref(event), ctypes.byref(terminate))
        return bool(event.value), bool(terminate.value)

    # the equations

    def move_to(self, t: float, states: np.ndarray[Any, Any]) -> None:
        """Set the time [s] and the continuous states."""
        self._time = t
        self._evaluated("SetTime", t)
        self.states[:] = states
        self._vector("SetContinuousStates")

    def differentiate(self) -> np.ndarray[Any, Any]:
        """Return the state derivatives at the present point."""
        self._vector("GetContinuousStateDerivatives")
        return self.derivatives

    def indicate(self) -> np.ndarray[Any, Any]:
        """Return the event indicators at the present point."""
        self._vector("GetEventIndicators")
        return self.indicators

    def _vector(self, function: str) -> None:
        """Call one of the functions that move the values of all states or indicators."""
        array, size = self._arrays[function]
        if size:
            self._evaluated(function, array, size)

    def _evaluated(self, function: str, *arguments: Any) -> None:
        """Call a function that the FMU may discard; the solver then tries a nearer point."""
        name = self._unpacked.fmi.function(function)
        try:
            self._loaded.call(name, self.instance, *arguments)
        except CallError as error:
            if error.status == binary.DISCARD:
                raise Discarded from None
            self.failed(error.status)
            raise binary.failed(self.name, error.function, error.status, self.log) from None

    def direction(
        self, unknowns: np.ndarray[Any, Any], value_reference: int, seed: np.ndarray[Any, Any], size: int
    ) -> Any:
        """Directional derivative of unknowns, with `size` values in all, along a known variable.

        Time, states and inputs are set again afterwards: an FMU may take a finite difference and stay where that ended.
        """
        try:
            change = self.directional_derivative(unknowns, value_reference, seed, size)
        except (CallError, MissingFunctionError) as error:
            raise Discarded(str(error)) from None
        if self._state == CONTINUOUS and self._time is not None:
            self.reset_point(self._time)
        return change

    def reset_point(self, t: float) -> None:
        """Set time [s], states and inputs of the present point once more."""
        self.move_to(t, self.states)
