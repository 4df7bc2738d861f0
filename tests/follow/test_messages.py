"""Messages of a rig become values of the model: when it begins, which are left out, what is told; datagrams of a run."""

from __future__ import annotations

import json
import math
import socket
import struct
import time as host_time
from types import SimpleNamespace

import numpy as np
import pytest

from tests.every_case import every_case
from tests.follow.test_linear import estimate
from twin.errors import SimulationError, TwinError
from twin.follow.live import MessageFollower
from twin.follow.live_problem import LiveSignal
from twin.follow.publishing import Publisher
from twin.follow.schema import RigKeys
from twin.follow.sensor_clock import SensorClock
from twin.follow.signal_checks import Notes
from twin.follow.sources import Inbox, Message
from twin.follow.sources.udp import STAMP, TIMESTAMP, age, is_multicast

RIG = {"sources": {"a": {"udp": 1}, "b": {"udp": 2, "clock": "arrival", "lost_after": "250 ms"}}}
FORCE = LiveSignal("force", "N", "m.f", "N")
TIP = LiveSignal("tip", "mm", "m.y", "m", offset=0.001, delay=0.02)


class Steps:
    """A follower that notes values; too late are those before 1.05 s of the model."""

    def __init__(self, *_):
        self.values, self.limits, self.tick = [], [], 10

    def add_input(self, number, time, value):
        self.values.append(("input", number, round(time, 6), round(value, 6)))
        return time > 1.05

    def add_measurement(self, number, time, value):
        self.values.append(("output", number, round(time, 6), round(value, 6)))
        return time > 1.05

    def run(self, limit):
        self.limits.append(limit)
        return []

    def forecast(self):
        return f"from step {self.tick}"

    def __exit__(self, *_):
        self.values.append("closed")


@pytest.fixture
def messages(monkeypatch):
    """Of a model that starts at 1 s with steps of 10 ms; its values and the lines that are shown."""
    monkeypatch.setattr("twin.follow.live.RevisableFollower", Steps)

    def made(forecast=None, **rig):
        problem = SimpleNamespace(
            experiment=SimpleNamespace(case=SimpleNamespace(start_ns=1_000_000_000, step_ns=10_000_000)),
            rig=RigKeys.model_validate({**RIG, **rig}),
            inputs=(FORCE,),
            measured=(TIP,),
            forecast=forecast,
        )
        return MessageFollower(problem, None, Notes(lambda _line: None))

    return made


def test_the_model_begins_when_all_inputs_have_a_value(messages):
    own = messages()
    own.receive(Message("b", 100.0, None, {"tip": 4.0}))
    assert own.follower is None
    assert own.estimate(100.0) == []
    own.receive(Message("a", 100.1, 5.0, {"force": 2.0}))
    assert own.clock.origin == 5.0  # 1 s of the model
    assert own.timeline.inputs[0].times == [1.0]
    assert own.timeline.inputs[0].values == [2.0]
    assert list(own.timeline.visits(-100, 100, 1000)) == []  # the first tip was measured before
    own.receive(Message("a", 100.4, 5.3, {"force": 3.0}))
    own.receive(Message("b", 100.5, None, {"tip": 7.0}, {"tip": "m"}))
    own.receive(Message("b", 100.6, None, {"tip": 8.0}))  # its unit is still m
    assert own.follower.values == [
        ("input", 0, 1.3, 3.0),
        ("output", 0, pytest.approx(1.38), 7.001),
        ("output", 0, pytest.approx(1.48), 8.001),
    ]
    assert own.notes.lines == []
    assert own.summary() == {
        "messages": {"a": 2, "b": 3},
        "values": {},
        "origin": 5.0,
        "clocks": {"a": {"offset": pytest.approx(95.1), "drift": 0.0}},
        "events": {},
    }


def test_a_step_waits_for_the_slowest_source_and_not_for_ever(messages):
    own = messages(wait="50 ms")
    own.receive(Message("a", 100.0, 5.0, {"force": 2.0}))
    own.receive(Message("b", 100.1, None, {"tip": 1.0}))
    own.receive(Message("a", 100.2, 5.2, {"force": 2.0}))
    own.estimate(
        100.13
    )  # b has sent all up to its stamp less its delay: 1.08 s of the model; 1.13 s less 0.05 s is as far
    own.estimate(100.145)
    own.estimate(100.3)  # without b, 1.25 s
    own.estimate(100.41)  # b is lost
    assert own.follower.limits == [8, 9, 25, 36]
    assert own.states["b"].is_lost
    assert own.notes.lines == ["b: no message for 0.25 s. Its last inputs are held."]
    own.receive(Message("b", 101.1, None, {"tip": 2.0}))
    assert not own.states["b"].is_lost
    assert own.notes.lines[1:] == ["b is back after 1.0 s."]
    own.receive(Message("b", 101.5, None, {"tip": 3.0}))
    own.estimate(101.74)
    assert not own.states["b"].is_lost
    own.estimate(101.75)
    assert own.notes.lines[2:] == ["a: no message for 1 s. Its last inputs are held.", own.notes.lines[0]]


