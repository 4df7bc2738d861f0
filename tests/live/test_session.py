"""The loop of a session in this process: a script gives commands where the loop listens, and reads what it says.

Over 400 lines: one session and its commands serve all tests.
"""

import copy
import json
import math
import time as wall
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.every_case import every_case
from twin.live import EXPIRED, HOLD, SIMULATED_HOLD
from twin.live.operator import commands
from twin.live.operator.dead_man_switch import DeadManSwitch
from twin.live.pacing import checked_rate
from twin.live.session import Session
from twin.live.worker import SessionProcess
from twin.scenario import FaultSpec, Node

FILE = Path(__file__).parent / "carriage.yaml"
SPEED, MASS, POSITION = "command.live_speed[1]", "servomotor.mass", "servomotor.position"


class Script:
    """A channel whose peer does one step of a script after the other, while the loop stands still."""

    def __init__(self, *steps):
        self.steps, self.sent, self.session = iter(steps), [], None

    def receive(self, _timeout):
        if self.session.left:
            return []  # it steps
        step = next(self.steps, {"ask": "stop"})
        if callable(step):
            step = step(self.session, self)
        return [step] if step else []

    def send(self, **message):
        self.sent.append(message)

    def send_droppable(self, **message):
        self.sent.append(message)
        return True

    def all(self, kind):
        """What was sent of one kind."""
        return [message[kind] for message in self.sent if kind in message]

    def answers(self):
        """Number of a command -> reason of a refusal."""
        return {message["answer"]: message.get("refused", "") for message in self.sent if "answer" in message}


def play(tmp_path, file, *steps, **job):
    """Run a session with a script; what it sent."""
    script = Script(*steps)
    job = {
        "rate": math.inf,
        "running": False,
        "scenario": file,
        "overrides": (),
        "variant": None,
        "seed": None,
        "record": (),
        "hardware": None,
        "backend": "interpreted",
        "runs": tmp_path / "runs",
        "build": tmp_path / "build",
        "report": False,
        **job,
    }
    process = SessionProcess(script, job)
    script.session = process.session
    process.run()
    return script


