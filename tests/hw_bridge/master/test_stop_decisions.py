"""Decisions of the stop, without a bus: what counts as stopped, when a heartbeat ends, what an operator is told.

Over 400 lines: one stop, from its first frame to its last sentence.
"""

import struct
from types import SimpleNamespace

import pytest

from hw_bridge.bus import Frame
from hw_bridge.dictionary import NmtState, State
from hw_bridge.journal import ObjectChange
from hw_bridge.master import stop
from hw_bridge.master.station import EmergencyMessage
from hw_bridge.master.stop import Stop
from tests.every_case import every_case
from tests.hw_bridge.unconnected import WORDS, unconnected_node
from twin.errors import SimulationError

MS = 1_000_000
QUICK_STOP, OFF = (0x2B, 0x6040, 0, 2), (0x2B, 0x6040, 0, 0)


class RecordedMaster:
    """A master of these drives, whose frames and calls are recorded; each cycle takes 5 ms."""

    def __init__(self, *nodes, action="", resets=()):
        self.nodes = {f"{node.name}{number or ''}": node for number, node in enumerate(nodes)}
        self.stations, self.modules, self.cycle = dict(self.nodes), {}, 5 * MS
        self.network = SimpleNamespace(now=1000 * MS, send=self.send, advance=self.advance)
        self.foreign_master = SimpleNamespace(action=action, text=action, has_reset=lambda number: number in resets)
        self.keys = SimpleNamespace()
        self.frames, self.commands, self.notes, self.fault_texts, self.closed_switches = [], [], [], [], []
        self.beats, self.cycles = True, 0

    def send(self, frame):
        self.frames.append(frame)
        for node in self.nodes.values():
            if frame.id == 0x600 + node.number:
                node.server.send(frame)

    def advance(self, time):
        self.network.now = time

    def run_cycle(self):
        self.cycles += 1
        self.network.now += self.cycle

    def wait(self, duration):
        self.network.now += duration

    def nmt(self, command, number):
        self.commands.append((command, number))

    def has_mapping(self, station):
        return station.started

    def end_heartbeat(self):
        self.beats = False


def requests(master):
    """Writes by SDO: command, index, subindex, value."""
    return [
        (*struct.unpack_from("<BHB", frame.data), struct.unpack_from("<I", frame.data, 4)[0]) for frame in master.frames
    ]


def drive(state=State.ENABLED, at=0, **more):
    """A drive that was last heard `at` ms after the stop began; 60 ms until it misses the heartbeat."""
    node = unconnected_node(limits={"velocity": "100 mm/s"}, **more)
    node.nmt_state = NmtState.OPERATIONAL
    node.word, node.word_at, node.velocity_at, node.started = WORDS[state], (1000 + at) * MS, (1000 + at) * MS, True
    return node


@every_case("state", State)
def test_a_drive_confirms_by_braking_or_by_having_no_current_since_the_stop_began(state):
    confirms = state not in (State.ENABLED, State.SWITCHED_ON)
    for at, is_recent in ((0, False), (1, True)):
        node = drive(state, at)
        made = Stop(RecordedMaster(node))
        assert made._confirmed(node) is (confirms and is_recent)
        node.goal = State.DISABLED
        at_rest = state in (State.DISABLED, State.READY, State.NOT_READY, State.FAULT)
        assert made._at_rest(node) is (at_rest and is_recent)
        node.goal = State.QUICK_STOP
        assert made._at_rest(node) is False


@pytest.mark.parametrize(("speed", "stands"), [(0, True), (1, False), (-1, False)])
def test_a_drive_stands_below_a_hundredth_of_its_velocity_limit(speed, stands):
    """Of 100 mm/s that is 1 mm/s, one unit of the drive."""
    node = drive()
    node.raw_velocity = speed
    assert Stop(RecordedMaster(node))._stands(node) is stands


@every_case(
    ("state", "elapsed", "heard", "stands"),
    [
        (State.DISABLED, 101, 0, True),
        (State.DISABLED, 100, 0, False),
        (State.QUICK_STOP, 101, 0, False),
        (State.DISABLED, 150, 49, True),
        (State.DISABLED, 150, 50, False),
        (State.DISABLED, 101, -500, True),
    ],
)
def test_without_current_and_without_a_recent_speed_a_drive_counts_as_standing(state, elapsed, heard, stands):
    node = drive(state)
    node.raw_velocity, node.velocity_at = 50, (1000 + heard) * MS
    master = RecordedMaster(node)
    made = Stop(master)
    master.network.now += elapsed * MS
    assert made._stands(node) is stands


