"""A node-ID that is taken or free, and real-time settings of a process, as far as the system allows them."""

from types import SimpleNamespace

import pytest

from hw_bridge.bus import Frame
from hw_bridge.wire import assert_node_id_free, node_id_check, realtime
from hw_bridge.wire.link import Arrival
from tests.hw_bridge.wire.clock import Clock
from twin.errors import SimulationError


class Bench:
    """A link on which a node answers with one frame after some milliseconds."""

    def __init__(self, clock, answer, after):
        self.clock, self.answer, self.due = clock, answer, clock.ns + after * 1_000_000
        self.sent = []

    def send(self, frame):
        self.sent.append(frame)

    def hear(self, timeout):
        end = self.clock.ns + round(timeout * 1e9)
        if self.answer is not None and self.due <= end:
            self.clock.ns, answer, self.answer = max(self.due, self.clock.ns), self.answer, None
            return [Arrival(None), Arrival(answer)]
        self.clock.ns = end
        return []


@pytest.mark.parametrize("identifier", [0x083, 0x183, 0x283, 0x383, 0x483, 0x583, 0x703])
def test_a_node_id_that_is_taken(monkeypatch, identifier):
    clock = Clock(monkeypatch, node_id_check)
    with pytest.raises(
        SimulationError, match=rf"^node 3: another node answers on this ID \({identifier:03X}#\)\. Choose another ID"
    ):
        assert_node_id_free(Bench(clock, Frame(identifier), 499), 3)


@pytest.mark.parametrize(("identifier", "after"), [(0x584, 1), (0x603, 1), (0x203, 1), (0x080, 1), (0x583, 501)])
def test_a_node_id_that_is_free(monkeypatch, identifier, after):
    clock = Clock(monkeypatch, node_id_check)
    begin, bench = clock.ns, Bench(clock, Frame(identifier), after)
    assert_node_id_free(bench, 3)
    assert clock.ns - begin == pytest.approx(500_000_000, abs=10)
    assert bench.sent == [
        Frame(0x603, bytes([0x40, *address, 0, 0, 0, 0]))
        for address in ([0, 0x10, 0], [0x18, 0x10, 1], [0x18, 0x10, 2])
    ]


class System:
    """The scheduler and the memory of a system that allows this or not."""

    SCHED_FIFO, SCHED_OTHER = 1, 0

    def __init__(self, priority, memory):
        self.priority, self.memory, self.calls = priority, memory, []

    def sched_param(self, priority):
        return priority

    def sched_setscheduler(self, process, policy, priority):
        self.calls.append((process, policy, priority))
        if not self.priority:
            raise PermissionError

    def CDLL(self, _name):  # noqa: N802 - of ctypes
        return self

    def mlockall(self, flags):
        self.calls.append(("lock", flags))
        return 0 if self.memory else -1

    def munlockall(self):
        self.calls.append(("unlock",))


@pytest.mark.parametrize(("priority", "memory"), [(True, True), (True, False), (False, True)])
@pytest.mark.parametrize("collects", [True, False])
def test_real_time_ends_as_it_began(monkeypatch, priority, memory, collects):
    system, collector = System(priority, memory), SimpleNamespace(calls=[], isenabled=lambda: collects)
    for name in ("collect", "disable", "enable", "freeze"):
        monkeypatch.setattr(collector, name, lambda *a, name=name: collector.calls.append((name, *a)), raising=False)
    monkeypatch.setattr(realtime, "os", system)
    monkeypatch.setattr(realtime, "ctypes", system)
    monkeypatch.setattr(realtime, "gc", collector)
    scope = realtime.RealtimeScope(realtime.MASTER)
    assert (scope.real_time, scope.locked) == (priority, False)
    allowed = priority and memory
    assert [scope.lock(), scope.lock(), scope.locked] == [allowed] * 3
    scope.end()
    locks = [("lock", 3)] * (0 if not priority else 1 if memory else 2)
    assert system.calls == [(0, 1, 20), *locks, *[(0, 0, 0)] * priority, *[("unlock",)] * allowed]
    assert collector.calls == [("collect", 1), ("disable",), *[("enable",)] * collects]
    system.calls.clear()
    collector.calls.clear()
    assert realtime.freeze_gc_and_set_fifo() is allowed
    assert collector.calls == [("collect",), ("freeze",)]
    assert system.calls == [(0, 1, 10), *[("lock", 3)] * priority]


def test_a_system_without_real_time(monkeypatch):
    monkeypatch.setattr(realtime, "os", SimpleNamespace())
    assert realtime.set_fifo_priority(1) is False
    monkeypatch.setattr(realtime, "ctypes", SimpleNamespace(CDLL=lambda _: SimpleNamespace()))
    assert realtime.lock() is False
