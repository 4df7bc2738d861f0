"""What a supervisor and its worker say to each other, over real pipes in one process; what follows from an exit."""

import os
import threading
from collections import deque

import pytest

from twin.process import CrashReport
from twin.process.shared import HEAD, NOTES, RECORD, TAIL, Drainer, Shared
from twin.process.supervisor import TRIES, Supervisor, read_available
from twin.process.supervisor_channel import LETTERS, LogLines, SupervisorChannel, Watched

NEXT_ROW, TICK, AT, FRONT = RECORD, RECORD + 8, RECORD + 16, 5_000


def layout(folder):
    return {
        "file": str(folder / "rows"),
        "position": str(folder / "position"),
        "front": FRONT,
        "row": 8,
        "end": 64,
        "next_row": NEXT_ROW,
        "tick": TICK,
        "at": AT,
    }


class Pair:
    """A supervisor that answers in a thread, and the channel of its worker."""

    def __init__(self, timeout=1.0):
        self.shared = Shared()
        self.supervisor = supervisor = Supervisor(self.shared, timeout, "")
        supervisor.drainer, supervisor.pending, supervisor.stack = Drainer(self.shared), b"", b""
        supervisor.done, supervisor.last, supervisor.lines, supervisor.pid = False, (0, 0, 0), {}, 0
        supervisor.silent_time = 0.0
        (supervisor.messages, out), (back, supervisor.answers) = os.pipe(), os.pipe()
        (supervisor.errors, self.err), (supervisor.stacks, self.dump) = os.pipe(), os.pipe()
        for end in (supervisor.messages, supervisor.errors, supervisor.stacks):
            os.set_blocking(end, False)
        self.channel = Watched(self.shared, out, back, os.getppid())
        self.ended = threading.Event()
        self.thread = threading.Thread(target=self.answer)
        self.thread.start()

    def answer(self):
        while not self.ended.wait(0.0005):
            self.supervisor.read_pipes()

    def stop(self):
        """The supervisor answers no more."""
        self.ended.set()
        self.thread.join()

    def put_rows(self, *rows):
        """Write rows of 8 bytes into the ring."""
        for row in rows:
            place = self.shared.word(NEXT_ROW) - FRONT
            self.shared.memory[HEAD + place : HEAD + place + 8] = row * 8
            self.shared.put(NEXT_ROW, FRONT + place + 8)


@pytest.fixture
def pair():
    pair = Pair()
    yield pair
    pair.stop()
    for end in (pair.supervisor.messages, pair.supervisor.answers, pair.supervisor.errors, pair.supervisor.stacks):
        os.close(end)
    pair.supervisor.drainer.close()
    pair.channel.close()


@pytest.mark.slow
def test_rows_are_in_the_file_after_each_sync(pair, tmp_path):
    pair.shared.put(NEXT_ROW, FRONT)
    pair.channel.open(layout(tmp_path))
    pair.put_rows(b"a", b"b")
    pair.channel.sync()
    assert (tmp_path / "rows").read_bytes() == b"a" * 8 + b"b" * 8
    assert pair.channel.tail == 16
    for _ in range(260):  # the number of a request is one byte
        pair.channel.sync()
    pair.put_rows(b"c")
    pair.channel.log("plant", "x" * (LETTERS + 1))
    pair.channel.shut()
    assert (tmp_path / "rows").read_bytes()[16:] == b"c" * 8
    assert (pair.supervisor.lines, pair.supervisor.drainer.file, pair.supervisor.drainer.layout) == ({}, -1, {})
    assert (pair.channel.layout, pair.channel.trouble, pair.channel.stopped) == (None, None, False)


