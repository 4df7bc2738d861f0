"""An I/O module on the master's side: identity, safe values without a master, outputs in each cycle."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from hw_bridge.bus import Frame
from hw_bridge.dictionary import cia401
from hw_bridge.master import setup
from hw_bridge.master.plan import WritePlan, disable_receive_pdos, plan_heartbeat, plan_pdo
from hw_bridge.master.station import Station
from twin.errors import SimulationError

if TYPE_CHECKING:
    from hw_bridge.bus import Network
    from hw_bridge.hardware import ModuleKeys
    from hw_bridge.master.station import Waiting
    from hw_bridge.profiles import Device

MODULE = 401  # device profile: the lower half of 1000h
OUTPUT_PDO, INPUT_PDO = 0x200, 0x180
IDENTITY = {1: "vendor", 2: "product code", 4: "serial number"}
AT_SYNC = 1  # transmission type


class ModuleNode(Station):
    """A module of CiA 401. Only the output bytes with signals or safe levels are written."""

    keys: ModuleKeys

    def __init__(self, name: str, keys: ModuleKeys, device: Device, network: Network, wait: Waiting) -> None:
        super().__init__(name, keys, device, network, wait)
        self.outputs = self.safe_outputs = keys.safe_outputs
        self.resting = True  # outputs are the safe ones, whatever is wanted
        self.size = max(keys.safe_outputs.bit_length() - 1, *keys.outputs) // 8 + 1  # bytes

    def levels(self) -> bytes:
        """Output bytes of this cycle."""
        return (self.safe_outputs if self.resting else self.outputs).to_bytes(self.size, "little")

    def frames(self) -> list[Frame]:
        """Process data of this cycle."""
        return [Frame(OUTPUT_PDO + self.number, self.levels())]

    def process_frame(self, frame: Frame, now: int) -> None:
        """Process a frame of this module."""
        if frame.id == INPUT_PDO + self.number:
            self.answered, self.answered_at = self.answered + 1, now
        super().process_frame(frame, now)

    def identify(self) -> list[str]:
        """Return every difference between the answering module and the hardware file."""
        keys, where = self.keys, f"{self.name}: node {self.number}"
        device = struct.unpack("<I", self.sdo.read(0x1000))[0]
        if device & 0xFFFF != MODULE or not device & cia401.DIGITAL_OUTPUTS:
            return [f"{where} is no module with digital outputs: 1000h is {device:08X}h. Check the node-ID."]
        if (count := self.sdo.read(cia401.OUTPUTS)[0]) < self.size:
            return [f"{where} has {8 * count} outputs, the hardware file uses {8 * self.size}. Correct `outputs`."]
        expected = {1: keys.vendor, 2: keys.product, 4: keys.serial}
        identity = {
            sub: struct.unpack("<I", self.sdo.read(0x1018, sub))[0]
            for sub, number in expected.items()
            if number is not None
        }
        return [
            f"{where}: {IDENTITY[sub]} is {value:X}h, expected {expected[sub]:X}h. Correct the hardware file or the wiring."
            for sub, value in identity.items()
            if value != expected[sub]
        ]

    def plan(self, master: int) -> WritePlan:
        """Plan all writes of a run: safe outputs first, then error behavior without a master, then process data."""
        plan = WritePlan(self)
        levels = list(enumerate(self.safe_outputs.to_bytes(self.size, "little"), 1))
        for block, safe in levels:
            plan.add(cia401.OUTPUTS, block, safe, "safe_outputs, also after the run")
        for block, safe in levels:
            plan.add(cia401.ERROR_VALUE, block, safe, "safe_outputs, when the module misses this program")
            plan.add(cia401.ERROR_MODE, block, 0xFF, "safe_outputs, when the module misses this program")
        for (index, sub), value in self.keys.objects.items():
            plan.add(index, sub, value, "objects of the hardware file")
        plan_heartbeat(plan, master)
        blocks = range(1, self.size + 1)
        output_words = tuple(cia401.OUTPUTS << 16 | block << 8 | 8 for block in blocks)
        plan_pdo(plan, 0x1400, OUTPUT_PDO + self.number, output_words, AT_SYNC)
        disable_receive_pdos(plan, 0x1401)
        plan_pdo(plan, 0x1800, INPUT_PDO + self.number, (cia401.INPUTS << 16 | 1 << 8 | 8,), AT_SYNC)
        return plan

    def configure(self, master: int) -> None:
        """Make the planned writes; each value is read back."""
        setup.carry_out(self.plan(master))

    def make_safe(self) -> None:
        """Safe outputs by SDO, read back."""
        for block, safe in enumerate(self.safe_outputs.to_bytes(self.size, "little"), 1):
            setup.write(self, cia401.OUTPUTS, block, safe, "safe_outputs, also after the run")

    def release(self) -> str:
        """After an orderly end: safe outputs and no expected heartbeat. Return what could not be confirmed."""
        self.resting = True
        try:
            self.make_safe()
            setup.forget_heartbeats(self)
        except SimulationError as error:
            return f"{self.name}: did not confirm its safe outputs ({error}) Check them before you touch anything."
        return ""
