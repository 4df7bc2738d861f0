"""Which steps of a commissioning have succeeded: by how their commands end, over restarts."""

import pytest

from hw_bridge.command.commissioning_steps import STEPS
from hw_bridge.command.live_motion import LiveMotion
from hw_bridge.command.progress import Outcome, StepProgress, outcome

SILENT = "axis: stopped at 5.70 mm: released.\n\nerror: the operator's page has not answered for 502 ms: stopped.\n"
STEP = {step.title: step for step in STEPS}


@pytest.mark.parametrize(
    ("word", "code", "text", "has_moved", "result"),
    [
        ("jog", 0, "", False, Outcome.DONE),
        ("jog", 130, "interrupted", True, Outcome.NEUTRAL),  # STOP may mean that something was wrong
        ("jog", 1, SILENT, True, Outcome.DONE),
        ("jog", 1, SILENT, False, Outcome.NEUTRAL),
        (
            "jog",
            1,
            f"{SILENT.rstrip()} axis: power is off (Switch on disabled), at 1.00 mm from start.\n",
            True,
            Outcome.DONE,
        ),
        ("jog", 1, f"{SILENT.rstrip()} axis: power is off (Fault), at 1.00 mm from start.\n", True, Outcome.FAILED),
        ("move", 1, SILENT, True, Outcome.NEUTRAL),
        ("jog", 1, f"warning: axis: is in Fault.\n{SILENT}", True, Outcome.FAILED),
        ("jog", 1, f"{SILENT.rstrip()} axis: EMCY 8611h, following error.\n", True, Outcome.FAILED),
        ("jog", 1, "error: axis: force 9 N is above 8 N. It stops.\n", True, Outcome.FAILED),
        ("check", 1, "differs: axis: its scale\n", False, Outcome.FAILED),
    ],
)
def test_what_the_end_of_a_command_means(word, code, text, has_moved, result):
    assert outcome(word, code, text, has_moved) is result


def test_steps_are_known_after_a_restart(tmp_path):
    """For the drive and the scope with which they were done; a failure takes them back, a stop does not."""
    path, scope = tmp_path / "runs" / "progress.json", ["a"]

    def progress():
        return StepProgress(path, lambda step, node: f"{scope[0]} {node}")

    first = progress()
    first.record("twin hil check b.yaml", "", Outcome.DONE)
    first.record("twin hil jog axis -f b.yaml", "axis", Outcome.DONE)
    first.record("twin hil jog axis -f b.yaml", "axis", Outcome.NEUTRAL)
    first.record("twin hil reset b.yaml axis", "axis", Outcome.DONE)  # no step
    again = progress()
    assert again.time_of(STEP["check"], "axis") == first.time_of(STEP["check"], "other") > 1.7e9
    assert again.time_of(STEP["jog"], "axis") is not None
    assert again.time_of(STEP["jog"], "other") is again.time_of(STEP["move"], "axis") is None
    scope[0] = "b"  # another hardware file
    assert again.time_of(STEP["check"], "axis") is None
    scope[0] = "a"
    again.record("twin hil check b.yaml", "", Outcome.FAILED)
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


def test_values_of_a_motion_are_taken_from_its_output():
    """Also where a part ends in the middle of a line; a repeated line is a sample."""
    motion = LiveMotion()
    line = "> position    1.25 mm from start, velocity  4.98 mm/s, current -0.10 A, Operation enabled   upper end    "
    motion.process_output(f"axis: hold a button.\n\r{line[:40]}")
    assert (motion.has_samples, motion.state) == (False, "")
    motion.process_output(f"{line[40:]}\r\r{line.replace('1.25', '1.75')}\r")
    assert (motion.state, motion.position, motion.velocity) == ("Operation enabled", "1.75 mm", "4.98 mm/s")
    assert (motion.current, motion.origin, motion.direction) == ("-0.10 A", "from start", "positive")
    begin, end = motion.span()
    motion.process_output(f"{line.replace('1.25', '6.44').replace('from start', 'in the drive')}\r")
    assert (motion.position, motion.origin, motion.span()) == (
        "6.44 mm",
        "in the drive",
        (begin, end),
    )  # no jump in the chart
    motion.process_output(f"{line.replace('1.25', '1.75')}\r")
    motion._samples.pop()
    time, position = motion.read("position", begin, end, 100)
    assert (list(time), list(position)) == ([begin, end], [1.25, 1.75])
    assert list(motion.read("current", end, end + 1.0, 100)[1])[-1] == -0.1
    motion.process_output("  position -4.00 deg from reference, velocity 0.00 deg/s, current 0.00 A, Fault   \r")
    assert (motion.direction, motion.has_moved, motion.unit, motion.origin) == ("", True, "deg", "from reference")
    motion.begin()
    assert (motion.has_moved, motion.has_samples, motion.span()) == (False, False, (0.0, 0.0))
