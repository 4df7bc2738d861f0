"""Vendors' drives as tables: object dictionary, errors, traps. Written from public facts, no vendor's file."""

from __future__ import annotations

import importlib
import inspect
from pathlib import Path
from typing import NamedTuple

from hw_bridge.dictionary import Dictionary, Mode
from hw_bridge.profiles.description import Device, Profile
from hw_bridge.profiles.motors import MOTORS
from twin.errors import DeclarationError, nearest

DRIVE_PROFILES = {
    "faulhaber_v3": "FAULHABER Motion Control V3.0 (MC 5005 and relatives) with a linear motor LM 2070",
    "mclm": "FAULHABER MCLM 300x, Motion Control V2, with a linear motor LM 2070",
    "epos4": "maxon EPOS4 with an EC-i 40",
    "epos2": "maxon EPOS2 in profile position and profile velocity, with an EC-i 40",
}

GENERIC = {"cia402": "any drive of CiA 402, by its EDS file"}

DEVICES = {"cia401": "a generic I/O module with digital inputs and outputs (CiA 401)"}

BENCHES = Path(__file__).parents[1] / "benches"
MODE_NAMES = {
    Mode.PP: "profile position",
    Mode.PV: "profile velocity",
    Mode.HM: "homing",
    Mode.CSP: "cyclic synchronous position",
    Mode.CSV: "cyclic synchronous velocity",
    Mode.CST: "cyclic synchronous torque",
}


class UnsupportedProduct(NamedTuple):
    """A product that no profile supports. `device_type`: 1000h, where others have the same product code; 0: any."""

    vendor: int
    product: int
    device_type: int
    title: str
    advice: str


UNSUPPORTED_PRODUCTS = (
    UnsupportedProduct(
        0xFB, 0x68500000, 0, "maxon EPOS4 Micro 24/5", "It has another dictionary than an EPOS4. Use another drive."
    ),
    UnsupportedProduct(
        327,
        3150,
        0x00020192,
        "FAULHABER MCLM 300x CF",
        "Its process data are fixed (targets only as the vendor's own commands, 2301h), it watches no heartbeat (no 1016h) and "
        "tells no current (no 6077h, 6078h): nothing would stop it when this program dies, and no force could be watched. An MCLM "
        "300x CO (1000h 00420192h) or a Motion Control V3.0 works.",
    ),
)


def listed() -> dict[str, str]:
    """Profiles for `twin list`."""
    return {**DRIVE_PROFILES, **GENERIC, **DEVICES}


def describe(name: str) -> list[str]:
    """Lines of `twin describe`: what the profile is from and its traps, modes, motor, units, and the nodes of a hardware file."""
    module = importlib.import_module(f"hw_bridge.profiles.{name}")
    lines = " ".join(inspect.cleandoc(module.__doc__ or "").splitlines()).split("  ")[:2]
    if name in DRIVE_PROFILES:
        drive = profile(name)
        own = identity(name)
        kinds = ("position", "velocity", "acceleration")
        units = drive.units(Dictionary(drive.objects, 1), MOTORS[drive.motor_name].pitch or None)
        symbols = [f"{drive.motor.unit}{end}" for end in ("", "/s", "/s^2")]
        sizes = [f"{kind} {getattr(units, kind):.4g} {symbol}" for kind, symbol in zip(kinds, symbols, strict=True)]
        lines += [
            f"Identity (1018h): vendor {own[1]:X}h, product {own[2]:X}h, revision {own[3]:X}h",
            f"Modes of operation: {', '.join(MODE_NAMES[mode] for mode in drive.modes)}",
            f"Motor: {MOTORS[drive.motor_name].title}; `motor` of the hardware file names another: {', '.join(MOTORS)}",
            f"One device unit, with the drive's defaults: {', '.join(sizes)}",
            *[f"The hardware file has to give the units of {' and '.join(drive.unstated_units)}."]
            * bool(drive.unstated_units),
        ]
    files = [
        path for path in sorted(BENCHES.glob("*.yaml")) if f"profile: {name}\n" in path.read_text(encoding="utf-8")
    ]
    if files:
        text = files[0].read_text(encoding="utf-8")
        lines += [f"A hardware file with it, {files[0].name}:"]
        lines += [f"  {line}" for line in text[text.index("nodes:") :].splitlines()]
    return lines


def unsupported_product(vendor: int, product: int, device_type: int) -> UnsupportedProduct | None:
    """The unsupported product of this identity, or None."""
    matches = (row for row in UNSUPPORTED_PRODUCTS if (row.vendor, row.product) == (vendor, product))
    return next((item for item in matches if item.device_type in (0, device_type)), None)


def profile_for(vendor: int, product: int) -> str:
    """Name of the profile of exactly this product, or empty."""
    return next((name for name in DRIVE_PROFILES if (vendor, product) in _products(name)), "")


def _products(name: str) -> tuple[tuple[int, int], ...]:
    own = identity(name)
    return ((own[1], own[2]), *profile(name).related)


def device(name: str) -> Device:
    """The device of this name that is no drive."""
    description: Device = importlib.import_module(f"hw_bridge.profiles.{name}").DEVICE
    return description


def profile(name: str) -> Profile:
    """The profile of this name."""
    if name not in DRIVE_PROFILES:
        raise DeclarationError(f"There is no drive profile {name!r}. {nearest(name, list(DRIVE_PROFILES))}")
    description: Profile = importlib.import_module(f"hw_bridge.profiles.{name}").PROFILE
    return description


def identity(name: str) -> dict[int, int]:
    """1018h of a profile: vendor, product code, revision, serial number by subindex."""
    return {entry.sub: int(entry.default) for entry in profile(name).objects if entry.index == 0x1018}
