"""Frames of a master over time, on a bus that records them: targets, SYNC, heartbeat; age of actual values."""

import pytest

from hw_bridge.bus import Frame, bit_count, never
from hw_bridge.hardware import HardwareKeys
from hw_bridge.master import Master
from hw_bridge.master.age import PATTERN, ValueAge
from hw_bridge.master.foreign_master import ForeignMasterMonitor
from tests.every_case import every_case
from tests.hw_bridge.axis import node as node_keys
from twin.errors import SimulationError

MS = 1_000_000
CYCLE = 5 * MS


class RecordedBus:
    """A bus on which nothing answers; frames with the times at which they were sent."""

    def __init__(self, wall_clock=False):
        self.wall_clock, self.now, self.frames, self.steps = wall_clock, 0, [], []

    def send(self, frame):
        self.frames.append((self.now, frame))

    def send_at(self, frame, time):
        self.frames.append((time, frame))
        return time

    def advance(self, until, done=never):
        self.steps.append(until)
        self.now = until


def master(wall_clock=False, nodes=None, **more):
    """A master whose drives are started, each with its process data."""
    nodes = nodes or {"axis": node_keys(number=3)}
    keys = HardwareKeys.model_validate(
        {
            "simulated": not wall_clock,
            "nodes": nodes,
            "cycle": "5 ms",
            **({"interface": "virtual", "channel": "x"} if wall_clock else {}),
            **more,
        }
    )
    made = Master(keys, RecordedBus(wall_clock))
    for station in made.stations.values():
        station.started = True
    return made


def test_sync_leaves_after_the_targets():
    made = master()
    times = [bit_count(frame) * 1000 for frame in made.nodes["axis"].frames()]
    assert made.window == sum(times) + 100_000
    assert made.lead == made.window
    made.network.now = 7 * MS
    sent = made.exchange()
    assert [frame.id for _, frame in made.network.frames] == [0x203, 0x303, 0x080]
    assert sent == made.network.frames[-1][0] == 7 * MS + made.window
    assert made.nodes["axis"].ages[0x180].last == sent
    assert master(wall_clock=True).lead == CYCLE // 2
    assert master(wall_clock=True, cycle="1 ms").lead == max(made.window + 400_000, 500_000)


@every_case(
    ("now", "planned", "synced", "due"),
    [
        (100.0, 100.0, 0.0, "lead"),
        (100.2, 100.0, 0.0, "window"),
        (100.0, 99.0, 0.0, "window"),
        (100.0, 100.0, 99.5, 103.25),
        (100.0, 100.0, 98.5, "lead"),  # at least three quarters of a cycle after the last one
        (100.0, None, 99.9, "window"),
    ],
)
def test_sync_keeps_to_the_plan(now, planned, synced, due):
    made = master(wall_clock=True)
    made.network.now, made._synced = round(now * MS), round(synced * MS)
    expected = {"lead": round((planned or 0) * MS) + made.lead, "window": round(now * MS) + made.window}.get(
        due
    ) or round(due * MS)
    if due == "window" and planned is not None:
        expected = max(expected, round(planned * MS) + made.lead)
    assert made.exchange(None if planned is None else round(planned * MS)) == expected
    assert made.shortest == 3_750_000


def test_sync_is_uneven_while_an_age_is_in_doubt():
    made = master()
    made.nodes["axis"].ages[0x180].in_doubt = True
    offsets = []
    for cycle in range(len(PATTERN)):
        made.network.now = cycle * CYCLE
        offsets.append(made.exchange() - cycle * CYCLE - made.window)
    assert offsets == [600_000 * PATTERN[(cycle + 1) % len(PATTERN)] for cycle in range(len(PATTERN))]


@pytest.mark.parametrize(
    ("change", "sends"),
    [
        ({}, True),
        ({"started": False}, False),
        ({"boots": 1}, False),
    ],
)
def test_targets_go_only_to_a_drive_with_this_programs_mapping(change, sends):
    made = master()
    node = made.nodes["axis"]
    for name, value in change.items():
        setattr(node, name, value)
    made.exchange()
    assert ([frame.id for _, frame in made.network.frames] == [0x203, 0x303, 0x080]) is sends
    assert made.has_mapping(node) is sends
    made.network.frames.clear()
    made.running = True
    made.exchange()
    assert len(made.network.frames) == (3 if sends else 1)
    made.foreign_master.resets.add(3)
    assert made.has_mapping(node) is False


def test_heartbeats_are_sent_while_time_passes():
    """The master's, as often as the fastest station asks for; none once it has ended."""
    nodes = {
        "axis": node_keys(number=3),
        "other": node_keys(number=4, heartbeat={"every": "10 ms", "lost_after": "50 ms"}),
    }
    made = master(nodes=nodes)
    made.wait(30 * MS)
    assert (made.network.frames, made.network.now, made.network.steps) == ([], 30 * MS, [30 * MS])
    made._beating, made._beat_due = True, 35 * MS
    made.wait(30 * MS)
    assert made.network.now == 60 * MS
    assert made.network.frames == [(time * MS, Frame(0x77F, b"\5")) for time in (35, 45, 55)]
    made.end_heartbeat()
    made.wait_until(200 * MS)
    assert len(made.network.frames) == 3


