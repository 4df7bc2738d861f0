"""A node that restarts by itself, a module in a run or a drive that homes: the run ends before a target reaches it."""

import struct

import pytest

from hw_bridge.bus import MILLISECOND, Frame
from hw_bridge.dictionary import State
from hw_bridge.master import Master
from tests.hw_bridge.axis import Rig, node
from tests.hw_bridge.master.test_nmt_stop import frames_of_targets, moving, restart_operational
from twin.errors import SimulationError

LIMITS = {"position": ["-45 mm", "45 mm"], "velocity": "200 mm/s", "force": "8 N", "following_error": "3 mm"}
RESTARTED = r"started anew by itself"


def answers_of_its_own(rig, station, *frames):
    """Process data that a node sends at each SYNC by the mapping of its power-on."""
    bus = rig.session.bench.bus

    def answer(_, frame):
        if frame.id == 0x80 and not frame.data:
            for sent in frames:
                station.port.send(sent)

    bus.observers.append(answer)


@pytest.mark.parametrize("operational", [False, True])
@pytest.mark.parametrize("answers", [False, True])
def test_a_module_in_a_run(build, operational, answers):
    more = {"modules": {"valves": {"node": 9, "outputs": {0: "sequencer.valve[1]"}, "safe_outputs": 0}}}
    rig = Rig(build, {"servomotor": node()}, **more)
    switch = rig.hardware._module("valves", "")()
    switch.start()
    rig.axes["valves"] = switch
    rig.go(50)
    module = rig.session.bench.modules["valves"]
    frames = frames_of_targets(rig.session.bench.bus, 9)
    if answers:
        answers_of_its_own(rig, module, Frame(0x189, b"\0"))
    if operational:
        restart_operational(module)
    else:
        module.nmt.boot_time = MILLISECOND
        module.restart()
    with pytest.raises(SimulationError, match=r"valves: (started anew by itself|two nodes have)"):
        rig.go(300)
    assert len(frames) <= 1


def test_a_drive_that_homes(build, monkeypatch):
    search = {"method": -3, "at": "-40 mm", "speed": "10 mm/s"}
    rig = Rig(build, {"servomotor": node(limits={**LIMITS, "acceleration": "3 m/s^2"}, homing=search)})
    plain, frames = Master.wait, []

    def wait(master, duration, *arguments):
        plain(master, duration, *arguments)
        drive = master.nodes["servomotor"]
        if drive.homing and drive.state is State.ENABLED and not frames:
            restart_operational(rig.drive)
            frames.append(frames_of_targets(rig.session.bench.bus, rig.drive.node))

    monkeypatch.setattr(Master, "wait", wait)
    with pytest.raises(SimulationError, match=RESTARTED):
        rig.go(1)
    assert len(frames[0]) <= 2, "of the cycle in which it boots"
    assert rig.drive.state is State.DISABLED


def test_process_data_of_a_restarted_drive_that_look_like_a_speed_do_not_delay_the_stop(build):
    """By the mapping of its power-on TPDO 2 may have as many bytes as a speed and a current."""
    rig = moving(build, "faulhaber_v3")
    drive, master = rig.drive, rig.master
    own = master.nodes["servomotor"]
    restart_operational(drive)
    state = struct.pack("<H", 0x250).ljust(own._state.size, b"\0")
    answers_of_its_own(
        rig, drive, Frame(0x180 + drive.node, state), Frame(0x280 + drive.node, b"\x0f" * own._speed.size)
    )
    stop, times = master.stop, []

    def timed():
        begin = rig.session.bench.bus.now
        stop()
        times.append(rig.session.bench.bus.now - begin)

    master.stop = timed
    with pytest.raises(SimulationError, match=r"two nodes have node-ID 1"):
        rig.go(100)
    assert times[0] < 500 * MILLISECOND
