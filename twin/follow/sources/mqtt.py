"""Connection to an MQTT broker."""

from __future__ import annotations

import queue
from typing import TYPE_CHECKING, Any

from twin.errors import SimulationError
from twin.installed import import_optional

if TYPE_CHECKING:
    from collections.abc import Callable

    from twin.follow.rig_keys import TopicAddress

ANSWER_TIMEOUT = 5.0  # for the broker to accept a connection [s]
KEEP_ALIVE = 5  # silence after which the client asks whether the broker is there [s]
LONGEST_PAUSE = 4  # between two attempts to connect again [s]


class MqttConnection:
    """Client of an MQTT broker. Retained messages are left out: they are older than the connection."""

    largest = (1 << 28) - 1

    def __init__(
        self,
        name: str,
        address: TopicAddress,
        report: Callable[[str], object],
        receive: Callable[[bytes], object] | None,
    ) -> None:
        mqtt = import_optional("paho.mqtt.client", "mqtt", f"{name}: mqtt")
        broker = f"{address.host}:{address.port}"
        self._client = client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
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

    def send(self, topic: str, data: bytes) -> None:
        """Send a message."""
        self._client.publish(topic, data)

    def close(self) -> None:
        """Disconnect, and end the client's thread."""
        self._client.on_disconnect = None
        self._client.disconnect()
        self._client.loop_stop()
