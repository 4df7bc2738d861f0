"""When a condition is met: its operations, how long it must hold, from when on, how often; and what happens then."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.coupling.parts import Clock, Hold, SlowClock, couple
from tests.every_case import every_case
from twin.coupling import Condition, CoSimulation, condition_loop, find
from twin.coupling.execution.condition_loop import (
    ABS,
    ADD,
    AND,
    DISARMED,
    DIVIDE,
    EQUAL,
    LESS,
    LESS_EQUAL,
    MAX,
    MET,
    MIN,
    MULTIPLY,
    NEGATE,
    NOT,
    NOT_EQUAL,
    NUMBER,
    OR,
    POWER,
    SQRT,
    SUBTRACT,
    VALUE,
    WAITING,
)
from twin.coupling.execution.loop import KINDS
from twin.coupling.execution.value_memory import bits

MS = 1_000_000
NAN = float("nan")


@every_case(
    ("hold", "first", "repeats", "expected"),
    [
        (0, 0, False, [1]),
        (0, 2, False, [2]),
        (0, 0, True, [1, 5, 8]),
        (2, 0, True, [3, 10]),
        (3, 0, True, [11]),
        (2, 2, True, [10]),
        (4, 0, True, []),
    ],
)
def test_phases(hold, first, repeats, expected):
    is_true = [0, 1, 1, 1, 0, 1, 1, 0, 1, 1, 1, 1, 0]
    value, stack, state = np.zeros(1), np.zeros(2), np.zeros(2, np.int64)
    program = np.array([[NUMBER, 0, 0], [VALUE, value.ctypes.data, KINDS["f8"]], [LESS, 0, 0]], np.int64)
    row = np.array([[program.ctypes.data, 3, hold, first, state.ctypes.data]], np.int64)
    record = SimpleNamespace(conditions=row.ctypes.data, condition_count=1, stack=stack.ctypes.data)
    met = []
    for tick, value[0] in enumerate(is_true):
        if condition_loop.is_met(record, tick):
            assert state[0] == MET
            state[0] = WAITING if repeats else DISARMED
            met.append(tick)
    assert met == expected


def result(*program):
    """Result of a program whose operands are numbers, or arrays for the value at their address."""
    rows = [
        [operation, operand.ctypes.data, KINDS[operand.dtype.str[1:]]]
        if isinstance(operand, np.ndarray)
        else [operation, bits(operand), 0]
        for operation, operand in program
    ]
    table, stack = np.array(rows, np.int64), np.full(len(rows), 99.0)
    return condition_loop.evaluate(table.ctypes.data, len(rows), stack.ctypes.data)


def of_two(operation, x, y):
    return result((NUMBER, x), (NUMBER, y), (operation, 0.0))


@pytest.mark.parametrize(
    ("operation", "values"),
    [
        (NEGATE, {2.0: -2.0, -2.0: 2.0}),
        (ABS, {2.0: 2.0, -2.0: 2.0}),
        (SQRT, {9.0: 3.0, 0.0: 0.0}),
        (NOT, {1.0: 0.0, 0.0: 1.0}),
    ],
)
def test_operations_on_one_value(operation, values):
    assert {x: result((NUMBER, x), (operation, 0.0)) for x in values} == values


@every_case(
    ("operation", "expected"),
    [
        (ADD, np.add),
        (SUBTRACT, np.subtract),
        (MULTIPLY, np.multiply),
        (POWER, np.float_power),
        (MIN, np.minimum),
        (MAX, np.maximum),
        (LESS, np.less),
        (LESS_EQUAL, np.less_equal),
        (EQUAL, np.equal),
        (NOT_EQUAL, np.not_equal),
        (AND, np.logical_and),
        (OR, np.logical_or),
    ],
)
def test_operations_on_two_values_are_those_of_numpy(operation, expected):
    """Comparisons with NaN are false, except that it differs; the smaller and the larger of two are NaN with it."""
    values = (0.0, 1.0, 2.5, 3.0) if operation == POWER else (-2.0, 0.0, 1.0, 2.5, NAN)
    for x in values:
        for y in values:
            np.testing.assert_equal(of_two(operation, x, y), float(expected(x, y)), f"{x}, {y}")


def test_a_program_is_that_of_a_stack_machine():
    """abs(n - 7.5) / 2 < v**2 or v == -3, with n an Int16 and v a Float32."""
    n, v = np.array([-4], np.int16), np.array([2.5], np.float32)
    program = [(VALUE, n), (NUMBER, 7.5), (SUBTRACT, 0.0), (ABS, 0.0), (NUMBER, 2.0), (DIVIDE, 0.0)]
    assert result(*program) == 5.75
    program += [
        (VALUE, v),
        (NUMBER, 2.0),
        (POWER, 0.0),
        (LESS, 0.0),
        (VALUE, v),
        (NUMBER, -3.0),
        (EQUAL, 0.0),
        (OR, 0.0),
    ]
    assert [result(*program) for v[0] in (2.5, 2.0, -3.0)] == [1.0, 0.0, 1.0]


def run(build, *conditions, begin=0, stop=20 * MS, until=20 * MS, **options):
    """A clock, a slow one, and a counter of steps; the journal: name and time [ms] of each action."""
    parts = {"clock": Clock(), "slow": SlowClock(), "hold": Hold()}
    members = couple(build, parts, []).members
    catalog = {name: member.variables for name, member in members.items()}
    journal = []

    def condition(name, path, least, **more):
        act = more.pop("act", lambda _: None)
        program = [(NUMBER, least), (VALUE, find(path, catalog)), (LESS_EQUAL, None)]
        return Condition(program, lambda now: (journal.append((name, now.time / MS)), act(now)), **more)

    made = [condition(name, path, least, **more) for name, path, least, more in conditions]
    simulated = CoSimulation(members, [], MS, build=build, conditions=made, **options)
    simulated.initialize(begin, None if stop is None else begin + stop)
    simulated.advance(begin + until)
    simulated.terminate()
    assert simulated.conditions.met == [
        (round(time * MS), [one[0] for one in conditions].index(name)) for name, time in journal
    ]
    return journal, simulated


def test_actions_happen_at_the_communication_point_of_the_recorded_values(build):
    """A time to hold and one from which on to look are rounded up to communication points."""
    journal, _ = run(
        build,
        ("whole", "clock.y", 0.005, {}),
        ("held", "clock.y", 0.005, {"hold": 2 * MS}),
        ("nearly", "clock.y", 0.005, {"hold": 2 * MS - 1}),
        ("longer", "clock.y", 0.005, {"hold": 2 * MS + 1}),
        ("later", "clock.y", 0.005, {"after": 12 * MS}),
        ("soon after", "clock.y", 0.005, {"after": 12 * MS + 1, "hold": MS}),
        ("slow", "slow.y", 0.0099, {}),
        ("count", "hold.count", 3.0, {}),
        ("count again", "hold.count", 3.0, {"repeats": True}),
        ("at once", "hold.count", 0.0, {}),
        ("at the end", "clock.y", 0.02, {}),
    )
    assert journal == [
        ("at once", 0),
        *(("count", 3), ("count again", 3)),
        ("whole", 5),
        *(("held", 7), ("nearly", 7)),
        ("longer", 8),
        ("slow", 10),
        ("later", 12),
        ("soon after", 14),
    ]


def test_at_the_last_point_of_a_run_there_is_nothing_left_to_do(build):
    last = ("at the end", "clock.y", 0.02, {})
    assert run(build, last)[0] == []
    assert run(build, last, stop=None)[0] == [("at the end", 20)]
    assert run(build, last, stop=21 * MS)[0] == [("at the end", 20)]


def test_times_count_from_the_begin_of_the_run(build):
    condition = ("x", "clock.y", 0.0, {"after": 103 * MS})
    assert run(build, condition, begin=100 * MS)[0] == [("x", 103)]


def test_an_action_may_end_the_run(build):
    stop = {"act": lambda now: now.conditions.stop(now, "enough")}
    journal, simulated = run(build, ("stop", "clock.y", 0.004, stop), ("too", "clock.y", 0.004, {}))
    assert journal == [("stop", 4), ("too", 4)]
    assert (simulated.finished, simulated.failure, simulated.conditions.has_stopped) == (True, "enough", True)
    assert simulated.recording().time.tolist() == pytest.approx([0.0, 0.001, 0.002, 0.003, 0.004])
    _, other = run(build, ("never", "clock.y", 1.0, {}))
    assert (other.finished, other.failure, other.conditions.has_stopped) == (False, "", False)


def test_an_action_changes_what_comes_after_it(build):
    """From then on the readers of the clock, among them the other conditions, get another value."""
    override = {"act": lambda now: now.override(("clock", "y"), -1.0)}
    again = {"repeats": True, "act": lambda now: now.release(("clock", "y"))}
    journal, simulated = run(
        build, ("a", "clock.y", 0.003, override), ("b", "clock.y", 0.003, {"hold": MS}), ("c", "hold.count", 6.0, again)
    )
    assert journal == [("a", 3), ("c", 6), ("b", 8)]
    expected = [0.0, 1e-3, 2e-3, 3e-3, -1.0, -1.0, -1.0, 7e-3, 8e-3]
    assert simulated.recording().signals["clock.y"][:9].tolist() == pytest.approx(expected)
