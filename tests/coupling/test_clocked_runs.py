"""Runs of members with clocks: events at the begin, at communication points and between two, and how they end a run."""

import pytest

from tests.coupling.mock import Mock
from twin.coupling import Connection, CoSimulation, CoupledSystem
from twin.errors import CouplingError

MS = 1_000_000


class Ticking(Mock):
    """A member whose clock ticks at some times [ns]; the journal has its events and steps [ms]. `ends`: at which it ends."""

    clocked, event_time, has_jumped = True, None, False

    def __init__(self, name, ticks=(), ends_at=None):
        super().__init__(name)
        self.ticks, self.ends_at, self.ended, self.journal = list(ticks), ends_at, False, []
        self.fresh = False

    @property
    def due(self):
        return self.ticks[0] if self.ticks else None

    def due_clocks(self, now):
        return ["c"] if self.ticks and self.ticks[0] <= now else []

    def has_news(self, now):
        return False

    def enter_events(self, now):
        self.journal.append(f"event at {now / MS:g}")

    def tick(self, name, now):
        self.journal.append(f"{name} ticks")
        self.ticks.pop(0)
        self.ended = self.ended or now == self.ends_at
        return True

    def evaluate(self, now):
        return False

    def ticked_clocks(self):
        return []

    def finish(self, now):
        return False

    def leave_events(self):
        pass

    def rest(self):
        self.fresh = True

    def step(self, instance, t, h, *flags):
        self.journal.append(f"step {t * 1000:g} to {(t + h) * 1000:g}")
        return super().step(instance, t, h, *flags)


def run(build, ticks, algorithm="jacobi", until=12 * MS, **options):
    members = {"a": Ticking("a", ticks, **options), "b": Mock("b")}
    catalog = {name: member.variables for name, member in members.items()}
    links = CoupledSystem(catalog, [Connection("a.y", "b.u")]).links()
    simulated = CoSimulation(members, links, 4 * MS, algorithm, build=build)
    simulated.initialize(0, 12 * MS)
    reached = []
    simulated.advance(until, reached.append)
    simulated.terminate()
    assert reached[-1] == simulated.time
    return simulated, members["a"].journal


@pytest.mark.parametrize("algorithm", ["jacobi", "gauss_seidel", "iterative"])
def test_a_clock_that_ticks_between_two_points_cuts_the_step(algorithm, build):
    """After initialization all are in Event Mode; a tick at a communication point cuts nothing."""
    simulated, journal = run(build, [4 * MS, 6_500_000], algorithm)
    steps = list(dict.fromkeys(journal))  # iterations repeat a step
    assert steps == [
        *("event at 0", "step 0 to 4", "event at 4", "c ticks", "step 4 to 6.5"),
        *("event at 6.5", "step 6.5 to 8", "step 8 to 12"),
    ]
    assert simulated.recording().time.tolist() == pytest.approx([0.0, 0.004, 0.008, 0.012])
    assert (simulated.finished, simulated.time) == (False, 12 * MS)
    begins = list(dict.fromkeys(t for t, _ in simulated.members["b"].steps))
    assert begins == pytest.approx([0.0, 0.004, 0.0065, 0.008]), "all step to the tick"


@pytest.mark.parametrize(("at", "text", "rows"), [(4 * MS, "4 ms", 2), (6_500_000, "6.5 ms", None)])
def test_a_member_may_wish_at_an_event_to_end_the_run(at, text, rows, build):
    simulated, journal = run(build, [at], ends_at=at)
    assert simulated.finished
    assert simulated.failure == f"a ended the simulation at {text}: it wished so at an event"
    assert journal[-1] == "c ticks"
    if rows:
        assert len(simulated.recording().time) == rows


def test_what_is_set_from_outside_is_an_event_of_members_with_clocks(build):
    members = {"a": Ticking("a"), "b": Mock("b")}
    simulated = CoSimulation(members, [], 4 * MS, build=build)
    simulated.initialize(0, 12 * MS)
    assert (simulated.last, simulated.value(("a", "t"))) == (None, 0.0)
    simulated.advance(4 * MS)
    for key, value in ((("b", "u"), 1.0), (("a", "u"), 2.0)):
        simulated.set(key, value)
    assert members["a"].journal == ["event at 0", "step 0 to 4", "event at 4"], "of the second one"
    assert (members["b"].memory[0], members["a"].memory[0]) == (1.0, 2.0)
    with pytest.raises(CouplingError, match=r"6 ms is no communication point\. Give n times 4 ms\."):
        simulated.advance(6 * MS)
    simulated.terminate()


def test_delays_are_those_of_the_order_and_of_periods(build):
    """Beyond the step of the source: none from a member that stepped before, else a period of the reader."""

    def delays(algorithm, periods=None, clocked=()):
        members = {name: Mock(name) for name in "abc"}
        catalog = {name: member.variables for name, member in members.items()}
        wires = [Connection("a.y", "b.u"), Connection("b.y", "c.u"), Connection("c.y", "a.u")]
        links = CoupledSystem(catalog, wires).links()
        simulated = CoSimulation(members, links, MS, algorithm, build=build, periods=periods)
        return [delay // MS for _, delay in simulated.delays()]

    assert delays("jacobi") == [1, 1, 1]
    assert delays("gauss_seidel") == [0, 0, 1]
    assert delays("gauss_seidel", {"b": 4 * MS}) == [3, 0, 1], "what a slow member takes is held"
    assert delays("jacobi", {"b": 4 * MS}) == [4, 1, 1]
    assert delays("iterative") == [0, 0, 0]
    assert delays("iterative", {"b": 4 * MS}) == [4, 1, 0]
    assert delays({"name": "predictive"}) == [1, 1, 1]
    assert delays({"name": "gauss_seidel", "order": 1}) == [0, 0, 1]
    assert delays({"name": "iterative", "iterations": 1}) == [0, 0, 0]


@pytest.mark.parametrize("phase", ["instantiate", "enter_initialization", "exit_initialization"])
def test_what_goes_wrong_before_the_first_step_is_told_with_its_member(phase, build):
    member = Mock("a")
    member.log.append("a line")
    noted = []

    def fail(*_):
        raise ValueError("why")

    setattr(member, phase, fail)
    simulated = CoSimulation({"a": member}, [], MS, build=build)
    simulated.recorder.note = noted.append
    name = "instantiation" if phase == "instantiate" else "initialization"
    with pytest.raises(Exception, match=rf"^a: {name} failed: why Last log: a line$"):
        simulated.initialize(0)
    assert noted[-1] == f"a: {name}"
    assert simulated.recording().time.tolist() == []