def test_a_wait_ends_as_soon_as_its_condition_holds():
    made = master()
    made._beating, made._beat_due = True, 10 * MS
    made.wait(100 * MS, lambda: made.network.now >= 20 * MS)
    assert made.network.now == 30 * MS


def test_frames_reach_their_station():
    made = master()
    hear = made.network.hear
    made.network.now = 9
    hear(Frame(0x703, b"\5"))
    hear(Frame(0x704, b"\5"))
    hear(Frame(0x003, b"\5"))
    hear(Frame(0x703, b"", remote=True))
    assert made.nodes["axis"].last_heartbeat_at == 9
    assert made.foreign_master.unknown_nodes == {4}
    assert isinstance(made.foreign_master, ForeignMasterMonitor)
    made.network.now = 60 * MS + 9
    assert not made.lost(made.nodes["axis"])
    made.network.now += 1
    assert made.lost(made.nodes["axis"])


def test_how_long_process_data_may_stay_away():
    assert (master().max_missed_cycles, master().oldest) == (5, 21_250_000)
    late = master(late_cycle={"at_most": "40 ms"})
    assert (late.max_missed_cycles, late.oldest) == (8, 40 * MS)
    assert (
        master(late_cycle={"at_most": "20 ms"}).max_missed_cycles,
        master(late_cycle={"at_most": "20 ms"}).oldest,
    ) == (5, 21_250_000)


def test_a_drive_that_watches_targets_has_no_period_where_the_file_says_so():
    watching = {"nodes": {"axis": node_keys("epos4", 3)}}
    for given, period in ((True, CYCLE), (False, 0)):
        made = master(**watching, late_cycle={"rpdo_timeout": given})
        assert made._target_period(made.nodes["axis"]) == period
        made = master(late_cycle={"rpdo_timeout": given})
        assert made._target_period(made.nodes["axis"]) == CYCLE


def test_the_end_of_waiting_for_a_drive():
    made = master()
    made.exchange = lambda: None
    node = made.nodes["axis"]
    done = []
    made.run_until(lambda: len(done) >= 3, 100 * MS, lambda: "", lambda: done.append(1))
    assert made.network.now == 3 * CYCLE
    with pytest.raises(SimulationError, match=r"^not enabled after 0\.02 s: axis\.$"):
        made.run_until(lambda: False, 20 * MS, lambda: "axis")
    assert made.network.now == 3 * CYCLE + 25 * MS
    node.silent = 20
    made.network.now = 0
    made.run_until(lambda: made.network.now > 0, 20 * MS, lambda: "axis")
    node.silent = 21
    text = r"^axis: no process data while it was brought up\. Check its power and the bus\.$"
    with pytest.raises(SimulationError, match=text):
        made.run_until(lambda: False, 20 * MS, lambda: "axis")
    node.silent, node.last_heartbeat_at = 0, -70 * MS
    with pytest.raises(SimulationError, match=r"^axis: no heartbeat while it was brought up"):
        made.run_until(lambda: False, 20 * MS, lambda: "axis")
    made.foreign_master.action = "Another one."
    with pytest.raises(SimulationError, match=r"^Another one\.$"):
        made.run_until(lambda: False, 20 * MS, lambda: "axis")


def test_answers_before_a_run_do_not_count():
    age = ValueAge(CYCLE)
    for cycle in range(3):
        age.synced(cycle * CYCLE)
    age.forget()
    age.received(2 * CYCLE + 100)
    assert age.sampled_at == 2 * CYCLE
    age.received(2 * CYCLE + 200)  # none is open
    assert age.sampled_at == 2 * CYCLE


@pytest.mark.parametrize("delay", [400_000, 1_390_000])
def test_after_a_single_loss_the_delay_of_before_tells_which_sync_is_answered(delay):
    """It was 0.4 ms, and may vary by a fifth of a cycle."""
    age = ValueAge(CYCLE)
    for cycle in range(10):
        age.synced(cycle * CYCLE)
        age.received(cycle * CYCLE + 400_000)
    age.synced(10 * CYCLE)
    for cycle in (11, 12, 13):
        age.synced(cycle * CYCLE)
        age.received(cycle * CYCLE + delay)
        assert age.sampled_at == cycle * CYCLE
        assert age.in_doubt is False


def test_an_answer_with_another_delay_is_late():
    """After a cycle without one, answers 5.4 ms after their SYNC: each of the SYNC before the last."""
    age = ValueAge(CYCLE)
    for cycle in range(10):
        age.synced(cycle * CYCLE)
        age.received(cycle * CYCLE + 400_000)
    age.synced(10 * CYCLE)
    sampled = []
    for cycle in range(11, 17):
        age.synced(cycle * CYCLE)
        age.received(cycle * CYCLE + 2_000_000)
        sampled.append(age.sampled_at // CYCLE - cycle)
    assert sampled == [-1] * 6
    assert age.in_doubt is False


def test_several_losses_are_in_doubt():
    age = ValueAge(CYCLE)
    for cycle in range(10):
        age.synced(cycle * CYCLE)
        age.received(cycle * CYCLE + 400_000)
    for cycle in range(10, 13):
        age.synced(cycle * CYCLE)
    age.received(12 * CYCLE + 400_000)
    assert age.in_doubt is True
    assert age.sampled_at == 10 * CYCLE  # the earliest that it can be
    age.forget()
    assert age.in_doubt is False
