"""Actual values of a hardware file's drives in a trace."""

from __future__ import annotations

from bisect import bisect_right
from typing import TYPE_CHECKING

from hw_bridge.bus import bit_count
from hw_bridge.dictionary import State, state_of
from hw_bridge.trace.decoder import Decoder
from hw_bridge.wire import read
from twin.errors import SimulationError

if TYPE_CHECKING:
    from pathlib import Path

    from hw_bridge.hardware import HardwareKeys, NodeKeys
    from hw_bridge.trace.decoder import DecodedFrame

POSITION, VELOCITY, STATUSWORD = "position_actual_value", "velocity_actual_value", "statusword"
CURRENTS = ("torque_actual_value", "current_actual_values_actual", "current_actual_value")
NAMES = {  # names of members' outputs
    POSITION: (POSITION, "position", "angle"),
    VELOCITY: (VELOCITY, "velocity", "angular_velocity"),
    "current": ("current",),
    STATUSWORD: (STATUSWORD,),
}
DISORDER = 10_000_000  # by which frames of two channels may be recorded in the wrong order [ns]


class Track:
    """Recorded actual values of one drive: for each quantity times [ns] and values, in the member's direction and scale."""

    def __init__(self, keys: NodeKeys, name: str) -> None:
        self.name = name
        sign = -1.0 if keys.inverted else 1.0
        self.factors = {POSITION: sign * keys.scale, VELOCITY: sign * keys.scale, "current": sign, STATUSWORD: 1.0}
        self.times: dict[str, list[int]] = {quantity: [] for quantity in NAMES}
        self.values: dict[str, list[float]] = {quantity: [] for quantity in NAMES}
        self.home = 0.0  # position where the drive stood before it was enabled
        self.enabled = False
        self._left = False  # whether it was on the way to Operation enabled

    def hear(self, line: DecodedFrame) -> None:
        """Process a decoded frame of this drive."""
        for key, value in line.values.items():
            quantity = "current" if key in CURRENTS else key
            if quantity in NAMES and not isinstance(value, str):
                self.times[quantity].append(line.time)
                self.values[quantity].append(self.factors[quantity] * value)
        if isinstance(word := line.values.get(STATUSWORD), int):
            state = state_of(word)
            self.enabled = state is State.ENABLED
            self._left = self._left or state not in (State.DISABLED, State.NOT_READY, State.FAULT)
            if not self._left and self.values[POSITION]:
                self.home = self.values[POSITION][-1]

    def at(self, quantity: str, time: int) -> float | None:
        """Last value until a time [ns]; before the first one, the first; None without any."""
        times = self.times[quantity]
        if not times:
            return None
        return self.values[quantity][max(bisect_right(times, time) - 1, 0)]


class Recording:
    """The drives of a hardware file in a trace. `zero` [ns]: begin of the recorded run."""

    def __init__(self, path: Path, keys: HardwareKeys, start: float | None = None) -> None:
        decoder = Decoder.of_bench(keys)
        self.tracks = {name: Track(node_keys, name) for name, node_keys in keys.nodes.items()}
        nodes = {node_keys.node: self.tracks[name] for name, node_keys in keys.nodes.items()}
        targets = {base + node for base in (0x200, 0x300, 0x400, 0x500) for node in nodes}
        self.zero = round(start * 1e9) if start is not None else -1
        self.end = 0
        for number, (time, frame, _) in enumerate(read(path), 1):
            if number > 1 and time < self.end - DISORDER:
                raise SimulationError(
                    f"{path}: frame {number} is {(self.end - time) / 1e9:g} s earlier than the one before. Sort them by time."
                )
            self.end = max(time, self.end)
            if frame is None:
                continue
            line = decoder.decode(time, frame)
            if line.node in nodes and frame.id not in targets:
                nodes[line.node].hear(line)
            if self.zero < 0 and frame.id in targets and all(track.enabled for track in nodes.values()):
                self.zero = time - bit_count(frame) * 1_000_000_000 // keys.bit_rate
        for name, track in self.tracks.items():
            if not track.values[POSITION]:
                raise SimulationError(
                    f"{path}: says nothing of {name}'s position (node {keys.nodes[name].node}). "
                    f"Record it from the start, or correct the hardware file."
                )
        if self.zero < 0:
            raise SimulationError(f"{path}: the drives are never enabled. Name the beginning: {path.name}@SECONDS.")