@pytest.mark.slow
def test_every_command_at_its_communication_point(tmp_path):
    """The sensor samples each 5 ms: that is a point common to all members. What is done is in the file, in order.

    Over 60 lines: one session, whose commands depend on each other.
    """
    times, states = [], []

    def note(session, _):
        times.append(round(session.simulated.time / 1e6))
        states.append(copy.deepcopy(session.status()))

    def hold(session, _):
        assert session.dead_man.longest == SIMULATED_HOLD
        session.dead_man.longest = 1e9  # a busy machine is no released hand
        session.dead_man.hold(SPEED, 0.02, 0.0, 1, 0.0, wall.monotonic())  # the command is refused while paused

    script = play(
        tmp_path,
        FILE,
        {"ask": "step", "count": 3, "number": 1},
        note,
        {"ask": "step", "macro": True, "number": 2},
        note,
        {"ask": "step", "macro": True, "count": 2, "number": 3},
        note,
        {"ask": "set", "name": MASS, "value": 0.9, "number": 4},
        {"ask": "override", "name": POSITION, "value": "3 mm", "number": 5},
        note,
        {"ask": "step", "number": 6},
        note,
        {"ask": "release", "name": POSITION, "number": 7},
        note,
        {"ask": "trigger", "key": "event_2", "number": 8},
        {"ask": "set", "name": SPEED, "value": 0.01, "number": 9},
        {"ask": "release", "name": POSITION, "number": 10},
        hold,
        note,
        {"ask": "step", "count": 60, "number": 11},  # the drive starts 42 ms after the hand
        note,
        {"ask": "release_hold", "name": SPEED, "number": 12},
        note,
        {"ask": "step", "count": 20, "number": 13},
        note,
        {"ask": "pace", "rate": 0.5, "number": 14},
        {"ask": "pause", "number": 15},
        note,
        {"ask": "pace", "rate": 1.1, "number": 17},  # controls: their dead-man times are those of the wall clock
        {"ask": "reset", "number": 16},
        note,
        {"ask": "stop"},
        variant="quiet",
        seed=2,
    )
    assert times == [3, 5, 15, 15, 16, 16, 16, 76, 76, 96, 96, 0]
    refusals = {number: text for number, text in script.answers().items() if text}
    assert refusals == {
        9: f"{SPEED}: moves only while held. Use its control.",
        17: "pace: 1.1 is above 1. A scenario with controls runs at most at real time.",
    }
    assert sorted(script.answers()) == list(range(1, 18))
    assert [state["overridden"] for state in states[3:6]] == [{POSITION: "3 mm"}, {POSITION: "3 mm"}, {}]
    assert [state["held"] for state in states[6:9]] == [{SPEED: 0.02}, {SPEED: 0.02}, {}]
    of_scenario = {"sensor.force": "0.1 N", "sensor.noise": "2 mN"}  # at 50 ms, and where the drive has moved for 3 ms
    assert states[7]["values"] == {MASS: 0.9, SPEED: 0.02, "command.pressed": True} | of_scenario
    assert states[8]["values"] == {MASS: 0.9, SPEED: 0.0, "command.pressed": False} | of_scenario
    assert [state["rate"] for state in states[-3:]] == [1.0, 0.5, 0.5]
    assert ({state["phase"] for state in states}, states[-1]["values"]) == ({"paused"}, {})
    done = [entry for part in script.all("done") for entry in part]
    first_run = done[: next(i for i, entry in enumerate(done) if entry["text"] == "set command.pressed = false") + 1]
    assert [entry["number"] for entry in first_run] == list(range(1, len(first_run) + 1))
    own = [(round(1e3 * entry["time"]), entry["kind"], entry["text"]) for entry in first_run if entry["by_operator"]]
    assert own == [
        (15, "set", "set servomotor.mass = 0.9 kg"),
        (15, "override", "override servomotor.position = 3 mm"),
        (16, "release", "release servomotor.position"),
        (16, "override", "override servomotor.position = 3 mm"),
        (16, "release", "release servomotor.position"),
        (16, "set", f"set {SPEED} = 20 mm/s"),
        (16, "set", "set command.pressed = true"),
        (76, "set", f"set {SPEED} = 0 mm/s"),
        (76, "set", "set command.pressed = false"),
    ]
    others = {(entry["kind"], entry["text"]) for entry in first_run if not entry["by_operator"]}
    assert others == {
        ("condition", "set sensor.noise = 2 mN (when servomotor.velocity > 1 mm/s)"),
        ("set", "set sensor.force = 0.1 N"),
    }
    one, other = dict.fromkeys(script.all("folder"))
    text = (Path(one) / "operated.yaml").read_text()
    assert text.startswith("stop_time: 0.1 s ")  # the next point common to all members
    assert text.partition("\nevents:\n")[2].splitlines() == [
        "- {when: servomotor.velocity > 1 mm/s, for: 3 ms, repeat: true, set: {sensor.noise: 2 mN}}",
        "- {at: 0.015 s, set: {servomotor.mass: 0.9}}",
        "- {at: 0.015 s, override: {servomotor.position: 3 mm}}",
        "- {at: 0.016 s, release: [servomotor.position]}",
        "- {at: 0.016 s, override: {servomotor.position: 3 mm}}",
        "- {at: 0.016 s, release: [servomotor.position]}",
        "- {at: 0.016 s, set: {'command.live_speed[1]': 0.02}}",
        "- {at: 0.016 s, set: {command.pressed: true}}",
        "- {at: 0.05 s, set: {sensor.force: 0.1 N}}",
        "- {at: 0.076 s, set: {'command.live_speed[1]': 0.0}}",
        "- {at: 0.076 s, set: {command.pressed: false}}",
    ]
    assert (script.all("epoch"), other != one) == ([1, 2], True)
    assert script.all("phase")[-1] == "finishing"


@pytest.mark.slow
def test_values_that_are_nominal_at_the_first_step_are_not_changed(tmp_path):
    """Only values that a run has used count: its comparison with published values holds after `nominal values` at 0 s."""
    (tmp_path / "beat.yaml").write_text("{stop_time: 20 ms, step: 1 ms, members: {heart: {component: heart}}}")
    steps, nominal = [], []

    def send(value):
        def act(session, _script):
            start = session.executor.catalog.signals["heart.rate"].start
            nominal.append(start)
            return {"ask": "set", "name": "heart.rate", "value": start if value is None else value, "number": 1}

        return act

    def note(session, _script):
        steps.append((session.status()["changes"], session.operator_changes() != []))

    go = {"ask": "step", "number": 2}
    play(tmp_path, tmp_path / "beat.yaml", send(1.5), note, send(None), note, go, note, send(None), note)
    assert steps == [({"heart.rate": 0.0}, True), ({}, False), ({}, False), ({"heart.rate": 0.001}, True)]
    (summary,) = tmp_path.glob("runs/*/2*/summary.json")
    assert json.loads(summary.read_text())["paper_applies"] is False  # a value was set after the first step
    play(tmp_path, tmp_path / "beat.yaml", send(1.5), send(None), lambda *_: wall.sleep(0.3), go)
    times = [json.loads(file.read_text())["wall_time"] for file in tmp_path.glob("runs/*/2*/summary.json")]
    assert 0.0 < max(times) < 0.25  # without the pause
    found = {json.loads(file.read_text())["paper_applies"] for file in tmp_path.glob("runs/*/2*/summary.json")}
    assert found == {False, True}


