"""The bus in simulated time: lengths, arbitration, latency, disturbances, determinism."""

import pytest

from hw_bridge.bus import MILLISECOND, Bus, Disturbance, Frame, Kind, bit_count
from hw_bridge.dictionary import Mode, State
from tests.hw_bridge.bench import NODE, Master
from twin.errors import DeclarationError


@pytest.mark.parametrize(("size", "bits"), [(0, 55), (1, 65), (2, 75), (8, 135)])
def test_worst_case_length(size, bits):
    """CiA's figure for 8 bytes is 135 bits with stuffing; 0.13 ms at 1 Mbit/s."""
    assert bit_count(Frame(1, bytes(size))) == bits


@pytest.mark.parametrize(("bit_rate", "time"), [(1_000_000, 155_000), (500_000, 290_000), (125_000, 1_100_000)])
def test_latency_follows_the_bit_rate(bit_rate, time):
    bus = Bus(bit_rate)
    sender, receiver = Master(bus), Master(bus)
    sender.send(Frame(0x123, bytes(8)))
    bus.advance(10 * MILLISECOND)
    assert [when for when, _ in receiver.received] == [time]  # 135 bits and 20 us
    assert sender.received == []


def test_the_lowest_identifier_wins():
    bus = Bus()
    first, second, receiver = Master(bus), Master(bus), Master(bus)
    for identifier in (0x300, 0x180):
        first.send(Frame(identifier))
    for identifier in (0x200, 0x080):
        second.send(Frame(identifier))
    bus.advance(MILLISECOND)
    assert [frame.id for _, frame in receiver.received] == [0x080, 0x180, 0x200, 0x300]
    assert bus.busy_time == 4 * 55_000
    assert bus.longest_wait == 4 * 55_000


def test_three_axes_at_one_millisecond_load_the_bus_by_85_percent():
    """Facts, section 4: three RPDOs and TPDOs of 8 bytes and SYNC take about 0.85 ms at 1 Mbit/s."""
    bus = Bus()
    master = Master(bus)
    for cycle in range(100):
        bus.advance(cycle * MILLISECOND)
        for identifier in (0x080, 0x181, 0x182, 0x183, 0x201, 0x202, 0x203):
            master.send(Frame(identifier, bytes(8 * (identifier != 0x080))))
    bus.advance(100 * MILLISECOND)
    assert bus.load == pytest.approx(0.865, abs=0.01)


def test_drop_delay_and_jitter():
    bus = Bus()
    sender, receiver = Master(bus), Master(bus)
    bus.disturbances = [
        Disturbance(Kind.DROP, 0x100, 0x100, count=2),
        Disturbance(Kind.DELAY, 0x080, 0x080, delay=MILLISECOND, jitter=MILLISECOND),
    ]
    for number in range(10):
        bus.advance(number * 10 * MILLISECOND)
        sender.send(Frame(0x100))
        sender.send(Frame(0x080))
    bus.advance(100 * MILLISECOND)
    assert sum(frame.id == 0x100 for _, frame in receiver.received) == 8
    late = [time % (10 * MILLISECOND) for time, frame in receiver.received if frame.id == 0x080]
    assert all(MILLISECOND < one < 2.2 * MILLISECOND for one in late)
    assert len(set(late)) == 10


def test_corrupted_frames_are_repeated():
    bus = Bus()
    sender, receiver = Master(bus), Master(bus)
    bus.disturbances = [Disturbance(Kind.CORRUPT, count=3)]
    sender.send(Frame(0x100, b"\1"))
    bus.advance(MILLISECOND)
    assert [frame.data for _, frame in receiver.received] == [b"\1"]
    assert bus.busy_time == (3 * (65 + 23) + 65) * 1000


@pytest.mark.parametrize(
    ("name", "codes", "state"),
    [
        ("epos4", [0x8120, 0x81FD], State.QUICK_STOP),
        ("faulhaber_v3", [0x8140], State.FAULT),
        ("mclm", [0x8120, 0x8140], State.ENABLED),
    ],
)
def test_bus_off_and_return(make, name, codes, state):
    bench = make(name)
    bench.write(0x1017, 5)
    bench.nmt(1)
    bench.enable(Mode.PV)
    bench.emergencies()
    bench.bus.disturbances = [Disturbance(Kind.CORRUPT, 0x700 + NODE, 0x700 + NODE)]
    bench.go(8)
    bench.bus.disturbances.clear()
    bench.go(200)
    assert bench.emergencies() == codes
    assert bench.state is state


def test_a_node_is_lost_and_returns(make):
    bench = make("epos4")
    bench.write(0x1017, 10)
    bench.bus.detach(bench.drive)
    bench.frames(0x700 + NODE)
    bench.go(50)
    assert bench.frames(0x700 + NODE) == []
    bench.drive.advance(bench.bus.now)
    bench.bus.attach(bench.drive)
    bench.go(50)
    assert len(bench.frames(0x700 + NODE)) == 5


def test_every_run_is_the_same(make):
    def run():
        bench = make("faulhaber_v3")
        bench.bus.disturbances = [Disturbance(Kind.DELAY, share=0.5, jitter=100_000)]
        bench.enable(Mode.PP)
        bench.nmt(1)
        bench.write(0x607A, 5000)
        bench.control(0x1F)
        bench.go(200)
        return [(time, str(frame)) for time, frame in bench.master.received]

    first = run()
    assert len(first) > 100
    assert run() == first


def test_the_error_counter_of_a_sender():
    """ISO 11898-1: 8 more for a frame that is destroyed, 1 less for one that is sent, never below 0."""
    bus = Bus()
    sender, receiver = Master(bus), Master(bus)
    (port, _) = bus._ports
    for destroyed, errors in ((0, 0), (1, 7), (2, 22), (0, 21)):
        bus.disturbances = [Disturbance(Kind.CORRUPT, count=destroyed)] if destroyed else []
        sender.send(Frame(0x100))
        bus.advance(bus.now + MILLISECOND)
        assert port.errors == errors
    assert len(receiver.received) == 4


def test_a_bit_rate_that_does_not_exist():
    with pytest.raises(DeclarationError, match="no bit rate 123"):
        Bus(123)
