"""Drives in processes of their own: `hil compare` with a dump from before has nothing to tell, however a run ends."""

import signal
import subprocess
import sys
import time

import pytest
from click.testing import CliRunner

from benchmarks import hil as benchmark
from hw_bridge.command import hil
from hw_bridge.command.control import request
from hw_bridge.fault import Cause, Fault
from hw_bridge.profiles import DRIVE_PROFILES
from hw_bridge.wire import WireNetwork
from tests.hw_bridge import program
from tests.hw_bridge.axis import with_units
from tests.hw_bridge.multicast import needed, own

SYNC = 0x080
BENCH = """
interface: udp_multicast
channel: {channel}
options: {{port: {port}}}
cycle: 10 ms
late_cycle: {{at_most: 200 ms}}  # a machine that tests share stalls
nodes:
  servomotor: {{node: 1, profile: {profile}, heartbeat: {{every: 20 ms, lost_after: 300 ms}}, {scale}}}
"""
SCENARIO = """
title: to and fro
stop_time: 20 s
step: 1 ms
members:
  command: {component: travel_command, parameters: {distance: 1 mm, speed: 5 mm/s, acceleration: 0.1 m/s^2}}
  servomotor: {component: servomotor, parameters: {mode_of_operation: 8}}
connections:
  - command.reference_position -> servomotor.target_position
"""
FAILING = """
members:
  failing: {component: "tests.run.pymunk_parts:Burns", parameters: {}}
"""
HEAT = {"faulhaber_v3": 0x4310, "mclm": 0x4310, "epos4": 0x4210, "epos2": 0x4210}  # a fault of the drive
MAPPED = bytes([0x2F, 0x01, 0x1A, 0x00])  # SDO: the number of objects of TPDO 2, late in a bringing-up
pytestmark = [
    pytest.mark.slow,
    pytest.mark.real_time,
    pytest.mark.skipif(sys.platform != "linux", reason="multicast"),
]


@pytest.fixture(params=DRIVE_PROFILES)
def rig(request, tmp_path, build, monkeypatch):
    """A drive process, its bench, a dump of it, and `twin hil` on it."""
    monkeypatch.setenv("TWIN_STATE", str(tmp_path / "state"))
    channel, profile = needed(own(76), port=benchmark.PORT), request.param
    with benchmark.drive(profile, "udp_multicast", channel, build, more=["--control", "0"]) as process:
        bench = tmp_path / "bench.yaml"
        scale = (
            "scale: 1.5915e-3, limits: {force: 250 N, velocity: 50 mm/s, following_error: 3 mm}"
            if profile.startswith("epos")
            else "scale: 1"
        )
        bench.write_text(BENCH.format(channel=channel, port=benchmark.PORT, profile=with_units(profile), scale=scale))

        def command(*words, code=0):
            done = CliRunner().invoke(hil.command, [*map(str, words), "-f", str(bench), "--build", str(build)])
            assert done.exit_code == code, f"{done.output}\n{done.exception}"
            return done.output

        command("dump", 1, tmp_path / "before.dcf")
        yield profile, channel, bench, command, process


def compared(command, folder):
    assert "all values equal" in command("compare", 1, folder / "before.dcf")


def until_syncs(channel, count, process, counted=lambda frame: frame.id == SYNC):
    """Wait for so many SYNCs on the bus, or other frames."""
    heard = []
    network = WireNetwork("udp_multicast", channel, 1_000_000, benchmark.options("udp_multicast"))
    try:
        network.hear = lambda frame: heard.append(counted(frame))
        network.advance(network.now + 60_000_000_000, lambda: sum(heard) > count or process.poll() is not None)
    finally:
        network.close()
    assert sum(heard) > count, process.communicate()


def started(rig, tmp_path, build, seconds=20.0, more="members:\n"):
    """A run of the scenario, with these members too."""
    _, _, bench, _, _ = rig
    (tmp_path / "scenario.yaml").write_text(SCENARIO.replace("members:\n", more.lstrip()))
    words = [
        "run",
        tmp_path / "scenario.yaml",
        "--hardware",
        bench,
        "--set",
        f"stop_time={seconds} s",
        "--no-report",
        "--runs",
        tmp_path / "runs",
        "--build",
        build,
    ]
    line = [sys.executable, "-c", "from twin.cli import main; main()", *map(str, words)]
    return program.begun(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


@pytest.mark.parametrize("syncs", [1, 100])
def test_after_kill_9_and_restore(rig, tmp_path, build, syncs):
    _, channel, _, command, _ = rig
    process = started(rig, tmp_path, build)
    until_syncs(channel, syncs, process)
    program.send(process, signal.SIGKILL)
    process.communicate()
    time.sleep(0.8)  # the drive misses the heartbeat
    command("store", 1, code=1)
    command("compare", 1, tmp_path / "before.dcf", code=1)
    assert "objects are as before the run, 0 are not" in command("restore")
    compared(command, tmp_path)
    assert "No run left anything to restore." in command("restore")


def test_after_ctrl_c(rig, tmp_path, build):
    _, channel, _, command, _ = rig
    process = started(rig, tmp_path, build)
    until_syncs(channel, 100, process)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=30)
    assert process.returncode == 130, (out, err)
    compared(command, tmp_path)


def test_after_a_whole_run(rig, tmp_path, build):
    _, _, _, command, _ = rig
    process = started(rig, tmp_path, build, 1.0)
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0, (out, err)
    assert b": a run writes " in err, (out, err)
    assert b"objects were changed for the run and are as before" in out, (out, err)
    compared(command, tmp_path)


def test_after_a_bringing_up_that_failed(rig, tmp_path, build):
    """A fault of the drive while it is set up: all mappings are written, and it is never enabled."""
    profile, channel, _, command, drive = rig
    process = started(rig, tmp_path, build)
    until_syncs(channel, 0, process, lambda frame: frame.id == 0x601 and frame.data[:4] == MAPPED)
    request(drive.port, Fault(Cause.EMCY, HEAT[profile], lasting=True))
    out, err = process.communicate(timeout=60)
    assert process.returncode == 1, (out, err)
    assert b"failed: base, seed 0" in err + out, (out, err)
    compared(command, tmp_path)
    assert "No run left anything to restore." in command("restore")


def test_after_an_exception_of_a_member(rig, tmp_path, build):
    """A member in Python raises after 0.3 s, while the drive moves."""
    _, _, _, command, _ = rig
    process = started(rig, tmp_path, build, more=FAILING)
    out, err = process.communicate(timeout=120)
    assert process.returncode == 1, (out, err)
    assert b"burnt" in err + out, (out, err)
    compared(command, tmp_path)
    assert "No run left anything to restore." in command("restore")
