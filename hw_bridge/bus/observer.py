"""Who looks on during a run, and who interferes: interfaces, so that a run knows neither traces, shadows nor faults."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from hw_bridge.bus.disturbance import Medium
    from hw_bridge.bus.station import Device


class Listener(Protocol):
    """Hears all frames of a run, and tells afterwards what was more than the daily exchange: a trace."""

    count: int  # frames heard

    def seen(self, since: int) -> list[str]:
        """Events since a time [ns], a line each that begins with the seconds from then on; of many the last.

        Then the first line is how many there were: `before: 3 more`.
        """

    def close(self) -> None:
        """No more frames will come."""


class Observer(Protocol):
    """Goes along with one drive and changes nothing: a shadow."""

    warnings: list[str]

    def update_load(self) -> None:
        """What the scenario does to the drive may be another from now on."""

    def look(self, t: int) -> None:
        """A cycle is over, at t [ns] of the scenario."""

    def report(self) -> dict[str, Any]:
        """What is worth keeping of it, in SI."""


class Override(Protocol):
    """What is done to a simulated bench on purpose: a fault."""

    at: int  # time of the scenario [ns]
    node: str  # name of the drive or module, or the master's

    @property
    def text(self) -> str:
        """What happens to whom."""

    def act(self, place: Medium, number: int, device: Device | None, sign: float) -> None:
        """Let it happen now, to the node `number`; without a device it is the master.

        `sign`: way of the member for one of the motor, with its direction.
        """
