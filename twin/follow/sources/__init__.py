"""Sources of measured values: JSON datagrams, topics of a broker or router, CAN buses of hardware files. They are only received."""

from __future__ import annotations

from typing import TYPE_CHECKING

from twin.follow.sources.inbox import Inbox
from twin.follow.sources.message import Message, Source, now

if TYPE_CHECKING:
    from pathlib import Path

    from twin.follow.rig_keys import SourceKeys

__all__ = ["Inbox", "Message", "now", "open_source"]


def open_source(name: str, keys: SourceKeys, folder: Path) -> Source:
    """Open a source; SimulationError if it cannot be opened. `folder`: of the file that names it."""
    if keys.udp is not None:
        from twin.follow.sources.udp import UdpSource

        return UdpSource(name, *keys.udp, keys.time)
    if (topic := keys.mqtt or keys.zenoh) is not None:
        from twin.follow.sources.topics import TopicSource

        return TopicSource(name, topic, keys.time)
    from twin.follow.sources.bus import BusSource

    return BusSource(name, folder / keys.hardware)
