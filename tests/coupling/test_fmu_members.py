"""FMUs in the loop: what the tables keep for their setters."""

import numpy as np
import pytest

from tests.component.test_component import Everything
from tests.coupling.parts import Clock
from tests.fmi.third_party import NATIVE, NATIVE_XML, native_fmu
from twin import compiler
from twin.component import Component, Int32, input, output
from twin.coupling import Connection, CoSimulation, CoupledSystem, RecordMember
from twin.errors import SimulationError
from twin.fmi import FMUMember
from twin.fmi.exporting import exporter

MS = 1_000_000


class Echo(Component):
    """Shows its array input."""

    u = input("s", "in", start=(1.0, 2.0, 3.0))
    y = output("s", "out", shape=(3,))

    def step(self, t, h):
        for i in range(3):
            self.y[i] = self.u[i]


class Whole(Component):
    """Nothing, as a whole number."""

    y = output("", "zero", type=Int32)

    def step(self, t, h):
        self.y = 0


@pytest.fixture(params=["2.0", "3.0"])
def echo(request, build):
    version = request.param
    path = exporter.build(Echo, version, build / "tests")
    clock = RecordMember("clock", Clock(), compiler.load_component(Clock, build))
    members = {"clock": clock, "echo": FMUMember("echo", path)}
    system = CoupledSystem({name: m.variables for name, m in members.items()}, [Connection("clock.y", "echo.u[2]")])
    simulation = CoSimulation(members, system.links(), MS, build=build)
    yield simulation, version
    simulation.terminate()


def values(simulation, version):
    signals = simulation.recording().signals
    return signals["echo.y"] if version == "3.0" else np.column_stack([signals[f"echo.y[{i}]"] for i in (1, 2, 3)])


def test_unconnected_elements_of_an_input_keep_their_values(echo):
    simulation, version = echo
    simulation.initialize(0, 10 * MS)
    simulation.advance(5 * MS)
    if version == "3.0":
        simulation.set(("echo", "u"), np.array([7.0, 0.0, 9.0]))
    simulation.advance(10 * MS)
    found = values(simulation, version)
    np.testing.assert_allclose(found[5], [1.0, 0.004, 3.0])
    np.testing.assert_allclose(found[-1], [7.0, 0.009, 9.0] if version == "3.0" else [1.0, 0.009, 3.0])


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_every_type_and_shape_passes_through_an_fmu(version, build):
    names = {"toggles": [False, True, True], "vector": [0.1, 0.2, 0.3], "flag": True, "number": 5}
    plain, member = Everything(), FMUMember("it", exporter.build(Everything, version, build / "tests"))
    member.instantiate()
    for name, value in names.items():
        setattr(plain, name, value)
        elements = [name] if version == "3.0" or not isinstance(value, list) else [f"{name}[{i}]" for i in (1, 2, 3)]
        for element, one in zip(elements, [value] if len(elements) == 1 else value, strict=True):
            member.set(element, one)
    plain.start()
    member.enter_initialization(0.0, None)
    member.exit_initialization()
    found = member.get("toggled") if version == "3.0" else [member.get(f"toggled[{i}]") for i in (1, 2, 3)]
    assert [bool(one) for one in found] == plain.toggled.tolist() == [True, False, False]
    assert member.get("y") == plain.y == 0.0
    member.close()


def test_a_member_that_cannot_be_read_is_named(echo, monkeypatch):
    simulation, _ = echo
    monkeypatch.setattr(FMUMember, "access", lambda *_: (_ for _ in ()).throw(ValueError("no getter")))
    with pytest.raises(ValueError, match="no getter"):
        simulation.initialize(0, 10 * MS)
    assert len(simulation.recording().time) == 0


REFUSING = NATIVE.replace(
    "int fmi3GetFloat64(Instance *c, VRS, double *v, size_t nv) {",
    """int fmi3GetInt32(Instance *c, VRS, int32_t *v, size_t nv) { return 3; }
int fmi3GetFloat64(Instance *c, VRS, double *v, size_t nv) {
    if (c->y[0] > 0.25) { c->log(c->environment, 3, "logStatusError", "y is worn out"); return 3; }""",
)


@pytest.fixture(scope="module")
def refusing(tmp_path_factory):
    return native_fmu(tmp_path_factory.mktemp("refusing"), NATIVE_XML, REFUSING)


def test_what_a_start_value_tells_is_not_asked(refusing, build):
    member = FMUMember("part", refusing, {"mode": 0})
    hold = RecordMember("hold", Whole(), compiler.load_component(Whole, build))
    members = {"hold": hold, "part": member}
    system = CoupledSystem({name: m.variables for name, m in members.items()}, [Connection("hold.y", "part.mode")])
    simulation = CoSimulation(members, system.links(), 100 * MS, build=build, record=[("part", "mode"), ("hold", "y")])
    simulation.initialize(0)
    simulation.advance(100 * MS)
    assert simulation.value(("part", "mode")) == 0
    simulation.terminate()


def test_a_refused_value_is_named(refusing, build):
    simulation = CoSimulation({"part": FMUMember("part", refusing)}, [], 100 * MS, build=build)
    simulation.initialize(0)
    with pytest.raises(SimulationError) as caught:
        simulation.advance(1000 * MS)
    assert str(caught.value) == (
        "part: failed with ERROR in the step from t = 200 ms. It refused fmi3GetFloat64 of y (value reference 3), y_seen (value "
        "reference 3). "
        "Last inputs: none. Last log: ERROR: y is worn out"
    )
    with pytest.raises(
        SimulationError, match=r"y is worn out It was asked for y \(value reference 3\)\.|closed|failed"
    ):
        simulation.members["part"].get("y")
    simulation.terminate()


@pytest.mark.parametrize("stop", [9, 10, 11])
def test_the_last_step_of_a_member_may_end_after_the_run(build, stop):
    """An FMU that communicates every 3 ms gets a stop time that its last step does not pass."""
    members = {"echo": FMUMember("echo", exporter.build(Echo, "3.0", build / "tests"))}
    simulation = CoSimulation(members, [], MS, build=build, periods={"echo": 3 * MS})
    simulation.initialize(0, stop * MS)
    simulation.advance(stop * MS)
    assert simulation.time == stop * MS
    simulation.terminate()
