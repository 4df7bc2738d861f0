"""A session from outside: a person operates it, and what was done runs again to the bit.

Over 400 lines: one scenario and its sessions serve all of them.
"""

import itertools
import json
import os
import signal
import subprocess
import sys
import time
from math import inf, nan
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from twin.errors import TwinError
from twin.live import SIMULATED_HOLD, LiveSession, RefusedError
from twin.run import RunOptions, recover, run_scenario
from twin.scenario import load_scenario

FILE = Path(__file__).parent / "carriage.yaml"
SPEED, MASS, POSITION = "command.live_speed[1]", "servomotor.mass", "servomotor.position"


def until(condition, what, seconds=20.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, f"{what} did not come"
        time.sleep(0.005)


def table(folder):
    return {name: column.to_numpy() for name, column in zip(*columns(folder), strict=True)}


def columns(folder):
    found = pq.read_table(folder / "signals.parquet").drop_columns(["variant"])
    return found.column_names, found.columns


def same_bits(folder, build, root, hardware=None):
    """operated.yaml run as any scenario: no fewer rows, each of them the same; the rows of the session."""
    scenario = load_scenario(folder / "operated.yaml")
    again = run_scenario(scenario, RunOptions(root=root, build=build, report=False), hardware=hardware)
    first, second = table(folder), table(again.folder)
    assert first.keys() == second.keys()
    count = len(first["time"])
    assert count <= len(second["time"])
    for name, values in first.items():
        assert values.tobytes() == second[name][:count].tobytes(), name
    return first


@pytest.fixture(scope="module")
def start(build, tmp_path_factory):
    """Starts sessions, and ends those that are left."""
    begun = []

    def begin(file=FILE, **options):
        options = {"variant": "quiet", "seed": 2, "build": build, "runs": tmp_path_factory.mktemp("runs"), **options}
        begun.append(LiveSession.start(file, **options))
        return begun[-1]

    yield begin
    for one in begun:
        one.close()


@pytest.fixture(scope="module")
def live(start):
    return start()


REFUSED = {
    "an unknown name": (
        lambda live: live.set("command.nothing", 1.0),
        "'command.nothing': command has no variable 'nothing'. Known:",
    ),
    "no name": (lambda live: live.set(["a"], 1.0), "['a'] is not a name. Use member.variable."),
    "no number": (lambda live: live.set(MASS, nan), "servomotor.mass: nan is not a value. Use a finite number,"),
    "an infinite one": (lambda live: live.set(MASS, -inf), "servomotor.mass: -inf is not a value."),
    "nothing": (lambda live: live.set(MASS, None), "servomotor.mass: None is not a value."),
    "too much": (lambda live: live.set(MASS, [[[[1.0]]]]), "servomotor.mass: [1.0] is not a value."),
    "another type": (lambda live: live.set(MASS, "heavy"), "servomotor.mass: `heavy` is not a quantity."),
    "another unit": (lambda live: live.set(MASS, "3 mm"), "servomotor.mass: `3 mm` does not convert to kg."),
    "out of bounds": (lambda live: live.set(MASS, -1.0), "servomotor.mass: -1 kg is below the minimum."),
    "not tunable": (lambda live: live.set("command.rows", 3), "command.rows is fixed."),
    "an output": (lambda live: live.set(POSITION, 3e-3), "servomotor.position is output, not a parameter or input."),
    "what is connected": (
        lambda live: live.set("servomotor.target_velocity", 1.0),
        "servomotor.target_velocity is connected",
    ),
    "what is held": (lambda live: live.set(SPEED, 0.01), "command.live_speed[1]: moves only while held."),
    "an unknown event": (lambda live: live.trigger("event_9"), "there is no event event_9."),
    "a release of nothing": (lambda live: live.release(POSITION), "servomotor.position: is not overridden"),
    "part of an override": (
        lambda live: live.override("command.live_turn[1]", 1.0),
        "command.live_turn[1]: an element of an input",
    ),
    "a rate": (lambda live: live.pace(20.0), "pace: 20.0 is not a rate. Use 0.1 to 10, or inf"),
    "a rate that is none": (lambda live: live.pace(nan), "pace: nan is not a rate."),
    "no steps": (lambda live: live.step(0), "step: 0 is not a number of steps."),
    "what was not recorded": (lambda live: live.read([MASS]), "servomotor.mass: is not recorded."),
    "an element too far": (
        lambda live: live.read(["command.live_turn[3]"]),
        "command.live_turn[3]: there is no such element.",
    ),
    "another question": (lambda live: live._request("exec"), "exec is not a command."),
}


@pytest.mark.parametrize("what", REFUSED)
def test_is_refused_in_one_line(live, what):
    ask, told = REFUSED[what]
    with pytest.raises(RefusedError) as caught:
        ask(live)
    assert str(caught.value).startswith(told)
    assert len(caught.value.problems) == 1


HOLDS = {
    "beyond its range": ((SPEED, 0.021, 1), "is outside its range, -20 to 20 mm/s"),
    "no number": ((SPEED, nan, 1), "nan is not a value."),
    "another type": ((SPEED, True, 1), "expected a number in m/s, not True."),
    "text": ((SPEED, "5 mm/s", 1), "expected a number in m/s, not 5 mm/s."),
    "no press": ((SPEED, 0.01, -1), "hold: -1 is not the number of a press."),
    "no age": ((SPEED, 0.01, 1, nan), "hold: instant: expected a number of seconds."),
    "an output": ((POSITION, 0.01, 1), "servomotor.position: is not a free input."),
    "what is connected": (("servomotor.target_velocity", 0.01, 1), "servomotor.target_velocity: is not a free input."),
    "a number for a bit": (("command.pressed", 1.0, 1), "command.pressed: expected true or false, not 1.0."),
}


@pytest.mark.parametrize("what", HOLDS)
def test_a_hold_is_refused(live, what):
    arguments, told = HOLDS[what]
    before = len(live.state.messages) and live.state.messages[-1][0]
    live.hold(*arguments)
    until(lambda: live.state.messages and live.state.messages[-1][0] > before, "a message")
    assert told in live.state.message
    assert live.state.held == {}


HOSTILE = (
    {"ask": None},
    {"ask": ["set"]},
    {"ask": "__class__"},
    {"ask": "set"},
    {"ask": "set", "name": MASS},
    {"ask": "set", "name": {"a": 1}, "value": 1},
    {"ask": "set", "name": "x" * 100_000, "value": 1},
    {"ask": "set", "name": MASS, "value": "9" * 100_000},
    {"ask": "set", "name": MASS, "value": {"a": 1}},
    {"ask": "set", "name": MASS, "value": 10**400},
    {"ask": "set", "name": "command.live_turn", "value": [0.0] * 20_000},
    {"ask": "set", "name": "command.live_turn[-1]", "value": 1.0},
    {"ask": "hold", "name": SPEED, "value": 0.01, "press": 1e300, "instant": 0.0},
    {"ask": "hold", "name": SPEED, "value": 0.01, "press": 2**70, "instant": 0.0},
    {"ask": "hold", "name": SPEED, "value": 0.01, "press": 1},
    {"ask": "hold", "name": None, "value": 0.01, "press": 1, "instant": 0.0},
    {"ask": "step", "count": 10**9},
    {"ask": "step", "count": True},
    {"ask": "pace", "rate": "fast"},
    {"ask": "pace"},
    {"ask": "trigger", "key": ["event_1"]},
    {"ask": "release", "name": POSITION},
)


@pytest.mark.parametrize("message", HOSTILE, ids=lambda one: str(one)[:60])
def test_whatever_comes_ends_in_a_sentence(live, message):
    before = len(live.done)
    more = {key: one for key, one in message.items() if key != "ask"}
    with pytest.raises(RefusedError) as caught:
        live._request(message["ask"], **more)
    assert len(str(caught.value)) < 400
    assert (live.state.phase, live.state.held, len(live.done)) == ("paused", {}, before)


def test_catalog(live):
    catalog = live.catalog
    assert (catalog.variant, catalog.seed, catalog.step, catalog.every) == ("quiet", 2, 1e-3, 1e-3)
    assert catalog.members == {"command": "OperatorCommand", "servomotor": "Servomotor", "sensor": "ForceSensor"}
    mass, speed = catalog.signals[MASS], catalog.signals["command.live_speed"]
    assert (mass.kind, mass.settable, mass.held, mass.unit) == ("parameter", True, False, "kg")
    assert (speed.shape, speed.settable, speed.held, speed.recorded) == ((2,), False, True, True)
    assert (speed.display_unit, speed.factor, speed.start) == ("mm/s", 1000.0, [0.0, 0.0])
    (control,) = catalog.controls
    assert (control.low, control.high, control.rest, control.keys) == (-0.02, 0.02, 0.0, ("ArrowUp", "ArrowDown"))
    assert [control.value(one) for one in (-2.0, -0.55, 0.1, 1.0)] == pytest.approx([-0.02, -0.01, 0.0, 0.02])
    assert [(one.own, one.at, one.text) for one in catalog.events] == [
        (True, 0.05, "sensor.force set to 0.1 N"),
        (False, None, "servomotor.position overridden by 3 mm"),
    ]
    assert catalog.plots == (("Position", "mm", (POSITION,)),)
    assert catalog.bands == {"Position": (0.0, pytest.approx(1e-3))}


def operate(live, press):
    """A second in an operator's hands: held, let go, changed, paused, stepped, at other rates, with events."""
    (control,) = live.catalog.controls
    presses = itertools.count(press)  # on a busy machine a press may be over before it is seen
    live.resume()
    for count in range(8):
        live.hold(control.input, control.value(0.3 + count / 12), next(presses))
        time.sleep(0.02)
    until(lambda: live.hold(control.input, control.value(0.9), next(presses)) or live.state.held, "the hand")
    live.set(MASS, "0.9 kg")
    live.pace(0.2)
    until(lambda: not live.state.held, "rest")
    live.pace(0.5)
    live.trigger("event_2")
    begin = live.state.time

    def is_held():
        live.hold(control.input, -0.004, next(presses))
        return live.state.held and live.state.time > begin + 0.02

    until(is_held, "the hand")
    live.pause()
    live.release_hold()
    live.step(7)
    live.release(POSITION)
    live.step_macro()


@pytest.mark.slow
def test_runs_again_to_the_bit(live, build, tmp_path):
    operate(live, 100)
    before = live.state
    assert before.phase == "paused"
    assert before.values[MASS] == "0.9 kg"
    assert before.values["sensor.noise"] == "2 mN"  # set when a condition was met
    conditions = [command.text for command in live.done if command.kind == "condition"]
    assert set(conditions) == {"set sensor.noise = 2 mN (when servomotor.velocity > 1 mm/s)"}
    now = live.state.time
    time.sleep(0.1)
    assert live.state.time == now  # it stands still
    until(lambda: len(live.latest([POSITION]).time) and live.latest([POSITION]).time[0] == now, "the last row")
    seen = live.read([POSITION, "command.live_speed[1]", "command.pressed"])
    part = live.read([POSITION], since=0.01, until=0.02)
    assert part.time.tolist() == pytest.approx([k / 1000 for k in range(11, 21)])
    live.reset()  # the run before is finished with it
    folder = Path(before.folder)
    assert (live.state.epoch, live.state.phase, live.state.time) == (before.epoch + 1, "paused", 0.0)
    assert (live.done, live.state.values) == ((), {})
    recorded = same_bits(folder, build, tmp_path)
    assert recorded["time"][-1] >= now
    for name, values in seen.values.items():  # what was seen while it ran is what was recorded
        assert np.array_equal(values, recorded[name][: len(values)])
    assert np.any(recorded[SPEED] > 0.005)  # what a person did is in the results
    assert np.any(recorded[SPEED] == -0.004)
    assert set(recorded["seed"]) == {2}
    assert not (folder / ".recording").exists()


@pytest.mark.slow
def test_a_session_that_was_killed_runs_again_to_the_bit(start, build, tmp_path):
    live = start(running=True)
    live.set(MASS, 0.8)
    presses = itertools.count(1000)

    def is_held():
        live.hold(SPEED, 0.02, next(presses))
        return live.state.held and live.state.time > 0.1

    until(is_held, "a tenth of a second")
    folder = Path(live.state.folder)
    os.kill(live.process.pid, signal.SIGKILL)
    until(lambda: live.state.phase == "failed", "the end")
    assert f"has died (signal 9). Recover its results with: twin recover {folder}" in live.state.message
    with pytest.raises(RefusedError, match="over"):
        live.pause()
    with pytest.raises(TwinError, match="signal 9"):
        live.stop()
    until((folder / ".recording").exists, "the recording")
    recover(folder, report=False)
    recorded = same_bits(folder, build, tmp_path)
    assert recorded["time"][-1] >= 0.05
    assert np.any(recorded[SPEED] == 0.02)


SHOWS = """
import sys, time
from twin.live import LiveSession
if __name__ == "__main__":
    live = LiveSession.start(sys.argv[1], variant="quiet", runs=sys.argv[2], build=sys.argv[3], running=True)
    is_told = False
    while True:
        live.hold("command.live_speed[1]", 0.01, time.monotonic_ns())
        time.sleep(0.03)
        if live.state.held and live.state.time > 0.2 and not is_told:
            print(live.state.folder, live.process.pid, flush=True)
            is_told = True
"""


@pytest.mark.slow
def test_the_loop_ends_by_itself_when_who_shows_it_is_killed(build, tmp_path):
    """All goes to rest, and the folder is finished, with nobody left to ask for it."""
    with subprocess.Popen([sys.executable, "-c", SHOWS, FILE, tmp_path, build], stdout=-1, text=True) as shows:
        folder = Path(shows.stdout.readline().split()[0])
        shows.kill()
    until((folder / "summary.json").exists, "the summary")
    summary = json.loads((folder / "summary.json").read_text())
    assert (summary["status"], summary["passed"]) == ("interrupted", False)
    assert "s: the console was killed." in summary["reason"]
    recorded = same_bits(folder, build, tmp_path / "again")
    assert np.any(recorded[SPEED] == 0.01)
    until(lambda: not (folder / ".recording").exists(), "the end")


@pytest.mark.slow
def test_odd_steps_from_an_odd_start(start, build, tmp_path):
    file = tmp_path / "beat.yaml"
    file.write_text(
        "{start_time: 1 s, stop_time: 2 s, step: 1/300 s, members: {heart: {component: heart}, "
        "wall: {component: wall}}, connections: [heart.position -> wall.heart_position], variants: {free: {}, pressed: {}}, "
        "expect: [{name: bound, signal: wall.tip_position, at_most: 3 mm}, {name: own, signal: wall.tip_position, at_most: 0, "
        "nominal: true}, {name: other, signal: wall.tip_position, at_most: 0, variants: free}]}"
    )
    live = start(file, variant="pressed", seed=None, running=False, rate=10.0)
    live.set("wall.tip_position", "2 mm")  # before the scenario's end; later it would change no verdict
    live.resume()
    until(lambda: live.state.phase == "paused", "the end of the scenario")
    assert live.state.time == 2.0
    live.resume()
    until(lambda: live.state.time > 2.5, "half a second more than the scenario has")
    folder = live.stop()
    same_bits(folder, build, tmp_path)
    summary = json.loads((folder / "summary.json").read_text())
    assert [case["variant"] for case in summary["cases"]] == ["pressed"]
    assert {row["name"]: row["verdict"] for row in summary["expectations"]} == {"bound": "pass", "own": "skipped"}
    assert "operated by hand, at other values than the file's: wall.tip_position at " in summary["notes"][0]
    assert not summary["paper_applies"]


@pytest.mark.slow
def test_a_member_that_fails_ends_the_run_and_a_reset_begins_anew(start, tmp_path):
    (tmp_path / "breaks.py").write_text(
        "from twin.component import PythonComponent, input, output\n"
        "class Breaks(PythonComponent):\n"
        "    '''Breaks.'''\n"
        "    u = input('', 'breaks it')\n"
        "    y = output('', 'nothing')\n"
        "    def step(self, t, h):\n"
        "        if self.u > 0.5:\n"
        "            raise ValueError('broken')\n"
        "        self.y = t\n"
    )
    file = tmp_path / "breaks.yaml"
    file.write_text("{stop_time: 1 s, members: {it: {component: 'breaks:Breaks'}}}")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", f"{tmp_path}")
        live = start(file, variant=None, seed=None, running=True)
    live.set("it.u", 1.0)
    until(lambda: live.state.phase == "failed", "the failure")
    assert "it: failed with ERROR in the step" in live.state.message
    with pytest.raises(RefusedError, match="has failed"):
        live.resume()
    live.reset()
    assert (live.state.phase, live.state.time) == ("paused", 0.0)
    live.step(3)
    assert live.state.time == pytest.approx(3e-3)


@pytest.mark.slow
def test_what_cannot_begin_says_why(start, tmp_path):
    for file, options, told in (
        (tmp_path / "none.yaml", {}, "none.yaml"),
        (FILE, {"variant": "silent"}, "there is no variant `silent`"),
        (FILE, {"overrides": ["servomotor.mass=-1 kg"]}, "below the minimum"),
        (FILE, {"hardware": tmp_path / "none.yaml"}, "none.yaml"),
    ):
        with pytest.raises(TwinError) as caught:
            start(file, **options)
        assert told in str(caught.value)


@pytest.mark.slow
def test_ends_at_once_while_it_gets_ready(start):
    live = start(wait=False)
    begin = time.monotonic()
    live.close()
    assert live.state.phase == "stopped"
    assert time.monotonic() - begin < 20.0
    with pytest.raises(RefusedError, match="over"):
        live.resume()


@pytest.mark.slow
@pytest.mark.real_time
def test_at_rest_within_the_time_of_a_hold(start, build, tmp_path):
    """Of the last renewal: by the recording, whose simulated time is the wall clock's at rate 1."""
    live = start(running=True, rate=1.0)
    until(lambda: live.state.time > 0.3, "some time")
    renewed = []
    for press in range(1, 6):
        for _ in range(10):
            renewed.append(live.state.time)
            live.hold(SPEED, 0.01, press)
            time.sleep(0.033)
        until(lambda: not live.state.held, "rest")
        rest = live.state.time
        # else the next press follows without a part at rest between
        until(lambda rest=rest: live.state.time > rest + 0.05, "a part at rest")
    recorded = table(live.stop())
    ends = recorded["time"][1:][np.diff(recorded[SPEED]) < -0.005]
    assert len(ends) == 5
    assert all(min(end - one for one in renewed if one < end) < SIMULATED_HOLD + 0.06 for end in ends)
