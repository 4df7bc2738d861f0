"""Search of a reference and approach of the start position, of one drive without a bus: writes, limits, ends."""

from types import SimpleNamespace

import pytest

from hw_bridge.dictionary import Mode, State
from hw_bridge.master import homing
from tests.every_case import every_case
from tests.hw_bridge.unconnected import WORDS, unconnected_node
from twin.errors import SimulationError

MS = 1_000_000
CYCLE = 5 * MS


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
        while not done():
            self.run_cycle()


@pytest.mark.parametrize(("start", "sign"), [(0.00025, 1), (-0.00025, -1)])
def test_a_start_position_is_approached_at_the_homing_speed(start, sign):
    """20 mm/s are 0.1 mm in a cycle; then it rests for 200 ms."""
    node = unconnected_node(homing={"method": 37, "speed": "20 mm/s"})
    node.entered_from = 0.0
    cycles = Cycles(node)
    homing.approach(cycles, node, start)
    assert cycles.targets[:3] == pytest.approx([sign * 1e-4, sign * 2e-4, start])
    assert cycles.targets[3:] == [start] * 40
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
    assert cycles.steps == [(2_000 * MS, True), (2_000 * MS, True), (9_000 * MS, True), (2_000 * MS, False)]
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


@every_case(
    ("values", "text"),
    [
        ({"raw_current": 499}, ""),
        ({"raw_velocity": -100}, ""),
        (
            {"raw_current": -501},
            "axis: homing by method -3: force -5.01 N is above 5 N. Is it blocked? Lower the drive's own torque limit for homing, or check limits.force.",
        ),
        ({"raw_velocity": 101}, "axis: homing by method -3: velocity 101.00 mm/s is above 100.00 mm/s."),
        ({"raw_position": 2990}, ""),
        ({"raw_position": -64_900}, ""),
        (
            {"raw_position": 3010},
            "axis: homing by method -3 goes to the positive end instead of the negative one. It is not taken for -20.00 mm. Correct method, `at` or `inverted`.",
        ),
        (
            {"raw_position": -65_100},
            (
                "axis: homing went 66.10 mm and found nothing; the limits are 60.00 mm apart. If the stroke is longer than the limits, "
                "move it away from the far end first (twin hil jog axis). Else check switches, method and direction."
            ),
        ),
        ({"raw_position": -99_000, "word": WORDS[State.SWITCHED_ON]}, ""),
        ({"raw_position": -99_000, "word": WORDS[State.ENABLED] | 0x1000}, ""),
    ],
)
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


@every_case(
    ("word", "done", "text"),
    [
        (WORDS[State.ENABLED], False, ""),
        (WORDS[State.ENABLED] | 0x1000, False, ""),
        (WORDS[State.ENABLED] | 0x0400, False, ""),
        (WORDS[State.ENABLED] | 0x1400, True, ""),
        (WORDS[State.ENABLED] | 0x3400, True, "axis: homing by method -3 ended with an error. EMCY: none."),
        (WORDS[State.QUICK_STOP], True, "axis: homing by method -3 was left: Quick stop active. EMCY: none."),
    ],
)
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
        (-0.025, ""),
        (0.035, ""),
        (-0.0251, "axis: begins at -25.10 mm, outside of limits.position, -25.00 mm to 35.00 mm."),
        (0.0351, "axis: begins at 35.10 mm, outside of limits.position, -25.00 mm to 35.00 mm."),
    ],
)
def test_where_a_scenario_may_begin_after_homing(start, text):
    _, node = search()
    assert homing.problem(node, start) == text
    assert homing.problem(unconnected_node(), 9.0) == ""
    _, node = search(method=-4)
    assert homing.problem(node, 0.0).startswith("axis: homing: method -4 goes to the positive end, but `at` -20.00 mm")


@pytest.mark.parametrize(
    ("problem", "raw", "at", "inverted", "is_kept"),
    [
        ("", 10_000, "0 mm", False, True),
        ("", 10_000, "20 mm", False, True),
        ("", 10_000, "26 mm", False, False),
        ("", 10_000, "-20 mm", True, False),
        ("", 10_000, "-10 mm", True, True),
        ("", -26_000, "0 mm", False, False),
        ("pushed.", 10_000, "0 mm", False, False),
    ],
)
def test_a_reference_is_kept_within_the_limits_of_position(monkeypatch, problem, raw, at, inverted, is_kept):
    """From -25 to 35 mm: the drive counts from its reference, which is `at` there."""
    forgotten = []
    reference = SimpleNamespace(problem=lambda node: problem, forget=lambda: forgotten.append(1))
    monkeypatch.setattr(homing, "Reference", lambda *_: reference)
    limits = {"position": ["-25 mm", "35 mm"]}
    node = unconnected_node(inverted=inverted, homing={"method": 37, "at": at}, limits=limits)
    node.origin, node.raw_position = 0.123, raw
    assert homing.keep_reference(Cycles(node), node) is is_kept
    assert len(forgotten) == is_kept
    if is_kept:
        counted = node.keys.homing.at + (-0.01 if inverted else 0.01)
        assert (node.position, node.entered_from) == (pytest.approx(counted), pytest.approx(counted))
        return
    assert (node.origin, node.entered_from) == (0.123, None)
