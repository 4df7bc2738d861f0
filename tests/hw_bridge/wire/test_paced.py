"""A master's network and a simulated drive on an interface, on a clock that stands until something takes time."""

from types import SimpleNamespace

import pytest

from hw_bridge.bus import Frame
from hw_bridge.bus.event_queue import NEVER, EventQueue
from hw_bridge.wire import Wire, network, wire
from hw_bridge.wire.link import Arrival
from tests.hw_bridge.wire.clock import Clock
from twin.errors import SimulationError

MS = 1_000_000  # [ns]
READ, SEND, HEAR, OBSERVE = 1_000, 500, 2_000, 300  # what each takes [ns]


class Line:
    """A link on which frames arrive at times [ns] after its begin."""

    def __init__(self, clock, arrivals=()):
        self.clock, self.begin = clock, clock.ns
        self.arrivals = [(self.begin + time, arrival) for time, arrival in arrivals]
        self.idle, self.looked, self.sent, self.timeouts = 0, clock.ns, [], []

    def hear(self, timeout):
        self.timeouts.append(timeout)
        end = self.clock.ns + round(timeout * 1e9)
        due = self.arrivals[0][0] if self.arrivals else NEVER
        if due > self.clock.ns:
            self.idle += min(due, end) - self.clock.ns
            self.clock.ns = min(due, end)
        self.looked = self.clock.ns
        heard = [arrival for time, arrival in self.arrivals if time <= self.clock.ns]
        self.arrivals = self.arrivals[len(heard) :]
        self.clock.ns += READ
        return heard

    def send(self, frame):
        self.sent.append((self.clock.ns - self.begin, frame))
        self.clock.ns += SEND


class Settings:
    """Real-time settings that are only noted."""

    real_time = True

    def __init__(self, priority):
        self.calls = [priority]

    def lock(self):
        self.calls.append("lock")
        return True

    def end(self):
        self.calls.append("end")


@pytest.fixture
def opened(monkeypatch):
    def make(*arrivals, interface="virtual"):
        clock = Clock(monkeypatch, network)
        line = Line(clock, arrivals)
        made = SimpleNamespace(clock=clock, line=line, heard=[], observed=[], closed=[])
        monkeypatch.setattr(network, "sleep", clock.sleep)
        monkeypatch.setattr(network, "open_bus", lambda *words: words)
        monkeypatch.setattr(network, "link", lambda bus, kind: line)
        monkeypatch.setattr(network, "shut_down", made.closed.append)
        monkeypatch.setattr(network, "RealtimeScope", Settings)
        made.bus = network.WireNetwork(interface, "can0", 500_000, {"a": 1})

        def hear(frame):
            made.heard.append((made.bus.now, frame))
            clock.ns += HEAR

        def observe(time, frame):
            made.observed.append((time, frame))
            clock.ns += OBSERVE

        made.bus.hear = hear
        made.bus.observe(observe)
        return made

    return make


def budget(made):
    return vars(made.bus.time_budget)


def test_a_network_is_opened_and_closed(opened):
    made = opened(interface="socketcan")
    bus = made.bus
    assert (bus.bus, bus.now, bus.wall_clock, bus.real_time) == (
        ("socketcan", "can0", 500_000, {"a": 1}),
        0,
        True,
        True,
    )
    assert bus.lock() is True
    bus.send(Frame(1))
    bus.close()
    assert made.observed == [(SEND, Frame(1))]  # what was still to be told
    assert (made.closed, bus._realtime.calls) == ([bus.bus], [20, "lock", "end"])


def test_frames_and_the_time_that_everything_takes(opened):
    made = opened((3 * MS, Arrival(Frame(1))), (3 * MS, Arrival(None)), (5 * MS, Arrival(Frame(2))))
    made.bus.advance(10 * MS)
    assert made.heard == [(3 * MS + READ, Frame(1)), (5 * MS + READ, Frame(2))]
    assert made.observed == [(3 * MS + READ, Frame(1)), (3 * MS + READ + HEAR, None), (5 * MS + READ, Frame(2))]
    # waiting until 3, 5 and 10 ms, and one more look at the end, at which nothing is there
    assert made.bus.now == 10 * MS + 2 * READ
    assert made.line.timeouts[-1] == 0.0
    assert budget(made) == {
        "wait": 10 * MS - 2 * (READ + HEAR + OBSERVE) - OBSERVE,
        "send": 0,
        "receive": 4 * READ,
        "decode": 2 * HEAR + 3 * OBSERVE,
    }


@pytest.mark.parametrize(("is_done", "ends"), [(True, 3 * MS), (False, 10 * MS)])
def test_a_condition_ends_the_wait_after_what_arrived(opened, is_done, ends):
    made = opened((3 * MS, Arrival(Frame(1))))
    made.bus.advance(10 * MS, lambda: is_done and bool(made.heard))
    assert ends <= made.bus.now < ends + 10_000
    assert len(made.heard) == 1


def test_what_is_late_is_received_but_not_for_ever(opened):
    """For 20 ms after the time that was waited for, or after now."""
    made = opened(*((k * 100_000, Arrival(Frame(1))) for k in range(1_000)))
    made.bus.hear = lambda _: made.clock.sleep(100e-6)  # as long as a frame takes on the bus
    made.bus.advance(5 * MS)
    assert made.bus.now == pytest.approx(25 * MS, abs=110_000)
    begin = made.bus.now
    made.bus.advance(0)
    assert made.bus.now - begin == pytest.approx(20 * MS, abs=500_000)


