"""Times, counts and order on the bus in simulated time, and a master's access to it, to the nanosecond."""

import random

import pytest

from hw_bridge.bus import (
    MILLISECOND,
    NEVER,
    Bus,
    CycleTimeBudget,
    Disturbance,
    EventQueue,
    Frame,
    Kind,
    Recorder,
    SimulatedNetwork,
    Timer,
    bit_count,
)
from tests.every_case import every_case
from twin.errors import SimulationError

BIT = 1000  # [ns] at 1 Mbit/s
EMPTY = 55 * BIT  # a frame without data
LATENCY = 20_000
ERROR_FRAME, RECOVERY = 23 * BIT, 128 * 11 * BIT


class Station(Recorder):
    """A recorder that also notes what its controller reports."""

    def __init__(self, bus):
        super().__init__()
        self.states = []
        bus.attach(self)

    def error_passive(self):
        self.states.append(("passive", self.now))

    def bus_off(self):
        self.states.append(("off", self.now))

    def bus_on(self):
        self.states.append(("on", self.now))


# ------------------------------------------------------------------------------------------------------ event queue


def test_actions_are_executed_by_time_and_then_by_insertion():
    queue, executed = EventQueue(), []
    for name, time in (("b", 20), ("a", 10), ("c", 20), ("d", 30)):
        queue.at(time, lambda name=name: executed.append((name, queue.now)))
    assert queue.next_time() == 10
    queue.advance(9)
    assert (executed, queue.now) == ([], 9)
    queue.advance(20)
    assert executed == [("a", 10), ("b", 20), ("c", 20)]
    queue.advance(15)  # time does not go back
    assert (queue.now, queue.next_time()) == (20, 30)
    queue.at(5, lambda: executed.append(("late", queue.now)))
    assert queue.next_time() == 20
    queue.advance(40)
    assert executed[3:] == [("late", 20), ("d", 30)]
    assert (queue.now, queue.next_time()) == (40, NEVER)


def test_a_timer_is_started_restarted_and_stopped():
    queue, fired = EventQueue(), []
    timer = Timer(queue, lambda: fired.append((queue.now, timer.running)))
    assert timer.running is False
    timer.start(10)
    queue.advance(9)
    assert (timer.running, fired) == (True, [])
    timer.start(10)
    queue.advance(18)
    assert fired == []
    queue.advance(19)
    assert (timer.running, fired) == (False, [(19, False)])
    timer.start(5)
    timer.stop()
    assert timer.running is False
    queue.advance(50)
    assert fired == [(19, False)]


# ----------------------------------------------------------------------------------------------------- disturbances


@every_case(
    ("options", "identifier", "time", "hit"),
    [
        ({}, 0x7FF, 0, True),
        ({"low": 0x100}, 0x100, 0, True),
        ({"low": 0x100}, 0x0FF, 0, False),
        ({"high": 0x100}, 0x100, 0, True),
        ({"high": 0x100}, 0x101, 0, False),
        ({"start": 10}, 1, 10, True),
        ({"start": 10}, 1, 9, False),
        ({"end": 10}, 1, 9, True),
        ({"end": 10}, 1, 10, False),
        ({"count": 0}, 1, 0, False),
        ({"count": 1}, 1, 0, True),
        ({"only": frozenset({1, 3})}, 3, 0, True),
        ({"only": frozenset({1, 3})}, 2, 0, False),
        ({"share": 0.0}, 1, 0, False),
    ],
)
def test_which_frames_a_disturbance_hits(options, identifier, time, hit):
    disturbance = Disturbance(Kind.DROP, **options)
    before = disturbance.count
    assert disturbance.hits(Frame(identifier), time, random.Random(1)) is hit
    assert disturbance.count == before - hit


def test_a_share_is_chosen_by_the_seed_and_the_count_ends_it():
    chance, expected = random.Random(7), random.Random(7)
    disturbance = Disturbance(Kind.DROP, share=0.25, count=3)
    hits = [disturbance.hits(Frame(1), 0, chance) for _ in range(40)]
    drawn = [expected.random() < 0.25 for _ in range(40)]
    third = [k for k, is_hit in enumerate(drawn) if is_hit][2]
    assert hits == [is_hit and k <= third for k, is_hit in enumerate(drawn)]
    whole = random.Random(7)
    assert Disturbance(Kind.DROP).hits(Frame(1), 0, whole)
    assert whole.random() == random.Random(7).random()  # nothing is drawn for all frames


# -------------------------------------------------------------------------------------------------------------- bus


