"""Which members step at the same time: stages that are merged, blocks of steps in memory, members that are worth a thread."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.coupling.test_plan import STEP, Fake, planned, variable
from tests.every_case import every_case
from twin.coupling import IsolatedMember
from twin.coupling.execution import loop
from twin.coupling.execution.loop_tables import Tables
from twin.coupling.isolation.isolated_worker import words
from twin.coupling.threads import step_threads
from twin.coupling.threads.step_threads import (
    BLOCK,
    EXPENSIVE,
    EXPENSIVE_ISOLATED,
    FIRST_STEP_FACTOR,
    MEASURE,
    MEASURE_SERIAL,
    MEASURED_STEPS,
    RUN,
    TASK,
    SerialSteps,
    StepThreads,
    is_usable,
    merge_independent_stages,
    start,
)

pytestmark = pytest.mark.skipif(not step_threads.IS_AVAILABLE, reason="threads need POSIX")


def links(*wires):
    return [
        SimpleNamespace(source=SimpleNamespace(member=a), target=SimpleNamespace(member=b))
        for a, b in (wire.split(" ") for wire in wires)
    ]


@every_case(
    ("order", "wires", "serial", "merged"),
    [
        ("", [], "", []),
        ("a", [], "", ["a"]),
        ("a b c", [], "", ["abc"]),
        ("a b c", ["a b", "b c"], "", ["a", "b", "c"]),
        ("a b c", ["a c"], "", ["ab", "c"]),
        ("a b c", ["b c"], "", ["ab", "c"]),
        ("a b c", ["c a"], "", ["abc"]),  # "a" takes what "c" gave before: not after it
        ("a b c", ["a b", "c b"], "", ["a", "bc"]),
        ("a b c", ["a a"], "", ["abc"]),
        ("ab c", ["a c"], "", ["ab", "c"]),
        ("a b c", [], "ab", ["abc"]),  # those that share more than connections stay in order within a stage
        ("a b c d", ["a b"], "bd", ["ac", "bd"]),
        ("a b c d", ["a b", "b c"], "cd", ["a", "b", "cd"]),
    ],
)
def test_stages_are_merged_unless_a_member_needs_what_another_one_computes(order, wires, serial, merged):
    stages = [list(stage) for stage in order.split()]
    concurrent = [name for stage in stages for name in stage if name not in serial]
    found = merge_independent_stages(stages, links(*wires), concurrent)
    assert ["".join(stage) for stage in found] == merged


@pytest.mark.parametrize(
    ("concurrent", "clocked", "threads", "usable"),
    [("ab", "", None, True), ("ab", "", 2, True), ("ab", "", 1, False), ("a", "", 2, False), ("ab", "b", 2, False)],
)
def test_threads_need_two_members_that_may_and_no_clocks(concurrent, clocked, threads, usable, build):
    members = {n: SimpleNamespace(concurrent=n in concurrent, clocked=n in clocked) for n in "ab"}
    assert is_usable(members, threads) is usable
    order = [["a"], ["b"]]
    assert step_threads.stages(order, [], members, threads) == ([["a", "b"]] if usable else order)
    if not usable:
        assert type(start(None, None, members, None, threads, build)) is SerialSteps


class Concurrent(Fake):
    concurrent, clocked = True, False


class Isolated(Concurrent, IsolatedMember):
    """A member in a process of its own, of which only the halves of a step are needed."""

    halves = 501, 502

    def __new__(cls, *_arguments, **_options):
        return object.__new__(cls)


def blocks(build, kinds, threads):
    """Blocks of members "a", "b", ...: concurrent (c), isolated (i) or serial (s)."""
    classes = {"c": Concurrent, "i": Isolated, "s": Concurrent}
    members = {}
    for number, kind in enumerate(kinds):
        name = "abcde"[number]
        members[name] = classes[kind](number, variable("y", "output"), base=400 + 100 * number)
        members[name].name, members[name].concurrent = name, kind != "s"
    plan = planned(members, [])
    tables = Tables(plan, members)
    record = np.zeros(1, loop.RECORD)
    made = StepThreads(plan, tables, members, record, threads, build)
    made.kept = record, tables
    return made, tables.arrays["steps"]


def fields(made, address, names, count=1):
    """Words of a block, or of its tasks."""
    rows = [words(address + 8 * len(names) * i, names)[0] for i in range(count)]
    return [{name: int(row[name]) for name in names} for row in rows]


def test_a_block_has_the_members_in_other_processes_last(build):
    made, steps = blocks(build, "sicc", 1)
    ((address, (names, _)),) = made.calls.items()
    assert names == "b or c or d"
    (block,) = fields(made, address, BLOCK)
    first = address + 8 * len(BLOCK)
    size = 8 * len(TASK)
    assert {name: block[name] for name in ("tasks", "count", "local_count", "mode", "first")} == {
        "tasks": first,
        "count": 3,
        "local_count": 2,
        "mode": RUN,
        "first": first + 2 * size,  # that of "b", whose step is the first of the loop
    }
    assert block["pool"] == made._pool.ctypes.data
    tasks = fields(made, first, TASK, 3)
    assert [task["instance"] for task in tasks] == [12, 13, 11]
    assert [task["function"] for task in tasks] == [STEP + 2, STEP + 3, 502]
    assert [task["begin"] for task in tasks] == [0, 0, 501]
    assert [task["flags"] for task in tasks] == [made._plan.steps[row][3] for row in (2, 3, 1)]
    assert all(task["block"] == address and task["signature"] == 5 for task in tasks)
    function = step_threads.native(build)["block_step"]
    assert steps[:, 0].tolist() == [STEP, function, function, function]
    assert steps[1:, 2].tolist() == [first + 2 * size, first, first + size]
    assert steps[0, 2] == 10, "steps by itself"
    assert (made.overlaps_isolated, made.is_measuring, made._workers) == (True, False, [])
    made.close()


@pytest.mark.parametrize("kinds", ["cc", "ccc"])
def test_as_many_threads_are_started_as_the_largest_block_can_use(kinds, build):
    made, _ = blocks(build, kinds, 8)
    assert len(made._workers) == len(kinds) - 1
    assert not made.overlaps_isolated
    made.close()
    made.close()
    assert made._workers == []
    few, _ = blocks(build, "ccc", 2)
    assert [thread.name for thread in few._workers] == ["steps 2"]
    few.close()


@pytest.mark.parametrize(
    ("kinds", "costs", "threaded"),
    [  # times of a step as parts of what makes a thread worth it; those in the block, the longest first
        ("ccc", (1.0, 1.0, 1.0), "abc"),
        ("ccc", (1.0, 2.0, 1.5), "bca"),
        ("ccc", (1.0, 0.9, 2.0), "ca"),
        ("ccc", (1.0, 0.9, 0.9), ""),  # one alone needs no other thread
        ("iic", (1.0, 1.0, 0.1), "ab"),
        ("iic", (1.0, 0.9, 1.0), "ca"),  # those in other processes last
    ],
)
def test_only_members_that_are_expensive_stay_in_a_block(kinds, costs, threaded, build, monkeypatch):
    monkeypatch.setattr(step_threads, "cores", lambda: 2)
    made, steps = blocks(build, kinds, None)
    before = steps.copy()
    (address,) = made.calls
    (block,) = fields(made, address, BLOCK)
    assert (made.is_measuring, block["mode"], made._workers) == (True, MEASURE_SERIAL, [])
    made.decide()
    assert made.is_measuring, "too few steps were measured"
    _, tasks = made._blocks[address]
    order = sorted(range(len(kinds)), key=lambda i: (kinds[i] == "i", i))
    for task, number in zip(tasks, order, strict=True):
        limit = EXPENSIVE_ISOLATED if kinds[number] == "i" else EXPENSIVE
        task["calls"], task["least"] = MEASURED_STEPS, int(limit * costs[number])
    tasks[0]["calls"] = MEASURED_STEPS - 1
    made.decide()
    assert made.is_measuring, "of each member"
    tasks[0]["calls"] = MEASURED_STEPS
    made.decide()
    assert not made.is_measuring
    function = step_threads.native(build)["block_step"]
    assert "".join("abc"[i] for i in range(3) if steps[i, 0] == function) == "".join(sorted(threaded))
    alone = [i for i in range(3) if "abc"[i] not in threaded]
    assert steps[alone, :3].tolist() == [made._plan.steps[i][:3] for i in alone]
    assert set(made.calls) == {address}, "crash reports know it"
    if threaded:
        (block,) = fields(made, address, BLOCK)
        assert (block["count"], block["mode"]) == (len(threaded), RUN)
        tasks = fields(made, address + 8 * len(BLOCK), TASK, len(threaded))
        assert "".join("abc"[task["instance"] - 10] for task in tasks) == threaded
        assert block["first"] == steps[min("abc".index(name) for name in threaded), 2]
    assert (steps[:, 3:] == before[:, 3:]).all()
    made.close()


@pytest.mark.parametrize(
    ("kinds", "costs", "cores", "workers"),
    [
        ("ccc", (1.0, 1.0, 1.0), 3, 2),
        ("ccc", (1.0, 0.0, 1.0), 2, 1),
        ("ccc", (1.0, 0.9, 0.9), 2, 0),  # the first step of one alone
        ("cc", (1.0, 1.0), 1, 0),
        ("cci", (1.0, 1.0, 1.0), 2, 0),  # other processes would be measured with the time of those before them
    ],
)
def test_members_with_clearly_expensive_first_steps_are_measured_at_the_same_time(
    kinds, costs, cores, workers, build, monkeypatch
):
    monkeypatch.setattr(step_threads, "cores", lambda: cores)
    made, steps = blocks(build, kinds, None)
    ((address, (_, tasks)),) = made._blocks.items()
    for task, cost in zip(tasks, costs, strict=True):
        task["calls"], task["least"] = 1, int(FIRST_STEP_FACTOR * EXPENSIVE_ISOLATED * cost)
        if kinds == "ccc":
            task["least"] = int(FIRST_STEP_FACTOR * EXPENSIVE * cost)
    made.decide()
    (block,) = fields(made, address, BLOCK)
    assert (made.is_measuring, len(made._workers)) == (True, workers)
    assert block["mode"] == (MEASURE if workers else MEASURE_SERIAL)
    for task in tasks:
        task["calls"], task["least"] = MEASURED_STEPS, EXPENSIVE - 1
    made.decide()
    assert (made.is_measuring, made._blocks) == (False, {}), "only their first step was expensive"
    assert steps[:, :3].tolist() == [row[:3] for row in made._plan.steps]
    made.close()


def test_on_one_core_only_other_processes_overlap(build, monkeypatch):
    monkeypatch.setattr(step_threads, "cores", lambda: 1)
    for kinds, count in (("cc", 0), ("ii", 1)):
        made, _ = blocks(build, kinds, None)
        ((_, tasks),) = made._blocks.values()
        for task in tasks:
            task["calls"], task["least"] = MEASURED_STEPS, EXPENSIVE_ISOLATED
        made.decide()
        assert (len(made._blocks), made._workers) == (count, [])
        made.close()


@pytest.mark.parametrize("kinds", ["sc", "si", "ss"])
def test_one_member_alone_makes_no_block(kinds, build):
    made, steps = blocks(build, kinds, 8)
    assert (made.calls, made._workers, made.is_measuring) == ({}, [], False)
    assert steps[:, :3].tolist() == [row[:3] for row in made._plan.steps]
    made.close()
