"""Reference trajectories: the generated stimulus, replay, comparison, files, and what the checks of a component find."""

from math import inf, nan, pi, sin

import numpy as np
import pytest

from twin.component import Boolean, Component, Int32, input, local, output, parameter
from twin.conformance import agreement, reference
from twin.conformance.reference import STEPS, Trajectory
from twin.errors import DeclarationError, SimulationError


class Adder(Component):
    """Adds what was before a step."""

    period = 1e-3

    u = input("m", "first", start=1.0, nominal=2.0)
    low = input("m", "at least 0.9", start=1.0, minimum=0.9, maximum=1.2)
    n = input("", "count", type=Int32, start=3, minimum=-2)
    free = input("", "count without a minimum", type=Int32, start=4)
    on = input("", "truth", type=Boolean, start=True)
    v = input("m", "array", shape=(2,))
    y = output("m", "their sum", shape=(2,))
    seen = output("", "the count", type=Int32)
    truth = output("", "not on", type=Boolean)

    def initialize(self):
        self.y[0] = self.u
        self.y[1] = 0.0
        self.seen = self.n
        self.truth = not self.on

    def step(self, t, h):
        self.y[0] = self.u + self.low
        self.y[1] = self.v[0] - self.v[1] + t
        self.seen = self.n
        self.truth = not self.on


def test_the_stimulus_of_a_component():
    """Two sines of the nominal value about the start value within the bounds; others change once, after the half."""
    rows = reference.stimulus(Adder)
    assert len(rows) == STEPS + 1
    assert [row[0] for row in rows[:3]] == [0.0, 1e-3, 2e-3]
    part = 0.2
    slow, fast = (lambda k: sin(2 * pi * part * (1 + 0.3 * k))), 0.3 * sin(2 * pi * 3.7 * part)
    time, u, low, n, free, on, v1, v2 = rows[20]
    assert (time, u) == (0.02, pytest.approx(1.0 + 2.0 * (slow(0) + fast) / 1.3))
    assert (v1, v2) == (pytest.approx((slow(5) + fast) / 1.3), pytest.approx((slow(6) + fast) / 1.3))
    assert low == pytest.approx(min(1.2, 1.0 + 1.2 * (slow(1) + fast) / 1.3))  # its maximum is its size
    bounded = [row[2] for row in rows]
    assert (min(bounded), max(bounded)) == (0.9, 1.2)
    assert (n, free, on) == (3, 4, True)
    assert [row[3:6] for row in rows[50:52]] == [(3, 4, True), (-2, 4, False)]
    assert rows[0][1:] == (1.0, 1.0, 3, 4, True, 0.0, 0.0)


INPUTS = ("u", "low", "n", "free", "on", "v[1]", "v[2]")
OUTPUTS = ("y[1]", "y[2]", "seen", "truth")
STIMULUS = (
    (0.5, 1.0, 1.0, 3, 4, True, 0.0, 0.0),
    (0.501, 2.0, 1.1, 5, 4, False, 7.0, 2.0),
    (0.502, 0.0, 1.0, 6, 4, True, 0.0, 0.0),
)
ANSWERS = ((1.0, 0.0, 3, False), (2.0, 0.5, 3, False), (3.1, 5.501, 5, True))


def test_a_row_holds_the_outputs_of_the_inputs_before_it():
    found = reference.record_reference(Adder, STIMULUS)
    assert (found.inputs, found.outputs) == (INPUTS, OUTPUTS)
    assert found.rows == tuple((*inputs, *outputs) for inputs, outputs in zip(STIMULUS, ANSWERS, strict=True))
    assert found.stimulus == STIMULUS
    assert [type(value) for value in found.rows[2][-2:]] == [int, bool]


class Failing:
    """A target whose second step has a status."""

    def __init__(self, status):
        self.statuses = iter((0, status))

    def set(self, name, value):
        pass

    def start(self, t):
        pass

    def advance(self, t, h):
        return next(self.statuses)

    def get(self, name):
        return 0.0


def test_a_step_that_fails_ends_a_replay():
    expected = Trajectory((), ("y",), ((0.0, 0.0), (0.1, 0.0), (0.2, 0.0)))
    assert len(reference.replay(Failing(1), expected).rows) == 3  # a warning is none
    with pytest.raises(SimulationError, match=r"reference: status 2 after 100 ms\. Look at the inputs there\."):
        reference.replay(Failing(2), expected)


def test_the_largest_difference_of_each_output():
    expected = Trajectory(
        ("u",), ("a", "b", "c", "d"), ((0.0, 9.0, 1.0, True, nan, inf), (0.1, 9.0, 2.0, False, 1.0, 1.0))
    )
    actual = Trajectory(
        ("u",), ("a", "b", "c", "d"), ((0.0, 0.0, 0.5, True, 1.0, 1.0), (0.1, 0.0, 2.25, False, 1.0, 1.0))
    )
    assert reference.differences(expected, actual) == {"a": 0.5, "c": inf, "d": inf}
    assert list(reference.differences(expected, actual)) == ["a", "c", "d"]
    with pytest.raises(agreement.ConformanceError) as caught:
        agreement.require_equal(Adder, "compiled", "interpreted", expected, actual)
    assert str(caught.value) == "Adder: compiled differs from interpreted in a by 0.5, c by inf, d by inf."
    same = Trajectory(("u",), ("a",), ((0.0, 1.0, 2.0),))
    agreement.require_equal(Adder, "compiled", "interpreted", same, same)


