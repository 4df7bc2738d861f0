"""A simulated drive in a process of its own, and a hardware file that names it."""

import subprocess
import sys
from contextlib import contextmanager
from types import SimpleNamespace

import pytest
from click.testing import CliRunner

from hw_bridge.command import hil
from hw_bridge.commission import SdoSession
from hw_bridge.wire import WireNetwork
from tests.hw_bridge.multicast import needed, own

BENCH = """
interface: udp_multicast
channel: {channel}
options: {{port: {port}}}
cycle: 10 ms
late_cycle: {{at_most: 200 ms}}  # a machine that tests share stalls
nodes:
  {name}:
    node: 1
    profile: {profile}
    units: {{acceleration: 1 mm/s^2}}
    limits: {{position: [-45 mm, 45 mm], velocity: 200 mm/s, force: 8 N, following_error: 3 mm, acceleration: 3 m/s^2}}
    homing: {{method: -3, at: -40 mm, speed: 50 mm/s}}
    heartbeat: {{every: 20 ms, lost_after: 300 ms}}
"""


@contextmanager
def drive_process(profile, build, port):
    """`twin drive` of a profile as node 1, on a port of its own."""
    channel = needed(own(74), port=port)
    words = ["-p", profile, "-n", "1", "-i", "udp_multicast", "-c", channel, "--option", f"port={port}"]
    line = [sys.executable, "-m", "hw_bridge.drive", *words, "--control", "0", "--build", str(build)]
    process = subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        told = process.stdout.readline()
        assert "node 1" in told, process.stderr.read()
        yield SimpleNamespace(channel=channel, port=port, process=process, control=told.partition("--control ")[2][:5])
    finally:
        process.terminate()
        process.communicate(timeout=20)


@contextmanager
def watching(drive):
    """The bus of a drive process, for a test that asks it beside the command."""
    network = WireNetwork("udp_multicast", drive.channel, 1_000_000, {"port": drive.port})
    try:
        yield SdoSession(network)
    finally:
        network.close()


@pytest.fixture(scope="module")
def hil_command(build):
    """Run `twin hil` in this process."""
    runner = CliRunner()

    def run(*words, code=0):
        done = runner.invoke(hil.command, [*map(str, words), "--build", str(build)])
        assert done.exit_code == code, f"{done.output}\n{done.exception}"
        return done.output if done.exception is None or code == 0 else f"{done.output}{done.exception}"

    return run
