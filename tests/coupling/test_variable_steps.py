"""Steps between two communication points, interpreted: which are tried, from when, how long; what follows their outcome."""

import numpy as np
import pytest

from tests.coupling.test_step_functions import state
from twin.coupling.execution.loop import DONE, FAILED, FINISHED, FULL, NOTICED, TRIGGERED
from twin.coupling.variable_step import stepping
from twin.coupling.variable_step.record_layout import (
    COMPARED,
    DOUBLING,
    EARLY,
    FIXED,
    PREDICTED,
    RESIDUAL,
    UNSOLVED,
)

OK, WARNING, DISCARD, ERROR = range(4)
ADDRESS = 4711


class Script:
    """Ticks of 1 s in four divisions; the journal has what a step function called; `answers`: by call, one after another.

    An answer is a status, or a status and fields of the record that the call changes.
    """

    def __init__(self, monkeypatch, module, names, answers=(), **fields):
        own = {"step_ns": 1, "per_second": 1, "tick_length": 1.0, "divisions": 4, "stride": 4, "least": 1}
        self.state = state(**own | {"has_scales": 1, "due": np.inf} | fields)
        self.journal, self.answers = [], {name: list(given) for name, given in dict(answers).items()}
        for name in names.split():
            monkeypatch.setattr(module, name, lambda own, *values, name=name: self.called(name, own, values))

    def called(self, name, own, values):
        assert own is self.state
        self.journal.append((name, *values))
        given = self.answers.get(name) or [0]
        answer = given.pop(0)
        status, changes = answer if isinstance(answer, tuple) else (answer, {})
        vars(own).update(changes)
        return status

    def take(self, *names):
        return tuple(getattr(self.state, name) for name in names)


def tick(monkeypatch, answers=(), **fields):
    """Advance to a tick with scripted steps."""
    names = "attempt step_twice judge save_state restore_state notify_events learn_scales update_scales notify_logs"
    script = Script(monkeypatch, stepping, names, answers, **fields)
    script.result = stepping.advance_to_tick(script.state)
    script.steps = [entry[1:3] for entry in script.journal if entry[0] in ("attempt", "step_twice")]
    return script


@pytest.mark.parametrize(
    ("fields", "steps"),
    [
        ({}, [(0.0, 1.0)]),
        ({"tick": 3}, [(3.0, 1.0)]),
        ({"stride": 2}, [(0.0, 0.5), (0.5, 0.5)]),
        ({"stride": 1, "position": 2}, [(0.5, 0.25), (0.75, 0.25)]),
        ({"position": 1}, [(0.25, 0.25), (0.5, 0.5)]),  # steps begin at multiples of their length
        ({"position": 3}, [(0.75, 0.25)]),
        ({"position": 2, "off": 1, "now": 0.6}, [(0.6, 0.4)]),  # from between two divisions to the next one
        ({"position": 2, "off": 1, "now": 0.6, "stride": 1}, [(0.6, 0.75 - 0.6), (0.75, 0.25)]),
        ({"position": 4}, []),
        ({"finished": 1}, []),
    ],
)
def test_a_tick_is_reached_in_steps_that_fit_into_it(fields, steps, monkeypatch):
    script = tick(monkeypatch, **fields)
    assert (script.result, script.steps) == (0, steps)
    if steps:
        assert script.take("position", "off", "accepted", "rejected") == (4, 0, len(steps), 0)
        assert script.take("step_begin", "span") == steps[-1]


