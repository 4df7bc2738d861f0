"""Vendors' drives as tables: object dictionary, errors, traps. Written from public facts, no vendor's file."""

from __future__ import annotations

import importlib

from hw_bridge.profiles.description import Device, Profile
from twin.errors import DeclarationError, nearest

MODULES = {
    "faulhaber_v3": "FAULHABER Motion Control V3.0 (MC 5005 and relatives) with a linear motor LM 2070",
    "mclm":         "FAULHABER MCLM 300x, Motion Control V2, with a linear motor LM 2070",
    "epos4":        "maxon EPOS4 with an EC-i 40",
}  # fmt: skip

DEVICES = {"cia401": "a generic I/O module with digital inputs and outputs (CiA 401)"}

# devices of these vendors that no profile fits, by vendor and product code
UNFIT = {(0xFB, 0x68500000): "maxon EPOS4 Micro 24/5"}

# bit of the statusword, by profile, that tells whether positions count from a reference since power-on; recalled
REFERENCED = {"epos4": 15}


def listed() -> dict[str, str]:
    """What there is, for `twin list`."""
    return {**MODULES, **DEVICES}


def device(name: str) -> Device:
    """The device of this name that is no drive."""
    found: Device = importlib.import_module(f"hw_bridge.profiles.{name}").DEVICE
    return found


def profile(name: str) -> Profile:
    """The profile of this name."""
    if name not in MODULES:
        raise DeclarationError(f"There is no drive profile {name!r}. {nearest(name, list(MODULES))}")
    found: Profile = importlib.import_module(f"hw_bridge.profiles.{name}").PROFILE
    return found


def identity(name: str) -> dict[int, int]:
    """1018h of a profile: vendor, product code, revision, serial number by subindex."""
    return {one.sub: int(one.default) for one in profile(name).objects if one.index == 0x1018}
