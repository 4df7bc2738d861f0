"""A session without a process: its signals, one control, and what it is asked."""

import json
import math
from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np

from twin.console.session import Host
from twin.console.websocket import (
    MAX_VALUES,
    PageMessages,
)
from twin.results import expression
from twin.scene import Space, SpacePoint


@dataclass
class Recorder:
    """An object whose methods note their calls. `values`: its other attributes."""

    name: str
    calls: list = field(default_factory=list)
    values: dict = field(default_factory=dict)

    def __getattr__(self, name):
        if name in self.values:
            return self.values[name]
        return lambda *arguments: self.calls.append((self.name, name, *arguments))


def signal(name, *, shape=(), recorded=True, kind="output", type="Float64", factor=1.0, offset=0.0, unit="m"):  # noqa: A002
    return SimpleNamespace(
        name=name,
        member=name.partition(".")[0],
        shape=shape,
        recorded=recorded,
        kind=kind,
        type=type,
        factor=factor,
        offset=offset,
        display_unit=unit,
        description=f"about {name}",
        unit="m",
    )


SIGNALS = {
    one.name: one
    for one in (
        signal("a.x", factor=1e3, unit="mm"),
        signal("a.m", shape=(2, 2)),
        signal("a.hidden", recorded=False),
        signal("a.big", shape=(MAX_VALUES,)),
        signal("b.n", type="Int32", kind="local", unit=""),
        signal("b.text", type="String"),
    )
}
SPACE = Space(points=(SpacePoint("tip", tuple(map(expression.parse, ("a.x", 0, 0)))),))
CONTROL = SimpleNamespace(
    name="speed",
    input="a.speed[1]",
    value=lambda at: 0.02 * at,
    label="catheter",
    description="d",
    kind="hold",
    stick="y",
    keys=("ArrowUp", "ArrowDown"),
    axis=1,
    reverse=True,
    buttons=(None, 2),
    dead_zone=0.1,
    display_unit="mm/s",
    low=-0.02,
    high=0.02,
    factor=1e3,
    offset=1.0,
)


class Setting:
    """A console with a session and an activity, whose calls are noted, and a page that operates."""

    def __init__(self, client="operator"):
        self.calls, self.now = [], 100.0
        state = SimpleNamespace(
            phase="running",
            time=1.5,
            rate=math.inf,
            achieved=2.0,
            lag=0.01,
            epoch=3,
            held={"a.speed[1]": 0.02},
            message="said",
        )
        catalog = SimpleNamespace(
            signals=SIGNALS,
            variant="quiet",
            controls=[CONTROL],
            start=1.0,
            every=0.5,
            wall_clock=False,
            plots=(),
            bands={},
            lines={},
            warnings=(),
            spaces=({"space": SPACE.plain(), "curvature": [], "diameter": []},),
        )
        self.rows = {"a.x": np.array([1.0, 2.0]), "a.m": np.array([[[1.0, np.nan], [3.0, np.inf]]])}
        values = {
            "state": state,
            "catalog": catalog,
            "changes": {},
            "latest": lambda names: SimpleNamespace(
                time=np.array([0.5, 1.25]), values={name: self.rows[name] for name in names}
            ),
        }
        self.live = Recorder("live", self.calls, values)
        values = {"controls": {"jog"}, "held": {"jog": 0.5}, "attended": True, "busy": ""}
        self.activity = Recorder("activity", self.calls, values)
        self.console = Host(live=self.live, activities={"bench": self.activity})
        self.console.operator_lock.enter("operator")
        self.messages = PageMessages(self.console, client, lambda: self.now)
        self.messages.sent(7)
        self.now += 0.05

    def take(self, message):
        self.messages.take(message if isinstance(message, str) else json.dumps(message))
        return [call for call in self.calls if call[0] != "state"]