def test_forecasts_are_made_when_they_are_due(messages, monkeypatch):
    own = messages(SimpleNamespace(repeat=20))
    own.receive(Message("a", 100.0, 5.0, {"force": 2.0}))

    def run(self, limit):
        self.tick = limit
        return [estimate(0.01 * limit - 0.01), estimate(0.01 * limit)]

    monkeypatch.setattr(Steps, "run", run)
    made = [[one.forecast for one in own.estimate(host)] for host in (100.12, 100.22, 100.32, 100.42, 100.52)]
    assert made == [[None, "from step 10"], [None, None], [None, "from step 30"], [None, None], [None, "from step 50"]]


def test_a_lost_source_may_end_it(messages):
    own = messages(on_loss="stop")
    own.receive(Message("b", 100.0, None, {"tip": 1.0}))
    own.estimate(100.2)
    with pytest.raises(SimulationError, match=r"^b: no message for 0\.25 s\.$"):
        own.estimate(100.25)


def test_values_that_are_left_out_are_counted(messages):
    own = messages()
    own.receive(Message("a", 100.0, 5.0, {"force": 2.0}))
    own.receive(Message("a", 100.01, 5.03, {"force": math.nan, "tip": 1.0, "other": 3.0}))
    assert own.follower.values == [("output", 0, 1.01, 0.002)]
    assert own.counts == {"left out": 1, "late": 1}
    lines = ["force is nan: left out until it is a number.", "tip came 0.09 s late, max_delay is 0.5 s: left out."]
    assert own.notes.lines == lines
    own.receive(Message("a", 100.02, problem="a message is no JSON"))
    assert own.notes.lines[2:] == ["a: a message is no JSON: left out."]
    assert own.states["a"].messages == 3
    with own:
        pass
    assert own.follower.values[-1] == "closed"
    strict = messages(on_bad="stop")
    with pytest.raises(SimulationError, match="a message is no JSON"):
        strict.receive(Message("a", 100.0, problem="a message is no JSON"))


@every_case(
    ("kind", "stamp", "origin"),
    [
        ("arrival", None, 5.5),  # what the first source's clock was then
        ("own", 20.0, 5.5),
        ("own", -20.0, 5.5),
        ("own", None, 5.5),  # without stamps, arrival counts
        ("shared", 5.4, 5.4),  # 0.1 s on its way
    ],
)
def test_the_first_input_may_come_from_another_clock(messages, kind, stamp, origin):
    own = messages(sources={"a": {"udp": 1}, "b": {"udp": 2, "clock": kind}})
    own.receive(Message("a", 100.0, 5.0, {"tip": 1.0}))
    own.receive(Message("b", 100.5, stamp, {"force": 2.0}))
    assert own.clock.origin == pytest.approx(origin)
    assert own.timeline.inputs[0].times == [pytest.approx(1.0)]


def test_a_message_whose_stamp_does_not_fit_is_told_when_the_next_one_does():
    clock = SensorClock(0.5)
    assert clock.add(0.0, 10.0) == 0.0
    assert clock.add(0.1, 10.6) == 0.0  # as late as is allowed
    assert clock.at(0.1) == 10.0
    assert clock.add(0.2, 11.0) is None
    assert clock.outlier == 0.0
    assert clock.add(0.3, 10.3) == 0.0
    assert clock.outlier == pytest.approx(0.8)
    assert clock.add(9.0, 11.0, was_lost=True) == pytest.approx(8.0)  # a source that was silent may begin anew
    assert clock.at(9.0) == 2.0


@pytest.mark.parametrize(("count", "every", "jumped"), [(3, 0.5, 2), (2, 1.0, None), (3, 0.49, None), (12, 0.1, 10)])
def test_a_clock_has_jumped_after_a_second_and_three_messages(count, every, jumped):
    clock = SensorClock(0.5)
    clock.add(0.0, 10.0)
    results = [clock.add(100.0 + every * k, 11.0 + every * k) for k in range(count)]
    assert [k for k, result in enumerate(results) if result is not None][:1] == ([] if jumped is None else [jumped])
    if jumped is not None:
        assert results[jumped] == pytest.approx(99.0)


def test_the_least_delay_of_each_second_counts():
    clock = SensorClock(0.5)
    for stamp, delay in ((0.0, 0.1), (0.2, 0.3), (0.4, 0.05), (0.6, 0.2), (1.5, 0.2), (1.7, 0.15), (1.8, 0.16)):
        clock.add(stamp, stamp + delay)
    assert list(clock._points) == [(0.4, pytest.approx(0.05)), (1.7, pytest.approx(0.15))]
    assert (clock.offset, clock.drift) == (pytest.approx(0.05), 0.0)
    for k in range(2, 9):
        clock.add(k + 0.5, 1.01 * (k + 0.5))
    assert clock.drift == 0.0  # of nine points
    clock.add(9.5, 1.01 * 9.5)
    assert clock.drift == pytest.approx(0.01)  # of the line below all of them


