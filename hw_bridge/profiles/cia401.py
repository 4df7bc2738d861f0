"""A generic CANopen module with digital inputs and outputs, by the device profile CiA 401; no vendor's module.

From public texts about CiA 401 and manuals of modules: 1000h, 6000h, 6200h, 6206h, 6207h, 1029h and the default PDOs.
Polarity (6202h), filter (6208h) and interrupt masks (6005h to 6008h) are optional there and left out.
"""

from __future__ import annotations

from hw_bridge.dictionary import TEXT, U8, U16, U32, Code, NodeId, cia301, cia401, record, sub, var
from hw_bridge.profiles.description import Device, Fault, Reaction, Rules
from hw_bridge.profiles.rows import SDO_SERVER, joined, pdo

OUTPUT_WORDS = tuple(cia401.OUTPUTS << 16 | block << 8 | 8 for block in cia401.BLOCKS)
READ = tuple(cia401.INPUTS << 16 | block << 8 | 8 for block in cia401.BLOCKS)

OBJECTS = joined(
    var(0x1000, "Device type", U32, "const", cia401.DIGITAL_OUTPUTS | cia401.DIGITAL_INPUTS | 401),
    var(0x1001, "Error register", U8, "ro", pdo=True),
    record(0x1003, "Pre-defined error field", sub(0, "Number of errors", U8, "rw", 0),
           *(sub(n, f"Standard error field {n}", U32, "ro") for n in range(1, 5))),
    var(0x1005, "COB-ID SYNC", U32, "rw", 0x80),
    var(0x1008, "Manufacturer device name", TEXT, "const", "CiA 401"),
    record(0x1010, "Store parameters", *(sub(n, f"Save group {n}", U32, "rw", 1) for n in range(1, 4))),
    record(0x1011, "Restore default parameters", *(sub(n, f"Restore group {n}", U32, "rw", 1) for n in range(1, 4))),
    var(0x1014, "COB-ID EMCY", U32, "rw", NodeId(0x80)),
    record(0x1016, "Consumer heartbeat time", sub(1, "Consumer heartbeat time 1", U32, "rw")),
    var(0x1017, "Producer heartbeat time", U16, "rw"),
    record(0x1018, "Identity object", sub(1, "Vendor ID", U32, "const", 0), sub(2, "Product code", U32, "const", 401),
           sub(3, "Revision number", U32, "const", 1), sub(4, "Serial number", U32, "const", 1)),
    record(0x1029, "Error behavior", sub(1, "Communication error", U8, "rw", 0, 0, 2)),
    SDO_SERVER,
    pdo(1, 0x200, OUTPUT_WORDS, receive=True, objects=8),
    *(pdo(n, 0x100 + 0x100 * n, (), receive=True, objects=8, flags=cia301.INVALID) for n in range(2, 5)),
    pdo(1, 0x180, READ, receive=False, objects=8, inhibit=0, event=0),
    *(pdo(n, 0x080 + 0x100 * n, (), receive=False, objects=8, flags=cia301.INVALID, inhibit=0, event=0) for n in range(2, 5)),
    record(cia401.INPUTS, "Read input 8-bit",
           *(sub(n, f"Inputs {8 * n - 7} to {8 * n}", U8, "ro", pdo=True) for n in cia401.BLOCKS)),
    record(cia401.OUTPUTS, "Write output 8-bit",
           *(sub(n, f"Outputs {8 * n - 7} to {8 * n}", U8, "rw", pdo=True) for n in cia401.BLOCKS)),
    record(cia401.ERROR_MODE, "Error mode output 8-bit",
           *(sub(n, f"Error mode of outputs {8 * n - 7} to {8 * n}", U8, "rw", 0xFF) for n in cia401.BLOCKS)),
    record(cia401.ERROR_VALUE, "Error value output 8-bit",
           *(sub(n, f"Error value of outputs {8 * n - 7} to {8 * n}", U8, "rw", 0) for n in cia401.BLOCKS)),
)  # fmt: skip

FAULTS = {
    0x8120: Fault(0x11, 0, Reaction.REPORT, "CAN error passive"),
    0x8130: Fault(0x11, 0, Reaction.REPORT, "heartbeat"),
    0x8140: Fault(0x11, 0, Reaction.REPORT, "recovered from bus-off"),
    0x8210: Fault(0x11, 0, Reaction.REPORT, "PDO too short"),
    0x8220: Fault(0x11, 0, Reaction.REPORT, "PDO too long"),
}

DEVICE = Device("cia401", "CiA 401 I/O module", OBJECTS, FAULTS, Rules(objects=8, remap=Code.UNSUPPORTED_ACCESS))
