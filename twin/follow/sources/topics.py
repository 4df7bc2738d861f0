"""JSON messages of a topic, over an MQTT broker or a Zenoh router: a source that receives them, and a sender."""

from __future__ import annotations

import queue
from typing import TYPE_CHECKING, Protocol

from twin.follow.sources.inbox import drained
from twin.follow.sources.json_message import parse
from twin.follow.sources.message import Message, now

if TYPE_CHECKING:
    from collections.abc import Callable

    from twin.follow.rig_keys import TopicAddress


class Connection(Protocol):
    """Connection to a broker or router, which is made anew whenever it is lost."""

    largest: int  # size of a message [byte]

    def send(self, topic: str, data: bytes) -> None:
        """Send a message; it is lost while the connection is."""

    def close(self) -> None:
        """End it."""


def connect(
    name: str,
    address: TopicAddress,
    report: Callable[[str], object],
    receive: Callable[[bytes], object] | None = None,
) -> Connection:
    """Connect to the broker or router of an address; SimulationError if that is impossible.

    `report`: gets a line when the connection is lost, and if the topic is refused. `receive`: gets the messages of the topic,
    in the thread of the connection.
    """
    if address.scheme == "mqtt":
        from twin.follow.sources.mqtt import MqttConnection

        return MqttConnection(name, address, report, receive)
    from twin.follow.sources.zenoh import ZenohConnection

    return ZenohConnection(name, address, report, receive)


class TopicSource:
    """A topic; it may have wildcards. `time_name`: of the stamp."""

    def __init__(self, name: str, address: TopicAddress, time_name: str) -> None:
        self._messages: queue.SimpleQueue[Message] = queue.SimpleQueue()

        def report(text: str) -> None:
            self._messages.put(Message(name, now(), connection=text))

        def receive(data: bytes) -> None:
            self._messages.put(parse(name, data, now(), time_name))

        self._connection = connect(name, address, report, receive)

    def receive(self, timeout: float) -> list[Message]:
        """Return the messages that have arrived."""
        return drained(self._messages, timeout)

    def close(self) -> None:
        """Leave the broker or router."""
        self._connection.close()


class TopicSender:
    """Sender of messages to a topic. While the connection is lost messages are lost. `problems`: lines about it."""

    def __init__(self, address: TopicAddress) -> None:
        self.problems: list[str] = []
        self._topic = address.topic
        self._connection = connect("--publish", address, self.problems.append)
        self.largest = self._connection.largest

    def send(self, data: bytes) -> None:
        """Send a message."""
        self._connection.send(self._topic, data)

    def close(self) -> None:
        """Leave the broker or router."""
        self._connection.close()
