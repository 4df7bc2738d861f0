"""Replay: what a recorded bus says of its drives, instead of the members of a scenario.

A member shows what the master had heard of its drive by the end of each step, at the times of the trace; its inputs go
nowhere. Zero of the scenario is where the recorded run began: the first target after all drives were enabled.
"""

from __future__ import annotations

from bisect import bisect_right
from typing import TYPE_CHECKING, Any

from hw_bridge.bridge import KEPT, DriveAxis, Hardware
from hw_bridge.cia402 import INTERNAL_LIMIT, State, state_of
from hw_bridge.frame import bit_count
from hw_bridge.master.node import constant_of
from hw_bridge.outputs import inputs
from hw_bridge.session import beginning
from hw_bridge.trace.decoder import Decoder
from hw_bridge.trace.files import read
from twin.component import Int32, PythonComponent
from twin.component import output as output_variable
from twin.errors import SimulationError
from twin.results import Ending

if TYPE_CHECKING:
    from pathlib import Path

    from hw_bridge.keys import HardwareKeys, NodeKeys
    from hw_bridge.trace.decoder import Line
    from twin.component import Component
    from twin.scenario import Case

POSITION, VELOCITY, STATUSWORD = "position_actual_value", "velocity_actual_value", "statusword"
CURRENTS = ("torque_actual_value", "current_actual_values_actual", "current_actual_value")
NAMES = {  # what a member may call it
    POSITION: (POSITION, "position", "angle"),
    VELOCITY: (VELOCITY, "velocity", "angular_velocity"),
    "current": ("current",),
    STATUSWORD: (STATUSWORD,),
}  # fmt: skip
DISORDER = 10_000_000  # by which frames of two channels may be recorded in the wrong order [ns]


class Track:
    """What one drive said: for each quantity the times [ns] and values, in the member's direction and scale."""

    def __init__(self, keys: NodeKeys, name: str) -> None:
        self.name = name
        sign = -1.0 if keys.inverted else 1.0
        self.factors = {POSITION: sign * keys.scale, VELOCITY: sign * keys.scale, "current": sign, STATUSWORD: 1.0}
        self.times: dict[str, list[int]] = {quantity: [] for quantity in NAMES}
        self.values: dict[str, list[float]] = {quantity: [] for quantity in NAMES}
        self.home = 0.0  # position where the drive stood before it was enabled
        self.enabled = False
        self._left = False  # whether it was on the way to Operation enabled

    def hear(self, line: Line) -> None:
        """A line of the trace about this drive."""
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
        """The last value until a time [ns]; the first one before; none if there is none at all."""
        times = self.times[quantity]
        if not times:
            return None
        return self.values[quantity][max(bisect_right(times, time) - 1, 0)]


class Recording:
    """The drives of a hardware file in a trace. `zero` [ns]: where the recorded run began."""

    def __init__(self, path: Path, keys: HardwareKeys, start: float | None = None) -> None:
        decoder = Decoder.of_bench(keys)
        self.tracks = {name: Track(one, name) for name, one in keys.nodes.items()}
        nodes = {one.node: self.tracks[name] for name, one in keys.nodes.items()}
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
            if self.zero < 0 and frame.id in targets and all(one.enabled for one in nodes.values()):
                self.zero = time - bit_count(frame) * 1_000_000_000 // keys.bit_rate
        for name, track in self.tracks.items():
            if not track.values[POSITION]:
                raise SimulationError(
                    f"{path}: says nothing of {name}'s position (node {keys.nodes[name].node}). "
                    f"Record it from the start, or correct the hardware file."
                )
        if self.zero < 0:
            raise SimulationError(f"{path}: the drives are never enabled. Name the beginning: {path.name}@SECONDS.")


class ReplayAxis(DriveAxis):
    """A drive that was recorded; what its trace does not tell is NaN."""

    hardware: Replay

    def __init__(self, **values: Any) -> None:
        super(DriveAxis, self).__init__(**values)
        self._track = self.hardware.recording.tracks[self.member]
        self._keys = self.hardware.keys.nodes[self.member]
        self._force_constant = constant_of(self._keys)

    def step(self, t: float, h: float) -> None:
        """Show what had been heard by the end of the step."""
        self._show(round((t + h) * 1e9))

    def _show(self, time: int) -> None:
        track, zero, keys = self._track, self.hardware.recording.zero, self._keys
        for quantity, names in NAMES.items():
            value = track.at(quantity, zero + time)
            if value is None:
                continue
            if quantity == POSITION:
                value += beginning(self) - track.home if keys.homing is None else keys.homing.at
            found = dict.fromkeys(names, value)
            if quantity == POSITION:
                found["motor_angle"] = value / keys.scale
            elif quantity == STATUSWORD:
                found["limited"] = bool(int(value) & INTERNAL_LIMIT)
            elif quantity == "current":
                found["force"] = self._force_constant * value
                found["torque"] = found["force"] * keys.scale
            for name, one in found.items():
                if name in self.views:
                    self.views[name][...] = one

    def close(self) -> None:
        """Nothing is held."""


class Idle(PythonComponent):
    """A module in a replay: what switches is in the trace."""

    def step(self, t: float, h: float) -> None:
        """Nothing is done."""


class Replay(Hardware):
    """A hardware file whose drives are in a trace."""

    def __init__(self, path: Path, keys: HardwareKeys, trace: Path, start: float | None = None) -> None:
        super().__init__(path, keys, arm=True)
        self.contacts = {}
        self.trace_read = trace
        self.recording = Recording(trace, keys, start)

    @property
    def takes_faults(self) -> bool:
        """What happened has happened."""
        return False

    def ending(self) -> Ending:
        """A trace stops nobody."""
        return Ending()

    def _find_contact(self, name: str, case: Case) -> list[str]:  # noqa: ARG002 - nobody retracts
        return []

    def _component(self, name: str, replaced: type[Component], variant: str = "") -> type[DriveAxis]:
        fields: dict[str, Any] = {v.name: v for v in replaced.variables if v.role in KEPT}
        fields |= inputs(self.keys.nodes[name].outputs)
        fields.setdefault(STATUSWORD, output_variable("", "6041h", type=Int32))
        fields |= {"hardware": self, "member": name, "replaced": replaced, "variant": variant, "__module__": __name__}
        fields["__doc__"] = f"A recorded drive instead of {replaced.__name__}."
        return type(f"Recorded_{name}", (ReplayAxis,), fields)

    def _module(self, name: str, variant: str) -> type[Component]:  # noqa: ARG002 - its levels go nowhere
        fields: dict[str, Any] = {**inputs(self.keys.modules[name].outputs)}
        return type(f"Recorded_{name}", (Idle,), fields | {"__module__": __name__, "__doc__": "A recorded module."})

    def report(self) -> dict[str, Any]:
        """Which trace it was."""
        recording = self.recording
        length = (recording.end - recording.zero) / 1e9
        shown = f"{self.trace_read}: {length:.3f} s from {recording.zero / 1e9:.6f} s on"
        return {"file": str(self.path), "replay": str(self.trace_read), "zero": recording.zero / 1e9, "shown": [shown]}


def replay(path: Path, keys: HardwareKeys, words: str) -> Replay:
    """A trace as the command line names it: FILE, or FILE@SECONDS with the time that is the scenario's zero."""
    from pathlib import Path as File

    name, mark, seconds = words.rpartition("@")
    if not mark:
        return Replay(path, keys, File(words))
    try:
        return Replay(path, keys, File(name), float(seconds))
    except ValueError:
        raise SimulationError(f"--replay {words}: expected FILE@SECONDS, such as run.blf@0.35.") from None
