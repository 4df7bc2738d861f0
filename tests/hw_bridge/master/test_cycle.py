"""Frames of a master over time, on a bus that records them: targets, SYNC, heartbeat; homing and approach of one drive."""

from types import SimpleNamespace

import pytest

from hw_bridge.bus import Frame, bit_count, never
from hw_bridge.dictionary import Mode, State
from hw_bridge.hardware import HardwareKeys
from hw_bridge.master import Master, homing
from hw_bridge.master.age import PATTERN, ValueAge
from hw_bridge.master.foreign_master import ForeignMasterMonitor
from tests.hw_bridge.axis import node as node_keys
from tests.hw_bridge.unconnected import WORDS, unconnected_node
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


@pytest.mark.parametrize(
    ("now", "planned", "synced", "due"),
    [
        (100.0, 100.0, 0.0, "lead"), (100.2, 100.0, 0.0, "window"), (100.0, 99.0, 0.0, "window"),
        (100.0, 100.0, 99.5, 103.25), (100.0, 100.0, 98.5, "lead"),  # at least three quarters of a cycle after the last one
        (100.0, None, 99.9, "window"),
    ],
)  # fmt: skip
def test_sync_keeps_to_the_plan(now, planned, synced, due):
    made = master(wall_clock=True)
    made.network.now, made._synced = round(now * MS), round(synced * MS)
    expected = {
        "lead": round((planned or 0) * MS) + made.lead, "window": round(now * MS) + made.window
    }.get(due) or round(due * MS)  # fmt: skip
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
        ({}, True), ({"started": False}, False), ({"boots": 1}, False),
    ],
)  # fmt: skip
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
    assert len(made.network.frames) == 3
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


class Cycles:
    """A master of one drive that follows its targets at once; `watch` of a search is called in every cycle."""

    def __init__(self, node, problems=()):
        self.node, self.cycle, self.targets, self.problems = node, CYCLE, [], list(problems)
        self.keys = SimpleNamespace(nodes={"axis": node.keys}, simulated=True, is_software=lambda: False)
        self.steps = []

    def run_cycle(self):
        self.targets.append(self.node.target_position)

    def check(self):
        return self.problems.pop(0) if self.problems else ""

    def emergencies(self):
        return " EMCY: none."

    def run_until(self, done, limit, what, watch=None):
        self.steps.append((limit, watch is not None))
        self.node.word = WORDS[State.ENABLED if self.node.goal is State.ENABLED else State.DISABLED] | (
            0x1400 if self.node.homing else 0
        )
        assert done()


@pytest.mark.parametrize(("start", "sign"), [(0.0003, 1), (-0.0003, -1)])
def test_a_start_position_is_approached_at_the_homing_speed(start, sign):
    """20 mm/s are 0.1 mm in a cycle; then it rests for 200 ms."""
    node = unconnected_node(homing={"method": 37, "speed": "20 mm/s"})
    node.entered_from = 0.0
    cycles = Cycles(node)
    homing.approach(cycles, node, start)
    assert cycles.targets[:3] == pytest.approx([sign * 1e-4, sign * 2e-4, sign * 3e-4])
    assert cycles.targets[3:] == [start] * 40 or cycles.targets[4:] == [start] * 40
    assert (node.mode, node.entered_from) == (Mode.CSP, None)
    with pytest.raises(SimulationError, match=r"^too fast$"):
        homing.approach(Cycles(node, ["", "too fast"]), node, 0.0)


def test_a_search_of_the_reference():
    """Method and speeds, the drive's own force lowered meanwhile; the reference is at -20 mm, then it has no power."""
    keys = {"homing": {"method": -3, "at": "-20 mm", "speed": "15 mm/s", "timeout": "9 s"}, "limits": {"force": "4 N"}}
    node = unconnected_node(**keys)
    lowered = homing.lowered_for_homing(node, lambda index, sub: node.server.dictionary.values[index, sub])
    before = [(limit.index, limit.sub, limit.value, limit.before) for limit in lowered]
    assert before
    cycles = Cycles(node)
    homing.Homing(cycles, node).carry_out()
    down = [(index, sub, value) for index, sub, value, _ in before]
    up = [(index, sub, value) for index, sub, _, value in before]
    assert node.server.written == [*down, (0x6098, 0, -3), (0x6099, 1, 15), (0x6099, 2, 7), *up]
    assert cycles.steps == [(2_000 * MS, True), (9_000 * MS, True), (2_000 * MS, False)]
    assert len(cycles.targets) == 4
    assert (node.origin, node.entered_from, node.goal, node.homing) == (0.02, -0.02, State.DISABLED, False)


