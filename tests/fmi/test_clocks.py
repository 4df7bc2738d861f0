"""Clocks on import in a co-simulation: every kind of clock, connections, events, Scheduled Execution as a member.

What is expected is worked out from FMI 3.0.2, section 2.2.8; the FMUs refuse what the standard forbids (tests/fmi/clocks.c).
"""

import numpy as np
import pytest

import twin
from tests.fmi.clock_parts import KINDS, TICKS, clocks_fmu
from twin.component import Component, input, output
from twin.coupling import Connection, CoSimulation, CoupledSystem, RecordMember
from twin.errors import CouplingError, FMUError, SimulationError
from twin.fmi import member


class Held(Component):
    """Samples every 100 ms."""

    period = 0.1
    u = input("", "input")
    y = output("", "output")

    def step(self, t, h):
        self.y = self.u


class Follow(Component):
    """An output that is its input at the begin of the step, and one that is how far it went."""

    u = input("", "input")
    y = output("", "output")
    way = output("s", "sum of the steps")

    def step(self, t, h):
        self.y = self.u
        self.way = self.way + h


MS = 1_000_000
S = 1000 * MS


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("clocks")


@pytest.fixture(scope="module")
def coupled(folder, build):
    """Run members coupled; what was recorded, and how it ended."""

    def made(name, part, values):
        if isinstance(part, str):
            return member(name, clocks_fmu(folder, part), values)
        return RecordMember(name, part()) if isinstance(part, type) else part(name)

    def run(parts, connections, stop, step=50 * MS, algorithm="jacobi", starts=None, events=None, **options):
        members = {name: made(name, one, (starts or {}).get(name)) for name, one in parts.items()}
        links = CoupledSystem(
            {name: one.variables for name, one in members.items()}, connections_of(connections)
        ).links()
        system = CoSimulation(members, links, step, algorithm, build=build, **options)
        try:
            system.initialize(0, stop)
            for time, act in (events or {}).items():
                system.advance(time)
                act(system)
            system.advance(stop)
            return system.recording(), system.failure
        finally:
            system.terminate()

    return run


def connections_of(texts):
    return [Connection(*text.split(" -> ")) for text in texts]


def changes(recording, name):
    """Times at which a recorded variable is another one than before."""
    values = recording.signals[name]
    return [round(float(t), 6) for t in recording.time[1:][values[1:] != values[:-1]]]


# ------------------------------------------------------------------------------------------------------ kinds of clocks


