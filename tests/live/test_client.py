"""The two ends of a session by themselves: what its page knows of it, and what is said to a process and heard from it."""

import dataclasses
import json
import math
import socket
import threading
from types import SimpleNamespace

import pytest

from tests.live.test_session import play
from twin.errors import TwinError
from twin.live import LiveSession, RefusedError
from twin.live.catalog import Catalog, CatalogControl
from twin.live.channel import Channel, ClosedError

SCENARIO = """
title: Plant
description: about it
stop_time: 20 ms
step: 1 ms
seeds: [4, 5]
members:
  a: {component: "tests.live.plant:Plant", parameters: {gain: 3.0}}
  b: {component: "tests.live.plant:Plant"}
connections: ["a.y[1] -> b.fed"]
variants: {one: {title: First}, two: {title: Second, events: [{at: 5 ms, override: {b.fed: 2 mm}}, {at: 6 ms, set: {a.speed: 1 mm/s}}]}}
events: [{at: 3 ms, set: {a.gain: 4.0}}]
record: [a.gain]
plots:
  - {title: Both, signals: ["a.y[1]", "b.y[1]"], unit: mm, band: [-1 mm, 2 mm]}
  - {title: Loop, signals: [{signal: "a.y[1]", x: "b.y[1]"}]}
console:
  controls:
    - {input: a.speed, label: hand, range: 20 mm/s, dead_zone: 10 %, stick: y, keys: [ArrowUp, ArrowDown], axis: 1, along: {a.pressed: true}}
    - {input: b.pressed, label: foot, buttons: [0]}
  parameters: {a.gain: [1.0, 5.0], b.gain: []}
  warnings: [{signal: a.z, above: 5 mm, text: far}]
"""


@pytest.fixture(scope="module")
def catalog(tmp_path_factory):
    """As plain data, as the process of the loop sends it."""
    folder = tmp_path_factory.mktemp("plant")
    (folder / "plant.yaml").write_text(SCENARIO)
    script = play(folder, folder / "plant.yaml", variant="one")
    (data,) = script.all("catalog")
    return data


@pytest.mark.slow
def test_what_a_page_knows_of_a_scenario(catalog):
    found = {
        key: catalog[key]
        for key in (
            "scenario",
            "title",
            "description",
            "variant",
            "seed",
            "step",
            "common_step",
            "start",
            "stop",
            "every",
        )
    }
    assert found == {
        "scenario": "plant",
        "title": "Plant: First",
        "description": "about it",
        "variant": "one",
        "seed": 4,
        "step": 0.001,
        "common_step": 0.002,
        "start": 0.0,
        "stop": 0.02,
        "every": 0.001,
    }
    assert (catalog["hardware"], catalog["wall_clock"], catalog["members"]) == (
        False,
        False,
        {"a": "Plant", "b": "Plant"},
    )
    assert (catalog["variants"], catalog["scenes"], catalog["targets"]) == ({"one": "First", "two": "Second"}, (), {})
    assert catalog["plots"] == (("Both", "mm", ("a.y[1]", "b.y[1]")),)  # a loop is not over time
    assert catalog["bands"] == {"Both": pytest.approx((-0.001, 0.002))}
    assert catalog["parameters"] == {"a.gain": (1.0, 5.0), "b.gain": None}
    (warning,) = catalog["warnings"]
    assert (warning["signal"], warning["above"], warning["text"]) == ("a.z", pytest.approx(0.005), "far")


def test_signals_of_a_catalog(catalog):
    """A free input is held or set; a fixed parameter is neither; what is small is recorded."""
    signals = {signal["name"]: signal for signal in catalog["signals"]}
    kinds = {
        name: (signal["kind"], signal["settable"], signal["held"], signal["recorded"])
        for name, signal in signals.items()
    }
    assert kinds == {
        "a.speed": ("input", False, True, True),
        "a.free": ("input", True, True, True),
        "a.fed": ("input", True, True, True),
        "a.pressed": ("input", True, True, True),
        "a.gain": ("parameter", True, False, True),
        "a.size": ("parameter", False, False, False),
        "a.y": ("output", False, False, True),
        "b.speed": ("input", True, True, True),
        "b.free": ("input", True, True, True),
        "b.fed": ("input", False, False, False),
        "b.pressed": ("input", False, True, True),
        "b.gain": ("parameter", True, False, False),
        "b.size": ("parameter", False, False, False),
        "b.y": ("output", False, False, True),
        "a.z": ("output", False, False, True),
        "b.z": ("output", False, False, True),
        "a.inner": ("local", False, False, False),
        "b.inner": ("local", False, False, False),
    }
    speed, y, free = signals["a.speed"], signals["a.y"], signals["b.free"]
    assert (speed["unit"], speed["display_unit"], speed["factor"], speed["offset"], speed["start"]) == (
        "m/s",
        "mm/s",
        1000.0,
        0.0,
        0.001,
    )
    assert (y["member"], y["shape"], y["type"], y["description"]) == ("a", (2,), "Float64", "position")
    assert (free["minimum"], free["maximum"], free["display_unit"], free["factor"]) == (-1.0, 2.0, "N", 1.0)
    assert [signals[name]["start"] for name in ("a.gain", "b.gain", "a.size", "a.pressed")] == [3.0, 2.0, 3, False]


