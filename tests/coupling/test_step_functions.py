"""Functions of a step, interpreted over memory: calls in their order, times, rollback, acceptance, accelerations."""

import ctypes
from types import SimpleNamespace

import numpy as np
import pytest

from tests.every_case import every_case
from twin.compiler import machine
from twin.coupling.execution import loop
from twin.coupling.execution.value_memory import bits
from twin.coupling.variable_step import explicit_step, stepping
from twin.coupling.variable_step.input_extrapolation import USES
from twin.coupling.variable_step.record_layout import BEFORE, BEGIN, EARLY, FINAL, LAST, NODES

COPY, ACCESS_ROW, STEP_ROW = 24, 56, 56


class Calls:
    """Functions that the loop can call by their address; the journal has what they were called with."""

    def __init__(self):
        self.journal, self.memory, self.answers, self.functions = [], [], {}, {}

    def address(self, kind, function):
        self.memory.append(kind(function))
        return ctypes.cast(self.memory[-1], ctypes.c_void_p).value

    def array(self, rows, dtype=np.int64):
        self.memory.append(np.array(rows, dtype))
        return int(self.memory[-1].ctypes.data)

    def access(self, name, member=0, size=3):
        """A row of a getter or setter."""

        def call(instance, references, count, values, size):
            self.journal.append((name, instance, references, count, values, size))
            return self.answers.get(name, 0)

        self.functions[name] = self.address(machine.ACCESS, call)
        return [self.functions[name], 11, 12, 13, 14, size, member]

    def step(self, name, member=0, flags=(0.0, 0.0, 0.0, 0.0)):
        """A row of a step; `flags`: terminate and early return, and the last successful time."""
        block = np.zeros(4)
        for index, flag in enumerate(flags[:3]):
            block.view(np.uint8)[8 * index] = flag
        block[3] = flags[3]
        self.memory.append(block)

        def call(instance, t, h, final, *_):
            self.journal.append((name, t, h, final))
            return self.answers.get(name, 0)

        self.functions[name] = self.address(machine.STEP, call)
        return [self.functions[name], machine.FMI3, 21, int(block.ctypes.data), 0, 0, member]

    def operation(self, copies=(), accesses=(), steps=(), divider=1, h=0.0, converts=()):
        """An operation of the loop."""
        table = [divider, 0, bits(h)]
        for rows in (copies, converts, accesses, steps):
            table += [self.array(rows), len(rows)] if rows else [0, 0]
        return table


def state(**fields):
    """A record of the loop as an object, all zero but some fields."""
    names = dict.fromkeys(loop.RECORD.names, 0)
    return SimpleNamespace(**names | fields)


def test_an_operation_moves_then_calls_then_steps():
    calls, values = Calls(), np.array([1.0, 2.0, 3.0])
    at, f8 = int(values.ctypes.data), loop.KINDS["f8"]
    copies, converts = [[at, at + 8, 1]], [[at + 8, f8, at + 16, f8, 1, bits(-2.0), bits(0.5)]]
    accesses = [calls.access("set")]
    steps = [calls.step("a", 4), calls.step("b", 5)]
    own = state(trial=0)
    row = calls.array([calls.operation(copies, accesses, steps, converts=converts)])
    assert explicit_step.perform(own, row, 1.0, 0.5) == 0
    assert values.tolist() == [1.0, 1.0, -1.5]
    assert calls.journal == [("set", 11, 12, 13, 14, 3), ("a", 1.0, 0.5, True), ("b", 1.0, 0.5, True)]
    assert (own.ending, own.status, own.member) == (0, 0, 0)
    own.trial = 1
    assert explicit_step.perform(own, row, 2.0, 0.25) == 0
    assert calls.journal[3:] == [("set", 11, 12, 13, 14, 3), ("a", 2.0, 0.25, False), ("b", 2.0, 0.25, False)]


@every_case(("status", "goes_on"), [(1, True), (2, False), (3, False)])
@every_case("refusing", ["set", "a"])
def test_a_status_above_a_warning_ends_an_operation(refusing, status, goes_on):
    calls = Calls()
    calls.answers[refusing] = status
    own = state(trial=1)
    row = calls.array([calls.operation((), [calls.access("set", 6)], [calls.step("a", 7), calls.step("b", 8)])])
    assert explicit_step.perform(own, row, 0.0, 1.0) == (0 if goes_on else status)
    names = [name for name, *_ in calls.journal]
    assert names == (["set", "a", "b"] if goes_on else ["set", "a"][: 1 + (refusing == "a")])
    assert (own.member, own.status) == ((0, 0) if goes_on else (6 if refusing == "set" else 7, status))


