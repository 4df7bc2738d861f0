"""A supervisor and its real child: what the child begins with, what is read of it, and when it is killed."""

import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")

# a child that exits with what `child` returns; the supervisor prints what `parent` returns after it has ended
PROGRAM = """
import json, os, signal, sys, time
from pathlib import Path
from twin.process import CrashReport
from twin.process.process_identity import MemoryFolder
from twin.process.shared import Shared
from twin.process.stop import once
from twin.process import supervisor as module
from twin.process.supervisor import Supervisor

def name(handler):
    return getattr(handler, "__name__", str(handler))

signal.signal(signal.SIGINT, signal.SIG_IGN)
signal.signal(signal.SIGHUP, signal.SIG_IGN)
one = Supervisor(Shared(), TIMEOUT, sys.argv[1], "quick")
one.attempt, one.successor_values = ATTEMPT, {"a": 1}
CODE
link = one.begin(CrashReport(signal=11, note="before"))
if link is not None:
    os._exit(child(link))
begun(one)
begin = time.monotonic()
code = os.waitstatus_to_exitcode(one.watch())
print(json.dumps({"code": code, "seconds": time.monotonic() - begin, "pid": one.pid, **parent(one)}))
"""


def supervised(folder, code, *, timeout=0.0, attempt=1):
    """What the supervisor prints, and what came on stderr."""
    defaults = "def begun(one): pass\ndef parent(one): return {}\n"
    text = PROGRAM.replace("TIMEOUT", str(timeout)).replace("ATTEMPT", str(attempt))
    text = text.replace("CODE", defaults + textwrap.dedent(code))
    done = subprocess.run(
        [sys.executable, "-c", text, str(folder)], capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout), done.stderr


def test_what_a_child_begins_with(tmp_path):
    """Its own folder for temporary files, what its predecessor left, and signals that end it once."""
    result, errors = supervised(
        tmp_path,
        """
        def child(link):
            import tempfile
            facts = {
                "folders": [os.environ["TMPDIR"], tempfile.gettempdir(), MemoryFolder.folder, link.temporary],
                "link": [link.attempt, dict(link.successor_values), link.crash_report.note],
                "allowed": Supervisor.allowed,
                "signals": [name(signal.getsignal(each)) for each in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)],
                "blocked": len(signal.pthread_sigmask(signal.SIG_BLOCK, ())),
            }
            link.successor_values["a"] = 2
            Path(sys.argv[1], "facts").write_text(json.dumps(facts))
            os.write(2, b"native\\n\\n")
            print("python", file=sys.stderr)
            return 7

        import tempfile
        tempfile.gettempdir()
        Supervisor.allowed = True

        def parent(one):
            return {
                "lines": {source: list(lines) for source, lines in one.lines.items()},
                "values": one.successor_values,
                "blocked": len(signal.pthread_sigmask(signal.SIG_BLOCK, ())),
                "waits": [os.get_blocking(each) for each in (one.wake, one._woken, one.messages, one.errors, one.stacks)],
                "kept": [name(signal.getsignal(each)) for each in (signal.SIGTERM, signal.SIGINT)],
            }
        """,
        attempt=2,
    )
    own = str(tmp_path)
    assert json.loads((tmp_path / "facts").read_text()) == {
        "folders": [own, own, "quick", own],
        "link": [2, {"a": 1}, "before"],
        "allowed": False,
        "signals": ["once", "1", "1"],
        "blocked": 0,
    }
    assert sorted(errors.split()) == ["native", "python"]
    assert (result.pop("code"), result.pop("pid"), result.pop("seconds") < 10.0) == (7, 0, True)
    assert result == {
        "lines": {"": ["native"]},
        "values": {"a": 1},
        "blocked": 0,
        "waits": [False] * 5,
        "kept": ["0", "1"],  # handlers are installed for the first child only
    }


def test_a_signal_is_passed_on(tmp_path):
    """SIGINT even if it was ignored, as for background jobs of a shell; SIGHUP then stays ignored."""
    result, _ = supervised(
        tmp_path,
        """
        def child(link):
            try:
                signal.pthread_sigmask(signal.SIG_BLOCK, ())
                Path(sys.argv[1], "ready").touch()
                time.sleep(20)
            except KeyboardInterrupt:
                return 3

        def begun(one):
            while not Path(sys.argv[1], "ready").exists():
                time.sleep(0.005)
            os.kill(os.getpid(), signal.SIGHUP)
            os.kill(os.getpid(), signal.SIGTERM)

        def parent(one):
            os.kill(os.getpid(), signal.SIGINT)  # nothing to pass it on to
            return {"first": one.stop_signal, "handlers": [name(signal.getsignal(each)) for each in (2, 15, 1)]}
        """,
        attempt=0,
    )
    assert (result["code"], result["first"]) == (3, signal.SIGTERM)
    assert result["handlers"] == ["_forward_signal", "_forward_signal", "1"]
    assert result["seconds"] < 10.0