@pytest.mark.slow
def test_a_scenario_without_controls_pauses_at_its_end(tmp_path):
    (tmp_path / "beat.yaml").write_text("{stop_time: 20 ms, step: 1 ms, members: {heart: {component: heart}}}")
    seen = []

    def wait(phase, beyond):
        def poll(session, script):
            if session.phase == phase and session.simulated.time >= beyond:
                seen.append((session.phase, session.simulated.time / 1e6, session.status()["achieved"] > 0.0))
                return
            script.steps = iter([poll, *script.steps])
            return

        return poll

    script = play(
        tmp_path,
        tmp_path / "beat.yaml",
        wait("paused", 20_000_000),
        {"ask": "resume"},
        wait("running", 200_000_000),
        {"ask": "step", "number": 1},
        wait("paused", 201_000_000),
        running=True,
    )
    assert seen[0] == ("paused", 20.0, False)
    assert seen[1][0] == "running"
    assert seen[1][2]
    texts = ["the scenario has reached its end. Run continues beyond it.", ""]
    assert [said[2] for said in script.all("said")] == texts  # withdrawn when it goes on
    assert [said[0] for said in script.all("said")] == [1, 2]


def test_a_reset_or_a_stop_follows_a_failure():
    for asked, more in (({"ask": "reset", "number": 3}, True), ({"ask": "stop", "number": 3}, False)):
        script = Script({"ask": "resume", "number": 1}, {"ask": "hold"}, asked)
        script.session = SimpleNamespace(left=None)
        process = SessionProcess(script, {"rate": 1.0, "running": True})
        process.session.wall_clock = False
        assert process.wait_for_reset() is more
        assert script.all("phase") == ["failed", "starting" if more else "finishing"]
        assert script.answers() == {1: "the simulation has failed. Reset it.", 3: ""}
        assert not process.session.running
    script = Script({"ask": "reset", "number": 1}, {"ask": "stop"})
    script.session = SimpleNamespace(left=None)
    process = SessionProcess(script, {"rate": 1.0, "running": True})
    process.session.wall_clock = True  # drives have kept the time: they do not begin anew
    assert not process.wait_for_reset()
    assert script.answers()[1] == "the simulation has failed. Reset it."


def test_what_is_built_before_the_first_step_is_told_once():
    script = Script()
    process = SessionProcess(script, {"rate": 1.0, "running": True})
    for name in ("building a", "building a", "building b"):
        process.progress(name, 0.5)
    process.session.phase = "running"
    process.progress("c", 0.5)
    assert script.all("progress") == ["building a", "building b"]
    process.session.phase = "finishing"
    for part in (1.0, 0.5, 0.5, 0.75):
        process.progress("writing", part)
    assert script.all("progress")[2:] == ["writing", "writing, 50%", "writing, 75%"]


def test_a_stop_of_drives_is_no_orderly_end():
    """A log had the same sentence for both."""
    catalog = SimpleNamespace(judged_until=2.0, controls=())
    session = SimpleNamespace(
        _executor=SimpleNamespace(catalog=catalog), session_scenario=None, killed=False, drives=None
    )
    session.simulated = SimpleNamespace(finished=False, time=10**9)
    assert "the operator ended it before the end" in Session.early_end(session)[0]
    session.drives = "drives"
    assert "the operator stopped the drives (STOP or Ctrl-C) before the end" in Session.early_end(session)[0]


def fake_session(**attributes):
    """A session as commands see it."""
    calls = []
    session = SimpleNamespace(
        wall_clock=False,
        has_stepped=False,
        phase="running",
        rate=1.0,
        pace=SimpleNamespace(rate=1.0),
        macro=5,
        left=None,
        stepping=None,
        ending=False,
        again=False,
        running=True,
        prepared={},
        drives=None,
        simulated=SimpleNamespace(time=0),
        executor=SimpleNamespace(
            catalog=SimpleNamespace(fastest_rate=math.inf, controls=()),
            add_done=lambda _time, kind, text, *_, **__: calls.append((kind, text)),
        ),
        calls=calls,
        dead_man=DeadManSwitch(),
        confirm_hold=lambda name: calls.append("confirm_hold"),
        end_stepping=lambda: calls.append("end_stepping"),
        begin_pace=lambda: calls.append("begin_pace"),
        withdraw_message=lambda: calls.append("withdraw_message"),
        left_to_common=lambda more=0: 4 + more,
    )
    vars(session).update(attributes)
    return session