@every_case(
    ("flags", "trial", "expected"),
    [
        ((0, 0, 0, 0.0), 1, (0, 0, 0.0)),
        ((1, 0, 0, 0.0), 1, (0, 0, 0.0)),  # FMI's eventHandlingNeeded alone
        ((0, 0, 1, 1.25), 0, (EARLY, 0, 1.25)),
        ((0, 0, 1, 1.5), 0, (0, 0, 0.0)),  # at the end of its step
        ((0, 1, 0, 1.5), 0, (0, 8, 0.0)),
        ((0, 1, 0, 1.25), 0, (0, 8, 0.0)),
        ((0, 1, 0, 1.25), 1, (EARLY, 8, 1.25)),  # steps can be repeated up to where it ends
        ((0, 1, 0, 1.5), 1, (0, 8, 0.0)),
    ],
)
def test_flags_of_a_step_from_1_s_by_half_a_second(flags, trial, expected):
    calls, own = Calls(), state(trial=trial)
    row = calls.array([calls.operation((), (), [calls.step("a", 7, flags)])])
    result = explicit_step.perform(own, row, 1.0, 0.5)
    assert (result, own.ending, own.until) == expected
    assert (own.member, own.status) == ((7, EARLY) if result else (0, 0))


def test_operations_of_members_with_a_period_happen_when_they_are_due():
    calls = Calls()
    rows = [calls.operation((), (), [calls.step(f"every {n}")], n, n / 10) for n in (1, 2, 3)]
    table = calls.array(rows)
    own = state(begin_ns=100, step_ns=1, per_second=10)
    for own.tick in range(4):
        assert explicit_step.periodic(own, table, 3, 0) == 0
    begins = [(name, t, h) for name, t, h, _ in calls.journal]
    assert begins == [
        *(("every 1", 10.0, 0.1), ("every 2", 10.0, 0.2), ("every 3", 10.0, 0.3)),
        *(("every 1", 10.1, 0.1), ("every 1", 10.2, 0.1), ("every 2", 10.2, 0.2)),
        *(("every 1", 10.3, 0.1), ("every 3", 10.3, 0.3)),
    ]
    calls.journal.clear()
    own.tick = 1
    explicit_step.periodic(own, table, 3, 1)
    assert [name for name, *_ in calls.journal] == ["every 1", "every 2"], "at the end of the tick"
    calls.answers["every 1"] = 3
    assert explicit_step.periodic(own, table, 3, 0) == 3


def test_a_sweep_goes_stage_by_stage_and_part_by_part():
    """Two stages; the first one's members make their step in two parts, and publish before the second stage."""
    calls, values = Calls(), np.arange(4.0)
    at = int(values.ctypes.data)
    moves = [calls.operation([[at, at + 8, 1]]), calls.operation([[at + 16, at + 24, 1]])]
    gets = calls.array([calls.operation((), [calls.access("get")])])
    stages = []
    for index, (names, parts) in enumerate([(("a1", "a2"), ((0.0, 0.75), (0.75, 0.25))), (("b",), ((0.0, 1.0),))]):
        rows = [
            [0, 0, calls.array([calls.operation((), (), [calls.step(name)])]), bits(begin), bits(length)]
            for name, (begin, length) in zip(names, parts, strict=True)
        ]
        stages.append([calls.array([moves[index]]), 0, gets if index == 0 else 0, calls.array(rows), len(rows)])
    own = state(stages=calls.array(stages), stage_count=2, trial=1, ending=3, sweeps=4)
    assert explicit_step.sweep(own, 2.0, 0.5) == 0
    assert (own.sweeps, own.ending) == (5, 0)
    assert [one[:3] for one in calls.journal] == [
        ("a1", 2.0, 0.375),
        ("a2", 2.375, 0.125),
        ("get", 11, 12),
        ("b", 2.0, 0.5),
    ]
    assert values.tolist() == [0.0, 0.0, 2.0, 2.0]
    for name, count in (("get", 3), ("a1", 1), ("b", 4)):
        calls.answers, before = {name: 2}, len(calls.journal)
        assert explicit_step.sweep(own, 2.0, 0.5) == 2
        assert len(calls.journal) - before == count
    values[:] = np.arange(4.0)
    explicit_step.read_connections(own)
    assert values.tolist() == [0.0, 0.0, 2.0, 2.0]
    own.stage_count, values[0], calls.answers = 1, 7.0, {}
    explicit_step.sweep(own, 2.0, 0.5)
    assert values[1] == 0.0, "the connections to a single stage have been read before"
    direct = calls.array([calls.operation([[at, at + 24, 1]])])
    own.stages = calls.array([[*stages[1][:1], direct, *stages[1][2:]]])
    explicit_step.sweep(own, 2.0, 0.5)
    assert values.tolist() == [7.0, 0.0, 2.0, 7.0], "what is not fed by a polynomial is moved directly"


