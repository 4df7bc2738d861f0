"""Computing time of the loop's operations: what is measured, how often, and that results stay what they are."""

import sys
import time
from types import SimpleNamespace

import numpy as np
import pytest

from tests.coupling.parts import Clock, Lag, SlowHold, couple
from twin.coupling import Stopwatch
from twin.coupling.execution import loop
from twin.coupling.execution.profiler import clock_address, split_operation
from twin.errors import CouplingError

MS = 1_000_000
pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the clock is Linux's")


def table(*rows, columns):
    return np.array(rows or [[0] * columns], np.int64)


def test_an_operation_is_split_into_copies_and_calls_each_with_its_member():
    accesses = table([1, 2, 3, 4, 5, 6, 20], [1, 2, 3, 4, 5, 6, 21], columns=7)
    steps = table([7, 0, 8, 9, 0, 0, 10], [7, 0, 8, 9, 77, 2, 11], columns=7)
    arrays = {"accesses": accesses, "steps": steps}
    get, step = int(accesses.ctypes.data), int(steps.ctypes.data)
    operation = np.array([5, 1, 99, 30, 2, 40, 0, get, 2, step, 2], np.int64)
    assert split_operation(operation, arrays) == [
        ("copies", None, [5, 1, 99, 30, 2, 40, 0, 0, 0, 0, 0]),
        ("accesses", 20, [5, 1, 99, 0, 0, 0, 0, get, 1, 0, 0]),
        ("accesses", 21, [5, 1, 99, 0, 0, 0, 0, get + 56, 1, 0, 0]),
        ("steps", 10, [5, 1, 99, 0, 0, 0, 0, 0, 0, step, 1]),
        ("steps", 11, [5, 1, 99, 0, 0, 0, 0, 0, 0, step + 56, 1]),
        ("accesses", 11, [5, 1, 99, 0, 0, 0, 0, 77, 2, 0, 0]),
    ]
    assert steps[:, loop.STEP.index("get_count")].tolist() == [0, 0], "they are read once"
    operation[4], operation[6] = 0, 3
    assert split_operation(operation, arrays)[0] == ("copies", None, [5, 1, 99, 30, 0, 40, 3, 0, 0, 0, 0])
    operation[6] = 0
    assert [kind for kind, _, _ in split_operation(operation, arrays)] == ["accesses"] * 2 + ["steps"] * 2


def test_the_clock_is_read_twice_then_after_each_piece(build):
    """The operations of a fast and a slow member, cut into copies, steps and publication."""
    parts = {"clock": Clock(), "slow": SlowHold()}
    simulated = couple(build, parts, ["clock.y -> slow.u"], "gauss_seidel")
    simulated.initialize(0, 20 * MS)
    before = simulated.plan.operation_rows(simulated._tables.arrays)
    watch = Stopwatch(simulated)
    simulated.terminate()
    pieces = [piece for row in before for piece in split_operation(row, simulated._tables.arrays)]
    assert watch.kinds == [kind for kind, _, _ in pieces] == ["steps", "copies", "steps", "copies"]
    assert watch.members == [0, -1, 1, -1]
    assert watch.dividers.tolist() == [1, 10, 10, 10]
    assert watch._shifts.tolist() == [0, 0, 0, 1], "what a slow member publishes is due at the end of its period"
    rows = watch._operations.tolist()
    assert (int(simulated.state["operations"]), int(simulated.state["operation_count"])) == (
        watch._operations.ctypes.data,
        2 * 4 + 2,
    )
    assert rows[2::2] == [row for *_, row in pieces]
    readings = watch._readings
    assert [rows[0], *rows[1::2]] == [[1, 0, 0, 0, 0, 0, 0, int(reading.ctypes.data), 1, 0, 0] for reading in readings]
    address, stamps = clock_address(), watch._stamps.ctypes.data
    assert readings.tolist() == [[address, 1, stamps + 16 * i, 0, 0, 0, 0] for i in range(6)]
    assert (watch.stride, watch.sampled, watch.ticks, watch.wall, watch.overheads) == (7, 0, 0, 0.0, [])
    assert watch.durations_ns.tolist() == watch.done.tolist() == [0] * 4


