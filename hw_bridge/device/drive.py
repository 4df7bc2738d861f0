"""The simulated drive: state machine, modes and errors of CiA 402 on a CANopen slave, in control of a motor."""

from __future__ import annotations

import struct
from functools import reduce
from operator import or_
from typing import TYPE_CHECKING

from hw_bridge.device import emergency, modes
from hw_bridge.device.axis import Axis
from hw_bridge.device.homing import Homing
from hw_bridge.device.motor import CYCLE, Motor
from hw_bridge.device.slave import Slave
from hw_bridge.device.touch_probe import TouchProbes
from hw_bridge.dictionary import Abort, Code, Command, HomingEvent, Mode, NmtState, State, cia402
from hw_bridge.profiles import Profile, Reaction
from twin.errors import DeclarationError, SimulationError

if TYPE_CHECKING:
    from collections.abc import Set as AbstractSet

    from hw_bridge.dictionary import Entry, Value
    from hw_bridge.profiles import Fault

FOLLOWING_ERROR, SPEED_DEVIATION, HEARTBEAT, RPDO_TIMEOUT = 0x8611, (0x8400, 0x84F0), 0x8130, 0x8250
ERROR_PASSIVE = 0x8120
OVERVOLTAGE, UNDERVOLTAGE, OVERCURRENT = 0x3210, 0x3220, 0x2310
LIMIT_SWITCH = {HomingEvent.NEGATIVE: 0x8A80, HomingEvent.POSITIVE: 0x8A81}  # of a vendor that takes it for an error
SILENCE = 3  # so many interpolation periods without a target are an RPDO timeout; estimate

MODES: dict[int, type[modes.ModeOfOperation]] = {
    Mode.NONE: modes.NoMode,
    Mode.PP: modes.ProfilePosition,
    Mode.PV: modes.ProfileVelocity,
    Mode.HM: Homing,
    Mode.CSP: modes.CyclicPosition,
    Mode.CSV: modes.CyclicVelocity,
    Mode.CST: modes.CyclicTorque,
}
TARGETS = (0x607A, 0x60FF, 0x6071)
CYCLIC = (Mode.CSP, Mode.CSV, Mode.CST)
STAGE_ON = (State.SWITCHED_ON, State.ENABLED, State.QUICK_STOP, State.REACTION)


REQUIRED = (0x1000, 0x1001, 0x1003, 0x1018, 0x6040, 0x6041, 0x6060, 0x6061, 0x6064, 0x6502)


