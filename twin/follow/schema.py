"""Keys of a follow file: those of an identify file for model and recording, what is estimated by which method, and the rig.

The keys of a rig that is followed live are its sources, how late values may be, and what happens if one of them fails.
"""

from __future__ import annotations

import re
from functools import partial
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import BeforeValidator, Field, model_validator

from twin import clock
from twin.identify import IdentifyKeys, shorthand
from twin.scenario import Keys, Period, Seed, Text, Value

ADDRESS = re.compile(r"(?:udp://)?(?:(?P<host>[^:/\s]*):)?(?P<port>\d{1,5})")
TOPIC = re.compile(r"(?P<host>[^:/\s@]+)(?::(?P<port>\d{1,5}))?/(?P<topic>\S+)")
PORTS = {"mqtt": 1883, "zenoh": 7447}  # of brokers and routers, by scheme
MILLISECOND = clock.NANOSECONDS // 1000
Reaction = Literal["continue", "stop"]


class EstimateKeys(Keys):
    """An estimated state or tunable parameter.

    `start`: first estimate, by default the model's value; `deviation`: its standard deviation. `walk`: standard deviation
    of the change in one second (random walk). `from`, `to`: bounds.
    """

    start: Value | None = None
    deviation: Value
    walk: Value = 0.0
    low: Value | None = Field(None, alias="from")
    high: Value | None = Field(None, alias="to")


class MethodKeys(Keys):
    """The filter: `unscented`, `extended`, or `ensemble` with its `size` and random `seed`."""

    name: Literal["unscented", "extended", "ensemble"] = "unscented"
    size: Annotated[int, Field(ge=2, le=10_000)] = 50
    seed: Seed = 0


class ChangeKeys(Keys):
    """A change to look for. `set`: variable -> amount: `x1.5`, `+5 mN`, a new value, or a list of these; `rate`: changes per hour."""

    set: dict[Text, Value | list[Value]] = Field(default_factory=dict)
    rate: Annotated[float, Field(gt=0)] = 0.1


class ForecastKeys(Keys):
    """Forecasts. `every`: interval of forecasts; `interval`: of the points in one; `limits`: signal -> lower and upper one.

    `planned`: inputs of which the future is known; all others are held. `calibrate`: how long errors of past forecasts of measured signals
    widen or narrow the bands, so that they hold 90 % of the measured values.
    """

    horizon: Period = 0
    every: Period | None = None
    interval: Period | None = None
    signals: list[Text] = Field(default_factory=list)
    limits: dict[Text, tuple[Value, Value]] = Field(default_factory=dict)
    planned: list[Text] = Field(default_factory=list)
    draws: Annotated[int, Field(ge=10, le=10_000)] = 50
    seed: Seed = 0
    calibrate: Period | None = None


class FollowKeys(IdentifyKeys):
    """A follow file. `rig`: what is followed live, instead of the recording `data`; `smooth`: lag of the smoothed estimates."""

    estimate: dict[Text, EstimateKeys] = Field(default_factory=dict)
    changes: dict[Text, ChangeKeys] = Field(default_factory=dict)
    forecast: ForecastKeys | None = None
    smooth: Period | None = None
    method: Annotated[MethodKeys, shorthand("name")] = Field(default_factory=MethodKeys)
    rig: Annotated[RigKeys | None, BeforeValidator(with_sources)] = None


def address(value: Any) -> Any:
    """Parse the address of datagrams, `4710`, `127.0.0.1:4710` or `udp://239.1.2.3:4710`: host and port."""
    if isinstance(value, tuple):
        return value
    match = ADDRESS.fullmatch(str(value).strip())
    if match is None or not 0 < int(match["port"]) < 65536:
        raise ValueError(f"expected a port such as 4710, or an address such as udp://127.0.0.1:4710, not {value}")
    return match["host"] or "127.0.0.1", int(match["port"])


class TopicAddress(NamedTuple):
    """A topic of an MQTT broker, or a key expression of a Zenoh router."""

    scheme: str
    host: str
    port: int
    topic: str


def scheme_of(value: Any) -> str:
    """Return `mqtt` or `zenoh` if an address begins with mqtt:// or zenoh://, else an empty string."""
    scheme, separator, _ = str(value).partition("://")
    return scheme if separator and scheme in PORTS else ""


def topic_address(value: Any, scheme: str) -> Any:
    """Parse `mqtt://broker:1883/topic` or `zenoh://router:7447/key`; the scheme and the port may be left out."""
    if isinstance(value, TopicAddress):
        return value
    match = TOPIC.fullmatch(str(value).strip().removeprefix(f"{scheme}://"))
    port = int(match["port"] or PORTS[scheme]) if match else 0
    if match is None or not 0 < port < 65536:
        example = f"{scheme}://127.0.0.1:{PORTS[scheme]}/rig"
        raise ValueError(f"expected host and topic such as {example}, not {value}")
    *levels, last = match["topic"].split("/")
    if scheme == "mqtt" and (
        "#" in "".join(levels) or any(set(level) & set("+#") and len(level) > 1 for level in (*levels, last))
    ):
        raise ValueError(f"expected + as a whole level of a topic and # as its last one, not {match['topic']}")
    return TopicAddress(scheme, match["host"], port, match["topic"])


class SourceKeys(Keys):
    """A source of measured values: `udp` (JSON datagrams to this address), `mqtt` or `zenoh` (JSON messages of a topic of a broker
    or router) or `hardware` (file of a CAN bus, only received).

    `time`: name of the time stamp [s] in a message. `clock`: `own`, whose offset and drift are estimated, `shared` with the first
    source, or `arrival`, if stamps are missing or useless. `lost_after`: silence after which the source counts as lost.
    """

    udp: Annotated[tuple[str, int] | None, BeforeValidator(address)] = None
    mqtt: Annotated[TopicAddress | None, BeforeValidator(partial(topic_address, scheme="mqtt"))] = None
    zenoh: Annotated[TopicAddress | None, BeforeValidator(partial(topic_address, scheme="zenoh"))] = None
    hardware: Text = ""
    time: Text = "time"
    clock: Literal["own", "shared", "arrival"] = "own"
    lost_after: Period = 1000 * MILLISECOND

    @model_validator(mode="after")
    def check_kind(self) -> SourceKeys:
        """Refuse a source of no kind, or of two."""
        if [bool(kind) for kind in (self.udp, self.mqtt, self.zenoh, self.hardware)].count(True) != 1:
            raise ValueError(
                "expected one of udp, such as udp: 4710, mqtt or zenoh, such as mqtt: 127.0.0.1/rig, "
                "and hardware, such as hardware: bench.yaml"
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
    scheme = scheme_of(value)
    return {"sources": {"rig": {scheme: topic_address(value, scheme)} if scheme else {"udp": address(value)}}}
