"""Keys of a rig that is followed live: its sources, how late values may be, and what happens if one of them fails."""

from __future__ import annotations

import re
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from twin import clock
from twin.scenario import Keys, Period, Text

ADDRESS = re.compile(r"(?:udp://)?(?:(?P<host>[^:/\s]*):)?(?P<port>\d{1,5})")
BROKER = re.compile(r"(?:mqtt://)?(?P<host>[^:/\s@]+)(?::(?P<port>\d{1,5}))?/(?P<topic>\S+)")
MQTT, MQTT_PORT = "mqtt://", 1883
MILLISECOND = clock.NANOSECONDS // 1000
Reaction = Literal["continue", "stop"]


def address(value: Any) -> Any:
    """Parse the address of datagrams, `4710`, `127.0.0.1:4710` or `udp://239.1.2.3:4710`: host and port."""
    if isinstance(value, tuple):
        return value
    match = ADDRESS.fullmatch(str(value).strip())
    if match is None or not 0 < int(match["port"]) < 65536:
        raise ValueError(f"expected a port such as 4710, or an address such as udp://127.0.0.1:4710, not {value}")
    return match["host"] or "127.0.0.1", int(match["port"])


def broker_topic(value: Any) -> Any:
    """Parse `mqtt://broker:1883/topic`: host, port and topic of an MQTT broker."""
    if isinstance(value, tuple):
        return value
    match = BROKER.fullmatch(str(value).strip())
    port = int(match["port"] or MQTT_PORT) if match else 0
    if match is None or not 0 < port < 65536:
        raise ValueError(f"expected a broker and a topic such as mqtt://127.0.0.1:1883/rig, not {value}")
    *levels, last = match["topic"].split("/")
    if "#" in "".join(levels) or any(set(level) & set("+#") and len(level) > 1 for level in (*levels, last)):
        raise ValueError(f"expected + as a whole level of a topic and # as its last one, not {match['topic']}")
    return match["host"], port, match["topic"]


class SourceKeys(Keys):
    """A source of measured values: `udp` (JSON datagrams to this address), `mqtt` (JSON messages of a broker's topic) or
    `hardware` (file of a CAN bus, only received).

    `time`: name of the time stamp [s] in a message. `clock`: `own`, whose offset and drift are estimated, `shared` with the first
    source, or `arrival`, if stamps are missing or useless. `lost_after`: silence after which the source counts as lost.
    """

    udp: Annotated[tuple[str, int] | None, BeforeValidator(address)] = None
    mqtt: Annotated[tuple[str, int, str] | None, BeforeValidator(broker_topic)] = None
    hardware: Text = ""
    time: Text = "time"
    clock: Literal["own", "shared", "arrival"] = "own"
    lost_after: Period = 1000 * MILLISECOND

    @model_validator(mode="after")
    def check_kind(self) -> SourceKeys:
        """Refuse a source of no kind, or of two."""
        if [self.udp is not None, self.mqtt is not None, bool(self.hardware)].count(True) != 1:
            raise ValueError(
                "expected one of udp, such as udp: 4710, mqtt, such as mqtt: 127.0.0.1/rig, and hardware, such as hardware: bench.yaml"
            )
        return self


class RigKeys(Keys):
    """A rig. The first of its sources has the clock that the model follows.

    `wait`: how long a step waits for a source before inputs are held. `max_delay`: age up to which a measurement is still used.
    `on_loss`, `on_jump`, `on_bad`: what happens if a source is lost, a clock jumps, or a value cannot be used.
    """

    sources: dict[Text, SourceKeys] = Field(default_factory=dict, min_length=1)
    wait: Period = 20 * MILLISECOND
    max_delay: Period = 500 * MILLISECOND
    on_loss: Reaction = "continue"
    on_jump: Reaction = "continue"
    on_bad: Reaction = "continue"


def with_sources(value: Any) -> Any:
    """A rig, also if only the address of its messages is given."""
    if not isinstance(value, str | int):
        return value
    source = {"mqtt": broker_topic(value)} if str(value).startswith(MQTT) else {"udp": address(value)}
    return {"sources": {"rig": source}}
