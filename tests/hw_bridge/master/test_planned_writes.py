"""Every write of a set-up, in its order, from the values that a drive holds: of its parameters and its process data."""

import pytest

from hw_bridge.dictionary import State
from hw_bridge.master.plan import plan_drive
from hw_bridge.master.restoration import restore
from hw_bridge.master.setup import carry_out, configure, limit_positions, release
from hw_bridge.master.writes import clamp_to_range, write, write_if_present
from hw_bridge.profiles.rows import pdo
from tests.hw_bridge.unconnected import WORDS, unconnected_node
from twin.errors import SimulationError

CYCLE = 5_000_000
LINE = {
    "velocity": "100 mm/s",
    "acceleration": "2 m/s^2",
    "following_error": "1.5 mm",
    "position": ["-10 mm", "20 mm"],
}
TURN = {
    "velocity": "50 rad/s",
    "acceleration": "100 rad/s^2",
    "following_error": "0.2 rad",
    "position": ["-1 rad", "3 rad"],
    "force": "0.1 N*m",
}
HEARTBEATS = [(0x1016, 1, 127 << 16 | 60), (0x1017, 0, 20)]


def planned(node, master=127, **options):
    """The plan of a run, and its writes outside of process data: index, subindex, value."""
    plan = plan_drive(node, options.get("period", CYCLE), master)
    return plan, [(row.index, row.sub, row.value) for row in plan.writes if not 0x1400 <= row.index < 0x1C00]


def test_parameters_of_an_inverted_drive_at_half_of_its_scale():
    """In the motor's units twice as much: 1 um, 1 mm/s, 1 mm/s^2. Its ends change places: 10 mm are -20 of the motor."""
    node = unconnected_node(limits=LINE, inverted=True, scale=0.5)
    plan, writes = planned(node)
    assert writes == [
        (0x6007, 0, 3),
        (0x60C2, 1, 5),
        (0x6083, 0, 4000),
        (0x6084, 0, 4000),
        (0x6085, 0, 4000),
        (0x607F, 0, 200),
        (0x6080, 0, 200),
        (0x6081, 0, 200),
        (0x6065, 0, 3000),
        (0x607D, 1, -46_000),
        (0x607D, 2, 26_000),
        (0x6060, 0, 9),
        *HEARTBEATS,
    ]
    assert [row.index for row in plan.writes if row.later] == [0x607D, 0x607D, 0x6060]
    assert (plan.problems, plan.refused, plan.notes, plan.sizes()) == ([], [], [], [])
    assert node.server.written == []


def test_parameters_of_a_drive_that_counts_revolutions():
    """2000 increments a revolution; 1/min, which become mrpm, and 1/min/s; rounded up to whole units."""
    node = unconnected_node("epos4", limits=TURN, inverted=True, scale=0.5)
    _, writes = planned(node)
    assert writes == [
        (0x60A9, 0, 0xFDB44700),
        (0x605A, 0, 2),
        (0x60C2, 1, 5),
        (0x6083, 0, 1910),
        (0x6084, 0, 1910),
        (0x6085, 0, 1910),
        (0x607F, 0, 954_930),
        (0x6080, 0, 954_930),
        (0x6081, 0, 954_930),
        (0x6065, 0, 128),
        (0x607D, 1, -2165),
        (0x607D, 2, 891),
        (0x6060, 0, 9),
        *HEARTBEATS,
    ]


def test_values_that_a_drive_holds_already_are_not_written():
    node = unconnected_node(limits=LINE)
    values = {(index, sub): value for index, sub, value in planned(node)[1]}
    own = planned(unconnected_node(values=values, limits=LINE))[1]
    assert own == [(0x6060, 0, 9)], "the mode, which process data write in each cycle"


def test_process_data_are_disabled_remapped_and_enabled():
    node = unconnected_node(follow={"feedforward": 1.0}, outputs={0: "a.b"}, safe_outputs=2)
    node.has_target_force = True
    node.use_process_data()
    values = {
        (index + number, sub): 0xEE
        for index in (0x1400, 0x1600, 0x1800, 0x1A00)
        for number in range(4)
        for sub in (0, 1, 2, 3)
        if sub in node.server.dictionary.objects.get(index + number, {})
    }
    node.server.dictionary.values.update(values)
    plan = plan_drive(node, CYCLE, 127)
    rows = [(row.index, row.sub, row.value) for row in plan.writes if 0x1400 <= row.index < 0x1C00]

    def pdo(index, identifier, *words):
        return [
            (index, 1, 0x80000000 | identifier),
            (index, 2, 1),
            (index + 0x200, 0, 0),
            *((index + 0x200, sub, word) for sub, word in enumerate(words, 1)),
            (index + 0x200, 0, len(words)),
            (index, 1, identifier),
        ]

    assert rows == [
        *pdo(0x1400, 0x203, 0x607A0020, 0x60B10020),
        *pdo(0x1800, 0x183, 0x60410010, 0x60610008, 0x60640020),
        *pdo(0x1401, 0x303, 0x60400010, 0x60600008, 0x60FF0020),
        *pdo(0x1801, 0x283, 0x606C0020, 0x60770010),
        *pdo(0x1402, 0x403, 0x60710010),
        (0x1802, 1, 0x80000383),
        *pdo(0x1403, 0x503, 0x60FE0120),
        (0x1803, 1, 0x80000483),
    ]


