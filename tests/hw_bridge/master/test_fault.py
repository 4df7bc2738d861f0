"""A drive in Fault is told and left alone: only `twin hil reset` resets it, never a run."""

import pytest
from click.testing import CliRunner

from hw_bridge.bus import MILLISECOND
from hw_bridge.command import hil
from hw_bridge.dictionary import State
from hw_bridge.session import Session
from tests.hw_bridge.axis import Rig
from tests.hw_bridge.bridge.test_bridge import NODES
from twin.errors import SimulationError

BENCH = "simulated: true\nnodes:\n  servomotor: {node: 1, profile: faulhaber_v3}\n"


def prepared(rig, monkeypatch, prepare):
    """Do something to the drive before the master hears of it."""
    begin = Session.network

    def network(self):
        made = begin(self)
        self.bench.bus.advance(200 * MILLISECOND)
        prepare(self.bench, self.bench.plants["servomotor"].drive)
        return made

    monkeypatch.setattr(Session, "network", network)
    return rig


@pytest.mark.parametrize(
    ("profile", "code", "text"),
    [
        ("faulhaber_v3", 0x7300, r"603Fh: 7300h encoder; 1003h: 7300h encoder, 84F0h speed deviation\."),
        ("epos4", 0x7320, r"603Fh: 7320h position sensor; 1003h: 7320h position sensor\."),
        ("mclm", 0x3210, r"1003h: 3210h overvoltage\."),  # it has no 603Fh
    ],
)
def test_a_fault_at_the_start_is_told_and_not_reset(build, monkeypatch, profile, code, text):
    def fault(_, drive):
        if profile == "faulhaber_v3":
            drive.inject(0x84F0)
        if profile == "mclm":
            drive.dictionary.put(0x2321, 0xFFFF, 2)  # what trips
        drive.inject(code)

    rig = prepared(Rig(build, {"servomotor": NODES[profile]}), monkeypatch, fault)
    with pytest.raises(SimulationError, match=rf"servomotor: is in Fault, {text} Find the cause, then .*hil reset"):
        rig.go(1)
    rig.session.bench.bus.advance(rig.session.bench.bus.now + 500 * MILLISECOND)
    assert rig.drive.state is State.FAULT
    assert code in rig.drive.active


def test_a_fault_while_it_is_brought_up_is_not_reset(build, monkeypatch):
    def fault(bench, drive):
        bench.bus.event_queue.at(560 * MILLISECOND, lambda: drive.inject(0x7300))

    rig = prepared(Rig(build, {"servomotor": NODES["faulhaber_v3"]}), monkeypatch, fault)
    with pytest.raises(SimulationError, match=r"in Fault, 603Fh: 7300h encoder"):
        rig.go(1)
    assert rig.drive.state is State.FAULT


@pytest.fixture
def bench(tmp_path, build, monkeypatch):
    """A hardware file, and its one drive."""
    path = tmp_path / "bench.yaml"
    path.write_text(BENCH)
    made, drives = hil.bench_network, []

    def network(keys, folder):
        found = made(keys, folder)
        drives.append(next(port.station for port in found.bus._ports if hasattr(port.station, "profile")))
        found.bus.advance(200 * MILLISECOND)
        drives[0].inject(0x7300, lasting=network.lasting)
        return found

    network.lasting = False
    monkeypatch.setattr(hil, "bench_network", network)
    return (
        lambda *words: CliRunner().invoke(hil.command, [*words, "-f", str(path), "--build", str(build)]),
        drives,
        network,
    )


def test_the_command_resets(bench):
    run, drives, _ = bench
    done = run("reset")
    assert done.exit_code == 0, done.output
    assert (
        "servomotor: is in Fault, 603Fh: 7300h encoder; 1003h: 7300h encoder. Reset: Switch on disabled."
        in " ".join(done.output.split())
    )
    assert drives[0].state is State.DISABLED


def test_a_cause_that_stays_is_told(bench):
    run, drives, network = bench
    network.lasting = True
    done = run("reset")
    assert done.exit_code == 1
    assert "Reset: Fault. Its cause is still there." in done.output
    assert drives[0].state is State.FAULT


def test_check_tells_a_fault(bench):
    run, drives, _ = bench
    done = run("check")
    assert done.exit_code == 1
    assert "differs: servomotor: is in Fault, 603Fh: 7300h encoder" in done.output
    assert drives[0].state is State.FAULT
