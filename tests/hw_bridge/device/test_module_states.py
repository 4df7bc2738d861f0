"""A module for inputs and outputs alone on a bus: its states, and what its outputs do when something fails."""

import struct

import pytest

from hw_bridge.bus import MILLISECOND, Bus, Disturbance, Frame, Kind
from hw_bridge.bus.recorder import Recorder
from hw_bridge.device import Module
from hw_bridge.dictionary import NmtState
from hw_bridge.profiles import device
from tests.hw_bridge.device.test_module import MASTER, NODE


class Bench:
    """A module in Pre-operational and a master that sends what a test says."""

    def __init__(self):
        self.module, self.master, self.bus = Module(device("cia401"), NODE), Recorder(), Bus()
        self.bus.attach(self.module)
        self.bus.attach(self.master)
        self.go(110)

    def go(self, milliseconds):
        self.bus.advance(self.bus.now + milliseconds * MILLISECOND)

    def send(self, identifier, data=b""):
        self.master.send(Frame(identifier, bytes(data)))
        self.go(1)

    def write(self, index, sub, value, size=1):
        form = {1: (0x2F, "<BHBBxxx"), 2: (0x2B, "<BHBHxx"), 4: (0x23, "<BHBI")}[size]
        self.send(0x600 + NODE, struct.pack(form[1], form[0], index, sub, value))
        self.go(2)
        assert [frame.data[0] for frame in self.heard(0x580 + NODE)][-1] == 0x60

    def heard(self, identifier):
        return [frame for _, frame in self.master.received if frame.id == identifier]

    def codes(self):
        return [struct.unpack_from("<H", frame.data)[0] for frame in self.heard(0x80 + NODE)]


@pytest.fixture
def bench():
    """A module that watches node 127, writes half of its outputs' error bits, and is Operational."""
    bench = Bench()
    bench.write(0x6206, 1, 0x0F)
    bench.write(0x6207, 1, 0x0A)
    bench.write(0x1016, 1, MASTER << 16 | 50, 4)
    bench.send(0, [1, NODE])
    bench.send(0x700 + MASTER, [5])
    bench.send(0x200 + NODE, [0x55, 0, 0, 0])
    return bench


def test_outputs_follow_process_data(bench):
    assert bench.module.outputs == 0x55
    bench.send(0x200 + NODE, [1, 2, 3, 4])
    assert bench.module.outputs == 0x04030201


def test_inputs_are_told_when_they_change(bench):
    before = len(bench.heard(0x180 + NODE))
    bench.module.set_inputs(0x0102)
    bench.go(1)
    assert [frame.data for frame in bench.heard(0x180 + NODE)[before:]] == [bytes([2, 1, 0, 0])]


FAILURES = {
    "heartbeat lost": (lambda bench: bench.go(60), [0x8130]),
    "stopped": (lambda bench: bench.send(0, [2, NODE]), []),
    "bus off": (lambda bench: bench.bus.disturbances.append(Disturbance(Kind.CORRUPT, 0x189, 0x189, count=40)), None),
}


@pytest.mark.parametrize("which", FAILURES)
def test_a_failure_takes_the_error_values_where_the_mode_says_so(bench, which):
    event, codes = FAILURES[which]
    event(bench)
    if which == "bus off":
        bench.module.set_inputs(1)  # something to send
        bench.go(20)
        assert 0x8140 in bench.codes()
    else:
        assert bench.codes() == codes
    assert bench.module.outputs == 0x5A
    bench.send(0, [1, NODE])
    assert bench.module.outputs == 0x55


def test_a_lost_heartbeat_leaves_operational_and_process_data_acts_no_more(bench):
    bench.go(60)
    assert bench.module.port.state is NmtState.PRE_OPERATIONAL
    bench.send(0x200 + NODE, [0xFF, 0, 0, 0])
    assert bench.module.outputs == 0x5A
    assert bench.module.dictionary.get(0x1001) == 0x11
    bench.send(0, [1, NODE])
    assert bench.codes() == [0x8130, 0]


def test_pre_operational_by_command_keeps_outputs(bench):
    bench.send(0, [128, NODE])
    assert bench.module.outputs == 0x55


def test_a_reset_begins_anew(bench):
    bench.go(60)
    bench.send(0, [129, NODE])
    bench.go(110)
    assert (bench.module.outputs, bench.module.failed) == (0, False)