def run(build, measured, stop=100 * MS):
    parts = {"clock": Clock(), "lag": Lag(x=1.0), "slow": SlowHold()}
    simulated = couple(build, parts, ["clock.y -> slow.u", "lag.y -> lag.u"])
    simulated.initialize(0, stop)
    watch = Stopwatch(simulated) if measured else None
    if watch:
        simulated.state["stop"], begin = stop // MS, time.perf_counter()
        assert watch.run(simulated._record.ctypes.data) == loop.DONE
        assert watch.wall < time.perf_counter() - begin
    simulated.advance(stop)
    simulated.terminate()
    return watch, {name: signal.tolist() for name, signal in simulated.recording().signals.items()}


def test_a_measured_run_computes_the_same(build):
    """100 steps are sampled every 7th; the member of 10 ms steps in every 10th of them."""
    watch, signals = run(build, measured=True)
    assert signals == run(build, measured=False)[1]
    assert watch.names == ["clock", "lag", "slow"]
    assert (watch.stride, watch.ticks, watch.sampled, len(watch.overheads)) == (7, 100, 14, 14)
    done = dict(zip(zip(watch.kinds, watch.members, strict=True), watch.done.tolist(), strict=True))
    assert {member: done["steps", member] for member in range(3)} == {0: 14, 1: 14, 2: 2}  # ticks 20 and 90
    assert watch.dividers[watch.members.index(2)] == 10
    assert watch.overhead > 0.0
    assert (watch.per_tick() >= 0.0).all()
    assert (watch.durations_ns > 0).sum() >= 3
    assert watch.wall > watch.durations_ns.sum() * 1e-9


def test_the_time_of_a_piece_is_that_of_its_steps_less_that_of_the_clock():
    """Stamps before the first piece, twice, and after each piece: seconds and nanoseconds."""
    watch = Stopwatch.__new__(Stopwatch)
    watch._stamps = np.array([[0, 999_999_990], [1, 0], [1, 110], [2, 0]], np.int64)
    watch._shifts, watch.dividers = np.array([0, 1]), np.array([1, 3])
    watch.durations_ns, watch.done = np.zeros(2, np.int64), np.zeros(2, np.int64)
    watch.sampled, watch.overheads = 0, []
    assert watch.overhead == 0.0
    assert watch.per_tick().tolist() == [0.0, 0.0]
    watch.add_sample(2)
    assert (watch.durations_ns.tolist(), watch.done.tolist(), watch.overheads) == ([110, 999_999_890], [1, 1], [10])
    watch.add_sample(3)  # the second piece is due at the end of every third step
    assert (watch.durations_ns.tolist(), watch.done.tolist(), watch.sampled) == ([220, 999_999_890], [2, 1], 2)
    assert watch.overhead == pytest.approx(1e-8)
    assert watch.per_tick() == pytest.approx([100e-9, 999_999_880e-9 / 2])
    watch.overheads = [1000, 1000, 10]
    assert watch.per_tick()[0] == 0.0, "never negative"


def test_samples_do_not_fall_on_the_steps_of_a_slow_member_alone(build):
    parts = {"clock": Clock(), "slow": SlowHold()}
    simulated = couple(build, parts, ["clock.y -> slow.u"], periods={"clock": MS, "slow": 70 * MS}, step=MS)
    simulated.initialize(0, 80 * MS)
    assert Stopwatch(simulated).stride == 11
    simulated.terminate()


def test_steps_that_are_repeated_are_not_measured():
    simulated = SimpleNamespace(algorithm=SimpleNamespace(is_plain=False, __str__=lambda _: "iterative"))
    with pytest.raises(CouplingError, match=r"profile: .* repeats or divides steps. Measure .* --set algorithm=jacobi"):
        Stopwatch(simulated)
