"""Drives on the page: the commands of the bench as its buttons, and the safety view in words.

Over 400 lines: the steps of one page share its fixtures.
"""

import math
import re
import time
from types import SimpleNamespace

import click
import pytest

from hw_bridge.command import hil
from hw_bridge.command.commissioning_steps import (
    ANY_TIME,
    NOT_HOMED,
    READING,
    STEPS,
    alternative,
    closed,
    is_step,
    missing,
    options,
    prerequisite,
    problem,
    unavailable,
)
from hw_bridge.command.live_motion import LiveMotion
from hw_bridge.command.pages import PANEL
from hw_bridge.command.running_card import (
    CLOSE_PAGES,
    EXPIRED,
    listed,
    motion_state,
    output_lines,
    parts,
    result,
    state_text,
    wrapped,
)
from hw_bridge.command.typed import MOVES, settled
from hw_bridge.commission import axis
from hw_bridge.hardware import load
from tests.every_case import every_case
from twin.console import Host, safety
from twin.errors import TwinError

PAGE = "this page did not answer for 0.5 s (closed, reloaded or stalled)"
LIMITS = "{position: [-45 mm, 45 mm], velocity: 200 mm/s, force: 8 N, following_error: 3 mm, acceleration: 3 m/s^2}"
NODE = f"nodes: {{axis: {{node: 1, profile: faulhaber_v3, limits: {LIMITS}}}}}\n"
LIMIT = {"name": "force", "value": 4.5, "low": -5.0, "high": 5.0, "part": 0.9, "unit": "N"}
DRIVE = {
    "node": 1,
    "profile": "<b>",
    "state": "Fault",
    "mode": "csv",
    "errors": ["3210h overvoltage. Check the supply."],
    "limits": [LIMIT, {**LIMIT, "name": "velocity", "part": 1.2}],
    "heartbeat_age": 0.004,
    "heartbeat_limit": 0.06,
    "lost": 2,
    "late": 0,
}
TOLD = {
    "interface": "socketcan",
    "channel": "can0",
    "armed": True,
    "simulated": False,
    "stopped": "",
    "control": "this session",
    "brought_up": True,
    "bus_load": 0.109,
    "cycle": 0.005,
    "cycles": 7,
    "jitter_99": 2e-4,
    "jitter_max": 1e-3,
    "nodes": {"servomotor": DRIVE},
    "modules": {},
    "watches": {"servomotor": {"signal": "sensor.force", "force": 0.19062, "above": 0.4, "retracts": ""}},
    "shadow": {},
    "notes": ["n"],
}


@pytest.fixture
def typed(tmp_path, build):
    """Commands on a file, of a console that was armed or not."""
    made = []

    def of(bus="simulated: true", arm=False):
        file = tmp_path / "bench.yaml"
        file.write_text(f"{bus}\ncycle: 5 ms\n{NODE}")
        host = Host(hardware=file, build=build, runs=tmp_path / "runs", arm=arm)
        host.activities[PANEL.title] = PANEL.activity(host)
        made.append(host.activities[PANEL.title])
        return made[-1]

    yield of
    for one in made:
        one.close()


def until(condition, seconds=40.0, meanwhile=lambda: None):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        meanwhile()
        time.sleep(0.02)


@pytest.mark.slow
def test_a_button_runs_what_one_types(typed):
    one = typed()
    one.begin("status", "axis")
    assert one.busy == ""  # it only reads: a session may begin
    assert not one.attended
    with pytest.raises(TwinError, match=r"twin hil status goes on. End it first"):
        one.begin("scan")
    until(lambda: not one.running)
    assert "Switch on disabled" in one.text
    ((_, line, code),) = one.done
    assert (line, code) == (f"twin hil status axis -f {one.file}", 0)