def test_what_is_done_for_a_step_depends_on_whether_it_can_be_rolled_back(monkeypatch):
    assert tick(monkeypatch).journal == [("attempt", 0.0, 1.0, 0), ("notify_logs", 2, 0)]
    assert tick(monkeypatch, trial=1).journal == [
        ("save_state", 0),
        ("attempt", 0.0, 1.0, 0),
        ("notify_logs", 2, 0),
    ]
    assert tick(monkeypatch, trial=1, has_scales=0, max_iterations=1, stride=4).journal == [
        ("learn_scales", 0.0),
        ("save_state", 0),
        ("attempt", 0.0, 1.0, 0),
        ("update_scales",),
        ("notify_logs", 2, 0),
    ]
    assert tick(monkeypatch, has_scales=0).journal[0][0] == "attempt"
    twice = tick(monkeypatch, {"judge": [1, 1]}, trial=1, control=DOUBLING, stride=2, least=2)
    assert twice.journal[:4] == [
        ("save_state", 0),
        ("step_twice", 0.0, 0.5, True),
        ("judge", 2),
        ("update_scales",),
    ]
    assert tick(monkeypatch, {"judge": [1]}, control=DOUBLING, least=2).steps == [(0.0, 1.0)]
    assert ("step_twice", 0.0, 1.0, False) in tick(monkeypatch, {"judge": [1]}, control=DOUBLING).journal


@pytest.mark.parametrize("name", ["learn_scales", "save_state"])
@pytest.mark.parametrize(("status", "steps"), [(WARNING, 1), (DISCARD, 0)])
def test_a_member_that_cannot_be_saved_ends_the_run(name, status, steps, monkeypatch):
    script = tick(monkeypatch, {name: [(status, {"status": status})]}, trial=1, has_scales=0)
    assert (script.result, len(script.steps)) == (0 if steps else status, steps)


@pytest.mark.parametrize(
    ("due", "events", "steps"),
    [
        (0.3, ADDRESS, [(0.0, 0.3), (0.3, 0.2), (0.5, 0.5)]),
        (0.5, ADDRESS, [(0.0, 0.5), (0.5, 0.5)]),
        (0.3, 0, [(0.0, 1.0)]),
        (1.0, ADDRESS, [(0.0, 1.0)]),
        (1.0 - 1e-13, ADDRESS, [(0.0, 1.0)]),  # at its end, but for rounding
        (0.0, ADDRESS, [(0.0, 1.0)]),
        (7.0, ADDRESS, [(0.0, 1.0)]),
    ],
)
def test_no_step_crosses_an_event(due, events, steps, monkeypatch):
    later = (0, {"due": np.inf})
    script = tick(monkeypatch, {"notify_events": [later]}, due=due, events=events)
    assert (script.result, script.steps) == (0, steps)
    calls = [entry[0] for entry in script.journal].count("notify_events")
    assert calls == (len(steps) - 1 if events else 0), "events are processed after each step within the tick"


def test_a_step_that_was_limited_already_is_not_limited_by_an_event_too(monkeypatch):
    script = tick(monkeypatch, events=ADDRESS, due=0.2, limited=1, until=0.7, stride=4, finished=0, trial=1)
    assert script.steps[0] == (0.0, 0.7)
    assert script.take("limited", "position") == (0, 4)


@pytest.mark.parametrize(("status", "result"), [(WARNING, 0), (ERROR, ERROR)])
def test_events_that_fail_end_the_run(status, result, monkeypatch):
    given = [(status, {"status": status, "due": np.inf})]
    assert tick(monkeypatch, {"notify_events": given}, events=ADDRESS, due=0.3).result == result


@pytest.mark.parametrize(
    ("trial", "until", "result", "steps"),
    [
        (1, 0.6, 0, [(0.0, 1.0), (0.0, 0.6), (0.6, 0.4)]),
        (0, 0.6, EARLY, [(0.0, 1.0)]),
        (1, 0.0, EARLY, [(0.0, 1.0)]),
    ],
)
def test_all_step_to_the_time_of_a_member_that_returned_early(trial, until, result, steps, monkeypatch):
    script = tick(monkeypatch, {"attempt": [(EARLY, {"until": until}), 0, 0]}, trial=trial)
    assert (script.result, script.steps) == (result, steps)
    assert [entry[0] for entry in script.journal].count("restore_state") == len(steps) // 2


