"""What a page's messages do, on a console without a session of its own, and what is drawn of a session's rows."""

import json
import math
from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import numpy as np
import pytest

from twin import web
from twin.console import charts
from twin.console.curves import MAX_ELEMENTS, PREVIOUS, SessionCurves, elements
from twin.console.joysticks import control, controls
from twin.console.session import Host
from twin.console.websocket import (
    MAX_CHARACTERS,
    MAX_SIGNALS,
    MAX_TICKS,
    MAX_VALUES,
    PageMessages,
    number,
    plain,
    tick_message,
)
from twin.errors import TwinError
from twin.live import RefusedError


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
            signals=SIGNALS, controls=[CONTROL], start=1.0, every=0.5, wall_clock=False, plots=(), bands={}
        )
        self.rows = {"a.x": np.array([1.0, 2.0]), "a.m": np.array([[[1.0, np.nan], [3.0, np.inf]]])}
        values = {
            "state": state,
            "catalog": catalog,
            "latest": lambda names: SimpleNamespace(values={name: self.rows[name] for name in names}),
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


HOLD = {"hold": "speed", "at": 0.5, "press": 4, "tick": 7}


@pytest.mark.parametrize(
    ("message", "calls"),
    [
        (HOLD, [("live", "hold", "a.speed[1]", 0.01, 4, pytest.approx(0.05))]),
        (HOLD | {"at": -1, "press": 0}, [("live", "hold", "a.speed[1]", -0.02, 0, pytest.approx(0.05))]),
        (HOLD | {"tick": 8}, []),  # a tick that was not sent
        (HOLD | {"hold": "jog"}, [("activity", "hold", "jog", 0.5, 4, pytest.approx(0.05))]),
        ({"here": True, "tick": 7}, [("activity", "here", pytest.approx(0.05))]),
        ({"here": True, "tick": 9}, []),
        ({"release_hold": "speed"}, [("live", "release_hold", "a.speed[1]")]),
        ({"release_hold": "jog"}, [("activity", "release_hold")]),
        ({"release_hold": ""}, [("live", "release_hold"), ("activity", "release_hold")]),
    ],
)
def test_what_a_message_does(message, calls):
    assert Setting().take(message) == calls


@pytest.mark.parametrize(
    ("message", "why"),
    [
        ("x" * (MAX_CHARACTERS + 1), f"a message of {MAX_CHARACTERS + 1} characters. At most {MAX_CHARACTERS}."),
        (" " * MAX_CHARACTERS, "the message is not JSON."),
        ("{", "the message is not JSON."),
        ("[]", "expected one of here, hold, release_hold, stop, watch."),
        ({"hold": "speed", "stop": True}, "expected one of"),
        ({"tick": 7}, "expected one of"),
        ('{"hold": "speed", "at": NaN}', "NaN is not a number."),
        (HOLD | {"hold": "none"}, "hold: 'none' is not a control of this scenario."),
        (HOLD | {"at": 1.0001}, "hold: at: expected a number from -1 to 1."),
        (HOLD | {"at": -1.0001}, "hold: at: expected a number from -1 to 1."),
        (HOLD | {"at": True}, "hold: at: expected a number from -1 to 1."),
        (HOLD | {"at": None}, "hold: at: expected a number from -1 to 1."),
        (HOLD | {"press": -1}, "hold: press: expected a whole number."),
        (HOLD | {"press": 2**53}, "hold: press: expected a whole number."),
        (HOLD | {"press": True}, "hold: press: expected a whole number."),
        (HOLD | {"press": 1.0}, "hold: press: expected a whole number."),
        (HOLD | {"tick": None}, "hold: tick: expected a whole number."),
        ({"here": 1, "tick": 7}, "here: expected true."),
        ({"here": True}, "here: tick: expected a whole number."),
        ({"stop": 1}, "stop: expected true."),
        ({"release_hold": 5}, "release_hold: '5' is not a control of this scenario."),
        ({"release_hold": "none"}, "release_hold: 'none' is not a control of this scenario."),
        ({"watch": "a.x"}, f"watch: expected up to {MAX_SIGNALS} names."),
        ({"watch": [1]}, f"watch: expected up to {MAX_SIGNALS} names."),
        ({"watch": ["a.x"] * (MAX_SIGNALS + 1)}, f"watch: expected up to {MAX_SIGNALS} names."),
        ({"watch": ["a.hidden"]}, "watch: 'a.hidden' is not recorded."),
        ({"watch": ["a.none"]}, "watch: 'a.none' is not recorded."),
        ({"watch": ["a.big", "a.x"]}, f"watch: more than {MAX_VALUES} values."),
    ],
)
def test_what_is_refused(message, why):
    setting = Setting()
    with pytest.raises(ValueError) as caught:
        setting.take(message)
    assert str(caught.value).startswith(why)
    assert setting.calls == []


def test_another_page_watches_and_may_stop():
    setting = Setting("watcher")
    for message in (HOLD, {"release_hold": ""}, {"here": True, "tick": 7}):
        with pytest.raises(ValueError, match=r"this page only watches\. Another page operates\."):
            setting.take(message)
    setting.take({"watch": ["a.x", "a.x"]})
    assert setting.messages.watched == ("a.x",)
    setting.take({"watch": ["a.big"]})
    setting.take({"stop": True})
    setting.console._stopping.join()
    assert setting.calls == [("activity", "stop"), ("live", "stop")]


def test_ticks_are_known_for_three_seconds():
    setting = Setting()
    setting.messages.sent(7 + MAX_TICKS - 1)
    assert len(setting.take(HOLD)) == 1
    setting.messages.sent(7 + MAX_TICKS)
    assert len(setting.take(HOLD)) == 1


def test_a_tick_holds_what_has_changed():
    setting = Setting()
    setting.take({"watch": ["a.x", "a.m"]})
    tick = json.loads(tick_message(setting.console, "operator", 9, setting.messages))
    assert tick == {
        "tick": 9,
        "stop": "STOP",
        "operator": True,
        "attend": True,
        "phase": "running",
        "time": 1.5,
        "rate": None,
        "achieved": 2.0,
        "lag": 0.01,
        "epoch": 3,
        "held": {"jog": 0.5, "a.speed[1]": 0.02},
        "message": "said",
        "values": {"a.x": 2.0, "a.m": [[1.0, None], [3.0, None]]},
    }
    setting.rows["a.x"] = np.array([3.0])
    setting.activity.values["attended"] = False
    tick = json.loads(tick_message(setting.console, "watcher", 10, setting.messages))
    assert (tick["values"], tick["operator"], tick["attend"]) == ({"a.x": 3.0}, False, False)
    setting.rows["a.x"] = np.array([])
    assert json.loads(tick_message(setting.console, "watcher", 11, setting.messages))["values"] == {}
    setting.console.live = None
    assert json.loads(tick_message(setting.console, "operator", 12, setting.messages)) == {
        "tick": 12,
        "stop": "",
        "operator": True,
        "attend": False,
        "phase": "",
        "held": {"jog": 0.5},
    }
    assert (number(math.inf), number(0.0), plain(np.array(np.nan)), plain(np.array(3))) == (None, 0.0, None, 3)


@pytest.mark.parametrize(
    ("hardware", "phase", "is_ready", "has_controls", "label"),
    [
        ("bench", "stopped", True, False, "STOP"),
        (None, "running", True, True, "STOP"),
        (None, "running", True, False, "End"),
        (None, "starting", False, False, "STOP"),
        (None, "stopped", True, True, ""),
        (None, "failed", True, True, ""),
    ],
)
def test_the_button_that_ends_everything(hardware, phase, is_ready, has_controls, label):
    catalog = SimpleNamespace(controls=[CONTROL] * has_controls) if is_ready else None
    live = SimpleNamespace(state=SimpleNamespace(phase=phase), catalog=catalog)
    assert Host(hardware=hardware, live=live).stop_label == label
    assert Host(hardware=hardware, live=live).catalog is catalog
    assert (Host().stop_label, Host().catalog, Host().source, Host().drives_in_use) == ("", None, None, "")


@pytest.mark.parametrize(
    ("phase", "wall_clock", "brought_up", "in_use"),
    [
        ("running", True, True, True),
        ("paused", True, True, True),
        ("paused", True, False, False),
        ("paused", True, None, False),
        ("running", True, None, True),
        ("running", False, True, False),
        ("stopped", True, True, False),
    ],
)
def test_a_session_uses_its_drives(phase, wall_clock, brought_up, in_use):
    hardware = None if brought_up is None else {"brought_up": brought_up}
    state = SimpleNamespace(phase=phase, hardware=hardware)
    live = SimpleNamespace(state=state, catalog=SimpleNamespace(wall_clock=wall_clock))
    assert bool(Host(live=live).drives_in_use) == in_use


def test_a_session_goes_on_unless_an_activity_uses_its_drives():
    setting = Setting()
    setting.activity.values["busy"] = "homing"
    setting.console.resume()  # its own drives are simulated
    setting.live.values["catalog"].wall_clock = True
    with pytest.raises(TwinError, match="homing"):
        setting.console.resume()
    setting.activity.values["busy"] = ""
    setting.console.resume()
    assert setting.calls == [("live", "resume")] * 2
    for begin in (setting.console.leave, lambda: setting.console.begin("a.yaml")):
        with pytest.raises(TwinError, match=r"a session is running\. Stop it first\."):
            begin()
    setting.console.hardware = "bench"
    with pytest.raises(TwinError, match=r"a session with drives is running\. Stop it first\."):
        setting.console.restart("x")
    setting.live.values["state"].phase = "stopped"
    setting.console.leave()
    assert (setting.console.live, setting.calls[2:]) == (None, [("live", "stop"), ("live", "close")])


def test_scalars_of_a_signal():
    """Indices count from 1; of what is large or a text there is none."""
    assert list(elements(SIGNALS["a.x"])) == ["a.x"]
    assert list(elements(SIGNALS["a.m"])) == ["a.m[1,1]", "a.m[1,2]", "a.m[2,1]", "a.m[2,2]"]
    assert list(elements(SIGNALS["b.text"])) == []
    assert len(list(elements(signal("a.v", shape=(MAX_ELEMENTS,))))) == MAX_ELEMENTS
    assert list(elements(signal("a.v", shape=(MAX_ELEMENTS + 1,)))) == []


def reader(time, values):
    """Rows that are recorded."""

    def read(names, since, until):
        chosen = (time > since) & (time <= until)
        return SimpleNamespace(time=time[chosen], values={name: values[name][chosen] for name in names})

    return SimpleNamespace(read=read, latest=lambda names: SimpleNamespace(time=time[-1:]))


def test_curves_of_a_session():
    """In display units, with the row before the window; those of the run before it are there under another name."""
    setting = Setting()
    time = 1.0 + 0.5 * np.arange(5)
    rows = {"a.x": np.arange(5.0), "b.n": np.arange(5)}
    setting.live.values["reader"] = lambda: reader(time, rows)
    first = SessionCurves(setting.live)
    assert list(first.names()) == ["a.x", *elements(SIGNALS["a.m"]), "b.n"]
    assert (first.span(), first.previous("a.x")) == ((1.0, 3.0), "")
    times, values = first.read("a.x", 2.0, 2.5, 100)
    assert (times.tolist(), values.tolist()) == ([2.0, 2.5], [2000.0, 3000.0])
    times, values = first.read("a.x", 2.1, 2.5, 100)
    assert (times.tolist(), values.tolist()) == ([2.0, 2.5], [2000.0, 3000.0])
    assert [array.size for array in first.read("a.x", 7.0, 8.0, 100)] == [0, 0]
    setting.live.values["state"].epoch = 4
    setting.live.values["reader"] = lambda: reader(time, {name: -values for name, values in rows.items()})
    second = SessionCurves(setting.live, first)
    assert f"{PREVIOUS}b.n" in second.names()
    assert second.read(f"{PREVIOUS}a.x", 2.0, 2.5, 100)[1].tolist() == [2000.0, 3000.0]
    assert second.read("a.x", 2.0, 2.5, 100)[1].tolist() == [-2000.0, -3000.0]
    late = SessionCurves(setting.live, replace(setting.console) and None)
    setting.live.values["state"].epoch = 5
    with pytest.raises(RefusedError, match="nothing was recorded"):
        late.reader()
    assert late.span() == (1.0, 1.0)
    assert [array.size for array in late.read("a.x", 0.0, 9.0, 10)] == [0, 0]
    assert SessionCurves(setting.live, late).previous_run is None  # it never had a row


def test_the_first_panes_of_a_chart():
    """Those of the scenario's plots, with bands in display units; else the first two outputs."""
    curves = SessionCurves(Setting().live)
    catalog = SimpleNamespace(
        plots=(
            ("One", "m", ("a.x", "a.gone", "b.n")),
            ("None", "m", ("a.gone",)),
            ("Two", "N", ("b.n",)),
            ("Three", "m", ("a.x",)),
            ("Four", "m", ("a.x",)),
        ),
        bands={"One": (0.001, 0.002)},
    )
    panes = charts.first_panes(catalog, curves)
    assert [(pane.title, pane.unit, pane.band) for pane in panes] == [
        ("One", "mm", (1.0, 2.0)),
        ("Two", "N", None),
        ("Three", "mm", None),
    ]
    assert [[(curve.name, curve.color, curve.step) for curve in pane.curves] for pane in panes] == [
        [("a.x", 0, False), ("b.n", 1, True)],
        [("b.n", 2, True)],
        [("a.x", 3, False)],
    ]
    many = SimpleNamespace(plots=(("One", "m", ("a.x",) * 7), ("Two", "m", ("b.n",) * 3)), bands={})
    assert [len(pane.curves) for pane in charts.first_panes(many, curves)] == [7, 1]
    own = charts.first_panes(SimpleNamespace(plots=(), bands={}), curves)
    assert [(pane.unit, [(curve.name, curve.color) for curve in pane.curves]) for pane in own] == [
        ("mm", [("a.x", 0)]),
        ("m", [("a.m[1,1]", 1)]),
    ]
    assert isinstance(own[0], web.Pane)


def test_labels_of_commands():
    assert charts.mark_text("set a.b = 1") == "a.b = 1"
    assert charts.mark_text(f"speed{charts.HELD}") == "speed"
    exact, longer = "x" * charts.MARK_WIDTH, "x" * (charts.MARK_WIDTH + 1)
    assert (charts.mark_text(exact), charts.mark_text(longer)) == (exact, exact[:-1] + "…")


def test_controls_of_a_page():
    """Limits in the display unit."""
    (item,) = controls(SimpleNamespace(controls=[CONTROL]))
    assert item == {
        "name": "speed",
        "input": "a.speed[1]",
        "label": "catheter",
        "about": "d",
        "kind": "hold",
        "stick": "y",
        "keys": ["ArrowUp", "ArrowDown"],
        "axis": 1,
        "reverse": True,
        "buttons": [None, 2],
        "dead": 0.1,
        "unit": "mm/s",
        "low": -19.0,
        "high": 21.0,
        "factor": 1e3,
        "offset": 1.0,
    }
    jog = control("jog", "Jog", "about", ("a", "b"), "mm/s", 5.0)
    assert {key: jog[key] for key in ("input", "low", "high", "factor", "offset", "dead", "reverse", "keys")} == {
        "input": "jog",
        "low": -5.0,
        "high": 5.0,
        "factor": 5.0,
        "offset": 0.0,
        "dead": 0.0,
        "reverse": False,
        "keys": ["a", "b"],
    }
