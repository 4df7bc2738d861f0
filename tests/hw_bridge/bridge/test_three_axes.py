"""The whole rig on three drives in processes of their own: in real time, and what each death leaves behind."""

import json
import os
import signal
import sys
import time

import can
import pytest

from benchmarks import hil
from hw_bridge.bus import never
from hw_bridge.command.control import request
from hw_bridge.dictionary import State, state_of
from hw_bridge.fault import Cause, Fault
from hw_bridge.master import SdoClient
from hw_bridge.wire.adapter import to_message
from tests.hw_bridge import program
from tests.hw_bridge.multicast import needed

LOST_AFTER = 0.1  # [s], of the project's bench
SYNC, HEARTBEAT, EMERGENCIES = 0x080, 0x77F, (0x081, 0x082, 0x083)
CYCLES = 600  # until something happens: homing is over, the carriages move
pytestmark = [
    pytest.mark.slow,
    pytest.mark.real_time,
    pytest.mark.skipif(sys.platform != "linux", reason="pseudo-terminals, multicast"),
]


@pytest.fixture
def port(monkeypatch):
    """A port of this test alone: groups of one port are not kept apart on one machine."""
    monkeypatch.setattr(hil, "PORT", 44000 + os.getpid() % 10000)
    needed(hil.GROUP, port=hil.PORT)
    return hil.PORT


class Scene:
    """Three drives, the program that moves them, and somebody who listens."""

    def __init__(self, folder, build, port, drives):
        self.folder, self.drives = folder, drives
        self.heard = []
        bench = hil.rig_bench(folder, "udp_multicast", hil.GROUP, cycle="10 ms")
        line = hil.rig_line(bench, 60.0, folder / "runs", build)
        self.bus = can.Bus(channel=hil.GROUP, interface="udp_multicast", port=port)
        self.syncs, self.client = 0, None
        self.output = (folder / "output.txt").open("w+")
        self.notes = (folder / "notes.txt").open("w")
        self.program = program.begun(line, stdout=self.output, stderr=self.notes, text=True)

    def listen(self, seconds, done=never):
        """Hear messages, with the time when they reached this machine."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0 and not done():
            message = self.bus.recv(min(left, 0.05))
            if message is None:
                continue
            self.heard.append(message)
            self.syncs += message.arbitration_id == SYNC
            if self.client is not None and message.arbitration_id == 0x580 + self.client.node:
                self.client.process_frame(bytes(message.data))

    def until_it_runs(self):
        """The last homing is over and the scenario runs."""
        self.listen(60.0, lambda: self.syncs > CYCLES or self.program.poll() is not None)
        assert self.program.poll() is None, self.summary()["reason"]

    def told(self, code):
        """When each drive told an EMCY, by identifier."""
        data = code.to_bytes(2, "little")
        return {
            one.arbitration_id: one.timestamp
            for one in self.heard
            if one.arbitration_id in EMERGENCIES and one.data[:2] == data
        }

    def end(self):
        """Its exit code, in bounded time."""
        self.listen(30.0, lambda: self.program.poll() is not None)
        return self.program.poll()

    def said(self):
        """What it printed: its summary, as JSON."""
        self.output.seek(0)
        return self.output.read()

    def summary(self):
        return json.loads(self.said())

    def ask(self, node, index, sub=0):
        self.client = SdoClient(
            node,
            lambda frame: self.bus.send(to_message(frame)),
            lambda duration, done: self.listen(duration / 1e9, done),
        )
        return int.from_bytes(self.client.read(index, sub), "little")

    def states(self, nodes=(1, 2, 3)):
        return [state_of(self.ask(node, 0x6041)) for node in nodes]

    def valves(self, nodes=(1, 2)):
        return [self.ask(node, 0x60FE, 1) for node in nodes]

    def close(self):
        self.program.kill()
        self.program.wait()
        self.bus.shutdown()
        self.output.close()
        self.notes.close()


@pytest.fixture
def scene(port, tmp_path, build):
    with hil.drives(hil.RIG_DRIVES, "udp_multicast", [hil.GROUP] * 3, build, ["--control", "0"]) as drives:
        scene = Scene(tmp_path, build, port, drives)
        try:
            scene.until_it_runs()
            yield scene
        finally:
            scene.close()


def test_the_program_is_killed(scene):
    """Each drive stops by itself within its time."""
    program.send(scene.program, signal.SIGKILL)
    scene.program.wait()
    scene.listen(0.6)
    last = max(one.timestamp for one in scene.heard if one.arbitration_id == HEARTBEAT)
    told = scene.told(0x8130)
    assert set(told) == set(EMERGENCIES)
    # on a machine that others use too
    assert all(LOST_AFTER - 0.01 < at - last < LOST_AFTER + 0.1 for at in told.values())
    assert not {State.ENABLED, State.SWITCHED_ON} & set(scene.states())


def test_one_drive_is_killed(scene):
    """The others are stopped, their valves safe; the report tells who was lost and what was seen."""
    scene.drives[1].kill()
    assert scene.end() == 1
    assert scene.states((1, 3)) == [State.DISABLED] * 2
    assert scene.valves((1,)) == [1]
    summary = scene.summary()
    assert summary["status"] == "failed"
    assert (
        "servomotor_2: no heartbeat for" in summary["reason"]
        or "servomotor_2: no process data for" in summary["reason"]
    )
    assert any("servomotor_2: did not confirm that it is disabled" in note for note in summary["notes"])
    assert any(
        "servomotor_1" in line and "Switch on disabled" in line for line in summary["hardware"]["cases"][0]["seen"]
    )


def test_ctrl_c(scene):
    scene.program.send_signal(signal.SIGINT)
    assert scene.end() == 130
    assert scene.states() == [State.DISABLED] * 3
    assert scene.valves() == [1, 1]
    assert not scene.told(0x8130)
    assert scene.summary()["status"] == "interrupted"


def test_the_program_stands_for_a_second(scene):
    """Drives have stopped by then; the program notices and does not go on."""
    program.send(scene.program, signal.SIGSTOP)
    scene.listen(1.0)
    assert set(scene.told(0x8130)) == set(EMERGENCIES)
    program.send(scene.program, signal.SIGCONT)
    assert scene.end() == 1
    assert "8130h" in scene.summary()["reason"]
    assert not {State.ENABLED, State.SWITCHED_ON, State.QUICK_STOP} & set(scene.states())
    assert scene.valves() == [1, 1]


def test_a_drive_starts_anew(scene):
    request(scene.drives[2].port, Fault(Cause.RESET))
    assert scene.end() == 1
    assert "Last log: rotation: " in scene.summary()["reason"]
    assert scene.states() == [State.DISABLED] * 3
    assert scene.valves() == [1, 1]


@pytest.mark.parametrize(
    ("profiles", "stroke"),
    [
        (hil.RIG_DRIVES, 50),
        (("mclm", "faulhaber_v3", "epos4"), 35),  # without homing it begins in the middle of its way
    ],
    ids=("faulhaber_v3", "mclm"),
)
def test_the_rig_in_real_time(port, profiles, stroke, tmp_path, build):
    """Eight seconds of it; the machine that tests may be busy, so only what is lost counts."""
    summary = hil.measure_rig("udp_multicast", hil.GROUP, 8.0, tmp_path, build, profiles, "10 ms", stroke)
    assert summary["status"] == "completed", summary["reason"]
    (case,) = summary["hardware"]["cases"]
    assert case["cycles"] == 800
    assert all(node["lost_pdos"] == 0 for node in case["nodes"].values())
    assert {one["verdict"] for one in summary["expectations"]} == {"pass"}
