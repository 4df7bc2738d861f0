"""Vendors' drives and modules as data: object dictionary, errors, units, traps. From public facts, no vendor's file."""

from hw_bridge.profiles import acting
from hw_bridge.profiles.catalog import (
    DEVICES,
    DRIVE_PROFILES,
    GENERIC,
    UNSUPPORTED_PRODUCTS,
    device,
    identity,
    profile,
    profile_for,
    unsupported_product,
)
from hw_bridge.profiles.cia402 import generic, units_without_object, unknown_units
from hw_bridge.profiles.description import Currents, Device, Fault, GivenUnits, Profile, Reaction, Rules, Units
from hw_bridge.profiles.motor import EFFORT, MotorModel, member_load
from hw_bridge.profiles.motors import MOTORS, MotorParameters, disagreement, magnetic_pitch, motor_parameters
from hw_bridge.profiles.quantities import KIND_OF_OBJECT, SCALING, Measure, measure, symbol

__all__ = [
    "DEVICES",
    "DRIVE_PROFILES",
    "EFFORT",
    "GENERIC",
    "KIND_OF_OBJECT",
    "MOTORS",
    "SCALING",
    "UNSUPPORTED_PRODUCTS",
    "Currents",
    "Device",
    "Fault",
    "GivenUnits",
    "Measure",
    "MotorModel",
    "MotorParameters",
    "Profile",
    "Reaction",
    "Rules",
    "Units",
    "acting",
    "device",
    "disagreement",
    "generic",
    "identity",
    "magnetic_pitch",
    "measure",
    "member_load",
    "motor_parameters",
    "profile",
    "profile_for",
    "symbol",
    "units_without_object",
    "unknown_units",
    "unsupported_product",
]
