"""An NMT command of another program: the drives are stopped at once, although a Stopped node takes neither PDO nor SDO."""

import pytest

from hw_bridge.bus import MILLISECOND, Frame, SimulatedNetwork
from hw_bridge.dictionary import NmtState, State, cia301
from hw_bridge.master import setup
from hw_bridge.profiles import DRIVE_PROFILES
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


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("to", ["own", "all"])
@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("name", DRIVE_PROFILES)
def test_an_nmt_command_of_another_program_ends_the_run_at_once(build, name, command, to):
    rig = moving(build, name)
    number = rig.drive.node if to == "own" else 0
    rig.other.send(Frame(cia301.NMT, bytes([COMMANDS[command], number])))
    took, (way,) = ends(rig, "sent NMT command")
    assert took < 1.5  # the aftermath of 0.51 s that a simulated bench is watched included
    assert way < 2e-3, f"{1e3 * way:.1f} mm"
    assert rig.drive.state not in (State.ENABLED, State.QUICK_STOP)
    assert not rig.drive.axis.motor.powered


@pytest.mark.slow
def test_an_nmt_command_that_is_not_heard_shows_in_the_heartbeat(build):
    """The frame of another program on the same adapter does not come to this one."""
    rig = moving(build, "mclm")
    rig.drive.nmt.command(bytes([cia301.STOP, rig.drive.node]))
    took, (way,) = ends(rig, r"left NMT Operational: Stopped")
    assert took < 1.5
    assert way < 2e-3, f"{1e3 * way:.1f} mm"


@pytest.mark.slow
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
    assert any("heartbeat" in note and "stops by itself" in note for note in rig.session.outcome.notes)


@pytest.mark.slow
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

    monkeypatch.setattr(setup, "carry_out", failing)
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


@pytest.mark.slow
@pytest.mark.parametrize("every", [1, 5, 20])
def test_another_program_that_goes_on_sending_stop(build, every):
    rig = moving(build, "mclm")
    event_queue = rig.session.bench.bus.event_queue

    def again():
        rig.other.send(Frame(cia301.NMT, bytes([cia301.STOP, rig.drive.node])))
        event_queue.at(event_queue.now + every * MILLISECOND, again)

    again()
    took, (way,) = ends(rig, "sent NMT command")
    assert took < 1.5
    assert way < 2e-3, f"{1e3 * way:.1f} mm"
    assert not rig.drive.axis.motor.powered


def restart_operational(drive):
    """Restart a drive that goes to Operational by itself (1F80h): it has the RPDO mapping of its power-on at once."""
    enter = drive.nmt.enter
    drive.nmt.boot_time = MILLISECOND
    drive.nmt.enter = lambda state: enter(NmtState.OPERATIONAL if drive.port.state is NmtState.INITIALIZING else state)
    drive.restart()


def frames_of_targets(bus, node):
    """Frames of RPDO 1 and 2 of a drive from now on."""
    frames = []
    bus.observers.append(lambda _, frame: frames.append(frame) if frame.id in (0x200 + node, 0x300 + node) else None)
    return frames


@pytest.mark.parametrize("name", DRIVE_PROFILES)
def test_a_drive_that_restarts_by_itself_takes_no_target_for_a_controlword(build, name):
    rig = moving(build, name)
    rig.go(1)  # after the frames of a cycle
    frames, drive = frames_of_targets(rig.session.bench.bus, rig.drive.node), rig.drive
    restart_operational(drive)
    with pytest.raises(SimulationError, match=r"started anew by itself\. Check its supply\. All drives stop\."):
        rig.go(100)
    assert frames == []
    assert drive.state is State.DISABLED


def test_a_restart_while_the_other_drive_is_brought_up_ends_it_at_once(build, monkeypatch):
    """Before any target; also later the drive is not taken for one with the PDO mapping of the run."""
    limit_positions = setup.limit_positions

    rig = Rig(build, {"a": node("epos4", 1), "b": node("epos4", 2)})
    frames = []

    def restart_first(own):
        limit_positions(own)
        if own.name == "b":
            first = rig.session.bench.plants["a"].drive
            restart_operational(first)
            frames.append(frames_of_targets(rig.session.bench.bus, first.node))

    monkeypatch.setattr(setup, "limit_positions", restart_first)
    with pytest.raises(
        SimulationError, match=r"a: started anew by itself while it was brought up\. Check its supply\."
    ):
        rig.go(10)
    assert len(frames[0]) <= 2, "of the cycle in which it boots"