def test_an_inbox_gives_all_that_has_arrived_and_closes_its_sources():
    class Source:
        def __init__(self, *batches):
            self.batches, self.closed = list(batches), False

        def receive(self, timeout):
            if not self.batches:
                raise SimulationError("gone")
            host_time.sleep(min(timeout, 0.001))
            return self.batches.pop(0)

        def close(self):
            self.closed = True

    one, two = Message("a", 1.0, values={"x": 1.0}), Message("a", 2.0, values={"x": 2.0})
    source, found = Source([one, two], []), []
    with Inbox({"a": source}) as inbox:
        while len(found) < 3:
            found += inbox.take(5.0)
        assert inbox.take(0.0) == []
    assert found[:2] == [one, two]
    assert (found[2].source, found[2].problem) == ("a", "gone")
    assert source.closed


def test_how_long_a_datagram_has_waited(monkeypatch):
    monkeypatch.setattr("twin.follow.sources.udp.time.time_ns", lambda: 100_500_000_000)

    def waited(seconds, nanoseconds):
        return age([(0, TIMESTAMP + 1, b""), (0, TIMESTAMP, STAMP.pack(seconds, nanoseconds))])

    assert waited(99, 250_000_000) == 1.25
    assert waited(101, 0) == 0.0  # the wall clock was set back
    assert waited(40, 500_000_000) == 0.0  # or ahead: none waits for a minute
    assert waited(40, 500_000_001) == pytest.approx(60.0)
    assert age([]) == 0.0
    assert [is_multicast(host) for host in ("239.1.2.3", "127.0.0.1", "localhost")] == [True, False, False]
    assert struct.calcsize("@ll") == STAMP.size


class Simulation:
    """Advances its time to what it is asked for; a number, a Boolean, an array and a text are recorded."""

    def __init__(self, start, every):
        self.time, self.every, self.finished, self.members = start, every, False, {"m": SimpleNamespace(variables=self)}
        self.recorded = [("m", name) for name in ("x", "on", "r", "text")]
        self.stops = []

    def __getitem__(self, name):
        kind = {"x": "f", "on": "b", "r": "f", "text": "O"}[name]
        return SimpleNamespace(dtype=SimpleNamespace(kind=kind), shape=(2,) if name == "r" else (), unit="m")

    def value(self, key):
        return {"x": self.time / 1e9, "on": np.bool_(True), "r": np.array([1.0, 2.0]), "text": "a"}[key[1]]

    def initialize(self, *_):
        pass

    def advance(self, until):
        self.stops.append(until)
        self.time = until


@pytest.mark.parametrize("target", ["localhost", "0", "127.0.0.1:99999"])
def test_an_address_that_is_none_is_told(target):
    with pytest.raises(TwinError, match=r"^--publish: expected a port such as 4710"):
        Publisher(target)


def test_a_run_is_published_at_its_pace_with_units_once_a_second(monkeypatch):
    ms = 1_000_000
    slept, applied, progress = [], [], []
    monkeypatch.setattr("twin.follow.publishing.time.monotonic", lambda: 50.0)
    monkeypatch.setattr("twin.follow.publishing.time.sleep", slept.append)
    monkeypatch.setattr("twin.follow.publishing.apply_event", lambda event, *_: applied.append(event.time_ns))
    case = SimpleNamespace(
        name="case", start_ns=500 * ms, stop_ns=1700 * ms, events=[SimpleNamespace(time_ns=t * ms) for t in (500, 750)]
    )
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(5.0)
        publisher = Publisher(f"127.0.0.1:{receiver.getsockname()[1]}")
        simulation = Simulation(case.start_ns, 500 * ms)
        publisher.run_case(case, simulation, lambda name, part: progress.append((name, part)))
        publisher.sender.close()
        found = [json.loads(receiver.recv(65536)) for _ in range(4)]
    assert simulation.stops == [stop * ms for stop in (750, 1250, 1700)]
    assert applied == [500 * ms, 750 * ms]
    assert [one["time"] for one in found] == [0.5, 0.75, 1.25, 1.7]
    assert found[0] == {"time": 0.5, "m.x": 0.5, "m.on": True, "m.r[1]": 1.0, "m.r[2]": 2.0, "units": found[0]["units"]}
    assert found[0]["units"] == dict.fromkeys(("m.x", "m.on", "m.r[1]", "m.r[2]"), "m")
    assert ["units" in one for one in found] == [True, False, False, True]
    assert slept == pytest.approx([0.25, 0.75, 1.2])
    assert progress == [("case", pytest.approx(part)) for part in (0.0, 0.25 / 1.2, 0.75 / 1.2, 1.0)]


def test_too_many_signals_for_a_datagram_are_told():
    publisher = Publisher("4710")
    try:
        simulation = Simulation(0, 1)
        simulation.value = lambda key: np.zeros(20_000)
        recorded = [(("m", "r"), simulation["r"])]
        with pytest.raises(SimulationError, match="20000 signals are too many for a message"):
            publisher._send(0.0, recorded, simulation, with_units=False)
    finally:
        publisher.sender.close()
