"""Frames and their transmission: a CAN bus in simulated time, its stations, disturbances, and observers."""

from hw_bridge.bus.bus import BIT_RATES, BUS_OFF, Bus
from hw_bridge.bus.disturbance import Disturbance, Kind, Medium
from hw_bridge.bus.event_queue import MILLISECOND, NEVER, EventQueue, Timer
from hw_bridge.bus.frame import Frame, bit_count
from hw_bridge.bus.network import Condition, CycleTimeBudget, Network, SimulatedNetwork, never
from hw_bridge.bus.observer import Listener, Observer, Override
from hw_bridge.bus.recorder import Recorder
from hw_bridge.bus.station import Device, Station, unconnected

__all__ = [
    "BIT_RATES",
    "BUS_OFF",
    "MILLISECOND",
    "NEVER",
    "Bus",
    "Condition",
    "CycleTimeBudget",
    "Device",
    "Disturbance",
    "EventQueue",
    "Frame",
    "Kind",
    "Listener",
    "Medium",
    "Network",
    "Observer",
    "Override",
    "Recorder",
    "SimulatedNetwork",
    "Station",
    "Timer",
    "bit_count",
    "never",
    "unconnected",
]
