"""The stop: what an interface does not take for one drive is no end for the others, and is told once."""

import pytest

from hw_bridge.bus import Frame
from hw_bridge.dictionary import State, cia301
from hw_bridge.master import Master
from hw_bridge.profiles import DRIVE_PROFILES
from tests.hw_bridge.axis import Rig, node
from twin.errors import SimulationError

FULL = "bus: does not take frames: No buffer space available. Check the adapter, wiring, termination and power."


@pytest.fixture
def rig(build):
    """Two drives that move at 20 mm/s."""
    made = Rig(build, {"first": node(), "second": node(number=2)})
    made.set(target_velocity=0.02)
    made.axes["second"].views["target_velocity"][...] = 0.02
    made.go(100)
    return made


def refuse(rig, monkeypatch, which, times=10**9):
    """The interface does not take some frames."""
    send, left = rig.master.network.send, [times]

    def refusing(frame):
        if which(frame) and left[0] > 0:
            left[0] -= 1
            raise SimulationError(FULL)
        send(frame)

    monkeypatch.setattr(rig.master.network, "send", refusing)


def states(rig):
    return [plant.drive.state for plant in rig.session.bench.plants.values()]


def test_a_frame_that_is_refused_once_is_sent_again(rig, monkeypatch):
    """Each drive is commanded by SDO too, which needs no SYNC: downloads of two bytes (CiA 301), 6040h = 2, then 0."""
    sent = []
    rig.session.bench.bus.observers.append(lambda _, frame: sent.append((frame.id, frame.data)))
    refuse(rig, monkeypatch, lambda frame: frame.id == cia301.SDO_REQUEST + 1, 2)
    rig.session.close()
    assert states(rig) == [State.DISABLED, State.DISABLED]
    assert rig.master.notes == []
    for number in (1, 2):
        requests = [data for identifier, data in sent if identifier == cia301.SDO_REQUEST + number]
        words = [data.hex() for data in requests if data[1:4] == b"\x40\x60\0"]
        assert words[:2] == ["2b40600002000000", "2b40600000000000"]


@pytest.mark.slow
def test_a_drive_whose_frames_are_refused_is_no_end_for_the_other(rig, monkeypatch):
    refuse(rig, monkeypatch, lambda frame: frame.id == cia301.SDO_REQUEST + 1)
    rig.session.close()
    assert states(rig) == [State.DISABLED, State.DISABLED], "the first by its process data"
    assert rig.session.bench.plants["second"].drive.dictionary.get(0x1016, 1) == 0, "the second was released"
    (note,) = rig.master.notes  # the one frame; later ones by SDO were refused too, and follow from it
    assert note.startswith(f"stop: {FULL}")


def test_an_interface_that_takes_nothing_is_told_once(rig, monkeypatch):
    """Time passes meanwhile, so that the stop ends; the drives miss the heartbeat."""
    refuse(rig, monkeypatch, lambda frame: isinstance(frame, Frame))
    bus, before = rig.session.bench.bus, rig.master.network.now
    rig.session.failed = True
    rig.session.close()
    assert bus.now - before < 1_500_000_000
    assert rig.master.notes == [f"stop: {FULL} The drives stop by themselves when this program's heartbeat is missing."]
    assert State.ENABLED not in states(rig)


def test_what_is_not_at_rest_stays_a_note_too(rig):
    account = rig.session.outcome

    class Silent:
        def faults_at_rest(self, _failed, unconfirmed):
            return list(unconfirmed)

    account.notes = ["first: did not confirm."]
    account.record_faults_at_rest(Silent(), failed=True)
    assert account.unsafe == ["first: did not confirm."]
    assert account.unsafe[0] in account.notes, "the summary of a run has it too"


@pytest.mark.parametrize("name", DRIVE_PROFILES)
def test_an_error_while_a_completed_run_is_stopped_is_a_note(build, name):
    rig = Rig(build, {"servomotor": node(name)})
    rig.set(target_velocity=0.05)
    rig.go(100)
    queue = rig.session.bench.bus.event_queue
    queue.at(queue.now + 4_000_000, lambda: rig.drive.inject(0x3210))
    rig.session.close()
    assert rig.drive.state is State.FAULT
    assert not rig.drive.axis.motor.powered
    (note,) = rig.session.outcome.notes
    assert note.startswith("servomotor: is in Fault, ")
    assert "3210h overvoltage" in note


def test_a_program_that_stood_while_a_drive_homed_does_not_enable_it_again(build, monkeypatch):
    """It misses the heartbeat and stays in Quick stop active, from where a controlword of the search would enable it."""
    limits = {"position": ["-45 mm", "45 mm"], "velocity": "200 mm/s", "force": "8 N", "acceleration": "3 m/s^2"}
    search = {"method": -3, "at": "-40 mm", "speed": "10 mm/s"}
    rig = Rig(build, {"servomotor": node(limits={**limits, "following_error": "3 mm"}, homing=search)})
    plain, states = Master.wait, []

    def wait(master, duration, *arguments):
        plain(master, duration, *arguments)
        if master.nodes["servomotor"].homing and master.nodes["servomotor"].state is State.ENABLED and not states:
            values, bus = rig.drive.dictionary.values, rig.session.bench.bus
            values[0x1029, 1], values[0x605A, 0] = 1, 6  # it stays in Operational, and in Quick stop active
            bus.advance(bus.now + 2_000_000_000)
            states.append(rig.drive.state)
            controlled = rig.drive._controlled
            rig.drive.dictionary.effects[0x6040] = lambda entry: (controlled(entry), states.append(rig.drive.state))

    monkeypatch.setattr(Master, "wait", wait)
    with pytest.raises(SimulationError, match=r"this program stood for 20.. ms, longer than heartbeat\.lost_after"):
        rig.go(1)
    assert states[0] is State.QUICK_STOP
    assert State.ENABLED not in states


def test_a_program_that_stood_between_its_checks_and_its_targets_does_not_enable_a_drive_again(build, monkeypatch):
    """A suspended program goes on with the statusword of before: Operation enabled."""
    rig = Rig(build, {"servomotor": node()})
    rig.go(20)
    plain, states = rig.session.orders.set_targets, []

    def set_targets(*arguments):
        plain(*arguments)
        if not states:
            values, bus = rig.drive.dictionary.values, rig.session.bench.bus
            values[0x1029, 1], values[0x605A, 0] = 1, 6  # it stays in Operational, and in Quick stop active
            bus.advance(bus.now + 1_000_000_000)
            states.append(rig.drive.state)
            controlled = rig.drive._controlled
            rig.drive.dictionary.effects[0x6040] = lambda entry: (controlled(entry), states.append(rig.drive.state))

    monkeypatch.setattr(rig.session.orders, "set_targets", set_targets)
    with pytest.raises(SimulationError, match=r"this program stood for 1... ms, longer than heartbeat\.lost_after"):
        rig.go(10)
    assert states[0] is State.QUICK_STOP
    assert State.ENABLED not in states