@every_case("step", [*STEPS, *ANY_TIME])
def test_every_step_types_what_its_command_accepts(typed, monkeypatch, step):
    """Of the file on its own, else with -f; also the files that the page adds."""
    one = typed()
    lines = []
    monkeypatch.setattr(one, "_start", lambda words, attended: lines.append(words))
    files = [str(one.file.with_name("axis.dcf"))] if step.word in ("dump", "compare") else []
    one.file.with_name("axis.dcf").touch()
    one.begin(step.word, "" if step.is_bus_wide else "axis", [*options(step, {}), *files])
    ((word, *arguments),) = lines
    assert hil.command.get_command(click.Context(hil.command), word).make_context(word, arguments).params


@pytest.mark.slow
def test_a_jog_moves_while_it_is_renewed_and_ends_with_its_page(typed):
    """All of it in the process of the command: here is only who renews."""
    one = typed()
    one.begin("jog", "axis", ["--velocity=20 mm/s"], (20.0, "mm/s"))
    assert one.attended
    assert "twin hil jog has the drives" in one.busy
    assert one.controls == ()
    one.hold("jog axis", 1.0, 1, 0.0)  # not before it is up
    until(lambda: one.controls, meanwhile=lambda: one.here(0.0))
    assert one.controls == ("jog axis",)
    until(lambda: place(one) > 1.0, meanwhile=lambda: one.hold("jog axis", 1.0, 2, 0.0))
    assert one.held == {"jog axis": 1.0}
    one.release_hold()
    until(lambda: " 0.00 mm/s" in one.text and "Operation enabled" in one.text, meanwhile=lambda: one.here(0.0))
    assert one.held == {}
    there = place(one)
    begun = time.monotonic()
    until(lambda: not one.running)  # and nobody says anything any more
    assert 0.2 < time.monotonic() - begun < 20.0
    assert "the operator's page has not answered" in one.text
    assert place(one) == pytest.approx(there, abs=0.05)
    assert one.done[0][2] == 1
    assert not one.progress.time_of(next(step for step in STEPS if step.word == "jog"), "axis")  # no orderly end
    (times, position), (_, current) = (one.motion.read(name, 0.0, 1e9, 4000) for name in ("position", "current"))
    assert position[0] == pytest.approx(0.0, abs=0.5)  # the first line may come within the first steps
    assert (position.max() > 1.0, len(times) == len(current) > 5) == (True, True)
    assert one.motion.origin == "from start"


def place(one):
    """Where the jog tells that it is [mm]."""
    last = re.findall(r"position +(-?[0-9.]+) mm", one.text)
    return float(last[-1]) if last else 0.0


@pytest.mark.slow
def test_an_orderly_end_and_a_stop(typed):
    one = typed()
    one.begin("enable", "axis")
    until(lambda: "Operation enabled" in one.text, meanwhile=lambda: one.here(0.0))
    one.end()
    until(lambda: not one.running, meanwhile=lambda: one.here(0.0))
    assert one.text.endswith("axis: stopped and disabled, at 0.00 mm from start.\n")
    one.begin("enable", "axis")
    until(lambda: "Operation enabled" in one.text, meanwhile=lambda: one.here(0.0))
    one.console.stop()  # what STOP does
    until(lambda: not one.running)
    assert "interrupted" in one.text
    kind, text = result(one)
    assert kind == "warn"
    what, state, command = text.split("\n")
    assert what == "enable axis: stopped by STOP or Esc."
    assert re.fullmatch(r"Power is off \(Switch on disabled\), at \S+ mm from start\.", state)
    assert command == "Next: enable."
    assert (one.motion.state, one.motion.direction) == ("Switch on disabled", "")
    assert one.done[0][2] == 130


