"""Vendors' drives and modules as data: object dictionary, errors, units, traps. From public facts, no vendor's file."""

from hw_bridge.profiles.catalog import DEVICES, MODULES, REFERENCED, UNFIT, device, identity, profile
from hw_bridge.profiles.description import Currents, Device, Fault, Profile, Reaction, Rules, Units
from hw_bridge.profiles.motor import EFFORT, MotorModel, member_load

__all__ = [
    "DEVICES",
    "EFFORT",
    "MODULES",
    "REFERENCED",
    "UNFIT",
    "Currents",
    "Device",
    "Fault",
    "MotorModel",
    "Profile",
    "Reaction",
    "Rules",
    "Units",
    "device",
    "identity",
    "member_load",
    "profile",
]
