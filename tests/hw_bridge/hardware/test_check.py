"""`twin hil check`: what differs between a hardware file and its bus."""

import pytest
from click.testing import CliRunner

from hw_bridge.command import hil
from hw_bridge.device import Drive, Motor
from hw_bridge.hardware import file as hardware
from hw_bridge.profiles import profile
from tests.hw_bridge.hardware.test_hardware_file import GOOD


def test_check_says_what_differs(write, build):
    runner = CliRunner()
    done = runner.invoke(hil.command, ["check", "-f", str(write(GOOD)), "--build", str(build)])
    assert done.exit_code == 0, done.output
    assert done.stdout.startswith("node 1: FAULHABER Motion Control V3.0, vendor 147h")
    keys = hardware.load(write(GOOD.replace("node: 1", "node: 1, serial: 12")))
    assert hil.compare_bus(keys, build).problems == [
        (
            "servomotor: node 1: serial number is 1h, expected Ch (FAULHABER Motion Control V3.0). "
            "Correct the hardware file or the wiring."
        )
    ]


def test_check_finds_strangers_and_missing_nodes(write, build, monkeypatch):
    present = hardware.load(write(GOOD.replace("node: 1", "node: 5").replace("faulhaber_v3", "mclm")))
    network = hil.bench_network
    monkeypatch.setattr(hil, "bench_network", lambda _keys, build: network(present, build))
    assert hil.compare_bus(hardware.load(write(GOOD)), build).problems == [
        "servomotor: node 1 does not answer. Check its power and node-ID.",
        "node 5 is not in the hardware file. Add it, or take it off the bus.",
    ]


def test_check_notices_a_drive_of_another_profile(write, build, monkeypatch):
    """Same vendor, no product given: the other profile's product code is not just any."""
    keys = hardware.load(write(GOOD))
    other = hil.bench_network(keys, build)
    monkeypatch.setattr(hil, "bench_network", lambda *_: other)
    found = hil.compare_bus(hardware.load(write(GOOD.replace("faulhaber_v3", "mclm"))), build).problems
    assert len(found) == 1
    assert "product code is 2D51h" in found[0]


def test_check_notices_two_nodes_with_one_id(write, build, monkeypatch):
    keys = hardware.load(write(GOOD))
    network = hil.bench_network(keys, build)
    chosen = profile("faulhaber_v3")
    network.bus.attach(Drive(chosen, 1, Motor(chosen.motor, build=build)))
    monkeypatch.setattr(hil, "bench_network", lambda *_: network)
    found = hil.compare_bus(keys, build).problems
    assert found == [
        "servomotor: node 1: 2 answers to one question: several nodes have this ID. Give one of them another."
    ]


@pytest.mark.slow
def test_check_says_where_each_limit_acts(write, build, tmp_path):
    done = CliRunner().invoke(
        hil.command, ["check", "-f", "hw_bridge/benches/simulated_racs.yaml", "--verbose", "--build", str(build)]
    )
    said = " ".join(done.output.split())
    assert "servomotor_1, servomotor_2: effect of each limit" in said
    assert "rotation: effect of each limit" in said
    assert "From limits.velocity it takes 100 ms to stop" in said
    assert "acceleration targets of csp and csv; in cst the measured one over 4 cycles, else it stops" in said
    mclm = tmp_path / "mclm.yaml"
    mclm.write_text("simulated: true\nnodes: {axis: {node: 1, profile: mclm, limits: {actual_value_age: 12 ms}}}\n")
    said = " ".join(
        CliRunner().invoke(hil.command, ["check", "-f", str(mclm), "--verbose", "--build", str(build)]).output.split()
    )
    assert "acceleration targets of pp and pv; the drive's 6083h, 6084h, 6085h: profile modes and quick stop" in said
    assert "actual_value_age 12 ms" in said
    assert "following_error each cycle, else it stops acceleration" in said, "the MCLM has no 6065h"


def test_check_names_a_drive_that_is_enabled(write, build, monkeypatch):
    from hw_bridge.device import Drive

    power_on = Drive.power_on

    def left(self):
        power_on(self)
        self.port.event_queue.at(
            self.port.event_queue.now + 300_000_000,
            lambda: [self.dictionary.put(0x6040, word) or self._controlled(None) for word in (6, 7, 15)],
        )

    monkeypatch.setattr(Drive, "power_on", left)
    done = CliRunner().invoke(hil.command, ["check", "-f", str(write(GOOD)), "--build", str(build)])
    assert done.exit_code == 1
    assert "is in Operation enabled: another program drives it, or left it so. Nothing was written." in " ".join(
        done.output.split()
    )
