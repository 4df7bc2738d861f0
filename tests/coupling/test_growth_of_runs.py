"""Growth of a deviation in small loops, where it can be computed by hand, and couplings of which none can be told."""

import numpy as np
import pytest

from twin.component import Component, PythonComponent, input, output, parameter
from twin.component import local as stored
from twin.coupling import Connection, CoSimulation, CoupledSystem, RecordMember
from twin.coupling.stability import growth as module
from twin.coupling.stability.growth import growth
from twin.errors import CouplingError

MS = 1_000_000


class Echo(Component):
    """What came in, times a gain."""

    u = input("m", "in")
    y = output("m", "out", start=1.0)
    gain = parameter(1.0, "", "gain")

    def step(self, t, h):
        self.y = self.gain * self.u


class Decay(Component):
    """A number that shrinks by itself, one that grows, and a count of steps."""

    slow = stored(4.0, "m", "shrinks")
    fast = stored(2.0, "m", "grows")
    count = stored(0.0, "", "steps")

    def step(self, t, h):
        self.slow *= 0.5
        self.fast *= 1.25


class Refusing(Component):
    """Fails every step."""

    x = stored(1.0, "m", "something")

    def step(self, t, h) -> int:
        return 3


class Spoiling(Component):
    """Is no number after its first step."""

    y = output("m", "out")

    def step(self, t, h):
        self.y = float("nan")


class Hidden(PythonComponent):
    """Keeps its state to itself."""

    y = output("m", "out")

    def step(self, t, h):
        self.y = t


def values(members):
    return {(name, path): member.get(path) for name, member in members.items() for path in member.variables}


def grown(build, parts, wires, algorithm="jacobi", **options):
    members = {name: RecordMember(name, part) for name, part in parts.items()}
    catalog = {name: member.variables for name, member in members.items()}
    links = CoupledSystem(catalog, [Connection(*wire.split(" -> ")) for wire in wires]).links()
    simulated = CoSimulation(members, links, MS, algorithm, build=build, **options)
    simulated.initialize(0, 100 * MS)
    try:
        before = values(members)
        result = growth(simulated)
        assert values(members) == before, "the run goes on as if nothing had been"
        return result
    finally:
        simulated.terminate()


RING = ["a.y -> b.u", "b.y -> a.u"]


@pytest.mark.parametrize(
    ("algorithm", "periods", "factor", "cycle"),
    [
        ("jacobi", {}, 2.0, 1),  # each value goes around in two steps, times 0.5 and times 8
        ("gauss_seidel", {}, 4.0, 1),  # in one step
        ("jacobi", {"b": 2 * MS}, 2.0, 2),  # what "b" publishes is seen after its period: once around in two of them
        ("gauss_seidel", {"a": 2 * MS, "b": 3 * MS}, 4.0**2, 6),
    ],
)
def test_a_deviation_grows_by_the_gains_around_a_loop(algorithm, periods, factor, cycle, build):
    parts = {"a": Echo(gain=0.5), "b": Echo(gain=8.0)}
    found = grown(build, parts, RING, algorithm, periods=periods)
    if len(periods) < 2:
        assert found.factor == pytest.approx(factor, rel=1e-6)
    assert found.cycle == pytest.approx(cycle * 1e-3)
    assert found.rate == pytest.approx(np.log(found.factor) / (cycle * 1e-3))
    assert {name.partition(".")[0] for name in found.share} <= {"a", "b"}


def test_the_values_that_grow_are_named_the_largest_first(build):
    found = grown(build, {"a": Decay(), "b": Decay()}, [])
    assert found.factor == pytest.approx(1.25, rel=1e-6)
    assert set(found.share) <= {"a.fast", "b.fast"}
    assert found.share
    echo = grown(build, {"a": Echo(gain=0.5), "b": Echo(gain=8.0)}, RING)
    assert echo.share[0].startswith("b."), "eight times as large as the others"


def test_without_values_nothing_grows(build):
    found = grown(
        build, {"a": type("Empty", (Component,), {"__doc__": "Nothing.", "step": lambda self, t, h: None})()}, []
    )
    assert (found.factor, found.cycle, found.share) == (0.0, 1e-3, ())


def test_a_deviation_that_is_not_finite_grows_without_limit(build):
    found = grown(build, {"a": Echo(), "b": Spoiling()}, ["b.y -> a.u"])
    assert (found.factor, found.share) == (np.inf, ())


def test_couplings_of_which_nothing_can_be_told(build, monkeypatch):
    with pytest.raises(CouplingError) as caught:
        grown(build, {"a": Hidden(), "b": Echo(), "c": Hidden()}, [])
    assert caught.value.problems == [
        f"stability: {name} keeps its state to itself: it is Python. Nothing can be told of a coupling with it."
        for name in ("a", "c")
    ]
    with pytest.raises(CouplingError, match=r"stability: b fails a step\."):
        grown(build, {"a": Echo(), "b": Refusing()}, [])
    monkeypatch.setattr(module, "LONGEST", 6)
    periods = {"a": 2 * MS, "b": 3 * MS}
    assert grown(build, {"a": Echo(), "b": Echo()}, RING, periods=periods).cycle == pytest.approx(0.006)
    with pytest.raises(CouplingError, match=r"the periods meet only every 10 steps\. Use periods with a common one\."):
        grown(build, {"a": Echo(), "b": Echo()}, RING, periods={"a": 2 * MS, "b": 5 * MS})