@pytest.mark.slow
def test_nothing_is_armed_that_the_command_line_did_not_arm(typed):
    real = "interface: socketcan\nchannel: can0"
    one = typed(real)
    for word in MOVES:
        with pytest.raises(TwinError, match=r"was not armed. End it, and start it with --arm"):
            one.begin(word, "axis")
    assert one.process is None
    one.begin("status", "axis")
    until(lambda: not one.running)
    assert "--arm" not in one.done[0][1]
    armed = typed(real, arm=True)
    armed.begin("move", "axis", ["--by=1 mm"])
    until(lambda: not armed.running)
    assert armed.done[0][1].endswith("--arm")
    assert armed.done[0][2] == 1  # there is no can0 here


def test_a_session_that_has_the_drives_keeps_them(typed):
    one = typed()
    going = SimpleNamespace(
        catalog=SimpleNamespace(wall_clock=True), state=SimpleNamespace(phase="running", hardware=None), resume=None
    )
    one.console.live = going
    for word in ("jog", "disable", "reset"):
        with pytest.raises(TwinError, match=r"the session uses the drives. Stop it first"):
            one.begin(word, "axis")
    going.state = SimpleNamespace(phase="paused", hardware={"brought_up": False})
    assert one.console.drives_in_use == ""
    one.begin("enable", "axis")
    with pytest.raises(TwinError, match="twin hil enable has the drives"):
        one.console.resume()
    one.close()
    one.console.live = None


@every_case("text", ["--arm", "1 mm; rm", "1 mm\n--arm", "x" * 41, "$(1)", "1 mm --arm"])
def test_what_a_field_holds_is_a_quantity(text):
    (move,) = [one for one in STEPS if one.word == "move"]
    with pytest.raises(TwinError, match="expected a number with its unit"):
        options(move, {"by": text})


def test_a_file_that_is_wrong_is_told_before_anything_is_served(tmp_path):
    with pytest.raises(TwinError, match=r"nowhere.yaml: cannot be read"):
        PANEL.activity(Host(hardware=tmp_path / "nowhere.yaml"))


def test_what_is_filled_in_is_what_is_typed():
    steps = {one.word: one for one in STEPS}
    assert options(steps["move"], {"by": " -1.5 mm ", "velocity": "", "from-start": True, "arm": True}) == [
        "--by=-1.5 mm",
        "--from-start",
    ]
    assert options(steps["jog"], {"acceleration": "0.5 m/s^2"}) == ["--acceleration=0.5 m/s^2"]
    assert settled("a\n\r1 mm\r2 mm") == "a\n2 mm"


