"""Live sessions: a scenario that runs paced in its own process, controlled by an operator; its log reproduces it to the bit."""

import sys
from typing import TYPE_CHECKING

import lazy_loader

from twin import CallablePackage
from twin.live.catalog import Catalog, CatalogControl, CatalogEvent, CatalogSignal
from twin.live.channel import Channel, ClosedError
from twin.live.live_session import OVER, ExecutedCommand, LiveSession
from twin.live.operator.dead_man_switch import EXPIRED, HOLD, DeadManSwitch
from twin.live.pacing import Pace, checked_rate
from twin.live.recording_reader import RecordingReader, RefusedError

if TYPE_CHECKING:
    from twin.live.catalog_builder import member_class, scene_data, start_values, targets_and_warnings

# of the process that runs a session, and of the viewer
__getattr__, _, _ = lazy_loader.attach(
    __name__, submod_attrs={"catalog_builder": ["member_class", "scene_data", "start_values", "targets_and_warnings"]}
)

__all__ = [
    "EXPIRED",
    "HOLD",
    "OVER",
    "Catalog",
    "CatalogControl",
    "CatalogEvent",
    "CatalogSignal",
    "Channel",
    "ClosedError",
    "DeadManSwitch",
    "ExecutedCommand",
    "LiveSession",
    "Pace",
    "RecordingReader",
    "RefusedError",
    "checked_rate",
    "member_class",
    "scene_data",
    "start_values",
    "targets_and_warnings",
]

sys.modules[__name__].__class__ = CallablePackage