@pytest.mark.parametrize(
    ("keys", "speed", "zero", "lowered"),
    [
        ({"homing": {"method": -3, "at": "4 mm", "speed": "15 mm/s"}}, 15, -4000, True),
        ({"homing": {"method": -3, "at": "4 mm", "speed": "15 mm/s"}, "inverted": True}, 15, 4000, True),
        ({"homing": {"method": -3, "at": "4 mm", "speed": "1 mm/s"}, "scale": 0.5}, 2, -8000, False),
    ],
)
def test_objects_of_homing_come_later(keys, speed, zero, lowered):
    """Positions of the drive count from its reference, which is at 4 mm."""
    node = unconnected_node(limits={**LINE, "force": "4 N" if lowered else "500 N"}, **keys)
    plan, writes = planned(node)
    later = [(row.index, row.sub, row.value) for row in plan.writes if row.later]
    sign, scale = -1 if node.keys.inverted else 1, node.keys.scale
    ends = sorted(sign * round(end / scale) for end in (-10_000, 20_000))
    margin = round(3000 / scale)
    force = [row for row in later if row[0] in (0x60E0, 0x60E1, 0x6072, 0x2350, 0x2351)]
    assert [row for row in later if row not in force] == [
        (0x6098, 0, -3),
        (0x6099, 1, speed),
        (0x6099, 2, max(speed // 2, 1)),
        (0x607D, 1, ends[0] - margin + zero),
        (0x607D, 2, ends[1] + margin + zero),
        (0x6060, 0, 9),
    ]
    assert all(value == int(0.8 * 4.0 / 11.64 / 0.79e-3) for *_, value in force)
    assert bool(force) is lowered
    assert len(writes) == len({row[:2] for row in writes})


@pytest.mark.parametrize(
    ("limits", "text"),
    [
        (
            {"velocity": "0.9 mm/s"},
            "axis: limits.velocity is 0.0009, less than one unit of the drive, 0.001 (SI). Raise it.",
        ),
        ({"velocity": "1 mm/s"}, ""),
        (
            {"following_error": "0.9 um", "velocity": "1 mm/s"},
            "axis: limits.following_error is 9e-07, less than one unit of the drive, 1e-06 (SI). Raise it.",
        ),
        (
            {"acceleration": "0.9 mm/s^2", "velocity": "1 mm/s"},
            "axis: limits.acceleration is 0.0009, less than one unit of the drive, 0.001 (SI). Raise it.",
        ),
    ],
)
def test_a_limit_of_less_than_a_unit_of_the_drive(limits, text):
    plan, _ = planned(unconnected_node(limits=limits))
    assert plan.problems == ([text] if text else [])


@pytest.mark.parametrize(("limit", "units"), [("5 um", 5), ("4.99 um", 5), ("5.01 um", 6), ("66 um", 66)])
def test_whole_units_are_not_rounded_up(limit, units):
    """0.005 mm are five units of 1 um; their quotient in floating point is 5.000000000000001."""
    _, writes = planned(unconnected_node(limits={"following_error": limit, "velocity": "100 mm/s"}))
    assert [value for index, _, value in writes if index == 0x6065] == [units]


def test_a_homing_speed_of_less_than_a_unit_of_the_drive():
    plan, writes = planned(unconnected_node(homing={"method": 37, "speed": "0.4 mm/s"}))
    assert plan.problems == ["axis: homing.speed 0.40 mm/s is less than the drive can count, 1.00 mm/s. Raise it."]
    assert {(0x6099, 1, 1), (0x6099, 2, 1)} <= set(writes)


def test_what_a_missing_or_wrong_object_does_to_a_plan():
    plan, writes = planned(unconnected_node(missing=[0x6007], limits=LINE))
    why = "in csv and pv it may go on when this program dies. Correct it, or add `follow: {mode: csp}`, with which it stands"
    assert plan.problems == [f"axis: has no 6007h Abort connection option code: {why} at its last target."]
    plan, _ = planned(unconnected_node(missing=[0x6007], limits=LINE, follow={"mode": "csp"}))
    assert plan.problems == []
    plan, _ = planned(unconnected_node(values={(0x607C, 0): 5}, limits=LINE, homing={"method": 37}))
    assert plan.problems == [
        (
            "axis: 607Ch is 5, so that the drive does not count 0 at its reference as `homing.at` expects. Set it to 0: "
            "twin hil set 3 607Ch '0 raw'."
        )
    ]
    plan, writes = planned(unconnected_node(values={(0x60B0, 0): 0, (0x60B1, 0): 7, (0x60B2, 0): -1}, limits=LINE))
    assert [row for row in writes if row[0] in (0x60B0, 0x60B1, 0x60B2)] == [(0x60B1, 0, 0), (0x60B2, 0, 0)]


def test_outputs_are_safe_before_their_mask_opens():
    node = unconnected_node(values={(0x60FE, 1): 9, (0x60FE, 2): 0x10}, outputs={0: "a.b", 3: "a.c"}, safe_outputs=2)
    _, writes = planned(node)
    assert [row for row in writes if row[0] == 0x60FE] == [(0x60FE, 1, 2), (0x60FE, 2, 0x19)]
    _, writes = planned(unconnected_node(values={(0x60FE, 1): 9}))
    assert [row for row in writes if row[0] == 0x60FE] == []


def test_the_consumer_heartbeat_is_cleared_before_it_is_changed():
    """An entry in use may not be changed (CiA 301)."""
    _, writes = planned(unconnected_node(heartbeat={"every": "30 ms", "lost_after": "90 ms"}), master=5)
    assert writes[-2:] == [(0x1016, 1, 5 << 16 | 90), (0x1017, 0, 30)]
    for stored in (5 << 16 | 90, 4 << 16, 90, 200 << 16 | 90):  # its own; of no time, of no node
        _, writes = planned(unconnected_node(values={(0x1016, 1): stored}), master=5)
        assert writes[-3:] == [(0x1016, 1, 0), (0x1016, 1, 5 << 16 | 60), (0x1017, 0, 20)]


@pytest.mark.parametrize(
    ("first", "second", "entry"), [(4 << 16 | 90, 0, 2), (0, 4 << 16 | 90, 1), (0, 5 << 16 | 90, 2), (0, 0, 1)]
)
def test_heartbeats_of_another_node_stay_watched_beside_those_of_this_program(first, second, entry):
    """Another node may be a safety controller. An entry that watches this program already comes before a free one."""
    values = {(0x6041, 0): WORDS[State.DISABLED], (0x1016, 1): first, (0x1016, 2): second}
    node = unconnected_node("epos4", limits=TURN, values=values)
    configure(node, CYCLE, 5)
    after = {1: first, 2: second} | {entry: 5 << 16 | 60}
    assert {sub: node.server.dictionary.get(0x1016, sub) for sub in (1, 2)} == after
    node.server.written.clear()
    release(node)
    assert [row for row in node.server.written if row[0] == 0x1016] == [(0x1016, entry, 0)]
    node.server.dictionary.values[0x6041, 0] = WORDS[State.DISABLED]
    restore(node)
    assert {sub: node.server.dictionary.get(0x1016, sub) for sub in (1, 2)} == {1: first, 2: second}


@pytest.mark.parametrize("in_profile", [False, True])
def test_receive_process_data_beyond_those_of_a_run_are_disabled_and_restored(in_profile):
    """Another master could command the drive by them, at an identifier that no monitor knows."""
    node = unconnected_node(values={(0x6041, 0): WORDS[State.DISABLED]})
    more = pdo(5, 0x21A, (0x60400010,), receive=True, objects=4) + pdo(6, 0x21B, (), receive=True, objects=4)
    for dictionary in (node.server.dictionary, node.mirror)[: 1 + in_profile]:
        for entry in more:
            dictionary.objects.setdefault(entry.index, {})[entry.sub] = entry
    values = node.server.dictionary.values
    values.update({(0x1404, 1): 0x21A, (0x1405, 1): 0x8000021B})
    configure(node, CYCLE, 127)
    assert (values[0x1404, 1], values[0x1405, 1]) == (0x8000021A, 0x8000021B)
    values[0x6041, 0] = WORDS[State.DISABLED]
    restore(node)
    assert (values[0x1404, 1], values[0x1405, 1]) == (0x21A, 0x8000021B)
    assert node.journal.changes == {}


def test_a_drive_that_can_watch_no_other_node_is_refused():
    plan, _ = planned(unconnected_node(values={(0x1016, 1): 5 << 16 | 100}))
    problem = (
        "axis: 1016h has no free entry for this program's heartbeat (node 127): 1016h.1 watches node 5 (100 ms). Clear one "
        "that nothing needs: twin hil set 3 1016h.1 0."
    )
    assert plan.problems == [problem]
    values = {(0x1016, 1): 5 << 16 | 100, (0x1016, 2): 6 << 16 | 200}
    plan, _ = planned(unconnected_node("epos4", limits=TURN, values=values))
    assert "1016h.1 watches node 5 (100 ms), 1016h.2 watches node 6 (200 ms)." in plan.problems[0]


@pytest.mark.parametrize(("period", "counted"), [(5_000_000, [5]), (255_000_000, [255]), (0, [0])])
def test_the_interpolation_period_is_that_of_the_targets(period, counted):
    node = unconnected_node(values={(0x60C2, 1): 9, (0x60C2, 2): -6})
    plan = plan_drive(node, period, 127)
    rows = [(row.sub, row.value) for row in plan.writes if row.index == 0x60C2]
    assert rows == [(1, counted[0]), (2, -3)]


def test_everything_is_recorded_before_the_first_write_and_read_back():
    node = unconnected_node(limits=LINE)
    configure(node, CYCLE, 127)
    plan = plan_drive(unconnected_node(limits=LINE), CYCLE, 127)
    now = [(row.index, row.sub, row.value) for row in plan.writes if not row.later]
    assert node.server.written == [(0x6040, 0, 0), *now]
    recorded = node.journal.changes
    assert set(recorded) == {(row.index, row.sub) for row in plan.writes}
    assert all(
        bool(change.written) is (address not in {(0x607D, 1), (0x607D, 2), (0x6060, 0)})
        for address, change in recorded.items()
    )
    assert recorded[0x6083, 0].written == [(2000).to_bytes(4, "little")]
    assert recorded[0x6083, 0].reason == "limits.acceleration"


def test_a_problem_or_a_value_that_does_not_fit_prevents_all_writes():
    node = unconnected_node(missing=[0x6041], limits=LINE)
    plan = plan_drive(node, CYCLE, 127)
    with pytest.raises(SimulationError, match="has no 6041h Statusword"):
        carry_out(plan)
    node = unconnected_node(limits=LINE)
    plan = plan_drive(node, CYCLE, 127)
    plan.add(0x6060, 0, 200, "a byte with a sign")
    with pytest.raises(SimulationError) as caught:
        carry_out(plan)
    assert (
        str(caught.value) == "axis: 6060h.0 cannot hold 200: it has 1 bytes, signed. Check the value and the profile."
    )
    assert node.server.written == []
    assert node.journal.changes == {}


def test_a_write_that_has_no_effect_or_is_refused():
    node = unconnected_node()
    write(node, 0x6083, 0, 77, "first")
    assert node.mirror.get(0x6083) == 77
    node.server.ignored.add((0x6083, 0))
    with pytest.raises(SimulationError, match=r"^axis: 6083h\.0 reads 77 after 78 was written\.$"):
        write(node, 0x6083, 0, 78)
    node.server.refused.add((0x6085, 0))
    with pytest.raises(
        SimulationError, match=r"^axis: node 3: 6085h\.0: refused with 06010002h, .* It was to become 5\.$"
    ):
        write(node, 0x6085, 0, 5)
    write(node, 0x6060, 0, -1, lasting=True)
    assert node.mirror.get(0x6060) == -1
    assert set(node.journal.changes) == {(0x6083, 0), (0x6085, 0)}


def test_values_are_clamped_to_the_range_of_their_object():
    node = unconnected_node()
    entry = node.mirror.entry(0x6071)
    assert [clamp_to_range(entry, value) for value in (-6001, -6000, 0, 6000, 6001)] == [-6000, -6000, 0, 6000, 6000]
    assert clamp_to_range(node.mirror.entry(0x6064), 10**9) == 10**9
    write_if_present(node, 0x6071, 0, 7000)
    write_if_present(node, 0x6041, 0, 7)  # read only
    write_if_present(node, 0x9999, 0, 7)
    assert node.server.written == [(0x6071, 0, 6000)]


def test_software_limits_go_with_the_reference():
    node = unconnected_node(limits=LINE)
    node.raw_position = 5000
    node.zero(0.0)
    limit_positions(node)
    assert node.server.written == [(0x607D, 1, -8000), (0x607D, 2, 28_000)]
