"""Simulated devices, built from a profile: a CANopen slave, a drive with its motor, an I/O module."""

from hw_bridge.device.axis import Switches
from hw_bridge.device.drive import Drive
from hw_bridge.device.module import Module
from hw_bridge.device.motor import Motor, uneven
from hw_bridge.device.slave import Slave
from hw_bridge.device.store import Store

__all__ = [
    "Drive",
    "Module",
    "Motor",
    "Slave",
    "Store",
    "Switches",
    "uneven",
]
