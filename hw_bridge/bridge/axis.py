"""Components in the place of members: they hand targets to a session, and show what it says."""

from __future__ import annotations

from math import nan
from typing import TYPE_CHECKING, Any, Protocol

from hw_bridge.plant import beginning
from twin.component import Float64, PythonComponent, Role

if TYPE_CHECKING:
    from hw_bridge.session import Session

KEPT = (Role.input, Role.output, Role.parameter)  # variables of the member
PLACES = {"position", "position_actual_value", "angle"}
START = dict.fromkeys(
    ("actual_value_age", "velocity", "velocity_actual_value", "angular_velocity", "current", "force", "torque"), 0.0
)


class Sessions(Protocol):
    """What the components of a hardware file belong to."""

    def join(self, part: DriveAxis | OutputModule) -> Session:
        """The session of a drive or module."""


class DriveAxis(PythonComponent):
    """A drive on a bus with the variables of the member that it stands for; what it cannot tell is NaN."""

    hardware: Sessions
    member: str
    variant: str
    forced = False  # whether it is told a force

    def __init__(self, **values: Any) -> None:
        super().__init__(**values)
        self._session = self.hardware.join(self)

    def initialize(self) -> None:
        """At rest where it begins: the drives are brought up in the first step."""
        for variable in type(self).variables:
            if variable.role is Role.output:
                self.views[variable.name][...] = START.get(variable.name, nan) if variable.type is Float64 else 0
        for name in PLACES & set(self.views):
            self.views[name][...] = beginning(self)

    def step(self, t: float, h: float) -> None:
        """Hand the targets over; the last member of a session lets the bus go on."""
        self._session.step(self.member, t, h)

    def close(self) -> None:
        """Stop all drives."""
        self._session.close()


class OutputModule(PythonComponent):
    """An I/O module on a bus: its inputs are the signals that its outputs follow."""

    hardware: Sessions
    member: str
    variant: str

    def __init__(self, **values: Any) -> None:
        super().__init__(**values)
        self._session = self.hardware.join(self)

    def step(self, t: float, h: float) -> None:
        """Hand the levels over; the last member of a session lets the bus go on."""
        self._session.step(self.member, t, h)

    def close(self) -> None:
        """Stop everything."""
        self._session.close()