@pytest.mark.parametrize(
    ("status", "fields", "result", "lengths", "expected"),
    [  # expected: stride, rejected, least, refused
        (ERROR, {}, 0, [1.0, 0.5, 0.5], (2, 1, 1, 0)),
        (ERROR, {"least": 4}, ERROR, [1.0], (4, 0, 4, 0)),
        (ERROR, {"control": FIXED}, ERROR, [1.0], (4, 0, 1, 0)),
        (ERROR, {"trial": 0}, ERROR, [1.0], (4, 0, 1, 0)),
        (DISCARD, {}, DISCARD, [1.0], (4, 0, 1, 0)),
        (WARNING, {}, 0, [1.0], (4, 0, 1, 0)),
        # a member that has made longer steps refuses shorter ones
        (ERROR, {"stride": 1, "passed": 2, "member": 3}, 0, [0.25, 0.5, 0.5], (2, 1, 2, 4)),
        (ERROR, {"stride": 2, "passed": 2, "least": 2, "member": 3}, ERROR, [0.5], (2, 0, 2, 0)),
        (UNSOLVED, {}, 0, [1.0, 0.5, 0.5], (2, 1, 1, 0)),
    ],
)
def test_a_step_that_failed_may_be_shortened(status, fields, result, lengths, expected, monkeypatch):
    own = {"control": PREDICTED, "trial": 1, "limited": 0} | fields
    script = tick(monkeypatch, {"attempt": [status, 0, 0], "judge": [1, 1, 1]}, **own)
    assert (script.result, [h for _, h in script.steps]) == (result, lengths)
    assert script.take("stride", "rejected", "least", "refused") == expected


@pytest.mark.parametrize(
    ("fields", "counted"),
    [({"control": FIXED}, 1), ({"control": PREDICTED, "least": 4}, 1), ({"control": PREDICTED}, 0)],
)
def test_a_step_without_convergence_is_kept_if_it_cannot_be_shorter(fields, counted, monkeypatch):
    answers = {"attempt": [UNSOLVED, 0, 0], "judge": [1, 1, 1]}
    script = tick(monkeypatch, answers, tick=5, trial=1, **fields)
    assert (script.result, len(script.steps)) == (0, 1 if counted else 3)
    assert script.take("unsolved", "unsolved_tick") == (counted, 5 * counted)
    again = tick(monkeypatch, answers | {"attempt": [UNSOLVED]}, tick=7, unsolved=2, unsolved_tick=3, trial=1, **fields)
    assert again.take("unsolved", "unsolved_tick") == (2 + counted, 3), "the first one is kept"
    strict = tick(monkeypatch, answers | {"attempt": [UNSOLVED, 0, 0]}, trial=1, strict=1, **fields)
    assert (strict.result, strict.state.status) == ((UNSOLVED, UNSOLVED) if counted else (0, 0))


@pytest.mark.parametrize("control", [PREDICTED, RESIDUAL, DOUBLING])
def test_a_step_that_is_not_accurate_enough_is_repeated_with_half_its_length(control, monkeypatch):
    script = tick(monkeypatch, {"judge": [0, 1, 1]}, control=control, trial=1, limited=0)
    assert [h for _, h in script.steps] == [1.0, 0.5, 0.5]
    assert script.take("accepted", "rejected", "position") == (2, 1, 4)
    assert script.journal.count(("restore_state", 0)) == 1


@pytest.mark.parametrize(
    ("answers", "fields"),
    [
        ({"attempt": [(EARLY, {"until": 0.5})]}, {}),
        ({"attempt": [UNSOLVED]}, {}),
        ({"attempt": [ERROR]}, {}),
        ({"attempt": [ERROR]}, {"stride": 1, "passed": 2}),
        ({"judge": [0]}, {}),
    ],
)
def test_a_rollback_that_fails_ends_the_run(answers, fields, monkeypatch):
    own = {"control": PREDICTED, "trial": 1} | fields
    failing = {"restore_state": [(DISCARD, {"status": DISCARD})]}
    script = tick(monkeypatch, answers | failing, **own)
    assert (script.result, len(script.steps)) == (DISCARD, 1)
    warned = {"restore_state": [(WARNING, {"status": WARNING})], "judge": [*answers.get("judge", []), 1, 1, 1, 1]}
    assert tick(monkeypatch, answers | warned, **own).result == 0


