"""Connection to a Zenoh router."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from twin.errors import SimulationError
from twin.installed import import_optional

if TYPE_CHECKING:
    from collections.abc import Callable

    from twin.follow.rig_keys import TopicAddress


class ZenohConnection:
    """Client of a Zenoh router, or of one peer; it looks for no others."""

    largest = 1 << 28

    def __init__(
        self,
        name: str,
        address: TopicAddress,
        report: Callable[[str], object],
        receive: Callable[[bytes], object] | None,
    ) -> None:
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
            topic = zenoh.KeyExpr(address.topic)
            self._session = zenoh.open(config)
        except zenoh.ZError as error:
            reason = str(error).partition(" at /")[0].rstrip(" !.")  # then comes a place in its own source
            raise SimulationError(
                f"{name}: the Zenoh router {router} cannot be used ({reason}). Start it, or correct its address."
            ) from None
        self._listener = self._session.info.declare_transport_events_listener(on_transport, history=False)
        if receive is not None:
            self._session.declare_subscriber(topic, lambda sample: receive(sample.payload.to_bytes()))

    def send(self, topic: str, data: bytes) -> None:
        """Send a message."""
        self._session.put(topic, data)

    def close(self) -> None:
        """Leave the router, without a report of that."""
        self._listener.undeclare()
        self._session.close()
