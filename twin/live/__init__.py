"""Live sessions: a scenario that runs paced, controlled by an operator, in a process of its own; its log reproduces it bit for bit."""

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
