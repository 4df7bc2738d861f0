"""JSON messages of a topic, over an MQTT broker or a Zenoh router: a source that receives them, and connections that send."""

from __future__ import annotations

import json
import queue
from collections.abc import Callable
from typing import Any, Protocol

from twin.errors import SimulationError
from twin.follow.schema import TopicAddress
from twin.follow.sources.messages import Message, drained, now, parse
from twin.installed import import_optional

Report = Callable[[str], object]
Receive = Callable[[bytes], object] | None
ANSWER_TIMEOUT = 5.0  # for the broker to accept a connection [s]
KEEP_ALIVE = 5  # silence after which the client asks whether the broker is there [s]
LONGEST_PAUSE = 4  # between two attempts to connect again [s]


class Sender(Protocol):
    """Sender of messages up to a size of `largest` [byte]."""

    largest: int

    def send(self, data: bytes) -> None:
        """Send a message; SimulationError if that is impossible. It is lost while a connection is."""

    def close(self) -> None:
        """End it."""


def connect(name: str, address: TopicAddress, report: Report, receive: Receive = None) -> Sender:
    """Connect to the broker or router of an address; SimulationError if that is impossible. A lost connection is made anew.

    `report`: gets a line when the connection is lost, and if the topic is refused. `receive`: gets the messages of the topic,
    in the thread of the connection.
    """
    return (MqttConnection if address.scheme == "mqtt" else ZenohConnection)(name, address, report, receive)


class TopicSource:
    """A topic; it may have wildcards. `time_name`: of the stamp."""

    def __init__(self, name: str, address: TopicAddress, time_name: str) -> None:
        self._messages: queue.SimpleQueue[Message] = queue.SimpleQueue()
        self._connection = connect(
            name,
            address,
            lambda text: self._messages.put(Message(name, now(), connection=text)),
            lambda data: self._messages.put(parse(name, data, now(), time_name)),
        )

    def receive(self, timeout: float) -> list[Message]:
        """Return the messages that have arrived."""
        return drained(self._messages, timeout)

    def close(self) -> None:
        """Leave the broker or router."""
        self._connection.close()


class MqttConnection:
    """Client of an MQTT broker. Retained messages are left out: they are older than the connection."""

    largest = (1 << 28) - 1

    def __init__(self, name: str, address: TopicAddress, report: Report, receive: Receive) -> None:
        mqtt = import_optional("paho.mqtt.client", "mqtt", f"{name}: mqtt")
        broker = f"{address.host}:{address.port}"
        self._topic, self._client = address.topic, mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
        client = self._client
        client.reconnect_delay_set(1, LONGEST_PAUSE)
        answers: queue.SimpleQueue[str] = queue.SimpleQueue()

        def on_connect(_client: Any, _data: Any, _flags: Any, reason: Any, _properties: Any) -> None:
            if receive is not None and not reason.is_failure:
                client.subscribe(
                    address.topic
                )  # after each connection: the broker keeps no subscriptions of a lost one
            answers.put(str(reason) if reason.is_failure else "")

        def on_disconnect(_client: Any, _data: Any, _flags: Any, reason: Any, _properties: Any) -> None:
            if reason.is_failure:
                report(f"the connection to the broker {broker} is lost; trying again.")

        def on_subscribe(_client: Any, _data: Any, _id: Any, reasons: Any, _properties: Any) -> None:
            if any(reason.is_failure for reason in reasons):
                report(f"the broker {broker} refuses the topic {address.topic} ({reasons[0]}).")

        def on_message(_client: Any, _data: Any, message: Any) -> None:
            if receive is not None and not message.retain:
                receive(message.payload)

        client.on_connect, client.on_disconnect = on_connect, on_disconnect
        client.on_subscribe, client.on_message = on_subscribe, on_message
        try:
            client.connect(address.host, address.port, KEEP_ALIVE)
            client.loop_start()
            refusal = answers.get(timeout=ANSWER_TIMEOUT)
        except queue.Empty:
            refusal = f"no answer within {ANSWER_TIMEOUT:g} s"
        except OSError as error:
            refusal = error.strerror or str(error)
        if refusal:
            self.close()
            raise SimulationError(
                f"{name}: the MQTT broker {broker} cannot be used ({refusal}). Start it, or correct its address."
            )

    def send(self, data: bytes) -> None:
        """Send a message."""
        self._client.publish(self._topic, data)

    def close(self) -> None:
        """Disconnect, and end the client's thread."""
        self._client.on_disconnect = None
        self._client.disconnect()
        self._client.loop_stop()


class ZenohConnection:
    """Client of a Zenoh router, or of one peer; it looks for no others."""

    largest = 1 << 28

    def __init__(self, name: str, address: TopicAddress, report: Report, receive: Receive) -> None:
        zenoh = import_optional("zenoh", "zenoh", f"{name}: zenoh")
        router = f"{address.host}:{address.port}"
        config = zenoh.Config()
        for key, value in (
            ("mode", "client"),
            ("connect/endpoints", [f"tcp/{router}"]),
            ("scouting/multicast/enabled", False),
        ):
            config.insert_json5(key, json.dumps(value))

        def on_transport(event: Any) -> None:
            if event.kind == zenoh.SampleKind.DELETE:
                report(f"the connection to the router {router} is lost; trying again.")

        try:
            self._topic = zenoh.KeyExpr(address.topic)
            self._session = zenoh.open(config)
        except zenoh.ZError as error:
            reason = str(error).partition(" at /")[0].rstrip(" !.")  # then comes a place in its own source
            raise SimulationError(
                f"{name}: the Zenoh router {router} cannot be used ({reason}). Start it, or correct its address."
            ) from None
        self._listener = self._session.info.declare_transport_events_listener(on_transport, history=False)
        if receive is not None:
            self._session.declare_subscriber(self._topic, lambda sample: receive(sample.payload.to_bytes()))

    def send(self, data: bytes) -> None:
        """Send a message."""
        self._session.put(self._topic, data)

    def close(self) -> None:
        """Leave the router, without a report of that."""
        self._listener.undeclare()
        self._session.close()