def test_a_trial_step_of_the_longest_length_gives_the_sizes_of_values(monkeypatch):
    def learn(answers):
        names = "attempt update_scales save_state restore_state"
        script = Script(monkeypatch, stepping, names, answers, has_scales=0, sweeps=8, status=ERROR)
        return stepping.learn_scales(script.state, 3.0), [entry[0] for entry in script.journal], script

    result, calls, script = learn({})
    assert (result, calls) == (0, ["save_state", "attempt", "update_scales", "restore_state"])
    assert script.journal[1] == ("attempt", 3.0, 1.0, 0)
    assert script.take("has_scales", "sweeps") == (1, 0)
    assert ("save_state", 0) in script.journal
    assert ("restore_state", 0) in script.journal
    assert learn({"save_state": [DISCARD]})[:2] == (ERROR, ["save_state"])
    assert learn({"attempt": [WARNING]})[1][2] == "update_scales"
    assert learn({"attempt": [DISCARD]})[1] == ["save_state", "attempt", "restore_state"]
    assert learn({"restore_state": [DISCARD]})[0] == DISCARD


def twice(monkeypatch, answers, is_least=False, status=ERROR):
    vectors = np.arange(10.0).reshape(5, 2)
    fields = {"vectors": vectors.ctypes.data, "elements": 2, "status": status}
    script = Script(monkeypatch, stepping, "attempt restore_state", answers, **fields)
    script.result, script.vectors = stepping.step_twice(script.state, 3.0, 0.5, is_least), vectors
    return script


def test_one_step_is_compared_with_two_halves_which_are_kept(monkeypatch):
    script = twice(monkeypatch, {})
    assert script.journal == [
        ("attempt", 3.0, 0.5, 1),
        ("restore_state", 0),
        ("attempt", 3.0, 0.25, 1),
        ("attempt", 3.25, 0.25, 1),
    ]
    assert script.vectors[COMPARED].tolist() == script.vectors[0].tolist() == [0.0, 1.0]
    assert script.result == 0


@pytest.mark.parametrize(
    ("answers", "is_least", "result", "steps"),
    [
        ({"attempt": [WARNING, WARNING, WARNING]}, False, 0, 3),
        ({"attempt": [DISCARD]}, False, DISCARD, 1),
        ({"attempt": [0, ERROR]}, True, ERROR, 2),
        ({"attempt": [UNSOLVED]}, False, UNSOLVED, 1),
        ({"attempt": [UNSOLVED]}, True, UNSOLVED, 3),
        ({"attempt": [0, 0, UNSOLVED]}, True, UNSOLVED, 3),
        ({"restore_state": [WARNING]}, False, 0, 3),
        ({"restore_state": [DISCARD]}, False, ERROR, 1),
    ],
)
def test_one_of_the_three_steps_may_fail(answers, is_least, result, steps, monkeypatch):
    script = twice(monkeypatch, answers, is_least)
    assert script.result == result
    assert [entry[0] for entry in script.journal].count("attempt") == steps


def through(monkeypatch, answers=(), **fields):
    """Run two ticks in which everything is scripted."""
    names = "periodic advance_to_tick notify_events record check restore_state"
    own = {"stop": 2, "limit": 100, "every": 1, "position": 4, "begins": 1, "ends": 2} | fields
    script = Script(monkeypatch, stepping, names, answers, **own)
    done = [(0, {"position": 4}), (0, {"position": 4})]
    script.answers.setdefault("advance_to_tick", done)
    script.result = stepping.run(script.state)
    script.calls = [entry[0] for entry in script.journal]
    return script


TICK = ["periodic", "advance_to_tick", "periodic", "record"]


