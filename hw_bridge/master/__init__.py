"""CANopen master of the bridge: drives follow the members of the co-simulation."""

from hw_bridge.master import fault_report as fault_report
from hw_bridge.master import restoration as restoration
from hw_bridge.master import setup as setup
from hw_bridge.master.acceleration import max_stoppable_speed as max_stoppable_speed
from hw_bridge.master.activity import active_drives as active_drives
from hw_bridge.master.block_signals import block_signals as block_signals
from hw_bridge.master.foreign_master import ForeignMasterMonitor as ForeignMasterMonitor
from hw_bridge.master.late_cycle_policy import LateCyclePolicy as LateCyclePolicy
from hw_bridge.master.limits import HOMING_FORCE_SHARE as HOMING_FORCE_SHARE
from hw_bridge.master.master import Master as Master
from hw_bridge.master.module import ModuleNode as ModuleNode
from hw_bridge.master.node import Node as Node
from hw_bridge.master.pdo_mapping import PDOS as PDOS
from hw_bridge.master.pdo_mapping import process_data as process_data
from hw_bridge.master.pdo_mapping import takes_set_points as takes_set_points
from hw_bridge.master.plan import PlannedWrite as PlannedWrite
from hw_bridge.master.plan import WritePlan as WritePlan
from hw_bridge.master.reference import Reference as Reference
from hw_bridge.master.sdo import SdoClient as SdoClient
from hw_bridge.master.sdo import SdoError as SdoError
from hw_bridge.master.sdo import SilentError as SilentError
from hw_bridge.master.station import Station as Station
