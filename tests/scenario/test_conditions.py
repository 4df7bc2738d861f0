"""Conditions of events: how they are read, and what `twin check` says about them."""

import numpy as np
import pytest

from tests.every_case import every_case
from twin.coupling import MemberVariable
from twin.coupling.execution import condition_loop
from twin.coupling.execution.value_memory import bits, kind
from twin.errors import ScenarioError
from twin.results import expression
from twin.scenario import parse_scenario, resolve_variables
from twin.scenario.keys import conditions

SCENARIO = """
stop_time: 1 s
members:
  heart: {component: heart}
  wall: {component: wall}
connections: [heart.position -> wall.heart_position]
events:
"""


def variable(name, type_="Float64", dtype=np.float64, shape=(), unit=""):
    return MemberVariable(name, "output", "continuous", type_, np.dtype(dtype), shape=shape, unit=unit)


CATALOG = {
    "a": {
        v.name: v
        for v in (
            variable("x", unit="mm"),
            variable("t", unit="degC"),
            variable("n", "Int32", np.int32),
            variable("on", "Boolean", np.int8),
            variable("p", shape=(3,), unit="m"),
        )
    }
}
VALUES = {"a.x": 3.0, "a.t": 41.5, "a.n": -7, "a.on": 1, "a.p": [3e-3, -4e-3, 12e-3]}


def evaluated(text):
    """The value of a condition by its instructions, as the loop runs them."""
    memory = {name: np.array(value, CATALOG["a"][name[2:]].dtype) for name, value in VALUES.items()}
    rows = []
    for operation, operand in conditions.parse(text).instructions(CATALOG):
        row = [operation, 0, 0]
        if operation == condition_loop.VALUE:
            owner = operand.variable
            address = memory[f"a.{owner.name}"].ctypes.data + operand.first * owner.dtype.itemsize
            row = [operation, address, kind(owner.dtype)]
        elif operand is not None:
            row[1] = bits(operand)
        rows.append(row)
    program, stack = np.array(rows, np.int64), np.zeros(len(rows))
    return condition_loop.evaluate(program.ctypes.data, len(rows), stack.ctypes.data)


@every_case(
    ("text", "expected"),
    [
        ("a.x > 2.9 mm", True),
        ("a.x > 3 mm", False),
        ("a.x >= 3 mm and a.n < -6.5", True),
        ("2 mm < a.x <= 3 mm", True),
        ("not a.on or a.x < 0", False),
        ("a.on and not (a.x < 0.001 or a.n == 7)", True),
        ("a.t > 41 degC", True),
        ("a.t - 313.15 < 1.4 K", False),
        ("abs(a.n) != 7", False),
        ("norm(a.p) > 12.9 mm and norm(a.p) < 13.1 mm", True),
        ("norm(a.p - a.p) == 0", True),
        ("a.p[2] < -3 mm", True),
        ("a.p[2] > -4.1e-3 and a.p[3] > 1.1E-2 m", True),
        ("max(a.x, a.p[1], a.p[3]) == a.p[3]", True),
        ("min(a.x, a.p[2]) ** 2 / a.x - -a.x > 0.0083", True),
        ("sqrt(a.x * a.x) == a.x", True),
    ],
)
def test_instructions(text, expected):
    assert evaluated(text) == expected


def test_arithmetic_equals_that_of_expressions():
    recorded = {name: np.array([value], float) for name, value in VALUES.items()}
    recorded["a.x"], recorded["a.t"] = recorded["a.x"] * 1e-3, recorded["a.t"] + 273.15
    for text in ("a.x * a.n - a.p[1] / 7", "norm(a.p) + abs(a.n)", "-min(a.x, a.p[2], a.t) * 3", "a.n + a.t - +a.x"):
        (value,) = np.ravel(expression.parse(text).evaluate(recorded))
        assert evaluated(f"{text} == {float(value)!r}"), text


@every_case(
    ("event", "message"),
    [
        ("when: wall.force > 0.3 mm", "`wall.force` is in N, which does not convert to mm. Give limits in N."),
        ("when: wall.force > heart.position", "`wall.force` is in N, `heart.position` is in m."),
        ("when: wall.forse > 0.3 N", "wall has no variable `forse`. Did you mean `force`?"),
        ("when: wal.force > 0.3 N", "there is no member `wal`. Did you mean `wall`?"),
        ("when: heart.rate > 1 Hz", "heart.rate is a parameter: conditions read outputs. Name an output."),
        ("when: wall.heart_position > 1 mm", "Name the output that it is connected to."),
        ("when: wall.force", "wall.force is Float64, neither true nor false. Compare it, as in wall.force > 0."),
        ("when: wall.force - 0.1 N > 0", "a number with a unit stands alone on its side"),
        ("when: 1 N > 2 N", "compares numbers only"),
        ("when: wall.force > 1 and", "is no condition. Compare signals"),
        ("set: {heart.rate: 1}", "`at` or `when` is missing"),
        ("at: 1 ms, when: wall.force > 1", "`at` and `when` in one event"),
        ("at: 1 ms, for: 3 ms", "`for` is for events with a condition"),
        ("when: wall.force > 1, fault: heartbeat", "a fault happens at a time. Give `at`, not `when`"),
        ("when: wall.force > 1, after: 2 s", "after 2 s is not before the end of the run, 1 s"),
        ("when: wall.force > 1, set: {heart.rat: 2}", "heart has no variable `rat`"),
        ("when: wall.force > 1, release: wall.force", "wall.force is released but never overridden"),
    ],
)
def test_mistakes(event, message):
    with pytest.raises(ScenarioError) as caught:
        raise ScenarioError(resolve_variables(parse_scenario(f"{SCENARIO}  - {{{event}}}"))[1])
    (problem,) = caught.value.problems
    assert problem.startswith("scenario.yaml:8: ")
    assert message in problem


def test_a_removed_member_takes_its_conditions_along():
    text = SCENARIO.replace("stop_time", "variants: {alone: {members: {wall: null}}}\nstop_time")
    events = ["when: wall.force > 1 N, set: {heart.rate: 2}", "when: heart.position > 1 mm, stop: true"]
    case = parse_scenario(text + "".join(f"  - {{{event}}}\n" for event in events)).variants[0]
    assert [condition.condition.text for condition in case.conditions] == ["heart.position > 1 mm"]
