"""Live sessions: a scenario that runs paced in its own process, controlled by an operator; its log reproduces it to the bit."""

from twin.live.catalog import Catalog, CatalogControl, CatalogEvent, CatalogSignal
from twin.live.channel import Channel, ClosedError
from twin.live.live_session import ExecutedCommand, LiveSession, SessionState
from twin.live.operator.dead_man_switch import HOLD, DeadManSwitch
from twin.live.recording_reader import RecordingReader, RefusedError, Samples

__all__ = [
    "HOLD",
    "Catalog",
    "CatalogControl",
    "CatalogEvent",
    "CatalogSignal",
    "Channel",
    "ClosedError",
    "DeadManSwitch",
    "ExecutedCommand",
    "LiveSession",
    "RecordingReader",
    "RefusedError",
    "Samples",
    "SessionState",
]
