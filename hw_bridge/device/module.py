"""Simulated I/O module of CiA 401: digital outputs of a master, with error values for its loss."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.device.slave import Slave
from hw_bridge.dictionary import NmtState, cia401

if TYPE_CHECKING:
    from hw_bridge.dictionary import Entry
    from hw_bridge.profiles import Device

ERROR_PASSIVE, HEARTBEAT, BUS_OFF = 0x8120, 0x8130, 0x8140


class Module(Slave):
    """One module; frames in, frames out, `advance(t_ns)`.

    A failure (heartbeat lost, stopped, bus-off) lasts until it is set to Operational again: that is this module's choice,
    CiA 401 leaves it open. Until then the bits of 6206h have the values of 6207h, the others keep what they were.
    """

    def __init__(self, device: Device, node: int) -> None:
        self.profile = device
        self.failed = False
        super().__init__(device.objects, node, device.rules, device.boot_time, device.sdo_time)

    @property
    def outputs(self) -> int:
        """Levels of the outputs, the first one in bit 0."""
        dictionary, word = self.dictionary, 0
        for block in cia401.BLOCKS:
            level = dictionary.get(cia401.OUTPUTS, block)
            if self.failed:
                mode = dictionary.get(cia401.ERROR_MODE, block)
                level = level & ~mode | dictionary.get(cia401.ERROR_VALUE, block) & mode
            word |= level << 8 * (block - 1)
        return word

    def set_inputs(self, word: int) -> None:
        """Set the levels at the inputs, the first one in bit 0."""
        for block in cia401.BLOCKS:
            self.dictionary.put(cia401.INPUTS, word >> 8 * (block - 1) & 0xFF, block)
        self.refresh()

    def power_on(self) -> None:
        """Restart without error; the outputs are those of the dictionary."""
        self.failed = False
        self.dictionary.put(0x1001, 0)

    def fail(self, code: int) -> None:
        """Set the outputs by 6206h and 6207h, and report the error."""
        self.failed = True
        self.communication_error(code)

    def communication_error(self, code: int) -> None:
        """Report an error; the outputs are unchanged."""
        self.emergency.report(code, self.profile.faults[code].register)

    def master_lost(self) -> None:
        """React to a missing heartbeat."""
        self.fail(HEARTBEAT)

    def data_received(self, mapped: list[Entry]) -> None:
        """No-op: outputs follow the dictionary."""

    def nmt_changed(self) -> None:
        """Stopped is a failure; Operational ends one."""
        if self.port.state is NmtState.STOPPED:
            self.failed = True
        elif self.port.state is NmtState.OPERATIONAL and self.failed:
            self.failed = False
            self.emergency.clear()

    def error_passive(self) -> None:
        """React to error passive."""
        self.communication_error(ERROR_PASSIVE)

    def bus_off(self) -> None:
        """React to bus-off."""
        self.port.online = False
        self.failed = True
        self.nmt.react()

    def bus_on(self) -> None:
        """React to recovery from bus-off: report it."""
        self.port.online = True
        self.fail(BUS_OFF)
