"""The master side of the bus: what makes a drive do what a member of the co-simulation says."""

from hw_bridge.master import restoration, setup, words
from hw_bridge.master.acceleration import stoppable
from hw_bridge.master.activity import active_drives
from hw_bridge.master.homing import refusal
from hw_bridge.master.master import OLDEST, Master
from hw_bridge.master.module import ModuleNode
from hw_bridge.master.node import Node, constant_of
from hw_bridge.master.plan import PlannedWrite, WritePlan
from hw_bridge.master.reference import Reference
from hw_bridge.master.sdo import SdoClient, SdoError, SilentError
from hw_bridge.master.station import Station
from hw_bridge.master.vendor import PDOS, VENDORS, process_data, takes_set_points

__all__ = [
    "OLDEST",
    "PDOS",
    "VENDORS",
    "Master",
    "ModuleNode",
    "Node",
    "PlannedWrite",
    "Reference",
    "SdoClient",
    "SdoError",
    "SilentError",
    "Station",
    "WritePlan",
    "active_drives",
    "constant_of",
    "process_data",
    "refusal",
    "restoration",
    "setup",
    "stoppable",
    "takes_set_points",
    "words",
]