def test_files_read_back_to_the_bit(tmp_path):
    path = tmp_path / "expected.csv"
    trajectory = reference.record_reference(Adder, ((0.1 + 0.2, 1 / 3, *STIMULUS[0][2:]), (0.4, *STIMULUS[0][1:])))
    reference.write(path, trajectory)
    first, second, _ = path.read_text().splitlines()
    assert first == ",".join(("time", *INPUTS, *OUTPUTS))
    assert second == "0.30000000000000004,0.3333333333333333,1.0,3,4,1,0.0,0.0,0.3333333333333333,0.0,3,0"
    assert reference.read(path, Adder) == trajectory
    assert reference.read_stimulus(path, Adder) == trajectory.stimulus
    assert reference.read_stimulus(tmp_path / "none.csv", Adder) is None
    changed = path.read_text().replace("time,u", "time,w")
    for text in ("", "time\n", changed, first + "\n", "time," + ",".join(INPUTS) + "\n0,1,1,3,4,1,0,0\n"):
        path.write_text(text)
        assert reference.read_stimulus(path, Adder) is None
    path.write_text(changed)
    with pytest.raises(DeclarationError, match=r"columns are not the variables of Adder\. Run: twin reference tests"):
        reference.read(path, Adder)
    for line in (second.replace(",3,4,", ",x,4,"), second.rpartition(",")[0]):
        path.write_text(f"{first}\n{second}\n{line}\n")
        with pytest.raises(DeclarationError, match=r"expected\.csv:3: expected 12 numbers\."):
            reference.read(path, Adder)


def test_a_reference_is_written_again_under_its_own_stimulus(tmp_path):
    path = tmp_path / "expected.csv"
    assert reference.regenerate(Adder, path) == path
    assert len(reference.read(path, Adder).rows) == STEPS + 1
    reference.write(path, reference.record_reference(Adder, STIMULUS))
    text = path.read_text()
    path.write_text(text.replace("5.501", "9.9"))  # an outdated answer
    reference.regenerate(Adder, path)
    assert path.read_text() == text
    assert reference.command(Adder).endswith("test_reference:Adder")


class Undocumented(Component):
    x = input("mm", "not SI")
    y = output("nonsense", "no unit")
    k = parameter(1.0, "", "no source")
    z = local(0.0, "", "")

    def step(self, t, h):
        if self.x > 0.0:
            self.y = 1.0


Undocumented.__doc__ = ""


class Incomplete(Component):
    """Writes not all outputs."""

    x = input("m", "input")
    a = output("m", "written at the start")
    b = output("m", "array, of which one is written", shape=(2,))

    def initialize(self):
        self.a = 0.0
        self.b[0] = 0.0
        self.b[1] = 0.0

    def step(self, t, h):
        self.b[0] = 1.0


def test_what_the_checks_find(tmp_path):
    agreement.check_documentation(Adder, tmp_path)
    agreement.check_outputs_set(Adder, tmp_path)
    with pytest.raises(agreement.ConformanceError) as caught:
        agreement.check_outputs_set(Incomplete, tmp_path)
    first, second = caught.value.problems
    remedy = "Write `def step(self, t, h):` with"
    assert first == f"Incomplete: a step does not write a. {remedy} `self.a = ...`, whatever branch is taken."
    every = "and so on, every element, whatever branch is taken."
    assert second == f"Incomplete: a step does not write b. {remedy} `self.b[0] = ...` {every}"
    with pytest.raises(agreement.ConformanceError, match=r"has no .*expected\.csv\. Run: twin reference tests"):
        agreement.read_expected(Adder)
    assert (agreement.step_size(Adder), agreement.step_size(Incomplete)) == (1e-3, 1e-3)
    assert agreement.elements("a", (2, 1)) == ["a[1,1]", "a[2,1]"]
    assert agreement.elements("a", ()) == ["a"]


@pytest.mark.slow  # a table of all units is read
def test_documentation_that_is_missing(tmp_path):
    with pytest.raises(agreement.ConformanceError) as caught:
        agreement.check_documentation(Undocumented, tmp_path)
    found = caught.value.problems
    assert found[0].startswith("Undocumented: has no docstring.")
    assert [line.partition(":")[0].removeprefix("Undocumented.") for line in found[1:]] == ["x", "y", "k", "z"]
    assert "unit mm is not SI. Use SI inside and display_unit beside it." in found[1]
    assert "has no source. Say where the value comes from, or `assumed`." in found[3]
    assert "has no description. Say what it means, with its sign." in found[4]


def test_an_instance_is_read_and_written_by_elements():
    target = reference.InstanceTarget(Adder(), start=lambda t: None, advance=lambda t, h: 7)
    target.set("v[2]", 3.5)
    target.set("on", False)
    assert (target.get("v[1]"), target.get("v[2]"), target.get("on"), target.advance(0.0, 1.0)) == (0.0, 3.5, False, 7)
    assert isinstance(target.get("n"), int)
    assert np.isclose(target.get("u"), 1.0)