def test_what_was_saved_is_restored_in_each_of_two_slots():
    """Memory by copies, other members by calls with the address of their pointer, then with the pointer."""
    calls, memory, copies = Calls(), np.arange(3.0), np.zeros((2, 3))
    other, others = np.array([0.5]), np.full(4, 99.0)
    pointers = np.array([[101, 102]])

    def get(instance, address):
        calls.journal.append(("get", instance, (address - pointers.ctypes.data) // 8))
        return calls.answers.get("get", 0)

    def set_(instance, pointer):
        calls.journal.append(("set", instance, pointer))
        return calls.answers.get("set", 0)

    at = int(pointers.ctypes.data)
    row = [calls.address(machine.STATE, get), calls.address(machine.STATE, set_), 21, at, at + 8, 5]
    region = [int(memory.ctypes.data), 3, int(copies.ctypes.data), int(copies.ctypes.data) + 24]
    second = [int(other.ctypes.data), 1, int(others.ctypes.data), int(others.ctypes.data) + 16]
    own = state(regions=calls.array([region, second]), region_count=2, states=calls.array([row]), state_count=1)
    own.outputs_current = 1
    for slot in range(2):
        assert explicit_step.save_state(own, slot) == 0
        memory += 10.0
        other *= -3.0
    assert own.outputs_current == 1
    assert others.tolist() == [0.5, 99.0, -1.5, 99.0]
    assert copies.tolist() == [[0.0, 1.0, 2.0], [10.0, 11.0, 12.0]]
    for slot in (1, 0):
        assert explicit_step.restore_state(own, slot) == 0
        assert memory.tolist() == copies[slot].tolist()
        assert other[0] == others[2 * slot]
    assert calls.journal == [("get", 21, 0), ("get", 21, 1), ("set", 21, 102), ("set", 21, 101)]
    assert own.outputs_current == 0, "outputs have to be read again"
    for name, call in (("get", explicit_step.save_state), ("set", explicit_step.restore_state)):
        calls.answers = {name: 1}
        assert call(own, 0) == 0, "a warning"
        calls.answers, own.member = {name: 3}, 0
        assert (call(own, 0), own.member, own.status) == (3, 5, 3)


def test_logs_are_told_the_outcome_of_a_step_if_they_hold_lines():
    calls, pending = Calls(), np.zeros(1, np.int64)
    row = calls.access("log")
    own = state(log_callback=row[0])
    explicit_step.notify_logs(own, 2, 1)
    own.pending = int(pending.ctypes.data)
    explicit_step.notify_logs(own, 2, 1)
    assert not calls.journal
    pending[0] = 1
    explicit_step.notify_logs(own, 2, 1)
    assert calls.journal == [("log", None, None, 2, None, 1)]


@pytest.mark.parametrize(("past", "count"), [(0, 1), (1, 2), (2, 2)])
def test_the_end_of_a_step_makes_its_begin_an_earlier_point(past, count):
    """Element 1 is of a bond: the error of its mean over the step is fed in the next one, by its share."""
    vectors = np.arange(10.0).reshape(5, 2)  # now, guess, begin, ...
    course, gaps = np.arange(8.0).reshape(4, 2) + 20.0, np.array([0.0, 0.3, 0.7])
    gaps.view(np.int64)[0] = past
    weights = np.zeros((USES, NODES))
    weights[0] = 1.0, 0.5, 0.25, 0.0  # of the mean
    calls = Calls()
    own = state(
        vectors=vectors.ctypes.data,
        course=course.ctypes.data,
        past=gaps.ctypes.data,
        weights=weights.ctypes.data,
        elements=2,
        correction=0.5,
        bonds=calls.array([1]),
        bond_count=1,
    )
    explicit_step.begin(own)
    assert vectors[2].tolist() == [0.0, 1.0]
    vectors[0] = 3.0, 5.0
    mean = 1.0 + 0.5 * (21.0 - 1.0) + 0.25 * (23.0 - 1.0)
    explicit_step.end(own, 0.4)
    assert course.tolist() == [[0.0, 1.0], [20.0, 21.0], [24.0, 25.0], [26.0, 0.5 * ((1.0 + 5.0) / 2 - mean)]]
    assert gaps[1:].tolist() == [0.4, 0.3]
    assert gaps.view(np.int64)[0] == count


def test_a_smooth_polynomial_remembers_its_end():
    """Each element's polynomial is evaluated at the end of its step; the next one begins there."""
    vectors, gaps = np.arange(10.0).reshape(5, 2), np.zeros(3)
    course = np.arange(8.0).reshape(4, 2) + 20.0
    weights = np.zeros((USES, NODES))
    weights[FINAL] = 1.0, 0.5, 0.25, 2.0
    own = state(
        vectors=vectors.ctypes.data,
        course=course.ctypes.data,
        past=gaps.ctypes.data,
        weights=weights.ctypes.data,
        elements=2,
        smoothing=0.5,
    )
    begin, earlier, before, last = vectors[BEGIN].copy(), course[0].copy(), course[BEFORE].copy(), course[LAST].copy()
    explicit_step.end(own, 0.4)
    ends = begin + 0.5 * (earlier - begin) + 0.25 * (before - begin) + 2.0 * (last - begin)
    assert course[:3].tolist() == [begin.tolist(), earlier.tolist(), ends.tolist()]


def test_events_are_processed_by_a_call_without_arguments():
    calls = Calls()
    row = calls.access("events")
    own = state(events=row[0], outputs_current=1)
    assert stepping.notify_events(own) == 0
    assert calls.journal == [("events", None, None, 0, None, 0)]
    assert (own.status, own.outputs_current) == (0, 0)
    calls.answers["events"] = 3
    assert stepping.notify_events(own) == own.status == 3


@every_case(
    ("tick", "position", "expected"),
    [
        (0, 0, 0.5),
        (3, 0, 0.512),
        (3, 1, 0.513),
        (3, 3, 0.515),
        (2**60, 0, 2**60 / 250),
        (2**60, 2, (2**60 + 0.5) / 250),
        (2**61, 2, 2**61 / 250 + 0.002),  # too large for the product: begin and part are added
        (-(2**61), 2, -(2**61) / 250 + 0.002),
    ],
)
def test_the_time_of_a_division_is_one_division_of_integers(tick, position, expected):
    """Ticks of 4 ms from 0.5 s on, in four divisions; ticks too large for integers only lose digits."""
    own = state(begin_ns=500, step_ns=4, per_second=1000, tick=tick, divisions=4, tick_length=0.004)
    if abs(tick) > 2**50:
        own.begin_ns, own.step_ns, own.per_second = 0, 1, 250
    assert stepping.time_at(own, position) == expected


def accepted(**fields):
    """State of ticks of 1 s in four divisions, after a step that was accepted."""
    own = state(step_ns=1, per_second=1, tick_length=1.0, divisions=4, member=9, **fields)
    stepping.accept(own, fields.get("stride", 1))
    assert own.accepted == 1
    return own.position, own.off, own.limited, own.now, own.finished, own.member


@every_case(
    ("fields", "expected"),
    [
        ({"stride": 2}, (2, 0, 0, 0, 0, 9)),
        ({"stride": 1, "position": 2, "off": 1}, (3, 0, 0, 0, 0, 9)),
        ({"stride": 1, "ending": 4}, (1, 0, 0, 0, 1, 3)),
        ({"stride": 4, "limited": 1, "until": 0.6}, (2, 1, 0, 0.6, 0, 9)),
        ({"stride": 4, "limited": 2, "until": 0.5}, (2, 0, 0, 0.5, 0, 9)),
        ({"stride": 4, "limited": 1, "until": 0.1}, (0, 1, 0, 0.1, 0, 9)),
        ({"stride": 4, "limited": 1, "until": 1.0}, (4, 0, 0, 1.0, 0, 9)),
    ],
)
def test_after_a_step_the_run_is_at_its_end_or_where_it_was_cut(fields, expected):
    assert accepted(**fields) == expected