@pytest.fixture(scope="module")
def kinds(coupled):
    keys = [("k", one) for kind in KINDS for one in (kind, f"{kind}_count")] + [("k", "latest")]
    return coupled({"k": "Kinds"}, [], 2 * S, record=keys)[0]


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_ticks_when_it_must(kinds, kind):
    ticks = np.round(kinds.time[kinds.signals[f"k.{kind}"] != 0], 6)
    assert ticks.tolist() == TICKS[kind]
    expected = np.searchsorted(np.array(TICKS[kind]), kinds.time + 1e-9)
    assert np.array_equal(kinds.signals[f"k.{kind}_count"], expected)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("step", [40 * MS, 250 * MS, S, S // 3])
def test_ticks_between_communication_points_cut_the_step(coupled, step):
    keys = [
        *(("k", f"{kind}_count") for kind in KINDS),
        ("k", "x"),
        ("k", "fixed"),
        ("f", "sum"),
        ("o", "way"),
        ("o", "y"),
    ]
    parts = {"k": "Kinds", "f": "Follower", "o": Follow}
    links = ["k.every_second -> f.tick", "k.x -> f.u", "f.sum -> o.u"]
    found, _ = coupled(parts, links, 2 * S // step * step, step=step, record=keys)
    for kind, ticks in TICKS.items():
        expected = np.searchsorted(np.array(ticks), found.time + 1e-9)
        assert np.array_equal(found.signals[f"k.{kind}_count"], expected), kind
    assert found.signals["f.sum"][-1] == pytest.approx(sum(TICKS["every_second"]))
    assert found.signals["o.y"][-1] == found.signals["f.sum"][-1]  # all members step to the tick, and on
    assert found.signals["k.x"] == pytest.approx(found.time, abs=1e-12)
    assert found.signals["o.way"] == pytest.approx(found.time, abs=1e-12)
    counts = found.signals["k.fixed_count"]
    assert found.signals["k.fixed"].tolist() == [bool(counts[0]), *(counts[1:] > counts[:-1]).tolist()]


def test_a_clocked_variable_keeps_its_value_between_ticks(kinds):
    assert np.unique(kinds.signals["k.latest"].round(6)).tolist() == [0.0, 0.8, 1.4, 2.0]


def test_intervals_of_the_importer(coupled):
    starts = {"k": {"tunable": 0.2, "pace": 0.1}}
    act = {250 * MS: lambda one: one.set(("k", "tunable"), 0.05), 300 * MS: lambda one: one.set(("k", "pace"), 0.25)}
    keys = [("k", "tunable_count"), ("k", "paced_count")]
    found, _ = coupled({"k": "Kinds"}, [], 600 * MS, starts=starts, events=act, record=keys)
    assert changes(found, "k.tunable_count") == [0.2, 0.3, 0.35, 0.4, 0.45, 0.5, 0.55, 0.6]

    # a new interval counts from the event in which it is told
    assert changes(found, "k.paced_count") == [0.1, 0.2, 0.3, 0.55]


def test_an_event_of_the_fmu_own_and_one_from_outside(coupled):
    act = {100 * MS: lambda one: one.set(("k", "d"), 3), 200 * MS: lambda one: one.set(("k", "triggered"), value=True)}
    keys = [("k", one) for one in ("alarm", "seen", "triggered", "triggered_count")]
    found, _ = coupled({"k": "Kinds"}, [], 500 * MS, starts={"k": {"signal_at": 0.22}}, events=act, record=keys)
    assert found.time[found.signals["k.alarm"] != 0].tolist() == [0.25]  # the end of the step in which it happened
    assert (changes(found, "k.seen"), found.signals["k.seen"][-1]) == ([0.15], 3)
    assert changes(found, "k.triggered_count") == [0.25]  # as any `set`: from the next step on
    assert found.time[found.signals["k.triggered"]].tolist() == [0.25]


# -------------------------------------------------------------------------------------------------------- connections


@pytest.mark.parametrize("algorithm", ["jacobi", "gauss_seidel"])
def test_ticks_and_values_reach_others_at_the_same_time(coupled, algorithm):
    links = ["k.every_second -> f.tick", "k.x -> f.u", "f.half -> g.tick", "f.sum -> g.u"]
    found, _ = coupled({"g": "Follower", "k": "Kinds", "f": "Follower"}, links, 2 * S, algorithm=algorithm)
    assert changes(found, "f.n") == TICKS["every_second"]
    assert changes(found, "g.n") == TICKS["every_second"][1::2]

    # f adds the time up at its ticks; g, in the same instant, what f has then
    assert found.signals["f.sum"][-1] == pytest.approx(sum(TICKS["every_second"]))
    assert found.signals["g.sum"][-1] == pytest.approx((0.3 + 0.7) + (0.3 + 0.7 + 1.1 + 1.5))
    assert found.time[found.signals["f.half"] != 0].tolist() == TICKS["every_second"][1::2]


def test_a_clock_that_ticks_by_time_lets_others_tick(coupled):
    found, _ = coupled({"k": "Kinds", "f": "Follower"}, ["k.changing -> f.tick", "k.latest -> f.u"], 2 * S)
    assert changes(found, "f.n") == TICKS["changing"]
    assert found.signals["f.held"][-1] == pytest.approx(3 * 0.0 + 0.8 + 1.4)


def test_an_override_is_what_a_clock_samples(coupled):
    act = {500 * MS: lambda one: one.override(("k", "x"), 100.0), S: lambda one: one.release(("k", "x"))}
    links = ["k.every_second -> f.tick", "k.x -> f.u"]
    found, _ = coupled({"k": "Kinds", "f": "Follower"}, links, 2 * S, events=act)
    assert found.signals["f.sum"][-1] == pytest.approx(0.3 + 100.0 + 1.1 + 1.5 + 1.9)


def test_messages_with_their_clocks(coupled):
    """Two nodes of a bus: each sends every third of a second, in an exact ratio, what the other hears at that time."""
    links = [
        f"{one}.{a} -> {other}.{b}" for one, other in ("ab", "ba") for a, b in (("sent", "take"), ("message", "taken"))
    ]
    keys = [(one, name) for one in "ab" for name in ("heard", "word", "announced")]
    starts = {"a": {"address": 7}, "b": {"address": 9}}
    found, _ = coupled({"a": "Node", "b": "Node"}, links, 2 * S, step=250 * MS, starts=starts, record=keys)
    expected = np.floor(found.time * 3 + 1e-9).astype(int)
    assert found.signals["a.heard"].tolist() == found.signals["b.heard"].tolist() == expected.tolist()
    assert found.signals["a.word"][-1] == 256 * 9 + 6
    assert found.signals["b.word"][-1] == 256 * 7 + 6
    assert found.signals["a.announced"].tolist() == [0.0, 0.0, *[0.35] * 7]  # the step is cut there, too


def test_an_fmu_that_ends_the_simulation_at_an_event(coupled):
    for last, end, row in ((0.9, "1 s", 1.0), (0.6, "2/3 s", 0.6)):
        found, failure = coupled({"a": "Node"}, [], 2 * S, step=100 * MS, starts={"a": {"last": last}})
        assert failure == f"a ended the simulation at {end}: it wished so at an event"  # the first one behind `last`
        assert found.time[-1] == row


def test_a_failure_at_an_event_says_when(coupled):
    links = ["n.sent -> k.triggered", "n.message -> o.taken"]  # o is given a message while its clock does not tick
    with pytest.raises(SimulationError, match=r"n: fmi3GetBinary .*ERROR.* t = 1/3 s") as caught:
        coupled({"n": "Node", "k": "Kinds", "o": "Node"}, links, S, starts={"n": {"address": -1}})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("connections", "words"),
    [
        (["k.x -> f.tick"], "Float64 does not fit Clock"),
        (["f.half -> k.fixed"], "the target ticks by itself .fixed."),
        (["f.tick -> k.triggered"], "the source is an input"),
        (["k.alarm -> f.tick", "k.every_second -> f.tick"], "has two sources"),
    ],
)
def test_clocks_that_do_not_fit(coupled, connections, words):
    with pytest.raises(CouplingError, match=words):
        coupled({"k": "Kinds", "f": "Follower"}, connections, S)


def test_a_scenario_with_clocks(folder, build):
    system = twin.System()
    for name, model in (("k", "Kinds"), ("f", "Follower"), ("p", "Partitions")):
        system.add(name, clocks_fmu(folder, model), parameters={"tunable": "200 ms"} if name == "k" else {})
    system.connect("k.every_second", "f.tick")
    system.connect("k.x", "f.u")
    with system.simulate("50 ms", build=build, record=["p.second"]) as running:
        running.advance("300 ms")
        assert (running["k.every_second"], running["f.sum"]) == (True, pytest.approx(0.3))
        running["p.second"] = True
        assert running["p.second_ticks"] == 1
        running.advance("50 ms")
        assert (running["p.second"], running["k.tunable_count"]) == (True, 2)
        assert running.results["p.second"].tolist() == [False] * 7 + [True]


# ------------------------------------------------------------------------------------------------ Scheduled Execution


def test_partitions_as_a_member(coupled):
    links = ["k.every_second -> p.second", "p.fifth -> f.tick", "p.made -> f.u", "p.made -> p.given"]
    parts = {"k": "Kinds", "p": "Partitions", "f": "Follower"}
    found, _ = coupled(parts, links, 5 * S)
    assert changes(found, "p.first_ticks") == [1.0, 2.0, 3.0, 4.0, 5.0]
    assert changes(found, "p.second_ticks") == [round(0.3 + 0.4 * i, 6) for i in range(12)]
    assert changes(found, "p.made") == [4.0]
    assert found.signals["p.result"][-1] == 2000  # 1000 at 4.3 s and at 4.7 s
    assert found.signals["f.n"][-1] == found.signals["p.total"][-1] // 5


# ----------------------------------------------------------------------------------------------------- Model Exchange


def test_clocks_of_model_exchange_in_a_co_simulation(coupled, folder):
    exchanged = lambda name: member(name, clocks_fmu(folder, "Kinds"), interface="model_exchange")  # noqa: E731
    act = {S: lambda one: one.set(("k", "triggered"), value=True)}
    links = ["k.every_second_count -> o.u"]
    found, _ = coupled({"k": exchanged, "o": Follow}, links, 2 * S, step=250 * MS, events=act)
    assert found.signals["k.changing_count"].tolist() == np.searchsorted(TICKS["changing"], found.time + 1e-9).tolist()
    assert changes(found, "k.triggered_count") == [1.25]
    with pytest.raises(CouplingError, match="clocks are connected in Co-Simulation"):
        coupled({"k": exchanged, "f": "Follower"}, ["k.every_second -> f.tick"], S)


# -------------------------------------------------------------------------------------------------------------- errors


@pytest.mark.parametrize(
    ("error", "words", "options"),
    [
        (CouplingError, "steps with every communication step of 50 ms, not every 100 ms", {"periods": {"k": 100 * MS}}),
        (FMUError, "constant is a constant clock", {"starts": {"k": {"constant": 0.1}}}),
        (FMUError, "interval -1 s of tunable is not positive", {"starts": {"k": {"tunable": -1}}}),
    ],
)
def test_errors(coupled, error, words, options):
    with pytest.raises(error, match=words):
        coupled({"k": "Kinds"}, [], S, **options)


def test_a_member_that_cannot_make_shorter_steps(coupled):
    words = "k: a clock ticks at t = 50 ms, between .* of 100 ms, and h cannot .* Use a communication step of 50 ms."
    with pytest.raises(SimulationError, match=words):
        coupled({"k": "Kinds", "h": Held}, [], S, step=100 * MS)


def test_an_event_without_end(coupled):
    with pytest.raises(SimulationError, match="has no end after 100 instants"):
        coupled({"k": "Kinds"}, [], S, starts={"k": {"wait": 0}})


def test_values_that_change_each_other_without_end(coupled):
    links = ["k.constant -> f.tick", "k.constant -> g.tick", "f.sum -> g.u", "g.sum -> f.u"]
    with pytest.raises(SimulationError, match=r"f, g: values .* t = 100 ms change each other without end"):
        coupled({"k": "Kinds", "f": "Follower", "g": "Follower"}, links, S, starts={"f": {"bias": 1.0}})