def test_how_a_command_has_ended():
    push, by_hand, jog = STEPS[len(READING) :][:3]
    lines = ("jog axis -f b.yaml", "direction axis -f b.yaml --by-hand", "scan -f b.yaml", "check b.yaml")
    of = {line: [step.title for step in STEPS if is_step(step, "axis", f"twin hil {line}")] for line in lines}
    assert list(of.values()) == [[jog.title], [by_hand.title], ["scan"], ["check"]]
    assert not is_step(by_hand, "axis_2", f"twin hil {lines[1]}")
    assert push.title == "direction, push"
    typed = SimpleNamespace(word="jog", node="axis", text="error: no power.\nSwitch it on.\n", done=[(2.0, "", 1)])
    assert result(typed) == ("bad", "✗ jog axis: no power. Switch it on.")
    assert parts(typed)[0] == ""  # the sentence above the output has it
    silent, left = (
        "error: the operator's page has not answered for 502 ms: stopped.",
        "  axis: power is off (Ready), at\n  1 mm.\n  Next, once the cause is removed:\n  twin hil jog axis -f b.yaml\n",
    )
    typed.text, typed.outputs = f"{silent}\n{left}", [f"{silent}\n{left}"]
    lines = "Power is off (Ready), at 1 mm.\nNext, once the cause is removed: jog."
    assert result(typed) == ("warn", f"jog axis: stopped: {PAGE}.\n{lines}\n{CLOSE_PAGES}")
    typed.text = f"error: jammed.\n{left}"
    assert result(typed) == ("bad", f"✗ jog axis: jammed.\n{lines}")
    assert "<b>stopped</b>" in listed(typed)
    typed.text = f"warning: axis: does not stand.\n{silent}"
    assert result(typed)[0] == "bad"
    typed.text = ""
    typed.done[0], typed.motion = (2.0, "", 0), SimpleNamespace(directions={"positive"})
    assert result(typed)[1].startswith("jog axis: ended, not complete: move it in both directions")
    typed.motion.directions.add("negative")
    assert result(typed) == ("good", "✓ jog axis: done")
    typed.done[0] = (2.0, "", 130)
    stopped = "jog axis: stopped by STOP or Esc.\n"  # amber, but red where power may be on
    assert result(typed) == ("bad", f"{stopped}It did not report the state of the drive: run status.")
    for text, kind, line in (
        ("axis: stopped before power.", "warn", "Nothing was enabled."),
        (
            "axis: power is off (Ready), at\n1 mm.\nNext: twin hil status\nThen: twin hil home\naxis: restored\n",
            "warn",
            "Power is off (Ready), at 1 mm.\nNext: status, then home.",
        ),
        (
            "axis: last state Fault. Check it.\nNext: twin hil status\ninterrupted\n",
            "bad",
            "Last state Fault. Check it.\nNext: status.",
        ),
    ):
        typed.text = text
        assert result(typed) == (kind, f"{stopped}{line}")
    typed.done[0] = (2.0, "", -9)
    assert "was killed (signal 9) and restored nothing" in result(typed)[1]
    typed = SimpleNamespace(
        word="scan", node="", text="", done=[(1.0, "", 0)], motion=SimpleNamespace(directions=set())
    )
    assert result(typed) == ("good", "✓ scan: done")
    typed.text = "node 1: note: x\nnote: axis: a limit\n  is wider.\nnote: b\naxis: tables\n  note: no\n"
    assert result(typed) == ("warn", "✓ scan: done, 2 notes")
    typed.done[0] = (1.0, "", 1)
    assert result(typed) == ("bad", "✗ scan: ended with exit code 1")
    typed.text = "differs: axis: its scale\n  is ASSUMED.\ndiffers: node 1 is not in the file.\nnote: b\n"
    assert result(typed) == ("bad", "✗ scan: axis: its scale is ASSUMED. node 1 is not in the file.")


def test_a_step_waits_for_the_steps_before_it(typed):
    """For all of them, by their numbers. Either kind of `direction` will do; what reads waits for nothing."""
    steps, done = {step.title: step for step in STEPS}, set()

    def before(title):
        return prerequisite(steps[title], lambda step: step.title in done)

    assert {title for title in steps if not before(title)} == {step.title for step in READING}
    directions = "6 (direction, push) or 7 (direction, by hand)"
    assert before("direction, push") == "Do step 5 (check) first."
    assert before("jog") == f"Do step 5 (check), then {directions} first."
    assert before("move") == f"Do step 5 (check), then {directions}, then 8 (jog) first."
    done |= {"direction, by hand", "jog"}
    assert before("move") == "Do step 5 (check) first."  # which has failed since
    done.add("check")
    assert not any(map(before, steps))
    done.remove("direction, by hand")
    assert before("home") == f"Do step {directions} first."


def test_of_two_steps_of_a_command_one_may_be_skipped():
    push, by_hand = (step for step in STEPS if step.word == "direction")
    assert alternative(by_hand, lambda step: step is push) is push
    assert alternative(by_hand, lambda step: step is by_hand) is None


def test_live_values_are_as_wide_as_the_other_output():
    line = "> position      26.73 mm from reference, velocity  2.04 mm/s, current  0.100 A, Operation enabled   upper end   "
    assert [len(row) <= 80 for row in wrapped(f"a: {'b' * 90}\n{line}\r").split("\n")] == [False, True, True]


