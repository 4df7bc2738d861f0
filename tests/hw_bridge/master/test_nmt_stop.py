"""An NMT command of another program: the drives are stopped at once, although a Stopped node takes neither PDO nor SDO."""

import pytest

from hw_bridge.bus import MILLISECOND, Frame, SimulatedNetwork
from hw_bridge.dictionary import NmtState, State, cia301
from hw_bridge.profiles import MODULES
from tests.hw_bridge.axis import Rig, node
from tests.hw_bridge.bridge.test_bridge import NODES
from twin.errors import SimulationError

SPEED = 6e-3  # [m/s]
COMMANDS = {
    "stop": cia301.STOP,
    "pre-operational": cia301.PRE_OPERATIONAL,
    "reset node": cia301.RESET_NODE,
    "reset communication": cia301.RESET_COMMUNICATION,
}


def moving(build, name, nodes=None, **more):
    """A rig whose first drive moves at 6 mm/s, with another program on its bus that notes all NMT commands."""
    rig = Rig(build, nodes or {"servomotor": NODES[name]}, **more)
    for axis in rig.axes.values():
        axis.views["target_velocity"][...] = SPEED
    rig.go(200)
    rig.other = SimulatedNetwork(rig.session.bench.bus)
    rig.commands = []
    rig.session.bench.bus.observers.append(
        lambda _, frame: rig.commands.append(tuple(frame.data)) if frame.id == cia301.NMT else None
    )
    return rig


def ends(rig, match):
    """Let the run end: after which time [s], and how far each drive moved after now [m], also after its end."""
    bus, plants = rig.session.bench.bus, list(rig.session.bench.plants.values())
    began, places = bus.now, [plant.motor.position for plant in plants]
    with pytest.raises(SimulationError, match=match):
        rig.go(500)
    took = (bus.now - began) / 1e9
    bus.advance(bus.now + 1000 * MILLISECOND)
    return took, [abs((plant.motor.position - place) * plant.sign) for plant, place in zip(plants, places, strict=True)]


@pytest.mark.parametrize("to", ["own", "all"])
@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("name", MODULES)
def test_an_nmt_command_of_another_program_ends_the_run_at_once(build, name, command, to):
    rig = moving(build, name)
    number = rig.drive.node if to == "own" else 0
    rig.other.send(Frame(cia301.NMT, bytes([COMMANDS[command], number])))
    took, (way,) = ends(rig, "sent NMT command")
    assert took < 1.5  # the aftermath of 0.51 s that a simulated bench is watched included
    assert way < 2e-3, f"{1e3 * way:.1f} mm"
    assert rig.drive.state not in (State.ENABLED, State.QUICK_STOP)
    assert not rig.drive.axis.motor.powered


def test_an_nmt_command_that_is_not_heard_shows_in_the_heartbeat(build):
    """The frame of another program on the same adapter does not come to this one."""
    rig = moving(build, "mclm")
    rig.drive.nmt.command(bytes([cia301.STOP, rig.drive.node]))
    took, (way,) = ends(rig, r"left NMT Operational: Stopped")
    assert took < 1.5
    assert way < 2e-3, f"{1e3 * way:.1f} mm"


def test_a_drive_that_is_stopped_again_and_again_misses_the_heartbeat(build, monkeypatch):
    """It takes no order; then this program falls silent, and the drive's own watch on the heartbeat stops it."""
    rig = moving(build, "mclm")
    drive = rig.drive
    monkeypatch.setitem(
        __import__("hw_bridge.device.nmt", fromlist=["COMMANDS"]).COMMANDS, cia301.START, NmtState.STOPPED
    )
    rig.other.send(Frame(cia301.NMT, bytes([cia301.STOP, drive.node])))
    took, (way,) = ends(rig, "sent NMT command")
    assert took < 1.5
    lost_after = rig.master.nodes["servomotor"].keys.heartbeat.lost_after / 1e9
    assert way < SPEED * (2 * lost_after + 0.1), f"{1e3 * way:.1f} mm"
    assert not drive.axis.motor.powered
    assert any("heartbeat" in note and "stops by itself" in note for note in rig.session.account.notes)


def test_only_own_nodes_are_addressed(build):
    rig = moving(build, "mclm", {"first": node("mclm", number=3), "second": node(number=4)})
    rig.session.close()
    assert rig.commands
    assert {number for _, number in rig.commands} == {3, 4}
    assert [plant.drive.port.state for plant in rig.session.bench.plants.values()] == [NmtState.PRE_OPERATIONAL] * 2
    assert rig.master.notes == []


def test_a_node_that_was_never_started_is_not_started_by_the_stop(build, monkeypatch):
    """Its RPDOs have the mapping that it was delivered with: a target would be taken for a controlword."""
    from hw_bridge.master import setup

    def failing(_node):
        raise SimulationError("mapping failed")

    monkeypatch.setattr(setup, "mapping", failing)
    rig = Rig(build, {"servomotor": node()})
    sent = []
    network = type(rig.session).network

    def watched(self):
        made = network(self)
        self.bench.bus.observers.append(lambda _, frame: sent.append(frame))
        return made

    monkeypatch.setattr(type(rig.session), "network", watched)
    with pytest.raises(SimulationError, match="mapping failed"):
        rig.go(1)
    assert not [frame for frame in sent if frame.id == cia301.NMT and frame.data[0] == cia301.START]
    assert rig.drive.port.state is NmtState.PRE_OPERATIONAL
