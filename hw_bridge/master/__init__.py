"""The master side of the bus: what makes a drive do what a member of the co-simulation says."""

from hw_bridge.master import restoration, setup, words
from hw_bridge.master.master import Master
from hw_bridge.master.module import ModuleNode
from hw_bridge.master.node import Node, constant_of
from hw_bridge.master.plan import PlannedWrite, WritePlan
from hw_bridge.master.sdo import SdoClient, SdoError, SilentError
from hw_bridge.master.station import Station
from hw_bridge.master.vendor import SPEED, TRANSMIT, VENDORS, receive

__all__ = [
    "SPEED",
    "TRANSMIT",
    "VENDORS",
    "Master",
    "ModuleNode",
    "Node",
    "PlannedWrite",
    "SdoClient",
    "SdoError",
    "SilentError",
    "Station",
    "WritePlan",
    "constant_of",
    "receive",
    "restoration",
    "setup",
    "words",
]
