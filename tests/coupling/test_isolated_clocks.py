"""Messages between the loop and the process of an isolated member, here without the process."""

import ctypes
import marshal
from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest

from tests.coupling.test_events import MS, Part
from tests.every_case import every_case
from twin.compiler import machine
from twin.coupling.isolation.isolated_clocks import IsolatedClocks
from twin.coupling.isolation.isolated_worker import (
    CHANNEL,
    HEAD,
    ROW,
    Room,
    Worker,
    from_words,
    to_plain,
    to_words,
    words,
)
from twin.errors import CouplingError, SimulationError

SIZE = HEAD + 4096
pytestmark = pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "read"), reason="a member is isolated by POSIX")


class Inner(Part):
    """A member with clocks whose values lie where its process says."""

    def __init__(self, journal, **options):
        super().__init__("a", journal, **options)
        self.own, self.log, self.values, self.references = {}, [], {}, None

    def slot(self, name):
        if name not in self.own:
            variable = self.variables[name]
            size = variable.size * variable.dtype.itemsize
            values = self.room(size).view(variable.dtype) if variable.connectable else self.texts[name].values
            self.own[name] = SimpleNamespace(variable=variable, values=values, is_input=variable.causality == "input")
        return self.own[name]

    def set(self, name, value):
        self.values[name] = value

    def get(self, name):
        return self.texts[name].values if name in self.texts else self.values[name]

    def save(self):
        return dict(self.values)

    def restore(self, saved):
        self.values = dict(saved)

    def exit_initialization(self):
        self.note("runs")


