"""A drive that another program left enabled or moving is refused before anything is written to it."""

import pytest

from hw_bridge.bus import MILLISECOND, Frame, SimulatedNetwork
from hw_bridge.dictionary import Mode, State, cia301
from hw_bridge.profiles import DRIVE_PROFILES
from hw_bridge.session import Session
from tests.hw_bridge.axis import Rig
from tests.hw_bridge.bridge.test_bridge import NODES
from twin.errors import SimulationError


@pytest.fixture
def found(build, monkeypatch):
    """A rig whose drive was left as `leave(drive)` makes it; all frames on its bus, and who moves it."""

    def made(name, leave):
        begin = Session.network

        def left(self):
            network = begin(self)
            bench = self.bench
            bench.bus.advance(500 * MILLISECOND)
            drive = next(iter(bench.plants.values())).drive
            leave(drive)
            bench.bus.advance(bench.bus.now + 200 * MILLISECOND)
            rig.frames = []
            bench.bus.observers.append(lambda _, frame: rig.frames.append(frame))
            return network

        monkeypatch.setattr(Session, "network", left)
        rig = Rig(build, {"servomotor": NODES[name]})
        return rig

    return made


def download(drive, index, value, sub=0):
    entry = drive.dictionary.entry(index, sub)
    drive.dictionary.check(entry, value)
    drive.dictionary.values[index, sub] = value
    drive.dictionary.act(entry)


def enabled(drive, velocity=0):
    """In pv at a speed, as another program commands it."""
    mode = Mode.CSV if Mode.CSV in drive.profile.modes else Mode.PV
    download(drive, 0x6060, mode)
    download(drive, 0x60FF, velocity)
    for word in (0x06, 0x07, 0x0F):
        download(drive, 0x6040, word)


def written(frames):
    """Frames that change something: NMT, SDO downloads, process data, SYNC."""
    return [
        one
        for one in frames
        if one.id in (cia301.NMT, cia301.SYNC)
        or (0x200 <= one.id < 0x580 and one.id & 0x780 in (0x200, 0x300, 0x400, 0x500))
        or (0x600 <= one.id < 0x680 and one.data[0] >> 5 in (0, 1))
    ]


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("velocity", [0, 20])
@pytest.mark.parametrize("name", DRIVE_PROFILES)
def test_a_drive_that_is_enabled_is_refused(found, name, velocity):
    rig = found(name, lambda drive: enabled(drive, velocity * (1000 if name == "epos4" else 1)))
    with pytest.raises(SimulationError, match=r"servomotor: .*Operation enabled.*another program.*twin hil disable 1"):
        rig.go(1)
    assert written(rig.frames) == []
    assert rig.drive.state is State.ENABLED


def test_a_drive_in_quick_stop_is_refused(found):
    def leave(drive):
        download(drive, 0x605A, 6)
        enabled(drive)
        download(drive, 0x6040, 0x02)

    rig = found("epos4", leave)
    with pytest.raises(SimulationError, match=r"servomotor: .*Quick stop active.*twin hil disable 1"):
        rig.go(1)
    assert written(rig.frames) == []


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("name", DRIVE_PROFILES)
def test_a_drive_that_moves_without_power_is_refused(found, name):
    """A vertical axis that falls, or one that somebody pushes."""

    def leave(drive):
        event_queue = drive.port.event_queue
        event_queue.at(
            event_queue.now + 640 * MILLISECOND, lambda: drive.axis.motor.load(4.0 if name != "epos4" else 1.0)
        )

    rig = found(name, leave)
    with pytest.raises(SimulationError, match=r"servomotor: moves at .* although it has no power.*brake"):
        rig.go(1)
    assert written(rig.frames) == []


def test_the_run_begins_after_disable(build, found):
    """`twin hil disable` brings it to rest with its ramp, then the run begins."""
    from hw_bridge.commission import SdoSession, power

    rig = found("faulhaber_v3", lambda drive: enabled(drive, 20))
    begin = Session.network

    def disabled(self):
        network = begin(self)
        line = SdoSession(SimulatedNetwork(self.bench.bus), dict(self.keys.nodes))
        assert power.disable(line, line.drive("servomotor")) is State.DISABLED
        line.network.close()
        return network

    Session.network, left = disabled, Session.network
    try:
        rig.go(20)
    finally:
        Session.network = left
    assert rig.drive.state is State.ENABLED
    assert Frame(cia301.SYNC) in rig.frames
