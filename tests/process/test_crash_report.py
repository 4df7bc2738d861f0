"""What is said of a process that ended before its time."""

import os
import signal

from tests.every_case import every_case
from twin.process import crash_report
from twin.process.crash_report import CrashReport, current_frames, is_library, signal_name

STDLIB = os.path.dirname(os.__file__)  # noqa: PTH120 - as Python prints it
ENGINE = crash_report.ENGINE


@every_case(
    ("report", "text", "from_outside"),
    [
        (CrashReport(exit=3), "the run: ended the process with exit code 3.", False),
        (
            CrashReport(signal=11, member="plant", function="fmi2DoStep", at=5, time_ns=1_000_000),
            "plant: crashed with SIGSEGV (Segmentation fault) in fmi2DoStep, in the step from t = 1 ms.",
            False,
        ),
        (
            CrashReport(signal=6, note="plant: initialization", time_ns=0),
            "plant: initialization: crashed with SIGABRT (Aborted), at t = 0 s.",
            False,
        ),
        (CrashReport(signal=9, unresponsive_time=2.5, member="plant"), "plant: did not return for 2.5 s.", False),
        (
            CrashReport(signal=9),
            "the run was killed (SIGKILL) by another process, or by the system for lack of memory.",
            True,
        ),
        (
            CrashReport(signal=9, stop_signal=2, member="plant", time_ns=2_000_000_000),
            "the run did not stop after SIGINT, and was killed, at t = 2 s, plant at work.",
            True,
        ),
        (CrashReport(exit=1, stop_signal=15), "the run ended the process with exit code 1.", True),
        (
            CrashReport(exit=1, member="plant", log={"plant": ["a", "b", "c"], "": ["d", "e", "f"], "other": ["g"]}),
            "plant: ended the process with exit code 1. Last log: b | c | d | e | f",
            False,
        ),
        (
            CrashReport(exit=1, note="plant: start", log={"plant": ["a"]}),
            "plant: start: ended the process with exit code 1. Last log: a",
            False,
        ),
        (
            CrashReport(exit=1, member="plant", stack=['  File "/home/me/model.py", line 12 in step']),
            "plant: ended the process with exit code 1, at /home/me/model.py:12.",
            False,
        ),
    ],
)
def test_a_report_in_one_line(report, text, from_outside):
    assert (report.text(), report.from_outside) == (text, from_outside)


@every_case(
    ("files", "location"),
    [
        ((), ""),
        (("/home/me/model.py",), "/home/me/model.py:1"),
        (
            (f"{STDLIB}/json/decoder.py", "/venv/site-packages/numpy/a.py", "<string>", "/home/me/model.py"),
            "/home/me/model.py:4",
        ),
        ((f"{ENGINE}/component/python.py", "/home/me/model.py"), "/home/me/model.py:2"),
        ((f"{ENGINE}/coupling/execution/loop.py", "/home/me/start.py"), ""),  # native code was called by the engine
        (("no frame", "/home/me/model.py"), "/home/me/model.py:2"),
    ],
)
def test_the_line_that_a_user_wrote(files, location):
    stack = [f'  File "{file}", line {i} in f' if file != "no frame" else file for i, file in enumerate(files, 1)]
    assert CrashReport(stack=stack).location == location


def test_frames_of_a_dump():
    """Those of the current thread only, as faulthandler prints them."""
    dump = (
        'Thread 0x1 (most recent call first):\n  File "a.py", line 1 in other\n\n'
        'Current thread 0x2 (most recent call first):\n  File "b.py", line 2 in inner\n  File "c.py", line 3 in outer\n\n'
        '  File "d.py", line 4 in later\n'
    )
    assert current_frames(dump) == ['  File "b.py", line 2 in inner', '  File "c.py", line 3 in outer']
    assert current_frames("") == []
    assert (signal_name(signal.SIGTERM), signal_name(200)) == ("SIGTERM", "signal 200")
    assert [is_library(file) for file in (f"{STDLIB}/os.py", "/x/site-packages/y.py", "/x/y.py")] == [True, True, False]
