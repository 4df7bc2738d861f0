"""CANopen master of the bridge: drives follow the members of the co-simulation."""

from hw_bridge.master import fault_report, restoration, setup
from hw_bridge.master.acceleration import max_stoppable_speed
from hw_bridge.master.activity import active_drives
from hw_bridge.master.block_signals import block_signals
from hw_bridge.master.late_cycle_policy import LateCyclePolicy
from hw_bridge.master.master import Master
from hw_bridge.master.module import ModuleNode
from hw_bridge.master.node import Node
from hw_bridge.master.pdo_mapping import PDOS, process_data, takes_set_points
from hw_bridge.master.plan import PlannedWrite, WritePlan
from hw_bridge.master.reference import Reference
from hw_bridge.master.sdo import SdoClient, SdoError, SilentError
from hw_bridge.master.station import Station

__all__ = [
    "PDOS",
    "LateCyclePolicy",
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
    "block_signals",
    "fault_report",
    "max_stoppable_speed",
    "process_data",
    "restoration",
    "setup",
    "takes_set_points",
]