WALL_CLOCK = "the drives determine the time."


@every_case(
    ("attributes", "message", "refused"),
    [
        ({"phase": "ended"}, {"ask": "resume"}, "resume: the simulation has ended. Reset it."),
        ({"phase": "ended"}, {"ask": "step"}, "step: the simulation has ended. Reset it."),
        ({"wall_clock": True}, {"ask": "step"}, f"step: {WALL_CLOCK}"),
        ({"wall_clock": True}, {"ask": "pace", "rate": 1}, f"pace: {WALL_CLOCK}"),
        ({"wall_clock": True}, {"ask": "pause"}, ""),  # they have not started
        ({"wall_clock": True}, {"ask": "reset"}, ""),
        ({"has_stepped": True}, {"ask": "reset"}, ""),
        ({"wall_clock": True, "has_stepped": True}, {"ask": "pause"}, f"pause: {WALL_CLOCK} Stop the session instead."),
        ({"wall_clock": True, "has_stepped": True}, {"ask": "reset"}, f"reset: {WALL_CLOCK} Stop the session instead."),
        ({"wall_clock": True}, {"ask": "override", "name": "a", "value": 1}, "overrides and events are disabled"),
        ({"wall_clock": True}, {"ask": "release", "name": "a"}, "overrides and events are disabled"),
        (
            {"wall_clock": True, "prepared": {"e": 1}},
            {"ask": "trigger", "key": "e"},
            "overrides and events are disabled",
        ),
        ({}, {"ask": "trigger", "key": "e"}, "there is no event e."),
        ({}, {"ask": "trigger"}, "trigger: 'key' is missing."),
        ({}, {"ask": "step", "count": 1_000_001}, "step: 1000001 is not a number of steps. Use 1 to 1000000."),
        ({}, {"ask": "step", "count": 1_000_000}, ""),
        ({}, {"ask": "hold", "name": "a", "press": 2**63, "instant": 0}, "hold: 9223372036854775808 is not the number"),
        ({}, {"ask": "hold", "name": "a", "press": True, "instant": 0}, "hold: True is not the number of a press."),
        ({}, {"ask": "hold", "name": "a", "press": 0, "instant": "1"}, "hold: instant: expected a number of seconds."),
        ({}, {"ask": "hold", "name": "a", "press": 0, "instant": True}, "hold: instant: expected a number of seconds."),
        ({}, {"ask": 3}, "3 is not a command."),
    ],
)
def test_commands_are_refused(attributes, message, refused):
    text, later = commands.execute(fake_session(**attributes), message)
    assert text.startswith(refused)
    assert bool(text) == bool(refused)
    assert later == (message["ask"] == "step" and not refused)


def test_a_press_that_began_while_paused_moves_nothing_after_run():
    """Nor does one that was held through a pause, until it is released and pressed again."""
    session = fake_session(phase="paused")
    session.executor.check_hold = lambda name, value: (name, value, 0.0)

    def held(press):
        message = {"ask": "hold", "name": "a", "value": 0.5, "press": press, "instant": wall.monotonic()}
        assert commands.execute(session, message) == ("", False)
        return session.dead_man.inputs["a"].value

    assert held(1) == 0.0
    commands.execute(session, {"ask": "resume"})
    assert (held(1), held(2)) == (0.0, 0.5)
    commands.execute(session, {"ask": "pause"})
    assert session.dead_man.inputs["a"].value == held(2) == 0.0
    commands.execute(session, {"ask": "resume"})
    assert (held(2), held(3)) == (0.0, 0.5)


