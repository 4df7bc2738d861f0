"""Members with clocks under algorithms that take steps back or make several: what was taken back had no event."""

import numpy as np
import pytest

from tests.coupling.parts import Lag
from tests.fmi.clock_parts import KINDS, TICKS, clocks_fmu, described, library
from tests.fmi.test_clocks import MS, Held, S, changes, coupled, folder  # noqa: F401 - fixtures
from tests.fmi.third_party import archive
from twin.component import Component, input, output, parameter, solver, state
from twin.coupling import Algorithm
from twin.errors import CouplingError
from twin.fmi import member

ALGORITHMS = [
    Algorithm("jacobi", order=1),
    Algorithm("gauss_seidel", order=2),
    Algorithm("iterative"),
    Algorithm("iterative", order=1, acceleration="newton"),
    Algorithm("step_doubling", tolerance=1e-3),
    Algorithm("step_doubling", iterations=10, tolerance=1e-3),
    Algorithm("predictive", order=1, tolerance=1e-3),
]
LINKS = ["k.constant -> f.tick", "k.x -> f.u", "k.x -> a.u", "a.y -> k.u"]


class Swing(Component):
    """A fast oscillation, which makes an algorithm shorten its steps: der2(x) = w^2 (u - x)."""

    u = input("", "where it rests")
    y = output("", "where it is")
    w = parameter(60.0, "rad/s", "natural frequency", source="assumed")
    x = state(0.0, "", "place")
    v = state(0.0, "1/s", "speed")
    method = solver.rk4(1e-3)

    def derivatives(self, t):
        self.der_x = self.v
        self.der_v = self.w**2 * (self.u - self.x)
        self.y = self.x


def counted(found, name="k"):
    """Whether every clock had ticked as often as it must at each communication point."""
    for kind in KINDS[:6]:
        expected = np.searchsorted(np.array(TICKS[kind]), found.time + 1e-9)
        assert found.signals[f"{name}.{kind}_count"].tolist() == expected.tolist(), kind


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("algorithm", ALGORITHMS, ids=lambda one: one.described)
def test_clocks_tick_when_they_must(coupled, algorithm):  # noqa: F811
    keys = [*(("k", f"{kind}_count") for kind in KINDS), ("f", "sum"), ("f", "n"), ("a", "y"), ("k", "x")]
    parts = {"k": "Kinds", "f": "Follower", "a": Lag}
    found, failure = coupled(parts, LINKS, 2 * S, step=250 * MS, algorithm=algorithm, record=keys)
    assert not failure
    counted(found)
    assert found.signals["k.every_second_count"][-1] == found.signals["f.n"][-1] / 2 == 5
    # the clock takes x where it ticks: x is t + u, and u what the lag is
    ticks = np.array(TICKS["constant"])
    assert np.all(np.abs(found.signals["f.sum"][-1] - ticks.sum()) < np.abs(found.signals["a.y"]).max() * len(ticks))


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("algorithm", [one for one in ALGORITHMS if one.rolls_back], ids=lambda one: one.described)
def test_an_event_inside_a_step_is_where_it_is(coupled, algorithm):  # noqa: F811
    """The FMU comes back early at 0.33 s; all others are brought there, too, and the event is at that time, once."""
    keys = [("k", "alarm_count"), ("k", "signalled"), ("k", "x"), ("a", "y")]
    found, _ = coupled(
        {"k": "Kinds", "a": Lag},
        ["k.x -> a.u", "a.y -> k.u"],
        S,
        step=250 * MS,
        algorithm=algorithm,
        starts={"k": {"signal_at": 0.33}},
        record=keys,
    )
    assert found.signals["k.alarm_count"].tolist() == [0, 0, 1, 1, 1]
    assert found.signals["k.signalled"][-1] == 0.33