def test_sentences_of_the_output_wrap_at_the_width_of_the_page():
    first, rest = "note: the motor and the drive, " * 2 + "and others, and more", "than that."
    rows = [
        "  607Dh.1  Min position limit  -2 mm",
        "  ---------------",
        "  1.  to the end stop",
        "  it is wide.",
        "a",
        "b",
    ]
    lines = (
        output_lines("\n".join([first, f"  {rest}", *rows])).replace("\n", "").removesuffix("</div>").split("</div>")
    )
    assert lines[0] == f"<div>{first} {rest}"
    assert ["class" in line for line in lines] == [False, True, True, False, False, False, False]


def test_a_step_that_a_drive_has_not_got_says_why(typed):
    one = typed()
    steps = {step.title: step for step in STEPS}
    drive = axis(one.file, one.keys, "axis")
    assert unavailable(steps["home"], drive, True).startswith("axis: has no `homing` in the hardware file.")
    assert unavailable(steps["direction, push"], drive, True) == ""
    one.file.write_text(one.file.read_text().replace("faulhaber_v3", "epos2, scale: 1.0e-3"))
    without_torque = axis(one.file, load(one.file), "axis")
    assert "no cst to push with" in unavailable(steps["direction, push"], without_torque, False)
    assert unavailable(steps["direction, by hand"], without_torque, False) == ""


LINEAR = {
    ("jog", "velocity", ""): "Expected a value: up to 160 mm/s.",
    ("jog", "velocity", "160 mm/s"): None,
    ("jog", "velocity", "161 mm/s"): "Expected up to 160 mm/s.",
    ("jog", "velocity", "0 mm/s"): "Expected up to 160 mm/s, not 0.",
    ("jog", "velocity", "5"): "speed: 5 has no unit. Write it with one, such as '5 mm/s'.",
    ("jog", "acceleration", "3.1 m/s^2"): "Expected up to 3 m/s^2.",
    ("jog", "distance", "1 m"): None,
    ("move", "by", ""): None,
    ("move", "by", "-90 mm"): None,
    ("move", "by", "91 mm"): "Expected -90 mm to 90 mm.",
    ("move", "by", "0 2 mm"): "by: expected a number with its unit, such as '1 mm'.",
    ("move", "to", "0 mm"): None,
    ("move", "to", "46 mm"): "Expected -45 mm to 45 mm.",
    ("step", "by", "1.6 mm"): "Expected -1.5 mm to 1.5 mm.",
}


@every_case(("word", "option", "text"), list(LINEAR))
def test_a_field_says_what_it_expects(typed, word, option, text):
    one = typed()
    (step,) = [step for step in STEPS if step.word == word]
    (entry,) = [entry for entry in step.entries if entry.option == option]
    assert problem(step, entry, text, axis(one.file, one.keys, "axis")) == LINEAR[word, option, text]


@pytest.mark.parametrize(
    ("text", "position", "refusal"),
    [
        ("60 mm", -0.02, None),
        ("60 mm", 0.0, "Expected -45 mm to 45 mm: it is at 0 mm."),
        ("-30 mm", -0.02, "Expected -25 mm to 65 mm: it is at -20 mm."),
        ("10 mm", NOT_HOMED, None),
        ("-11 mm", NOT_HOMED, "Expected -10 mm to 10 mm: it is not homed, and an end stop may be nearer."),
    ],
)
def test_a_distance_is_refused_where_it_would_leave_the_limits(typed, text, position, refusal):
    one = typed()
    (step,) = [step for step in STEPS if step.word == "move"]
    assert problem(step, step.entries[0], text, axis(one.file, one.keys, "axis"), position) == refusal


