"""Roll-outs of several inputs and outputs: which value goes where, which time a step has, and steps that fail."""

import numpy as np
import pytest

from twin.errors import CouplingError, SimulationError, TwinError
from twin.validation.rollout import RollOut

COUNTER = "tests.validation.bending:Counter"


@pytest.fixture(scope="module")
def counter(build):
    return RollOut(COUNTER, {}, 10e-3, ["right[2]", "left", "right[1]"], ["both[2]", "total"], build)


def test_each_input_and_output_has_its_element(counter):
    """Row 0 of a window is its initialization: no step, and time begins anew."""
    first = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 50.0, 9.0]])  # 50: a warning is no failure
    second = np.array([[9.0, 8.0, 7.0], [6.0, 5.0, 4.0]])
    outputs = counter([first, second], {})
    assert outputs[:, 0] == pytest.approx([-1.0, 0.01, 0.02, -1.0, 0.01])
    assert outputs[:, 1].tolist() == [132, 1000 + 465, 2000 + 840, 978, 1000 + 645]
    assert counter([first[:1]], {})[:, 1].tolist() == [132]


def test_values_at_the_start_of_each_window(counter):
    """One number for all, or one per window."""
    windows = [np.zeros((2, 3))] * 2
    assert counter(windows, {"count": 3.0})[:, 1].tolist() == [3000, 4000] * 2
    assert counter(windows, {"count": np.array([3.0, -1.0])})[:, 1].tolist() == [3000, 4000, -1000, 0]
    assert counter.start("count") == 0.0
    assert counter([np.zeros((1, 3))], {})[0, 1] == 0.0  # nothing is left of the run before


@pytest.mark.parametrize(("row", "number"), [(1, 2), (2, 3), (4, 5)])
def test_a_step_that_fails_is_told_by_its_row(counter, row, number):
    rows = np.zeros((5, 3))
    rows[row, 1] = 100.0
    with pytest.raises(SimulationError, match=rf"^the component fails in row {number}$"):
        counter([rows[:3], rows[3:]], {})


def test_an_output_that_is_not_finite_is_told(counter):
    with pytest.raises(SimulationError, match=r"^an output is not finite$"):
        counter([np.array([[0.0, 0.0, 0.0], [0.0, np.inf, 0.0]])], {})


def test_variables_are_single_real_numbers(counter):
    assert counter.variable("right[2]").name == "right"
    assert counter.offset("right[2]") - counter.offset("right[1]") == 8
    with pytest.raises(
        CouplingError, match=r"^right is no single real number\. Name one, or an element such as right\[1\]\.$"
    ):
        counter.variable("right")


def test_start_values_of_parameters(build):
    own = RollOut("tests.validation.bending:Bending", {"rest": "45 deg"}, 10e-3, ["tendon"], ["angle"], build)
    assert own.start("rest") == pytest.approx(np.pi / 4)
    assert own.start("gain") == 100.0
    assert own([np.array([[0.0], [2e-3]])], {"play": 0.0})[:, 0] == pytest.approx([np.pi / 4, np.pi / 4 + 0.2])


def test_a_parameter_that_is_not_known_is_told(build):
    with pytest.raises(TwinError, match=r"`sum`"):
        RollOut(COUNTER, {"sum": 1}, 10e-3, ["left"], ["total"], build)