def test_what_commands_do():
    session = fake_session(phase="paused")
    assert commands.execute(session, {"ask": "resume"}) == ("", False)
    assert (session.phase, session.calls) == ("running", ["end_stepping", "withdraw_message", "begin_pace"])
    assert commands.execute(session, {"ask": "pace", "rate": 3}) == ("", False)
    assert (session.rate, session.pace.rate, session.calls[3:]) == (3.0, 3.0, ["begin_pace"])
    assert commands.execute(session, {"ask": "step", "number": 7}) == ("", True)
    assert (session.phase, session.left, session.stepping) == ("paused", 1, 7)
    commands.execute(session, {"ask": "step", "macro": True, "count": 3, "number": 8})
    assert (session.left, session.stepping) == (5 + 2 * 5, 8)
    for phase, after in (("running", "paused"), ("starting", "starting")):
        session.phase = phase
        commands.execute(session, {"ask": "pause"})
        assert session.phase == after
    commands.execute(session, {"ask": "reset"})
    assert (session.ending, session.again, session.running) == (True, True, False)
    for phase, drives, controls, expected in (
        ("running", None, (), [("stop", "End"), "withdraw_message"]),
        ("running", None, ("a.x",), [("stop", "STOP"), "withdraw_message"]),  # as on the button
        ("ended", "drives", (), [("stop", "STOP")]),  # the message says why it has ended
    ):
        session = fake_session(phase=phase, drives=drives)
        session.executor.catalog.controls = controls
        commands.execute(session, {"ask": "stop"})
        assert (session.ending, session.again, session.calls) == (True, False, expected)
    rates = {rate: checked_rate(rate) for rate in (0.1, 1, 10.0, math.inf)}
    assert rates == {0.1: 0.1, 1: 1.0, 10.0: 10.0, math.inf: math.inf}
    for rate in (0.099, 10.01, True, -math.inf, math.nan, None):
        assert "is not a rate" in commands.execute(session, {"ask": "pace", "rate": rate})[0]


def test_a_fault_by_hand_happens_after_the_communication_point():
    """A microsecond later, so that a repetition has the same order."""
    struck, written = [], []
    executor = SimpleNamespace(write=lambda *args, **more: written.append((*args, more)))
    session = SimpleNamespace(
        drives=SimpleNamespace(strike=struck.append), simulated=SimpleNamespace(time=2_000_000), executor=executor
    )
    tree = {"at": "1 ms", "fault": "delay", "node": "n", "delay": "6 ms", "duration": "20 ms"}
    Session.strike(session, FaultSpec(1_000_000, Node({key: Node(value, None) for key, value in tree.items()}, None)))
    (fault,) = struck
    assert (fault.time_ns, fault.tree.plain()["at"]) == (2_001_000, "0.002001 s")
    assert fault.tree.plain() | {"at": ""} == tree | {"at": ""}
    assert written == [(fault, "fault", fault.text, {"by_operator": True})]


@pytest.mark.slow
def test_a_hold_with_drives_is_short(tmp_path):
    """Also with simulated ones, so that a rehearsal has the times of the real session."""
    longest = []
    bench = tmp_path / "bench.yaml"
    bench.write_text(
        "{simulated: true, cycle: 5 ms, nodes: {servomotor: {node: 1, profile: faulhaber_v3, watch_contact: false}}}"
    )
    note = lambda session, _: longest.append(session.dead_man.longest)  # noqa: E731
    play(tmp_path, FILE, note, hardware=bench, arm=False, variant="quiet", seed=2, backend="fmu")
    assert longest == [HOLD]


@pytest.mark.parametrize(
    ("pause", "cause"), [(0.0, "nothing came from the page for 620 ms"), (9.0, "this computer was busy for 9000 ms")]
)
def test_a_hold_that_expires_is_an_executed_command(monkeypatch, pause, cause):
    """Before the input goes to its rest value, so that the list says why; the message says which of two causes it was."""
    done, said = [], []
    monkeypatch.setattr(wall, "monotonic", lambda: 100.0)
    dead_man = SimpleNamespace(
        deadline=99.52,
        longest=0.14,
        expire=lambda now: ["a.x"],
        inputs={"a.x": SimpleNamespace(value=0.0, moves=False)},
    )
    executor = SimpleNamespace(
        controls={}, add_done=lambda time, kind, text, *_, **__: done.append((time, kind, text)), start=lambda name: 0.0
    )
    executor.apply = lambda event, **_: done.append((event.time_ns, event.kind, event.variable))
    session = SimpleNamespace(
        _executor=executor,
        dead_man=dead_man,
        expired_holds=set(),
        say=said.append,
        simulated=SimpleNamespace(time=5_000),
        along={},
        given={"a.x": 1.0},
        _last_update=wall.monotonic() - pause,
    )
    Session.update_held_inputs(session)
    assert done == [(5_000, EXPIRED, f"a.x: {cause}"), (5_000, "set", "a.x")]
    (text,) = said
    assert text.startswith(f"a.x: at rest, not renewed for 140 ms: {cause}")
    assert text.endswith(". Release and press again.")