@every_case(
    ("last", "text"),
    [
        ("  9.99 mm 1.00 mm/s 0.10 A  Operation enabled   ", "ready: hold an arrow key or a button"),
        (
            "> position 9.99 mm from start, velocity 1.00 mm/s, current 0.10 A, Operation enabled   ",
            "moves to positive positions while the button is held",
        ),
        (
            "< position 9.99 mm from start, velocity -1.00 mm/s, current 0.10 A, Operation enabled   \r",
            "moves to negative positions while the button is held",
        ),
        ("0.99 mm 0 mm/s 0.10 A  Operation enabled   dead-man switch   \r", EXPIRED),
        (
            "10.00 mm 0.00 mm/s 0.10 A  Operation enabled   upper end (--distance)   \r",
            "At the upper end of this jog, by --distance: only the other direction moves.",
        ),
        (
            "-35.00 mm 0.00 mm/s 0.10 A  Operation enabled   lower end (limits.position)",
            "At the lower end of this jog, by limits.position: only the other direction moves.",
        ),
    ],
)
def test_a_jog_says_what_it_does(typed, last, text):
    """Its button is not shown as held after its dead-man switch has ended the motion, as long as renewals of this press come."""
    one = typed()
    one.word, one.node, one.running, one.began = "move", "axis", True, time.monotonic() - 7.1
    assert motion_state(one) == ("neutral", "starts, 7 s")  # before its first line
    one.word = "jog"
    assert motion_state(one) == ("neutral", "powering on ... Keys have no effect yet.")
    one.text = f"axis: hold a button; -10.00 mm to 10.00 mm.\n{last}"
    one.motion.process_output(f"{last}\r")
    assert motion_state(one)[1] != "ready: hold an arrow key or a button" or one.motion.state == "Operation enabled"
    one.motion.state = "Operation enabled"
    one.hold("jog axis", 1.0, 1, 0.0)
    assert one.held == ({} if text is EXPIRED else {"jog axis": 1.0})
    assert motion_state(one) == ("good" if text.startswith("ready") else "warn", text)
    one.motion.begin()
    one.motion.process_output(
        "  position 9.99 mm from start, velocity 0.00 mm/s, current 0.10 A, Operation enabled   \r"
    )
    one.motion.process_output(
        "  position 9.99 mm from start, velocity 0.00 mm/s, current 0.10 A, Switch on disabled   \r"
    )
    assert motion_state(one)[1].startswith("Switch on disabled: keys have no effect.")
    one._page = object()
    one.word = "move"  # of a jog its dead-man switch says it
    one._late = (0.4, time.monotonic())
    assert motion_state(one) == (
        "warn",
        "This page answers late: 0.4 s. After 0.5 s the motion is stopped. Close other pages.",
    )
    one._page, one.running = None, False
    assert motion_state(one) == ("neutral", "")


def test_a_move_needs_one_goal():
    (move,) = [one for one in STEPS if one.word == "move"]
    assert missing(move, {"by": "", "to": ""}) == missing(move, {"by": "1 mm", "to": "1 mm"}) != ""
    assert missing(move, {"by": "1 mm"}) == missing(move, {"to": "1 mm"}) == ""
    assert missing(move, {"by": ""}) == "Fill in “by”."  # a drive without homing has no “to”
    assert "“to” counts from home" in missing(move, {"to": "1 mm", "from-start": True})
    by, to = move.entries[:2]
    assert closed(by, {"by": "", "to": "1 mm"}, 0.0) == "or clear “to (from home)”"
    assert closed(to, {"by": "1 mm", "to": ""}, 0.0) == "or clear “by”"
    assert closed(to, {"by": "", "to": ""}, math.inf) == "the drive is not homed"
    for entry, values in (
        (by, {"by": ""}),
        (to, {"by": "", "to": ""}),
        (to, {"by": "", "to": "1 mm"}),
        (move.entries[2], {}),
    ):
        assert closed(entry, values, 0.0) == ""