@every_case(
    ("action", "heard", "elapsed", "timed_out"),
    [
        ("", 0, 220, False),
        ("", 0, 221, True),
        ("", 50, 270, False),
        ("", 50, 271, True),
        ("", -900, 220, False),
        ("SYNC.", 0, 500, False),
        ("SYNC.", 0, 501, True),
    ],
)
def test_how_long_a_silent_drive_is_waited_for(action, heard, elapsed, timed_out):
    """Twice its heartbeat time and 100 ms of braking; after another master's reset as long as it boots."""
    node = drive(at=heard)
    master = RecordedMaster(node, action=action)
    made = Stop(master)
    master.network.now += elapsed * MS
    assert made._has_timed_out(node) is timed_out


def test_the_heartbeat_ends_for_a_drive_that_does_not_confirm():
    """Only then: those without current are released from it before, the others need it to stop by themselves.

    An entry of 1016h that the run did not write stays.
    """
    silent, resting, braking, own = (
        drive(),
        drive(State.DISABLED, 1),
        drive(State.QUICK_STOP, 1),
        drive(State.DISABLED, 1),
    )
    resting.consumer_entry = 2
    for node in (silent, resting, braking):
        node.journal.record([ObjectChange(0x1016, node.consumer_entry, bytes(4))])
    master = RecordedMaster(silent, resting, braking, own)
    made = Stop(master)
    master.network.now += 60 * MS
    made._end_heartbeat()
    assert (master.beats, master.frames, master.notes) == (True, [], [])
    master.network.now += MS
    made._end_heartbeat()
    assert master.beats is False
    assert requests(master) == [(0x23, 0x1016, 2, 0)]
    note = "axis: did not confirm the quick stop: this program sends no heartbeat any more, so that it stops by itself."
    assert master.notes == [note]
    made._end_heartbeat()
    assert len(master.notes) == 1


def test_an_action_is_tried_three_times_and_its_failure_reported_once():
    master = RecordedMaster()
    made = Stop(master)
    tries = []

    def act():
        tries.append(master.network.now)
        if len(tries) < 3:
            raise SimulationError("queue full.")

    assert made.attempt(act) is True
    assert tries == [1000 * MS, 1001 * MS, 1002 * MS]
    assert master.notes == []

    def fail():
        tries.append(0)
        raise SimulationError("queue full.")

    tries.clear()
    assert (made.attempt(fail), made.attempt(fail), len(tries)) == (False, False, 6)
    text = "stop: queue full. The drives stop by themselves when this program's heartbeat is missing."
    assert master.notes == [text]


@pytest.mark.parametrize(("goal", "request_"), [(State.QUICK_STOP, QUICK_STOP), (State.DISABLED, OFF)])
def test_a_goal_is_commanded_by_sdo_too(goal, request_):
    node = drive()
    master = RecordedMaster(node)
    Stop(master)._order(node, goal)
    assert node.goal is goal
    assert requests(master) == [request_]
    assert node.sdo.prompt is False


def test_communication_is_enabled_first():
    """Process data only with this program's mapping: a drive that has started anew is given SDO alone."""
    node, other = drive(), drive()
    other.started = False
    master = RecordedMaster(node, other)
    made = Stop(master)
    made._enable_communication(node)
    made._enable_communication(other)
    assert master.commands == [(1, 3), (0x80, 3)]


@pytest.mark.parametrize(
    ("answers", "state", "speed", "commanded"),
    [
        (True, State.QUICK_STOP, -7, 0),
        (True, State.ENABLED, 5, 1),
        (False, State.ENABLED, 0, 1),
        (False, State.DISABLED, 0, 0),
    ],
)
def test_a_drive_without_process_data_is_read_by_sdo(answers, state, speed, commanded):
    missing = () if answers else (0x6041, 0x606C)
    node = drive(state, missing=missing, values={(0x6041, 0): WORDS[state], (0x606C, 0): speed})
    node.goal = State.QUICK_STOP
    master = RecordedMaster(node)
    made = Stop(master)
    master.network.now += 9 * MS
    made._poll_by_sdo(node)
    heard = 1009 * MS if answers else 1000 * MS
    assert (node.word_at, node.velocity_at, node.raw_velocity) == (heard, heard, speed if answers else 0)
    assert requests(master) == [QUICK_STOP] * commanded
    assert (node.sdo.attempts, node.sdo.timeout) == (1, 30 * MS)


