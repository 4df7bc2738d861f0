"""Faults of simulated devices and of their bus."""

from hw_bridge.fault.action import inject as inject
from hw_bridge.fault.check import problem as problem
from hw_bridge.fault.fault import LARGEST as LARGEST
from hw_bridge.fault.fault import MEANINGS as MEANINGS
from hw_bridge.fault.fault import Cause as Cause
from hw_bridge.fault.fault import Fault as Fault