def test_the_live_state_is_a_line_of_each_drive():
    watch = SimpleNamespace(is_on=True, is_wanted=True, problem="", rows={})
    typed = SimpleNamespace(watch=watch, running=False, word="status", node="axis", motion=LiveMotion())
    watch.rows["axis"] = [("6041h Statusword", "Switch on disabled; voltage (0050h)"), ("6077h Torque", "0 A (0)")]
    assert state_text(typed) == (
        '<p><b>axis</b><span title="6041h Statusword">state <b>Switch on disabled; voltage</b></span></p>'
    )
    watch.rows["axis"] = [("no answer", "<abort>")]
    assert "no answer <b>&lt;abort&gt;</b>" in state_text(typed)
    typed.running = True
    assert "twin hil status runs: see its output." in state_text(typed)  # nothing that was read before it
    watch.rows, watch.is_on, typed.running = {}, False, False
    assert "off. It continues after the session." in state_text(typed)
    watch.is_wanted, watch.problem = False, "another program on the bus reads axis."
    assert "Live state is off: another program" in state_text(typed)


def test_the_live_state_has_the_values_of_the_command_that_moves_a_drive():
    """One source at a time: those of the command, after it those with which it has left the drive, until the next reading."""
    watch = SimpleNamespace(is_on=True, is_wanted=True, problem="", rows={})
    typed = SimpleNamespace(watch=watch, running=True, word="move", node="axis", motion=LiveMotion())
    line = "  position 7.00 mm from reference, velocity 2.00 mm/s, current 0.10 A, {}   \r"
    typed.motion.process_output(line.format("Operation enabled"))
    for text in ("state <b>Operation enabled<", "position <b>7.00 mm from reference<", "velocity <b>2.00 mm/s<"):
        assert text in state_text(typed)
    samples = len(typed.motion.read("current", 0.0, 9.0, 9)[0])
    typed.motion.process_output(line.replace("0.10 A", "    - A").format("Switch on disabled"))
    typed.running = False
    for text in ("state <b>Switch on disabled<", "position <b>7.00 mm from reference<", "current <b>-<"):
        assert text in state_text(typed)
    assert len(typed.motion.read("current", 0.0, 9.0, 9)[0]) == samples == 1
    watch.rows = {"axis": [("6041h", "Fault")]}
    assert state_text(typed) == '<p><b>axis</b><span title="6041h">state <b>Fault</b></span></p>'


def test_what_one_watches_over_stands_there_in_words():
    assert "armed: power may be on" in safety.heading(TOLD)
    assert "load 10.9 %" in safety.heading(TOLD)
    assert "stopped: EMCY &lt;1&gt;" in safety.heading({**TOLD, "stopped": "EMCY <1>"})
    assert "not armed" in safety.heading({**TOLD, "armed": False, "brought_up": False})
    told = safety.drives(TOLD)
    assert "&lt;b&gt;" in told
    assert "<b>" not in told.replace("<b>servomotor</b>", "")
    for text in (
        "3210h overvoltage. Check the supply.",
        "heartbeat 4 of 60 ms",
        "4.5 N</span>",
        "2 lost",
        "twin-warn",
        "twin-bad",
    ):
        assert text in told
    assert "heartbeat 4 of" not in safety.drives({**TOLD, "stopped": "stopped"})  # it would only grow
    assert ">-0.312 mm</span>" in safety.bar({**LIMIT, "value": -3.12e-4, "unit": "m"})
    assert '"57.3 of -286.5 to 286.5 deg/s"' in safety.bar({**LIMIT, "value": 1.0, "unit": "rad/s"})
    assert "sensor.force is 0.191 N, stops above 0.4 N<" in safety.details(TOLD)
    residual = {"position": 1e-3, "velocity": None, "current": 0.5}
    shadow = {"now": residual, "bands": residual, "largest": residual, "warnings": ["Look at <it>."]}
    text = safety.details({**TOLD, "shadow": {"servomotor": shadow}})
    assert "position 1 mm (band 1 mm, largest 1 mm), velocity not known" in text
    assert "Look at &lt;it&gt;." in text
    assert "velocity not known (band not known, largest not known), current 0.5 A" in text
    assert "position 0.0573 deg" in safety.shadow(shadow, rotary=True)