def test_frames_as_text_and_their_length():
    assert str(Frame(0x81, b"\x0a\xff")) == "081#0AFF"
    assert str(Frame(0x701, remote=True, length=1)) == "701#R"
    assert [bit_count(Frame(1, bytes(size))) for size in (0, 1, 3, 8)] == [55, 65, 85, 135]
    assert bit_count(Frame(1, remote=True, length=8)) == 55


def test_one_frame_after_the_other():
    bus = Bus()
    sender, receiver = Station(bus), Station(bus)
    assert bus.load == 0.0
    for identifier in (0x200, 0x100, 0x100):
        sender.send(Frame(identifier, bytes([len(bus._ports[0].queue)])))
    bus.advance(1_000_000)
    one = 65 * BIT
    assert receiver.received == [
        (one + LATENCY, Frame(0x100, b"\1")),
        (2 * one + LATENCY, Frame(0x100, b"\2")),
        (3 * one + LATENCY, Frame(0x200, b"\0")),
    ]
    assert (bus.busy_time, bus.longest_wait, bus.load) == (3 * one, 3 * one, pytest.approx(0.195))
    assert sender.received == []


def test_the_wire_is_free_again_when_a_frame_has_been_sent():
    bus = Bus(500_000, latency=0)
    sender, receiver = Station(bus), Station(bus)
    sender.send(Frame(1))
    bus.advance(50_000)
    sender.send(Frame(0))  # of a higher priority, but the wire is in use
    bus.advance(500_000)
    assert receiver.received == [(110_000, Frame(1)), (220_000, Frame(0))]
    assert bus.longest_wait == 170_000


def test_delay_jitter_and_drop():
    bus = Bus(seed=3)
    sender, receiver = Station(bus), Station(bus)
    heard = []
    bus.observers.append(lambda time, frame: heard.append((time, frame.id)))
    bus.disturbances = [
        Disturbance(Kind.DELAY, 1, 1, delay=5_000, jitter=1_000),
        Disturbance(Kind.DROP, 2, 2),
        Disturbance(Kind.DELAY, 1, 2, delay=NEVER),  # the first that hits counts
    ]
    for identifier in (1, 2, 3):
        sender.send(Frame(identifier))
    bus.advance(1_000_000)
    jitter = round(random.Random(3).random() * 1_000)
    assert sorted(receiver.received, key=lambda item: item[1].id) == [
        (EMPTY + LATENCY + 5_000 + jitter, Frame(1)),
        (3 * EMPTY + LATENCY, Frame(3)),
    ]
    assert heard == [(EMPTY, 1), (2 * EMPTY, 2), (3 * EMPTY, 3)]  # also what is not received


def test_destroyed_frames_count_up_to_bus_off_and_back():
    """ISO 11898-1: error passive from 128 on, bus-off from 256 on; back after 128 times 11 bits."""
    bus = Bus()
    sender, receiver = Station(bus), Station(bus)
    errors = []
    bus.error_observers.append(errors.append)
    bus.disturbances = [Disturbance(Kind.CORRUPT)]
    sender.send(Frame(1))
    sender.send(Frame(2))
    bus.advance(10_000_000)
    each = EMPTY + ERROR_FRAME
    assert errors == [each * n for n in range(1, 33)]
    assert [state for state, _ in sender.states] == ["passive", "off", "on"]
    assert sender.states[2][1] == 32 * each + RECOVERY
    assert bus.busy_time == 32 * each
    assert receiver.received == []
    bus.disturbances = []
    bus.advance(20_000_000)
    assert receiver.received == []  # what waited is gone
    sender.send(Frame(3))
    bus.advance(21_000_000)
    assert [frame.id for _, frame in receiver.received] == [3]
    assert bus._ports[0].errors == 0


def test_a_station_in_bus_off_neither_sends_nor_hears():
    bus = Bus()
    sender, receiver = Station(bus), Station(bus)
    bus.disturbances = [Disturbance(Kind.CORRUPT, count=32)]
    sender.send(Frame(1))
    bus.advance(32 * (EMPTY + ERROR_FRAME))
    assert [state for state, _ in sender.states] == ["passive", "off"]
    sender.send(Frame(2))
    receiver.send(Frame(3))
    bus.advance(bus.now + RECOVERY - 1)
    assert (sender.received, receiver.received) == ([], [])
    bus.advance(bus.now + 1)
    assert sender.states[-1][0] == "on"


