"""State of a co-simulation at a communication point, without addresses: it can be restored in another process.

Restoring takes an initialized co-simulation of the same members, connections and algorithm, in which the same overrides are
in force: addresses are those of its own tables, and only values are replaced.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from twin.coupling.variable_step.record_layout import FLOATS, PROGRESS
from twin.errors import CouplingError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin import clock
    from twin.coupling.cosimulation import CoSimulation
    from twin.coupling.member import Member

LOOP_FIELDS = ("tick", *PROGRESS, *FLOATS)  # of the loop's record


@dataclass(frozen=True)
class SavedState:
    """State of a co-simulation. `fields`: of the loop's record; `blocks`: values that the loop moves; `objects`: strings, binaries.

    `members`: serialized state of each member. `met`: time [ns] and index of each condition that was met.
    """

    fields: Mapping[str, int | float]
    blocks: tuple[bytes, ...]
    members: Mapping[str, bytes]
    objects: Mapping[str, Any]
    met: tuple[tuple[clock.Time, int], ...] = ()


def serialization_problems(members: Mapping[str, Member]) -> list[str]:
    """Return a line for each member whose state cannot be written to a file."""
    problems = {
        name: "it has clocks, whose state is not saved" if member.clocked else member.serialization_problem()
        for name, member in members.items()
    }
    return [f"{name}: cannot be saved in a checkpoint: {problem}." for name, problem in problems.items() if problem]


def save_state(cosimulation: CoSimulation) -> SavedState:
    """Save the state at the communication point reached."""
    state, plan = cosimulation.state, cosimulation.plan
    assert plan.objects is not None
    return SavedState(
        {name: state[name].item() for name in LOOP_FIELDS},
        tuple(block.tobytes() for block in plan.memory.blocks),
        {name: member.serialize() for name, member in cosimulation.members.items()},
        plan.objects.values(),
        tuple(cosimulation.conditions.met),
    )


def restore_state(cosimulation: CoSimulation, saved: SavedState) -> None:
    """Restore a saved state; CouplingError if it is one of other members or of another coupling."""
    state, plan = cosimulation.state, cosimulation.plan
    assert plan.objects is not None
    sizes = [block.nbytes for block in plan.memory.blocks]
    if set(saved.fields) != set(LOOP_FIELDS) or [len(block) for block in saved.blocks] != sizes:
        raise CouplingError("the saved state is of another coupling of the members. Use the scenario that saved it.")
    for name, member in cosimulation.members.items():
        member.deserialize(saved.members[name])
    for block, data in zip(plan.memory.blocks, saved.blocks, strict=True):
        block.view("u1")[:] = memoryview(data)
    plan.objects.restore(saved.objects)
    for name, value in saved.fields.items():
        state[name] = value
    cosimulation.conditions.met = list(saved.met)
    cosimulation.watch.forget()


def published_address(cosimulation: CoSimulation, key: tuple[str, str]) -> int:
    """Return the address of a variable as published at the communication point reached; 0: it has to be read by a call."""
    plan = cosimulation.plan
    return plan.published.get(key) or plan.staged.get(key) or cosimulation.members[key[0]].address(key[1])


def published_copies(cosimulation: CoSimulation, member: str) -> dict[tuple[str, ...], tuple[int, int]]:
    """Return address and words of the published outputs of a member that lie outside of its record, by the names of variables.

    These are outputs of a member with a longer period, and of an FMU, whose adjacent values are one entry.
    """
    plan, instance = cosimulation.plan, cosimulation.members[member]
    addresses = {path: at for (name, path), at in (plan.published | plan.unsplit).items() if name == member}
    copies: dict[tuple[str, ...], tuple[int, int]] = {}
    for _, copy, words in [] if plan.is_read_directly(member) else plan.publishes[member]:
        (path,) = (path for path, address in addresses.items() if copy <= address < copy + 8 * words)
        copies[path,] = copy, words
    blocks: list[
        tuple[tuple[str, ...], int, int]
    ] = []  # of an FMU: names, begin and end; each begins at a word of its own
    for (name, path), address in sorted([*plan.unsplit.items(), *plan.published.items()], key=lambda entry: entry[1]):
        if name != member or instance.address(path) or instance.variables[path].causality == "input":
            continue
        before, begin, _ = blocks.pop() if blocks and blocks[-1][2] == address else ((), address, 0)
        blocks.append(
            ((*before, path), begin, address + instance.variables[path].size * instance.variables[path].dtype.itemsize)
        )
    return copies | {names: (begin, -(-(end - begin) // 8)) for names, begin, end in blocks}
