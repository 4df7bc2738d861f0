"""Values that replace those of a variable for its readers, with elements and units."""

import numpy as np
import pytest

from tests.coupling.parts import Clock, Hold, Lag, Millimeters, SlowClock, couple
from tests.coupling.test_linear_equations import ThreeToTwo, TwoToThree
from tests.coupling.test_plan import planned, records
from twin.coupling import Connection
from twin.coupling.execution.loop import KINDS
from twin.coupling.execution.loop_tables import Tables
from twin.coupling.execution.value_memory import bits, view
from twin.coupling.overrides import Overrides
from twin.errors import CouplingError

MS = 1_000_000


def run(build, parts, wires, **options):
    simulated = couple(build, parts, wires, **options)
    simulated.initialize(0)
    simulated.advance(MS)
    return simulated


@pytest.mark.slow
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


def replaced(wires, split=()):
    """Overrides in the tables of records whose values are never read here."""
    members = records()
    plan = planned(members, wires, recorded=[("b", "y")], split=frozenset(split))
    tables = Tables(plan, members)
    return Overrides(tables, members), tables.arrays, plan


def test_each_row_that_reads_an_output_reads_its_replacement():
    overrides, arrays, plan = replaced(["a.y[2] -> b.u[3]", "a.s -> b.u[2]", "b.y -> a.u[1]"])
    overrides.set(("a", "y"), [1.0, 2.0, 3.0])
    shadow = int(arrays["copies"][0][0]) - 8
    assert view(shadow, overrides.members["a"].variables["y"]).tolist() == [1.0, 2.0, 3.0]
    assert arrays["copies"][0].tolist() == [shadow + 8, 824, 1]
    assert arrays["copies"][1:].tolist() == plan.copies[1:]
    overrides.set(("a", "y"), [4.0, 5.0, 6.0])
    assert int(arrays["copies"][0][0]) == shadow + 8, "in the same memory"
    assert view(shadow, overrides.members["a"].variables["y"])[1] == 5.0
    overrides.set(("b", "y"), 7.0)
    assert arrays["copies"][1][0] == arrays["records"][0][0] != 800, "recorded, too"
    for key in (("a", "y"), ("b", "y")):
        overrides.release(key)
    assert arrays["copies"].tolist() == plan.copies
    assert arrays["records"].tolist() == plan.records


def test_an_input_is_replaced_in_its_own_type_whatever_its_source_is():
    overrides, arrays, plan = replaced(["a.s -> b.u[2]", Connection("b.y", "b.u[1]", factor=3.0, offset=1.0)])
    overrides.set(("b", "u"), [1.0, 2.0, 3.0])
    one, f8 = [1, bits(1.0), bits(0.0)], KINDS["f8"]
    shadow = int(arrays["converts"][1][0])
    assert arrays["converts"].tolist() == [[shadow + 8, f8, 816, f8, *one], [shadow, f8, 808, f8, *one]]
    assert view(shadow, overrides.members["b"].variables["u"]).tolist() == [1.0, 2.0, 3.0]
    overrides.release(("b", "u"))
    assert arrays["converts"].tolist() == plan.converts


def test_single_elements_stay_replaced_when_the_array_is_published():
    overrides, arrays, plan = replaced(["a.y[2] -> b.u[1]"], [("a", "y")])
    key, values = ("a", "y"), view(plan.published["a", "y"], overrides.members["a"].variables["y"])
    overrides.set_element(key, 1, 9.0)
    assert values.tolist() == [0.0, 9.0, 0.0]
    row = plan.elements[key][1][1]
    assert int(arrays["copies"][row][0]) not in (0, 408)
    assert arrays["copies"][row][1:].tolist() == plan.copies[row][1:]
    values[:] = 5.0
    overrides.hold()
    assert values.tolist() == [5.0, 9.0, 5.0]
    overrides.set_element(key, 1, None)
    assert (values.tolist(), arrays["copies"].tolist()) == ([5.0, 1.0, 5.0], plan.copies), "the member's own value"
    values[:] = 5.0
    overrides.hold()
    assert values.tolist() == [5.0] * 3
    for refused in (lambda: overrides.set(("a", "u"), 1.0), lambda: overrides.set_element(("b", "y"), 0, 1.0)):
        with pytest.raises(CouplingError, match=r"nothing reads it, so overriding it has no effect\. Use set\."):
            refused()