def test_a_station_that_left_does_not_come_back_by_itself():
    bus = Bus()
    sender, receiver = Station(bus), Station(bus)
    bus.disturbances = [Disturbance(Kind.CORRUPT, count=32)]
    sender.send(Frame(1))
    bus.advance(32 * (EMPTY + ERROR_FRAME))
    bus.detach(sender)
    bus.advance(bus.now + 2 * RECOVERY)
    assert [state for state, _ in sender.states] == ["passive", "off"]
    bus.detach(receiver)
    receiver.send(Frame(2))
    other = Station(bus)
    bus.advance(bus.now + 1_000_000)
    assert other.received == []


def test_stations_are_advanced_to_the_time_of_what_they_hear():
    class Ticking(Station):
        """It wants to be advanced at 30 and 80 us."""

        def __init__(self, bus):
            self.ticks, self.advanced = [30_000, 80_000], []
            super().__init__(bus)

        def next_time(self):
            return self.ticks[0] if self.ticks else NEVER

        def advance(self, time):
            super().advance(time)
            self.advanced.append(time)
            while self.ticks and self.ticks[0] <= time:
                self.send(Frame(self.ticks.pop(0) // 10_000))

    bus = Bus()
    ticking, receiver = Ticking(bus), Station(bus)
    receiver.send(Frame(0x700))
    bus.advance(200_000)
    assert ticking.advanced == [30_000, 75_000, 80_000, 200_000]
    assert ticking.received == [(75_000, Frame(0x700))]
    assert receiver.received == [(130_000, Frame(3)), (185_000, Frame(8))]


# ---------------------------------------------------------------------------------------------------------- network


def test_the_time_budget_of_a_cycle():
    before = CycleTimeBudget(1_000, 2_000, 3_000, 4_000)
    after = CycleTimeBudget(11_000, 22_000, 33_000, 44_000)
    each = {"wait": 1e-6, "send": 2e-6, "receive": 3e-6, "decode": 4e-6, "loop": 5e-6}
    assert after.since(before, 150_000, 10) == pytest.approx(each)
    assert after.since(before, 150_000, 0)["wait"] == pytest.approx(1e-5)


def test_a_master_waits_for_a_time_or_a_condition():
    bus = Bus()
    network, other = SimulatedNetwork(bus), Station(bus)
    heard = []
    network.hear = heard.append
    assert (network.wall_clock, network.real_time, network.lock()) == (False, False, False)
    other.send(Frame(1))
    network.advance(2 * MILLISECOND, lambda: bool(heard))
    assert (network.now, heard) == (MILLISECOND // 4, [Frame(1)])  # looked at each quarter of a millisecond
    network.advance(2 * MILLISECOND, lambda: True)
    assert network.now == MILLISECOND // 4
    network.advance(MILLISECOND + 1, lambda: False)
    assert network.now == MILLISECOND + 1
    assert network.send_at(Frame(2), 3 * MILLISECOND) == 3 * MILLISECOND
    network.advance(4 * MILLISECOND)
    assert other.received == [(3 * MILLISECOND + EMPTY + LATENCY, Frame(2))]
    network.close()
    network.send(Frame(3))
    network.advance(5 * MILLISECOND)
    assert len(other.received) == 1


def test_observers_hear_every_frame_and_error_once_and_leave_when_they_fail():
    bus = Bus()
    network, other = SimulatedNetwork(bus), Station(bus)
    heard, again = [], []

    class Shadow:
        def hear(self, _time, frame):
            if frame is None:
                raise ValueError("no frame.")

    network.observe(lambda time, frame: heard.append((time, frame)))
    network.observe(Shadow().hear)
    network.observe(lambda time, _: again.append(time))
    bus.disturbances = [Disturbance(Kind.DROP, 1, 1), Disturbance(Kind.CORRUPT, 2, 2, count=1)]
    other.send(Frame(1))
    network.send(Frame(2))
    bus.advance(MILLISECOND)
    destroyed = 2 * EMPTY + ERROR_FRAME
    assert heard == [(EMPTY, Frame(1)), (destroyed, None), (destroyed + EMPTY, Frame(2))]
    assert again == [time for time, _ in heard]
    assert network.observer_errors == ["Shadow: no frame. It observes the bus no longer."]
    assert len(network.observers) == 2


def test_a_master_in_bus_off_cannot_send():
    bus = Bus()
    network, other = SimulatedNetwork(bus), Station(bus)
    bus.disturbances = [Disturbance(Kind.CORRUPT, count=32)]
    network.send(Frame(1))
    network.advance(10 * MILLISECOND)
    with pytest.raises(
        SimulationError, match=r"^bus: this program's node is in bus-off\. Check bit rate, wiring and termination\.$"
    ):
        network.send(Frame(2))
    assert other.received == []
