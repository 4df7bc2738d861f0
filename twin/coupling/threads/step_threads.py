"""Threads that step members of a stage at the same time (step_threads.c); results are those of one thread, to the bit.

A block is the members that one operation of the loop steps: their inputs are set before and their outputs read after all
of its steps, so the order of the steps does not matter. Threads are started after the members are initialized, so that
they inherit the floating-point environment of the loop's thread. They only run members' steps, never Python.
"""

from __future__ import annotations

import ctypes
import os
import threading
import time
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import compiler
from twin.compiler import machine
from twin.coupling.isolation.isolated_member import IsolatedMember
from twin.coupling.isolation.isolated_worker import system_calls, words

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from twin.coupling.execution.loop_tables import Tables
    from twin.coupling.execution.plan import LoopPlan
    from twin.coupling.member import Member
    from twin.coupling.system import ResolvedConnection

SOURCE = Path(__file__).with_name("step_threads.c")
IS_AVAILABLE = os.name == "posix"  # native code reads and writes pipes
FUNCTIONS = ("block_step", "block_work", "block_end")

# the structs of step_threads.c, in words
POOL = (
    *("read", "write", "clock_gettime", "clock", "wake", "wakened", "ended", "ending", "at"),
    *("block", "generation", "waiting", "loop_waits", "is_over"),
)
TASK = ("block", "function", "signature", "instance", "flags", "begin", "status", "calls", "least")
BLOCK = ("pool", "tasks", "count", "local_count", "mode", "t", "h", "is_final", "first", "next", "pending")

EXPENSIVE = 30_000  # time of a step from which a thread pays [ns]
EXPENSIVE_ISOLATED = 200_000  # of a member in another process: including the exchange between two cores [ns]
MEASURED_STEPS = 3  # least number of measured steps per member


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@lru_cache(maxsize=4)
def native(build: Path) -> dict[str, int]:
    """Compile step_threads.c; return the addresses of its functions."""
    sources = compiler.Sources("step_threads", "", SOURCE.read_text(encoding="utf-8"))
    return dict(zip(FUNCTIONS, compiler.load_symbols(sources, build, FUNCTIONS), strict=True))


def merge_independent_stages(
    order: list[list[str]], links: list[ResolvedConnection], concurrent: Collection[str]
) -> list[list[str]]:
    """Merge stages whose members do not depend on each other's new outputs, so that a stage has several members.

    A member follows all stages whose outputs it takes, and does not precede a stage that takes its outputs of the step
    before. Members that are not `concurrent` keep their order, since they may share more than connections.
    """
    stage_of = {name: i for i, stage in enumerate(order) for name in stage}
    ends = [(stage_of[link.source.member], stage_of[link.target.member]) for link in links]
    levels: list[int] = []
    last_serial = 0
    for i, stage in enumerate(order):
        forward_levels = [levels[source] + 1 for source, target in ends if target == i and source < i]
        feedback_levels = [levels[target] for source, target in ends if source == i and target < i]
        level = max([0, *forward_levels, *feedback_levels])
        if not all(name in concurrent for name in stage):
            level = last_serial = max(level, last_serial)
        levels.append(level)
    return [
        [name for i, stage in enumerate(order) if levels[i] == level for name in stage]
        for level in range(max(levels, default=-1) + 1)
    ]


def stages(
    order: list[list[str]], links: list[ResolvedConnection], members: Mapping[str, Member], threads: int | None
) -> list[list[str]]:
    """Return the stages for a number of threads."""
    if not is_usable(members, threads):
        return order
    return merge_independent_stages(order, links, [name for name, member in members.items() if member.concurrent])


def is_usable(members: Mapping[str, Member], threads: int | None) -> bool:
    """Whether threads may be used: at least two members can, and events do not interrupt the loop."""
    is_enough = sum(member.concurrent for member in members.values()) > 1
    return IS_AVAILABLE and threads != 1 and is_enough and not any(member.clocked for member in members.values())


def start(
    plan: LoopPlan, tables: Tables, members: Mapping[str, Member], record: Any, threads: int | None, build: Path
) -> SerialSteps:
    """Return the blocks of a plan, if threads may be used; else none."""
    if not is_usable(members, threads):
        return SerialSteps()
    return StepThreads(plan, tables, members, record, threads, build)


class SerialSteps:
    """Members stepped one after the other."""

    is_measuring = False  # whether it is still to be decided which members are worth a thread
    overlaps_isolated = (
        False  # whether members in processes of their own step at the same time: they must not share a core
    )

    def __init__(self) -> None:
        self.calls: dict[int, tuple[str, str]] = {}  # names of the members of a block, by its address

    def decide(self) -> None:
        """Decide from the measured steps which members are worth a thread; the others are stepped as without threads."""

    def close(self) -> None:
        """End the threads. Safe to call twice."""


