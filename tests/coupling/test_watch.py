"""Values that are not finite are named where and when they began; inputs beyond their bounds are noted."""

import numpy as np
import pytest

from tests.coupling.parts import Diverging, couple
from tests.coupling.watch_parts import Aside, Blink, Ramp, Spoiled, Sum
from twin.coupling import Algorithm, Connection, CoSimulation, CoupledSystem
from twin.coupling.execution.finite_value_monitor import LINE_NOTE
from twin.errors import SimulationError
from twin.fmi import FMUMember
from twin.fmi.exporting import exporter

MS = 1_000_000
MODES = ["compiled", "interpreted", "fmu"]


def coupled(build, parts, connections, mode="compiled", exempt=(), algorithm=Algorithm.jacobi):
    """Components coupled; as FMUs, too."""
    if mode != "fmu":
        made = couple(build, parts, connections, algorithm, mode=mode)
        members = made.members
    else:
        members = {}
        for name, part in parts.items():
            values = {v.name: part.views[v.name][()] for v in part.variables if v.role.value == "parameter"}
            members[name] = FMUMember(name, exporter.build(type(part), "3.0", build), values)
    catalog = {name: member.variables for name, member in members.items()}
    links = CoupledSystem(catalog, [Connection(*one.split(" -> ")) for one in connections]).links()
    return CoSimulation(members, links, MS, algorithm, build=build, exempt=exempt)


def ended(simulation, stop=200 * MS):
    """How a simulation ended, and its last recorded time [s]."""
    with pytest.raises(SimulationError) as caught:
        simulation.initialize(0, stop)
        simulation.advance(stop)
    simulation.terminate()
    return str(caught.value), simulation.recording().time[-1]


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("delay", [0.0, 0.003, 9.0])
def test_the_first_one_is_found_whether_it_is_recorded_or_not(mode, delay, build):
    parts = {"sum": Sum(), "spoiled": Spoiled(at=0.05, delay=delay)}
    text, last = ended(coupled(build, parts, ["spoiled.y -> sum.u"], mode))
    assert text.startswith("spoiled.inner is inf at t = 50 ms")
    assert f"with finite inputs. {LINE_NOTE}Correct its parameters" in text
    assert last == 0.05


@pytest.mark.parametrize("mode", MODES)
def test_it_is_found_long_after_it_began(mode, build):
    stop = 2_000 * MS if mode == "interpreted" else 200_000 * MS
    text, last = ended(coupled(build, {"spoiled": Spoiled(at=1.234, delay=1e6)}, [], mode), stop)
    assert text.startswith("spoiled.inner is inf at t = 1.234 s")
    assert last == 1.234


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("algorithm", Algorithm)
@pytest.mark.parametrize("mode", MODES)
def test_the_source_is_named_and_not_the_victim_that_fails(mode, algorithm, build):
    parts = {"picky": Sum(picky=True), "next": Sum(), "spoiled": Spoiled(at=0.05, delay=0.0)}
    wires = ["spoiled.y -> next.u", "next.y -> picky.u"]
    text, last = ended(coupled(build, parts, wires, mode, algorithm=algorithm))
    assert text.startswith("spoiled.inner is inf at t = 50 ms (spoiled.y too)")
    assert last <= 0.05


def test_beside_a_member_that_cannot_go_back_every_step_is_looked_at(build):
    aside = Aside()
    parts = {"aside": aside, "sum": Sum(), "spoiled": Spoiled(at=0.05, delay=0.0)}
    text, last = ended(coupled(build, parts, ["spoiled.y -> sum.u"]))
    assert text.startswith("spoiled.inner is inf at t = 50 ms")
    assert (last, aside.steps) == (0.05, 50)


def test_somebody_elses_fmu_is_looked_at_in_every_step(build):
    simulation = coupled(build, {"spoiled": Spoiled(at=0.05, delay=0.01), "ramp": Ramp()}, [], "fmu")
    for member in simulation.members.values():
        member.has_cheap_fmu_state = False
    simulation = CoSimulation(simulation.members, [], MS, build=build, record=[("ramp", "y")])
    text, last = ended(simulation)
    assert text.startswith("spoiled.y is inf at t = 60 ms")
    assert last == 0.06


@pytest.mark.parametrize("mode", MODES)
def test_a_member_may_be_left_out(mode, build):
    simulation = coupled(build, {"spoiled": Spoiled(at=0.05, delay=0.0)}, [], mode, exempt=["spoiled"])
    simulation.initialize(0, 100 * MS)
    simulation.advance(100 * MS)
    simulation.terminate()
    recorded = simulation.recording()
    assert np.isinf(recorded.signals["spoiled.y"][50:]).all()
    assert not simulation.watch.spell([(recorded.time, recorded.signals)])


def test_what_was_recorded_as_infinite_for_one_step_is_found_at_the_end(build):
    simulation = coupled(build, {"blink": Blink(at=0.05)}, [])
    simulation.initialize(0, 1_000 * MS)
    simulation.advance(1_000 * MS)
    simulation.terminate()
    recorded = simulation.recording()
    text = simulation.watch.spell([(recorded.time, recorded.signals)])
    assert text.startswith("blink.y was not finite at t = 0.05 s, and later was again.")


@pytest.mark.parametrize("mode", ["compiled", "interpreted"])
def test_already_at_the_start(mode, build):
    text, last = ended(coupled(build, {"spoiled": Spoiled(numbers=(1.0, np.nan, 3.0)), "sum": Sum()}, [], mode))
    assert text.startswith("spoiled.numbers[2] is nan at t = 0 s")
    assert last == 0.0


def test_going_back_leaves_no_trace(build):
    """What is set from outside, and overrides, hold on the way forward again."""
    parts = {"sum": Sum(), "spoiled": Spoiled(at=0.15, delay=0.0), "ramp": Ramp()}
    simulation = coupled(build, parts, ["ramp.y -> sum.u"])
    simulation.initialize(0, 200 * MS)
    simulation.advance(40 * MS)
    simulation.override(("sum", "u"), 5.0)
    simulation.advance(80 * MS)
    simulation.release(("sum", "u"))
    with pytest.raises(SimulationError, match=r"spoiled.inner is inf at t = 150 ms"):
        simulation.advance(200 * MS)
    simulation.terminate()
    recorded = simulation.recording()
    assert recorded.time[-1] == 0.15
    assert recorded.signals["sum.y"][60] == 6.0
    assert recorded.signals["sum.y"][120] == pytest.approx(1.119)
    assert recorded.signals["spoiled.count"].tolist() == list(range(151))


def test_a_diverging_state_is_named(build):
    text, _ = ended(coupled(build, {"diverging": Diverging()}, []))
    assert text.startswith("diverging.der_x is inf at t = 6 ms")


@pytest.mark.parametrize("mode", MODES)
def test_an_input_beyond_its_bounds_is_noted_once(mode, build):
    simulation = coupled(build, {"ramp": Ramp(), "sum": Sum()}, ["ramp.y -> sum.u", "ramp.count -> sum.mode"], mode)
    simulation.initialize(0, 100 * MS)
    simulation.advance(100 * MS)
    simulation.terminate()
    assert simulation.notes == [
        "sum.mode: 3 is above the maximum at t = 2 ms, for the first time. Expected 1 to 2.",
        "sum.u: 3 mm is above the maximum at t = 3 ms, for the first time. Expected -1000 mm to 2 mm.",
    ]
