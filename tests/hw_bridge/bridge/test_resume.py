"""After a fault and `twin hil reset` a run goes on: without a homing where the reference is proven, and it says what to do next."""

import signal
import subprocess
import sys

import can
import pytest
from click.testing import CliRunner

from benchmarks import hil as benchmark
from hw_bridge.command import hil
from hw_bridge.command.control import request
from hw_bridge.dictionary import Mode
from hw_bridge.fault import Cause, Fault
from tests.hw_bridge import program
from tests.hw_bridge.axis import with_units
from tests.hw_bridge.multicast import needed, own

SCENARIO = """
title: to and fro
stop_time: {seconds} s
step: 1 ms
members:
  command: {{component: travel_command, parameters: {{distance: 2 mm, speed: 5 mm/s, acceleration: 0.1 m/s^2}}}}
  servomotor: {{component: servomotor, parameters: {{mode_of_operation: 8}}}}
connections:
  - command.reference_position -> servomotor.target_position
"""
BENCH = """
interface: udp_multicast
channel: {channel}
options: {{port: {port}}}
cycle: 10 ms
late_cycle: {{at_most: 200 ms}}
nodes:
  servomotor: {{node: 1, profile: {profile}, heartbeat: {{every: 20 ms, lost_after: 300 ms}}, {more}}}
"""
MORE = {
    "faulhaber_v3": "scale: 1, homing: {method: -3, at: -40 mm, speed: 40 mm/s}",
    "mclm": "scale: 1, motor: lm2070, homing: {method: 17, at: -20 mm, speed: 40 mm/s}",
    "epos4": "scale: 1.5915e-3, homing: {method: 37, at: 0 mm, speed: 10 mm/s}, "
    "limits: {force: 250 N, velocity: 50 mm/s, following_error: 3 mm}",
}
HEAT = {"faulhaber_v3": 0x4310, "mclm": 0x4310, "epos4": 0x4210}  # a fault that loses no position
SENSOR = {"faulhaber_v3": 0x7300, "epos4": 0x7320}
HOMING = bytes([Mode.HM])
pytestmark = [
    pytest.mark.slow,
    pytest.mark.real_time,
    pytest.mark.skipif(sys.platform != "linux", reason="multicast"),
]


class Rig:
    """A drive process, its bench, and runs on it."""

    def __init__(self, profile, channel, process, folder, build):
        self.profile, self.process, self.folder, self.build = profile, process, folder, build
        self.bench = folder / "bench.yaml"
        self.bench.write_text(
            BENCH.format(channel=channel, port=benchmark.PORT, profile=with_units(profile), more=MORE[profile])
        )
        self.bus = can.Bus(channel=channel, interface="udp_multicast", port=benchmark.PORT)

    def started(self, seconds):
        (self.folder / "scenario.yaml").write_text(SCENARIO.format(seconds=seconds))
        words = [
            "run",
            self.folder / "scenario.yaml",
            "--hardware",
            self.bench,
            "--no-report",
            "--arm",
            "--runs",
            self.folder / "runs",
            "--build",
            self.build,
        ]
        line = [sys.executable, "-c", "from twin.cli import main; main()", *map(str, words)]
        return program.begun(line, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)

    def ended(self, process, act=None, after=0):
        """Exit code, what it told (on one line), and whether it homed. `act` after so many cycles in csp."""
        homed, cycles = False, 0
        while process.poll() is None:
            message = self.bus.recv(0.05)
            if message is not None and message.arbitration_id == 0x301:  # controlword, mode, velocity
                homed |= message.data[2:3] == HOMING
                cycles += message.data[:2] in (b"\x0f\x00", b"\x3f\x00") and message.data[2] != Mode.HM
                if act is not None and cycles > after:
                    act()
                    act = None
        assert act is None, process.communicate()[0]
        return process.returncode, " ".join(process.communicate()[0].split()), homed

    def reset(self):
        done = CliRunner().invoke(hil.command, ["reset", "-f", str(self.bench), "--build", str(self.build)])
        assert done.exit_code == 0, f"{done.output}\n{done.exception}"

    def fails_with(self, code):
        failure = self.started(20), lambda: request(self.process.port, Fault(Cause.EMCY, code)), 250
        return self.ended(*failure)


@pytest.fixture
def make(tmp_path, build, monkeypatch):
    monkeypatch.setenv("TWIN_STATE", str(tmp_path / "state"))
    rigs = []

    def made(profile):
        channel = needed(own(80), port=benchmark.PORT)
        more = ["--control", "0", "--switch", "negative=-20mm"] if profile == "mclm" else ["--control", "0"]
        context = benchmark.drive(profile, "udp_multicast", channel, build, more=more)
        rigs.append((context, Rig(profile, channel, context.__enter__(), tmp_path, build)))
        return rigs[-1][1]

    yield made
    for context, rig in rigs:
        rig.bus.shutdown()
        context.__exit__(None, None, None)


@pytest.mark.parametrize("profile", ["faulhaber_v3", "mclm", "epos4"])
def test_a_run_after_a_fault_needs_no_new_homing(make, profile):
    rig = make(profile)
    code, told, homed = rig.fails_with(HEAT[profile])
    assert (code, homed) == (1, True), told
    assert (
        "next: remove the cause, reset with `twin hil reset -f FILE`, run again (not homed again: servomotor)." in told
    )
    rig.reset()
    code, told, homed = rig.ended(rig.started(1))
    assert (code, homed) == (0, False), told
    assert "servomotor: counts from the reference found before: not homed again." in told


@pytest.mark.parametrize("profile", ["faulhaber_v3", "epos4"])
def test_after_an_error_of_the_sensor_it_is_homed_again(make, profile):
    rig = make(profile)
    code, told, _ = rig.fails_with(SENSOR[profile])
    assert code == 1
    assert "run again (homed again: servomotor)." in told, told
    rig.reset()
    code, told, homed = rig.ended(rig.started(1))
    assert (code, homed) == (0, True), told


def test_a_drive_that_was_switched_off_is_homed_again(make):
    rig = make("faulhaber_v3")
    code, told, homed = rig.ended(rig.started(1))
    assert (code, homed) == (0, True), told
    request(rig.process.port, Fault(Cause.RESET))
    code, told, homed = rig.ended(rig.started(1))
    assert (code, homed) == (0, True), told


def test_a_run_that_is_killed_leaves_no_reference(make):
    rig = make("faulhaber_v3")
    process = rig.started(20)
    rig.ended(process, lambda: program.send(process, signal.SIGKILL), 250)
    assert not list((rig.folder / "state" / "references").glob("*.json"))
