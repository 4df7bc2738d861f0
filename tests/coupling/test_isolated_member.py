"""A member in a process of its own, here without the process: its memory, requests and their answers, how it ends."""

import ctypes
import marshal
import os
import subprocess
import threading
from collections import deque
from itertools import pairwise
from multiprocessing.connection import Pipe
from queue import SimpleQueue
from types import SimpleNamespace

import numpy as np
import pytest

from tests.coupling.mock import scalar
from tests.every_case import every_case
from twin.coupling import IsolatedMember, MemberVariable
from twin.coupling.isolation import isolated_member
from twin.coupling.isolation.isolated_clocks import WIDEST, IsolatedClocks
from twin.coupling.isolation.isolated_member import pickled, shared_file
from twin.coupling.isolation.isolated_worker import (
    CHANNEL,
    HEAD,
    READY,
    ROW,
    Worker,
    map_memory,
    to_plain,
    unmap_memory,
    words,
)
from twin.coupling.member import Access
from twin.errors import CouplingError, SimulationError

MS = 1_000_000
SIZE = 4 * HEAD
pytestmark = pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "read"), reason="a member is isolated by POSIX")


def vector(name, causality, code="f8", shape=(3,), kind="Float64"):
    return MemberVariable(name, causality, "discrete", kind, np.dtype(code), shape)


class Inner:
    """The member in the process: some variables lie in memory, others are reached by calls."""

    instance, step_function, step_signature, step_name = 71, 72, 2, "fmi2DoStep"

    def __init__(self):
        every = (
            *(scalar("u", "input"), scalar("y", "output"), vector("v", "output")),
            *(vector("n", "output", "i4", (), "Int32"), vector("on", "output", "u1", (2,), "Boolean")),
            vector("text", "output", "O", (), "String"),
        )
        self.variables = {one.name: one for one in every}
        self.values = {"y": 1.5, "v": np.arange(3.0), "n": 7, "on": [True, False], "text": "a"}
        self.name, self.log, self.journal, self.period_ns = "m", [], [], 0

    def address(self, name):
        return {"u": 800, "v": 808, "n": 840}.get(name, 0)

    def access(self, names, write):
        return Access(60 + write, np.array([1, 2], np.uint32), 2, 3, "fmi2GetReal", takes_size=False)

    def get(self, name):
        return self.values[name]

    def set(self, name, value):
        self.values[name] = value

    def save(self):
        return dict(self.values)

    def restore(self, saved):
        self.values = saved

    def __getattr__(self, name):
        def call(*arguments):
            self.journal.append((name, *arguments))
            return {"serialize": b"12", "last_successful_time": 0.25, "finish_reason": "done"}.get(name)

        return call


