"""Sources of measured values: JSON datagrams, topics of a broker or router, CAN buses of hardware files. They are only received."""

from __future__ import annotations

from typing import TYPE_CHECKING

from twin.follow.sources.bus import BusSource
from twin.follow.sources.messages import Inbox, Message, Source, now
from twin.follow.sources.topics import TopicSource
from twin.follow.sources.udp import UdpSource

if TYPE_CHECKING:
    from twin.follow.schema import SourceKeys

__all__ = ["Inbox", "Message", "now", "open_source"]


def open_source(name: str, keys: SourceKeys) -> Source:
    """Open a source; SimulationError if it cannot be opened."""
    if keys.udp is not None:
        return UdpSource(name, *keys.udp, keys.time)
    if (topic := keys.mqtt or keys.zenoh) is not None:
        return TopicSource(name, topic, keys.time)
    return BusSource(name, keys.hardware)
