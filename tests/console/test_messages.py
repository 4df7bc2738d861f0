"""What a page's messages do, on a console without a session of its own, and what is drawn of a session's rows."""

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

from tests.console.without_a_process import CONTROL, Setting
from tests.every_case import every_case
from twin.console.session import Host
from twin.console.websocket import (
    MAX_CHARACTERS,
    MAX_SIGNALS,
    MAX_TICKS,
    MAX_VALUES,
    number,
    plain,
    tick_message,
)
from twin.errors import TwinError

HOLD = {"hold": "speed", "at": 0.5, "press": 4, "tick": 7}


@every_case(
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


@every_case(
    ("message", "why"),
    [
        ("x" * (MAX_CHARACTERS + 1), f"a message of {MAX_CHARACTERS + 1} characters. At most {MAX_CHARACTERS}."),
        (" " * MAX_CHARACTERS, "the message is not JSON."),
        ("{", "the message is not JSON."),
        ("[]", "expected one of here, hold, release_hold, space, stop, watch."),
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
        ({"space": 1}, "space: expected the number of a scene, below 1, or null."),
        ({"space": True}, "space: expected the number of a scene, below 1, or null."),
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
        with pytest.raises(ValueError, match=r"This page only watches: another page operates\."):
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
        "watching": "",
        "dropped": False,
        "phase": "running",
        "time": 1.25,  # of the values: one age for status, picture and charts
        "rate": None,
        "achieved": 2.0,
        "lag": 0.01,
        "epoch": 3,
        "held": {"jog": 0.5, "a.speed[1]": 0.02},
        "run": 1,
        "message": "said",
        "values": {"a.x": 2.0, "a.m": [[1.0, None], [3.0, None]]},
    }
    setting.rows["a.x"] = np.array([3.0])
    setting.activity.values["attended"] = False
    tick = json.loads(tick_message(setting.console, "watcher", 10, setting.messages))
    assert (tick["values"], tick["operator"]) == ({"a.x": 3.0}, False)
    setting.live.values["state"].epoch = 4  # another run: no value of the one before is valid
    tick = json.loads(tick_message(setting.console, "watcher", 10, setting.messages))
    assert (tick["run"], tick["values"]) == (2, {"a.x": 3.0, "a.m": [[1.0, None], [3.0, None]]})
    setting.rows["a.x"] = np.array([])
    assert json.loads(tick_message(setting.console, "watcher", 11, setting.messages))["values"] == {}
    setting.console.live = None
    assert json.loads(tick_message(setting.console, "operator", 12, setting.messages)) == {
        "tick": 12,
        "stop": "",
        "operator": True,
        "watching": "",
        "dropped": False,
        "phase": "",
        "held": {"jog": 0.5},
    }
    assert (number(math.inf), number(0.0), plain(np.array(np.nan)), plain(np.array(3))) == (None, 0.0, None, 3)


@pytest.mark.parametrize("error", [TwinError("it is gone."), FileNotFoundError("1.rows")])
def test_a_tick_without_readable_values_is_sent(error):
    """Between two sessions; without ticks a page says that the server does not answer."""
    setting = Setting()
    setting.take({"watch": ["a.x"]})

    def fail(_names):
        raise error

    setting.live.values["latest"] = fail
    tick = json.loads(tick_message(setting.console, "operator", 9, setting.messages))
    assert (tick["phase"], tick["values"]) == ("running", {})


def test_values_that_move_pictures_are_in_si(monkeypatch):
    """A member of a foreign FMU declares its length in millimeters."""
    setting = Setting()
    monkeypatch.setattr(setting.live.catalog.signals["a.x"], "unit", "mm")
    setting.take({"watch": ["a.x"]})
    tick = json.loads(tick_message(setting.console, "operator", 9, setting.messages))
    assert tick["values"] == {"a.x": pytest.approx(0.002)}


def test_an_arc_for_recordings_is_no_second_catheter():
    """A recording has no shapes; in a session the arc lay beside the shape, as another instrument."""
    from twin.console.space import space_view

    def labels(*lines):
        space = {"lines": [{"label": str(k), **line} for k, line in enumerate(lines)]}
        signals = {name: SimpleNamespace(unit="m") for name in ("t.shape", "t.position", "u.position")}
        catalog = SimpleNamespace(spaces=({"space": space, "curvature": [], "diameter": []},), signals=signals)
        return [line.label for line in space_view(catalog, 0).space.lines]

    shape, arc = {"signal": "t.shape"}, {"root": [0.0, 0.0, 0.0], "tip": ["t.position"]}
    assert labels(shape, arc, arc | {"tip": ["u.position"]}) == ["0", "2"]
    assert labels(arc, arc) == ["0", "1"]


def test_what_moves_in_space_is_sent_when_it_has_changed():
    setting = Setting()

    def heard(tick):
        return json.loads(tick_message(setting.console, "operator", tick, setting.messages)).get("space")

    assert heard(9) is None
    setting.take({"space": 0})
    assert heard(10) == {"lines": [], "points": [[2000.0, 0.0, 0.0]], "surfaces": [], "forces": []}  # a.x in mm
    assert heard(11) is None
    setting.rows["a.x"] = np.array([3.0])
    assert heard(12)["points"] == [[3000.0, 0.0, 0.0]]
    setting.take({"space": None})
    setting.rows["a.x"] = np.array([4.0])
    assert heard(13) is None
    setting.take({"space": 0})  # a page that was lost
    setting.rows["a.x"] = np.array([])
    assert heard(14) is None


@every_case(
    ("hardware", "phase", "operated", "label"),
    [
        ("bench", "stopped", False, "STOP"),
        (None, "running", True, "STOP"),
        (None, "running", False, "End"),
        (None, "stopped", True, ""),
        (None, "failed", True, ""),
    ],
)
def test_the_button_that_ends_everything(hardware, phase, operated, label):
    """STOP is for motion: of drives, and of a rig under controls. Any other simulation ends."""
    controls = [CONTROL] if operated else []
    live = SimpleNamespace(state=SimpleNamespace(phase=phase), catalog=SimpleNamespace(controls=controls))
    assert Host(hardware=hardware, live=live).stop_label == label
    assert Host(hardware=hardware, live=live).catalog is live.catalog
    live.catalog = None  # it is being prepared: nothing moves that could be stopped
    if phase == "running":
        assert Host(hardware=hardware, live=live).stop_label == ("STOP" if hardware else "End")
    assert (Host().stop_label, Host().catalog, Host().source, Host().drives_in_use) == ("", None, None, "")


@every_case(
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
