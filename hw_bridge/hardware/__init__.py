"""The hardware file: its keys, and a line for every problem."""

from hw_bridge.hardware import motor_data as motor_data
from hw_bridge.hardware import plausible as plausible
from hw_bridge.hardware import stall_bounds as stall_bounds
from hw_bridge.hardware.contradictions import gain_problem as gain_problem
from hw_bridge.hardware.events import planned as planned
from hw_bridge.hardware.file import load as load
from hw_bridge.hardware.file import overloaded as overloaded
from hw_bridge.hardware.file import resolve_bench as resolve_bench
from hw_bridge.hardware.homing_checks import homing_conflict as homing_conflict
from hw_bridge.hardware.homing_checks import search_direction as search_direction
from hw_bridge.hardware.keys import ContactKeys as ContactKeys
from hw_bridge.hardware.keys import FaultKeys as FaultKeys
from hw_bridge.hardware.keys import FollowKeys as FollowKeys
from hw_bridge.hardware.keys import HardwareKeys as HardwareKeys
from hw_bridge.hardware.keys import LateCycleKeys as LateCycleKeys
from hw_bridge.hardware.keys import LimitKeys as LimitKeys
from hw_bridge.hardware.keys import ModuleKeys as ModuleKeys
from hw_bridge.hardware.keys import NodeKeys as NodeKeys
from hw_bridge.hardware.keys import ShadowKeys as ShadowKeys
from hw_bridge.hardware.keys import UnitKeys as UnitKeys
from hw_bridge.hardware.quantities import TARGET_SHARE as TARGET_SHARE
from hw_bridge.hardware.quantities import format_quantity as format_quantity
from hw_bridge.hardware.quantities import without_unit as without_unit
