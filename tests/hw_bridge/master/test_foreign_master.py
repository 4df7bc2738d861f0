"""A second master on the bus is noticed and named, whatever its node-ID; who only looks on is not one."""

import struct

import pytest

from hw_bridge.bus import Frame, SimulatedNetwork
from hw_bridge.dictionary import State
from tests.hw_bridge.axis import Rig, node
from tests.hw_bridge.bridge.test_bridge_safety import stopped
from twin.errors import SimulationError


@pytest.fixture
def rig(build):
    """An axis that moves, and another program on its bus."""
    rig = Rig(build, {"servomotor": node()})
    rig.set(target_velocity=0.05)
    rig.go(200)
    rig.other = SimulatedNetwork(rig.session.bench.bus)
    return rig


def write(index, sub, value):
    return Frame(0x601, struct.pack("<BHBI", 0x23, index, sub, value))


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    ("frames", "text"),
    [
        ([write(0x1016, 1, 126 << 16 | 60)], r"writes 1016h\.1 of servomotor"),
        ([Frame(0x201, struct.pack("<i", 0))], "sends servomotor targets"),
        ([Frame(0x301, struct.pack("<Hbi", 0x0F, 9, 10))], "sends servomotor targets"),
        ([Frame(0x000, bytes([128, 1]))], "sent NMT command 80h to servomotor"),
        ([Frame(0x000, bytes([1, 0]))], "sent NMT command 01h to all nodes"),
        ([Frame(0x080)], "sent SYNC"),
        ([Frame(0x77F, b"\5")], "node 127: another master tells that it lives on this ID"),
    ],
)
def test_another_master_takes_over_a_moving_drive(rig, frames, text):
    rig.other.send(Frame(0x700 + 126, b"\5"))  # it lives under another node-ID
    for frame in frames:
        rig.other.send(frame)
    with pytest.raises(
        SimulationError, match=rf"{text}.* It may be node 126, not in the hardware file\. All drives stop"
    ):
        rig.go(20)
    assert stopped(rig.drive)
    assert any("126" in note and "can enable the drives again" in note for note in rig.session.outcome.notes)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    "frame",
    [
        Frame(0x601, struct.pack("<BHB4x", 0x40, 0x6064, 0)),  # a vendor's program that reads
        Frame(0x000, bytes([1, 9])),
        Frame(0x609, bytes([0x2B, 0x40, 0x60, 0, 6, 0, 0, 0])),  # another node's
        Frame(0x700 + 9, b"\5"),
    ],
)
def test_who_looks_on_does_not_stop_anything(rig, frame):
    rig.other.send(frame)
    rig.go(100)
    assert rig.drive.state is State.ENABLED


def test_another_master_before_the_start(build, monkeypatch):
    from hw_bridge.session import Session

    begin = Session.network

    def crowded(self):
        made = begin(self)
        SimulatedNetwork(self.bench.bus).send(Frame(0x080))
        return made

    monkeypatch.setattr(Session, "network", crowded)
    rig = Rig(build, {"servomotor": node()})
    with pytest.raises(SimulationError, match="another master on the bus sent SYNC"):
        rig.go(1)
    assert rig.drive.state is State.DISABLED