def test_cycles_until_every_drive_has_no_current():
    node = drive()
    master = RecordedMaster(node)
    made = Stop(master)
    made._order(node, State.QUICK_STOP)
    cycle = master.run_cycle

    def cycle_of_a_drive():
        cycle()
        node.word_at = node.velocity_at = master.network.now
        node.word = WORDS[State.QUICK_STOP if master.cycles < 6 else State.DISABLED]
        node.raw_velocity = max(40 - 10 * master.cycles, 0)

    master.run_cycle = cycle_of_a_drive
    made._cycle_until_standstill()
    assert requests(master) == [QUICK_STOP, OFF]  # once it stands: in the fourth cycle
    assert master.cycles == 6
    assert (node.goal, master.beats, made.failed) == (State.DISABLED, True, 0)


def test_a_drive_that_another_master_stopped_is_started_again():
    node = drive(at=1)
    master = RecordedMaster(node)
    made = Stop(master)
    node.goal, node.nmt_state = State.QUICK_STOP, NmtState.STOPPED
    made._cycle_until_standstill()
    assert master.commands[0] == (1, 3)
    assert node.nmt_state is None
    assert set(requests(master)) == {QUICK_STOP}
    assert master.beats is False
    assert master.network.now == (1001 + 225) * MS - MS  # 220 ms after it was heard


def test_an_interface_that_takes_nothing_ends_the_cycles():
    node = drive()
    master = RecordedMaster(node)

    def fail():
        master.cycles += 1
        raise SimulationError("gone.")

    master.run_cycle = fail
    made = Stop(master)
    made._cycle_until_standstill()
    assert (made.failed, master.cycles) == (5, 15)
    assert len([note for note in master.notes if note.startswith("stop: gone.")]) == 1


@pytest.fixture
def references(monkeypatch):
    """References that were saved, by node."""
    saved = []

    class Recorded:
        def __init__(self, keys, name, rotary):
            self.name = name

        def save(self, node):
            if node.name == "full":
                raise OSError("disk full")
            saved.append(self.name)

    monkeypatch.setattr(stop, "Reference", Recorded)
    return saved


@pytest.mark.parametrize(
    ("change", "is_saved"),
    [
        ({}, True),
        ({"has_reference": False}, False),
        ({"boots": 1}, False),
        ({"word": WORDS[State.QUICK_STOP]}, False),
        ({"word_at": 1000 * MS}, False),
        ({"goal": State.QUICK_STOP}, False),
        ({"emergencies": [EmergencyMessage(0, 0x7300)]}, False),
        ({"emergencies": [EmergencyMessage(0, 0x73FF)]}, False),
        ({"emergencies": [EmergencyMessage(0, 0x7400)]}, True),
        ({"emergencies": [EmergencyMessage(0, 0x72FF)]}, True),
    ],
)
def test_a_reference_is_kept_only_if_the_count_is_certain(references, change, is_saved):
    node = drive(State.DISABLED, 1)
    node.has_reference, node.goal = True, State.DISABLED
    node.keys = node.keys.model_copy(update={"homing": True})
    for name, value in change.items():
        setattr(node, name, value)
    Stop(RecordedMaster(node))._save_reference(node)
    assert references == (["axis"] if is_saved else [])
    assert node.has_reference is is_saved
    node.has_reference = True
    Stop(RecordedMaster(node, resets=(3,)))._save_reference(node)
    assert references == (["axis"] if is_saved else [])


def test_a_reference_that_cannot_be_recorded_is_reported(references):
    node = drive(State.DISABLED, 1)
    node.name, node.has_reference, node.goal = "full", True, State.DISABLED
    node.keys = node.keys.model_copy(update={"homing": True})
    master = RecordedMaster(node)
    Stop(master)._save_reference(node)
    assert (references, node.has_reference) == ([], False)
    assert master.notes == ["full: its reference is not recorded (disk full): it is homed again."]


