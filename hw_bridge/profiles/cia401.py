"""A generic CANopen module with digital inputs and outputs, by the device profile CiA 401; no vendor's module.

From public texts about CiA 401 and manuals of modules: 1000h, 6000h, 6200h, 6206h, 6207h, 1029h and the default PDOs.
Polarity (6202h), filter (6208h) and interrupt masks (6005h to 6008h) are optional there and left out.
"""

from __future__ import annotations

from hw_bridge.dictionary import U8, Code, cia301, cia401, record, sub
from hw_bridge.profiles.description import REPORT, Device, Rules, faults
from hw_bridge.profiles.rows import HEARTBEATS, adapted, error_field, joined, parameter_groups, process_data, standard

OUTPUT_WORDS = tuple(cia401.OUTPUTS << 16 | block << 8 | 8 for block in cia401.BLOCKS)
FIRST_ALONE = (0, cia301.INVALID, cia301.INVALID, cia301.INVALID)
READ = tuple(cia401.INPUTS << 16 | block << 8 | 8 for block in cia401.BLOCKS)

OBJECTS = joined(
    adapted(0x1000, cia401.DIGITAL_OUTPUTS | cia401.DIGITAL_INPUTS | 401),
    standard(0x1001),
    error_field(4),
    standard(0x1005),
    adapted(0x1008, "CiA 401"),
    parameter_groups(3, 3),
    HEARTBEATS,
    adapted(0x1018, (0, 401, 1, 1)),
    standard(0x1029, 0x1200),
    process_data(8, (OUTPUT_WORDS, (), (), ()), (READ, (), (), ()), FIRST_ALONE, FIRST_ALONE, inhibit=0, event=0),
    record(cia401.INPUTS, "Read input 8-bit",
           *(sub(n, f"Inputs {8 * n - 7} to {8 * n}", U8, "ro", pdo=True) for n in cia401.BLOCKS)),
    record(cia401.OUTPUTS, "Write output 8-bit",
           *(sub(n, f"Outputs {8 * n - 7} to {8 * n}", U8, "rw", pdo=True) for n in cia401.BLOCKS)),
    record(cia401.ERROR_MODE, "Error mode output 8-bit",
           *(sub(n, f"Error mode of outputs {8 * n - 7} to {8 * n}", U8, "rw", 0xFF) for n in cia401.BLOCKS)),
    record(cia401.ERROR_VALUE, "Error value output 8-bit",
           *(sub(n, f"Error value of outputs {8 * n - 7} to {8 * n}", U8, "rw", 0) for n in cia401.BLOCKS)),
)  # fmt: skip

FAULTS = faults(
    (0x8120, 0x11, REPORT, "CAN error passive"),
    (0x8130, 0x11, REPORT, "heartbeat"),
    (0x8140, 0x11, REPORT, "recovered from bus-off"),
    (0x8210, 0x11, REPORT, "PDO too short"),
    (0x8220, 0x11, REPORT, "PDO too long"),
)

DEVICE = Device("cia401", "CiA 401 I/O module", OBJECTS, FAULTS, Rules(objects=8, remap=Code.UNSUPPORTED_ACCESS))
