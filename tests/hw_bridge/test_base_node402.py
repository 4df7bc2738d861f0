"""python-canopen's BaseNode402 drives each profile over python-can's virtual bus, as it would a real drive."""

import threading
import time
import uuid

import can
import canopen
import pytest
from canopen.profiles.p402 import BaseNode402

from hw_bridge import eds
from hw_bridge.device import Drive, Motor
from hw_bridge.profiles import profile
from hw_bridge.wire import Wire

NODE = 5


@pytest.fixture
def node(name, build, tmp_path):
    """A node of canopen, beside the drive that it talks to."""
    chosen = profile(name)
    path = tmp_path / "drive.eds"
    path.write_text(eds.export(chosen))
    channel = uuid.uuid4().hex
    drive = Drive(chosen, NODE, Motor(chosen.motor, build=build))
    network = canopen.Network()
    with can.Bus(channel, interface="virtual") as bus:
        wire = Wire(drive, bus)
        thread = threading.Thread(target=wire.run)
        network.connect(channel, interface="virtual")
        found = network.add_node(BaseNode402(NODE, str(path)))
        thread.start()
        try:
            found.nmt.wait_for_bootup(5)
            prepare(found)
            yield found
        finally:
            network.sync.stop()
            wire.stop.set()
            thread.join()
            network.disconnect()


def prepare(node):
    """What a host of a real drive does first: controlword in one RPDO only, statusword periodically, Operational.

    BaseNode402 takes every TPDO that it has heard twice for a periodic one; and through a second RPDO with a
    controlword it would switch the drive off.
    """
    for index in (0x1401, 0x1402, 0x1403):
        node.sdo[index][1].raw |= 1 << 31
    if 5 in node.object_dictionary[0x1800]:
        node.sdo[0x1800][5].raw = 10
    else:
        node.sdo[0x1800][2].raw = 1
        node.network.sync.start(0.01)
    node.nmt.state = "PRE-OPERATIONAL"
    node.setup_402_state_machine()
    node.nmt.state = "OPERATIONAL"


def until(condition, seconds=3.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


@pytest.mark.slow
def test_homing_velocity_position_and_csp(node, name):
    fine = name != "epos4"  # um instead of increments
    node.sdo[0x6098].raw = 37 if 37 in profile(name).homing else 35
    assert node.homing(timeout=3)
    assert node.sdo[0x6064].raw == 0
    node.controlword = 0x0F

    node.op_mode = "PROFILED VELOCITY"
    node.state = "OPERATION ENABLED"
    speed = 20 if fine else 120
    node.sdo[0x60FF].raw = speed
    until(lambda: node.sdo[0x606C].raw == pytest.approx(speed, rel=0.3) and node.statusword & 0x0400)
    node.sdo[0x60FF].raw = 0
    until(lambda: node.statusword & 0x1000)

    node.op_mode = "PROFILED POSITION"
    target = node.sdo[0x6064].raw - (3000 if fine else 5000)
    node.sdo[0x607A].raw = target
    node.controlword = 0x1F
    until(lambda: node.statusword & 0x1000)
    node.controlword = 0x0F
    until(lambda: node.statusword & 0x1400 == 0x0400)
    until(lambda: abs(node.sdo[0x6064].raw - target) <= 40)

    if node.sdo[0x6502].raw & 0x80:
        node.sdo[0x607A].raw = target
        node.op_mode = "CYCLIC SYNCHRONOUS POSITION"
        until(lambda: node.sdo[0x6061].raw == 8)
        for step in range(1, 21):
            node.sdo[0x607A].raw = target + 20 * step
        until(lambda: abs(node.sdo[0x6064].raw - target - 400) <= 20)
    assert node.state == "OPERATION ENABLED"
    node.state = "SWITCH ON DISABLED"
    assert node.emcy.active == []


@pytest.mark.slow_repetitions
def test_quick_stop(node, name):
    node.state = "OPERATION ENABLED"
    node.controlword = 0x02
    until(lambda: node.state in ("QUICK STOP ACTIVE", "SWITCH ON DISABLED"))
    if name == "epos4":
        assert node.state == "QUICK STOP ACTIVE"  # 605Ah = 6: it stays
    node.state = "OPERATION ENABLED"


@pytest.mark.slow_repetitions
def test_identity_and_abort(node, name):
    assert node.sdo[0x1018][1].raw == (0xFB if name.startswith("epos") else 327)
    with pytest.raises(canopen.SdoAbortedError) as found:
        node.sdo.download(0x6041, 0, b"\0\0")
    assert found.value.code == 0x06010002
    assert node.sdo.upload(0x1008, 0).decode() in ("EPOS2", "EPOS4", "MC5005", "MCLM300x")  # segmented where it is long