@every_case(
    ("word", "missing", "note", "fault"),
    [
        (State.DISABLED, (), "", ""),
        (State.READY, (), "", ""),
        (
            State.ENABLED,
            (),
            "axis: did not confirm that it is disabled (last state: Operation enabled). Check it before you touch it.",
            "",
        ),
        (State.FAULT, (), "", "axis: is in Fault, and does not say why."),
        (
            State.REACTION,
            (),
            "axis: did not confirm that it is disabled (last state: Fault reaction active). Check it before you touch it.",
            "axis: is in Fault, and does not say why.",
        ),
        (
            State.DISABLED,
            (0x6041,),
            "axis: did not confirm that it is disabled (last state: Switch on disabled). node 3: 6041h.0: refused with 06020000h, no object. Check it before you touch it.",
            "",
        ),
    ],
)
def test_how_a_drive_is_released(word, missing, note, fault):
    node = drive(word, 1, values={(0x6041, 0): WORDS[word], (0x60FD, 0): 1}, missing=missing, safe_outputs=4)
    master = RecordedMaster(node)
    Stop(master)._release(node)
    assert node.server.written[:2] == [(0x60FE, 1, 4), (0x6040, 0, 0)]
    assert master.notes == ([note] if note else [])
    assert master.fault_texts == ([fault] if fault else [])
    switches = [] if missing else ["axis: its negative limit switch is closed (60FDh)."]
    assert master.closed_switches == switches


def test_a_drive_that_refuses_its_safe_outputs_is_released_all_the_same():
    node = drive(State.DISABLED, 1, values={(0x6041, 0): WORDS[State.DISABLED], (0x1016, 1): 9}, safe_outputs=4)
    node.journal.record([ObjectChange(0x1016, 1, bytes(4))])
    node.server.refused.add((0x60FE, 1))
    master = RecordedMaster(node)
    Stop(master)._release(node)
    assert node.server.written == [(0x6040, 0, 0), (0x1016, 1, 0)]
    assert [text for text in master.notes if text.startswith("axis: did not confirm") and "60FEh.1: refused" in text]


@pytest.mark.parametrize(
    ("action", "elapsed", "patience"),
    [("", 220, (2, 300 * MS)), ("", 222, (1, 30 * MS)), ("SYNC.", 220, (2, 100 * MS)), ("SYNC.", 502, (1, 30 * MS))],
)
def test_how_long_a_drive_may_take_to_be_released(action, elapsed, patience):
    node = drive(State.DISABLED, 1)
    master = RecordedMaster(node, action=action)
    made = Stop(master)
    master.network.now += elapsed * MS
    made._release(node)
    assert (node.sdo.attempts, node.sdo.timeout) == patience


def test_the_whole_stop_of_a_drive_that_obeys(references):
    """NMT, quick stop, disable, release, Pre-operational; then its reference."""
    node = drive(values={(0x6041, 0): WORDS[State.DISABLED]})
    node.homing, node.has_reference = True, True
    node.keys = node.keys.model_copy(update={"homing": True})
    module = SimpleNamespace(resting=False, silent=0, release=lambda: "", number=9, nmt_state=None, started=True)
    master = RecordedMaster(node, action="SYNC.")
    master.modules["valves"] = master.stations["valves"] = module
    cycle = master.run_cycle

    def cycle_of_a_drive():
        cycle()
        node.word, node.word_at, node.velocity_at = WORDS[State.DISABLED], master.network.now, master.network.now

    master.run_cycle = cycle_of_a_drive
    Stop(master).carry_out()
    assert master.commands == [(1, 3), (1, 9), (0x80, 3), (0x80, 9)]
    assert [row for row in requests(master) if row[0] != 0x40] == [QUICK_STOP, OFF]
    assert (node.homing, module.resting, node.goal, master.cycles) == (False, True, State.DISABLED, 1)
    assert master.notes == ["SYNC. It can enable the drives again."]
    assert references == ["axis"]
    assert master.frames[0] == Frame(0x603, bytes([0x2B, 0x40, 0x60, 0, 2, 0, 0, 0]))