def test_a_frame_is_sent_at_its_time(opened):
    made = opened((2 * MS, Arrival(Frame(1))), (4_800_000, Arrival(Frame(2))))
    assert made.bus.send_at(Frame(9), 5 * MS) == 5 * MS
    assert made.line.sent == [(5 * MS, Frame(9))]
    assert [frame.id for _, frame in made.heard] == [1]  # nothing is received in the last 0.3 ms
    assert made.observed == []
    assert budget(made)["send"] == SEND
    assert budget(made)["wait"] == 5 * MS - 3 * READ - HEAR
    late = made.bus.now
    assert late < made.bus.send_at(Frame(9), 1 * MS) < late + 20_000
    made.bus.advance(made.bus.now)
    assert [frame.id for _, frame in made.observed] == [1, 9, 2, 9]


@pytest.mark.parametrize(("interface", "heard"), [("udp_multicast", [1]), ("virtual", [7, 7, 1, 7])])
def test_what_comes_back_is_not_heard(opened, interface, heard):
    """As often as it was sent."""
    echoes = [(k * MS, Arrival(Frame(identifier))) for k, identifier in ((1, 7), (2, 7), (3, 1), (4, 7))]
    made = opened(*echoes, interface=interface)
    for _ in range(3 if interface == "udp_multicast" else 1):
        made.bus.send(Frame(7))
    made.bus.advance(5 * MS)
    assert [frame.id for _, frame in made.heard] == heard
    assert not made.bus._sent


def test_a_frame_of_another_master_is_heard_after_the_echo(opened):
    made = opened((1 * MS, Arrival(Frame(7))), (2 * MS, Arrival(Frame(7))), interface="udp_multicast")
    made.bus.send(Frame(7))
    made.bus.advance(3 * MS)
    assert [frame.id for _, frame in made.heard] == [7]


def test_an_adapter_that_sends_nothing_any_more(opened):
    made = opened((MS, Arrival(None, failure="bus-off")))
    with pytest.raises(SimulationError, match=r"^bus: bus-off\. Check bit rate, wiring and termination\.$"):
        made.bus.advance(2 * MS)


# ------------------------------------------------------------------------------------------------- a simulated drive


class Slave:
    """It wants to be advanced at times [ns], and notes to which it was."""

    def __init__(self, *times):
        self.port = SimpleNamespace(event_queue=EventQueue())
        self.notes, self.times = [], list(times)

    def connect(self, send):
        self.send = send

    def next_time(self):
        return next((time for time in self.times if time > self.port.event_queue.now), NEVER)

    def advance(self, time):
        self.port.event_queue.advance(time)
        self.notes.append(time)

    def receive(self, frame):
        self.notes.append(frame.id)


def run(monkeypatch, slave, arrivals, looks, stall=()):
    """Run for some looks at the link; `stall`: by look, time that the process then loses [ns]."""
    clock = Clock(monkeypatch, wire)
    line = Line(clock, arrivals)
    paced, stall = Wire(slave, line), dict(stall)
    hear = line.hear

    def stalled(timeout):
        heard = hear(timeout)
        clock.ns += stall.get(len(line.timeouts), 0)
        if len(line.timeouts) == looks:
            paced.stop.set()
        return heard

    line.hear = stalled
    paced.run()
    return paced, line


def test_simulated_time_follows_the_clock(monkeypatch):
    slave = Slave(2 * MS, 4 * MS, 200 * MS)
    frames = [(3 * MS, Arrival(Frame(1))), (3 * MS, Arrival(None))]
    paced, line = run(monkeypatch, slave, frames, 5)
    # to the time of the look, which is before the time of reading: frames that arrive in between are later
    second = 3 * MS
    assert slave.notes == [2 * MS, second, 1, 4 * MS, 54 * MS + READ, 104 * MS + 2 * READ]
    assert line.timeouts == pytest.approx([2e-3, 2e-3 - 1e-6, 1e-3 - 1e-6, 0.05, 0.05])
    assert paced.overruns == 0


def test_a_frame_acts_when_it_reached_this_machine(monkeypatch):
    slave = Slave(2 * MS)
    frames = [(3 * MS, Arrival(Frame(1), waited=MS // 2)), (3 * MS, Arrival(Frame(2), waited=5 * MS))]
    run(monkeypatch, slave, frames, 2)
    # time does not go back
    assert slave.notes == [2 * MS, 5 * MS // 2, 1, 5 * MS // 2, 2]


@pytest.mark.parametrize(("late", "overruns"), [(9 * MS, 0), (11 * MS, 1)])
def test_a_stalled_process_is_counted_once(monkeypatch, late, overruns):
    slave = Slave(*(k * MS for k in range(1, 100)))
    paced, _ = run(monkeypatch, slave, [], 4, stall={2: late})
    assert paced.overruns == overruns


def test_overruns_in_a_row_are_one(monkeypatch):
    slave = Slave(*(k * MS for k in range(1, 200)))
    paced, _ = run(monkeypatch, slave, [], 6, stall={2: 30 * MS, 3: 30 * MS})
    assert paced.overruns == 1
    slave = Slave(*(k * MS for k in range(1, 200)))
    paced, _ = run(monkeypatch, slave, [], 9, stall={2: 30 * MS, 7: 30 * MS})
    assert paced.overruns == 2
