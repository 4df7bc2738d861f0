"""Values that replace those of a variable for its readers, with elements and units."""

import numpy as np
import pytest

from tests.coupling.parts import Clock, Hold, Lag, Millimeters, SlowClock, couple
from tests.coupling.test_linear_equations import ThreeToTwo, TwoToThree

MS = 1_000_000


def run(build, parts, wires, **options):
    simulated = couple(build, parts, wires, **options)
    simulated.initialize(0)
    simulated.advance(MS)
    return simulated


def test_readers_of_an_element_get_that_of_the_replaced_array(build):
    wires = ["a.y[1] -> b.u[2]", "a.y[2] -> b.u[1]", "b.y[3] -> a.u[1]", "b.y -> c.u"]
    parts = {"a": ThreeToTwo(offset=1.0), "b": TwoToThree(), "c": ThreeToTwo()}
    simulated = run(build, parts, wires)
    simulated.override(("a", "y"), [5.0, 7.0])
    simulated.override(("b", "y"), [0.5, -0.5, 1.5])
    simulated.advance(3 * MS)
    members = simulated.members
    assert members["b"].get("u").tolist() == [7.0, 5.0]
    assert members["a"].get("u").tolist() == [1.5, 0.0, 0.0]
    assert members["c"].get("u").tolist() == [0.5, -0.5, 1.5]
    recorded = simulated.recording().signals
    assert recorded["a.y"][-1].tolist() == [5.0, 7.0], "what is recorded is what readers get"
    assert members["a"].get("y") == pytest.approx([0.1 * 1.5 + 1.0, 0.05 * 1.5 + 1.0]), "the member computes its own"
    simulated.release(("a", "y"))
    simulated.advance(5 * MS)
    assert members["b"].get("u").tolist() == members["a"].get("y").tolist()[::-1]
    simulated.terminate()


def test_an_input_is_replaced_for_its_member_in_its_own_unit(build):
    """The connection converts m to mm; the value that replaces it is in mm already."""
    simulated = run(build, {"lag": Lag(x=1.0), "mm": Millimeters()}, ["lag.y -> mm.u"])
    assert simulated.members["mm"].get("u") == pytest.approx(1000.0, rel=0.1)
    simulated.override(("mm", "u"), 3.0)
    simulated.advance(3 * MS)
    assert simulated.value(("mm", "y")) == 3.0
    simulated.override(("mm", "u"), 4.0)
    simulated.advance(4 * MS)
    assert simulated.value(("mm", "y")) == 4.0
    simulated.release(("mm", "u"))
    simulated.advance(6 * MS)
    assert simulated.value(("mm", "y")) > 500.0
    simulated.terminate()


def test_elements_of_an_input_are_replaced_together(build):
    simulated = run(build, {"a": ThreeToTwo(offset=1.0), "b": TwoToThree()}, ["a.y[1] -> b.u[2]", "a.y[2] -> b.u[1]"])
    simulated.override(("b", "u"), [2.0, 3.0])
    simulated.advance(3 * MS)
    assert simulated.members["b"].get("u").tolist() == [2.0, 3.0]
    assert simulated.value(("b", "y")).tolist() == pytest.approx(
        [0.2 * 2 + 0.7 * 3, -0.3 * 2 + 0.15 * 3, 0.6 * 2 - 0.5 * 3]
    )
    simulated.terminate()


def test_the_value_of_a_slow_member_is_replaced_at_once(build):
    """The slow one publishes at 10 ms; its reader sees the replaced value in the next step."""
    simulated = run(build, {"slow": SlowClock(), "clock": Clock(), "hold": Hold()}, ["slow.y -> hold.u"])
    simulated.advance(12 * MS)
    assert simulated.members["hold"].get("u") == pytest.approx(0.01)
    simulated.override(("slow", "y"), -1.0)
    simulated.advance(13 * MS)
    assert simulated.members["hold"].get("u") == -1.0
    simulated.release(("slow", "y"))
    simulated.advance(14 * MS)
    assert simulated.members["hold"].get("u") == pytest.approx(0.01)
    assert np.isfinite(simulated.recording().signals["slow.y"]).all()
    simulated.terminate()
