"""Where blocks of a session end, and which runs follow another."""

import json
from types import SimpleNamespace

import pytest

from tests.every_case import every_case
from tests.live.test_session import play
from twin.live.session import Session
from twin.live.worker import SessionProcess


def blocks_of(**attributes):
    """A session at 2 us of steps of 1 us, of which a block has 10."""
    log = []
    simulated = SimpleNamespace(time=2_000, finished=False, failure="it is empty.")
    simulated.advance = lambda until: setattr(simulated, "time", until)
    executor = SimpleNamespace(
        file=SimpleNamespace(commit=lambda time: None), write=lambda fault, *args, **more: log.append(fault)
    )
    session = SimpleNamespace(
        simulated=simulated,
        _executor=executor,
        pace=SimpleNamespace(count=lambda: 10, rate=1.0, record_block=lambda *args: None),
        priority=SimpleNamespace(update=lambda *args: None),
        case=SimpleNamespace(step_ns=1_000, start_ns=0, events=()),
        drives=None,
        wall_clock=False,
        phase="running",
        left=None,
        pause_ns=None,
        _next=0,
        _faults=[],
        left_to_common=lambda more=0: more,
        say=log.append,
        end_stepping=lambda: log.append("end of steps"),
        apply_events=lambda: None,
    )
    vars(session).update(attributes)
    return session, log


END = "the scenario has reached its end. Run continues beyond it."


@every_case(
    ("attributes", "time", "phase", "log"),
    [
        ({}, 12_000, "running", []),
        ({"phase": "paused", "left": 3}, 5_000, "paused", ["end of steps"]),
        ({"phase": "paused", "left": 30}, 12_000, "paused", []),
        ({"pause_ns": 6_000}, 6_000, "paused", [END]),
        ({"pause_ns": 12_000}, 12_000, "paused", [END]),
        ({"pause_ns": 13_000}, 12_000, "running", []),
        ({"pause_ns": 2_000}, 12_000, "running", []),  # it goes on beyond the end
        ({"pause_ns": 4_000, "phase": "paused", "left": 3}, 4_000, "paused", []),
    ],
)
def test_blocks_end_where_a_session_pauses(attributes, time, phase, log):
    session, made = blocks_of(**attributes)
    Session.block(session)
    assert (session.simulated.time, session.phase, made) == (time, phase, log)
    if session.left is not None:
        assert session.left == attributes["left"] - (time - 2_000) // 1_000


def test_a_block_ends_at_the_next_event_and_has_the_faults_before_its_end():
    events = [SimpleNamespace(time_ns=7_000), SimpleNamespace(time_ns=9_000)]
    faults = [SimpleNamespace(time_ns=time, text="") for time in (6_999, 7_000)]
    session, log = blocks_of(_faults=faults.copy())
    session.case.events = events
    Session.block(session)
    assert (session.simulated.time, log, session._faults) == (7_000, faults[:1], faults[1:])
    session._next = 1
    Session.block(session)
    assert (session.simulated.time, log) == (9_000, faults)


def test_a_member_that_ends_the_simulation_ends_the_steps():
    session, log = blocks_of(phase="paused", left=20)
    session.simulated.finished = True
    Session.block(session)
    assert (session.phase, log) == ("ended", ["it is empty.", "end of steps"])


@every_case(
    ("status", "gone", "again", "wait", "runs"),
    [
        ("completed", False, False, True, 1),
        ("completed", False, True, False, 2),
        ("failed", False, False, False, 1),
        ("failed", False, False, True, 2),
        ("failed", True, True, True, 1),
    ],
)
def test_a_session_is_repeated_after_a_reset(monkeypatch, status, gone, again, wait, runs):
    """`wait`: a reset follows a failure. The second run is completed without a reset."""
    job = {"rate": 1.0, "running": True, "backend": "interpreted", "runs": "", "build": "", "report": False}
    process = SessionProcess(SimpleNamespace(send=lambda **message: None), job)
    made = []

    def run_scenario(*args, **more):
        made.append(args)
        assert len(made) <= 2, "repeated without a reset"
        process.session.gone, process.session.again = gone, again and len(made) == 1
        run = SimpleNamespace(status=status if len(made) == 1 else "completed", reason="it failed")
        return SimpleNamespace(run=run)

    monkeypatch.setattr("twin.live.worker.run_scenario", run_scenario)
    monkeypatch.setattr(process, "prepare", lambda: None)
    monkeypatch.setattr(process, "wait_for_reset", lambda: wait)
    process.run()
    assert len(made) == runs


CONTROL = ", console: [{input: sensor.force, range: [0 N, 1 N]}]"
EARLY = "ended early, at 0.005 s: the operator ended it before the end of"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("console", "steps", "reason", "complete"),
    [
        ("", 3, f"{EARLY} the scenario, 0.02 s.", False),
        ("", 20, "", True),
        (CONTROL, 3, f"{EARLY} what is required, 0.01 s.", True),
        (CONTROL, 12, "", True),
    ],
)
def test_a_session_that_ends_early_is_no_complete_run(tmp_path, console, steps, reason, complete):
    """With controls it has no end of its own: then it is early for requirements whose window is not over."""
    members = "{heart: {component: heart}, sensor: {component: force_sensor}}"
    expect = "[{name: small, signal: heart.position, within: [-1 m, 1 m], to: 10 ms}]"
    text = f"{{stop_time: 20 ms, step: 1 ms, members: {members}, expect: {expect}{console}}}"
    (tmp_path / "beat.yaml").write_text(text)
    play(tmp_path, tmp_path / "beat.yaml", {"ask": "step", "count": steps, "number": 1})
    (file,) = (tmp_path / "runs/beat").glob("2*/summary.json")
    summary = json.loads(file.read_text())
    (case,) = summary["cases"]
    assert (summary["status"], summary["passed"]) == (("interrupted", False) if reason else ("completed", True))
    assert (summary["reason"].partition(": ")[2], case["complete"]) == (reason, complete)
    assert [each["verdict"] for each in summary["expectations"]] == ["skipped" if reason else "pass"]
