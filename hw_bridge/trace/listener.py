"""Listener on a bus: decoded process data of a hardware file's drives as they arrive. It never sends a frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.trace.decoder import Decoder
from hw_bridge.trace.recording import CURRENTS
from hw_bridge.wire import link, open_bus, shut_down
from twin.errors import SimulationError

if TYPE_CHECKING:
    from pathlib import Path

    from hw_bridge.hardware import HardwareKeys

MOTION = (
    "position",
    "velocity",
    "acceleration",
    "following_error",
)  # parts of names of values that scale with the member's way


class BusListener:
    """Values `MEMBER.object` on a bus, such as `servomotor.position_actual_value`, in the member's direction and scale, SI.

    SimulationError if the bus exists in simulated time only, or cannot be opened.
    """

    def __init__(self, path: Path, keys: HardwareKeys) -> None:
        if keys.simulated:
            raise SimulationError(
                f"{path}: `simulated: true`: this bus exists within a run only. Name an interface, such as interface: socketcan."
            )
        self.decoder = Decoder.of_bench(keys)
        self.factors = {
            node.node: (name, (-1.0 if node.inverted else 1.0), node.scale) for name, node in keys.nodes.items()
        }
        self.bus = open_bus(keys.interface, keys.channel, keys.bit_rate, keys.options)
        self.link = link(self.bus, keys.interface)

    def receive(self, timeout: float) -> list[tuple[float, dict[str, float]]]:
        """Return arrival time (monotonic clock [s]) and values of each frame that has arrived; wait up to `timeout` [s]."""
        result = []
        for arrival in self.link.hear(timeout):
            if arrival.failure:
                raise SimulationError(f"bus: {arrival.failure}. Check bit rate, wiring and termination.")
            if arrival.frame is None:
                continue
            host = (self.link.looked - arrival.waited) / 1e9
            line = self.decoder.decode(self.link.looked - arrival.waited, arrival.frame)
            if line.service == "PDO" and line.node in self.factors:
                result.append((host, self._scaled(line.node, line.values)))
        return result

    def _scaled(self, node: int, values: dict[str, float | str]) -> dict[str, float]:
        name, sign, scale = self.factors[node]
        scaled = {}
        for key, value in values.items():
            if isinstance(value, str):
                continue
            factor = sign * scale if any(part in key for part in MOTION) else sign if key in CURRENTS else 1.0
            scaled[f"{name}.{key}"] = factor * value
        return scaled

    def close(self) -> None:
        """Leave the bus."""
        shut_down(self.bus)
