"""Which steps of a commissioning have succeeded: by how their commands end, over restarts."""

from types import SimpleNamespace

import pytest

from hw_bridge.command.bench.single_axis import NO_DATA
from hw_bridge.command.commissioning_steps import STEPS
from hw_bridge.command.live_motion import LiveMotion
from hw_bridge.command.progress import Outcome, StepProgress, outcome
from hw_bridge.command.running_card import motion_line, motion_state

SILENT = "axis: stopped at 5.70 mm: released.\n\nerror: the operator's page has not answered for 502 ms: stopped.\n"
STEP = {step.title: step for step in STEPS}


@pytest.mark.parametrize(
    ("word", "code", "text", "directions", "result"),
    [
        ("jog", 0, "", 0, Outcome.NEUTRAL),
        ("jog", 0, "", 1, Outcome.NEUTRAL),
        ("jog", 0, "", 2, Outcome.DONE),
        ("move", 0, "", 1, Outcome.DONE),
        ("jog", 130, "interrupted", 2, Outcome.NEUTRAL),  # STOP may mean that something was wrong
        ("jog", 1, SILENT, 2, Outcome.NEUTRAL),
        (
            "jog",
            1,
            f"{SILENT.rstrip()} axis: power is off (Switch on disabled), at 1.00 mm from start.\n",
            2,
            Outcome.NEUTRAL,
        ),
        ("jog", 1, f"{SILENT.rstrip()} axis: power is off (Fault), at 1.00 mm from start.\n", 2, Outcome.FAILED),
        ("move", 1, SILENT, 2, Outcome.NEUTRAL),
        ("jog", 1, f"warning: axis: is in Fault.\n{SILENT}", 2, Outcome.FAILED),
        ("jog", 1, f"{SILENT.rstrip()} axis: EMCY 8611h, following error.\n", 2, Outcome.FAILED),
        ("jog", 1, "error: axis: force 9 N is above 8 N. It stops.\n", 2, Outcome.FAILED),
        ("check", 1, "differs: axis: its scale\n", 0, Outcome.FAILED),
    ],
)
def test_what_the_end_of_a_command_means(word, code, text, directions, result):
    """A jog is done after both directions and an orderly end."""
    assert outcome(word, code, text, ["positive", "negative"][:directions]) is result


def test_steps_are_known_after_a_restart(tmp_path):
    """For the drive and the scope with which they were done; a failure takes them back, a stop does not."""
    path, scope = tmp_path / "runs" / "progress.json", ["a"]

    def progress():
        return StepProgress(path, lambda step, node: f"{scope[0]} {node}")

    first = progress()
    first.record("twin hil check -f b.yaml", "", Outcome.DONE)
    first.record("twin hil jog axis -f b.yaml", "axis", Outcome.DONE)
    first.record("twin hil jog axis -f b.yaml", "axis", Outcome.NEUTRAL)
    first.record("twin hil reset -f b.yaml axis", "axis", Outcome.DONE)  # no step
    again = progress()
    assert again.time_of(STEP["check"], "axis") == first.time_of(STEP["check"], "other") > 1.7e9
    assert again.time_of(STEP["jog"], "axis") is not None
    assert again.time_of(STEP["jog"], "other") is again.time_of(STEP["move"], "axis") is None
    scope[0] = "b"  # another hardware file
    assert again.time_of(STEP["check"], "axis") is None
    scope[0] = "a"
    again.record("twin hil check -f b.yaml", "", Outcome.FAILED)
    assert again.latest_outcome(STEP["check"], "axis") is Outcome.FAILED
    again.record("twin hil jog axis -f b.yaml", "axis", Outcome.NEUTRAL)
    assert again.latest_outcome(STEP["jog"], "axis") is Outcome.NEUTRAL
    assert [again.learn_serial("can0 node 1", serial) for serial in ("1", "1", "2B")] == ["", "", "1"]
    assert progress().serials == {"can0 node 1": "2B"}
    assert progress().time_of(STEP["check"], "axis") is None
    assert progress().time_of(STEP["jog"], "axis") is not None
    again.record("twin hil home axis -f b.yaml", "axis", Outcome.DONE)
    again.forget(node="axis", title="home")
    assert progress().time_of(STEP["home"], "axis") is None
    assert progress().time_of(STEP["jog"], "axis") is not None
    again.forget(scope="a ")
    assert progress().time_of(STEP["jog"], "axis") is None
    path.write_text('[["a", 1]]')
    assert progress().done == {}


LINE = "> position    1.25 mm from start, velocity  4.98 mm/s, current -0.100 A, Operation enabled   upper end    "


def test_values_of_a_motion_are_taken_from_its_output():
    """Also where a part ends in the middle of a line; a repeated line is a sample. Time begins with power."""
    motion = LiveMotion()
    motion.process_output(f"\r{LINE.replace('Operation enabled', 'Switched on')}\r")
    assert (motion.has_samples, motion.state) == (False, "Switched on")
    motion.process_output(f"axis: hold a button.\n\r{LINE[:40]}")
    assert not motion.has_samples
    motion.process_output(f"{LINE[40:]}\r\r{LINE.replace('1.25', '1.75')}\r")
    assert (motion.state, motion.position, motion.velocity) == ("Operation enabled", "1.75 mm", "4.98 mm/s")
    assert (motion.current, motion.origin, motion.direction) == ("-0.100 A", "from start", "positive")
    begin, end = motion.span()
    assert begin == 0.0
    time, position = motion.read("position", begin, end, 100)
    assert (list(time), list(position)) == ([begin, end], [1.25, 1.75])
    assert list(motion.read("current", end, end + 1.0, 100)[1])[-1] == -0.1
    motion.process_output("< position -4.00 deg from reference, velocity 0.00 deg/s, current 0.00 A, Fault   \r")
    assert (motion.directions, motion.unit, motion.origin) == ({"positive", "negative"}, "deg", "from reference")
    motion.begin()
    assert (motion.directions, motion.has_samples, motion.span()) == (set(), False, (0.0, 0.0))
    assert [len(values) for values in motion.read("position", 0.0, 1.0, 100)] == [0, 0]  # an empty chart


def test_a_curve_ends_where_process_data_are_missing():
    motion = LiveMotion()
    stale = LINE.replace("upper end    ", f"{NO_DATA} 0.28 s")
    motion.process_output(f"{LINE}\r{stale}\r{stale}\r")
    assert (motion.no_data_since, motion.position, len(motion.read("position", 0.0, 1.0, 9)[0])) == (
        "0.00 s",
        "1.25 mm",
        1,
    )
    typed = SimpleNamespace(motion=motion, running=False, node="axis")
    assert motion_state(typed)[1] == "No data since 0.00 s: curves end there, values are the last known."
    assert "Operation enabled, last known" in motion_line(typed)
    motion.process_output(f"{LINE}\r")
    assert motion.no_data_since == ""


def test_the_curve_of_a_homing_counts_from_the_reference_in_the_end():
    """The drive sets its position anew: in one curve that would be a jump that did not happen."""
    motion = LiveMotion()
    for place, origin in (("7.00", "in the drive"), ("2.00", "in the drive"), ("-40.00", "from reference")):
        motion.process_output(f"{LINE.replace('1.25', place).replace('from start', origin)}\r")
    assert list(motion.read("position", *motion.span(), 100)[1]) == [-35.0, -40.0, -40.0]
