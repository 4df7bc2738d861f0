"""Objects that act at once when they are written: motion, and outputs.

Vendors' objects that a profile does not have are included: their effect is unknown.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from hw_bridge.dictionary import cia401, cia402
from hw_bridge.profiles.catalog import DRIVE_PROFILES, profile

if TYPE_CHECKING:
    from hw_bridge.profiles.description import Device

# of every device; each has a command of its own: enable, jog, move, home, store, defaults, lss
COMMANDS = frozenset({0x1010, 0x1011, 0x6040, 0x6060, 0x6071, 0x607A, 0x60FF, *cia402.OFFSETS})
OUTPUTS = frozenset({cia402.OUTPUTS, cia401.OUTPUTS, 0x6202, 0x6300, 0x6411})  # valves, brakes
VENDORS_OWN = range(0x2000, 0x6000)


def commands(device: Device) -> frozenset[int]:
    """Objects that move a motor, or have a command of their own."""
    return COMMANDS | device.commands


@cache
def all_commands() -> frozenset[int]:
    """Such objects of any profile: a node may be another device than it is taken for."""
    return COMMANDS.union(*(profile(name).commands for name in DRIVE_PROFILES))


def switches(device: Device, index: int, is_in_profile: bool) -> bool:
    """Whether writing an object may switch an output at once. `is_in_profile`: the profile has it."""
    return index in OUTPUTS | device.output_objects or (index in VENDORS_OWN and not is_in_profile)
