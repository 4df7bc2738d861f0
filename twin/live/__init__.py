"""Live sessions: a scenario that runs paced in its own process, controlled by an operator; its log reproduces it to the bit."""

from twin.live.catalog import Catalog, Control, Event, Signal
from twin.live.channel import Channel, ClosedError
from twin.live.dead_man_switch import HOLD, DeadManSwitch
from twin.live.live_session import ExecutedCommand, LiveSession, SessionState
from twin.live.recording_reader import RecordingReader, RefusedError, Samples

__all__ = [
    "HOLD",
    "Catalog",
    "Channel",
    "ClosedError",
    "Control",
    "DeadManSwitch",
    "Event",
    "ExecutedCommand",
    "LiveSession",
    "RecordingReader",
    "RefusedError",
    "Samples",
    "SessionState",
    "Signal",
]