class Drive(Slave):
    """One drive of a vendor's `profile` with its motor; frames in, frames out, `advance(t_ns)`."""

    def __init__(self, profile: Profile, node: int, motor: Motor) -> None:
        if missing := [f"{index:04X}" for index in REQUIRED if index not in {entry.index for entry in profile.objects}]:
            raise DeclarationError(f"{profile.title}: lacks {', '.join(missing)}. A CiA 402 drive has these objects.")
        self.profile = profile
        self.lasting: set[int] = set()  # errors whose cause stays until it is removed
        super().__init__(profile.objects, node, profile.rules, profile.boot_time, profile.sdo_time)
        self.axis = Axis(profile, self.dictionary, self.port.event_queue, motor)
        self.touch_probes = TouchProbes(self.axis)
        dictionary = self.dictionary
        dictionary.checks[0x6060] = self._check_mode
        dictionary.checks[0x6098] = self._check_homing
        dictionary.effects[0x6040] = self._controlled
        for twin in profile.twins:
            dictionary.effects[twin] = self._update_twin
        self.power_on()
        self.port.event_queue.at(CYCLE, self._cycle)

    def power_on(self) -> None:
        """Restart: no current, no errors, position 0 at the motor's position."""
        self.axis.start()
        self.touch_probes.start()
        self.state = State.NOT_READY
        self.word = 0
        self.active: dict[int, Fault] = {}
        self.stop: modes.DecelerationRamp | None = None
        self.after: State | None = None  # the state after the stop; None: stay
        self.brake: modes.DecelerationRamp | None = None  # at a closed limit switch
        self.last_target_at = 0  # [ns]; 0: never
        self.mode = MODES[Mode.NONE](self.axis, self.error)
        self._choose_mode()
        self._show()

    @property
    def supply(self) -> float:
        """Voltage of the power stage [V]: what the drive watches is what the motor has."""
        return self.axis.motor.supply

    @supply.setter
    def supply(self, voltage: float) -> None:
        self.axis.motor.set("supply_voltage", voltage)

    @property
    def outputs(self) -> int:
        """Levels of its digital outputs: 60FEh.1 where enabled by the mask 60FEh.2."""
        return self.dictionary.get(0x60FE, 1) & self.dictionary.get(0x60FE, 2, missing=0xFFFFFFFF)

    # -------------------------------------------------------------------------------------------- the state machine

    def _controlled(self, _: Entry) -> None:
        word, previous = self.dictionary.get(0x6040), self.word
        self.word = word
        if cia402.command_of(word, previous) is Command.FAULT_RESET:
            self._reset_errors()
        if (step := cia402.transition(self.state, word, previous)) is not None:
            self._take(step)
        if self.state is State.ENABLED and self.stop is None:
            self.mode.control(word)
        self._show()

    def _take(self, step: cia402.Transition) -> None:
        """Execute a transition; those that stop the motor end later."""
        option = self.profile.option
        match step.number:
            case 5 if option(self.dictionary, 0x605C):
                self._slow_down(0x6084, step.target)
            case 8 if option(self.dictionary, 0x605B):
                self._slow_down(0x6084, step.target)
            case 11:
                self._quick_stop()
            case 15 if self.active:
                pass  # the cause is still there
            case 16 if self.after is not None:
                pass  # a quick stop with 605Ah = 1 to 4 ends disabled
            case _:
                self._enter(step.target)

    def _enter(self, state: State) -> None:
        self.state, self.stop, self.brake = state, None, None
        if state is State.ENABLED:
            self.last_target_at = 0  # silence counts from the first target on
            self.mode.word = self.word
            self.mode.begin()
        elif state is not State.REACTION:
            self.axis.off()

    def _slow_down(self, rate: int, after: State | None) -> None:
        self.stop, self.after = modes.DecelerationRamp(self.axis, self.axis.rate(rate)), after

    def _quick_stop(self) -> None:
        option = self.profile.option(self.dictionary, 0x605A)
        if option == 0:
            self._enter(State.DISABLED)
            return
        self.state = State.QUICK_STOP
        self._slow_down(0x6084 if option in (1, 5) else 0x6085, None if option in (5, 6) else State.DISABLED)

    def _check_mode(self, _: Entry, value: Value) -> None:
        if value != Mode.NONE and value not in self.profile.modes:
            raise Abort(Code.VALUE_RANGE)

    def _check_homing(self, _: Entry, value: Value) -> None:
        if value not in self.profile.homing and value != 0:
            raise Abort(Code.VALUE_RANGE)

    def _update_twin(self, entry: Entry) -> None:
        """Convert a target in increments to user units."""
        axis, twin = self.axis, self.profile.twins[entry.index]
        target = self.dictionary.get(entry.index) * axis.motor.model.resolution / axis.units.position
        self.dictionary.put(twin, self.dictionary.entry(twin).type.saturated(target))

    def _choose_mode(self) -> None:
        """6061h follows 6060h; a change while enabled begins the new mode from the present motion."""
        wanted = self.dictionary.get(0x6060)
        if wanted != self.dictionary.get(0x6061) or type(self.mode) is not MODES[wanted]:
            self.mode = MODES[wanted](self.axis, self.error)
            self.dictionary.put(0x6061, wanted)
            self.mode.word = self.word
            self.mode.begin()

    # ------------------------------------------------------------------------------------------------ control cycle

    def _cycle(self) -> None:
        now = self.port.event_queue.now
        self.axis.motor.advance(now - CYCLE)
        self.axis.measure()
        self.touch_probes.cycle()
        self._monitor(now)
        if self.state is State.NOT_READY:
            self._enter(State.DISABLED)
        elif self.stop is not None:
            if self.stop.cycle() and self.after is not None:
                self._enter(self.after)
        elif self.state is State.REACTION:
            self._enter(State.FAULT)
        elif self.state is State.SWITCHED_ON and cia402.command_of(self.word, self.word) is Command.ENABLE:
            self._enter(State.ENABLED)
        self._choose_mode()
        if self.state is State.ENABLED and self.stop is None:
            self.mode.cycle()
            self._keep_off_limit_switches()
        self._show()
        self.refresh()
        self.port.event_queue.at(now + CYCLE, self._cycle)

    def _keep_off_limit_switches(self) -> None:
        """Stop at a closed limit switch: the vendor's error, or braking with 6085h and bit 11. Homing has its own."""
        axis = self.axis
        switch = None if isinstance(self.mode, Homing) else axis.limit_switch(axis.heading)
        if switch is None:
            self.brake = None
        elif LIMIT_SWITCH[switch] in self.profile.faults:
            self.error(LIMIT_SWITCH[switch])
        else:
            self.brake = self.brake or modes.DecelerationRamp(axis, axis.rate(0x6085))
            self.brake.cycle()
            axis.clipped = True

    def _monitor(self, now: int) -> None:
        """Detect errors."""
        axis, dictionary, profile = self.axis, self.dictionary, self.profile
        low, high = profile.supply(dictionary)
        supply = self.supply
        self._while(OVERVOLTAGE, supply > high)
        self._while(UNDERVOLTAGE, supply < low)
        if profile.masks:
            self._while(OVERCURRENT, axis.derated)
        enabled = self.state is State.ENABLED
        outside = enabled and axis.holds_position and self.mode.following_error()
        self._while(FOLLOWING_ERROR, axis.lasting(0x6065, outside, dictionary.get(0x6066)))
        if profile.deviation is not None:
            window, time = profile.deviation(dictionary)
            deviates = enabled and abs(axis.speed - axis.velocity) > window * axis.units.velocity
            code = next(code for code in SPEED_DEVIATION if code in profile.faults)
            self._while(code, axis.lasting(code, deviates, time))
        if profile.rpdo_timeout and enabled and self.last_target_at and dictionary.get(0x6061) in CYCLIC:
            period = dictionary.get(0x60C2, 1) * 10 ** max(dictionary.get(0x60C2, 2) + 9, 0)
            if period and now - self.last_target_at > SILENCE * period:
                self.error(RPDO_TIMEOUT)

    def _while(self, code: int, condition: bool) -> None:
        """Hold an error as long as its cause; one that did not trip ends with it."""
        if condition and code in self.profile.faults:
            self.error(code)
        elif (
            not condition
            and code in self.active
            and code not in self.lasting
            and self.state not in (State.REACTION, State.FAULT)
        ):
            self._forget({code})

    def _show(self) -> None:
        """Compose the statusword."""
        axis = self.axis
        word = cia402.STATUS[self.state].value | cia402.REMOTE * (self.port.state is NmtState.OPERATIONAL)
        powered = self.state in STAGE_ON if self.profile.power_stage_bit else self.supply > 0.0
        word |= cia402.VOLTAGE_ENABLED * powered
        word |= cia402.WARNING * (axis.derated or (bool(self.active) and self.state is not State.FAULT))
        word |= cia402.INTERNAL_LIMIT * (self.state is State.ENABLED and (axis.limited or axis.clipped))
        if self.state is State.ENABLED:
            word |= self.mode.bits()
        if (bit := self.profile.reference_bit) is not None:
            word |= axis.referenced << bit
        self.dictionary.put(0x6041, word)

    # ------------------------------------------------------------------------------------------------------- errors

    def error(self, code: int) -> None:
        """Raise an error: report it once, react by the vendor's table."""
        if code not in self.profile.faults:
            codes = ", ".join(f"{number:04X}" for number in sorted(self.profile.faults))
            raise SimulationError(f"{self.profile.name}: has no error {code:04X}h. There are: {codes}.")
        if code in self.active:
            return
        fault = self.active[code] = self.profile.faults[code]
        dictionary = self.dictionary
        masks = self.profile.masks
        dictionary.put(0x603F, code)
        dictionary.put(0x1001, self._register())
        dictionary.put(0x2320, self._vendor_register())
        if self._is_reported(fault):
            self.emergency.report(code, self._register(), self._vendor_bytes())
        reaction = fault.reaction
        if masks and reaction is not Reaction.OFF and not fault.vendor & dictionary.get(0x2321, 2):
            reaction = Reaction.REPORT
        if reaction is Reaction.CONNECTION:
            self.abort_connection()
        elif reaction is not Reaction.REPORT:
            self._trip(reaction)
        self._show()

    def inject(self, code: int, lasting: bool = False) -> None:
        """Inject an error; a lasting one cannot be reset until `remove`."""
        if lasting:
            self.lasting.add(code)
        self.error(code)
        self.refresh()

    def remove(self, code: int) -> None:
        """Remove the cause of a lasting error."""
        self.lasting.discard(code)

    def _register(self) -> int:
        return reduce(or_, (fault.register for fault in self.active.values()), emergency.GENERIC if self.active else 0)

    def _is_reported(self, fault: Fault) -> bool:
        return not self.profile.masks or bool(fault.vendor & self.dictionary.get(0x2321, 1))

    def _vendor_register(self) -> int:
        return reduce(or_, (fault.vendor for fault in self.active.values()), 0)

    def _vendor_bytes(self) -> bytes:
        return struct.pack("<H", self._vendor_register()) if 0x2320 in self.dictionary else b""

    def _reset_errors(self) -> None:
        if self.state is State.REACTION or not self.active:
            return
        self._forget(self.active.keys() - self.lasting)

    def _forget(self, codes: AbstractSet[int]) -> None:
        """End these errors; the end of the last one is reported."""
        is_reported = any(self._is_reported(self.active[code]) for code in codes & self.active.keys())
        self.active = {code: fault for code, fault in self.active.items() if code not in codes}
        self.dictionary.put(0x1001, self._register())
        self.dictionary.put(0x2320, self._vendor_register())
        if not self.active:
            self.dictionary.put(0x603F, 0)
            self.emergency.clear(is_reported)

    def _trip(self, reaction: Reaction) -> None:
        """Transition 13; the reaction ends in Fault."""
        if self.state in (State.REACTION, State.FAULT):
            return
        moving = self.state in (State.ENABLED, State.QUICK_STOP)
        option = self.profile.option(self.dictionary, 0x605E)
        self._enter(State.REACTION)
        if moving and reaction is Reaction.RAMP and option:
            self._slow_down(0x6084 if option == 1 else 0x6085, State.FAULT)
        else:
            self.axis.off()

    def abort_connection(self) -> None:
        """React to the loss of the master by 6007h."""
        option = self.profile.option(self.dictionary, 0x6007)
        if self.state is not State.ENABLED or option == 0:
            return
        if option == 1:
            self._trip(Reaction.RAMP)
        elif option == 2:
            self._enter(State.DISABLED)
        else:
            self._quick_stop()

    # ------------------------------------------------------------------------------------------- the slave's wishes

    def communication_error(self, code: int) -> None:
        """React to a PDO of a wrong length."""
        if code in self.profile.faults:
            self.error(code)

    def master_lost(self) -> None:
        """React to a missing heartbeat or node guarding; again, if the drive was enabled anew with the earlier error."""
        if HEARTBEAT in self.active and self.state is State.ENABLED:
            self._forget({HEARTBEAT})
        self.error(HEARTBEAT)

    def data_received(self, mapped: list[Entry]) -> None:
        """Reset the RPDO time-out if targets were received."""
        if any(entry.index in TARGETS for entry in mapped):
            self.last_target_at = self.axis.last_target_at = self.port.event_queue.now

    def nmt_changed(self) -> None:
        """Abort the connection in Stopped and at a reset (CiA 402); not in Pre-operational."""
        if self.port.state is not NmtState.OPERATIONAL:
            self.last_target_at = 0
        if self.port.state in (NmtState.STOPPED, NmtState.INITIALIZING):
            self.abort_connection()
        self._show()

    def error_passive(self) -> None:
        """React to error passive."""
        if ERROR_PASSIVE in self.profile.faults:
            self.error(ERROR_PASSIVE)

    def bus_off(self) -> None:
        """React to bus-off."""
        self.port.online = False
        self.abort_connection()

    def bus_on(self) -> None:
        """React to recovery from bus-off: report it."""
        self.port.online = True
        self.error(self.profile.bus_off)
