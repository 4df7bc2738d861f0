"""Frames and their transmission: a CAN bus in simulated time, its stations, disturbances, and observers."""

from hw_bridge.bus.bus import BIT_RATES as BIT_RATES
from hw_bridge.bus.bus import BUS_OFF as BUS_OFF
from hw_bridge.bus.bus import Bus as Bus
from hw_bridge.bus.disturbance import Disturbance as Disturbance
from hw_bridge.bus.disturbance import Kind as Kind
from hw_bridge.bus.disturbance import Medium as Medium
from hw_bridge.bus.event_queue import MILLISECOND as MILLISECOND
from hw_bridge.bus.event_queue import NEVER as NEVER
from hw_bridge.bus.event_queue import EventQueue as EventQueue
from hw_bridge.bus.event_queue import Timer as Timer
from hw_bridge.bus.frame import Frame as Frame
from hw_bridge.bus.frame import bit_count as bit_count
from hw_bridge.bus.network import Condition as Condition
from hw_bridge.bus.network import CycleTimeBudget as CycleTimeBudget
from hw_bridge.bus.network import Network as Network
from hw_bridge.bus.network import SimulatedNetwork as SimulatedNetwork
from hw_bridge.bus.network import never as never
from hw_bridge.bus.observer import Listener as Listener
from hw_bridge.bus.observer import Observer as Observer
from hw_bridge.bus.observer import Override as Override
from hw_bridge.bus.recorder import Recorder as Recorder
from hw_bridge.bus.station import Device as Device
from hw_bridge.bus.station import Station as Station
from hw_bridge.bus.station import unconnected as unconnected
