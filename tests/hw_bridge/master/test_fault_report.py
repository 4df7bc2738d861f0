"""What an operator is told to do after a stop."""

import pytest

from hw_bridge.master.fault_report import next_step
from tests.hw_bridge.master.test_limits import Bench

HOMING = {"method": 37, "at": "0 mm", "speed": "10 mm/s"}
FAULT = "remove the cause, reset with `twin hil reset -f FILE`, run again (not homed again: axis)."


@pytest.mark.parametrize(
    ("homing", "started", "has_reference", "word", "foreign", "text"),
    [
        (HOMING, True, False, 0, False, "next: remove the cause, run again (homed again: axis)."),
        (HOMING, True, True, 0, False, "next: remove the cause, run again (not homed again: axis)."),
        (HOMING, False, False, 0, False, "next: remove the cause, run again."),
        (None, True, False, 0, False, "next: remove the cause, run again."),
        (HOMING, True, True, 8, True, f"next: switch the other program off, {FAULT}"),
    ],
)
def test_the_next_step(build, homing, started, has_reference, word, foreign, text):
    more = {"homing": homing} if homing else {}
    node = Bench("faulhaber_v3", build, {}, units={"acceleration": "1 mm/s^2"}, **more).master.nodes["axis"]
    node.started, node.has_reference, node.word = started, has_reference, word
    assert next_step([node], foreign) == text
