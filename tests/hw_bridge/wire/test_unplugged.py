"""A serial adapter is pulled out or fails while a drive moves: the run ends with the cause, and so does the motion."""

import contextlib
import os
import random
import re
import select
import subprocess
import sys
import threading

import pytest
from click.testing import CliRunner

from hw_bridge.command import hil
from hw_bridge.dictionary import State
from tests.hw_bridge.wire.wired import rig, until, wired
from twin.errors import SimulationError

pytestmark = [
    pytest.mark.slow,
    pytest.mark.real_time,
    pytest.mark.skipif(sys.platform != "linux", reason="pseudo-terminals"),
]
SYNC, SYNCS = b"t0800\r", 30
LOST = b"t08183081"  # EMCY 8130h of node 1: no heartbeat
GONE = (
    "(?:Input/output error|it is gone)"  # what the system says of a terminal that was closed, or that it says nothing
)
SILENCE = (
    r"servomotor: (no process data for|its actual values are|following error) .* All drives stop\."  # what is first
)
OPTIONS = {"sleep_after_open": 0}
PATIENCE = 20.0  # for what takes this machine a moment [s]
BENCH = """interface: slcan
channel: {channel}
options: {{sleep_after_open: 0}}
cycle: 50 ms
nodes:
  servomotor:
    node: 1
    profile: faulhaber_v3
    units: {{acceleration: 1 mm/s^2}}
    heartbeat: {{every: 50 ms, lost_after: 500 ms}}
    limits: {{velocity: 50 mm/s}}
"""


class Cable:
    """Two serial ports with a cable between them, of which the first fails after so many SYNC; by default it comes loose.

    Other failures: it refuses frames, is stalled, or garbles what it receives.
    """

    def __init__(self, syncs, failure="pull"):
        import pty
        import tty

        self.ends, theirs = zip(*(pty.openpty() for _ in range(2)), strict=True)
        for end in theirs:
            tty.setraw(end)
        self.theirs = theirs
        self.ports = [os.ttyname(end) for end in theirs]
        self.left = syncs
        self.failure, self.has_failed = failure, False
        self.random = random.Random(1)
        self.open = dict(zip(self.ends, self.ends[::-1], strict=True))
        self.lines = dict.fromkeys(self.ends, b"")  # of each end, what came
        self.told = threading.Condition()
        self.over = False
        self.thread = threading.Thread(target=self.carry, daemon=True)
        self.thread.start()

    def carry(self):
        while not self.over and self.open:
            is_stalled = self.has_failed and self.failure == "stall"
            for end in select.select([*self.open][is_stalled:], [], [], 0.02)[0]:
                data = os.read(end, 4096)
                if self.has_failed:
                    self.fail(end, data)
                elif self.open[end] in self.open:
                    os.write(self.open[end], data)
                with self.told:
                    self.lines[end] += data
                    self.told.notify_all()
            if len(self.open) == 2 and self.lines[self.ends[0]].count(SYNC) >= self.left and not self.has_failed:
                if self.failure == "pull":
                    self.pull(self.ends[0])
                else:
                    self.has_failed = True

    def fail(self, end, data):
        """React to data that came to an end as an adapter that has failed."""
        first = self.ends[0]
        if self.failure == "refuse" and end == first:
            os.write(first, b"\a" * data.count(b"\r"))
        elif self.failure == "garble":
            os.write(self.open[end], data if end == first else self.random.randbytes(len(data)))

    def pull(self, end):
        self.open.pop(end)
        os.close(end)
        os.close(self.theirs[self.ends.index(end)])

    def heard(self, text):
        """Whether the drive says this, now or soon."""
        with self.told:
            return self.told.wait_for(lambda: text in self.lines[self.ends[1]], PATIENCE)

    def close(self):
        self.over = True
        self.thread.join()
        for end in [*self.open]:
            self.pull(end)


