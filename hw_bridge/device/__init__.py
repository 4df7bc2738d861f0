"""Simulated devices, built from a profile: a CANopen slave, a drive with its motor, an I/O module."""

from hw_bridge.device.axis import Switches as Switches
from hw_bridge.device.drive import Drive as Drive
from hw_bridge.device.module import Module as Module
from hw_bridge.device.motor import Motor as Motor
from hw_bridge.device.motor import uneven as uneven
from hw_bridge.device.slave import Slave as Slave
from hw_bridge.device.store import Store as Store