def test_a_tick_has_periodic_members_at_its_begin_and_at_its_end(monkeypatch):
    script = through(monkeypatch, begin_count=3, end_count=5, outputs_current=1)
    assert (script.result, script.calls) == (DONE, TICK * 2)
    assert [entry for entry in script.journal[:4] if entry[0] == "periodic"] == [
        ("periodic", 1, 3, 0),
        ("periodic", 2, 5, 1),
    ]
    assert script.take("tick", "in_tick", "off", "outputs_current") == (2, 0, 0, 0)


@pytest.mark.parametrize(("end_count", "kept"), [(0, 1), (1, 0)])
def test_outputs_are_read_again_after_members_with_a_period_have_published(end_count, kept, monkeypatch):
    reached = (0, {"position": 4, "outputs_current": 1})
    script = through(monkeypatch, {"advance_to_tick": [reached]}, stop=1, end_count=end_count)
    assert script.state.outputs_current == kept


@pytest.mark.parametrize(
    ("answers", "fields", "result", "calls"),
    [
        ({}, {"next_row": 100}, FULL, []),
        ({}, {"next_row": 99, "stop": 1}, DONE, TICK),
        ({}, {"stop": 0}, DONE, []),
        ({}, {"every": 2}, DONE, [*TICK[:3], *TICK]),
        ({"periodic": [DISCARD]}, {}, FAILED, TICK[:1]),
        ({"periodic": [WARNING] * 4}, {}, DONE, TICK * 2),
        ({"periodic": [0, DISCARD]}, {}, FAILED, TICK[:3]),
        ({"advance_to_tick": [DISCARD]}, {}, FAILED, TICK[:2]),
        ({"advance_to_tick": [(WARNING, {"position": 4})]}, {"stop": 1}, DONE, TICK),
        ({"advance_to_tick": [(0, {"position": 3})]}, {}, FINISHED, TICK[:2]),
        ({}, {"events": ADDRESS, "stop": 1}, DONE, [*TICK[:3], "notify_events", "record"]),
        ({"notify_events": [DISCARD]}, {"events": ADDRESS}, FAILED, [*TICK[:3], "notify_events"]),
        ({"notify_events": [WARNING]}, {"events": ADDRESS, "stop": 1}, DONE, [*TICK[:3], "notify_events", "record"]),
        ({}, {"finished": 1}, FINISHED, TICK),
        ({}, {"in_tick": 1, "stop": 1}, DONE, TICK[1:]),  # goes on within a tick
        ({}, {"must_restore": 1, "stop": 1}, DONE, ["restore_state", *TICK]),
        ({"restore_state": [WARNING]}, {"must_restore": 1, "stop": 1}, DONE, ["restore_state", *TICK]),
        ({"restore_state": [DISCARD]}, {"must_restore": 1}, FAILED, ["restore_state"]),
        ({"check": [TRIGGERED]}, {"condition_count": 1}, TRIGGERED, [*TICK, "check"]),
        ({"check": [NOTICED]}, {"limit_count": 1}, NOTICED, [*TICK, "check"]),
        ({}, {"limit_count": 1, "stop": 1}, DONE, [*TICK, "check"]),
    ],
)
def test_how_a_run_goes_on_or_ends(answers, fields, result, calls, monkeypatch):
    script = through(monkeypatch, answers, **fields)
    assert (script.result, script.calls) == (result, calls)
    assert script.state.must_restore == 0
    if result == DONE:
        assert script.state.in_tick == 0
    if "check" in calls:
        assert script.journal[-1] == ("check", 1), "the communication point that was reached"


def test_a_member_with_a_period_may_end_the_run(monkeypatch):
    """Member 4 says so at the begin of the tick; the tick is completed."""
    script = through(monkeypatch, {"periodic": [(0, {"ending": 5})]}, ending=9)
    assert (script.result, script.calls) == (FINISHED, TICK)
    assert script.take("member", "finished", "over", "tick") == (4, 1, 5, 1)
    assert through(monkeypatch, ending=9).result == DONE, "what ended before is over"