def test_controls_and_events_of_a_catalog(catalog):
    """Events of other variants happen by hand; none may set what is held."""
    hand, foot = catalog["controls"]
    assert {
        key: hand[key] for key in ("low", "high", "rest", "dead_zone", "kind", "axis", "along", "stick", "factor")
    } == {
        "low": -0.02,
        "high": 0.02,
        "rest": 0.0,
        "dead_zone": 0.1,
        "kind": "hold",
        "axis": 1,
        "along": ("a.pressed",),
        "stick": "y",
        "factor": 1e3,
    }
    assert (foot["kind"], foot["buttons"], foot["rest"]) == ("press", (0,), 0.0)
    assert catalog["events"] == [
        {"key": "event_1", "kind": "set", "text": "a.gain set to 4.0", "description": "", "at": 0.003, "own": True},
        {
            "key": "event_2",
            "kind": "override",
            "text": "b.fed overridden by 2 mm",
            "description": "Second",
            "at": None,
            "own": False,
        },
    ]
    again = Catalog.of(json.loads(json.dumps(catalog)))
    assert json.loads(json.dumps(again.plain())) == json.loads(json.dumps(catalog))
    assert (again.signals["a.y"].shape, again.controls[0].keys, again.parameters["b.gain"]) == (
        (2,),
        ("ArrowUp", "ArrowDown"),
        None,
    )


@pytest.mark.parametrize(
    ("deflection", "value"),
    [(0.0, 1.0), (0.2, 1.0), (0.6, 2.0), (1.0, 3.0), (7.0, 3.0), (-0.2, 1.0), (-0.6, -1.5), (-1.0, -4.0), (-9.0, -4.0)],
)
def test_deflection_of_a_control(catalog, deflection, value):
    """From rest at the dead zone to the end, on each side by itself."""
    hand = CatalogControl(**{**catalog["controls"][0], "low": -4.0, "high": 3.0, "rest": 1.0, "dead_zone": 0.2})
    assert hand.value(deflection) == pytest.approx(value)
    button = dataclasses.replace(hand, kind="press")
    assert [button.value(part) for part in (0.5, 0.51, -1.0)] == [False, True, False]


class Peer:
    """The process of a loop, played by a test, and the session that talks to it."""

    def __init__(self, code=0):
        ours, theirs = socket.socketpair()
        self.channel, self.code, self.ended = Channel(theirs), code, threading.Event()
        process = SimpleNamespace(
            wait=lambda: self.ended.wait() and self.code,
            poll=lambda: self.code if self.ended.is_set() else None,
            terminate=self.end,
        )
        self.live = LiveSession(process, ours, {"rate": 2.0})
        (self.job,) = self.channel.receive(5.0)

    def end(self):
        """End the process."""
        if not self.ended.is_set():
            self.ended.set()
            self.channel.end.close()

    def say(self, check, **message):
        """Send a message and wait until it has its effect."""
        self.channel.send(**message)
        with self.live._changed:
            assert self.live._changed.wait_for(lambda: check(self.live), 5.0)

    def answer(self, refused=""):
        """Answer the next command in a thread; the command."""
        asked = []

        def wait():
            (message,) = self.channel.receive(5.0)
            asked.append(message)
            self.channel.send(answer=message.get("number"), refused=refused)

        thread = threading.Thread(target=wait)
        thread.start()
        return asked, thread


@pytest.fixture
def peer():
    peer = Peer()
    yield peer
    peer.end()
    peer.live.close()


def test_what_a_session_hears(peer, catalog):
    live = peer.live
    assert (peer.job, live.state.rate, live.catalog) == ({"rate": 2.0}, 2.0, None)
    with pytest.raises(TwinError, match=r"the session is not ready yet\."):
        live.wait(0.0)
    with pytest.raises(RefusedError, match=r"nothing is recorded yet\."):
        live.latest([])
    peer.say(lambda live: live.state.message == "building a", progress="building a")
    command = {"number": 1, "time": 0.5, "kind": "set", "text": "t", "line": "l", "by_operator": False}
    peer.say(lambda live: live.done, done=[command])
    peer.say(lambda live: live.catalog, catalog=json.loads(json.dumps(catalog)), folder="runs/a", epoch=3)
    live.wait()
    assert (live.state.folder, live.state.epoch, live.state.message, live.done) == ("runs/a", 3, "", ())
    for count in (1, 2):
        peer.say(lambda live, count=count: len(live.done) == count, done=[command])
    assert (live.done[1].text, live.done[1].by_operator) == ("t", False)
    peer.say(lambda live: live.state.messages, said=[1, 100.0, "hello"])
    assert (live.state.message, live.state.messages) == ("hello", ((1, 100.0, "hello"),))
    peer.say(
        lambda live: live.state.time == 2.0, state={"time": 2.0, "phase": "running", "held": {"a": 1.0}}, unknown=3
    )
    peer.say(lambda live: live.state.hardware, hardware={"armed": False})
    peer.say(lambda live: live.state.phase == "finishing", phase="finishing")
    assert (live.state.held, live.state.hardware) == ({"a": 1.0}, {"armed": False})


