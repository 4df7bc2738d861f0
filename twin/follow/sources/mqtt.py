"""JSON messages over an MQTT broker: a topic that is received, and the connection with which a run is published."""

from __future__ import annotations

import queue
from typing import TYPE_CHECKING, Any

from twin.errors import SimulationError
from twin.follow.sources.inbox import drained
from twin.follow.sources.json_message import parse
from twin.follow.sources.message import Message, now
from twin.installed import import_optional

if TYPE_CHECKING:
    from collections.abc import Callable

ANSWER_TIMEOUT = 5.0  # for the broker to accept a connection [s]
KEEP_ALIVE = 5  # silence after which the client asks whether the broker is there [s]
LONGEST_PAUSE = 4  # between two attempts to connect again [s]


def connect(
    name: str,
    host: str,
    port: int,
    report: Callable[[str], object],
    topic: str = "",
    receive: Callable[[bytes], object] | None = None,
) -> Any:
    """Return a client that is connected to a broker, and connects again whenever the connection is lost.

    `report`: gets a line when it is lost, and if the topic is refused. `receive`: gets the messages of `topic`, in the
    client's thread. SimulationError if the broker is not there or refuses the connection.
    """
    mqtt = import_optional("paho.mqtt.client", "mqtt", f"{name}: mqtt")
    client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
    client.reconnect_delay_set(1, LONGEST_PAUSE)
    answers: queue.SimpleQueue[str] = queue.SimpleQueue()

    def on_connect(_client: Any, _data: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        if topic and not reason.is_failure:
            client.subscribe(topic)  # after each connection: the broker keeps no subscriptions of a lost one
        answers.put(str(reason) if reason.is_failure else "")

    def on_disconnect(_client: Any, _data: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        if reason.is_failure:
            report(f"the connection to the broker {host}:{port} is lost; trying again.")

    def on_subscribe(_client: Any, _data: Any, _id: Any, reasons: Any, _properties: Any) -> None:
        if any(reason.is_failure for reason in reasons):
            report(f"the broker {host}:{port} refuses the topic {topic} ({reasons[0]}).")

    def on_message(_client: Any, _data: Any, message: Any) -> None:
        if receive is not None and not message.retain:  # a retained message is older than the connection
            receive(message.payload)

    client.on_connect, client.on_disconnect = on_connect, on_disconnect
    client.on_subscribe, client.on_message = on_subscribe, on_message
    try:
        client.connect(host, port, KEEP_ALIVE)
        client.loop_start()
        refusal = answers.get(timeout=ANSWER_TIMEOUT)
    except queue.Empty:
        refusal = f"no answer within {ANSWER_TIMEOUT:g} s"
    except OSError as error:
        refusal = error.strerror or str(error)
    if refusal:
        close(client)
        raise SimulationError(
            f"{name}: the MQTT broker {host}:{port} cannot be used ({refusal}). Start it, or correct its address."
        )
    return client


def close(client: Any) -> None:
    """Disconnect a client, and end its thread."""
    client.on_disconnect = None
    client.disconnect()
    client.loop_stop()


class MqttSource:
    """A topic of an MQTT broker; it may have wildcards. `time_name`: of the stamp. Retained messages are left out."""

    def __init__(self, name: str, host: str, port: int, topic: str, time_name: str) -> None:
        self._messages: queue.SimpleQueue[Message] = queue.SimpleQueue()

        def report(text: str) -> None:
            self._messages.put(Message(name, now(), connection=text))

        def receive(data: bytes) -> None:
            self._messages.put(parse(name, data, now(), time_name))

        self._client = connect(name, host, port, report, topic, receive)

    def receive(self, timeout: float) -> list[Message]:
        """Return the messages that have arrived."""
        return drained(self._messages, timeout)

    def close(self) -> None:
        """Leave the broker."""
        close(self._client)


class MqttSender:
    """Sender of messages to a topic. While the broker is away messages are lost. `problems`: lines about the connection."""

    largest = (1 << 28) - 1  # size of a message [byte]

    def __init__(self, host: str, port: int, topic: str) -> None:
        self.topic = topic
        self.problems: list[str] = []
        self._client = connect("--publish", host, port, self.problems.append)

    def send(self, data: bytes) -> None:
        """Send a message."""
        self._client.publish(self.topic, data)

    def close(self) -> None:
        """Leave the broker."""
        close(self._client)