@pytest.fixture
def cable():
    """Comes loose at the master's end about a second after the drive moves."""
    made = Cable(SYNCS)
    yield made
    made.close()


def safe(drive):
    """Whether it has stopped by itself, since it missed the heartbeat."""
    return drive.state not in (State.ENABLED, State.QUICK_STOP) and 0x8130 in drive.active


def test_a_run(cable, build):
    """The failure names the adapter, a note says why the drive stops all the same, and it does."""
    ours, theirs = cable.ports
    with wired("slcan", theirs, build, OPTIONS) as wire:
        axis = rig("slcan", ours, build, OPTIONS)
        with pytest.raises(SimulationError) as failure:
            axis.go(20_000)
        assert re.fullmatch(
            rf"bus: (cannot be read|does not take frames): .*({GONE}|it is gone).* Check the adapter.*",
            str(failure.value),
        )
        assert abs(wire.slave.axis.motor.position) > 1e-3, "it had moved"
        note, *others = axis.session.outcome.unsafe
        assert any("The journal is kept" in note for note in others)
        assert note.startswith("stop: bus: does not take frames: ")
        assert note.endswith("The drives stop by themselves when this program's heartbeat is missing.")
        assert axis.session.outcome.termination().reason == str(failure.value)
        assert until(lambda: safe(wire.slave))
        cable.close()  # the drive's end, too
        assert until(lambda: wire.ended)
        assert re.fullmatch(rf"bus: cannot be read: .*{GONE}.*", wire.ended)


@pytest.mark.parametrize(
    ("failure", "cause"),
    [
        (
            "refuse",
            r"bus: the adapter refuses frames \(its answer is BEL\): .*\. Check bit rate, wiring and termination\.",
        ),
        ("stall", SILENCE),
        ("garble", SILENCE),
    ],
)
def test_an_adapter_that_fails(failure, cause, build):
    made = Cable(SYNCS, failure)
    try:
        ours, theirs = made.ports
        with wired("slcan", theirs, build, OPTIONS) as wire:
            axis = rig("slcan", ours, build, OPTIONS)
            with pytest.raises(SimulationError) as error:
                axis.go(20_000)
            assert re.fullmatch(cause, str(error.value))
            assert abs(wire.slave.axis.motor.position) > 1e-3, "it had moved"
            assert any("The journal is kept" in note for note in axis.session.outcome.unsafe)
            assert until(lambda: wire.slave.state not in (State.ENABLED, State.QUICK_STOP))
    finally:
        made.close()


def test_a_person_and_the_drive_as_commands(cable, tmp_path, build):
    """`twin hil move`, then `twin drive` whose end is pulled as well: both end with one sentence, none with a traceback."""
    ours, theirs = cable.ports
    words = ["drive", "-p", "faulhaber_v3", "-n", "1", "-i", "slcan", "-c", theirs, "--option", "sleep_after_open=0"]
    line = [sys.executable, "-c", "from twin.cli import main; main()", *words, "--build", str(build)]
    with (
        subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as drive,
        contextlib.ExitStack() as ending,
    ):
        ending.callback(drive.kill)
        assert "node 1 on slcan" in drive.stdout.readline()
        path = tmp_path / "bench.yaml"
        path.write_text(BENCH.format(channel=ours))
        move = ["move", "servomotor", "--by", "20 mm", "--distance", "20 mm", "--velocity", "10 mm/s", "--arm"]
        done = CliRunner().invoke(hil.command, [*move, "-f", str(path), "--build", str(build)])
        assert isinstance(done.exception, SimulationError)
        assert re.match(rf"bus: .*{GONE}", str(done.exception))
        assert "warning: stop: bus: does not take frames" in done.output
        assert cable.heard(LOST)
        cable.close()
        out, told = drive.communicate(timeout=PATIENCE)
    assert out == ""
    assert re.fullmatch(rf"error: bus: cannot be read: .*{GONE}.*\. Check the adapter\.\n", told)
    assert drive.returncode == 1
