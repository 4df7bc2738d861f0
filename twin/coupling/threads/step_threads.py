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
from twin.process import cores

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from twin.coupling.execution.loop_tables import Tables
    from twin.coupling.execution.plan import LoopPlan
    from twin.coupling.member import Member
    from twin.coupling.system import ResolvedConnection

SOURCE = Path(__file__).with_name("step_threads.c")
IS_AVAILABLE = os.name == "posix"  # native code waits for conditions of pthread
FUNCTIONS = ("block_step", "block_work", "block_end")

# the structs of step_threads.c, in words
POOL = (
    *("pthread_mutex_lock", "pthread_mutex_unlock", "pthread_cond_broadcast", "pthread_cond_wait", "clock_gettime"),
    *("clock", "mutex", "start", "end", "at", "block", "generation", "waiting", "loop_waits", "is_over"),
)
TASK = ("block", "function", "signature", "instance", "flags", "begin", "status", "calls", "least")
BLOCK = ("pool", "tasks", "count", "local_count", "mode", "t", "h", "is_final", "first", "next", "pending")

EXPENSIVE = 30_000  # time of a step from which a thread pays [ns]
EXPENSIVE_ISOLATED = 200_000  # of a member in another process: including the exchange between two cores [ns]
MEASURED_STEPS = 3  # least number of measured steps per member
FIRST_STEP_FACTOR = 2  # a first step so many times as long as an expensive one: the next are measured at the same time
MEASURE_SERIAL, MEASURE, RUN = range(3)  # modes of a block
LOCK_WORDS = 16  # of a mutex or a condition, more than any platform needs


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
        self._pool = np.zeros(len(POOL), np.int64)
        self._pool_words = words(int(self._pool.ctypes.data), POOL)[0:1]
        for name, address in system_calls(POOL[:5]).items():
            self._pool_words[name] = address
        self._locks = np.zeros((3, LOCK_WORDS), np.int64)
        for name, lock in zip(("mutex", "start", "end"), self._locks, strict=True):
            self._pool_words[name] = address = lock.ctypes.data
            initialize = "pthread_mutex_init" if name == "mutex" else "pthread_cond_init"
            getattr(ctypes.CDLL(None), initialize)(ctypes.c_void_p(address), None)
        self._pool_words["clock"] = time.CLOCK_MONOTONIC
        self._pool_words["at"] = record.ctypes.data + record.dtype.fields["at"][1]
        self._memory: dict[int, np.ndarray[Any, Any]] = {}  # of the blocks, by address
        self._measured: dict[int, list[int]] = {}  # rows by block, until it is decided
        self._blocks: dict[int, tuple[Any, Any]] = {}  # blocks in use: its words and its tasks
        ranges = dict.fromkeys(operation["steps"] for operation in plan.stepping_operations() if "steps" in operation)
        for begin, end in ranges:
            rows = [row for row in range(begin, end) if self._members[plan.steps[row][-1]].concurrent]
            if len(rows) > 1:
                memory = np.zeros(len(BLOCK) + len(TASK) * len(rows), np.int64)
                self._make_block(rows, memory, MEASURE_SERIAL if threads is None else RUN)
        self.is_measuring = bool(self._measured)
        self._start()

    def _make_block(self, rows: list[int], memory: np.ndarray[Any, Any], mode: int) -> None:
        """Step the members of some rows as a block, in `memory`; threads take them in this order.

        A crash names the members of the first block in this memory.
        """
        order = sorted(rows, key=self._is_isolated)
        address = int(memory.ctypes.data)
        self._memory[address] = memory
        block = words(address, BLOCK)[0:1]
        tasks = [words(address + 8 * (len(BLOCK) + len(TASK) * i), TASK)[0:1] for i in range(len(rows))]
        block["pool"], block["tasks"] = self._pool.ctypes.data, address + 8 * len(BLOCK)
        block["count"], block["local_count"] = len(rows), len(rows) - sum(map(self._is_isolated, rows))
        block["mode"] = mode
        for row, task in zip(order, tasks, strict=True):
            function, signature, instance, flags = self._plan.steps[row][:4]
            task["block"], task["function"], task["signature"] = address, function, signature
            task["instance"], task["flags"] = instance, flags
            member = self._member(row)
            if isinstance(member, IsolatedMember):
                task["begin"], task["function"] = member.halves
            if row == min(rows):
                block["first"] = task.ctypes.data
            self._rows[row, :3] = native(self._build)["block_step"], machine.FMI3, task.ctypes.data
        names = " or ".join(self._member(row).name for row in sorted(rows))
        self.calls.setdefault(address, (names, "a step at the same time as the others (threads: off tells which)"))
        self._blocks[address] = block, tasks
        if mode != RUN:
            self._measured[address] = order

    def _member(self, row: int) -> Member:
        return self._members[self._plan.steps[row][-1]]

    def _is_isolated(self, row: int) -> bool:
        return isinstance(self._member(row), IsolatedMember)

    def decide(self) -> None:
        """Decide for each measured block, between two calls of the loop, which of its members are worth a thread.

        Members whose first steps are clearly expensive are measured at the same time. Threads are started when a block
        can use them.
        """
        for address, order in list(self._measured.items()):
            block, tasks = self._blocks[address]
            calls = min(int(task["calls"][0]) for task in tasks)
            if calls >= MEASURED_STEPS:
                self._keep_expensive(address)
            elif calls > 0 and cores() > 1 and not any(map(self._is_isolated, order)):
                clearly = sum(
                    self._is_expensive(row, task, FIRST_STEP_FACTOR) for row, task in zip(order, tasks, strict=True)
                )
                block["mode"] = MEASURE if clearly > 1 else MEASURE_SERIAL
        self.is_measuring = bool(self._measured)
        self._start()

    def _keep_expensive(self, address: int) -> None:
        """Replace a measured block by one of its expensive members, the longest steps first."""
        order, (_, tasks) = self._measured.pop(address), self._blocks.pop(address)
        times = {row: int(task["least"][0]) for row, task in zip(order, tasks, strict=True)}
        expensive = [row for row, task in zip(order, tasks, strict=True) if self._is_expensive(row, task)]
        for row in order:
            self._rows[row, :3] = self._plan.steps[row][:3]
        if len(expensive) > 1 and (any(map(self._is_isolated, expensive)) or cores() > 1):
            memory = self._memory[address]  # the address that crash reports know
            memory[len(BLOCK) :] = 0  # A thread that is late may read the counters of the block.
            self._make_block(sorted(expensive, key=lambda row: -times[row]), memory, RUN)

    def _is_expensive(self, row: int, task: Any, factor: int = 1) -> bool:
        # The least time: what other processes interrupt is not the member's cost.
        return bool(task["least"][0] >= factor * (EXPENSIVE_ISOLATED if self._is_isolated(row) else EXPENSIVE))

    def _start(self) -> None:
        """Start the threads that the largest block can use and that do not run yet."""
        blocks = [block for block, _ in self._blocks.values() if block["mode"][0] != MEASURE_SERIAL]
        largest = max((int(block["local_count"][0]) for block in blocks), default=0)
        self.overlaps_isolated = any(block["count"][0] > block["local_count"][0] for block in blocks)
        missing = range(len(self._workers), min(largest, self._threads or cores()) - 1)
        if not missing:
            return
        work = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p)(native(self._build)["block_work"])
        for i in missing:
            thread = threading.Thread(target=work, args=(self._pool.ctypes.data,), name=f"steps {i + 2}", daemon=True)
            thread.start()
            self._workers.append(thread)

    def close(self) -> None:
        """End the threads. Safe to call twice."""
        if self._workers:
            ctypes.CFUNCTYPE(None, ctypes.c_void_p)(native(self._build)["block_end"])(self._pool.ctypes.data)
        for thread in self._workers:
            thread.join()
        self._workers = []