def test_what_a_worker_leaves_to_its_successor(pair):
    os.write(pair.err, b"first\n\n second\n")
    os.write(pair.dump, b"Current thread\n")
    pair.channel.keep(resume="folder", code=2)
    pair.channel.keep(code=3)
    for i in range(7):
        pair.channel.log("plant", f"line {i} " + "x" * LETTERS)
    pair.channel.note("plant: step")
    pair.channel.done()
    pair.channel._request(sync=True)
    pair.stop()  # the answer comes before the other pipes are read
    supervisor = pair.supervisor
    assert supervisor.successor_values == pair.channel.successor_values == {"resume": "folder", "code": 3}
    assert [line[:7] for line in supervisor.lines["plant"]] == [f"line {i} " for i in range(2, 7)]
    assert {len(line) for line in supervisor.lines["plant"]} == {LETTERS}
    assert list(supervisor.lines[""]) == ["first", " second"]
    assert (supervisor.done, supervisor.stack) == (True, b"Current thread\n")
    assert pair.channel.owners.split()[0] == SupervisorChannel().owners
    assert len(pair.channel.owners.split()) == 2


def test_a_worker_without_its_supervisor_drains_itself(pair, tmp_path):
    pair.shared.put(NEXT_ROW, FRONT)
    pair.channel.open(layout(tmp_path))
    pair.channel.look()
    assert not pair.channel.stopped
    pair.stop()
    pair.supervisor.drainer.close()
    os.close(pair.supervisor.messages)
    pair.supervisor.messages = os.open(os.devnull, os.O_RDONLY)
    pair.put_rows(b"a")
    pair.channel.sync()
    assert pair.channel.stopped
    assert (tmp_path / "rows").read_bytes() == b"a" * 8
    pair.channel.log("plant", "heard by none")
    pair.channel.shut()
    other = Watched(Shared(), *os.pipe()[::-1], os.getpid())
    other.look()  # its parent is another process than it was told
    assert (other.stopped, other._out) == (True, -1)


def test_a_message_may_come_in_pieces(pair):
    """Of several messages and a part of one, the complete ones are handled."""
    import marshal

    pair.stop()
    supervisor = pair.supervisor
    parts = [len(data := marshal.dumps({"keep": {name: 1}})).to_bytes(4, "little") + data for name in ("a", "b", "c")]
    whole = b"".join(parts)
    for begin, end, keys in ((0, len(whole) - 1, "ab"), (len(whole) - 1, None, "abc")):
        os.write(pair.channel._out, whole[begin:end])
        supervisor.read_pipes()
        assert "".join(supervisor.successor_values) == keys
    assert supervisor.pending == b""
    assert read_available(supervisor.stacks) == b""


def test_how_long_a_worker_is_stuck(pair, tmp_path):
    """While the same activity goes on; not between activities, and not while drives are stopped."""
    pair.stop()
    supervisor, shared = pair.supervisor, pair.shared
    assert supervisor.stuck_time(1.0, 0.1) == 0.0  # nothing is noted
    shared.note("plant: initialization")
    assert supervisor.stuck_time(1.0, 0.1) == 0.0  # it is new
    assert supervisor.stuck_time(1.0, 0.1) == pytest.approx(1.1)
    pair.channel.beat()
    assert supervisor.stuck_time(1.0, 0.1) == 0.0
    shared.note("drive: termination")
    assert [supervisor.stuck_time(1.0, 0.1) for _ in range(2)] == [0.0, 0.0]
    shared.note("")
    supervisor.drainer.layout = layout(tmp_path)
    shared.put(AT, 7)
    assert [supervisor.stuck_time(1.0, 0.1) for _ in range(2)] == [0.0, pytest.approx(1.1)]
    shared.put(TICK, 1)
    assert supervisor.stuck_time(1.0, 0.1) == 0.0
    shared.put(AT, 0)
    assert [supervisor.stuck_time(1.0, 0.1) for _ in range(2)] == [0.0, 0.0]
    assert shared.word(NOTES) > 0


def test_a_report_of_what_the_worker_did(pair, tmp_path):
    pair.stop()
    supervisor = pair.supervisor
    supervisor.lines = {"plant": deque(["a", "b"])}
    supervisor.stack = b'Current thread 0x1\n  File "m.py", line 3 in step\n'
    pair.shared.note("plant: step")
    pair.shared.put(TICK, 12)
    pair.shared.put(AT, 34)
    report = {"note": "plant: step", "log": {"plant": ["a", "b"]}, "stack": ['  File "m.py", line 3 in step']}
    assert supervisor.crash_report(-11) == CrashReport(signal=11, **report)
    supervisor.drainer.layout = layout(tmp_path)
    assert supervisor.crash_report(3) == CrashReport(exit=3, tick=12, at=34, **report)
    supervisor.silent_time, supervisor.stop_signal = 1.7, 2
    assert supervisor.crash_report(-9) == CrashReport(
        signal=9, unresponsive_time=1.0, stop_signal=2, tick=12, at=34, **report
    )
    supervisor._forward_signal(15, None)
    assert supervisor.stop_signal == 2  # the first one


