"""Frames and what carries them: a CAN bus in simulated time, its stations, what happens to frames, who looks on."""

from hw_bridge.bus.agenda import MILLISECOND, NEVER, Agenda, Timer
from hw_bridge.bus.bus import BIT_RATES, BUS_OFF, Bus
from hw_bridge.bus.disturbance import Disturbance, Kind, Medium
from hw_bridge.bus.frame import Frame, bit_count
from hw_bridge.bus.network import Condition, Network, SimulatedNetwork, Spent, never
from hw_bridge.bus.observer import Listener, Observer, Override
from hw_bridge.bus.recorder import Recorder
from hw_bridge.bus.station import Device, Station, unconnected

__all__ = [
    "BIT_RATES",
    "BUS_OFF",
    "MILLISECOND",
    "NEVER",
    "Agenda",
    "Bus",
    "Condition",
    "Device",
    "Disturbance",
    "Frame",
    "Kind",
    "Listener",
    "Medium",
    "Network",
    "Observer",
    "Override",
    "Recorder",
    "SimulatedNetwork",
    "Spent",
    "Station",
    "Timer",
    "bit_count",
    "never",
    "unconnected",
]
