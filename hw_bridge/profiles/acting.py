"""Objects that act at once when they are written: motion, and outputs.

Vendors' objects that a profile does not describe are included, also those that an EDS file adds: their effect is unknown.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from hw_bridge.dictionary import cia401, cia402
from hw_bridge.profiles.catalog import DEVICES, DRIVE_PROFILES, device, profile

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


def sets_output(described: Device, index: int) -> bool:
    """Whether writing an object of CiA or of the profile sets an output."""
    return index in OUTPUTS | described.output_objects


def is_described(described: Device, index: int, sub: int) -> bool:
    """Whether the effect of an object is known: CiA defines it, or the profile itself has it, whatever an EDS file adds."""
    return index not in VENDORS_OWN or (index, sub) in _own_objects(described.name)


def switches(described: Device, index: int, sub: int) -> bool:
    """Whether writing an object may switch an output at once."""
    return sets_output(described, index) or not is_described(described, index, sub)


@cache
def _own_objects(name: str) -> frozenset[tuple[int, int]]:
    """Objects of a profile without an EDS file; none of a generic one."""
    if name not in {**DRIVE_PROFILES, **DEVICES}:
        return frozenset()
    described: Device = profile(name) if name in DRIVE_PROFILES else device(name)
    return frozenset((entry.index, entry.sub) for entry in described.objects)
