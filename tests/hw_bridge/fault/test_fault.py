"""Every fault of a bench ends in the safe state, soon, with what was seen on the bus in the report."""

import pytest

from hw_bridge.bus import MILLISECOND, Frame
from hw_bridge.dictionary import State
from hw_bridge.fault import Cause, Fault, problem
from hw_bridge.fault.action import ACTIONS, TO_BUS_OFF, disturbance
from hw_bridge.hardware import load
from hw_bridge.profiles import DRIVE_PROFILES, profile
from hw_bridge.trace.watch import SHOWN
from tests.hw_bridge.axis import Rig, node
from tests.hw_bridge.bridge.test_bridge import NODES
from tests.matrix import covering
from twin.errors import ScenarioError, SimulationError

AT = 0.2  # time of the fault [s]

# fault: keys beside the time; what ends the run; what is seen on the bus
FAULTS = {
    "emcy": ({"fault": "emcy", "code": "8611h"}, "EMCY 8611h", "8611h following error"),
    "overcurrent": ({"fault": "overcurrent"}, "EMCY", "EMCY servomotor"),
    "encoder": ({"fault": "encoder"}, "EMCY|following error", "servomotor"),
    "encoder offset": ({"fault": "encoder_offset", "offset": "20 mm"}, "following error|velocity", "servomotor"),
    "reset": ({"fault": "reset"}, "EMCY|left Operation|anew|no process data", "boot-up"),
    "heartbeat": ({"fault": "heartbeat"}, "no heartbeat", ""),
    "master's heartbeat": ({"fault": "heartbeat", "node": "master"}, "EMCY 8130h", "8130h"),
    "sync": ({"fault": "sync"}, "no process data|EMCY", ""),
    "drop": ({"fault": "drop"}, "no heartbeat|no process data", ""),
    "master's drop": ({"fault": "drop", "node": "master"}, "EMCY|no process data", ""),
    "delay": ({"fault": "delay", "delay": "100 ms"}, "no heartbeat|no process data", ""),
    "corrupt": ({"fault": "corrupt", "duration": "100 ms"}, "no heartbeat|no process data|EMCY", "error frame"),
    "bus off": ({"fault": "bus_off"}, "EMCY", "error frame"),
    "master's bus off": ({"fault": "bus_off", "node": "master"}, "bus-off", "error frame"),
}


def faulty(build, name, *faults):
    """A moving axis with faults to come."""
    keys = [{"at": f"{AT} s", "node": "servomotor", **one} for one in faults]
    rig = Rig(build, {"servomotor": NODES[name]}, faults=keys)
    rig.set(target_velocity=0.05)
    return rig


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(("which", "name"), covering(FAULTS, DRIVE_PROFILES))
def test_every_fault_ends_in_the_safe_state(build, name, which):
    keys, ends, seen = FAULTS[which]
    rig = faulty(build, name, keys)
    rig.go(round(1000 * AT) - 1)
    assert rig.drive.state is State.ENABLED
    before = rig.plant.motor.position
    with pytest.raises(SimulationError, match=ends):
        rig.go(500)
    rig.session.bench.bus.advance(rig.session.bench.bus.now + 500 * MILLISECOND)
    assert rig.drive.state is not State.ENABLED
    assert not rig.drive.axis.motor.powered or rig.drive.state is State.QUICK_STOP
    assert abs(rig.plant.motor.measured_velocity) * abs(rig.plant.sign) < 1e-3
    assert (
        abs(rig.plant.motor.position - before) * abs(rig.plant.sign) < 6e-3
    )  # 5 mm of following error, and the rest of the way
    told = rig.session.report()["seen"]
    assert told
    assert any(seen in line for line in told), told


def test_the_run_goes_on_through_a_few_lost_or_late_frames(build):
    """Shares and counts: what a bus with a bad connector does is counted, and nothing stops."""
    rig = faulty(
        build,
        "faulhaber_v3",
        {"fault": "drop", "identifiers": [0x181, 0x181], "count": 2},
        {
            "fault": "delay",
            "identifiers": [0x181, 0x181],
            "delay": "1 ms",
            "jitter": "500 us",
            "duration": "100 ms",
            "share": 0.5,
        },
        {"fault": "corrupt", "identifiers": [0x080, 0x080], "count": 3},
    )
    rig.go(600)
    assert rig.drive.state is State.ENABLED
    assert rig.master.nodes["servomotor"].lost == 2
    (line,) = [one for one in rig.session.report()["seen"] if "error frame" in one]
    assert line.endswith("(again and again)")


