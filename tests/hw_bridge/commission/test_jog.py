"""A key that is held moves a drive in a process of its own; released, hung up or killed, it stops."""

import os
import pty
import select
import signal
import subprocess
import sys
import time
from contextlib import suppress

import pytest

from hw_bridge.command.control import request
from hw_bridge.commission.deadman import BEGIN, HOLD, DeadMan, split
from hw_bridge.dictionary import State, state_of
from hw_bridge.fault import Cause, Fault
from tests.every_case import every_case
from tests.hw_bridge.commission.conftest import BENCH, drive_process, watching

RIGHT, LEFT = b"\x1b[C", b"\x1b[D"
REPEAT = 0.04  # of a terminal [s]
MS = 1_000_000


@pytest.fixture(scope="module")
def drive(build, tmp_path_factory):
    with drive_process("faulhaber_v3", build, 41000 + os.getpid() % 4000) as found:
        file = tmp_path_factory.mktemp("jog") / "bench.yaml"
        file.write_text(BENCH.format(name="servomotor", profile="faulhaber_v3", channel=found.channel, port=found.port))
        found.file = file
        yield found


@pytest.fixture
def jog(drive, build):
    """`twin hil jog` in a terminal of its own; ends with the test."""
    ours, theirs = pty.openpty()
    words = ["hil", "jog", "servomotor", "-f", str(drive.file), "--velocity", "10 mm/s", "--distance", "9 mm"]
    line = [sys.executable, "-c", "from twin.cli import main; main()", *words, "--build", str(build)]
    process = subprocess.Popen(line, stdin=theirs, stdout=theirs, stderr=theirs, start_new_session=True)
    os.close(theirs)
    process.terminal, process.said = ours, b""
    try:
        until(process, b"hold an arrow key")
        yield process
    finally:
        process.terminate()
        with suppress(OSError):
            os.close(ours)
        process.wait(20)


def until(process, text):
    end = time.monotonic() + 40
    while text not in process.said:
        assert time.monotonic() < end, process.said
        listen(process)


def listen(process):
    """Take in what it shows; AssertionError with all of that if it has ended."""
    try:
        process.said += os.read(process.terminal, 4096)
    except OSError:
        raise AssertionError(process.said.decode()) from None


def hold(process, seconds, key=RIGHT):
    """Hold a key down; the time of its last repeat."""
    end = time.monotonic() + seconds
    while True:
        os.write(process.terminal, key)
        last = time.monotonic()
        while select.select([process.terminal], [], [], 0)[0]:  # what it shows
            listen(process)
        if last > end:
            return last
        time.sleep(REPEAT)


def place(node):
    """Where the drive is [m]."""
    return int.from_bytes(node.sdo.read(0x6064), "little", signed=True) * 1e-6


def stands(line, node, within):
    """The time when it stood, looked at until `within` [s] have passed."""
    before, since = place(node), time.monotonic()
    end = since + within
    while time.monotonic() < end:
        line.wait(10 * MS)
        if abs((now := place(node)) - before) > 20e-6:
            before, since = now, time.monotonic()
    return since


def off(line, node, within):
    """Whether it has no power after so many seconds at most."""
    end = time.monotonic() + within
    while time.monotonic() < end:
        if state_of(node.sdo.number(0x6041)) in (State.DISABLED, State.FAULT, State.READY):
            return True
        line.wait(10 * MS)
    return False


@pytest.mark.slow
@pytest.mark.real_time
def test_it_moves_while_a_key_is_held(drive, jog):
    with watching(drive) as line:
        node = line.drive("1", "faulhaber_v3")
        begin = place(node)
        os.write(jog.terminal, RIGHT)  # one key alone
        time.sleep(0.3)
        assert abs(place(node) - begin) < 50e-6
        hold(jog, 0.6)
        moved = stands(line, node, 0.6) and place(node) - begin
        assert 3e-3 < moved < 9.2e-3
        hold(jog, 2.5, LEFT)  # farther than it may
        stands(line, node, 0.5)
        assert place(node) - begin == pytest.approx(-9e-3, abs=0.1e-3)
        os.write(jog.terminal, b"q")
        until(jog, b"stopped and disabled")
        assert jog.wait(20) == 0
        assert off(line, node, 1.0)


