"""Strings and binaries between members: carried like numbers, with the same delays, and nothing lost of them."""

import msgpack
import pytest

from tests.coupling.test_algorithms import FORCE, masses
from tests.fmi.third_party import FMI2, FMI3, NATIVE, NATIVE_XML, native_fmu, python_fmu
from twin import compiler
from twin.coupling import Connection, CoSimulation, CoupledSystem, IsolatedMember, RecordMember
from twin.errors import CouplingError
from twin.fmi import member

MS = 1_000_000
RING = [("a.r", "b.s"), ("b.r", "a.s")]


@pytest.fixture(scope="module")
def paths(tmp_path_factory):
    """One FMU says what it hears and when, the other passes it on; a third has a binary."""
    folder = tmp_path_factory.mktemp("objects")
    told = 'self.r = self.label + self.s + str(round(1000 * t)) + ","'
    return {
        "a": python_fmu(folder, FMI2, "Telling", told),
        "b": python_fmu(folder, FMI3, "Passing", "self.r = self.s"),
        "native": native_fmu(folder),
    }


@pytest.fixture
def pair(paths):
    return {"a": member("a", paths["a"], {"label": "A"}), "b": member("b", paths["b"], {"s": "-"})}


def run(build, members, links, steps=4, **options):
    """What each member says after every step."""
    catalog = {name: one.variables for name, one in members.items()}
    system = CoupledSystem(catalog, [Connection(*one) for one in links])
    simulated = CoSimulation(members, system.links(), MS, build=build, **options)
    found = []
    try:
        simulated.initialize(0, steps * MS)
        for k in range(1, steps + 1):
            simulated.advance(k * MS)
            found.append([members[name].get("echo" if "echo" in members[name].variables else "r") for name in members])
    finally:
        simulated.terminate()
    return found


JACOBI = [["A0,", ""], ["A1,", "A0,"], ["AA0,2,", "A1,"], ["AA1,3,", "AA0,2,"]]


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("isolate", [False, True])
def test_strings_come_a_step_later(pair, build, isolate):
    if isolate:
        pair["b"] = IsolatedMember(pair["b"], build)
    assert run(build, pair, RING) == JACOBI


def test_in_order_they_come_at_once(pair, build):
    assert run(build, pair, RING, 2, algorithm="gauss_seidel") == [["A0,", "A0,"], ["AA0,1,", "AA0,1,"]]


def test_a_slow_member_publishes_when_it_is_due(pair, build):
    found = run(build, pair, RING, 6, periods={"b": 2 * MS})
    heard = [one[0] for one in found]
    assert heard == ["A0,", "A1,", "A2,", "A3,", "AA1,4,", "AA1,5,"]


def test_zeros_in_binaries_are_kept(paths, build):
    members = {name: member(name, paths["native"], {"data": b"\0\1\0"} if name == "a" else {}) for name in "abc"}
    assert run(build, members, [("a.echo", "b.data"), ("b.echo", "c.data")], 2)[-1] == [b"\0\1\0"] * 3


@pytest.mark.slow
def test_values_survive_a_checkpoint(paths, build):
    def ring(start):
        members = {name: member(name, paths["native"], {"data": start}) for name in "ab"}
        catalog = {name: each.variables for name, each in members.items()}
        system = CoupledSystem(catalog, [Connection("a.echo", "b.data"), Connection("b.echo", "a.data")])
        simulated = CoSimulation(members, system.links(), MS, build=build)
        simulated.initialize(0, MS)
        return simulated

    first, second = ring(b"\0\1\0"), ring(b"2")
    values = first.plan.objects.values()
    second.plan.objects.restore(msgpack.unpackb(msgpack.packb(values)))
    assert second.plan.objects.values() == values
    assert b"\0\1\0" in values["inputs"][0][2]
    for simulated in (first, second):
        simulated.terminate()


@pytest.mark.parametrize(
    ("link", "text"),
    [
        (("a.r", "b.u"), "String does not fit Float64. Connect two of one type."),
        (("a.r", "b.i"), "String does not fit Int32"),
        (("a.y", "b.s"), "Float64 does not fit String"),
    ],
)
def test_kinds_must_be_the_same(pair, build, link, text):
    with pytest.raises(CouplingError, match=text):
        run(build, pair, [link])
    for one in pair.values():
        one.close()


def test_what_a_member_says_of_them_is_told(pair, build):
    failing = pair["b"].set

    def refuse(name, value):
        if name == "s" and value.startswith("AA"):
            raise CouplingError(f"b: cannot hear {value!r}.")
        failing(name, value)

    pair["b"].set = refuse
    with pytest.raises(Exception, match=r"b: failed with ERROR in the step from t = 3 ms.*cannot hear 'AA0,2,'"):
        run(build, pair, RING)


STATE = """
int fmi3GetFMUState(Instance *c, void **s) { if (!*s) *s = malloc(sizeof *c); memcpy(*s, c, sizeof *c); return 0; }
int fmi3SetFMUState(Instance *c, void *s) { memcpy(c, s, sizeof *c); return 0; }
int fmi3FreeFMUState(Instance *c, void **s) { free(*s); *s = NULL; return 0; }
"""


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("algorithm", ["iterative", "step_doubling", "energy"])
@pytest.mark.parametrize("isolate", [False, True])
def test_they_come_back_with_a_step_that_is_taken_back(tmp_path, build, algorithm, isolate):
    """Every step counts one up in a binary and passes it on; steps that do not stay leave nothing."""
    counting = NATIVE.replace("*last = end;", "*last = end; c->data[c->length - 1]++;") + STATE
    path = native_fmu(tmp_path, NATIVE_XML.replace("Size=", 'Size="true" canGetAndSetFMUState=', 1), counting)
    members = {name: member(name, path, {"data": b"\1\0"}) for name in "cd"}
    if isolate:
        members["d"] = IsolatedMember(members["d"], build)
    for name, part in masses(FORCE).items():
        members[name] = RecordMember(name, part, compiler.load_component(type(part), build))
    catalog = {name: one.variables for name, one in members.items()}
    wires = [Connection(*one.split(" -> ")) for one in [*FORCE, "c.echo -> d.data"]]
    simulated = CoSimulation(members, CoupledSystem(catalog, wires).links(), 8 * MS, algorithm, build=build, record=[])
    try:
        simulated.initialize(0, 80 * MS)
        simulated.advance(80 * MS)
        steps, swept = members["c"].get("echo")[-1], int(simulated.state["sweeps"])
        assert members["d"].get("echo")[-1] - steps == (1 if algorithm == "iterative" else 0)
        stay = int(simulated.state["accepted"]) * (2 if algorithm == "step_doubling" else 1)
        assert steps == (stay or 10) % 256
        assert swept > stay or algorithm == "energy"
    finally:
        simulated.terminate()