def search(inverted=False, method=-3, word=WORDS[State.ENABLED], **more):
    """A search that has begun at 1 mm."""
    limits = {"force": "5 N", "velocity": "100 mm/s", "position": ["-25 mm", "35 mm"], "following_error": "2 mm"}
    at = "30 mm" if inverted else "-20 mm"
    node = unconnected_node(
        inverted=inverted,
        homing={"method": method, "at": at},
        limits=limits,
        force_constant=f"{0.01 / 0.79e-3} N/A",
        **more,
    )
    node.word, node.raw_position = word, 1000
    made = homing.Homing(Cycles(node), node)
    made.watch()
    return made, node


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"raw_current": 499}, ""), ({"raw_velocity": -100}, ""),
        ({"raw_current": -501}, "axis: homing by method -3: force -5.01 N is above 5 N. Is it blocked? Lower the drive's own torque limit for homing, or check limits.force."),
        ({"raw_velocity": 101}, "axis: homing by method -3: velocity 101.00 mm/s is above 100.00 mm/s."),
        ({"raw_position": 2990}, ""), ({"raw_position": -64_900}, ""),
        ({"raw_position": 3010}, "axis: homing by method -3 goes to the positive end instead of the negative one. It is not taken for -20.00 mm. Correct method, `at` or `inverted`."),
        ({"raw_position": -65_100}, "axis: homing went 66.10 mm and found nothing; the limits are 60.00 mm apart. Check switches, method and direction."),
        ({"raw_position": -99_000, "word": WORDS[State.SWITCHED_ON]}, ""),
        ({"raw_position": -99_000, "word": WORDS[State.ENABLED] | 0x1000}, ""),
    ],
)  # fmt: skip
def test_a_search_keeps_to_the_limits(values, text):
    made, node = search()
    for name, value in values.items():
        setattr(node, name, value)
    if not text:
        made.watch()
        return
    with pytest.raises(SimulationError) as caught:
        made.watch()
    assert str(caught.value) == text


def test_a_search_of_an_inverted_drive_goes_the_other_way():
    made, node = search(inverted=True)
    node.raw_position = -20_000
    made.watch()
    node.raw_position = 3010
    with pytest.raises(
        SimulationError, match=r"goes to the negative end instead of the positive one\. It is not taken for 30\.00 mm"
    ):
        made.watch()


@pytest.mark.parametrize(
    ("word", "done", "text"),
    [
        (WORDS[State.ENABLED], False, ""), (WORDS[State.ENABLED] | 0x1000, False, ""), (WORDS[State.ENABLED] | 0x0400, False, ""),
        (WORDS[State.ENABLED] | 0x1400, True, ""),
        (WORDS[State.ENABLED] | 0x3400, True, "axis: homing by method -3 ended with an error. EMCY: none."),
        (WORDS[State.QUICK_STOP], True, "axis: homing by method -3 was left: Quick stop active. EMCY: none."),
    ],
)  # fmt: skip
def test_the_end_of_a_search(word, done, text):
    made, node = search()
    node.word = word
    if not text:
        assert made._done() is done
        return
    with pytest.raises(SimulationError) as caught:
        made._done()
    assert str(caught.value) == text


@pytest.mark.parametrize(
    ("start", "text"),
    [
        (-0.025, ""), (0.035, ""),
        (-0.0251, "axis: begins at -25.10 mm, outside of limits.position, -25.00 mm to 35.00 mm."),
        (0.0351, "axis: begins at 35.10 mm, outside of limits.position, -25.00 mm to 35.00 mm."),
    ],
)  # fmt: skip
def test_where_a_scenario_may_begin_after_homing(start, text):
    _, node = search()
    assert homing.problem(node, start) == text
    assert homing.problem(unconnected_node(), 9.0) == ""
    _, node = search(method=-4)
    assert homing.problem(node, 0.0).startswith("axis: homing: method -4 goes to the positive end, but `at` -20.00 mm")


def test_answers_before_a_run_do_not_count():
    age = ValueAge(CYCLE)
    for cycle in range(3):
        age.synced(cycle * CYCLE)
    age.forget()
    age.received(2 * CYCLE + 100)
    assert age.sampled_at == 2 * CYCLE
    age.received(2 * CYCLE + 200)  # none is open
    assert age.sampled_at == 2 * CYCLE