@pytest.mark.parametrize(
    ("call", "sent"),
    [
        (lambda live: live.resume(), {"ask": "resume"}),
        (lambda live: live.pause(), {"ask": "pause"}),
        (lambda live: live.step(), {"ask": "step", "count": 1}),
        (lambda live: live.step_macro(2), {"ask": "step", "count": 2, "macro": True}),
        (lambda live: live.pace(math.inf), {"ask": "pace", "rate": math.inf}),
        (lambda live: live.set("a", [1]), {"ask": "set", "name": "a", "value": [1]}),
        (lambda live: live.override("a", 1), {"ask": "override", "name": "a", "value": 1}),
        (lambda live: live.release("a"), {"ask": "release", "name": "a"}),
        (lambda live: live.trigger("event_1"), {"ask": "trigger", "key": "event_1"}),
    ],
)
def test_what_a_session_asks(peer, call, sent):
    """Each command has a number, and waits for its answer."""
    for number, refused in ((1, ""), (2, "no.")):
        asked, thread = peer.answer(refused)
        if refused:
            with pytest.raises(RefusedError, match=r"^no\.$"):
                call(peer.live)
        else:
            call(peer.live)
        thread.join()
        assert asked == [sent | {"number": number}]


def test_holds_are_not_answered(peer):
    peer.live.hold("a", 0.5, 3, age=1.0)
    (message,) = peer.channel.receive(5.0)
    instant = message.pop("instant")
    assert message == {"ask": "hold", "name": "a", "value": 0.5, "press": 3}
    peer.live.hold("a", 0.5, 3)
    (later,) = peer.channel.receive(5.0)
    assert 1.0 <= later["instant"] - instant < 4.0
    peer.live.release_hold("a")
    assert peer.channel.receive(5.0) == [{"ask": "release_hold", "name": "a"}]


@pytest.mark.parametrize(
    ("code", "phase", "message"),
    [
        (0, "stopped", ""),
        (3, "failed", "the process of the loop has died (code 3). Recover its results with: twin recover runs/a"),
        (-9, "failed", "the process of the loop has died (signal 9). Recover its results with: twin recover runs/a"),
    ],
)
def test_the_end_of_the_process(catalog, code, phase, message):
    peer = Peer(code)
    peer.say(lambda live: live.catalog, catalog=json.loads(json.dumps(catalog)), folder="runs/a", epoch=1)
    peer.say(lambda live: live.state.held, state={"held": {"a": 1.0}, "lag": 1.0, "achieved": 1.0})
    peer.end()
    peer.live._listener.join(5.0)
    state = peer.live.state
    assert (state.phase, state.message, state.held, state.lag, state.achieved) == (phase, message, {}, 0.0, 0.0)
    with pytest.raises(RefusedError, match=r"pause: the session is over\."):
        peer.live.pause()
    if message:
        with pytest.raises(TwinError, match="has died"):
            peer.live.stop()
    else:
        assert str(peer.live.stop()) == "runs/a"
    peer.live.close()


@pytest.mark.parametrize("is_asked", [False, True])
def test_a_process_that_dies_after_its_reason_or_when_it_is_asked_to(is_asked):
    """What is known already is no death without a reason."""
    peer = Peer(3)
    if is_asked:
        peer.live._ends = True
    else:
        peer.say(lambda live: live.state.phase == "failed", failed=["a.yaml:1: wrong"])
    peer.end()
    peer.live._listener.join(5.0)
    assert (peer.live.state.phase, peer.live.state.message) == (
        ("stopped", "") if is_asked else ("failed", "a.yaml:1: wrong")
    )
    assert peer.live._problems == ([] if is_asked else ["a.yaml:1: wrong"])


def test_a_session_that_cannot_begin():
    peer = Peer()
    peer.say(lambda live: live.state.phase == "failed", failed=["a.yaml:1: wrong", "more"])
    assert peer.live.state.message == "a.yaml:1: wrong"
    peer.end()
    with pytest.raises(TwinError) as caught:
        peer.live.wait()
    assert caught.value.problems == ["a.yaml:1: wrong", "more"]
    with pytest.raises(ClosedError):
        peer.live._channel.send(a=1)
