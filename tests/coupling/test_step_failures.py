"""What is done and said about a step that did not succeed, of a run whose record and members a test decides."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.every_case import every_case
from twin.coupling import Algorithm
from twin.coupling.execution import loop
from twin.coupling.execution.step_failures import StepFailures, log_text
from twin.coupling.variable_step.record_layout import ASKING, DOUBLING, EARLY, FIXED, PREDICTED, UNSOLVED
from twin.errors import SimulationError

MS = 1_000_000
DISCARD, ERROR, FATAL = 2, 3, 4


class Silent(SimpleNamespace):
    """A member that says what a test lets it say."""

    def __init__(self, name, **fields):
        told = {"reason": "", "reached": None, "loss": "", "failure": None, "log": [], "statuses": []}
        super().__init__(name=name, **told | fields)

    def lost(self, time):
        return self.loss and f"{self.loss} after {time / MS:g} ms"

    def finish_reason(self):
        return self.reason

    def last_successful_time(self, reached):
        self.asked = reached
        return self.reached

    def failed(self, status):
        self.statuses.append(status)


class Failing(StepFailures):
    """A run of "a" and "b", in the step of 4 ms from 108 ms on; "b", the second one, is the member that failed."""

    time = property(lambda self: self._begin + int(self.state["tick"]) * self.step)

    def __init__(self, algorithm="jacobi", variable=False, **fields):
        self.member = Silent("b")
        self.members = {"a": Silent("a"), "b": self.member}
        self.algorithm, self._slow, self.step, self._begin = Algorithm(algorithm), [], 4 * MS, 100 * MS
        self.finished, self.failure, self.notes, self._last = False, "", [], None
        self._variable_step = SimpleNamespace(disagreements=lambda: self.disagreeing) if variable else None
        self.flags = np.zeros((2, 4))
        steps = np.zeros((2, len(loop.STEP)), np.int64)
        steps[:, loop.STEP.index("flags")] = self.flags.ctypes.data + 32 * np.arange(2)
        steps[:, -1] = 0, 1
        self._tables = SimpleNamespace(arrays={"steps": steps, "accesses": np.zeros((3, 7), np.int64)})
        self.plan = SimpleNamespace(events=None, staged={}, accesses=[], access_names={}, functions={})
        self.watch = SimpleNamespace(replays=False, non_finite_members=lambda _failed="": [])
        self.state = np.zeros(1, loop.RECORD)[0]
        given = {"tick": 2, "member": 1, "step_begin": 0.108, "span": 0.004, "divisions": 8, "stride": 8} | fields
        for name, value in given.items():
            self.state[name] = value

    def refuse(self):
        with pytest.raises(SimulationError) as caught:
            self._handle_failure()
        return str(caught.value)


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"status": ERROR}, "b: failed with ERROR in the step from t = 108 ms. Last inputs: none."),
        ({"status": FATAL}, "b: failed with FATAL in the step from t = 108 ms. Last inputs: none."),
        ({"status": DISCARD}, "b: failed with DISCARD in the step from t = 108 ms. Last inputs: none."),
        ({"status": 7}, "b: failed with ERROR in the step from t = 108 ms. Last inputs: none."),
    ],
)
def test_a_failed_step_is_named_with_its_status_and_time(fields, text):
    run = Failing(**fields)
    assert run.refuse() == text
    assert run.member.statuses == [fields["status"]]
    assert run.members["a"].statuses == []


def test_a_failed_step_is_named_with_its_inputs_and_log():
    run = Failing(status=ERROR)
    values = np.array([1.25, -0.5, 7.0])
    at = int(values.ctypes.data)
    run.plan.staged = {("b", "u"): at, ("a", "u"): at, ("b", "w"): at + 8}
    variables = {"u": SimpleNamespace(dtype=np.dtype("f8"), size=1), "w": SimpleNamespace(dtype=np.dtype("f8"), size=2)}
    for member in run.members.values():
        member.variables = variables
    run.member.log = [f"line {i}" for i in range(7)]
    assert run.refuse() == (
        "b: failed with ERROR in the step from t = 108 ms. Last inputs: u=[1.25], w=[-0.5  7. ]. "
        "Last log: line 2 | line 3 | line 4 | line 5 | line 6"
    )
    assert log_text(run.members["a"]) == ""


@every_case(
    ("row", "offset", "names", "text"),
    [
        (0, 0, ["u (value reference 1)"], " It refused fmi2SetReal of u (value reference 1)."),
        (1, 0, ["u", "v", "w"], " It refused fmi2SetReal of u, v, w."),
        (1, 0, ["u", "v", "w", "x", "y"], " It refused fmi2SetReal of u, v, w and 2 more."),
        (1, 8, ["u"], ""),  # no row of a call
        (2, 0, ["u"], ""),  # the row of the events
        (-1, 0, ["u"], ""),
        (0, 0, [], ""),
    ],
)
def test_a_refused_access_is_named_with_its_variables(row, offset, names, text):
    run = Failing(status=ERROR)
    rows = run._tables.arrays["accesses"]
    run.plan.accesses = [[11, 21, 31 + i, 1, 0, 0, 1] for i in range(2)]
    run.plan.access_names = {(11, 21, 31 + max(0, min(row, 1))): tuple(names)}
    run.plan.functions = {11: "fmi2SetReal"}
    run.state["at"] = rows.ctypes.data + row * rows.strides[0] + offset
    assert run._refused_access() == text
    assert text in run.refuse()


def test_what_ends_a_run_besides_a_status_is_passed_on():
    lost = Failing(status=ERROR)
    lost.member.loss = "b: crashed"
    assert lost.refuse() == "b: crashed after 108 ms"
    interrupted = Failing(status=ERROR)
    interrupted.member.failure = KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt):
        interrupted._handle_failure()
    event = Failing(status=ERROR)
    event.plan.events = SimpleNamespace(failure=SimulationError("no end"))
    assert event.refuse() == "no end"
    event.plan.events.failure = None
    assert event.refuse().startswith("b: failed with ERROR")
    caused = Failing(status=ERROR)
    caused.member.failure = ValueError("why")
    with pytest.raises(SimulationError) as caught:
        caused._handle_failure()
    assert caught.value.__cause__ is caused.member.failure


@pytest.mark.parametrize(("count", "others"), [(1, "x1"), (3, "x1, x2, x3"), (4, "x1, x2, x3 and others")])
def test_connections_that_do_not_agree_are_named(count, others):
    run = Failing({"name": "iterative", "iterations": 7}, variable=True, status=UNSOLVED)
    run.disagreeing = [f"x{i + 1}" for i in range(count)]
    assert run.refuse() == (
        f"{run.algorithm}: {others} do not agree after 7 iterations in the step from t = 108 ms. "
        "Allow more `iterations`, take another `acceleration` or a smaller step."
    )


@pytest.mark.parametrize("result", [loop.DONE, loop.FAILED])
def test_a_request_for_derivatives_goes_back_to_the_begin_of_the_step(result):
    run, journal = Failing("iterative", variable=True, status=ASKING, stop=9), []
    run._variable_step.derive = lambda: journal.append("derive")
    run._record = np.zeros(1)

    def go(address):
        state = run.state
        journal.append((address == run._record.ctypes.data, int(state["must_restore"]), int(state["stop"])))
        state["status"] = ERROR
        return result

    run._loop = go
    if result == loop.FAILED:
        assert run.refuse().startswith("b: failed with ERROR")
        assert journal == [(True, 1, 2)]
    else:
        run._handle_failure()
        assert journal == [(True, 1, 2), "derive"]
        assert int(run.state["stop"]) == 9


def shortened(status=EARLY, reached=None, reason="", slow=(), **fields):
    """Whether a shorter step is accepted, and what it is."""
    run = Failing("step_doubling", variable=True, **{"status": status, "trial": 1, "control": PREDICTED} | fields)
    run.member.reached, run._slow = reached, list(slow)
    accepted = run._accept_shorter_step(run.member, reason)
    names = ("limited", "must_restore", "stride", "rejected")
    return (accepted, float(run.state["until"]), *(int(run.state[name]) for name in names))


@every_case(
    ("given", "expected"),
    [  # accepted, until, limited, must_restore, stride, rejected
        ({"until": 0.11}, (True, 0.11, 1, 1, 8, 0)),
        ({"status": DISCARD, "reached": 0.109}, (True, 0.109, 1, 1, 8, 0)),
        ({"status": DISCARD, "reached": 0.109, "reason": "over"}, (True, 0.109, 1, 1, 8, 0)),
        ({"until": 0.108}, (True, 0.108, 0, 1, 4, 1)),  # it got nowhere: half the step
        ({"until": 0.112}, (True, 0.112, 0, 1, 4, 1)),
        ({"status": DISCARD, "until": 0.11}, (True, 0.11, 0, 1, 4, 1)),  # it does not say how far
        ({"until": 0.108, "stride": 1}, (False, 0.108, 0, 0, 1, 0)),
        ({"until": 0.108, "control": FIXED}, (False, 0.108, 0, 0, 8, 0)),
        ({"until": 0.108, "reason": "over"}, (False, 0.108, 0, 0, 8, 0)),
        ({"until": 0.108, "limited": 1}, (True, 0.108, 0, 1, 4, 1)),
    ],
)
def test_a_step_is_repeated_to_where_a_member_came_or_with_half_its_length(given, expected):
    assert shortened(**given) == expected


def whole(algorithm="jacobi", status=DISCARD, reached=None, reason="", slow=(), **fields):
    run = Failing(algorithm, status=status, **fields)
    run.member.reached, run._slow, run.member.log = reached, list(slow), ["slipped"]
    return run._accept_shorter_step(run.member, reason)


def test_fixed_steps_are_made_in_whole_or_the_run_ends():
    assert not whole(reason="over", reached=0.11)
    assert not whole(reached=0.108), "it got nowhere"
    assert not whole()
    with pytest.raises(SimulationError) as caught:
        whole(reached=0.11)
    rolling = ", ".join(one.name for one in Algorithm if one.rolls_back)
    assert rolling
    assert str(caught.value) == (
        f"b: went to t = 110 ms only in the step from t = 108 ms, and {Algorithm('jacobi')} makes whole steps. "
        f"Use one that goes to that time: {rolling}. Last log: slipped"
    )
    with pytest.raises(SimulationError, match=r"110 ms only in .* 108 ms, and .* makes whole steps"):
        whole(status=EARLY, until=0.11)
    with pytest.raises(SimulationError) as caught:
        whole("step_doubling", reached=0.11, slow=["b"], trial=1)
    assert "and its period is to be made in whole. Leave `communication_step` out. Last log" in str(caught.value)


def test_the_time_that_a_member_reported_is_that_of_its_own_flags():
    run = Failing()
    run.flags[:, 3] = 0.3, 0.2
    assert run._reported_time(0.1) == 0.2
    assert run._reported_time(0.25) == 0.25, "at least the begin of its step"
    run.member.reached = 0.11
    run.state["status"] = DISCARD
    run.flags[:, 3] = 0.3, 0.109
    with pytest.raises(SimulationError):
        run._accept_shorter_step(run.member, "")
    assert run.member.asked == 0.109


@every_case(
    ("reached", "fields", "text", "last"),
    [
        (0.107, {}, "107 ms", 1),  # in the step that ended at 108 ms: its row is later
        (0.104, {}, "108 ms", None),
        (0.108, {}, "108 ms", None),
        (0.0, {}, "108 ms", None),
        (0.2, {}, "108 ms", None),
        (0.107, {"in_tick": 1}, "112 ms", None),
        (0.107, {"in_tick": 1, "off": 1, "now": 0.1095}, "109.5 ms", None),
    ],
)
def test_when_a_run_was_ended_by_a_member(reached, fields, text, last):
    run = Failing(**fields)
    run.flags[1, 3] = reached
    assert (run._end_time_text(), run._last) == (text, last)


def test_with_held_inputs_a_missed_tolerance_asks_for_order_1():
    """A mass on a spring with `predictive` at 1e-5 makes 311,309 steps with held inputs, and 4,474 with extrapolated ones."""
    run = Failing("predictive", variable=True, missed=1, order=0)
    run._note_step_problems()
    assert "not as exact as asked for. Set `order: 1`, or give a smaller one; the first" in run.notes[0]


def test_problems_of_steps_are_noted_once():
    run = Failing("step_doubling", variable=True, missed=3, missed_tick=5, unsolved=1, unsolved_tick=7, order=1)
    run.state["refused"], run.state["least"], run.state["control"] = 2, 4, PREDICTED
    for _ in range(2):
        run._note_step_problems()
    name = run.algorithm
    missed, unsolved, refused = run.notes
    assert missed == (
        f"{name}: 3 steps of the smallest size were not as exact as asked for. Give a smaller one; the first began at "
        "t = 120 ms or soon after."
    )
    assert unsolved == (
        f"{name}: 1 steps did not agree after the last iteration. Allow more, or a smaller step; the first began at "
        "t = 128 ms or soon after."
    )
    assert refused == f"{name}: b makes no steps shorter than 2 ms; no step was shorter."
    run.state["refused"], run.state["control"] = 1, DOUBLING
    run._note_step_problems()
    assert run.notes[3] == f"{name}: a makes no steps shorter than 1 ms; no step was shorter.", "halves are made too"
    fixed = Failing(missed=1, unsolved=1, refused=1)
    fixed._note_step_problems()
    assert fixed.notes == []


def finished(reached, full=False, **fields):
    """End a run at a step that a member discarded; return its message, the tick, the journal and the recorded ticks."""
    run, journal = Failing(**fields), []
    rows = np.zeros((3, 1), np.int64)
    run._record = np.zeros(1, loop.RECORD)
    run.member.reached = reached
    for name in run.state.dtype.names:
        run._record[0][name] = run.state[name]
    run.state = run._record[0]
    run.state["next_row"], run.state["row_bytes"] = rows.ctypes.data, 8
    run.state["limit"] = rows.ctypes.data + 8 * (0 if full else 3)
    run.plan.published = {("a", "y"): 100, ("b", "y"): 200, ("b", "z"): 300}
    run._tables.put = lambda *values: journal.append(values)
    run._overrides = SimpleNamespace(hold=lambda: journal.append("hold"))
    run.recorder = SimpleNamespace(make_room=lambda: journal.append("room"))
    run._finish_discarded(run.member, "over")
    assert run.finished
    return run.failure, int(run.state["tick"]), journal, rows[:, 0].tolist()


@every_case("full", [False, True])
@every_case("reached", [0.112, 0.112 + 4e-10, 0.112 - 4e-10])
def test_a_member_that_ended_the_run_at_the_end_of_its_step_has_a_row_there(reached, full):
    message, tick, journal, rows = finished(reached, full)
    assert (message, tick) == ("b ended the simulation at 112 ms: over", 3)
    assert journal == [("b", "y", 200), ("b", "z", 300), "hold", *(["room"] if full else [])]
    assert rows[0] == 3


@every_case(
    ("reached", "text"), [(0.11, "110 ms"), (None, "108 ms"), (0.108, "108 ms"), (0.12, "108 ms"), (0.1, "108 ms")]
)
def test_a_member_that_ended_the_run_within_its_step_has_no_row_there(reached, text):
    assert finished(reached) == (f"b ended the simulation at {text}: over", 2, [], [0, 0, 0])


def test_with_variable_steps_a_run_ends_within_a_step_of_a_tick():
    assert finished(0.1095, variable=True, step_begin=0.109)[:2] == ("b ended the simulation at 109.5 ms: over", 2)
    assert finished(None, variable=True, step_begin=0.109)[0] == "b ended the simulation at 109 ms: over"
    assert finished(0.112, variable=True)[1] == 2, "no row: rows are those of ticks"
