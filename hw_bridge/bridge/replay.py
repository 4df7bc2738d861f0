"""Replay: actual values from a recorded bus instead of the members of a scenario.

A member has the values that the master had received from its drive by the end of each step, at the times of the trace; its
inputs are ignored. Zero of the scenario is where the recorded run began: the first target after all drives were enabled.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hw_bridge.bridge.axis import COPIED_ROLES, DriveAxis, SessionMember
from hw_bridge.bridge.fitting import Fitting
from hw_bridge.bridge.hardware import ROOM, Hardware
from hw_bridge.dictionary import cia402
from hw_bridge.hardware import motor_data
from hw_bridge.plant import start_position
from hw_bridge.session import outputs
from hw_bridge.trace import NAMES, POSITION, STATUSWORD, Recording
from twin.component import Int32, PythonComponent
from twin.component import output as output_variable
from twin.errors import SimulationError
from twin.results import HardwareTermination

if TYPE_CHECKING:
    from pathlib import Path

    from hw_bridge.hardware import HardwareKeys
    from twin.component import Component


class ReplayAxis(DriveAxis):
    """A recorded drive; values that its trace does not contain are NaN."""

    hardware: Replay

    def __init__(self, **values: Any) -> None:
        super(SessionMember, self).__init__(**values)
        self._track = self.hardware.recording.tracks[self.member]
        self._keys = self.hardware.keys.nodes[self.member]
        self._force_constant = motor_data.force_constant_of(self._keys)

    def step(self, t: float, h: float) -> None:
        """Update outputs with the values received by the end of the step."""
        self._show(round((t + h) * 1e9))

    def _show(self, time: int) -> None:
        track, zero, keys = self._track, self.hardware.recording.zero, self._keys
        for quantity, names in NAMES.items():
            value = track.at(quantity, zero + time)
            if value is None:
                continue
            if quantity == POSITION:
                value += start_position(self) - track.home if keys.homing is None else keys.homing.at
            values = dict.fromkeys(names, value)
            if quantity == POSITION:
                values["motor_angle"] = value / keys.scale
            elif quantity == STATUSWORD:
                values["limited"] = bool(int(value) & cia402.INTERNAL_LIMIT)
            elif quantity == "current":
                values["force"] = self._force_constant * value
                values["torque"] = values["force"] * keys.scale
            for name, item in values.items():
                if name in self.views:
                    self.views[name][...] = item

    def close(self) -> None:
        """No-op."""


class Idle(PythonComponent):
    """A module in a replay: its outputs are in the trace."""

    def step(self, t: float, h: float) -> None:
        """No-op."""


class Replay(Hardware):
    """A hardware file whose drives are in a trace."""

    def __init__(self, path: Path, keys: HardwareKeys, trace: Path, start: float | None = None) -> None:
        super().__init__(path, keys, arm=True)
        self.fitting = Fitting(path, keys, retracts=False)
        self.trace_read = trace
        self.recording = Recording(trace, keys, start)

    @property
    def takes_faults(self) -> bool:
        """False: a recording cannot change."""
        return False

    def bounds(self) -> list[str]:
        """No bounds: nothing moves."""
        return []

    def termination(self) -> HardwareTermination:
        """A replay is never stopped by hardware."""
        return HardwareTermination()

    def _component(self, name: str, replaced: type[Component], variant: str = "") -> type[DriveAxis]:
        fields: dict[str, Any] = {
            **{v.name: v for v in replaced.variables if v.role in COPIED_ROLES},
            **replaced.terminals,
        }
        fields |= outputs.inputs(self.keys.nodes[name].outputs)
        fields.setdefault(STATUSWORD, output_variable("", "6041h", type=Int32))
        fields |= {"hardware": self, "member": name, "replaced": replaced, "variant": variant, "__module__": ROOM}
        fields["__doc__"] = f"A recorded drive instead of {replaced.__name__}."
        return type(f"Recorded_{name}", (ReplayAxis,), fields)

    def _module(self, name: str, variant: str) -> type[Component]:  # noqa: ARG002 - its levels go nowhere
        fields: dict[str, Any] = {**outputs.inputs(self.keys.modules[name].outputs)}
        return type(f"Recorded_{name}", (Idle,), fields | {"__module__": ROOM, "__doc__": "A recorded module."})

    def report(self) -> dict[str, Any]:
        """Name and zero of the trace."""
        recording = self.recording
        length = (recording.end - recording.zero) / 1e9
        shown = f"{self.trace_read}: {length:.3f} s from {recording.zero / 1e9:.6f} s on"
        return {"file": str(self.path), "replay": str(self.trace_read), "zero": recording.zero / 1e9, "shown": [shown]}


def replay(path: Path, keys: HardwareKeys, words: str) -> Replay:
    """Open a trace as named on the command line: FILE, or FILE@SECONDS with the time of the scenario's zero."""
    from pathlib import Path as File

    name, mark, seconds = words.rpartition("@")
    if not mark:
        return Replay(path, keys, File(words))
    try:
        return Replay(path, keys, File(name), float(seconds))
    except ValueError:
        raise SimulationError(f"--replay {words}: expected FILE@SECONDS, such as run.blf@0.35.") from None