def isolated(inner):
    """The member's proxy, whose requests are answered at once; all data goes through a message."""
    memory = np.zeros(SIZE // 8 + 8)
    address = -(-int(memory.ctypes.data) // 64) * 64
    worker = Worker(inner, {"gather": 1, "scatter": 2}, address, 5, 6, None, (HEAD, SIZE))
    proxy = object.__new__(IsolatedClocks)
    proxy.name, proxy.variables, proxy.log, proxy.slots = inner.name, inner.variables, [], {}
    proxy._memory, proxy._calls, proxy._phase = address, [], "an access"
    proxy._is_running = proxy._rests = False

    def request(what, *arguments):
        failure, value = marshal.loads(marshal.dumps(worker.answer(*marshal.loads(marshal.dumps((what, arguments))))))
        if failure:
            raise {"CouplingError": CouplingError}.get(failure, SimulationError)(value)
        return value

    proxy._request = request
    proxy.memory = memory
    return proxy, worker


def test_each_call_is_a_message_and_has_the_answer_of_the_member():
    journal = []
    inner = Inner(journal, due=[5 * MS], changes=[True, False], more=[True, False], news=(7 * MS,), fires=True)
    proxy, _ = isolated(inner)
    assert proxy.due_clocks(4 * MS) == []
    assert proxy.due == 5 * MS
    assert proxy.due_clocks(5 * MS) == ["c"]
    assert proxy.due is None
    assert [proxy.has_news(now * MS) for now in (6, 7)] == [False, True]
    proxy.enter_events(7 * MS)
    assert [proxy.tick(name, 7 * MS) for name in ("c", "i")] == [True, False]
    assert [proxy.ticked_clocks() for _ in range(2)] == [["o"], []]
    assert [proxy.evaluate(7 * MS) for _ in range(2)] == [True, False]
    assert [proxy.finish(7 * MS) for _ in range(2)] == [True, False]
    proxy.leave_events()
    assert journal == [
        *("a enters at 7", "a ticks c", "a ticks i", "a evaluates", "a evaluates"),
        *("a finishes", "a finishes", "a leaves"),
    ]


def test_the_begin_of_a_step_is_told_with_the_next_message():
    journal = []
    proxy, _ = isolated(Inner(journal))
    proxy.rest()
    assert journal == []
    proxy.enter_events(MS)
    proxy.enter_events(2 * MS)
    assert journal == ["a rests", "a enters at 1", "a enters at 2"]
    proxy.exit_initialization()
    assert journal[3:] == ["a runs", "a rests"]


def test_times_are_exact_and_ends_and_jumps_come_along():
    inner = Inner([], due=[Fraction(10, 3)])
    proxy, _ = isolated(inner)
    inner.event_time, inner.ended, inner.has_jumped = Fraction(7, 2), False, True
    assert proxy.has_news(0) is False
    assert (proxy.due, proxy.event_time, proxy.ended, proxy.has_jumped) == (
        Fraction(10, 3),
        Fraction(7, 2),
        False,
        True,
    )
    inner.event_time, inner.ended, inner.has_jumped = 9, True, False
    proxy.leave_events()
    assert (proxy.event_time, proxy.ended, proxy.has_jumped) == (9, True, False)


def test_numbers_lie_in_shared_memory_and_texts_go_with_the_messages():
    inner = Inner([], strings=("p", "q"))
    proxy, _ = isolated(inner)
    first, second = proxy.slot("u"), proxy.slot("y")
    assert proxy.slot("u") is first
    first.values[0], second.values[0] = 2.5, 3.5
    assert (inner.slot("u").values.tolist(), inner.slot("y").values.tolist()) == ([2.5], [3.5])
    assert proxy.address("u") == inner.slot("u").values.ctypes.data >= proxy._memory + HEAD
    assert proxy.address("s") == 0
    assert [proxy.slot(name).values.tolist() for name in "sr"] == [["p", "q"]] * 2
    proxy.slot("s").values[:] = "x", "y"
    inner.slot("r").values[:] = "v", "w"
    assert inner.slot("s").values.tolist() == ["p", "q"]
    proxy.has_news(0)
    assert inner.slot("s").values.tolist() == ["x", "y"]
    assert proxy.slot("r").values.tolist() == ["v", "w"], "an input is not overwritten, an output is"


def test_the_loop_moves_values_by_a_call_and_sets_them_while_initializing():
    inner = Inner([])
    proxy, _ = isolated(inner)
    for variable in inner.variables.values():
        object.__setattr__(variable, "references", (len(variable.name) + 10,))
    block = np.array([1.5, 2.5])
    write, read = (proxy.access(["u", "y"], write=write) for write in (True, False))
    assert (write.count, write.size, write.references.tolist()) == (2, 2, [11, 11])
    assert write.call(0, block.ctypes.data) == 0
    assert [inner.slot(name).values[0] for name in "uy"] == [1.5, 2.5]
    assert inner.values == {"u": 1.5, "y": 2.5}
    proxy.exit_initialization()
    block[:] = 7.0, 8.0
    assert write.call(0, block.ctypes.data) == 0
    assert inner.values == {"u": 1.5, "y": 2.5}, "clocked values wait for their clock"
    inner.slot("u").values[0] = 9.0
    assert read.call(0, block.ctypes.data) == 0
    assert block.tolist() == [9.0, 8.0]
    proxy._is_running = False
    inner.set = lambda _name, _value: (_ for _ in ()).throw(CouplingError("a: no."))
    assert write.call(0, block.ctypes.data) == 3
    assert str(proxy.failure) == "a: no."


def test_what_fails_in_an_event_is_kept_for_the_loop():
    inner = Inner([])
    proxy, _ = isolated(inner)
    inner.finish = lambda _: (_ for _ in ()).throw(SimulationError("a: refuses."))
    with pytest.raises(SimulationError, match="a: refuses"):
        proxy.finish(0)
    assert str(proxy.failure) == "a: refuses."
    assert proxy._phase == "an access"
    inner.finish = lambda _: 1 / 0
    with pytest.raises(SimulationError, match=r"a: event failed: .*ZeroDivisionError"):
        proxy.finish(0)


def test_room_for_values_is_eight_byte_a_scalar():
    scalar, vector, none = (SimpleNamespace(size=size) for size in (1, 3, 0))
    assert [IsolatedClocks._room(variable) for variable in (scalar, vector, none)] == [8, 24, 8]
    memory = np.ones(4)
    room = Room(int(memory.ctypes.data), int(memory.ctypes.data) + 24)
    one, two = room.take(8).view(np.float64), room.take(16).view(np.float64)
    one[0], two[:] = 5.0, 6.0
    assert memory.tolist() == [5.0, 6.0, 6.0, 1.0]
    with pytest.raises(AssertionError):
        room.take(1)


@every_case(
    ("value", "plain"),
    [
        (np.float64(2.5), 2.5),
        (np.array([[1, 2], [3, 4]], np.int8), [[1, 2], [3, 4]]),
        (b"\0\1\0", b"\0\1\0"),
        ([b"a\0", "b"], [b"a\0", "b"]),
        (np.True_, True),
    ],
)
def test_values_of_a_message_are_plain_and_whole(value, plain):
    found = to_plain(value)
    assert found == plain
    assert type(found) is type(plain)


@pytest.mark.parametrize("time", [None, 0, -5, Fraction(1, 3)])
def test_times_of_a_message_are_exact(time):
    word = marshal.loads(marshal.dumps(to_words(time)))
    assert from_words(word) == time
    assert from_words("name") == "name"


def test_the_process_answers_requests_and_links_the_rows_of_its_calls():
    inner = Inner([])
    proxy, _ = isolated(inner)
    inner.instance, inner.address = 77, lambda name: 1000 if name == "u" else 2000
    channel = words(proxy._memory, CHANNEL)
    assert (channel["called"], channel["back"]) == (5, 6)
    inner.step_function, inner.step_signature, inner.step_name = 31, machine.FMI2, "fmi2DoStep"
    inner.instantiate = lambda: inner.note("instantiates")
    assert proxy._request("instantiate") == "fmi2DoStep"
    assert (channel["step"], channel["instance"], channel["signature"]) == (31, 77, machine.FMI2)
    rows = [words(proxy._memory + offset, ROW) for offset in (512, 1024)]
    assert proxy._request("access", ["u", "y"], True, 512) == (2, 2, "access")
    assert proxy._request("access", ["u"], False, 1024) == (1, 1, "access")
    assert [int(row["function"][0]) for row in rows] == [2, 1]  # scatter, gather
    assert [int(row["instance"][0]) for row in rows] == [77, 77]
    assert [int(row["next"][0]) for row in rows] == [1024, 0]
    assert int(channel["rows"][0]) == 512
    pieces = np.ctypeslib.as_array((ctypes.c_int64 * 4).from_address(int(rows[0]["references"][0])))
    assert pieces.tolist() == [1000, 8, 2000, 8]
    inner.values = {"u": 1.0}
    proxy._request("save")
    inner.values["u"] = 2.0
    proxy._request("restore")
    assert proxy._request("get", "u") == 1.0
    with pytest.raises(SimulationError, match=r"a: get failed: .*KeyError"):
        proxy._request("get", "z")
