"""The bridge and drives in processes of their own: killed without warning, and in real time for some seconds."""

import json
import signal
import subprocess
import sys
import time
from contextlib import suppress

import pytest

from benchmarks import hil
from hw_bridge.bus import never
from hw_bridge.dictionary import State, state_of
from hw_bridge.master import SdoClient
from hw_bridge.wire import WireNetwork
from tests.hw_bridge import program
from tests.hw_bridge.multicast import needed, own

LOST_AFTER = 0.1  # [s], of the bench that `hil` writes
HEARTBEAT, EMERGENCY = 0x77F, 0x081
pytestmark = [
    pytest.mark.slow,
    pytest.mark.real_time,
    pytest.mark.skipif(sys.platform != "linux", reason="pseudo-terminals, multicast"),
]


@pytest.fixture
def channel():
    """A multicast group of this test alone."""
    return needed(own(75), port=hil.PORT)


@pytest.mark.parametrize("profile", ["faulhaber_v3", "mclm"])
def test_the_drive_stops_when_the_program_is_killed(channel, profile, tmp_path, build):
    """SIGKILL: no handler runs, only the heartbeat is missing."""
    heard = []
    with hil.drive(profile, "udp_multicast", channel, build):
        line = hil.run_line(hil.bench(tmp_path, profile, "udp_multicast", channel), 20.0, tmp_path / "runs", build)
        process = program.begun(line, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        network = WireNetwork("udp_multicast", channel, 1_000_000, hil.options("udp_multicast"))
        try:
            network.hear = lambda frame: heard.append((time.monotonic(), frame))
            network.advance(network.now + 60_000_000_000, lambda: len(syncs(heard)) > 400)
            program.send(process, signal.SIGKILL)
            process.wait()
            killed = time.monotonic()
            network.advance(network.now + 500_000_000, never)
            assert len(syncs(heard)) > 400
            beats = [at for at, frame in heard if frame.id == HEARTBEAT]
            told = [
                at for at, frame in heard if frame.id == EMERGENCY and frame.data[:2] == b"\x30\x81" and at > beats[-1]
            ]
            assert told, "no EMCY 8130h"
            # on a machine that others use too
            assert LOST_AFTER - 0.02 < told[0] - beats[-1] < LOST_AFTER + 0.05
            assert beats[-1] < killed + 0.01
            assert state(network, heard) not in (State.ENABLED, State.SWITCHED_ON)
        finally:
            process.kill()
            network.close()


def test_the_process_that_simulates_stops_the_drive_when_its_parent_is_killed(channel, tmp_path, build):
    heard = []
    with hil.drive("faulhaber_v3", "udp_multicast", channel, build):
        line = hil.run_line(
            hil.bench(tmp_path, "faulhaber_v3", "udp_multicast", channel), 20.0, tmp_path / "runs", build
        )
        process = program.begun(line, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        network = WireNetwork("udp_multicast", channel, 1_000_000, hil.options("udp_multicast"))
        try:
            network.hear = lambda frame: heard.append((time.monotonic(), frame))
            network.advance(network.now + 60_000_000_000, lambda: len(syncs(heard)) > 400)
            process.send_signal(signal.SIGKILL)
            process.wait()
            network.advance(network.now + 500_000_000, never)
            assert not [frame for _, frame in heard if frame.id == EMERGENCY and frame.data[:2] == b"\x30\x81"]
            assert state(network, heard) is State.DISABLED
        finally:
            with suppress(ProcessLookupError):
                program.send(process, signal.SIGKILL)
            network.close()


def test_ctrl_c_leaves_the_drive_disabled(channel, tmp_path, build):
    heard = []
    with hil.drive("faulhaber_v3", "udp_multicast", channel, build):
        line = hil.run_line(
            hil.bench(tmp_path, "faulhaber_v3", "udp_multicast", channel), 20.0, tmp_path / "runs", build
        )
        process = subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        network = WireNetwork("udp_multicast", channel, 1_000_000, hil.options("udp_multicast"))
        try:
            network.hear = lambda frame: heard.append((time.monotonic(), frame))
            network.advance(network.now + 60_000_000_000, lambda: len(syncs(heard)) > 300)
            process.send_signal(signal.SIGINT)
            network.advance(network.now + 15_000_000_000, lambda: process.poll() is not None)
            assert process.wait(10) == 130, process.stderr.read()
            network.advance(network.now + 300_000_000, never)
            assert state(network, heard) is State.DISABLED
            assert not [frame for _, frame in heard if frame.id == EMERGENCY and frame.data[:2] == b"\x30\x81"]
        finally:
            process.kill()
            process.communicate()
            network.close()


def syncs(heard):
    return [at for at, frame in heard if frame.id == 0x080]


def state(network, heard):
    client = SdoClient(1, network.send, lambda duration, done: network.advance(network.now + duration, done))
    network.hear = lambda frame: client.process_frame(frame.data) if frame.id == 0x581 else heard.append((0.0, frame))
    return state_of(int.from_bytes(client.read(0x6041), "little"))


@pytest.mark.parametrize("interface", ["udp_multicast", "slcan"])
def test_the_force_scenario_in_real_time(request, interface, tmp_path, build):
    """Four seconds of it; the machine that tests may be busy, so only what is lost counts."""
    channel = request.getfixturevalue("channel") if interface == "udp_multicast" else ""
    summary = hil.measure(interface, channel, 4.0, tmp_path, build)
    assert summary["status"] == "completed", summary["reason"]
    (case,) = summary["hardware"]["cases"]
    assert case["cycles"] == 800
    assert case["nodes"]["servomotor"]["lost_pdos"] == 0
    assert case["jitter_median"] < 2e-3
    assert json.dumps(summary)
