"""Motor of a simulated drive: a component of the twin, commanded by the drive's profile generators.

The component has its own cascaded loops, and the voltage of its supply, so that currents and following errors
are physical. A motor that is switched off has a current limit of 0.
"""

from __future__ import annotations

from math import isfinite
from pathlib import Path

import numpy as np

from hw_bridge.bus import MILLISECOND
from hw_bridge.profiles import EFFORT, MotorModel
from twin import clock
from twin.compiler import machine
from twin.component import OK
from twin.coupling import RecordMember
from twin.errors import SimulationError
from twin.scenario import Backend, members

CYCLE = MILLISECOND  # control cycle of a drive [ns]; a multiple of the sampling time of the motor's loops
CSP, CSV, CST = 8, 9, 10
SAMPLES = (1, 2, 4, 5, 8, 10, 20)  # of a motor's loops in a cycle; periods that can be written exactly


def uneven(period: float) -> str:
    """Problem text if the motor's loops do not sample a whole number of times in a control cycle, else empty. `period` [s]."""
    cycle = clock.seconds(CYCLE)
    samples = cycle / period
    if samples >= 0.5 and abs(round(samples) - samples) < 1e-6:
        return ""
    counts = [sample for sample in SAMPLES if sample < samples][-1:] + [
        sample for sample in SAMPLES if sample > samples
    ][:1]
    choice = " or ".join(f"{1e3 * cycle / count:g} ms" for count in counts)
    return f"drive_period {1e3 * period:g} ms does not divide the drive's control cycle of {1e3 * cycle:g} ms. Use {choice}."


class Motor:
    """One motor in SI units, linear or rotary, advanced a control cycle at a time. Its side of a gear counts."""

    def __init__(
        self, model: MotorModel, form: Backend = Backend.compiled, build: Path = Path("build"), position: float = 0.0
    ) -> None:
        self.model = model
        values = {**model.parameters, "target_position": position / model.ratio, "mode_of_operation": CSP}
        member = members.make("motor", model.component, values, form, build)
        assert isinstance(member, RecordMember)
        self._member = member
        self._views = member.component.views
        member.instantiate()
        member.enter_initialization(0.0, None)
        member.exit_initialization()
        member.get(model.position)
        self._step = machine.stepper(member.step_function, member.step_signature)
        self._flags = np.zeros(4, np.int64)
        self._address_of_flags = int(self._flags.ctypes.data)  # asked once: it takes longer than the step
        self.strongest = float(self._views["current_maximum"])  # the motor's own limit [A]
        if "current_continuous" in self._views:
            self._views["current_continuous"][...] = 10.0 * self.strongest  # I2t is the drive's, by its own objects
        self._tuned: dict[str, float] = {}  # gains, as multiples of the component's
        self.powered = True
        self.grip = 1.0  # share of the load that reaches it
        self.offset = 0.0  # error of the sensor [m or rad]
        self._stuck: float | None = None  # where the sensor stands still
        self._ahead = self._pushed = 0.0  # what offsets add: to the target position, and to the integral [A]
        self.off()

    @property
    def measured_position(self) -> float:
        """Position by its sensor [m or rad]."""
        if self._stuck is not None:
            return self._stuck
        return self.model.ratio * float(self._views["position_actual_value"]) + self.offset

    def stick(self) -> None:
        """Freeze the sensor. The motor's own loops continue without noticing."""
        self._stuck = self.measured_position

    @property
    def measured_velocity(self) -> float:
        """Filtered difference of the measured position [m/s or rad/s]."""
        return 0.0 if self._stuck is not None else self.model.ratio * float(self._views["velocity_actual_value"])

    @property
    def position(self) -> float:
        """The true position [m or rad]."""
        return self.model.ratio * float(self._views[self.model.position])

    @property
    def current(self) -> float:
        """Current in the winding [A]."""
        return float(self._views["current"])

    @property
    def supply(self) -> float:
        """Voltage of its power stage [V]."""
        return self.get("supply_voltage")

    def load(self, force: float) -> None:
        """Set the force [N] or torque [N*m] of the load, behind the gear."""
        if not isfinite(force):
            raise SimulationError(f"motor: {self.model.load} is {force}. Look at what it comes from.")
        self._views[self.model.load][...] = force * self.grip

    def set(self, parameter: str, value: float) -> None:
        """Change a parameter of the component."""
        self._views[parameter][...] = value * self._tuned.get(parameter, 1.0)

    def tune(self, parameter: str, factor: float) -> None:
        """Set a gain as a factor on the component's, above 0."""
        if (before := self._tuned.get(parameter, 1.0)) != factor:
            self._tuned[parameter] = factor
            self._views[parameter][...] *= factor / before

    def scale(self, parameter: str, factor: float) -> None:
        """Multiply a parameter of the component."""
        self._views[parameter][...] *= factor

    def get(self, name: str) -> float:
        """A variable of the component."""
        return float(self._views[name])

    def off(self) -> None:
        """Switch the current off."""
        self.powered = False
        self._views["current_maximum"][...] = 0.0
        # the loops begin anew when power comes back: nothing was gathered, and no position was followed meanwhile
        self._views["current_integral"][...] = 0.0
        self._ahead = self._pushed = 0.0
        self._views["mode_of_operation"][...] = CSV

    def follow_position(self, position: float, limit: float, velocity: float = 0.0, current: float = 0.0) -> None:
        """Track a position [m or rad] with no more than `limit` [A]; added to the loops: a speed, a current [A]."""
        self._ahead = self._lead(velocity / self.model.ratio)
        self._push(current)
        self._follow(CSP, "target_position", (position - self.offset) / self.model.ratio + self._ahead, limit)

    def follow_velocity(self, velocity: float, limit: float, current: float = 0.0) -> None:
        """Track a speed [m/s or rad/s]; added to the loop: a current [A]."""
        self._push(current)
        self._follow(CSV, "target_velocity", velocity / self.model.ratio, limit)

    def _lead(self, velocity: float) -> float:
        """Target offset that makes the P loop produce the feedforward velocity exactly.

        The loop is gain * (target - position), and some components feed the target's own speed forward.
        """
        if velocity == 0.0 and self._ahead == 0.0:
            return 0.0
        own = self.get("feedforward") / clock.seconds(CYCLE) if "feedforward" in self._views else 0.0
        if self._views["mode_of_operation"] != CSP:  # a target that was not followed has no speed
            own = 0.0
        return (velocity + own * self._ahead) / (self.get("position_gain") + own)

    def _push(self, current: float) -> None:
        """Add a current to that of the velocity loop, through its integral."""
        if current != self._pushed:
            self._views["current_integral"][...] += current - self._pushed
            self._pushed = current

    def follow_current(self, current: float, limit: float) -> None:
        """Track a current [A]."""
        self._pushed = 0.0  # the loop's integral becomes this current
        target, constant = EFFORT[self.model.load]
        self._follow(CST, target, current * self.get(constant), limit)

    def _follow(self, mode: int, target: str, value: float, limit: float) -> None:
        self.powered = True
        self._views["mode_of_operation"][...] = mode
        self._views[target][...] = value
        self._views["current_maximum"][...] = min(limit, self.strongest)

    def advance(self, time: int) -> None:
        """Advance by one control cycle from `time` [ns]."""
        begin, cycle = clock.seconds(time), clock.seconds(CYCLE)
        if self._step(self._member.instance, begin, cycle, True, self._address_of_flags) != OK:
            raise SimulationError(f"motor: {uneven(self.get('drive_period')) or 'its step failed.'}")