def test_the_same_faults_give_the_same_bus(build):
    """Also where chance decides which frames are hit."""
    heard = []
    for _ in range(2):
        rig = faulty(build, "epos4", {"fault": "drop", "share": 0.3})
        rig.go(230)
        heard.append(list(rig.session.listener.daily))
    assert heard[0] == heard[1]


@pytest.mark.parametrize(
    ("fault", "text"),
    [
        ("{at: 1 s, fault: emcy, node: motor, code: 1234h}", r"faults\[1\]: maxon EPOS4 has no error 1234h"),
        ("{at: 1 s, fault: reset, node: master}", "reset is a fault of a drive"),
        ("{at: 1 s, fault: reset, node: moter}", "no node 'moter'.*motor"),
        ("{at: 1 s, fault: rest, node: motor}", "fault"),
        ("{at: 1 s, fault: emcy, node: motor, code: zzz}", "expected an EMCY code such as 7300h"),
        ("{at: 1 s, fault: drop, node: motor, cuont: 3}", r"faults\[1\].cuont: unknown key. Did you mean 'count'"),
    ],
)
def test_faults_that_cannot_be(tmp_path, fault, text):
    path = tmp_path / "bench.yaml"
    path.write_text(f"simulated: true\nnodes:\n  motor: {{node: 3, profile: epos4}}\nfaults:\n  - {fault}\n")
    with pytest.raises(ScenarioError, match=text) as caught:
        load(path)
    assert "bench.yaml:5" in str(caught.value)


def test_real_drives_have_their_own_faults(tmp_path):
    path = tmp_path / "bench.yaml"
    path.write_text(
        "interface: socketcan\nchannel: can0\nnodes: {motor: {node: 3, profile: epos4}}\n"
        "faults: [{at: 1 s, fault: reset, node: motor}]\n"
    )
    with pytest.raises(ScenarioError, match="only a bench with `simulated: true`"):
        load(path)


def test_faults_of_the_mechanics_are_those_of_any_motor(make, name):
    drive = make(name).drive
    motor = drive.axis.motor
    before = {key: motor.get(key) for key in ("friction_coulomb", "velocity_gain", "velocity_integral")}
    for which in (Cause.FRICTION, Cause.SLOW, Cause.GRIP):
        ACTIONS[which](Fault(which, factor=0.5), drive)
    assert {key: motor.get(key) for key in before} == {key: 0.5 * value for key, value in before.items()}
    motor.load(3.0)
    assert motor.get(motor.model.load) == 1.5


def test_tables():
    for name in DRIVE_PROFILES:
        faults = profile(name).faults
        assert {profile(name).overcurrent, profile(name).encoder_error} - {None} <= set(faults)
        assert not problem(Fault(Cause.EMCY, min(faults)), profile(name))


def test_a_fault_hits_the_frames_of_its_sender_only():
    drive = disturbance(Fault(Cause.DROP), 0, 3, master=False)
    master = disturbance(Fault(Cause.BUS_OFF), 5, 127, master=True)
    assert 0x183 in drive.only
    assert 0x184 not in drive.only
    assert drive.only.isdisjoint(master.only)
    assert {0, 0x080, 0x201, 0x203, 0x27F, 0x603, 0x67F, 0x77F} <= master.only
    assert master.only.isdisjoint({0x200, 0x280, 0x300, 0x680, 0x77E})
    assert (master.count, master.start) == (TO_BUS_OFF, 5)


def test_a_node_without_faults_runs(build):
    rig = Rig(build, {"servomotor": node()})
    rig.go(10)
    assert not any("EMCY" in line for line in rig.session.report()["seen"])


def test_more_events_than_are_told(build):
    """The last of them are told, and how many there were before, above all of them."""
    rig = Rig(build, {"servomotor": node()})
    rig.go(5)
    begun = len(rig.session.listener.events(rig.session.origin))
    for number in range(40):
        rig.session.listener.hear(rig.session.origin, Frame(0, bytes([1 + number % 2, 0])))
    rig.axis.close()
    told = rig.session.report()["seen"]
    assert told[0].startswith("before: ")
    assert len(told) == 1 + SHOWN
    assert begun == 0