@pytest.mark.slow
@pytest.mark.parametrize("name", ["step_doubling", "predictive"])
def test_steps_that_are_taken_back_have_no_events(coupled, folder, name):  # noqa: F811
    made = []

    def talking(key):
        made.append(member(key, clocks_fmu(folder, "Kinds")))
        return made[-1]

    algorithm = Algorithm(name, tolerance=1e-5, order=1)
    keys = [*(("k", f"{kind}_count") for kind in KINDS), ("s", "y"), ("z", "y")]
    stepped, rejected = [], []

    def look(system):
        stepped.append(int(system.state["accepted"]))
        rejected.append(int(system.state["rejected"]))

    found, _ = coupled(
        {"k": talking, "s": Swing, "z": Lag},
        ["k.x -> s.u", "s.y -> z.u", "z.y -> k.u"],
        2 * S,
        step=50 * MS,
        algorithm=algorithm,
        record=keys,
        events={1900 * MS: look},
    )
    assert rejected[0] > 5
    counted(found)
    assert made[0].log == []  # the FMU tells of every call that the standard forbids


def test_slow_members_are_not_cut(coupled):  # noqa: F811
    keys = [("k", "constant_count"), ("h", "y")]
    found, _ = coupled(
        {"k": "Kinds", "h": Held}, ["k.x -> h.u"], 2 * S, step=100 * MS, algorithm="iterative", record=keys
    )
    assert changes(found, "h.y")[0] == 0.2  # as without clocks: sampled at 0.1 s, published at 0.2 s


@pytest.mark.slow
def test_scheduled_execution_and_model_exchange(coupled, folder):  # noqa: F811
    def exchanged(name):
        return member(name, clocks_fmu(folder, "Kinds"), interface="model_exchange")

    keys = [("p", "total"), ("p", "result"), *(("k", f"{kind}_count") for kind in KINDS)]
    links = ["k.x -> a.u", "a.y -> k.u", "k.constant_count -> p.given"]
    found = {}
    for algorithm in ("jacobi", "iterative"):
        parts = {"k": exchanged, "a": Lag, "p": "Partitions"}
        found[algorithm], _ = coupled(parts, links, 2 * S, step=250 * MS, algorithm=algorithm, record=keys)
        counted(found[algorithm])
    for name in ("p.total", "p.result"):
        assert np.array_equal(found["jacobi"].signals[name], found["iterative"].signals[name])


def test_a_value_set_from_outside_and_an_override(coupled):  # noqa: F811
    keys = [("k", "seen"), ("f", "sum"), ("k", "tunable_count")]
    act = {
        500 * MS: lambda one: (one.set(("k", "d"), 3), one.override(("f", "u"), 10.0)),
        1000 * MS: lambda one: one.release(("f", "u")),
    }
    found, _ = coupled(
        {"k": "Kinds", "f": "Follower"},
        ["k.tunable -> f.tick", "k.pace -> f.u"],
        2 * S,
        step=250 * MS,
        algorithm=Algorithm("iterative", order=1),
        record=keys,
        events=act,
    )
    assert changes(found, "k.seen") == [0.75]
    assert found.signals["f.sum"].tolist() == pytest.approx([0.4, 0.4, 0.8, 0.8, 10.8, 10.8, 11.2, 11.2, 11.6])


def test_one_that_cannot_save_its_state_is_named(coupled):  # noqa: F811
    words = r"n: has clocks and cannot save its state .* with algorithm iterative. Use jacobi or gauss_seidel"
    with pytest.raises(CouplingError, match=words):
        coupled({"n": "Node"}, [], S, algorithm="iterative")


def test_one_with_a_step_of_its_own_is_named(coupled, folder):  # noqa: F811
    text = described("Kinds").replace('canHandleVariableCommunicationStepSize="true"', 'fixedInternalStepSize="0.05"')
    files = {"modelDescription.xml": text.encode(), "binaries/x86_64-linux/Kinds.so": library()}
    path = archive(folder / "Fixed.fmu", files)
    words = r"k: has clocks and makes steps of one length only, .* with algorithm iterative. Use jacobi or gauss_seidel"
    with pytest.raises(CouplingError, match=words):
        coupled({"k": lambda name: member(name, path)}, [], S, algorithm="iterative")
    found, _ = coupled({"k": lambda name: member(name, path)}, [], S, record=[("k", "constant_count")])
    assert found.signals["k.constant_count"][-1] == 5
