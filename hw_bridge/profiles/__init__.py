"""Vendors' drives and modules as data: object dictionary, errors, units, traps. From public facts, no vendor's file."""

from hw_bridge.profiles.catalog import (
    DEVICES,
    GENERIC,
    MODULES,
    REFERENCED,
    UNFIT,
    device,
    identity,
    profile,
    profile_for,
    unfit,
)
from hw_bridge.profiles.cia402 import GivenUnits, generic, units_without_object, unknown_units
from hw_bridge.profiles.description import Currents, Device, Fault, Profile, Reaction, Rules, Units
from hw_bridge.profiles.motor import EFFORT, MotorModel, member_load
from hw_bridge.profiles.motors import MOTORS, MotorParameters, disagreement, magnetic_pitch, motor_parameters

__all__ = [
    "DEVICES",
    "EFFORT",
    "GENERIC",
    "MODULES",
    "MOTORS",
    "REFERENCED",
    "UNFIT",
    "Currents",
    "Device",
    "Fault",
    "GivenUnits",
    "MotorModel",
    "MotorParameters",
    "Profile",
    "Reaction",
    "Rules",
    "Units",
    "device",
    "disagreement",
    "generic",
    "identity",
    "magnetic_pitch",
    "member_load",
    "motor_parameters",
    "profile",
    "profile_for",
    "unfit",
    "units_without_object",
    "unknown_units",
]
