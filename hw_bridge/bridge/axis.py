"""Components that replace members: they pass targets to a session, and expose its actual values."""

from __future__ import annotations

from math import nan
from typing import TYPE_CHECKING, Any, Protocol

from hw_bridge.plant import start_position
from twin.component import Float64, PythonComponent, Role

if TYPE_CHECKING:
    from hw_bridge.session import Session

COPIED_ROLES = (Role.input, Role.output, Role.parameter)  # variables of the member
POSITION_OUTPUTS = {"position", "position_actual_value", "angle"}
START = dict.fromkeys(
    ("actual_value_age", "velocity", "velocity_actual_value", "angular_velocity", "current", "force", "torque"), 0.0
)


class Sessions(Protocol):
    """Owner of the sessions to which the components of a hardware file belong."""

    def join(self, part: SessionMember) -> Session:
        """The session of a drive or module."""


class SessionMember(PythonComponent):
    """A drive or an I/O module on a bus, which replaces a member."""

    hardware: Sessions
    member: str
    variant: str

    def __init__(self, **values: Any) -> None:
        super().__init__(**values)
        self._session = self.hardware.join(self)

    def step(self, t: float, h: float) -> None:
        """Pass the targets or levels; the last member of a session advances the bus."""
        self._session.step(self.member, t, h)

    def close(self) -> None:
        """Stop all drives."""
        self._session.close()


class DriveAxis(SessionMember):
    """A drive with the variables of the member that it replaces; unknown values are NaN."""

    forced = False  # whether it has a target force

    def initialize(self) -> None:
        """Set outputs at rest at the start position: the drives are enabled in the first step."""
        for variable in type(self).variables:
            if variable.role is Role.output:
                self.views[variable.name][...] = START.get(variable.name, nan) if variable.type is Float64 else 0
        for name in POSITION_OUTPUTS & set(self.views):
            self.views[name][...] = start_position(self)


class OutputModule(SessionMember):
    """An I/O module: its inputs are the signals of its outputs."""