@pytest.mark.slow
@pytest.mark.parametrize("name", DRIVE_PROFILES)
@pytest.mark.parametrize("boots_in", [1, 3, 100])
def test_no_target_is_sent_to_a_drive_that_was_reset(build, name, boots_in):
    """Its RPDO 1 is the controlword again, at the identifier of the targets. Also where it boots at once."""
    rig = moving(build, name)
    drive, sent, words = rig.drive, [], []
    drive.nmt.boot_time = boots_in * MILLISECOND
    rig.session.bench.bus.observers.append(lambda _, frame: sent.append(frame))
    controlled = drive._controlled
    drive.dictionary.effects[0x6040] = lambda entry: (words.append(drive.dictionary.get(0x6040)), controlled(entry))
    rig.other.send(Frame(cia301.NMT, bytes([cia301.RESET_NODE, drive.node])))
    ends(rig, "sent NMT command")
    begin = next(
        k for k, frame in enumerate(sent) if frame == Frame(cia301.NMT, bytes([cia301.RESET_NODE, drive.node]))
    )
    after = [frame for frame in sent[begin:] if frame.id in (0x200 + drive.node, 0x300 + drive.node)]
    assert len(after) <= 2, "of the cycle in which it was noticed"
    assert (cia301.START, drive.node) not in rig.commands
    assert set(words) <= {0x00, 0x02, 0x0F}


@pytest.mark.slow
def test_a_module_that_was_stopped_has_safe_outputs(build):
    more = {"modules": {"valves": {"node": 9, "outputs": {0: "sequencer.valve[1]"}, "safe_outputs": 2}}}
    rig = Rig(build, {"servomotor": NODES["mclm"]}, **more)
    switch = rig.hardware._module("valves", "")()
    switch.start()
    rig.axes["valves"] = switch
    switch.views["output_0"][...] = True
    rig.go(100)
    module = rig.session.bench.modules["valves"]
    assert module.outputs == 3
    SimulatedNetwork(rig.session.bench.bus).send(Frame(cia301.NMT, bytes([cia301.STOP, 9])))
    with pytest.raises(SimulationError, match="sent NMT command 02h to valves"):
        rig.go(300)
    assert module.outputs == 2
    assert not any("did not confirm" in note for note in rig.session.outcome.notes)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("left", [NmtState.STOPPED, NmtState.OPERATIONAL])
@pytest.mark.parametrize("name", DRIVE_PROFILES)
def test_disable_reaches_a_drive_that_is_stopped(build, name, left):
    """`twin hil disable`, and it brakes first."""
    from hw_bridge.bus import Bus
    from hw_bridge.commission import BOOT, SdoSession, power
    from hw_bridge.device import Drive, Motor
    from hw_bridge.profiles import profile
    from tests.hw_bridge.master.test_found_moving import enabled

    chosen = profile(name)
    drive = Drive(chosen, 1, Motor(chosen.motor, build=build))
    bus = Bus()
    bus.attach(drive)
    line = SdoSession(SimulatedNetwork(bus))
    line.wait(BOOT)
    enabled(drive, 20 * (1000 if name == "epos4" else 1))
    line.wait(200 * MILLISECOND)
    drive.nmt.enter(NmtState.OPERATIONAL)
    drive.nmt.enter(left)
    states, enter = [], drive._quick_stop
    drive._quick_stop = lambda: (states.append(drive.state), enter())
    assert power.disable(line, line.drive("1", name)) in (State.DISABLED, State.FAULT)
    # Stopped ends the connection, where 6007h says what that means
    assert states == [State.ENABLED] or (left is NmtState.STOPPED and drive.profile.option(drive.dictionary, 0x6007))
    line.wait(100 * MILLISECOND)
    assert abs(drive.axis.velocity) < 1e-3


def test_outputs_stay_until_a_drive_without_current_stands(build):
    """A fault takes its current away while it moves fast: a gripper does not let go before it stands."""
    more = {"modules": {"valves": {"node": 9, "outputs": {0: "sequencer.valve[1]"}, "safe_outputs": 0}}}
    limits = {"velocity": "300 mm/s", "acceleration": "10 m/s^2"}
    rig = Rig(build, {"servomotor": node(limits=limits)}, **more)
    switch = rig.hardware._module("valves", "")()
    switch.start()
    rig.axes["valves"] = switch
    switch.views["output_0"][...] = True
    rig.set(target_velocity=0.2)
    rig.go(100)
    module, speeds = rig.session.bench.modules["valves"], []
    rig.session.bench.bus.observers.append(
        lambda *_: speeds.append(abs(rig.drive.axis.velocity)) if not module.outputs else None
    )
    rig.drive.inject(0x7300)
    with pytest.raises(SimulationError, match="EMCY 7300h"):
        rig.go(300)
    assert module.outputs == 0
    assert speeds[0] < 5e-3