class StepThreads(SerialSteps):
    """Blocks of the steps of a plan, and the threads that step them. Must outlive the loop; `close` ends the threads.

    `threads`: largest number of threads, the loop's own included; None: from the cost of the members in the first steps,
    at most one per core. `record`: of the loop.
    """

    def __init__(
        self,
        plan: LoopPlan,
        tables: Tables,
        members: Mapping[str, Member],
        record: Any,
        threads: int | None,
        build: Path,
    ) -> None:
        super().__init__()
        self._plan, self._rows, self._threads = plan, tables.arrays["steps"], threads
        self._members = list(members.values())
        self._build = build
        self._workers: list[threading.Thread] = []
        self._pipes: list[int] = []
        self._pool = np.zeros(len(POOL), np.int64)
        self._pool_words = words(int(self._pool.ctypes.data), POOL)[0:1]
        for name, address in system_calls(["read", "write", "clock_gettime"]).items():
            self._pool_words[name] = address
        self._pool_words["clock"] = time.CLOCK_MONOTONIC
        self._pool_words["at"] = record.ctypes.data + record.dtype.fields["at"][1]
        self._memory: dict[int, np.ndarray[Any, Any]] = {}  # of the blocks, by address
        self._measured: dict[int, list[int]] = {}  # rows by block, until it is decided
        self._blocks: dict[int, tuple[Any, Any]] = {}  # blocks in use: its words and its tasks
        ranges = dict.fromkeys(operation["steps"] for operation in plan.stepping_operations() if "steps" in operation)
        for begin, end in ranges:
            rows = [row for row in range(begin, end) if self._members[plan.steps[row][-1]].concurrent]
            if len(rows) > 1:
                self._make_block(rows, np.zeros(len(BLOCK) + len(TASK) * len(rows), np.int64), threads is None)
        self.is_measuring = bool(self._measured)
        if not self.is_measuring:
            self._start()

    def _make_block(self, rows: list[int], memory: np.ndarray[Any, Any], is_measured: bool) -> None:
        """Step the members of some rows as a block, in `memory`. A crash names the members of the first block there."""
        isolated = [row for row in rows if isinstance(self._member(row), IsolatedMember)]
        order = [row for row in rows if row not in isolated] + isolated
        address = int(memory.ctypes.data)
        self._memory[address] = memory
        block = words(address, BLOCK)[0:1]
        tasks = [words(address + 8 * (len(BLOCK) + len(TASK) * i), TASK)[0:1] for i in range(len(rows))]
        block["pool"], block["tasks"] = self._pool.ctypes.data, address + 8 * len(BLOCK)
        block["count"], block["local_count"], block["mode"] = len(rows), len(rows) - len(isolated), not is_measured
        for row, task in zip(order, tasks, strict=True):
            function, signature, instance, flags = self._plan.steps[row][:4]
            task["block"], task["function"], task["signature"] = address, function, signature
            task["instance"], task["flags"] = instance, flags
            member = self._member(row)
            if isinstance(member, IsolatedMember):
                task["begin"], task["function"] = member.halves
            if row == rows[0]:
                block["first"] = task.ctypes.data
            self._rows[row, :3] = native(self._build)["block_step"], machine.FMI3, task.ctypes.data
        names = " or ".join(self._member(row).name for row in rows)
        self.calls.setdefault(address, (names, "a step at the same time as the others (threads: off tells which)"))
        self._blocks[address] = block, tasks
        if is_measured:
            self._measured[address] = order

    def _member(self, row: int) -> Member:
        return self._members[self._plan.steps[row][-1]]

    def decide(self) -> None:
        """Replace each measured block by one of its expensive members; start the threads once all are replaced."""
        for address, order in list(self._measured.items()):
            _, tasks = self._blocks[address]
            if min(int(task["calls"][0]) for task in tasks) < MEASURED_STEPS:
                continue
            del self._measured[address], self._blocks[address]
            expensive = [row for row, task in zip(order, tasks, strict=True) if self._is_expensive(row, task)]
            for row in order:
                self._rows[row, :3] = self._plan.steps[row][:3]
            is_isolated = [isinstance(self._member(row), IsolatedMember) for row in expensive]
            if len(expensive) > 1 and (any(is_isolated) or cores() > 1):
                memory = self._memory[address]  # the address that crash reports know
                memory[:] = 0
                self._make_block(sorted(expensive), memory, is_measured=False)
        self.is_measuring = bool(self._measured)
        if not self._measured:
            self._start()

    def _is_expensive(self, row: int, task: Any) -> bool:
        # The least time: what other processes interrupt is not the member's cost.
        limit = EXPENSIVE_ISOLATED if isinstance(self._member(row), IsolatedMember) else EXPENSIVE
        return bool(task["least"][0] >= limit)

    def _start(self) -> None:
        """Start as many threads as the largest block can use."""
        largest = max((int(block["local_count"][0]) for block, _ in self._blocks.values()), default=0)
        self.overlaps_isolated = any(block["count"][0] > block["local_count"][0] for block, _ in self._blocks.values())
        count = min(largest, cores() if self._threads is None else self._threads) - 1
        if count < 1:
            return
        (self._pool_words["wakened"], self._pool_words["wake"]) = wake = os.pipe()
        (self._pool_words["ending"], self._pool_words["ended"]) = end = os.pipe()
        self._pipes = [*wake, *end]
        work = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p)(native(self._build)["block_work"])
        for i in range(count):
            thread = threading.Thread(target=work, args=(self._pool.ctypes.data,), name=f"steps {i + 2}", daemon=True)
            thread.start()
            self._workers.append(thread)

    def close(self) -> None:
        """End the threads and close their pipes. Safe to call twice."""
        if self._workers:
            ctypes.CFUNCTYPE(None, ctypes.c_void_p)(native(self._build)["block_end"])(self._pool.ctypes.data)
        for thread in self._workers:
            thread.join()
        for end in self._pipes:
            os.close(end)
        self._workers, self._pipes = [], []
