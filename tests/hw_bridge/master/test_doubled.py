"""Two nodes with one node-ID are told as such, before a run and where the second comes while it goes on."""

import struct

import pytest

from hw_bridge.bus import MILLISECOND, Frame
from hw_bridge.bus.recorder import Recorder
from hw_bridge.device import Drive, Module, Motor
from hw_bridge.dictionary import State
from hw_bridge.master.sdo import SdoClient
from hw_bridge.profiles import device, profile
from hw_bridge.session import Session
from tests.hw_bridge.axis import Rig, node
from twin.errors import SimulationError

TOLD = r"servomotor: two nodes have node-ID 1\. Take one off the bus"


def second(build, name="faulhaber_v3", number=1):
    chosen = profile(name)
    return Drive(chosen, number, Motor(chosen.motor, build=build))


@pytest.mark.parametrize("other", ["faulhaber_v3", "epos4"])
def test_before_a_run(build, monkeypatch, other):
    begin = Session.network

    def crowded(self):
        made = begin(self)
        self.bench.bus.attach(second(build, other))
        return made

    monkeypatch.setattr(Session, "network", crowded)
    rig = Rig(build, {"servomotor": node()})
    with pytest.raises(SimulationError, match=TOLD):
        rig.go(1)
    assert rig.drive.state is State.DISABLED
    assert rig.drive.dictionary.get(0x1017) == 0, "nothing was written"


@pytest.mark.slow
@pytest.mark.parametrize("other", ["faulhaber_v3", "epos4"])
@pytest.mark.parametrize("phase", [0, 1, 4])
def test_a_second_one_is_switched_on_while_it_runs(build, other, phase):
    rig = Rig(build, {"servomotor": node()})
    rig.set(target_velocity=0.02)
    rig.go(100 + phase)
    late = second(build, other)
    late.advance(rig.session.bench.bus.now)
    late.restart()
    rig.session.bench.bus.attach(late)
    with pytest.raises(SimulationError, match=TOLD):
        rig.go(300)
    assert rig.drive.state is State.DISABLED
    assert late.state is not State.ENABLED
    rig.session.bench.bus.advance(rig.session.bench.bus.now + 200 * MILLISECOND)
    assert abs(rig.drive.axis.velocity) < 1e-3


def test_one_that_starts_anew_is_told_as_such(build):
    rig = Rig(
        build,
        {"servomotor": node(heartbeat={"every": "20 ms", "lost_after": "400 ms"})},
        late_cycle={"at_most": "300 ms"},
    )
    rig.go(100)
    rig.drive.restart()
    with pytest.raises(SimulationError, match=r"servomotor: started anew by itself\. Check its supply"):
        rig.go(300)


@pytest.mark.slow
def test_a_module(build):
    more = {"modules": {"valves": {"node": 9, "outputs": {0: "sequencer.valve[1]"}, "safe_outputs": 0}}}
    rig = Rig(build, {"servomotor": node()}, **more)
    switch = rig.hardware._module("valves", "")()
    switch.start()
    rig.axes["valves"] = switch
    rig.go(50)
    late = Module(device("cia401"), 9)
    late.advance(rig.session.bench.bus.now)
    late.restart()
    rig.session.bench.bus.attach(late)
    with pytest.raises(SimulationError, match=r"valves: two nodes have node-ID 9"):
        rig.go(300)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["faulhaber_v3", "mclm", "epos4", "epos2"])
def test_another_program_that_reads_is_no_second_node(build, name):
    """Its answers have the same identifier, also those of the object that this program read last."""
    rig = Rig(build, {"servomotor": node(name, number=21, **({"scale": 1.5e-3} if "epos" in name else {}))})
    rig.go(60)
    reader = Recorder()
    rig.session.bench.bus.attach(reader)
    for entry in rig.drive.dictionary.entries():
        reader.send(Frame(0x600 + 21, struct.pack("<BHB4x", 0x40, entry.index, entry.sub)))
        rig.go(2)
    assert rig.drive.state is State.ENABLED
    assert sum(frame.id == 0x580 + 21 for _, frame in reader.received) > 50
    rig.session.close()


@pytest.mark.parametrize("foreign", [[], [0x6041, 0x6064]], ids=["alone", "beside a program that asks the same"])
def test_two_answers_to_one_request(foreign):
    """Answers that another program has asked for arrive late: after its next requests, and after the own request."""
    answer = struct.pack("<BHBI", 0x43, 0x6041, 0, 0x250)
    client = SdoClient(1, lambda _: None, lambda *_: [client.process_frame(answer) for _ in range(2)])
    for index in foreign:
        client.process_foreign_request(struct.pack("<BHB4x", 0x40, index, 0))
    client.read(0x6041)
    assert client.doubled == (not foreign)