@pytest.mark.slow
def test_a_child_that_makes_no_progress_is_killed(tmp_path):
    """After it has told where it was. One that is silent because nothing is noted is left alone."""
    result, _ = supervised(
        tmp_path,
        """
        def child(link):
            time.sleep(0.4)
            link.note("b: working")
            time.sleep(60)

        def parent(one):
            report = one.crash_report(-9)
            return {"stack": b"Current thread" in one.stack, "silent": one.silent_time, "report": vars(report)}
        """,
        timeout=0.2,
    )
    assert (result["code"], result["stack"]) == (-signal.SIGKILL, True)
    assert 0.2 < result["silent"] < 10.0
    assert 0.6 < result["seconds"] < 20.0
    assert (result["report"]["unresponsive_time"], result["report"]["note"]) == (0.2, "b: working")


OVERDUE = """
def child(link):
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    time.sleep(DURATION)
    return 5

one.successor_values = VALUES

def begun(one):
    one.stop_signal, one.stop_requested_at = signal.SIGTERM, time.monotonic() - (PASSED)

def parent(one):
    return {"silent": one.silent_time}
"""


@pytest.mark.parametrize(
    ("passed", "values", "killed"),
    [
        pytest.param("module.STOP_TIME - 10", {}, False, marks=pytest.mark.slow),
        pytest.param("module.STOP_TIME + 1", {}, True, marks=pytest.mark.slow),
        ("module.STOP_TIME + 1", {"finishing": True}, False),
        pytest.param("module.FINISH_TIME + 1", {"finishing": True}, True, marks=pytest.mark.slow),
    ],
)
def test_a_child_that_does_not_stop_is_killed(tmp_path, passed, values, killed):
    """While it finishes its results it has more time."""
    code = (
        OVERDUE.replace("DURATION", "30" if killed else "0.3").replace("VALUES", repr(values)).replace("PASSED", passed)
    )
    result, _ = supervised(tmp_path, code)
    assert result["code"] == (-signal.SIGKILL if killed else 5)
    assert result["seconds"] < 20.0
    assert result["silent"] == 0.0


@pytest.mark.slow
def test_folders_are_removed_when_all_have_ended(tmp_path):
    """Even if they are killed: by a process of a session of its own, which holds nothing of theirs."""
    program = """
import os, signal, sys, time
from twin.process.supervisor import remove_at_end
remove_at_end([])
remove_at_end(sys.argv[1:])
if os.fork() == 0:
    time.sleep(0.2)
    os.kill(os.getpid(), signal.SIGKILL)
os.kill(os.getpid(), signal.SIGKILL)
"""
    folders = [tmp_path / "a", tmp_path / "b"]
    for folder in folders:
        folder.mkdir()
        (folder / "file").touch()
    done = subprocess.run([sys.executable, "-c", program, *map(str, folders)], capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (-signal.SIGKILL, b"")
    limit = time.monotonic() + 30.0
    while any(folder.exists() for folder in folders):
        assert time.monotonic() < limit
        time.sleep(0.01)


SUPERVISED = """
import os, signal, sys, tempfile
from twin.process import supervisor as module

module.remove_at_end = lambda folders: None  # what the supervisor itself removes is tested here
module.command_line()
link = module.supervise(TIMEOUT)
folder = os.environ["TMPDIR"]
open(os.path.join(folder, f"file {link.attempt}"), "w").close()
print(link.attempt, folder == tempfile.gettempdir(), len(os.listdir(folder)), link.attempt and link.crash_report.signal)
print(folder, file=sys.stderr)
sys.stdout.flush()
if link.attempt < CRASHES:
    link.keep(resume=True, begun=True)
    os.kill(os.getpid(), signal.SIGKILL)
sys.exit(CODE)
"""


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(("crashes", "code"), [(2, 3), (0, 0), (0, 3), (1, 0)])
def test_a_command_goes_on_in_children_and_leaves_nothing(tmp_path, crashes, code):
    """Their folder for temporary files lasts until the last one has ended; the exit code is its."""
    program = SUPERVISED.replace("TIMEOUT", "0.0").replace("CRASHES", str(crashes)).replace("CODE", str(code))
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False, env=environment, timeout=60
    )
    assert done.returncode == code
    assert done.stdout.splitlines() == [
        f"{attempt} True {attempt + 1} {9 if attempt else 0}" for attempt in range(crashes + 1)
    ]
    (folder,) = set(done.stderr.split())
    assert Path(folder).parent == tmp_path
    assert list(tmp_path.iterdir()) == []