@pytest.mark.parametrize(
    ("exits", "values", "code", "attempts"),
    [
        ([0], {}, 0, 0),
        ([3], {}, "gave up", 0),
        ([-11], {}, "gave up", 0),
        ([-11, 0], {"resume": "f", "begun": True}, "gave up", 2),  # a normal end that was not announced is none
        ([-11] * 3, {"resume": "f"}, "gave up", TRIES - 1),
        ([-11] * 3, {"resume": "f", "begun": True}, "gave up", TRIES),
        ([-11] * 3, {"resume": "f", "begun": True, "finishing": True}, "gave up", TRIES - 1),
    ],
)
def test_a_crash_is_followed_by_another_worker(pair, monkeypatch, exits, values, code, attempts):
    """As often as a case had begun in it, and twice otherwise."""
    pair.stop()
    supervisor, ends = pair.supervisor, iter([*exits, -11, -11, -11])
    supervisor.successor_values = dict(values)
    monkeypatch.setattr(supervisor, "watch", lambda: number if (number := -next(ends)) > 0 else -number << 8)
    monkeypatch.setattr(supervisor, "give_up", lambda crash: "gave up")

    def begin(crash):
        assert crash.signal == 11 or crash.exit == 0
        for name in ("messages", "answers", "errors", "stacks"):
            setattr(supervisor, name, os.open(os.devnull, os.O_RDWR))

    monkeypatch.setattr(supervisor, "begin", begin)
    assert (supervisor.run(), supervisor.attempt) == (code, attempts)


@pytest.mark.parametrize(("status", "code"), [(0, 0), (3 << 8, 3), (9, 2)])
def test_the_exit_code_of_a_worker_that_announced_its_end(pair, monkeypatch, status, code):
    """If it was killed after that, the code that it kept."""
    pair.stop()
    pair.supervisor.done, pair.supervisor.successor_values = True, {"code": 2, "resume": "f"}
    monkeypatch.setattr(pair.supervisor, "watch", lambda: status)
    assert pair.supervisor.run() == code


def test_giving_up(pair, capsys):
    pair.stop()
    assert pair.supervisor.give_up(CrashReport(exit=3)) == 1
    pair.supervisor.successor_values["hint"] = "Do this."
    assert pair.supervisor.give_up(CrashReport(signal=9)) == 130
    first, second, hint = capsys.readouterr().err.splitlines()
    assert first == "error: the run: ended the process with exit code 3."
    assert second.startswith("error: the run was killed (SIGKILL)")
    assert hint == "Do this."


def test_lines_are_passed_on():
    heard = []
    lines = LogLines(["a"], heard.append)
    lines.append("b")
    assert (list(lines), heard) == (["a", "b"], ["b"])


def test_a_process_of_its_own_drains_what_it_records(tmp_path):
    """Without a supervisor; an error of the disk is told as an OSError that names the file."""
    channel = SupervisorChannel()
    channel.shared.put(NEXT_ROW, FRONT)
    channel.shared.put(TAIL, 3)
    channel.open(layout(tmp_path))
    channel.shared.memory[HEAD : HEAD + 8] = b"a" * 8
    channel.shared.put(NEXT_ROW, FRONT + 8)
    channel.wait()
    assert ((tmp_path / "rows").read_bytes(), channel.tail) == (b"a" * 8, 8)
    (tmp_path / "rows").unlink()
    channel.sync()
    trouble = channel.trouble
    assert (trouble.errno, trouble.strerror, trouble.filename) == (
        2,
        "its folder has disappeared",
        str(tmp_path / "rows"),
    )
    channel.shut()
    channel.close()
    channel.close()
    assert channel.layout is None
