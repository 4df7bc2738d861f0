"""`twin drive --switch`: limit switches, home switch and touch probes of a drive that is a process of its own."""

import struct
import sys
import time

import can
import pytest
from click.testing import CliRunner

from benchmarks import hil as benchmark
from hw_bridge.command import hil
from hw_bridge.command.drive import command
from hw_bridge.command.switches import parse_switches
from tests.every_case import every_case
from tests.hw_bridge.multicast import needed, own
from tests.hw_bridge.waiting import wait_for_boot, wait_for_frame

NODE = 1
HOMED, FAILED = 0x1000, 0x2000
# 19 to 22 search in one direction: each begins on its own side. Of 3 to 14 the index lies behind the limit switches of this bench
METHODS = [1, 17, 19, 17, 20, 18, 21, 18, 22, 2, *range(23, 31)]


def test_places_have_units():
    switches = parse_switches(["negative=-35mm", "positive=3.5 cm", "home=4mm:6mm", "probe2=0:1mm"], "m")
    assert (switches.negative, switches.positive) == (-0.035, 0.035)
    assert switches.home == (0.004, 0.006)
    assert switches.probes == (None, (0.0, 0.001))
    assert parse_switches(["positive=180deg"], "rad").positive == pytest.approx(3.14159, abs=1e-5)
    assert parse_switches([], "m").closed(0.0) == (False, False, False)


@every_case(
    ("words", "told"),
    [
        (["negative=1"], "1 has no unit"),
        (["negative"], "expected NAME=PLACE, such as positive=35mm"),
        (["negatve=1mm"], "Did you mean 'negative'"),
        (["home=1mm"], "expected NAME=PLACE"),
        (["home=2mm:1mm"], "the lower end comes first"),
        (["positive=1mm", "positive=2mm"], "named twice"),
        (["positive=1deg"], "does not convert to m"),
        (["negative=2mm", "positive=1mm"], "Exchange them"),
    ],
)
def test_what_is_wrong_is_told_in_one_line(words, told):
    line = ["-p", "mclm", "-i", "virtual", "-c", "x", *(part for word in words for part in ("--switch", word))]
    done = CliRunner().invoke(command, line)
    assert done.exit_code == 2
    assert told in done.output.splitlines()[-1]


def test_a_module_has_no_switches_and_no_node_has_128():
    line = ["-p", "cia401", "-i", "virtual", "-c", "x"]
    assert "has no motor" in CliRunner().invoke(command, [*line, "--switch", "home=1mm:2mm"]).output
    assert "255 for a device without a node-ID" in CliRunner().invoke(command, [*line, "-n", "128"]).output


class Client:
    """SDO and controlword on a bus of another process."""

    def __init__(self, bus):
        self.bus = bus

    def write(self, index, value, size, sub=0):
        data = struct.pack("<BHB", 0x23 | (4 - size) << 2, index, sub) + value.to_bytes(4, "little", signed=value < 0)
        self._ask(data)

    def read(self, index):
        answer = self._ask(struct.pack("<BHB4x", 0x40, index, 0))
        size = 4 - (answer[0] >> 2 & 3)
        return int.from_bytes(answer[4 : 4 + size], "little", signed=index in (0x6064, 0x606C))

    def _ask(self, data):
        self.bus.send(can.Message(arbitration_id=0x600 + NODE, data=data, is_extended_id=False))
        answer = bytes(wait_for_frame(self.bus, 0x580 + NODE).data)
        assert answer[0] != 0x80, answer.hex(" ")
        return answer

    def until(self, condition, timeout=30.0):
        end = time.monotonic() + timeout
        while not condition(self.read(0x6041)):
            assert time.monotonic() < end, f"{self.read(0x6041):04X}h at {self.read(0x6064)}"
            time.sleep(0.02)


@pytest.fixture
def channel():
    return needed(own(79), port=benchmark.PORT)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="multicast")
def test_homing_and_limit_switches_of_a_process(build, channel):
    """Methods 1, 2, 17 to 30 home one after the other; then pv stops at the limit switch, and the way back is free."""
    switches = ["--switch", "negative=-10mm", "--switch", "positive=12mm", "--switch", "home=4mm:6mm"]
    with (
        benchmark.drive("faulhaber_v3", "udp_multicast", channel, build, NODE, switches),
        can.Bus(channel=channel, interface="udp_multicast", port=benchmark.PORT) as bus,
    ):
        wait_for_boot(bus, NODE)
        client = Client(bus)
        for word in (0x06, 0x07, 0x0F):
            client.write(0x6040, word, 2)
        for method in METHODS:
            client.write(0x6060, 6, 1)
            client.write(0x6098, method, 1)
            client.write(0x6040, 0x1F, 2)
            client.until(lambda word: word & (HOMED | FAILED))
            assert not client.read(0x6041) & FAILED, method
            client.write(0x6040, 0x0F, 2)
        client.write(0x6060, 3, 1)
        client.write(0x60FF, 20, 4)
        client.until(lambda word: word & 0x0800)  # internal limit
        time.sleep(0.3)
        assert client.read(0x60FD) & 7 == 2
        assert abs(client.read(0x606C)) <= 1
        place = client.read(0x6064)
        client.write(0x60FF, 0x1_0000_0000 - 20, 4)
        client.until(lambda word: not word & 0x0800)
        time.sleep(0.3)
        assert client.read(0x6064) < place - 2000


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="multicast")
def test_hil_home_finds_a_limit_switch(build, channel, tmp_path, monkeypatch):
    """The command that a person types, on a drive with switches."""
    monkeypatch.setenv("TWIN_STATE", str(tmp_path / "state"))
    bench = tmp_path / "bench.yaml"
    bench.write_text(
        f"interface: udp_multicast\nchannel: {channel}\noptions: {{port: {benchmark.PORT}}}\ncycle: 10 ms\n"
        "late_cycle: {at_most: 200 ms}\nnodes:\n  servomotor: {node: 1, profile: mclm, motor: lm2070, scale: 1, "
        "heartbeat: {every: 20 ms, lost_after: 300 ms}, homing: {method: 17, at: -20 mm, speed: 20 mm/s}, "
        "limits: {position: [-19 mm, 19 mm], velocity: 100 mm/s}}\n"
    )
    with benchmark.drive("mclm", "udp_multicast", channel, build, NODE, ["--switch", "negative=-20mm"]):
        done = CliRunner().invoke(hil.command, ["home", "1", "-f", str(bench), "--build", str(build)])
        assert done.exit_code == 0, f"{done.output}\n{done.exception}"
        assert "-19 mm" in done.output or "-19.0" in done.output
