"""A scenario that runs paced and in somebody's hands, in a process of its own; what was done runs again to the bit."""

from twin.live.catalog import Catalog, Control, Event, Signal
from twin.live.channel import Channel, ClosedError
from twin.live.dead_man_switch import HOLD, DeadMan
from twin.live.live_session import Done, Live, State
from twin.live.recording_reader import RefusedError, Samples

__all__ = [
    "HOLD",
    "Catalog",
    "Channel",
    "ClosedError",
    "Control",
    "DeadMan",
    "Done",
    "Event",
    "Live",
    "RefusedError",
    "Samples",
    "Signal",
    "State",
]
