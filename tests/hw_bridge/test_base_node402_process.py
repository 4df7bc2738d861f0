"""A stranger with python-canopen and nothing of this project: each profile as a process, through all of its modes."""

import os
import subprocess
import sys
import time

import canopen
import pytest
from canopen.profiles.p402 import BaseNode402

from benchmarks import hil
from tests.hw_bridge.waiting import wait_for_node

NODE = 5
PERIOD = 0.01  # SYNC [s]
# multicast gives back what was sent, and canopen takes an RPDO that it has heard twice for one that needs no sending
FROM_DRIVES = [{"can_id": base, "can_mask": 0x780} for base in (0x080, 0x180, 0x280, 0x380, 0x480, 0x580, 0x700)]
pytestmark = [pytest.mark.slow, pytest.mark.real_time, pytest.mark.skipif(sys.platform != "linux", reason="multicast")]


@pytest.fixture
def node(name, build, tmp_path, monkeypatch):
    """The node as the library's own documentation makes it, with the EDS file that the command writes."""
    monkeypatch.setattr(hil, "PORT", 45000 + os.getpid() % 10000)
    path = tmp_path / "drive.eds"
    words = ["drive", "--profile", name, "--write-eds", str(path)]
    subprocess.run([sys.executable, "-c", "from twin.cli import main; main()", *words], check=True)
    network = canopen.Network()
    with hil.drive(name, "udp_multicast", hil.GROUP, build, NODE):
        network.connect(channel=hil.GROUP, interface="udp_multicast", port=hil.PORT, can_filters=FROM_DRIVES)
        found = network.add_node(BaseNode402(NODE, str(path)))
        try:
            wait_for_node(found)
            configure(found)
            yield found
        finally:
            network.sync.stop()
            network.disconnect()


def configure(node):
    """PDOs as the library maps them: statusword and actual values at SYNC, controlword and targets in one RPDO each."""
    node.nmt.state = "PRE-OPERATIONAL"
    node.tpdo.read()
    node.rpdo.read()
    node.sdo["Producer heartbeat time"].raw = 100
    for number in range(1, 5):
        node.tpdo[number].enabled = node.rpdo[number].enabled = False
    transmit = {1: ("Statusword", "Modes of operation display"), 2: ("Position actual value", "Velocity actual value")}
    for number, names in transmit.items():
        node.tpdo[number].clear()
        for name in names:
            node.tpdo[number].add_variable(name)
        node.tpdo[number].trans_type, node.tpdo[number].enabled = 1, True
    for number, names in {1: ("Controlword",), 2: ("Target position", "Target velocity")}.items():
        node.rpdo[number].clear()
        for name in names:
            node.rpdo[number].add_variable(name)
        node.rpdo[number].trans_type, node.rpdo[number].enabled = 255, True
    node.tpdo.save()
    node.rpdo.save()
    node.network.sync.start(PERIOD)
    node.setup_402_state_machine()
    node.nmt.state = "OPERATIONAL"
    node.nmt.wait_for_heartbeat(2.0)


def until(condition, seconds=4.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(PERIOD)


def said(node, name):
    """A value from the TPDO that carries it."""
    return node.tpdo[2][name].raw


def tell(node, position=None, velocity=0):
    """Both targets in their RPDO; positions stay where nothing else is said."""
    node.rpdo[2]["Target position"].raw = said(node, "Position actual value") if position is None else position
    node.rpdo[2]["Target velocity"].raw = velocity
    node.rpdo[2].transmit()


def test_all_modes_of_a_drive(node, name):
    fine = not name.startswith("epos")  # um instead of increments
    way, speed = (2000, 20) if fine else (4000, 200)
    until(lambda: node.tpdo[2].is_received)

    node.sdo["Homing method"].raw = 35 if name in ("mclm", "epos2") else 37
    assert node.homing(timeout=5)
    until(lambda: said(node, "Position actual value") == 0)
    node.controlword = 0x0F

    tell(node)
    node.op_mode = "PROFILED VELOCITY"
    assert node.op_mode == "PROFILED VELOCITY"
    node.state = "OPERATION ENABLED"
    tell(node, velocity=speed)
    until(lambda: said(node, "Velocity actual value") == pytest.approx(speed, rel=0.3) and node.statusword & 0x0400)
    tell(node)
    until(lambda: node.statusword & 0x1000)

    node.op_mode = "PROFILED POSITION"
    target = said(node, "Position actual value") - way
    tell(node, target)
    node.controlword = 0x1F
    until(lambda: node.statusword & 0x1000)
    node.controlword = 0x0F
    until(lambda: node.statusword & 0x1400 == 0x0400)
    until(lambda: said(node, "Position actual value") == pytest.approx(target, abs=40))

    supported = [
        mode for mode in ("POSITION", "VELOCITY", "TORQUE") if node.is_op_mode_supported(f"CYCLIC SYNCHRONOUS {mode}")
    ]
    assert bool(supported) is (name not in ("mclm", "epos2"))
    if "POSITION" in supported:
        follow(node, way)
    if "VELOCITY" in supported:
        tell(node)
        node.op_mode = "CYCLIC SYNCHRONOUS VELOCITY"
        stream(node, 0.5, lambda: tell(node, velocity=speed))
        assert said(node, "Velocity actual value") == pytest.approx(speed, rel=0.3)
        stream(node, 0.2, lambda: tell(node))
    if "TORQUE" in supported:
        node.sdo["Target torque"].raw = 0
        node.op_mode = "CYCLIC SYNCHRONOUS TORQUE"
        assert node.op_mode == "CYCLIC SYNCHRONOUS TORQUE"
    assert node.state == "OPERATION ENABLED"
    node.state = "SWITCH ON DISABLED"
    assert node.emcy.active == []


def stream(node, seconds, send):
    """Targets in every cycle, as a cyclic mode wants them."""
    for _ in range(round(seconds / PERIOD)):
        send()
        time.sleep(PERIOD)
    assert node.state == "OPERATION ENABLED"


def follow(node, way):
    """csp: a ramp of targets."""
    begin = said(node, "Position actual value")
    tell(node, begin)
    node.op_mode = "CYCLIC SYNCHRONOUS POSITION"
    steps = iter(range(101))
    stream(node, 1.0, lambda: tell(node, begin + way * next(steps) // 100))
    until(lambda: tell(node, begin + way) or abs(said(node, "Position actual value") - begin - way) <= 40)