@pytest.mark.slow
@pytest.mark.real_time
def test_it_stands_within_200_ms_of_the_last_key(drive, jog):
    """From 10 mm/s; its loop closes in on the place with 20 ms, so that 0.05 mm are a standstill."""
    with watching(drive) as line:
        node = line.drive("1", "faulhaber_v3")
        for _ in range(5):
            for key in (RIGHT, LEFT):
                last = hold(jog, 0.4, key)
                line.wait(round((last + 0.2 - time.monotonic()) * 1e9))
                there = place(node)
                line.wait(300 * MS)
                assert abs(place(node) - there) < 50e-6


@pytest.mark.slow
@pytest.mark.parametrize("end", ["kill", "kill again", "hang up", "hang up twice", "interrupt", "bus"])
def test_it_stops_whatever_ends_it(drive, jog, hil_command, end):
    """kill -9: by the drive itself, which misses its heartbeat; else by the master."""
    with watching(drive) as line:
        node = line.drive("1", "faulhaber_v3")
        hold(jog, 0.3)
        assert state_of(node.sdo.number(0x6041)) is State.ENABLED
        if end.startswith("kill"):
            jog.kill()
        elif end == "bus":  # nothing gets through any more, for a second
            request(int(drive.control), Fault(Cause.DROP, duration=1_000_000_000, identifiers=(0, 0x7FF)))
            time.sleep(1.0)
        elif end.startswith("hang up"):
            os.close(jog.terminal)
            for _ in range(3 * end.endswith("twice")):  # as the terminal and its shell do
                jog.send_signal(signal.SIGHUP)
                time.sleep(1e-4)
        else:
            jog.send_signal(signal.SIGINT)
        assert off(line, node, 2.0)
        there = place(node)
        line.wait(100 * MS)
        assert abs(place(node) - there) < 50e-6
        if end == "bus":
            until(jog, b"servomotor: no ")  # heartbeat or process data
        code = jog.wait(20)
        assert code == 130 or end != "hang up twice"
        if end.startswith("kill") or end == "bus":
            if end != "bus":
                text = " ".join(hil_command("check", "-f", drive.file, code=1).split())
                assert "differs: servomotor: reports an earlier error" in text
                assert "differs: servomotor: a killed run left" in text
                for words in (["status", "1"], ["scan"]):  # the values are not the drive's own
                    told = " ".join(hil_command(*words, "-f", drive.file).split())
                    assert f"Restore them: twin hil restore 1 -f {drive.file}" in told
                    assert (words == ["scan"]) is not ("(of the killed run)" in told)
            assert "reports an earlier error" in hil_command("move", 1, "--by", "1 mm", "-f", drive.file, code=1)
            assert "8130h node guarding or heartbeat" in " ".join(hil_command("reset", "-f", drive.file).split())


@every_case(
    ("keys", "held"),
    [
        ([(0, "right")], 0),  # one alone
        ([(0, "right"), (500, "right")], 0),  # the second comes after the terminal's delay: still no repeat
        ([(0, "right"), (500, "right"), (540, "right")], 1),
        ([(0, "left"), (40, "left")], -1),
        ([(0, "left"), (40, "right")], 0),
        ([(0, "left"), (40, "left"), (60, "space")], 0),
        ([(0, "left"), (40, "left"), (60, "other")], 0),
    ],
)
def test_only_repeats_count(keys, held):
    deadman = DeadMan()
    for time_, key in keys:
        found = deadman.look([key], time_ * MS)
    assert found == held
    assert deadman.look([], keys[-1][0] * MS + HOLD) == held
    assert deadman.look([], keys[-1][0] * MS + HOLD + 1) == 0
    assert BEGIN < 200 * MS


def test_keys_of_a_terminal():
    assert split(b"\x1b[C\x1bOCq\x1b[Dx ") == ["right", "right", "q", "left", "other", "space"]