@pytest.fixture
def both():
    """The proxy in this process, whose requests are answered at once, and the worker with the member."""
    memory = np.zeros(SIZE // 8 + 8)
    address = -(-int(memory.ctypes.data) // 64) * 64
    inner = Inner()
    worker = Worker(inner, {"gather": 1, "scatter": 2}, address, 5, 6, None, None)
    proxy = object.__new__(IsolatedMember)
    proxy.name, proxy.variables, proxy.log, proxy.crash_text = "m", inner.variables, [], ""
    proxy._memory, proxy._size, proxy._used, proxy._functions = address, SIZE, HEAD, {}
    proxy._native, proxy._phase, proxy._errors = {"set": 11, "get": 12}, "instantiation", deque(maxlen=5)
    proxy._channel = words(address, CHANNEL)[0:1]
    proxy.memory = memory

    def request(what, *arguments):
        failure, value = worker.answer(what, arguments)
        assert not failure, value
        return value

    proxy._request = request
    return proxy, worker


def test_each_method_is_a_request_of_its_name(both):
    proxy, worker = both
    proxy.instantiate()
    assert (proxy.step_name, proxy._phase) == ("fmi2DoStep", "initialization")
    channel = {name: int(worker.channel[name][0]) for name in ("step", "instance", "signature", "called", "back")}
    assert channel == {"step": 72, "instance": 71, "signature": 2, "called": 5, "back": 6}
    proxy.enter_initialization(0.5, None)
    proxy.exit_initialization()
    assert proxy._phase == "an access"
    proxy.failed(4)
    proxy.deserialize(b"34")
    assert worker.inner.journal == [
        ("instantiate",),
        ("enter_initialization", 0.5, None),
        ("exit_initialization",),
        ("failed", 4),
        ("deserialize", b"34"),
    ]
    assert (proxy.serialize(), proxy.last_successful_time(0.3), proxy.finish_reason()) == (b"12", 0.25, "done")
    assert proxy.address("u") == 0, "it lies in another process"


def test_values_have_the_type_and_shape_of_their_variable(both):
    proxy, worker = both
    assert proxy.get("y") == 1.5
    assert (proxy.get("v").tolist(), proxy.get("v").dtype) == ([0.0, 1.0, 2.0], np.float64)
    assert (proxy.get("n"), proxy.get("n").dtype) == (7, np.int32)
    assert (proxy.get("on").tolist(), proxy.get("on").dtype) == ([True, False], np.bool_)
    proxy.set("v", np.array([4.0, 5.0, 6.0]))
    assert worker.inner.values["v"] == [4.0, 5.0, 6.0], "as plain data"
    proxy.save()
    proxy.set("v", [0.0] * 3)
    proxy.restore(None)
    assert proxy.get("v").tolist() == [4.0, 5.0, 6.0]


@every_case(
    ("value", "plain"),
    [("a", "a"), (b"a\0", b"a\0"), ([b"\0", b"b"], [b"\0", b"b"]), (np.float64(2.5), 2.5), (np.array([1, 2]), [1, 2])],
)
def test_values_of_a_message_are_plain_data(value, plain):
    assert to_plain(value) == plain
    assert type(to_plain(value)) is type(plain)


def test_calls_of_the_loop_are_rows_in_the_shared_memory(both):
    """Variables in memory are gathered and scattered in pieces; others by the member's own call."""
    proxy, worker = both
    proxy.instantiate()
    reads, writes, own = proxy.access(["v", "n"], False), proxy.access(["u"], True), proxy.access(["y", "v"], False)
    offsets = list(proxy._functions)
    assert list(proxy._functions.values()) == ["access", "access", "fmi2GetReal"]
    assert [(one.function, one.count, one.size) for one in (reads, writes, own)] == [(12, 2, 4), (11, 1, 1), (12, 2, 3)]
    rows = [words(proxy._memory + offset, ROW)[0] for offset in offsets]
    assert [int(row["function"]) for row in rows] == [1, 2, 60]
    assert [int(row["bytes"]) for row in rows] == [3 * 8 + 4, 8, 4 * 8]
    assert [int(row["write"]) for row in rows] == [0, 1, 0]
    assert [(int(row["count"]), int(row["size"])) for row in rows] == [(2, 4), (1, 1), (2, -1)]
    assert all(int(row["instance"]) == 71 for row in rows)
    assert [int(row["next"]) for row in rows] == [offsets[1], offsets[2], 0], "a list, in the order of the calls"
    assert int(worker.channel["rows"][0]) == offsets[0] == HEAD
    pieces = worker.accesses[0].references
    assert pieces.tolist() == [[808, 24], [840, 4]]
    assert int(rows[0]["references"]) == pieces.ctypes.data
    taken = [[offset, offset + 8 * len(ROW)] for offset in offsets]
    taken += [[int(row["values"]), int(row["values"] + row["bytes"])] for row in rows]
    taken.sort()
    assert all(first[1] <= second[0] for first, second in pairwise(taken))
    assert all(first % 64 == 0 for first, _ in taken)


def test_memory_is_taken_in_lines_of_64_byte_until_there_is_none(both):
    proxy, _ = both
    sizes = (1, 64, 65, 0, 8)
    assert [proxy._take(size) - HEAD for size in sizes] == [0, 64, 128, 256, 256]
    assert proxy._used == HEAD + 320
    proxy._used = SIZE - 64
    assert proxy._take(64) == SIZE - 64
    with pytest.raises(
        CouplingError, match=r"m: is read in more ways than an isolated member can be\. Do not isolate it\."
    ):
        proxy._take(1)
    numbers = 8 + 8 + 3 * 8 + 4 + 2
    assert proxy._memory_size() == HEAD + 4 * (numbers + 5 * 64 + 64 * 8 * len(ROW)), "strings lie elsewhere"


class Answering:
    """What a proxy needs to send requests; `answers` come back one after the other."""

    def __init__(self, *answers, exit_code=0):
        self.member = object.__new__(IsolatedMember)
        member = self.member
        member.name, member.log, member.crash_text, member._count, member._phase = "m", [], "", 0, "an access"
        member._errors, member._answers, member._memory = deque(maxlen=5), SimpleQueue(), 0
        member._functions, member.step_name = {640: "fmi2GetReal"}, "fmi2DoStep"
        self.sent = []
        member._messages = SimpleNamespace(send_bytes=self.sent.append)
        told = ctypes.CFUNCTYPE(None, ctypes.c_void_p)(lambda _: None)
        member._native, self.keep = {"tell": ctypes.cast(told, ctypes.c_void_p).value}, told
        member._process = SimpleNamespace(wait=lambda *_: exit_code)
        member._channel = np.zeros(1, [(name, np.int64) for name in CHANNEL])
        for answer in answers:
            member._answers.put(answer)


def test_a_request_waits_for_its_own_answer():
    """Ctrl-C may have left the answer to an earlier one."""
    answering = Answering(
        (1, "", "first"), (1, "", "old"), (2, "", "second"), (3, "CouplingError", "no"), (4, "Other", "what")
    )
    request = answering.member._request
    assert [request("get", "a"), request("get", "b")] == ["first", "second"]
    with pytest.raises(CouplingError, match=r"^no$"):
        request("get", "c")
    with pytest.raises(SimulationError, match=r"^what$"):
        request("get", "d")
    assert len(answering.sent) == 4
    with pytest.raises(SimulationError, match=r"m: did not return from an access within 0\.01 s\."):
        request("get", "e", timeout=0.01)


@pytest.mark.parametrize(
    ("code", "how"),
    [
        (0, "ended the process with exit code 0"),
        (70, "ended the process with exit code 70"),
        (-11, "crashed with SIGSEGV (Segmentation fault)"),
        (-9, "was killed (SIGKILL) by another process, or by the system for lack of memory"),
    ],
)
def test_the_end_of_the_process_is_told_in_one_line_from_then_on(code, how):
    answering = Answering(None, exit_code=code)
    member = answering.member
    member.log, member._errors = ["one", "two", "three"], deque(["four", "five", "six"])
    with pytest.raises(SimulationError) as caught:
        member._request("get", "a")
    text = str(caught.value)
    assert text == f"m: {how} in an access. Last log: two | three | four | five | six"
    with pytest.raises(SimulationError) as again:
        member._request("get", "a")
    assert (str(again.value), member.crash_text, len(answering.sent)) == (text, text, 1)
    assert member.lost(5 * MS) == text


@pytest.mark.parametrize(("at", "function"), [(640, "fmi2GetReal"), (0, "fmi2DoStep")])
def test_a_process_lost_in_a_step_is_told_with_the_call_and_the_time(at, function):
    answering = Answering((1, "", "late"), None, exit_code=-11)
    member = answering.member
    assert member.lost(5 * MS) == "", "it lives"
    member._channel["is_dead"], member._channel["at"] = 1, at
    text = member.lost(5 * MS)
    assert text == f"m: crashed with SIGSEGV (Segmentation fault) in {function}, in the step from t = 5 ms."
    assert member._answers.empty()


def test_a_process_that_does_not_end_is_killed():
    journal = []

    def wait(*timeout):
        journal.append(("wait", *timeout))
        if timeout:
            raise subprocess.TimeoutExpired("worker", timeout[0])
        return -9

    member = Answering().member
    member._process = SimpleNamespace(wait=wait, kill=lambda: journal.append("kill"))
    assert member._reap(0.5) == -9
    assert journal == [("wait", 0.5), "kill", ("wait",)]


def closing(answer, monkeypatch):
    """Close a member whose process answers so; return its log, and what was done."""
    answering, journal = Answering(), []
    member = answering.member
    member.living = [member]
    monkeypatch.setattr(isolated_member, "CLOSE_TIMEOUT", 0.01)
    if answer is not None:
        member._answers.put((1, *answer))
    member._process = SimpleNamespace(kill=lambda: journal.append("kill"), wait=lambda: journal.append("wait"))
    member._reader = SimpleNamespace(join=lambda: journal.append("join"))
    member._close_ends = lambda: journal.append("close")
    member._inner = SimpleNamespace(release=lambda: journal.append("release"))
    for _ in range(2):
        member.close()
    assert member.living == []
    assert journal == ["kill", "wait", "join", "close", "release"], "once"
    return member.log


def test_closing_ends_the_process_whatever_it_answers(monkeypatch):
    assert closing(("", None), monkeypatch) == []
    assert closing(("SimulationError", "m: close failed"), monkeypatch) == ["close failed"]
    assert closing(None, monkeypatch) == ["did not return from termination within 0.01 s."]


def test_messages_and_errors_of_the_process_are_read_to_the_end():
    member = Answering().member
    member.log, member._is_ready = ["old"], threading.Event()
    member._messages, other = Pipe()
    member._stderr, end = os.pipe()
    for count, failure, value in ((READY, "", None), (3, "", 2.5), *((0, "", f"line {i}") for i in range(25))):
        other.send_bytes(marshal.dumps((count, failure, value)))
    os.write(end, b"\n  \nTraceback\nTypeError: x\n")
    other.close()
    os.close(end)
    member._read_messages()
    assert member._is_ready.is_set()
    assert member.log == [f"line {i}" for i in range(5, 25)]
    assert list(member._errors) == ["Traceback", "TypeError: x"]
    assert [member._answers.get_nowait() for _ in range(2)] == [(3, "", 2.5), None]
    os.close(member._stderr)
    member._messages.close()


def test_shared_memory_is_a_file_that_two_mappings_see():
    with shared_file(8192) as file:
        assert os.fstat(file).st_size == 8192
        first, second = map_memory(file, 8192), map_memory(file, 8192)
    one, other = (np.ctypeslib.as_array((ctypes.c_int64 * 1024).from_address(at)) for at in (first, second))
    assert not one.any()
    one[1023] = 5
    assert other[1023] == 5
    for address in (first, second):
        unmap_memory(address, 8192)
    with pytest.raises(OSError, match="Bad file descriptor"):
        map_memory(-1, 4096)
    with pytest.raises(OSError, match="Bad file descriptor"):
        os.fstat(file)


def test_a_class_that_another_process_cannot_import_is_refused(tmp_path):
    expected = (
        r"m: another process cannot make it: .* Define its class at the top of a module, not of a script or in a "
    )
    with pytest.raises(CouplingError, match=expected):
        pickled(SimpleNamespace(name="m", file=threading.Lock()), tmp_path, None)


@pytest.mark.skipif(not isolated_member.HAS_CORES, reason="the system cannot bind threads to cores")
def test_the_loop_and_a_member_share_a_core_while_they_step():
    before = os.sched_getaffinity(0)
    member = SimpleNamespace(_channel=np.zeros(1, [("loop_core", np.int64)]))
    with IsolatedMember.together([member]):
        bound = os.sched_getaffinity(0)
        assert len(bound) == 1
        assert member._channel["loop_core"][0] in bound
    assert os.sched_getaffinity(0) == before
    with IsolatedMember.together([]):
        assert os.sched_getaffinity(0) == before


def test_a_member_with_clocks_has_memory_for_its_values():
    """The widest type for each scalar, also of strings; then there is room for the calls as of any member."""
    proxy = object.__new__(IsolatedClocks)
    proxy.variables = Inner().variables
    scalars = 1 + 1 + 3 + 1 + 2 + 1
    others = IsolatedMember._memory_size(proxy)
    assert proxy._memory_size() == others + WIDEST * scalars + 64
    with shared_file(proxy._memory_size()) as file:
        proxy._share(file)
    assert proxy._span == (HEAD, HEAD + WIDEST * scalars)
    assert proxy._take(0) == HEAD + -(-WIDEST * scalars // 64) * 64
    assert int(proxy._channel["loop_core"][0]) == int(proxy._channel["own_core"][0]) == -1, "bound to no core"
    assert (proxy.due, proxy.event_time, proxy.ended, proxy.has_jumped) == (None, None, False, False)
