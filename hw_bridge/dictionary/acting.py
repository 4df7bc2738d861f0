"""Objects that act at once when they are written, by profile: motion, and outputs.

Vendors' objects that a profile does not have are included: their effect is unknown.
"""

from __future__ import annotations

from hw_bridge.dictionary import cia401, cia402

COMMON = ""  # of every profile
# each has a command of its own: enable, jog, move, home, store, defaults, lss
COMMANDS: dict[str, frozenset[int]] = {
    COMMON: frozenset({0x1010, 0x1011, 0x6040, 0x6060, 0x6071, 0x607A, 0x60FF, *cia402.OFFSETS}),
    "faulhaber_v3": frozenset({0x2400}),  # bit rate
    "mclm": frozenset({0x2400, 0x257A}),  # bit rate; target position in increments
    "epos4": frozenset({0x2001, 0x31E4}),  # bit rate; recorder control
    "epos2": frozenset({0x2000, 0x2001, 0x2030, 0x2062, 0x206B, 0x20C1}),  # node-ID, bit rate; targets of its own modes
}
# valves, brakes, fault pins
OUTPUTS: dict[str, frozenset[int]] = {
    COMMON: frozenset({cia402.OUTPUTS, cia401.OUTPUTS, 0x6202, 0x6300, 0x6411}),
    "faulhaber_v3": frozenset({0x2311, 0x2315}),  # digital outputs, function of the fault pin; recalled
    "mclm": frozenset({0x2315}),  # function of the fault pin
    "epos2": frozenset({0x2078, 0x2079}),  # state and function of outputs
    "epos4": frozenset({0x3150, 0x3151}),  # polarity and function of outputs, also the one of a brake
}
VENDORS_OWN = range(0x2000, 0x6000)


def commands(profile: str) -> frozenset[int]:
    """Objects that move a motor, or have a command of their own."""
    return COMMANDS[COMMON] | COMMANDS.get(profile, frozenset())


def switches(profile: str, index: int, is_in_profile: bool) -> bool:
    """Whether writing an object may switch an output at once. `is_in_profile`: the profile has it."""
    return index in OUTPUTS[COMMON] | OUTPUTS.get(profile, frozenset()) or (index in VENDORS_OWN and not is_in_profile)
