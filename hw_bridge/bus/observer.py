"""Interfaces of observers and fault injection, so that a run depends on neither traces, shadows nor faults."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from hw_bridge.bus.disturbance import Medium
    from hw_bridge.bus.station import Device


class Listener(Protocol):
    """Listener to all frames of a run that reports notable events afterwards: a trace."""

    count: int  # frames received

    def events(self, since: int) -> list[str]:
        """Notable events since a time [ns], one line each that begins with the seconds since then; if many, the last ones.

        Then the first line is the number of earlier ones: `before: 3 more`.
        """

    def close(self) -> str:
        """End of the frames; return why what it stores is incomplete, or an empty string."""


class Observer(Protocol):
    """Passive observer of one drive: a shadow."""

    warnings: list[str]

    def update_load(self) -> None:
        """Apply changed loads and parameters of the scenario from now on."""

    def look(self, t: int) -> None:
        """Evaluate a finished cycle, at t [ns] of the scenario."""

    def report(self) -> dict[str, Any]:
        """Data for the summary, in SI."""


class Override(Protocol):
    """An intended manipulation of a simulated bench: a fault."""

    at: int  # time of the scenario [ns]
    node: str  # name of the drive or module, or the master's

    @property
    def text(self) -> str:
        """Fault and node."""

    def act(self, medium: Medium, number: int, device: Device | None, sign: float) -> None:
        """Inject it now at the node `number`; without a device at the master.

        `sign`: the member's displacement for one of the motor, with its direction.
        """
